"""Path planning over the posterior Cramér-Rao bound with several labels per cell.

The cost of going on depends on the covariance with which a cell is reached, so one label
per cell (`seanav.filters.gravity.planning`) can throw the optimum away. Here a label (G, P) is
discarded only if another one at its cell has G₁ ≤ G₂ and P₁ ⪯ (1 + ε) P₂. The recursion
is monotone in P, so with ε = 0 no better walk is ever lost; with ε > 0 the result is a
better path, not an optimum.

The search is ordered by F = G + h with a lower bound h of the remaining cost. Let J = P⁻¹
at a cell, d its Chebyshev distance to the goal, and u, v orthonormal. Every walk to the
goal has at least d more steps. Without process noise, which only adds, its covariance
after k of them is (J + Σ g gᵀ/R)⁻¹ with the slopes g of the k cells entered, and
eᵀA⁻¹e ≥ 1/(eᵀAe) (Cauchy-Schwarz) for e = u and e = v. With S_k^e the largest Σ (eᵀg)²/R
over all walks of k steps from the cell,

    h = Σ_{k=1…d} max over pairs (u, v) of Σ_{e=u,v} 1/(eᵀJe + S_k^e).

h falls by at most the trace of the new bound along a step: S_k^e ≥ (eᵀg)²/R + S_{k−1}^e
of the cell entered, and J grows there by at most g gᵀ/R. So F never falls along a walk,
and the smallest F among the open labels bounds every walk that is not finished.
"""

import heapq
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from seanav import checks
from seanav._compile import kernel
from seanav.filters.gravity.planning import Plan, _refuse, _sound, _step, plan, problem

# Eight directions 22.5° apart; directions m and m + 4 are an orthonormal pair.
_EAST = np.cos(np.pi / 8 * np.arange(8))
_NORTH = np.sin(np.pi / 8 * np.arange(8))

# Equal covariances differ by rounding when the same cells are visited in another order.
_ROUNDING = 1e-12

# What a search and its table may take, whatever the numbers: a label is 73 bytes, half as
# much again while the store grows (230 MB); the table is 32 bytes per cell and length.
MOST_LABELS = 2**21
MOST_TABLE_BYTES = 2**30

_LIMITS = ("", "expansions", "labels", "comparisons")
_UNSOUND = -1


@dataclass(frozen=True)
class LabelPlan:
    """A path planned with several labels per cell.

    Attributes
    ----------
    nodes : (k, 2) ndarray of int
        Nodes (east, north) from start to goal; a walk, cells may come twice.
    covariance : (k, 2, 2) ndarray
        Bound at each node, m²; the first is `P0`.
    cost : float
        Sum of the traces of the bound over all nodes after the start, m².
    lower_bound : float
        No walk from start to goal costs less than this, m² (up to rounding, 1e-9 of it).
    stopped_by : str
        The limit that the search met before its end: "expansions", "labels", "comparisons",
        or "" if it came to its end.
    expanded : int
        Labels taken from the open list.
    labels : int
        Labels stored.
    comparisons : int
        Pairs of labels that were compared; they take most of the time.
    """

    nodes: np.ndarray
    covariance: np.ndarray
    cost: float
    lower_bound: float
    stopped_by: str
    expanded: int
    labels: int
    comparisons: int

    @property
    def complete(self) -> bool:
        """Whether the search came to its end."""
        return not self.stopped_by


@kernel
def _gain_table(gradient, table):
    north, east, steps = table.shape[:3]
    padded = np.full((north + 2, east + 2), -np.inf)  # a border that no walk enters
    gain = np.empty((north, east))
    for e in range(8):
        best = np.zeros((north, east))
        for i in range(north):
            for j in range(east):
                gain[i, j] = (_EAST[e] * gradient[0, i, j] + _NORTH[e] * gradient[1, i, j]) ** 2
        for k in range(steps):
            for i in range(north):
                for j in range(east):
                    padded[i + 1, j + 1] = gain[i, j] + best[i, j]
            for i in range(north):
                for j in range(east):
                    above = max(padded[i, j], padded[i, j + 1], padded[i, j + 2])
                    below = max(padded[i + 2, j], padded[i + 2, j + 1], padded[i + 2, j + 2])
                    most = max(above, below, padded[i + 1, j], padded[i + 1, j + 2])
                    best[i, j] = most
                    # Rounded up: a bound from below needs a gain from above.
                    table[i, j, k, e] = np.nextafter(np.float32(most), np.float32(np.inf))


