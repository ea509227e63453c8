"""Linear models of the REMUS vehicle in the steering and in the diving plane (paper 3).

Both planes are x' = A x + B δ with one fin angle δ, built from one table of coefficients
that says where each number comes from. Stability axes: the vehicle moves with the
constant forward speed U, and its centre of mass is not displaced forward (x_G = 0).
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from seanav._compile import kernel
from seanav.checks import ParameterError, array, choice, number


class Coefficient(NamedTuple):
    """A number of the vehicle's model: value, unit, origin and a note on the origin."""

    value: float
    unit: str
    origin: str
    note: str


_TABLES = "Prestero's REMUS tables as found in public code"
_SCRIPT = "a public script that credits Fodrea's revised values"
_FORMULA = "that script's formulas at U = 1.54 m/s, rounded"
_FIN = "fin coefficient divided by 3.5 as in the script; undivided, the steady turn is implausible"

COEFFICIENTS = {
    "m": Coefficient(30.48, "kg", "public source", _TABLES),
    "U": Coefficient(1.54, "m/s", "derived", "the speed at which the formulas give all four"),
    "W": Coefficient(299.0, "N", "public source", _TABLES),
    "I_z": Coefficient(3.45, "kg m²", "public source", _TABLES),
    "Y_vdot": Coefficient(-35.5, "kg", "public source", _TABLES),
    "Y_rdot": Coefficient(1.93, "kg m", "public source", _TABLES),
    "N_vdot": Coefficient(1.93, "kg m", "public source", _TABLES),
    "N_rdot": Coefficient(-4.88, "kg m²", "public source", _TABLES),
    "Y_v": Coefficient(-66.6, "kg/s", "derived", _FORMULA),
    "Y_r": Coefficient(2.2, "kg m/s", "public source", _SCRIPT),
    "N_v": Coefficient(-4.47, "kg m/s", "public source", _SCRIPT),
    "N_r": Coefficient(-6.87, "kg m²/s", "derived", _FORMULA),
    "Y_delta": Coefficient(50.6 / 3.5, "N/rad", "derived", _FIN),
    "N_delta": Coefficient(-34.6 / 3.5, "N m/rad", "derived", _FIN),
    "I_y": Coefficient(3.45, "kg m²", "public source", _TABLES),
    "z_G": Coefficient(0.0196, "m", "public source", _TABLES),
    "Z_wdot": Coefficient(-35.5, "kg", "public source", _TABLES),
    "Z_qdot": Coefficient(-1.93, "kg m", "public source", _TABLES),
    "M_wdot": Coefficient(-1.93, "kg m", "public source", _TABLES),
    "M_qdot": Coefficient(-4.88, "kg m²", "public source", _TABLES),
    "Z_w": Coefficient(-66.6, "kg/s", "public source", _FORMULA),
    "Z_q": Coefficient(2.2, "kg m/s", "public source", _SCRIPT),
    "M_w": Coefficient(-9.3, "kg m/s", "public source", _SCRIPT),
    "M_q": Coefficient(-6.87, "kg m²/s", "public source", _FORMULA),
    "Z_delta": Coefficient(-50.6, "N/rad", "public source", _FORMULA),
    "M_delta": Coefficient(-34.6, "N m/rad", "public source", _FORMULA),
}


