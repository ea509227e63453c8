"""Paper 5's study of random pairs: what is compared, and the tables made of it."""

import itertools
import math

import numpy as np
import pytest
from scipy.stats import spearmanr

from seanav import estimates
from seanav.filters.gravity import labels
from seanav.models import gravity, paths
from seanav.studies.gravity_planning import beyond, printed, run, scores
from seanav.studies.gravity_planning.beyond import Bounds, Case, Comparison
from seanav.studies.gravity_planning.scenario import Scenario

PAIR = ((8, 50), (30, 8))  # some bows leave the map
FAR = ((12, 50), (60, 14))  # A* misses a better walk
SMALL = Scenario(runs=12, samples=25, pairs=2, label_pairs=2, noise_mgal=(1.0, 2.0), epsilon=1.0)


def waves(period_km):
    north, east = np.mgrid[0:61, 0:81] * 1e3
    field = 20e-5 * np.sin(2 * np.pi * east / (period_km * 1e3)) * np.cos(2 * np.pi * north / 30e3)
    return gravity.GravityMap(field, 1000.0, "waves", "analytic")


@pytest.fixture(scope="module")
def chart():
    return waves(40)


def plain_sum(scenario, chart, points, mgal):
    """Sum of the root traces of the bound along a path, in information form."""
    slopes = gravity.interpolate(gravity.gradient(chart), chart.spacing, points)
    total, P = math.sqrt(2) * 1e3, np.eye(2) * 1e6
    # Process noise is that of the mean step, although chords across a corner are shorter.
    seconds = np.hypot(*np.diff(points, axis=0).T).mean() / scenario.speed
    for step in range(1, len(points)):
        J = np.linalg.inv(P + np.eye(2) * scenario.process_noise**2 * seconds)
        P = np.linalg.inv(J + np.outer(slopes[step], slopes[step]) / (mgal * 1e-5) ** 2)
        total += math.sqrt(np.trace(P))
    return total


def bows(scenario, pair):
    """Every bow of the fan that stays on the map, and how many do not."""
    ends = np.array(pair) * 1e3
    curves = [paths.bow(*ends, 1e3 * km, scenario.samples) for km in beyond.FAN_KM]
    kept = [c for c in curves if (c >= 0).all() and (c <= [80e3, 60e3]).all()]
    return kept, len(curves) - len(kept)


def facts(planned, direct, fan, dropped=0, length_ratio=1.0, **more):
    places = {"start": 0.5, "goal": 0.5, "crossed": 1.0, "early": 1.0, "late": 1.0}
    return Bounds(planned, direct, fan, dropped, length_ratio, **(places | more))


def test_bounds_of_a_pair_are_those_of_its_paths(chart):
    ours = beyond.bounds(SMALL, chart, PAIR, 2.0)
    kept, dropped = bows(SMALL, PAIR)
    sums = [plain_sum(SMALL, chart, points, 2.0) for points in kept]
    direct = paths.bow(*(np.array(PAIR) * 1e3), 0.0, SMALL.samples)
    nodes = run.plan(SMALL, chart, PAIR[0], 2.0, PAIR[1]).nodes
    planned = paths.resample(nodes * 1e3, SMALL.samples)
    assert ours.fan == pytest.approx(min(sums), rel=1e-9)
    assert ours.direct == pytest.approx(plain_sum(SMALL, chart, direct, 2.0), rel=1e-9)
    assert ours.planned == pytest.approx(plain_sum(SMALL, chart, planned, 2.0), rel=1e-9)
    assert ours.dropped == dropped > 0
    assert ours.length_ratio == pytest.approx(paths.length(planned) / paths.length(direct))
    assert ours.length_ratio > 1
    steep = np.hypot(*gravity.gradient(chart))
    at = {n: steep[node[1], node[0]] for n, node in zip(("start", "goal"), PAIR, strict=True)}
    for name, value in at.items():
        assert getattr(ours, name) == np.mean(steep < value)
    assert ours.crossed == np.mean(steep < max(steep[j, i] for i, j in nodes))
    along = paths.length(direct)
    first = round(15e3 / along * (SMALL.samples - 1))
    slopes = gravity.interpolate(gravity.gradient(chart), chart.spacing, direct)
    J, roots = np.eye(2) * 1e-6, []  # process noise of some metres changes nothing here
    for step in range(1, SMALL.samples):
        J = J + np.outer(slopes[step], slopes[step]) / 2e-5**2
        roots.append(math.sqrt(np.trace(np.linalg.inv(J))))
    assert ours.late == pytest.approx(np.mean(roots[first:]), rel=1e-4)


