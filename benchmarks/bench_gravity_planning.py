"""Speed of paper 5: planners, filters, memory. Figures to read, nothing passes or fails.

Ratios are taken between things that ran in this one process; the plain versions are the ones a
reader would write first.
"""

import heapq
import resource

import numpy as np
from timing import best_of

from seanav.filters.gravity import labels, matching
from seanav.studies.gravity_planning import run
from seanav.studies.gravity_planning.scenario import Scenario


def plain_astar(gradient, start, goal, sigma, P0, rate, spacing, speed):
    """Return the cost of the paper's A*, in plain Python for the ratio."""
    best, closed, queue = {start: (0.0, P0)}, set(), [(0.0, start)]
    while queue:
        node = heapq.heappop(queue)[1]
        if node == goal:
            return best[goal][0]
        if node in closed:
            continue
        closed.add(node)
        for east in (-1, 0, 1):
            for north in (-1, 0, 1):
                child = (node[0] + east, node[1] + north)
                inside = 0 <= child[0] < gradient.shape[2] and 0 <= child[1] < gradient.shape[1]
                if not inside or child in closed:
                    continue
                H = gradient[:, child[1], child[0]]
                P = best[node][1] + np.eye(2) * rate * np.hypot(east, north) * spacing / speed
                K = P @ H / (H @ P @ H + sigma**2)
                P = P - np.outer(K, H @ P)
                cost = best[node][0] + np.trace(P)
                if child not in best or cost < best[child][0]:
                    best[child] = (cost, P)
                    ahead = np.hypot(child[0] - goal[0], child[1] - goal[1])
                    heapq.heappush(queue, (cost + 2 * rate * ahead * spacing / speed, child))
    return None


def plain_sitan(chart, points, first, noise, R, P, steps):
    """One run of the point-gradient filter in NumPy, for the ratio."""
    error, P = first.copy(), P.copy()
    for k in range(1, steps):
        column, row = ((points[k] + error) / chart.spacing).astype(int)
        cell = chart.anomaly[row : row + 2, column : column + 2]
        H = np.array([np.diff(cell, axis=1).mean(), np.diff(cell, axis=0).mean()]) / chart.spacing
        K = P @ H / (H @ P @ H + R)
        error = error + K * (noise[k] - H @ error)
        P = P - np.outer(K, H @ P)
    return error


def main():
    scenario = Scenario()
    chart, level = scenario.map(), scenario.planning_noise_mgal
    problem = run.problem(scenario, chart, scenario.start_1, level)
    plan = run.plan(scenario, chart, scenario.start_1, level)
    path = run.plan_path(plan, chart, scenario.samples)
    noise = run.draw(scenario)
    inputs = run.filter_inputs(scenario, chart, noise, path, level)
    table = labels.gain_table(problem["gradient"])
    steps = scenario.runs * (scenario.samples - 1)

    rows = [
        ("A*, whole grid", 20e-3, lambda: run.plan(scenario, chart, scenario.start_1, level), 5),
        ("1000 SITAN runs × 100 samples", 0.3, lambda: matching.sitan(*inputs), 5),
        ("table of the label heuristic", None, lambda: labels.gain_table(problem["gradient"]), 2),
        (
            f"multi-label plan, ε = {scenario.epsilon:g}",
            5.0,
            lambda: run.plan_labels(
                scenario,
                chart,
                scenario.start_1,
                level,
                epsilon=scenario.epsilon,
                incumbent=plan,
                table=table,
            ),
            2,
        ),
        (
            "1000 point-mass runs × 100 samples",
            None,
            lambda: run.run_all(scenario, chart, noise, {"": path}, [level], method="point mass"),
            1,
        ),
    ]
    print(f"{'what':40} {'wall (s)':>10} {'CPU (s)':>10} {'target (s)':>11}")
    times = {}
    for what, target, function, repeats in rows:
        times[what] = best_of(function, repeats)
        wall, cpu = times[what]
        print(f"{what:40} {wall:10.4f} {cpu:10.4f} {target if target else '':>11}")

    plain = list(problem.values())
    start, goal = tuple(problem["start"]), tuple(problem["goal"])
    arguments = (plain[0], start, goal, problem["noise"], problem["P0"], problem["process_noise"])
    slow = best_of(lambda: plain_astar(*arguments, problem["spacing"], problem["speed"]), 1)[1]
    print(f"A* against plain Python: {slow / times['A*, whole grid'][1]:.0f} times faster")
    one = (path, inputs[3][0], inputs[5][0], inputs[6], scenario.P0, scenario.samples)
    slow = best_of(lambda: plain_sitan(chart, *one), 3)[1] / (scenario.samples - 1)
    fast = times["1000 SITAN runs × 100 samples"][1] / steps
    print(f"filter step: {fast * 1e9:.0f} ns; NumPy {slow * 1e6:.1f} µs, {slow / fast:.0f} times")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory of this process: {peak:.0f} MB")


if __name__ == "__main__":
    main()