@dataclass(frozen=True, eq=False)
class Plane:
    """One plane of motion, x' = A x + B δ.

    Attributes
    ----------
    name : str
        ``"steering"`` or ``"diving"``, with ``"in our copy"`` where it is.
    states, units : tuple of str
        Names and SI units of the states.
    A : ndarray (n, n)
        Dynamics, 1/s between states in SI units.
    B : ndarray (n,)
        Effect of the fin angle, per second and radian.
    """

    name: str
    states: tuple
    units: tuple
    A: np.ndarray
    B: np.ndarray

    def __post_init__(self):
        n = len(self.states)
        object.__setattr__(self, "A", array("A", self.A, (n, n)))
        object.__setattr__(self, "B", array("B", self.B, (n,)))

    def discretise(self, dt: float, method: str = "euler") -> tuple[np.ndarray, ...]:
        """Return Phi (n, n) and the effect (n,) of a fin angle that is held for `dt` seconds.

        Parameters
        ----------
        dt : float
            Step, s.
        method : {"euler", "exact"}
            (7) and (13) of the paper, or the exponential of the dynamics.

        Raises
        ------
        seanav.checks.ParameterError
            If `dt` is not positive or `method` is unknown.
        """
        dt = number("dt", dt, above=0)
        choice("discretisation", method, ("euler", "exact"))
        n = len(self.B)
        if method == "euler":
            return np.eye(n) + dt * self.A, dt * self.B
        # The fin angle is one more state that does not change during the step.
        joined = np.zeros((n + 1, n + 1))
        joined[:n, :n], joined[:n, n] = self.A, self.B
        whole = expm(dt * joined)
        return np.ascontiguousarray(whole[:n, :n]), np.ascontiguousarray(whole[:n, n])

    def euler_limit(self) -> float:
        """Return the step in s above which Euler's rule makes a decaying mode grow.

        |1 + λ dt| < 1 holds for dt < −2 Re λ / |λ|². Modes that do not decay themselves
        (an integrated angle or depth) set no limit.
        """
        modes = np.linalg.eigvals(self.A)
        modes = modes[modes.real < -1e-9]
        return float(np.min(-2 * modes.real / np.abs(modes) ** 2, initial=np.inf))


def _values(changes):
    for name in changes:
        choice("coefficient", name, COEFFICIENTS)
    values = {name: coefficient.value for name, coefficient in COEFFICIENTS.items()}
    return values | {name: number(name, value) for name, value in changes.items()}


def _plane(name, states, units, mass, damping, fin):
    mass, damping, fin = (np.array(part, dtype=float) for part in (mass, damping, fin))
    if np.linalg.matrix_rank(mass) < len(fin):
        raise ParameterError("coefficients", name, "must give a mass matrix that is not singular")
    return Plane(name, states, units, np.linalg.solve(mass, damping), np.linalg.solve(mass, fin))


_STEERING = (("v", "r", "psi"), ("m/s", "rad/s", "rad"))
_DIVING = (("w", "q", "theta", "z"), ("m/s", "rad/s", "rad", "m"))


def steering(**changes: Any) -> Plane:
    """Return the steering plane, states v, r, ψ: (8) with its printing errors mended.

    Parameters
    ----------
    **changes : float
        Coefficients that replace those of the table `COEFFICIENTS`.

    Returns
    -------
    Plane

    Raises
    ------
    seanav.checks.ParameterError
        If a coefficient is unknown, not finite, or leaves the mass matrix singular.
    """
    c = _values(changes)
    mass = [[c["m"] - c["Y_vdot"], -c["Y_rdot"], 0], [-c["N_vdot"], c["I_z"] - c["N_rdot"], 0]]
    damping = [[c["Y_v"], c["Y_r"] - c["m"] * c["U"], 0], [c["N_v"], c["N_r"], 0], [0, 1, 0]]
    fin = [c["Y_delta"], c["N_delta"], 0]
    return _plane("steering", *_STEERING, [*mass, [0, 0, 1]], damping, fin)


def diving(**changes: Any) -> Plane:
    """Return the diving plane, states w, q, θ, z: (1) with its printing errors mended.

    Parameters, result and errors as for `steering`.
    """
    c = _values(changes)
    mass = [
        [c["m"] - c["Z_wdot"], -c["Z_qdot"], 0, 0],
        [-c["M_wdot"], c["I_y"] - c["M_qdot"], 0, 0],
        [0, 0, 1, 0],
        [0, 0, 0, 1],
    ]
    damping = [
        [c["Z_w"], c["Z_q"] + c["m"] * c["U"], 0, 0],
        [c["M_w"], c["M_q"], -c["z_G"] * c["W"], 0],
        [0, 1, 0, 0],
        [1, 0, -c["U"], 0],
    ]
    return _plane("diving", *_DIVING, mass, damping, [c["Z_delta"], c["M_delta"], 0, 0])