def test_the_initial_stage_is_told_by_ranks_or_by_why_not():
    pairs = [facts(1, 2, 3, start=k / 20, early=9.0 - k, late=(9.0 - k) ** 3) for k in range(12)]
    pairs[3], pairs[4] = facts(1, 2, 3, start=0.2, early=6.0, late=9.0), pairs[3]
    first, rest = beyond.initial_stage(pairs)
    expected = [[one.start for one in pairs], [one.early for one in pairs]]
    assert first.value == pytest.approx(spearmanr(*expected).statistic)
    assert first.value < -0.9
    assert rest.value > 0.9
    assert "was not run" in beyond.initial_stage(pairs[:9])[0]
    assert "was not run" in beyond.correlation([1.0] * 12, [2.0] * 12)


def test_mean_ratio_is_geometric():
    assert beyond.mean_ratio([1.0, 4.0, 2.0]).value == pytest.approx(2.0)
    assert "was not run" in beyond.mean_ratio([1.0])


def test_pairs_without_a_cheaper_label_are_searched_again(chart):
    # On a map without a gradient no path is cheaper than the straight one; on FAR one is.
    flat = gravity.GravityMap(np.zeros((61, 81)), 1000.0, "flat", "analytic")
    tie = [Comparison(1.0, 1.0, {}, 0), Comparison(1.0, 1.0, {}, 0)]
    assert beyond.still_as_good(SMALL, {"m": flat}, {"m": tie}, 1.0) == (2, 2)
    assert beyond.still_as_good(SMALL, {"m": flat}, {"m": [Comparison(2.0, 1.0, {}, 0)]}, 1.0) == (
        0,
        0,
    )
    one = run.plan(SMALL, chart, FAR[0], 2.0, FAR[1])
    many = run.plan_labels(SMALL, chart, FAR[0], 2.0, FAR[1], epsilon=1.0)
    assert beyond.cheaper(one.cost, many.cost)
    assert not beyond.cheaper(one.cost, one.cost * (1 - 1e-12))


def test_comparison_runs_the_filter_on_the_best_bow_and_on_both_plans(chart):
    noise, table = run.draw(SMALL), labels.gain_table(gravity.gradient(chart))
    ours = beyond.compare(SMALL, chart, noise, FAR, table)
    one = run.plan(SMALL, chart, FAR[0], 2.0, FAR[1])
    many = run.plan_labels(SMALL, chart, FAR[0], 2.0, FAR[1], epsilon=1.0)
    assert ours.cost == one.cost
    assert ours.label_cost == many.cost < one.cost
    best = min(bows(SMALL, FAR)[0], key=lambda points: plain_sum(SMALL, chart, points, 2.0))
    compared = {
        "Planned": paths.resample(one.nodes * 1e3, SMALL.samples),
        "Labels": paths.resample(many.nodes * 1e3, SMALL.samples),
        "Fan": best,
        "Direct": paths.bow(*(np.array(FAR) * 1e3), 0.0, SMALL.samples),
    }
    assert ours.scores.keys() == compared.keys()
    for name, points in compared.items():
        expected = run.run(SMALL, chart, noise, points, 2.0)
        np.testing.assert_array_equal(ours.scores[name].squared, expected.squared)


def test_results_are_filed_under_their_map_and_noise(chart):
    maps = {"waves": chart, "short": waves(20)}
    grouped = beyond.all_bounds(SMALL, maps)
    assert list(grouped) == list(itertools.product(maps, SMALL.noise_mgal))
    for (name, mgal), results in grouped.items():
        pairs = beyond.draw_pairs(SMALL, maps[name], name)
        expected = [beyond.bounds(SMALL, maps[name], pair, mgal) for pair in pairs]
        assert results == expected


