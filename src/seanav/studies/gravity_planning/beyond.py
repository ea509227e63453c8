"""Paper 5 beyond its two tests: random starts and goals on several maps."""

from dataclasses import dataclass

import numpy as np

from seanav import estimates, montecarlo
from seanav.filters.gravity import labels
from seanav.models import gravity, paths
from seanav.models.gravity import sources
from seanav.models.units import KM
from seanav.studies.gravity_planning import run, scores
from seanav.studies.gravity_planning.scenario import Scenario

FAN_KM = (27.5, 22.0, 16.5, 11.0, 5.5, -5.5, -11.0, -16.5, -22.0, -27.5)
SECOND_WINDOW_DEG = (30.0, 155.0)  # open Pacific inside the geoid's coverage
MARGIN = 5  # nodes between a start or goal and the border
CLOSEST = 30  # nodes between a start and its goal, at least
INITIAL_KM = 15.0  # the initial stage of a path; the paper reads its curves there
FEWEST = 10  # pairs that a correlation needs


def maps(scenario: Scenario, chart: gravity.GravityMap) -> dict[str, gravity.GravityMap]:
    """Return the three maps of the study: the scenario's, a second real one and a synthetic one."""
    latitude, longitude = SECOND_WINDOW_DEG
    return {
        "first map": chart,
        "second map": sources.load("geoid", latitude_deg=latitude, longitude_deg=longitude),
        "synthetic": sources.load("synthetic", seed=scenario.seed),
    }


def draw_pairs(scenario: Scenario, chart: gravity.GravityMap, name: str) -> list:
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
    """PCRB of one pair at one noise level: sums over the samples of the root of its trace, m.

    The shares are those of the map's nodes whose information M is smaller.
    """

    planned: float
    direct: float
    fan: float  # the best bow
    dropped: int  # bows that leave the map
    length_ratio: float  # planned over direct
    start: float  # share of the map below the start
    goal: float  # share of the map below the goal
    crossed: float  # share of the map below the plan's most informative node
    early: float  # root of the PCRB of the direct path at `INITIAL_KM`, m
    late: float  # its mean over the rest of the direct path, m

    @property
    def lost(self) -> bool:
        """Whether a bow or the direct path has a smaller sum than the plan."""
        return self.planned > min(self.fan, self.direct)


def bounds(scenario: Scenario, chart: gravity.GravityMap, pair: tuple, noise_mgal: float) -> Bounds:
    """Plan one pair with A* and return its `Bounds`."""

    def roots(points):
        return run.root_trace(run.bound(scenario, chart, points, noise_mgal))

    steep = np.hypot(*gravity.gradient(chart))

    def below(nodes):
        return float((steep < steep[nodes[..., 1], nodes[..., 0]].max()).mean())

    start, goal = pair
    curves, dropped = run.fan(chart, start, goal, FAN_KM, scenario.samples)
    plan = run.plan(scenario, chart, start, noise_mgal, goal)
    planned = run.plan_path(plan, chart, scenario.samples)
    direct = curves.pop("Direct")
    along, length = roots(direct), paths.length(direct)
    first = round(min(INITIAL_KM * KM / length, 1.0) * (scenario.samples - 1))
    return Bounds(
        roots(planned).sum(),
        along.sum(),
        min((roots(points).sum() for points in curves.values()), default=np.inf),
        dropped,
        paths.length(planned) / length,
        below(np.array(start)),
        below(np.array(goal)),
        below(plan.nodes),
        along[first],
        along[first:].mean() if first + 1 == len(along) else along[first + 1 :].mean(),
    )


@dataclass(frozen=True)
class Comparison:
    """One pair at the planning noise: A* against the multi-label search, bound against filter."""

    cost: float  # A*, km² as G counts it
    label_cost: float  # multi-label, ε > 0: a better path, never an optimum
    scores: dict  # name -> Score of SITAN on Planned, Labels, Fan, Direct
    dropped: int