def gain_table(gradient: ArrayLike) -> np.ndarray:
    """Tabulate how much a walk can learn: R S_k^e for every cell, length and direction.

    Parameters
    ----------
    gradient : (2, north, east) ndarray
        Slopes of the map to the east and to the north, (m/s²)/m.

    Returns
    -------
    (north, east, steps, 8) ndarray of float32
        The largest sum of (eᵀ∇h)² over all walks of 1, 2, … steps from the cell, the cell
        itself not counted, rounded up. It serves every start, goal and noise.

    Raises
    ------
    ParameterError
        If `gradient` is no finite array of that shape, or the table of such a map would
        take more than `MOST_TABLE_BYTES`, as from some 320 × 320 nodes.
    """
    gradient = checks.array("gradient", gradient, (2, "north", "east"))
    shape = _table_shape(gradient)
    size = 4 * math.prod(shape)
    if size > MOST_TABLE_BYTES:
        allowed = f"must have fewer cells: the table of its gains takes {size / 2**30:.1f} GiB"
        raise checks.ParameterError("gradient", gradient.shape, f"{allowed}, at most 1 may")
    table = np.empty(shape, dtype=np.float32)
    _gain_table(gradient, table)
    return table


def _table_shape(gradient):
    north, east = gradient.shape[1:]
    return north, east, max(north, east) - 1, 8


@kernel
def _remaining(ee, en, nn, gains, steps, R):
    """Return the bound h of the module's text; `gains` (≥ steps, 8) belong to the cell."""
    scale = R / (ee * nn - en * en)
    own = np.empty(8)  # R eᵀJe
    part = np.empty(8)
    for e in range(8):
        x, y = _EAST[e], _NORTH[e]
        own[e] = scale * (x * x * nn - 2.0 * x * y * en + y * y * ee)
    total = 0.0
    for k in range(steps):
        for e in range(8):
            part[e] = 1.0 / (own[e] + gains[k, e])
        first = max(part[0] + part[4], part[1] + part[5])
        total += max(first, part[2] + part[6], part[3] + part[7])
    return R * total


@kernel
def _below(one, other, factor):
    """Tell whether P₁ ⪯ factor · P₂ for two labels (ee, en, nn, …)."""
    ee = factor * other[0] - one[0]
    nn = factor * other[2] - one[2]
    en = factor * other[1] - one[1]
    return ee >= 0.0 and nn >= 0.0 and ee * nn >= en * en


@kernel
def _doubled(array):
    out = np.empty((2 * len(array), *array.shape[1:]), array.dtype)
    out[: len(array)] = array
    return out


@kernel
def _limit(expanded, count, compared, limits):
    # Which of `_LIMITS` is reached; an expansion makes eight labels at most.
    if expanded >= limits[0]:
        return 1
    if count + 8 > limits[1]:
        return 2
    return 3 if compared >= limits[2] else 0


@kernel
def _place(state, link, first, new, factor):
    # Where a label belongs in its cell's list: between which two, whether it is dominated,
    # and how many were compared for that.
    before, after, compared = -1, first, 0
    while after >= 0 and state[after, 3] <= new[3]:
        compared += 1
        if _below(state[after], new, factor):
            return before, after, True, compared
        before, after = after, link[after, 2]
    return before, after, False, compared


@kernel
def _drop_dominated(state, link, dropped, label, factor):
    # Take from a cell's list what comes after a label and is dominated by it.
    before, after, compared = label, link[label, 2], 0
    while after >= 0:
        compared += 1
        if _below(state[label], state[after], factor):
            dropped[after] = True
            link[before, 2] = link[after, 2]
        else:
            before = after
        after = link[after, 2]
    return compared


