"""Paper 5's study: its scenario, its paths, its scores."""

import numpy as np
import pytest
from scipy import stats

from seanav import checks, estimates, montecarlo
from seanav.models import gravity, paths
from seanav.studies.gravity_planning import beyond, printed, run, scores
from seanav.studies.gravity_planning.scenario import Scenario


@pytest.fixture(scope="module")
def chart():
    north, east = np.mgrid[0:61, 0:81] * 1e3
    field = 20e-5 * np.sin(2 * np.pi * east / 40e3) * np.cos(2 * np.pi * north / 30e3)
    return gravity.GravityMap(field, 1000.0, "waves", "analytic")


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("runs", -1, "integer of at least 3"),
        ("runs", 2.5, "integer of at least 3"),
        ("noise_mgal", [1, 0], "at least 1e-06"),
        ("noise_mgal", [1, 1e300], "at most 10000"),
        ("initial_std_km", 1e300, "at most 20"),
        ("process_noise", 1e200, "at most 10"),
        ("noise_mgal", [], "a list of 1 to 64 values"),
        ("noise_mgal", [2.0, 2.0], "every value once"),
        ("noise_mgal", "12", "a list of 1 to 64 values"),
        ("planning_noise_mgal", 2.5, "one of 1.0, 2.0, 3.0, 4.0"),
        ("epsilon", -0.1, "at least 0"),
        ("goal", [65], "a list of 2 values"),
        ("start_1", [65, 9], "must differ from goal"),
        ("start_2", [30.5, 58], "integer of at least 0"),
        ("label_pairs", 61, "at most 60"),
        ("speed", 0.0, "at least 0.1"),
        ("map_latitude_deg", 95.0, "at most 80"),
        ("map_unit", "m", "one of 'file', 'mGal'"),
        ("map_source", 7, "must be text"),
        ("runs", 50_000, "at most 40000 for 100 samples"),
    ],
)
def test_scenario_names_what_is_wrong(name, value, allowed):
    with pytest.raises(checks.ParameterError, match=allowed) as error:
        Scenario(**{name: value})
    assert str(error.value).startswith(f"{name} = ")
    assert "\n" not in str(error.value)


def test_start_off_the_map_is_refused_before_any_work():
    scenario = Scenario(map_source="synthetic", start_1=(101, 5))
    with pytest.raises(checks.ParameterError, match=r"start_1 = \[101, 5\]: must lie on the map"):
        scenario.map()


@pytest.mark.parametrize(
    ("path", "allowed"),
    [
        ([[1, 2]], "two or more"),
        ([[1, 2], [3]], "a list of 2 values"),
        ([[1, 2], [3, float("nan")]], "finite number"),
        ([[1, 2], [1, 2]], "from one place to another"),
        ([[1, 2], [81, 3]], "stay on the map, 0 … 80 by 0 … 60 km"),
    ],
)
def test_user_path_is_checked(chart, path, allowed):
    with pytest.raises(checks.ParameterError, match=allowed):
        Scenario(user_path_km=path).user_path(chart)


def test_user_path_is_resampled(chart):
    points = Scenario(user_path_km=[[10, 10], [20, 10], [20, 30]]).user_path(chart)
    assert points.shape == (100, 2)
    np.testing.assert_allclose(points[[0, -1]], [[10e3, 10e3], [20e3, 30e3]])


def test_quick_keeps_a_tenth_of_the_runs():
    scenario = Scenario()
    quick = scenario.quick()
    assert quick.runs >= scenario.runs / 10
    assert quick.pairs >= scenario.pairs / 10
    assert quick.label_pairs >= scenario.label_pairs / 10
    assert quick.noise_mgal == scenario.noise_mgal


def test_samples_are_equidistant_on_a_corner():
    points = paths.resample(np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 5.0]]), 9)
    np.testing.assert_allclose(points[:, 0] + points[:, 1], np.linspace(0, 8, 9), atol=1e-12)
    assert paths.length(points) == pytest.approx(8.0)


