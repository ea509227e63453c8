"""Path planning by A* over the posterior Cramér-Rao bound, as in paper 5.

Each cell of the grid keeps one label: the cost and the covariance of the cheapest path
found to it so far. Both depend on the path, so the result is not guaranteed to be the
optimum; `seanav.filters.gravity.labels` keeps several labels per cell.
"""

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from seanav import checks
from seanav._compile import kernel
from seanav.filters.gravity.pcrb import _update, deviation, pcrb


@dataclass(frozen=True)
class Plan:
    """A planned path.

    Attributes
    ----------
    nodes : (k, 2) ndarray of int
        Nodes (east, north) from start to goal.
    covariance : (k, 2, 2) ndarray
        Bound at each node, m²; the first is `P0`.
    cost : float
        Sum of the traces of the bound over all nodes after the start, m².
    expanded : int
        Cells taken from the open list, the goal's included.
    reopenings : int
        How often a closed cell was reached again at a smaller cost, and left closed.
    """

    nodes: np.ndarray
    covariance: np.ndarray
    cost: float
    expanded: int
    reopenings: int


@kernel
def _step(ee, en, nn, slope_e, slope_n, R, q):
    """Return ee, en, nn after the process noise q per axis and the measurement at a cell."""
    return _update(ee + q, en, nn + q, slope_e, slope_n, R)


@kernel
def _sound(ee, en, nn):
    """Tell whether a covariance is finite, and positive definite whatever rounding did.

    Of the determinant, rounding takes some 1e-16 of the product of the variances; what is
    left below 1e-12 of it decides nothing.
    """
    product = ee * nn
    return ee > 0.0 and nn > 0.0 and product < np.inf and product - en * en > 1e-12 * product


def _refuse(noise, P0, process_noise, speed):
    """Raise the `ParameterError` of a search that met a covariance which is not `_sound`."""
    values = (noise, np.asarray(P0).tolist(), process_noise, speed)
    allowed = "must leave every covariance finite and positive definite in double precision"
    raise checks.ParameterError("noise, P0, process_noise, speed", values, allowed)


@kernel
def _search(gradient, start, goal, R, P0, q, heuristic_rate):
    # Cells are numbered along the rows. Ties in F go to the smaller number, ties in G to
    # the parent that was expanded first. A cell is expanded once, so the search ends; its
    # parent was expanded before it, so the parents lead back to the start. Both need costs
    # that are numbers and grow along a path; where they are not, the goal's cost is NaN.
    north, east = gradient.shape[1:]
    cells = north * east
    G = np.full(cells, np.inf)
    P = np.zeros((cells, 3))
    parent = np.full(cells, -1)
    closed = np.zeros(cells, np.bool_)
    goal_i, goal_j = goal // east, goal % east
    G[start] = 0.0
    P[start] = P0[0, 0], P0[0, 1], P0[1, 1]
    heap = [(0.0, start)]
    expanded, reopenings = 0, 0
    while len(heap) > 0:
        cell = heapq.heappop(heap)[1]
        if closed[cell]:
            continue  # an entry made before the cell was reached more cheaply
        closed[cell] = True
        expanded += 1
        if cell == goal:
            break
        i, j = cell // east, cell % east
        for di in range(-1, 2):
            for dj in range(-1, 2):
                ni, nj = i + di, j + dj
                inside = 0 <= ni < north and 0 <= nj < east
                if not inside or (di == 0 and dj == 0):
                    continue
                q_step = q[1] if di != 0 and dj != 0 else q[0]
                east_slope, north_slope = gradient[0, ni, nj], gradient[1, ni, nj]
                ee, en, nn = P[cell, 0], P[cell, 1], P[cell, 2]
                ee, en, nn = _step(ee, en, nn, east_slope, north_slope, R, q_step)
                cost = G[cell] + ee + nn
                if not (_sound(ee, en, nn) and cost < np.inf):
                    return np.nan, parent, expanded, reopenings
                other = ni * east + nj
                if closed[other]:
                    reopenings += cost < G[other]
                elif cost < G[other]:
                    G[other] = cost
                    P[other] = ee, en, nn
                    parent[other] = cell
                    to_goal = np.sqrt(float((ni - goal_i) ** 2 + (nj - goal_j) ** 2))
                    heapq.heappush(heap, (cost + heuristic_rate * to_goal, other))
    return G[goal], parent, expanded, reopenings


