"""Paper 5 beyond its two tests: random starts and goals on several maps."""

from dataclasses import dataclass

import numpy as np

from seanav import montecarlo
from seanav.models import gravity
from seanav.studies import gravity_planning as study

FAN_KM = (27.5, 22.0, 16.5, 11.0, 5.5, -5.5, -11.0, -16.5, -22.0, -27.5)
SECOND_WINDOW_DEG = (30.0, 155.0)  # open Pacific inside the geoid's coverage
MARGIN = 5  # nodes between a start or goal and the border
CLOSEST = 30  # nodes between a start and its goal, at least


def maps(scenario, chart):
    """Return the three maps of the study: the scenario's, a second real one and a synthetic one."""
    latitude, longitude = SECOND_WINDOW_DEG
    return {
        "first map": chart,
        "second map": gravity.load("geoid", latitude_deg=latitude, longitude_deg=longitude),
        "synthetic": gravity.load("synthetic", seed=scenario.seed),
    }


def draw_pairs(scenario, chart, name):
    """Draw start and goal nodes, uniform on the map but for a margin and a least distance."""
    north, east = chart.anomaly.shape
    stream = montecarlo.streams(scenario.seed, f"pairs on {name}", 1)[0]
    pairs = []
    while len(pairs) < scenario.pairs:
        start, goal = stream.integers(MARGIN, (east - MARGIN, north - MARGIN), (2, 2))
        if np.hypot(*(goal - start)) >= CLOSEST:
            pairs.append((tuple(map(int, start)), tuple(map(int, goal))))
    return pairs


@dataclass(frozen=True)
class Bounds:
    """PCRB of one pair at one noise level: sums over the samples of the root of its trace, m."""

    planned: float
    direct: float
    fan: float  # the best bow
    dropped: int  # bows that leave the map
    length_ratio: float  # planned over direct


def bounds(scenario, chart, pair, noise_mgal):
    """Plan one pair with A* and return its `Bounds`."""

    def total(points):
        return study.root_trace(study.bound(scenario, chart, points, noise_mgal)).sum()

    start, goal = pair
    paths, dropped = study.fan(chart, start, goal, FAN_KM, scenario.samples)
    planned = study.plan_path(
        study.plan(scenario, chart, start, noise_mgal, goal), chart, scenario.samples
    )
    direct = paths.pop("Direct")
    return Bounds(
        total(planned),
        total(direct),
        min((total(points) for points in paths.values()), default=np.inf),
        dropped,
        study.length(planned) / study.length(direct),
    )


@dataclass(frozen=True)
class Comparison:
    """One pair at the planning noise: A* against the multi-label search, bound against filter."""

    cost: float  # A*, km² as G counts it
    label_cost: float  # multi-label, ε > 0: a better path, never an optimum
    scores: dict  # name -> Score of SITAN on Planned, Labels, Fan, Direct
    dropped: int


def compare(scenario, chart, noise, pair):
    """Plan one pair both ways and run SITAN on both plans, the best bow and the direct path."""
    start, goal = pair
    level = scenario.planning_noise_mgal
    one = study.plan(scenario, chart, start, level, goal)
    many = study.plan_labels(
        scenario, chart, start, level, goal, epsilon=scenario.epsilon, upper_bound=one.cost
    )
    curves, dropped = study.fan(chart, start, goal, FAN_KM, scenario.samples)
    paths = {
        "Planned": study.plan_path(one, chart, scenario.samples),
        "Labels": study.plan_path(many, chart, scenario.samples),
        "Direct": curves.pop("Direct"),
    }
    if curves:
        paths["Fan"] = min(
            curves.values(),
            key=lambda points: study.root_trace(study.bound(scenario, chart, points, level)).sum(),
        )
    scores = {
        name: study.run(scenario, chart, noise, points, level) for name, points in paths.items()
    }
    return Comparison(one.cost, min(many.cost, one.cost), scores, dropped)