@pytest.mark.parametrize("goal", [(40e3, 10e3), (10e3, 50e3), (60e3, 45e3), (20e3, 38e3)])
def test_positive_bow_lies_left_on_the_map(goal):
    start = np.array([40e3, 40e3])
    middle = paths.bow(start, goal, 5e3, 101)[50] - (start + goal) / 2
    assert np.hypot(*middle) == pytest.approx(5e3, rel=1e-5)
    assert middle @ (np.asarray(goal) - start) == pytest.approx(0, abs=1)
    assert middle[0] < 0


def test_bow_of_a_path_due_east_lies_north():
    assert paths.bow((0, 0), (10e3, 0), 1e3, 11)[5, 1] == pytest.approx(1e3)


def test_bow_length_is_that_of_a_sine_arc():
    share = np.linspace(0, 1, 200_001)
    slope = 6e3 * np.pi * np.cos(np.pi * share)
    arc = np.trapezoid(np.hypot(30e3, slope), share)
    assert paths.length(paths.bow((0, 0), (0, 30e3), 6e3, 2001)) == pytest.approx(arc, rel=1e-5)


def test_fan_drops_and_counts_bows_that_leave_the_map(chart):
    curves, dropped = run.fan(chart, (10, 50), (10, 10), (15.0, 5.0, -5.0), 50)
    assert list(curves) == ["Direct", "L4", "L5"]
    assert dropped == 1


def test_displaced_path_keeps_its_ends_and_moves_by_the_amplitude():
    straight = paths.bow((0, 0), (0, 40e3), 0.0, 101)
    moved = paths.displaced(straight, 2e3)
    np.testing.assert_allclose(moved[[0, -1]], straight[[0, -1]], atol=1e-9)
    assert moved[50, 0] == pytest.approx(-2e3, rel=1e-6)


def test_nearest_bows_are_sorted_by_their_gap():
    curves = {
        name: paths.bow((50e3, 50e3), (50e3, 10e3), amplitude, 60)
        for name, amplitude in (
            ("Planned", 8e3),
            ("Direct", 0),
            ("L3", 16e3),
            ("L4", 9e3),
            ("L5", 4e3),
        )
    }
    assert run.nearest(curves, 2) == ["L4", "L5"]


def score_of(squared, bound=None):
    bound = np.sqrt(squared.mean(axis=0)) if bound is None else bound
    return scores.Score(squared, bound, 10e3)


@pytest.fixture
def squared():
    return np.random.default_rng(3).gamma(1.0, 1e4, (2000, 12)).cumsum(axis=1)[:, ::-1].copy()


def test_standard_error_of_the_sum_is_that_of_the_bootstrap(squared):
    one = score_of(squared)
    weights = np.random.default_rng(4).multinomial(2000, np.full(2000, 1 / 2000), 2000)
    totals = np.sqrt(weights @ squared / 2000).sum(axis=1)
    assert one.total.value == pytest.approx(np.sqrt(squared.mean(axis=0)).sum())
    assert one.total.se == pytest.approx(totals.std(), rel=0.06)


def test_paired_ratio_is_sharper_than_an_unpaired_one(squared):
    twin = score_of(4 * squared * np.random.default_rng(5).uniform(0.99, 1.01, squared.shape))
    other = score_of(np.random.default_rng(6).permutation(squared))
    paired = scores.ratio(twin, score_of(squared))
    unpaired = scores.ratio(twin, other)
    assert paired.low < 2.0 < paired.high
    assert paired.se < 0.1 * unpaired.se


def test_ratio_at_a_distance_uses_that_sample(squared):
    a, b = squared.copy(), squared.copy()
    a[:, 6] *= 9.0
    at = [scores.ratio_at(score_of(a), score_of(b), km).value for km in (5.45, 6.4)]
    np.testing.assert_allclose(at, [3.0, 1.0])


def test_distance_of_the_minimum_and_its_interval():
    along = np.arange(21.0)
    squared = (along - 14.0) ** 2 + np.random.default_rng(7).gamma(1.0, 60.0, (400, 21))
    one = scores.Score(squared, np.ones(21), 20e3)
    weights = scores.resamples(Scenario(runs=400))
    estimate = scores.minimum_km(one, weights)
    assert estimate.low <= 14.0 <= estimate.high
    assert 0 < estimate.high - estimate.low < 10