def compare(
    scenario: Scenario, chart: gravity.GravityMap, noise: run.Noise, pair: tuple, table: np.ndarray
) -> Comparison:
    """Plan one pair both ways and run SITAN on both plans, the best bow and the direct path.

    `table` is the map's `seanav.filters.gravity.labels.gain_table`.
    """
    start, goal = pair
    level = scenario.planning_noise_mgal
    one = run.plan(scenario, chart, start, level, goal)
    many = run.plan_labels(
        scenario, chart, start, level, goal, epsilon=scenario.epsilon, incumbent=one, table=table
    )
    curves, dropped = run.fan(chart, start, goal, FAN_KM, scenario.samples)
    compared = {
        "Planned": run.plan_path(one, chart, scenario.samples),
        "Labels": run.plan_path(many, chart, scenario.samples),
        "Direct": curves.pop("Direct"),
    }
    if curves:
        compared["Fan"] = min(
            curves.values(),
            key=lambda points: run.root_trace(run.bound(scenario, chart, points, level)).sum(),
        )
    sailed = {
        name: run.run(scenario, chart, noise, points, level) for name, points in compared.items()
    }
    return Comparison(one.cost, many.cost, sailed, dropped)


# All pairs, in parallel -----------------------------------------------------------------


def all_bounds(scenario: Scenario, maps: dict[str, gravity.GravityMap]) -> dict:
    """Return the `Bounds` of every pair: {(map, mGal): [Bounds, …]}."""
    jobs = [
        (name, mgal, pair)
        for name, chart in maps.items()
        for mgal in scenario.noise_mgal
        for pair in draw_pairs(scenario, chart, name)
    ]
    results = montecarlo.parallel_map(
        lambda job: bounds(scenario, maps[job[0]], job[2], job[1]), jobs, label="random pairs"
    )
    grouped = {(name, mgal): [] for name in maps for mgal in scenario.noise_mgal}
    for (name, mgal, _), result in zip(jobs, results, strict=True):
        grouped[name, mgal].append(result)
    return grouped


def all_comparisons(
    scenario: Scenario, maps: dict[str, gravity.GravityMap], noise: run.Noise
) -> dict[str, list[Comparison]]:
    """Return the `Comparison` of the first `label_pairs` pairs of every map: {map: […]}."""
    tables = {name: labels.gain_table(gravity.gradient(chart)) for name, chart in maps.items()}
    jobs = [
        (name, pair)
        for name, chart in maps.items()
        for pair in draw_pairs(scenario, chart, name)[: scenario.label_pairs]
    ]
    results = montecarlo.parallel_map(
        lambda job: compare(scenario, maps[job[0]], noise, job[1], tables[job[0]]),
        jobs,
        label="multi-label plans",
    )
    grouped = {name: [] for name in maps}
    for (name, _), result in zip(jobs, results, strict=True):
        grouped[name].append(result)
    return grouped


def still_as_good(
    scenario: Scenario,
    maps: dict[str, gravity.GravityMap],
    compared: dict[str, list[Comparison]],
    epsilon: float,
) -> tuple[int, int]:
    """Count the pairs for which the labels found nothing cheaper than A*.

    Returns
    -------
    int, int
        With the scenario's ε, and after another search of these pairs with a finer one.
    """
    level = scenario.planning_noise_mgal
    jobs = [
        (maps[name], pair)
        for name, results in compared.items()
        for pair, one in zip(draw_pairs(scenario, maps[name], name), results, strict=False)
        if not cheaper(one.cost, one.label_cost)
    ]

    def finer(job):
        chart, (start, goal) = job
        one = run.plan(scenario, chart, start, level, goal)
        options = {"epsilon": epsilon, "incumbent": one}
        many = run.plan_labels(scenario, chart, start, level, goal, **options)
        return not cheaper(one.cost, many.cost)

    left = montecarlo.parallel_map(finer, jobs, label="finer searches")
    return len(jobs), sum(left)


def cheaper(cost: float, other: float) -> bool:
    """Tell whether `other` is below `cost` by more than rounding."""
    return cost / other > 1.0 + 1e-9


# Tables ---------------------------------------------------------------------------------


def share_lost(results: list[Bounds]) -> estimates.Estimate:
    """Return the share of pairs whose plan loses to a bow or the direct path: an exact number."""
    return estimates.exact(sum(one.lost for one in results) / len(results))


def mean_ratio(ratios: list[float]) -> estimates.Estimate | str:
    """Return the geometric mean over pairs, or why there is none."""
    if len(ratios) < 2:
        return (
            f"a mean over two such pairs or more was not run: {len(ratios)} of the pairs are such"
        )
    return estimates.exponential(estimates.mean(np.log(ratios)))


