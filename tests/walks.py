"""Independent references for the planners: every walk on a small grid, and A* from lists."""

import itertools

import numba
import numpy as np


def field(north, east, seed):
    """Independent slopes of unit variance, (2, north, east)."""
    return np.random.default_rng(seed).normal(size=(2, north, east))


def problem(gradient, start, goal, **changes):
    """Planning problem with numbers near one."""
    task = {"gradient": gradient, "spacing": 1.0, "start": start, "goal": goal, "noise": 0.8}
    task |= {"P0": np.array([[2.0, 0.6], [0.6, 1.0]]), "process_noise": 0.05, "speed": 1.0}
    return task | changes


def walk_bound(task, nodes):
    """Covariances (k, 2, 2) along a walk, in information form."""
    bound = [np.asarray(task["P0"], dtype=float)]
    for before, after in itertools.pairwise(nodes):
        metres = task["spacing"] * np.hypot(*np.subtract(after, before))
        q = task["process_noise"] * metres / task["speed"]
        h = task["gradient"][:, after[1], after[0]]
        information = np.outer(h, h) / task["noise"] ** 2
        bound.append(np.linalg.inv(np.linalg.inv(bound[-1] + q * np.eye(2)) + information))
    return np.array(bound)


def walk_cost(task, nodes):
    """Sum of the traces after the start."""
    return np.trace(walk_bound(task, nodes)[1:], axis1=1, axis2=2).sum()


def neighbours(task, node):
    """Eight neighbours on the map, from south-west to north-east along the rows."""
    north, east = task["gradient"].shape[1:]
    for i in range(node[1] - 1, node[1] + 2):
        for j in range(node[0] - 1, node[0] + 2):
            if (j, i) != tuple(node) and 0 <= i < north and 0 <= j < east:
                yield j, i


@numba.njit
def _depth_first(gradient, goal, R, q, floors, walk, best, at, depth, G, a, b, c):
    # Every walk that can still cost less than the best one: a step costs at least
    # floors[depth], because its bound keeps q on one axis and less than the largest
    # conceivable information on both. No limit on the length, cells may come again.
    walk[depth] = at
    north, east = gradient.shape[1:]
    if at[0] == goal[0] and at[1] == goal[1]:
        best[0] = G
        best[1] = depth
        best[2:] = 0
        for k in range(depth + 1):
            best[2 + 2 * k], best[3 + 2 * k] = walk[k]
        return
    distance = max(abs(at[0] - goal[0]), abs(at[1] - goal[1]))
    if G + floors[depth : depth + distance].sum() >= best[0]:
        return
    for j in range(max(at[0] - 1, 0), min(at[0] + 2, east)):
        for i in range(max(at[1] - 1, 0), min(at[1] + 2, north)):
            if i == at[1] and j == at[0]:
                continue
            add = q * np.sqrt((i - at[1]) ** 2 + (j - at[0]) ** 2)
            x, y = gradient[0, i, j], gradient[1, i, j]
            # inverse of (P + q I), plus the information, inverted again
            det = (a + add) * (c + add) - b * b
            ja, jb, jc = (
                (c + add) / det + x * x / R,
                -b / det + x * y / R,
                (a + add) / det + y * y / R,
            )
            det = ja * jc - jb * jb
            cost = G + (ja + jc) / det
            if cost < best[0]:
                args = (floors, walk, best, (j, i), depth + 1, cost, jc / det, -jb / det, ja / det)
                _depth_first(gradient, goal, R, q, *args)


def straight(task):
    """Shortest walk, diagonal first."""
    nodes = [task["start"]]
    while tuple(nodes[-1]) != tuple(task["goal"]):
        nodes.append(tuple(np.add(nodes[-1], np.sign(np.subtract(task["goal"], nodes[-1])))))
    return np.array(nodes)


def best_walk(task):
    """Search all walks depth first; return the smallest cost and its nodes."""
    R, q = task["noise"] ** 2, task["process_noise"] * task["spacing"] / task["speed"]
    known = walk_cost(task, straight(task)) * (1 + 1e-12)
    longest = int(known / q) + 1  # each step costs at least q
    most = (task["gradient"] ** 2).sum(axis=0).max() / R
    J0 = np.linalg.eigvalsh(np.linalg.inv(task["P0"])).max()
    floors = np.maximum(q, 2 / (J0 + most * np.arange(1, longest + 1)))
    best = np.zeros(2 + 2 * longest)
    best[0] = known
    walk = np.zeros((longest, 2))
    (a, b), (_, c) = task["P0"]
    _depth_first(
        task["gradient"], task["goal"], R, q, floors, walk, best, task["start"], 0, 0.0, a, b, c
    )
    return best[0], best[2 : 4 + 2 * int(best[1])].reshape(-1, 2).astype(int)