def test_lowest_ratio_compares_the_lowest_places_of_two_paths(squared):
    a, b = squared.copy(), squared.copy()
    a[:, 3] = 1e-2 * a[:, 11]
    b[:, 5] = 4e-2 * a[:, 11]
    one = scores.lowest_ratio(score_of(a), score_of(b))
    assert one.value == pytest.approx(0.5)
    assert one.se < 1e-12  # paired: the same runs


def test_paper_se_is_that_of_a_thousand_runs():
    ours = estimates.Estimate(5e3, 4e3, 6e3, 500.0, 4000)
    assert printed.paper_se(Scenario(runs=4000), ours) == pytest.approx(0.5 * 2)


def test_rank_stability_is_one_for_one_order_and_minus_one_for_the_opposite():
    weights = scores.resamples(Scenario(runs=50))
    base = np.full((50, 4), 1.0)
    rows = {
        name: [score_of(base * k), score_of(base * k**2)]
        for name, k in zip("abc", (1, 2, 3), strict=True)
    }
    assert scores.rank_stability(rows, weights).low == 1.0
    rows = {
        name: [score_of(base * k), score_of(base / k)]
        for name, k in zip("abc", (1, 2, 3), strict=True)
    }
    assert scores.rank_stability(rows, weights).high == -1.0


def test_paths_that_tie_have_no_order():
    # The plan is the direct path where the map says nothing: tau would be 0/0.
    weights = scores.resamples(Scenario(runs=5))
    squared = np.arange(1.0, 21.0).reshape(5, 4)
    row = [score_of(squared), score_of(2 * squared)]
    assert scores.rank_stability({"Planned": row, "Direct": row}, weights) == scores.TIE
    assert scores.rank_agreement(np.ones(2), np.array([1.0, 2.0])) == scores.TIE
    # Two paths that differ in one run alone: a resample without it ties, the paths do not.
    other = squared.copy()
    other[0] *= 2
    rows = {"Planned": row, "Direct": [score_of(other), score_of(2 * other)]}
    assert scores.rank_stability(rows, weights).low == 1.0


@pytest.mark.parametrize(("reading", "expected"), [("absolute", 0.02), ("relative", np.log(2 / 3))])
def test_growth_of_the_gain(reading, expected):
    # sums of RMSE: planned 10 then 30, direct 20 then 40 … absolute gain 10 → 10 + 20
    level = {
        name: [score_of(np.full((10, 4), (total / 4) ** 2)) for total in totals]
        for name, totals in {
            "Planned": (10.0, 30.0),
            "Direct": (20.0, 60.0 if reading == "absolute" else 40.0),
        }.items()
    }
    assert scores.growth(level, reading).value == pytest.approx(expected)


def test_contour_length_obeys_the_coarea_formula():
    # The length of all contours per area is the gradient over the interval; on this ramp exactly.
    north, east = np.mgrid[0:41, 0:41] * 1e3
    ramp = gravity.GravityMap((3e-8 * east + 4e-8 * north), 1000.0, "ramp", "analytic")
    lengths, steepness = scores.contour_density(ramp, levels=599, block=10)
    np.testing.assert_allclose(steepness, 5e-8)
    inner = lengths.reshape(4, 4)[1:3, 1:3]
    interval = (3e-8 + 4e-8) * 40e3 / 600
    np.testing.assert_allclose(inner, 5e-8 * 100e6 / interval, rtol=0.02)


def test_rank_correlation_matches_scipy_and_covers():
    stream = np.random.default_rng(8)
    rho, inside = 0.7, 0
    true = 6 / np.pi * np.arcsin(rho / 2)  # Spearman's coefficient of a binormal pair
    for _ in range(400):
        a, b = stream.multivariate_normal([0, 0], [[1, rho], [rho, 1]], 80).T
        one = scores.rank_correlation(a, b)
        inside += one.low <= true <= one.high
    assert one.value == pytest.approx(stats.spearmanr(a, b).statistic)
    assert 0.91 <= inside / 400 <= 0.985


def test_filter_reaches_the_bound_on_a_plane():
    scenario = Scenario(runs=2000)
    covariance, errors = run.plane_check(scenario, run.draw(scenario))
    assert covariance.value < 1e-12
    assert errors.low <= 1.0 <= errors.high


# Matched moments of the initial errors ------------------------------------------------------