def correlation(one: list[float], other: list[float]) -> estimates.Estimate | str:
    """Return the rank correlation of two numbers over pairs, or why there is none."""
    if len(one) < FEWEST or min(len(set(one)), len(set(other))) < 2:
        return f"a correlation over {FEWEST} different pairs was not run: {len(one)} pairs"
    return scores.rank_correlation(np.array(one), np.array(other))


def initial_stage(results: list[Bounds]) -> tuple[estimates.Estimate | str, ...]:
    """Return how the start's information ranks the early bound, and that the late one."""
    early = [one.early for one in results]
    return (
        correlation([one.start for one in results], early),
        correlation(early, [one.late for one in results]),
    )


def share_won(results: list[Bounds]) -> estimates.Estimate:
    """Return the share of pairs whose plan beats the bows and the direct path by PCRB."""
    wins = sum(one.planned < min(one.fan, one.direct) for one in results)
    return estimates.share(wins, len(results))


def share_table(grouped: dict) -> list:
    """Return rows (map, mGal, share, low, high, median over the best, length, dropped)."""
    rows = []
    for (name, mgal), results in grouped.items():
        won = share_won(results)
        over = np.median([one.planned / min(one.fan, one.direct) for one in results])
        longer = np.median([one.length_ratio for one in results])
        dropped = sum(one.dropped for one in results)
        rows.append((name, mgal, won.value, won.low, won.high, over, longer, dropped))
    return rows


def cost_table(grouped: dict[str, list[Comparison]]) -> list:
    """Return rows (map, median and largest cost ratio, RMSE ratio with interval).

    The ratio of the RMSE sums, A* over multi-label, is a geometric mean over the pairs.
    """
    rows = []
    for name, results in grouped.items():
        costs = [one.cost / one.label_cost for one in results]
        logs = [
            np.log(one.scores["Planned"].total.value / one.scores["Labels"].total.value)
            for one in results
        ]
        gain = estimates.exponential(estimates.mean(np.array(logs)))
        rows.append((name, np.median(costs), max(costs), gain.value, gain.low, gain.high))
    return rows


def bound_table(grouped: dict[str, list[Comparison]]) -> list:
    """Return rows (map, path, geometric mean, least and largest RMSE/PCRB, diverged in 1000)."""
    rows = []
    for name, results in grouped.items():
        for path in ("Planned", "Labels", "Fan", "Direct"):
            sailed = [one.scores[path] for one in results if path in one.scores]
            if not sailed:  # on a small map every bow may leave it
                continue
            over = [score.over_bound.value for score in sailed]
            lost = sum(score.diverged for score in sailed) / sum(len(s.squared) for s in sailed)
            mean = np.exp(np.mean(np.log(over)))
            rows.append((name, path, mean, min(over), max(over), 1000 * lost))
    return rows


# Filters side by side ---------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """One path under several filters and two bounds (samples,) m."""

    scores: dict
    at_truth: np.ndarray
    expected: np.ndarray
    length: float


def methods(
    scenario: Scenario, chart: gravity.GravityMap, noise: run.Noise, cases: dict[str, np.ndarray]
) -> dict[str, Case]:
    """Run SITAN, the point-gradient EKF and the point-mass filter on named paths.

    `cases` maps a name to points (samples, 2). Returns {name: `Case`}.
    """
    mgal = scenario.planning_noise_mgal
    done = {}
    for name, points in cases.items():
        sailed = {
            method: run.run_all(scenario, chart, noise, {"": points}, [mgal], method=method)[""][0]
            for method in ("sitan", "ekf", "point mass")
        }
        at_truth = sailed["sitan"].bound
        expected = run.root_trace(run.expected_bound(scenario, chart, points, mgal))
        done[name] = Case(sailed, at_truth, expected, paths.length(points))
    return done


def method_table(cases: dict[str, Case]) -> list:
    """Return rows (case, method, sum of RMSE with interval, sum of medians, diverged); km."""
    rows = []
    for name, case in cases.items():
        for method, one in case.scores.items():
            total = [x / KM for x in (one.total.value, one.total.low, one.total.high)]
            median = np.sqrt(np.median(one.squared, axis=0)).sum() / KM
            rows.append((name, method, *total, median, one.diverged))
        for label, limit in (("PCRB, truth", case.at_truth), ("PCRB, prior", case.expected)):
            rows.append((name, label, limit.sum() / KM, None, None, None, None))
    return rows