def test_maps_have_pairs_of_their_own(chart):
    first, second = (beyond.draw_pairs(SMALL, chart, name) for name in ("first", "second"))
    assert not set(first) & set(second)


# Tables -------------------------------------------------------------------------------------


def test_a_plan_wins_only_below_both_the_best_bow_and_the_direct_path():
    results = [
        facts(planned=1.0, direct=2.0, fan=3.0, dropped=1, length_ratio=1.5),
        facts(planned=1.0, direct=2.0, fan=math.inf, dropped=10, length_ratio=1.1),
        facts(planned=1.0, direct=2.0, fan=0.5, dropped=0, length_ratio=1.2),
        facts(planned=1.0, direct=0.8, fan=3.0, dropped=0, length_ratio=1.3),
        facts(planned=1.0, direct=2.0, fan=1.0, dropped=2, length_ratio=1.4),  # a tie
    ]
    won = estimates.share(2, 5)
    assert beyond.share_won(results) == won
    assert beyond.share_lost(results).value == 2 / 5  # a tie is neither won nor lost
    (row,) = beyond.share_table({("map", 2.0): results})
    assert row[:5] == ("map", 2.0, won.value, won.low, won.high)
    assert row[5:] == pytest.approx((1.0, 1.3, 13))  # medians, and a sum


def score(*rmse, runs=4, last=None, bound=1.0):
    squared = np.tile(np.square(np.array(rmse, dtype=float)), (runs, 1))
    if last is not None:
        squared[:, -1] = np.square(last)
    return scores.Score(squared, np.full(len(rmse), bound), 10e3)


def test_costs_are_compared_by_ratio_and_errors_by_the_geometric_mean():
    pairs = [
        Comparison(cost, 2.0, {"Planned": score(a, a), "Labels": score(1.0, 1.0)}, 0)
        for cost, a in ((2.0, 1.0), (3.0, 4.0), (8.0, 16.0))
    ]
    (row,) = beyond.cost_table({"map": pairs})
    logs = np.log([1.0, 4.0, 16.0])
    half = 4.302653 * logs.std(ddof=1) / math.sqrt(3)  # Student's t with 2 degrees of freedom
    expected = (1.5, 4.0, 4.0, 4.0 * math.exp(-half), 4.0 * math.exp(half))
    assert row[0] == "map"
    assert row[1:] == pytest.approx(expected, rel=1e-6)


def test_errors_are_compared_with_the_bound_and_lost_runs_counted_per_thousand():
    lost = score(500.0, 0.0, last=[10.0, 10.0, 900.0, 4100.0], bound=1000.0)  # 4 bounds: 4 km
    fine = score(1000.0, 1000.0, bound=1000.0)
    pairs = [
        Comparison(1.0, 1.0, {"Planned": one, "Labels": fine, "Direct": fine}, 0)
        for one in (fine, lost)
    ]
    rows = {row[1]: row[2:] for row in beyond.bound_table({"map": pairs[:1] + pairs})[:2]}
    over = (500 + math.sqrt((2 * 10**2 + 900**2 + 4100**2) / 4)) / 2000
    ends = sorted((1.0, over))
    assert rows["Planned"] == pytest.approx((over ** (1 / 3), *ends, 1000 / 12))
    assert rows["Labels"] == pytest.approx((1.0, 1.0, 1.0, 0.0))


def test_a_pair_without_a_bow_is_left_out_of_the_fan_only():
    with_bow = {name: score(2.0, 2.0) for name in ("Planned", "Labels", "Fan", "Direct")}
    without = {name: score(8.0, 8.0) for name in ("Planned", "Labels", "Direct")}
    rows = beyond.bound_table(
        {"map": [Comparison(1.0, 1.0, each, 0) for each in (with_bow, without)]}
    )
    means = {row[1]: row[2] for row in rows}
    assert means == pytest.approx({"Planned": 4.0, "Labels": 4.0, "Fan": 2.0, "Direct": 4.0})


