"""From error states to nominal states and back."""

from seanav._compile import kernel
from seanav.filters.ins.layout import B_A, LANES, PHI, QUATERNION, X_B_A, N
from seanav.models import attitude


@kernel
def quaternion(x, r):
    """Return the quaternion of run `r` of nominal states x (17, runs)."""
    return x[QUATERNION, r], x[QUATERNION + 1, r], x[QUATERNION + 2, r], x[QUATERNION + 3, r]


@kernel
def set_quaternion(x, r, q):
    """Put `q` into run `r` of nominal states x (17, runs)."""
    x[QUATERNION, r], x[QUATERNION + 1, r] = q[0], q[1]
    x[QUATERNION + 2, r], x[QUATERNION + 3, r] = q[2], q[3]


@kernel
def shift(x, e, sign):
    """Move nominal states x (17, runs) by error states e (16, runs): sign +1 adds them."""
    for r in range(LANES):
        for i in range(PHI):
            x[i, r] += sign * e[i, r]
        # An estimate with error phi is (I − [phi×]) C: adding an error turns by −phi.
        to = -0.5 * sign
        half = (to * e[PHI, r], to * e[PHI + 1, r], to * e[PHI + 2, r])
        turn = attitude.from_half_angles(half)
        set_quaternion(x, r, attitude.multiply(turn, quaternion(x, r)))
        for i in range(N - B_A):
            x[X_B_A + i, r] += sign * e[B_A + i, r]


@kernel
def difference(x, reference, e):
    """Write the error states of x relative to `reference`, (17, runs) each, into e (16, runs)."""
    for r in range(LANES):
        for i in range(PHI):
            e[i, r] = x[i, r] - reference[i, r]
        back = attitude.conjugate(quaternion(reference, r))
        w, a, b, c = attitude.multiply(quaternion(x, r), back)
        scale = -2.0 if w > 0.0 else 2.0  # a quaternion and its negative are one attitude
        e[PHI, r], e[PHI + 1, r], e[PHI + 2, r] = scale * a, scale * b, scale * c
        for i in range(N - B_A):
            e[B_A + i, r] = x[X_B_A + i, r] - reference[X_B_A + i, r]
