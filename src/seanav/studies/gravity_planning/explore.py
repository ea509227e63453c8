"""A picture that is drawn anew while a reader moves its sliders."""

from functools import cache

import attrs
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from seanav.estimates import significant
from seanav.filters.gravity import pcrb
from seanav.models import gravity, paths
from seanav.models.gravity.map import GravityMap
from seanav.models.units import KM, MGAL
from seanav.studies.gravity_planning import figures, run
from seanav.studies.gravity_planning.scenario import Scenario
from seanav.studies.gravity_planning.scores import Score

RUNS = 200  # the answer must come while the reader waits


def sail(
    scenario: Scenario, chart: GravityMap, start: tuple[int, int], noise_mgal: float
) -> tuple[dict[str, np.ndarray], dict[str, Score]]:
    """Plan from a node and sail the plan and the straight line on common random numbers.

    Returns
    -------
    dict of str to (samples, 2) ndarray in m, dict of str to Score
    """
    small = attrs.evolve(scenario, runs=RUNS)
    plan = run.plan(small, chart, start, noise_mgal)
    direct, _ = run.fan(chart, start, small.goal, (), small.samples)
    sailed = {"Planned": run.plan_path(plan, chart, small.samples)} | direct
    noise = run.draw(small)
    return sailed, {
        name: run.run(small, chart, noise, points, noise_mgal) for name, points in sailed.items()
    }


@cache
def _defaults() -> tuple[Scenario, GravityMap]:
    scenario = Scenario()
    return scenario, scenario.map()


def picture(
    noise_mgal: float = 2.0,
    start_east_km: int = 58,
    start_north_km: int = 73,
    *,
    scenario: Scenario | None = None,
    chart: GravityMap | None = None,
) -> Figure:
    """Draw the path planned from a start for a noise, over M, and how far off the filter is.

    Parameters
    ----------
    noise_mgal : float
        Standard deviation of the gravimeter, mGal; the plan is made for it, too.
    start_east_km, start_north_km : int
        The start's node; beyond the map its border is taken.
    scenario : Scenario, optional
        Everything else, such as the goal; the defaults if it is left out.
    chart : GravityMap, optional
        The map; the scenario's if it is left out.

    Returns
    -------
    Figure
    """
    if scenario is None and chart is None:
        scenario, chart = _defaults()
    scenario = Scenario() if scenario is None else scenario
    chart = scenario.map() if chart is None else chart
    north, east = chart.anomaly.shape
    start = min(max(start_east_km, 0), east - 1), min(max(start_north_km, 0), north - 1)
    # Places by hand: finding them takes as long as drawing, and a reader waits.
    fig, (left, right) = plt.subplots(1, 2, figsize=(9.4, 4.4), layout="none")
    fig.subplots_adjust(left=0.06, right=0.98, bottom=0.12, top=0.92, wspace=0.16)
    M = pcrb.information(gravity.gradient(chart), noise_mgal * MGAL) * KM
    figures.field(left, chart, M, "", 8, bar=False)
    if start == tuple(scenario.goal):
        left.set_title("the start is the goal: move it")
        right.axis("off")
        figures.mark(left, {"goal": start})
        return fig
    sailed, scores = sail(scenario, chart, start, noise_mgal)
    for name, points in sailed.items():
        left.plot(*(points.T / KM), **figures.style(name, 0))
    figures.mark(left, {"start": start, "goal": scenario.goal})
    longer = paths.length(sailed["Planned"]) - paths.length(sailed["Direct"])
    left.set_title(f"the plan is {significant(longer / KM)} km longer than the straight line")
    _errors(right, scores)
    return fig


def _errors(ax: Axes, scores: dict[str, Score]) -> None:
    """Draw RMSE and bound along each path, and say the sums."""
    for name, one in scores.items():
        along = np.linspace(0.0, one.length / KM, len(one.rmse))
        look = figures.style(name, 0)
        ax.plot(along, one.rmse / KM, label=f"{name}, RMSE", **look)
        thin = {"color": look["color"], "linewidth": 1.0, "linestyle": ":"}
        ax.plot(along, one.bound / KM, label=f"{name}, bound", **thin)
    totals = (f"{name} {significant(one.rmse.sum() / KM)} km" for name, one in scores.items())
    ax.set(xlabel="distance along the path (km)", ylabel="RMSE (km)")
    ax.set_title("sum of RMSE: " + ", ".join(totals), fontsize=9)
    ax.set_ylim(bottom=0.0)
    ax.legend()