@kernel
def _cells_to(link, label):
    # The cells from the start to a label; none for label −1.
    path = [label]
    while path[-1] >= 0:
        path.append(link[path[-1], 1])
    return np.array([link[label, 0] for label in path[-2::-1]])


@kernel
def _search(gradient, table, start, goal, R, P0, q, factor, cost, limits):
    # Labels are rows of `state` (ee, en, nn, G) and `link` (cell, parent, next). The labels
    # of a cell are a list linked by `next`, sorted by G. Ties in F go to the older label.
    # The limits are looked at between two expansions, so that the open list is whole.
    north, east = gradient.shape[1:]
    goal_i, goal_j = goal // east, goal % east
    state = np.empty((1024, 4))
    link = np.empty((1024, 3), np.int64)
    dropped = np.zeros(1024, np.bool_)
    head = np.full(north * east, -1)
    new = np.empty(4)
    state[0] = P0[0, 0], P0[0, 1], P0[1, 1], 0.0
    link[0] = start, -1, -1
    head[start] = 0
    none = np.empty(0, np.int64)
    count, expanded, compared, arrived, reason = 1, 0, 0, -1, 0
    i, j = start // east, start % east
    distance = max(abs(i - goal_i), abs(j - goal_j))
    at_start = _remaining(P0[0, 0], P0[0, 1], P0[1, 1], table[i, j], distance, R)
    heap = [(at_start, 0)]
    if not at_start < np.inf:
        return none, cost, cost, at_start, _UNSOUND, expanded, count, compared
    while len(heap) > 0 and heap[0][0] < cost:
        reason = _limit(expanded, count, compared, limits)
        if reason != 0:
            break
        label = heapq.heappop(heap)[1]
        if dropped[label]:
            continue
        expanded += 1
        cell = link[label, 0]
        i, j = cell // east, cell % east
        for di in range(-1, 2):
            for dj in range(-1, 2):
                ni, nj = i + di, j + dj
                inside = 0 <= ni < north and 0 <= nj < east
                if not inside or (di == 0 and dj == 0):
                    continue
                q_step = q[1] if di != 0 and dj != 0 else q[0]
                ee, en, nn = state[label, 0], state[label, 1], state[label, 2]
                east_slope, north_slope = gradient[0, ni, nj], gradient[1, ni, nj]
                ee, en, nn = _step(ee, en, nn, east_slope, north_slope, R, q_step)
                G = state[label, 3] + ee + nn
                if not _sound(ee, en, nn):
                    return none, cost, cost, at_start, _UNSOUND, expanded, count, compared
                if cost <= G:
                    continue
                new[0], new[1], new[2], new[3] = ee, en, nn, G
                other = ni * east + nj
                before, after, dominated, more = _place(state, link, head[other], new, factor)
                compared += more
                if dominated:
                    continue
                distance = max(abs(ni - goal_i), abs(nj - goal_j))
                F = G + _remaining(ee, en, nn, table[ni, nj], distance, R)
                if not F < np.inf:
                    return none, cost, cost, at_start, _UNSOUND, expanded, count, compared
                if cost <= F:
                    continue
                if count == len(state):
                    state, link, dropped = _doubled(state), _doubled(link), _doubled(dropped)
                state[count] = new
                link[count] = other, label, after
                dropped[count] = False
                if before < 0:
                    head[other] = count
                else:
                    link[before, 2] = count
                compared += _drop_dominated(state, link, dropped, count, factor)
                if other == goal:
                    cost, arrived = G, count
                else:
                    heapq.heappush(heap, (F, count))
                count += 1
    while len(heap) > 0 and dropped[heap[0][1]]:
        heapq.heappop(heap)
    lowest = min(heap[0][0], cost) if len(heap) > 0 else cost
    if not lowest < cost:
        reason = 0  # nothing below the cost is open: the end, and not a limit
    return _cells_to(link, arrived), cost, lowest, at_start, reason, expanded, count, compared