@pytest.mark.parametrize("runs", [3, 7, 400])
def test_initial_errors_have_the_nominal_moments(runs):
    scenario = Scenario(runs=runs)
    initial = run.draw(scenario).initial
    np.testing.assert_allclose(initial.mean(axis=0), 0, atol=1e-12)
    np.testing.assert_allclose(initial.T @ initial / runs, np.eye(2), atol=1e-12)
    # Shifted and stretched, not replaced: the errors are still those that were drawn.
    drawn = run.drawn_initial(scenario)
    correlation = [np.corrcoef(a, b)[0, 1] for a, b in zip(initial.T, drawn.T, strict=True)]
    assert runs < 10 or min(correlation) > 0.99


def ramp():
    north, east = np.mgrid[0:61, 0:81] * 1e3
    return gravity.GravityMap(2e-8 * east + 1e-8 * north, 1000.0, "ramp", "analytic")


def test_without_matching_a_linear_filter_misses_the_bound_by_the_sample_of_its_start():
    # On a plane, without process noise, e(t) = A e(0) + noise with A = P(t) P(0)^-1: the mean
    # square of the first part is tr(A C Aᵀ) for the sample's second moment C, tr(A P0 Aᵀ) on
    # average. With (almost) no noise of the readings the second part is nothing.
    scenario = Scenario(runs=50, samples=20, process_noise=0.0)
    points = paths.bow((20e3, 50e3), (60e3, 10e3), 0.0, 20)
    noise, raw = run.draw(scenario), run.drawn_initial(scenario)
    quiet = np.zeros_like(noise.measurement)
    A = run.bound(scenario, ramp(), points, 2.0) @ np.linalg.inv(scenario.P0)
    for initial in (raw, noise.initial):
        drawn = run.Noise(initial, noise.drift, quiet)
        one = run.run(scenario, ramp(), drawn, points, 2.0)
        C = initial.T @ initial / len(initial) * 1e6
        expected = np.sqrt(np.trace(A @ C @ A.transpose(0, 2, 1), axis1=1, axis2=2))
        np.testing.assert_allclose(one.rmse, expected, rtol=1e-6)
    average = np.sqrt(np.trace(A @ scenario.P0 @ A.transpose(0, 2, 1), axis1=1, axis2=2))
    np.testing.assert_allclose(one.rmse, average, rtol=1e-6)  # the matched one, the last


def test_intervals_of_matched_runs_are_as_wide_as_the_scatter_over_seeds(chart):
    points = paths.bow((20e3, 50e3), (60e3, 10e3), 3e3, 30)
    matched, plain, told = [], [], []
    for seed in range(120):
        scenario = Scenario(runs=200, samples=30, seed=seed)
        noise = run.draw(scenario)
        one = run.run(scenario, chart, noise, points, 2.0)
        raw = run.Noise(run.drawn_initial(scenario), noise.drift, noise.measurement)
        other = run.run(scenario, chart, raw, points, 2.0).drawn
        matched.append(one.total.value)
        plain.append(other.total.value)
        told.append((one.total.se, other.total.se))
    told = np.mean(told, axis=0)
    # The standard deviation of 120 numbers is known to 6.5 %.
    assert np.std(matched) == pytest.approx(told[0], rel=0.2)
    assert np.std(plain) == pytest.approx(told[1], rel=0.2)
    assert np.std(matched) < 0.8 * np.std(plain)


def test_matched_score_leaves_the_start_without_sampling_error(chart):
    scenario = Scenario(runs=200, samples=30)
    points = paths.bow((20e3, 50e3), (60e3, 10e3), 3e3, 30)
    one = run.run(scenario, chart, run.draw(scenario), points, 2.0)
    assert one.rmse[0] == pytest.approx(np.sqrt(2) * 1e3, rel=1e-12)
    assert one.at(0.0).se < 1e-9
    assert one.drawn.at(0.0).se > 10
    few = run.Noise(*(part[: scores.FEWEST - 1] for part in vars(run.draw(scenario)).values()))
    small = run.run(scenario, chart, few, points, 2.0)
    assert small.total == small.drawn.total  # too few runs to fit five coefficients


