"""Paper 5 on a user's own data: an own path beside the straight line and the planner's."""

import itertools
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from seanav.estimates import significant
from seanav.filters.gravity import pcrb
from seanav.models import gravity, paths
from seanav.models.units import KM, MGAL
from seanav.studies.gravity_planning import figures, own_path, run, scores
from seanav.studies.gravity_planning.scenario import Scenario
from seanav.studies.gravity_planning.scores import Score

AMPLITUDE = 8.0 * KM  # of the built-in path's tacks
STRETCHES = 10

PATHS = "path length_km hours end_bound_km bound_sum_km rmse_sum_km over_direct low high"
TENTHS = "to_km east_km north_km mean_M_per_km long_axis_km short_axis_km rmse_km"
COLUMNS, ALONG = tuple(PATHS.split()), tuple(TENTHS.split())


def built_in(scenario: Scenario, chart: gravity.GravityMap) -> np.ndarray:
    """Return the path for who has none: tacks from the first start to the goal, (samples, 2) m."""
    start, goal = (np.array(node) * chart.spacing for node in (scenario.start_1, scenario.goal))
    corners = own_path.zigzag(start, goal, chart.extent, AMPLITUDE)
    return paths.resample(corners, scenario.samples)


def source(scenario: Scenario) -> str:
    """Say where the own path comes from."""
    if scenario.path_file:
        return Path(scenario.path_file).name
    return "user_path_km" if scenario.user_path_km else "built in, tacks from start to goal"


def ends(own: np.ndarray, chart: gravity.GravityMap) -> list[tuple[int, ...]]:
    """Return the nodes (east, north) next to the two ends of a path (samples, 2) m."""
    return [tuple(np.rint(own[k] / chart.spacing).astype(int).tolist()) for k in (0, -1)]


def ways(scenario: Scenario, chart: gravity.GravityMap, own: np.ndarray) -> dict[str, np.ndarray]:
    """Return the own path and, if it leads elsewhere, two others between its ends.

    Parameters
    ----------
    own : ndarray, shape (samples, 2)
        East and north, m.

    Returns
    -------
    dict of str to (samples, 2) ndarray in m
        "Own", "Planned" by A* for the scenario's noise, "Direct".
    """
    start, goal = ends(own, chart)
    if start == goal:
        return {"Own": own}
    plan = run.plan(scenario, chart, start, scenario.planning_noise_mgal, goal)
    planned = run.plan_path(plan, chart, scenario.samples)
    return {"Own": own, "Planned": planned, "Direct": paths.bow(own[0], own[-1], 0.0, len(own))}


def sail(
    scenario: Scenario, chart: gravity.GravityMap, noise: run.Noise, sailed: dict[str, np.ndarray]
) -> dict[str, Score]:
    """Run SITAN along every path at the noise that was planned for."""
    levels = [scenario.planning_noise_mgal]
    return {
        name: row[0] for name, row in run.run_all(scenario, chart, noise, sailed, levels).items()
    }


def rows(scenario: Scenario, scored: dict[str, Score]) -> list[tuple]:
    """Return a row per path with the entries of `COLUMNS`; the last two are a 95 % interval."""
    found = []
    for name, one in scored.items():
        ratio: tuple = (None,) * 3
        if "Direct" in scored:
            each = scores.ratio(one, scored["Direct"])
            ratio = each.value, each.low, each.high
        hours = one.length / scenario.speed / 3600
        lengths = (one.bound[-1], one.bound.sum(), one.total.value)
        numbers = (one.length / KM, hours, *(x / KM for x in lengths))
        found.append((name, *numbers, *ratio))
    return found


def along(
    scenario: Scenario, chart: gravity.GravityMap, own: np.ndarray, score: Score
) -> list[tuple]:
    """Return a row per tenth of a path with the entries of `ALONG`.

    M is the mean over the tenth; the axes are those of the bound's one-sigma ellipse at its end.
    """
    noise = scenario.planning_noise_mgal
    M = information_along(chart, noise, own)
    axes = np.sqrt(np.linalg.eigvalsh(run.bound(scenario, chart, own, noise))) / KM
    last = len(own) - 1
    marks = np.rint(np.linspace(0, last, min(STRETCHES, last) + 1)).astype(int)
    return [
        (
            b / last * score.length / KM,
            *(own[b] / KM).tolist(),
            M[a + 1 : b + 1].mean(),
            axes[b, 1],
            axes[b, 0],
            score.rmse[b] / KM,
        )
        for a, b in itertools.pairwise(marks)
    ]


def information_along(
    chart: gravity.GravityMap, noise_mgal: float, points: np.ndarray
) -> np.ndarray:
    """Return M at the points (…, 2) m, (…,) 1/km."""
    slopes = gravity.interpolate(gravity.gradient(chart), chart.spacing, points)
    return np.hypot(slopes[..., 0], slopes[..., 1]) / (noise_mgal * MGAL) * KM


def picture(
    scenario: Scenario,
    chart: gravity.GravityMap,
    sailed: dict[str, np.ndarray],
    scored: dict[str, Score],
) -> Figure:
    """Draw the paths over the information M, and RMSE and bound along each."""
    fig, (left, right) = plt.subplots(1, 2, figsize=(9.4, 4.4), width_ratios=(1.15, 1))
    M = pcrb.information(gravity.gradient(chart), scenario.planning_noise_mgal * MGAL) * KM
    figures.field(left, chart, M, "", 8, bar=False)
    for name, points in sailed.items():
        look = {"linestyle": "-"} | figures.style(name, 0)
        if name == "Own":
            look = {"color": "#d55e00", "linewidth": 1.8, "linestyle": "-", "zorder": 6}
        one = scored[name]
        left.plot(*(points.T / KM), label=name, **look)
        distance = np.linspace(0.0, one.length / KM, len(one.rmse))
        right.plot(distance, one.rmse / KM, label=f"{name}, RMSE", **look)
        thin = {"color": look["color"], "linewidth": 1.0, "linestyle": ":"}
        right.plot(distance, one.bound / KM, label=f"{name}, bound", **thin)
    own = sailed["Own"] / KM
    figures.mark(left, {"start": tuple(own[0]), "end": tuple(own[-1])})
    right.set(xlabel="distance along the path (km)", ylabel="position error (km)")
    right.set_ylim(bottom=0.0)
    right.legend()
    return fig


def verdict(scored: dict[str, Score]) -> str:
    """Say which of the paths has the smallest sum of RMSE, and whether that is certain."""
    if len(scored) == 1:
        return "The path ends where it begins: there is no other one to compare it with."
    words = []
    for name, other in (("the straight line", "Direct"), ("the planner's path", "Planned")):
        ratio = scores.ratio(scored["Own"], scored[other])
        how = "better than" if ratio.high < 1 else "worse than" if ratio.low > 1 else "as good as"
        words.append(f"{how} {name} ({significant(ratio)} times its sum)")
    own, direct = scored["Own"], scored["Direct"]
    longer = round((own.length - direct.length) / KM, 3)
    at_end, other = (significant(x.bound[-1] / KM) for x in (own, direct))
    return (
        f"The own path is {' and '.join(words)}. It is {significant(longer)} km longer than the "
        f"straight line, and its bound at the end is {at_end} km, there {other} km."
    )