def _known_path(task, incumbent):
    nodes = getattr(incumbent, "nodes", None)
    nodes = np.asarray(nodes) if checks.dimensions(nodes) == 2 else np.empty(0)
    ends = task.nodes(np.array([task.start, task.goal]))
    size = task.gradient.shape[:0:-1]
    usable = nodes.ndim == 2 and nodes.shape[1] == 2 and nodes.dtype.kind in "iu"
    usable = usable and len(nodes) > 1 and (nodes >= 0).all() and (nodes < size).all()
    nodes = nodes.astype(np.int64) if usable else nodes  # differences of unsigned ones wrap
    adjacent = usable and (np.abs(np.diff(nodes, axis=0)).max(axis=1) == 1).all()
    if not adjacent or not np.array_equal(nodes[[0, -1]], ends):
        allowed = "must be a plan over adjacent nodes from start to goal"
        raise checks.ParameterError("incumbent", f"plan of nodes {nodes.shape}", allowed)
    return nodes


def _known_table(task, table):
    shape = _table_shape(task.gradient)
    usable = isinstance(table, np.ndarray) and table.dtype == np.float32 and table.shape == shape
    usable = usable and table.flags.c_contiguous and not np.ma.is_masked(table)
    if not usable or not (table >= 0).all():
        found = f"{type(table).__name__} of shape {getattr(table, 'shape', ())}"
        raise checks.ParameterError("table", found, "must be gain_table(gradient)")
    return np.asarray(table)


def plan_labels(
    gradient: ArrayLike,
    spacing: float,
    start: ArrayLike,
    goal: ArrayLike,
    noise: float,
    P0: ArrayLike,
    process_noise: float,
    speed: float,
    *,
    epsilon: float,
    max_expansions: int = 1_000_000,
    max_comparisons: int = 150_000_000,
    incumbent: Plan | LabelPlan | None = None,
    table: np.ndarray | None = None,
) -> LabelPlan:
    """Plan a walk with several labels per cell, see the module's text for the method.

    Parameters
    ----------
    gradient, spacing, start, goal, noise, P0, process_noise, speed
        As for `seanav.filters.gravity.planning.plan`.
    epsilon : float
        Tolerance of the dominance between covariances; zero is exact, for small grids.
    max_expansions, max_comparisons : int
        Labels to expand and pairs of labels to compare at most, some ten million in a second;
        then the search stops, as it does at `MOST_LABELS` labels.
    incumbent : Plan or LabelPlan, optional
        A path that is known already (default: the A* plan); returned if none is cheaper.
    table : ndarray, optional
        ``gain_table(gradient)``, if it has been computed already.

    Returns
    -------
    LabelPlan
        With ``epsilon = 0`` its lower bound is that at the end of the search, else at the start.

    Raises
    ------
    ParameterError
        As `plan` and `gain_table`, and if an option is not usable or does not fit.
    """
    inputs = (gradient, spacing, start, goal, noise, P0, process_noise, speed)
    task = problem(*inputs)
    epsilon = checks.number("epsilon", epsilon, at_least=0)
    expansions = checks.integer("max_expansions", max_expansions, at_least=1, at_most=10**15)
    comparisons = checks.integer("max_comparisons", max_comparisons, at_least=1, at_most=10**15)
    limits = expansions, MOST_LABELS, comparisons
    table = gain_table(task.gradient) if table is None else _known_table(task, table)
    nodes = _known_path(task, plan(*inputs) if incumbent is None else incumbent)
    known = float(np.trace(task.bound(nodes)[1:], axis1=1, axis2=2).sum())
    factor = (1.0 + epsilon) * (1.0 + _ROUNDING)
    cells, cost, lowest, at_start, reason, *counts = _search(
        task.gradient, table, task.start, task.goal, task.R, task.P0, task.q, factor, known, limits
    )
    if reason == _UNSOUND:
        _refuse(noise, P0, process_noise, speed)
    nodes = task.nodes(cells) if len(cells) > 0 else nodes
    lower = lowest if epsilon == 0 else min(at_start, cost)
    return LabelPlan(nodes, task.bound(nodes), cost, lower, _LIMITS[reason], *counts)