def test_filter_that_assumes_too_little_noise_does_not_reach_it(chart):
    scenario = Scenario(runs=500, samples=40)
    points = paths.bow((20e3, 50e3), (60e3, 10e3), 0.0, 40)
    noise = run.draw(scenario)
    right = run.run(scenario, chart, noise, points, 2.0)
    wrong = run.run(scenario, chart, noise, points, 2.0, assumed_mgal=0.2)
    assert scores.ratio(wrong, right).low > 1.0


@pytest.mark.parametrize(
    "change", [{"initial_std_km": 5.0}, {"process_noise": 10.0}, {"initial_std_km": 0.05}]
)
def test_point_mass_filter_runs_with_every_prior_and_drift(chart, change):
    scenario = Scenario(runs=3, samples=12, **change)
    points = paths.bow((20e3, 50e3), (60e3, 10e3), 0.0, 12)
    one = run.run(scenario, chart, run.draw(scenario), points, 2.0, method="point mass")
    assert np.isfinite(one.rmse).all()


def test_batches_and_threads_do_not_change_a_score(chart):
    scenario = Scenario(runs=600, samples=30)
    points = paths.bow((20e3, 50e3), (60e3, 10e3), 3e3, 30)
    noise = run.draw(scenario)
    whole = run.run(scenario, chart, noise, points, 2.0)
    cut = run.run_all(scenario, chart, noise, {"one": points}, [2.0])["one"][0]
    np.testing.assert_array_equal(whole.squared, cut.squared)
    assert whole.rmse[0] == pytest.approx(np.sqrt(2) * 1e3, rel=0.1)


def test_expected_bound_is_the_bound_where_the_gradient_is_constant():
    north, east = np.mgrid[0:61, 0:81] * 1e3
    ramp = gravity.GravityMap(3e-8 * east + 4e-8 * north, 1000.0, "ramp", "analytic")
    scenario = Scenario(samples=20)
    points = paths.bow((20e3, 50e3), (60e3, 10e3), 0.0, 20)
    np.testing.assert_allclose(
        run.expected_bound(scenario, ramp, points, 2.0),
        run.bound(scenario, ramp, points, 2.0),
        rtol=1e-9,
    )


def test_expected_bound_agrees_with_sampled_truths(chart):
    scenario = Scenario(samples=20)
    points = paths.bow((20e3, 45e3), (60e3, 15e3), 0.0, 20)
    shifts = montecarlo.normals(1, "truth", 4000, (2,)) * 1e3
    slopes = gravity.interpolate(gravity.gradient(chart), chart.spacing, points + shifts[:, None])
    mean = np.einsum("nsi,nsj->sij", slopes, slopes) / len(slopes) / (2e-5) ** 2
    P = scenario.P0
    for step in range(1, 20):
        P = np.linalg.inv(np.linalg.inv(P + run.Q_step(scenario, points)) + mean[step])
    ours = run.expected_bound(scenario, chart, points, 2.0)[-1]
    np.testing.assert_allclose(ours, P, rtol=0.03, atol=0.01 * np.trace(P))


def test_all_84_printed_cells_are_there():
    cells = [cell for test in printed.SUMS_KM.values() for row in test.values() for cell in row]
    assert len(cells) == 84


def test_printed_table_3_contradicts_its_constant_ranking():
    assert printed.rank_stability(1) == pytest.approx(1.0)
    assert printed.rank_stability(2) < 1.0


def test_printed_gain_in_test_2_grows_in_km_and_shrinks_in_ratio():
    assert printed.gain_growth(2, "absolute") == pytest.approx(5.9)
    assert printed.gain_growth(2, "relative") < 0


def test_random_pairs_keep_their_distance_and_margin(chart):
    pairs = beyond.draw_pairs(Scenario(pairs=40), chart, "waves")
    ends = np.array(pairs)
    assert ends.shape == (40, 2, 2)
    assert np.hypot(*(ends[:, 1] - ends[:, 0]).T).min() >= beyond.CLOSEST
    assert ends.min() >= beyond.MARGIN
    assert (ends[..., 0] < 81 - beyond.MARGIN).all()
    assert (ends[..., 1] < 61 - beyond.MARGIN).all()
    assert pairs[:7] == beyond.draw_pairs(Scenario(pairs=7, label_pairs=7), chart, "waves")