# What the paper prints, kept entry by entry to show what it does; never used by a study.
# Each entry is an expression in the names of the table above.
PRINTED: dict[str, dict[str, Any]] = {
    "steering": {
        "mass": [["m - Y_vdot", "-Y_r", "0"], ["-N_vdot", "I_z - N_rdot", "0"], ["0", "0", "1"]],
        "damping": [["Y_v", "Y_r - m*U", "0"], ["N_v", "N_r", "0"], ["0", "0", "1"]],
        "fin": ["Y_delta", "N_delta", "0"],
    },
    "diving": {
        "mass": [
            ["m - Z_wdot", "-Z_qdot", "0", "0"],
            ["-M_wdot", "I_y - M_qdot", "0", "0"],
            ["0", "0", "1", "0"],
            ["0", "0", "0", "1"],
        ],
        "damping": [
            ["Z_w", "Z_q - m*U", "0", "0"],
            ["M_w", "M_q", "-z_G*W", "0"],
            ["0", "1", "0", "0"],
            ["1", "0", "-U", "1"],
        ],
        "fin": ["Z_delta", "M_delta", "0", "0"],
    },
}


def as_printed(name: str) -> Plane:
    """Return the steering or diving `Plane` with the matrices exactly as in our copy.

    The left sides, which print ψ and θ for their derivatives, are read as derivatives;
    anything else leaves no equation for that row.
    """
    choice("plane", name, PRINTED)
    values = _values({})

    def evaluate(entry):
        return sum(_term(term, values) for term in entry.replace("- ", "+ -").split("+ "))

    parts = PRINTED[name]
    mass = [[evaluate(entry) for entry in row] for row in parts["mass"]]
    damping = [[evaluate(entry) for entry in row] for row in parts["damping"]]
    fin = [evaluate(entry) for entry in parts["fin"]]
    labels = _STEERING if name == "steering" else _DIVING
    return _plane(f"{name} in our copy", labels[0], labels[1], mass, damping, fin)


def _term(text, values):
    text = text.strip()
    sign = -1.0 if text.startswith("-") else 1.0
    factors = text.removeprefix("-").split("*")
    return sign * float(np.prod([values.get(f) if f in values else float(f) for f in factors]))


@kernel
def _simulate(Phi, offsets, noise, x0, out):
    steps, n, runs = noise.shape
    for k in range(steps):
        for i in range(n):
            row = out[k, i]
            for r in range(runs):
                row[r] = offsets[k, i] + noise[k, i, r]
            for j in range(n):
                gain = Phi[i, j]
                if gain != 0.0:
                    before = x0[j] if k == 0 else out[k - 1, j]
                    for r in range(runs):
                        row[r] += gain * before[r]


def simulate(Phi: ArrayLike, offsets: ArrayLike, noise: ArrayLike, x0: ArrayLike) -> np.ndarray:
    """Return the states x_k = Phi x_{k-1} + offset_k + noise_k for a batch of runs.

    Parameters
    ----------
    Phi : array (n, n)
        Transition over one step.
    offsets : array (steps, n)
        What the input adds during each step, the same in all runs.
    noise : array (runs, steps, n)
        Process noise.
    x0 : array (runs, n)
        States before the first step, which are not returned.

    Returns
    -------
    ndarray (runs, steps, n)
        A view whose memory has the runs innermost.

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit or a number is not finite.
    """
    sizes = {}
    Phi = array("Phi", Phi, ("states", "states"), sizes)
    offsets = array("offsets", offsets, ("steps", "states"), sizes)
    noise = array("noise", noise, ("runs", "steps", "states"), sizes, contiguous=False)
    x0 = array("x0", x0, ("runs", "states"), sizes)
    noise = np.ascontiguousarray(noise.transpose(1, 2, 0))
    out = np.empty_like(noise)
    _simulate(Phi, offsets, noise, np.ascontiguousarray(x0.T), out)
    return out.transpose(2, 0, 1)