@dataclass(frozen=True)
class Problem:
    """A checked planning problem, in the form that the kernels take."""

    gradient: np.ndarray  # (2, north, east)
    start: int  # cell numbers, along the rows
    goal: int
    noise: float
    P0: np.ndarray
    q: np.ndarray  # (2,) process noise of a straight and a diagonal step, m²

    @property
    def R(self) -> float:
        """Variance of the measurement."""
        return self.noise**2

    def nodes(self, cells: np.ndarray) -> np.ndarray:
        """Return the nodes (east, north) of cell numbers."""
        return np.column_stack([cells % self.gradient.shape[2], cells // self.gradient.shape[2]])

    def bound(self, nodes: np.ndarray) -> np.ndarray:
        """Return the bound (k, 2, 2) along adjacent nodes (k, 2)."""
        diagonal = np.abs(np.diff(nodes, axis=0)).min(axis=1)
        q = np.concatenate([[0.0], self.q[diagonal]])
        slopes = self.gradient[:, nodes[:, 1], nodes[:, 0]].T
        return pcrb(slopes, self.noise, self.P0, q[:, None, None] * np.eye(2))


def problem(
    gradient: ArrayLike,
    spacing: float,
    start: ArrayLike,
    goal: ArrayLike,
    noise: float,
    P0: ArrayLike,
    process_noise: float,
    speed: float,
) -> Problem:
    """Check the parameters of `plan` and return them as a `Problem`."""
    gradient = checks.array("gradient", gradient, (2, "north", "east"))
    cells = [_cell(name, node, gradient) for name, node in (("start", start), ("goal", goal))]
    if cells[0] == cells[1]:
        raise checks.ParameterError("goal", goal, "must differ from the start")
    spacing = checks.number("spacing", spacing, above=0)
    seconds = spacing / checks.number("speed", speed, above=0)
    rate = checks.number("process_noise", process_noise, at_least=0)
    noise, P0 = deviation(noise), checks.covariance("P0", P0, 2, definite=True)
    if not _sound(P0[0, 0], P0[0, 1], P0[1, 1]):
        _refuse(noise, P0, process_noise, speed)
    q = rate * seconds * np.array([1.0, np.sqrt(2.0)])
    return Problem(gradient, cells[0], cells[1], noise, P0, q)


def _cell(name, node, gradient):
    north, east = gradient.shape[1:]
    try:
        i, j = (checks.integer(name, part, at_least=0) for part in reversed(node))
    except (TypeError, ValueError):
        i, j = -1, -1
    if not (0 <= i < north and 0 <= j < east):
        allowed = f"must lie on the map, [0 … {east - 1}, 0 … {north - 1}]"
        raise checks.ParameterError(name, node, allowed)
    return i * east + j


def plan(
    gradient: ArrayLike,
    spacing: float,
    start: ArrayLike,
    goal: ArrayLike,
    noise: float,
    P0: ArrayLike,
    process_noise: float,
    speed: float,
) -> Plan:
    """Plan a path with the A* of paper 5 over eight neighbours.

    G sums the trace of the bound over the nodes after the start, the heuristic is the
    trace that the process noise alone would add on the straight line to the goal, and
    each cell keeps the covariance of its cheapest path (equations 23 to 30). The
    pseudo-code of the paper is an image that is lost; this is the textbook algorithm:
    an open cell reached at a smaller G is replaced, a closed one is left alone.

    Parameters
    ----------
    gradient : (2, north, east) ndarray
        Slopes of the map to the east and to the north, (m/s²)/m.
    spacing : float
        Spacing of the grid, m.
    start, goal : (2,) sequence of int
        Nodes (east, north).
    noise : float
        Standard deviation of the gravity measurement, m/s².
    P0 : (2, 2) ndarray
        Position covariance (east, north) at the start, m².
    process_noise : float
        Growth of the position variance per axis, m²/s.
    speed : float
        Speed of the vehicle, m/s.

    Returns
    -------
    Plan

    Raises
    ------
    ParameterError
        If a node is off the map, start and goal are equal, a value is not usable, or a
        covariance is finite and positive definite no more in double precision.
    """
    task = problem(gradient, spacing, start, goal, noise, P0, process_noise, speed)
    heuristic_rate = 2.0 * task.q[0]  # per step of one spacing; the trace counts two axes
    cost, parent, expanded, reopenings = _search(
        task.gradient, task.start, task.goal, task.R, task.P0, task.q, heuristic_rate
    )
    if np.isnan(cost):
        _refuse(noise, P0, process_noise, speed)
    cells = [task.goal]
    for _ in parent:  # a path has no more nodes than the map
        if cells[-1] == task.start:
            break
        cells.append(parent[cells[-1]])
    nodes = task.nodes(np.array(cells[::-1]))
    return Plan(nodes, task.bound(nodes), cost, expanded, reopenings)
