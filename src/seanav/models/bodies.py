"""A rigid body in water with six velocities, in symbols: torpedo and sphere.

The state is x = (u, v, w, p, q, r), the velocities in the body frame (forward, right,
down; m/s and rad/s). Neutrally buoyant, centre of gravity at the centre of buoyancy,
added mass included:

    M v' = (M v) × ω + τ − drag,    J ω' = (J ω) × ω + (M v) × v + τ − drag.

A module apart from `seanav.models.vehicles`, which holds numbers and kernels of one
steered vehicle: here nothing is numeric until `seanav.filters.moments` compiles it,
and simulation and every filter use the same symbols.
"""

from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

STATES = ("u", "v", "w", "p", "q", "r")
INPUTS = tuple(f"tau{i}" for i in range(1, 7))
MASSES = ("m1", "m2", "m3", "j1", "j2", "j3")
DRAGS = tuple(f"{kind}{i}" for kind in ("a", "c") for i in range(1, 7))
NOISES = tuple(f"g{i}" for i in range(1, 7))


def equations(quadratic_drag: bool = False) -> tuple[sp.Matrix, sp.Matrix, tuple[str, ...]]:
    """Return drift and diffusion of the body, (6, 1) and (6, 6) SymPy matrices.

    Parameters
    ----------
    quadratic_drag : bool
        Drag a x + b x|x| + c x³ with b1 … b6 more parameters; else a x + c x³.

    Returns
    -------
    drift, diffusion : Matrix
    parameters : tuple of str
        Names: m1 m2 m3 (kg), j1 j2 j3 (kg m²), a1 … a6, c1 … c6, g1 … g6 (on x, per √s)
        and b1 … b6, the order of a parameter vector.
    """
    symbol = {name: sp.Symbol(name, real=True) for name in (*STATES, *INPUTS, *MASSES)}
    names = (*MASSES, *DRAGS, *NOISES)
    if quadratic_drag:
        names += tuple(f"b{i}" for i in range(1, 7))
    symbol |= {name: sp.Symbol(name, real=True) for name in names}
    v, omega = (sp.Matrix([symbol[x] for x in STATES[k : k + 3]]) for k in (0, 3))
    mass, inertia = (sp.diag(*(symbol[x] for x in MASSES[k : k + 3])) for k in (0, 3))
    force = (mass * v).cross(omega)
    moment = (inertia * omega).cross(omega) + (mass * v).cross(v)
    drift = []
    for i, entry in enumerate([*force, *moment]):
        x, a, c = symbol[STATES[i]], symbol[f"a{i + 1}"], symbol[f"c{i + 1}"]
        drag = a * x + c * x**3
        if quadratic_drag:
            drag += symbol[f"b{i + 1}"] * x * sp.Abs(x)
        drift.append(sp.expand((entry + symbol[INPUTS[i]] - drag) / symbol[MASSES[i]]))
    return sp.Matrix(drift), sp.diag(*(symbol[x] for x in NOISES)), names


@dataclass(frozen=True)
class Body:
    """Numbers of one vehicle, SI.

    Attributes
    ----------
    name : str
    mass, inertia : tuple of 3
        Added mass included, kg and kg m².
    linear, cubic : tuple of 6
        Drag coefficients.
    inputs : tuple of 6
        Amplitudes τ0, N and N m.
    noise : tuple of 6
        Diffusion of each state per √s.
    """

    name: str
    mass: tuple
    inertia: tuple
    linear: tuple
    cubic: tuple
    inputs: tuple
    noise: tuple

    def parameters(self, noise: ArrayLike | None = None) -> np.ndarray:
        """Return the parameter vector in the order of `equations`, shape (24,)."""
        noise = self.noise if noise is None else noise
        parts = (self.mass, self.inertia, self.linear, self.cubic, noise)
        return np.concatenate([np.asarray(part, dtype=float) for part in parts])

    def fastest(self) -> float:
        """Return the time constant of the axis that its linear drag slows down first, s."""
        inertias = zip((*self.mass, *self.inertia), self.linear, strict=True)
        return min(inertia / drag for inertia, drag in inertias)

    def forces(self, times: np.ndarray) -> np.ndarray:
        """Return the inputs τ0 (1 + 0.5 sin 0.3 t), shape (times, 6)."""
        return (1.0 + 0.5 * np.sin(0.3 * np.asarray(times)))[:, None] * np.asarray(self.inputs)


TORPEDO = Body(
    "torpedo",
    mass=(31.41, 65.98, 65.98),
    inertia=(0.2474, 8.33, 8.33),
    linear=(5.0, 66.6, 66.6, 1.0, 6.87, 6.87),
    cubic=(3.0, 50.0, 50.0, 1.0, 20.0, 20.0),
    inputs=(12.0, 4.0, -3.0, 0.02, 0.3, -0.5),
    noise=(0.1, 0.1, 0.1, 0.2, 0.2, 0.2),
)

SPHERE = Body(
    "sphere",
    mass=(196.55, 196.55, 196.55),
    inertia=(5.46, 5.29, 5.72),
    linear=(27.0273, 27.0273, 27.0273, 13.7935, 13.7935, 11.9424),
    cubic=(897.6553, 897.6553, 897.6553, 6.4592, 6.4592, 6.9393),
    inputs=(30.0, 8.0, -6.0, 0.4, -0.5, 2.0),
    noise=(0.03, 0.03, 0.03, 0.12, 0.12, 0.12),
)
BODIES = {body.name: body for body in (TORPEDO, SPHERE)}
