"""From error states to nominal states and back."""

import numpy as np
from numpy.typing import ArrayLike

from seanav._compile import kernel
from seanav.checks import array, number
from seanav.filters.ins.layout import B_A, LANES, NOMINAL, PHI, QUATERNION, X_B_A, N
from seanav.models import attitude


@kernel
def _quaternion(x, r):
    """Return the quaternion of run `r` of nominal states x (17, runs)."""
    return x[QUATERNION, r], x[QUATERNION + 1, r], x[QUATERNION + 2, r], x[QUATERNION + 3, r]


@kernel
def _set_quaternion(x, r, q):
    """Put `q` into run `r` of nominal states x (17, runs)."""
    x[QUATERNION, r], x[QUATERNION + 1, r] = q[0], q[1]
    x[QUATERNION + 2, r], x[QUATERNION + 3, r] = q[2], q[3]


@kernel
def _shift(x, e, sign):
    # See `shift`; x is changed.
    for r in range(LANES):
        for i in range(PHI):
            x[i, r] += sign * e[i, r]
        # An estimate with error phi is (I − [phi×]) C: adding an error turns by −phi.
        to = -0.5 * sign
        half = (to * e[PHI, r], to * e[PHI + 1, r], to * e[PHI + 2, r])
        turn = attitude._from_half_angles(half)
        _set_quaternion(x, r, attitude._multiply(turn, _quaternion(x, r)))
        for i in range(N - B_A):
            x[X_B_A + i, r] += sign * e[B_A + i, r]


def shift(x: ArrayLike, e: ArrayLike, sign: float = 1.0) -> np.ndarray:
    """Return nominal states moved by error states.

    Parameters
    ----------
    x : array (17, LANES)
        Nominal states.
    e : array (16, LANES)
        Error states.
    sign : float
        +1 adds the errors, -1 takes them away.

    Returns
    -------
    ndarray (17, LANES)

    Raises
    ------
    seanav.checks.ParameterError
        If a shape does not fit or a number is not finite.
    """
    moved = array("x", x, (NOMINAL, LANES)).copy()
    _shift(moved, array("e", e, (N, LANES)), number("sign", sign))
    return moved


@kernel
def _difference(x, reference, e):
    """Write the error states of x relative to `reference`, (17, runs) each, into e (16, runs)."""
    for r in range(LANES):
        for i in range(PHI):
            e[i, r] = x[i, r] - reference[i, r]
        back = attitude._conjugate(_quaternion(reference, r))
        w, a, b, c = attitude._multiply(_quaternion(x, r), back)
        scale = -2.0 if w > 0.0 else 2.0  # a quaternion and its negative are one attitude
        e[PHI, r], e[PHI + 1, r], e[PHI + 2, r] = scale * a, scale * b, scale * c
        for i in range(N - B_A):
            e[B_A + i, r] = x[X_B_A + i, r] - reference[X_B_A + i, r]