def test_methods_are_listed_with_medians_and_both_bounds_in_km():
    one = score(1000.0, 0.0, last=[0.0, 1000.0, 2000.0, 9000.0], bound=500.0)
    case = Case({"sitan": one}, np.array([1000.0, 500.0]), np.array([1000.0, 800.0]), 10e3)
    filters, truth, prior = beyond.method_table({"case": case})
    assert filters[:2] == ("case", "sitan")
    total = 1 + math.sqrt((1 + 4 + 81) / 4)
    assert filters[2] == pytest.approx(total)
    assert filters[3] < total < filters[4]
    assert filters[5:] == (pytest.approx(1 + math.sqrt(2.5)), 1)  # above 4 bounds, 2 km: one run
    assert truth == ("case", "PCRB, truth", 1.5, None, None, None, None)
    assert prior == ("case", "PCRB, prior", 1.8, None, None, None, None)


def test_growth_of_the_noise_is_over_the_least_level_and_printed_where_the_paper_has_it():
    known, held = ([score(one), score(two)] for one, two in ((1.0, 3.0), (2.0, 8.0)))
    scenario = Scenario(noise_mgal=[2.5, 2.0])
    rows = printed.noise_growth(scenario, 1, known, held)
    assert rows == [(1, 2.0, 1.0, 1.0, 1.0), (1, 2.5, None, 3.0, 4.0)]
    rows = printed.noise_growth(Scenario(noise_mgal=[1.5, 2.0]), 1, known, held)
    assert [row[2] for row in rows] == [None, None]
    rows = printed.noise_growth(Scenario(noise_mgal=[1.0, 2.0]), 1, known, held)
    assert [row[2] for row in rows] == [1.0, 14.4 / 8.1]


# Scores and the printed tables ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("bound", "expected"),
    [(1.0, 2), (300.0, 1), (2000.0, 0)],  # above 1 km; above 1.2 km; above 8 km
)
def test_a_run_is_lost_beyond_a_kilometre_and_four_bounds(bound, expected):
    one = score(1e5, 0.0, last=[999.0, 1100.0, 1500.0, -10.0], bound=bound)
    assert one.diverged == expected


def test_band_is_the_interval_of_every_sample():
    squared = np.random.default_rng(1).gamma(1.0, 1e4, (50, 3))
    one = scores.Score(squared, np.ones(3), 10e3)
    low, high = one.band()
    for column in range(3):
        expected = estimates.root_mean_square(squared[:, column])
        ends = (expected.low, expected.high)
        assert (low[column], high[column]) == pytest.approx(ends, rel=1e-12)
    assert one.at(5.0).low == pytest.approx(low[1], rel=1e-12)


def test_best_other_is_not_the_planned_path():
    rows = {
        "Planned": [score(1.0), score(1.0)],
        "Direct": [score(3.0), score(2.0)],
        "L3": [score(2.0), score(3.0)],
    }
    assert [scores.best_other(rows, level) for level in (0, 1)] == ["L3", "Direct"]


def test_bootstrap_interval_holds_the_middle_95_percent_and_its_value():
    replicates = np.linspace(0.0, 1.0, 2001)
    inside = scores.percentile_estimate(0.5, replicates, 9)
    assert (inside.low, inside.high) == pytest.approx((0.025, 0.975))
    assert inside.se == pytest.approx(1 / math.sqrt(12), rel=1e-2)
    assert scores.percentile_estimate(1.5, replicates, 9).high == 1.5
    assert scores.percentile_estimate(-1.5, replicates, 9).low == -1.5


def test_bootstrap_weights_resample_the_runs():
    weights = scores.resamples(Scenario(runs=40), count=2000)
    assert weights.shape == (2000, 40)
    np.testing.assert_array_equal(weights.sum(axis=1), 40)
    np.testing.assert_allclose(weights.var(), 1 - 1 / 40, rtol=0.05)  # multinomial


@pytest.mark.parametrize("test", [1, 2])
def test_printed_tau_counts_the_pairs_of_paths_that_keep_their_order(test):
    cells = printed.SUMS_KM[test].values()
    signs = [np.sign((a[0] - b[0]) * (a[-1] - b[-1])) for a, b in itertools.combinations(cells, 2)]
    assert 0 not in signs  # no ties: tau-a and tau-b are the same
    assert printed.rank_stability(test) == pytest.approx(np.mean(signs))