def textbook_a_star(task):
    """A* with an open list that is searched from end to end: nodes, cost, expanded."""
    east = task["gradient"].shape[2]
    q = 2 * task["process_noise"] / task["speed"] * task["spacing"]
    start, goal = tuple(task["start"]), tuple(task["goal"])
    paths, costs, opened, closed = {start: [start]}, {start: 0.0}, [start], []

    def estimate(node):
        return costs[node] + q * np.hypot(*np.subtract(node, goal)), node[1] * east + node[0]

    while goal not in closed:
        node = min(opened, key=estimate)
        opened.remove(node)
        closed.append(node)
        for other in neighbours(task, node) if node != goal else ():
            path = [*paths[node], other]
            cost = walk_cost(task, path)
            if other not in closed and cost < costs.get(other, np.inf):
                paths[other], costs[other] = path, cost
                if other not in opened:
                    opened.append(other)
    return np.array(paths[goal]), costs[goal], len(closed)


def moved(task, move):
    """Mirror ("east", "north") or quarter turn ("turn") a problem, and how to move nodes."""
    north, east = task["gradient"].shape[1:]
    g, P = task["gradient"], task["P0"]
    if move == "turn":  # (x, y) -> (−y, x), moved back onto the map
        gradient = np.stack([-g[1], g[0]]).transpose(0, 2, 1)[:, :, ::-1]
        U = np.array([[0.0, -1.0], [1.0, 0.0]])
    elif move == "east":
        gradient, U = np.stack([-g[0], g[1]])[:, :, ::-1], np.diag([-1.0, 1.0])
    else:
        gradient, U = np.stack([g[0], -g[1]])[:, ::-1], np.diag([1.0, -1.0])
    shift = {"turn": (north - 1, 0), "east": (east - 1, 0), "north": (0, north - 1)}[move]

    def carry(nodes):
        return np.asarray(nodes) @ U.T.astype(int) + shift

    start, goal = (tuple(map(int, carry(task[name]))) for name in ("start", "goal"))
    return task | {"gradient": gradient, "P0": U @ P @ U.T, "start": start, "goal": goal}, carry


def textbook_labels(task, epsilon, remaining, limit=np.inf):
    """Multi-label search from plain lists: nodes, cost, lowest F open, labels expanded and made.

    `remaining(node, P)` is the lower bound that orders and prunes; the straight walk of
    `straight` is the first that is known. The search stops after `limit` expansions.
    """
    start, goal = tuple(task["start"]), tuple(task["goal"])
    nodes, order, expanded = straight(task), itertools.count(), 0
    best = walk_cost(task, nodes)
    first = (remaining(start, task["P0"]), next(order), 0.0, [start], np.asarray(task["P0"]))
    opened, cells = [first], {start: [first]}
    while opened:
        label = min(opened, key=lambda one: one[:2])
        if label[0] >= best or expanded == limit:
            break
        opened = [one for one in opened if one[1] != label[1]]
        expanded += 1
        _, _, G, path, P = label
        for node in neighbours(task, path[-1]):
            after = walk_bound(task | {"P0": P}, [path[-1], node])[1]
            cost = G + np.trace(after)
            F = cost + remaining(node, after)
            kept = cells.setdefault(node, [])
            if best <= F or any(
                one[2] <= cost and _not_above(one[4], after, epsilon) for one in kept
            ):
                continue
            new = (F, next(order), cost, [*path, node], after)
            worse = {one[1] for one in kept if one[2] > cost and _not_above(after, one[4], epsilon)}
            cells[node] = [*(one for one in kept if one[1] not in worse), new]
            opened = [one for one in opened if one[1] not in worse]
            if node == goal:
                best, nodes = cost, new[3]
            else:
                opened.append(new)
    lowest = min([best, *(one[0] for one in opened)])
    return np.array(nodes), best, lowest, expanded, next(order)


def _not_above(one, other, epsilon):
    return np.linalg.eigvalsh((1 + epsilon) * other - one).min() >= -1e-13 * np.trace(other)
