"""The Fokker–Planck equation of two states on a dense grid: a reference for closed moments."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse.linalg import splu

from seanav import checks

MAX_NODES, MAX_STEPS = 401, 100_000
TINY = 1e-9  # of a half width


@dataclass(frozen=True, eq=False)
class Density:
    """A density of two states on a grid: `p` (nx, ny) at the nodes `x`, `y`."""

    x: np.ndarray
    y: np.ndarray
    p: np.ndarray

    def moments(self) -> tuple[np.ndarray, ...]:
        """Return mean (2,), covariance (2, 2) and third central moments of both axes (2,)."""
        p = self.p / self.p.sum()
        grid = np.meshgrid(self.x, self.y, indexing="ij")
        mean = np.array([(g * p).sum() for g in grid])
        off = [g - m for g, m in zip(grid, mean, strict=True)]
        P = np.array([[(a * b * p).sum() for a in off] for b in off])
        return mean, P, np.array([(a**3 * p).sum() for a in off])


def fokker_planck(
    drift: Callable,
    spread: ArrayLike,
    mean: ArrayLike,
    P: ArrayLike,
    duration: float,
    half_widths: ArrayLike,
    nodes: int = 121,
    steps: int = 200,
) -> Density:
    """Solve the Fokker–Planck equation of two states on a dense grid.

    Finite volumes with centred fluxes, nothing flows through the border; Crank–Nicolson
    in time. Second order in both.

    Parameters
    ----------
    drift : callable
        (x, y) -> (f, g), on arrays.
    spread : sequence of 2 floats
        Diagonal of G Gᵀ.
    mean, P : ndarray, shapes (2,), (2, 2)
        Gaussian start.
    duration : float
        s.
    half_widths : sequence of 2 floats
        Of the grid about the start's mean.
    nodes, steps : int
        Per axis, 3 to `MAX_NODES`; in time, at most `MAX_STEPS`.

    Raises
    ------
    seanav.checks.ParameterError
        If a shape does not fit, a number is not finite or allowed, or P is no covariance.
    """
    spread = checks.array("spread", spread, (2,), at_least=0)
    mean, P = checks.array("mean", mean, (2,)), checks.covariance("P", P, 2, definite=True)
    half_widths = checks.array("half_widths", half_widths, (2,), at_least=TINY)
    duration = checks.number("duration", duration, above=0)
    nodes = checks.integer("nodes", nodes, at_least=3, at_most=MAX_NODES)
    steps = checks.integer("steps", steps, at_least=1, at_most=MAX_STEPS)
    axes = [m + np.linspace(-w, w, nodes) for m, w in zip(mean, half_widths, strict=True)]
    operator = sparse.csc_array((nodes**2, nodes**2))
    for axis in (0, 1):
        h = axes[axis][1] - axes[axis][0]
        middles = list(axes)
        middles[axis] = axes[axis][:-1] + h / 2
        speed = drift(*np.meshgrid(*middles, indexing="ij"))[axis].ravel()
        ones = np.ones(nodes)
        average = sparse.diags_array([ones / 2, ones / 2], offsets=[0, 1], shape=(nodes - 1, nodes))
        slope = sparse.diags_array([-ones / h, ones / h], offsets=[0, 1], shape=(nodes - 1, nodes))
        same = sparse.eye_array(nodes)
        average, slope = (
            sparse.kron(part, same) if axis == 0 else sparse.kron(same, part)
            for part in (average, slope)
        )
        flux = sparse.diags_array(speed) @ average - 0.5 * spread[axis] * slope
        # slopeᵀ is minus the divergence: what leaves a cell enters its neighbour.
        operator = operator + slope.T @ flux
    dt = duration / steps
    same = sparse.eye_array(nodes**2)
    solve = splu(sparse.csc_array(same - 0.5 * dt * operator)).solve
    forward = sparse.csr_array(same + 0.5 * dt * operator)
    offset = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1) - mean
    p = np.exp(-0.5 * np.einsum("xyi,ij,xyj->xy", offset, np.linalg.inv(P), offset)).ravel()
    p /= p.sum()
    for _ in range(steps):
        p = solve(forward @ p)
    return Density(axes[0], axes[1], p.reshape(nodes, nodes))
