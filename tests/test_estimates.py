"""Intervals and the delta method, against textbooks, derivatives and repetition."""

import math

import numpy as np
import pytest
from scipy import stats

from seanav import estimates
from seanav.checks import ParameterError
from seanav.estimates import (
    Estimate,
    Statistic,
    average,
    exact,
    from_influence,
    mean,
    rms,
    root_mean_square,
    share,
)

# ---------------------------------------------------------------- intervals


def test_mean_has_the_textbook_t_interval():
    samples = np.random.default_rng(1).gamma(2.0, size=30)
    ours = mean(samples)
    reference = stats.ttest_1samp(samples, 0.0).confidence_interval(0.95)
    assert (ours.low, ours.high) == pytest.approx(tuple(reference), rel=1e-12)
    assert ours.se == pytest.approx(stats.sem(samples), rel=1e-12)
    assert ours.count == 30


@pytest.mark.parametrize(("wins", "count"), [(0, 14), (1, 14), (7, 14), (14, 14), (999, 1000)])
def test_share_is_the_wilson_interval(wins, count):
    ours = share(wins, count)
    reference = stats.binomtest(wins, count).proportion_ci(0.95, method="wilson")
    assert (ours.low, ours.high) == pytest.approx((reference.low, reference.high), abs=1e-12)
    assert ours.value == wins / count


@pytest.mark.parametrize(("wins", "count"), [(3, 2), (-1, 2), (0, 0), (1.0, 2)])
def test_share_names_the_bad_parameter(wins, count):
    with pytest.raises(ParameterError, match=r"^(wins|count) = "):
        share(wins, count)


def test_root_mean_square_has_the_delta_method_error():
    squared = np.random.default_rng(2).chisquare(2, 500)
    ours = root_mean_square(squared)
    assert ours.value == pytest.approx(math.sqrt(squared.mean()))
    # d sqrt(m) = dm / (2 sqrt(m))
    assert ours.se == pytest.approx(mean(squared).se / (2 * ours.value))


def test_root_mean_square_of_nothing_is_zero():
    assert root_mean_square(np.zeros(5)) == Estimate(0.0, 0.0, 0.0, 0.0, 5)


def coverage(estimate, truth, trials, seed):
    """Return (below, above): how often the true value lies outside, 2.5 % each."""
    rng = np.random.default_rng(seed)
    estimates = [estimate(rng) for _ in range(trials)]
    below = np.mean([truth < e.low for e in estimates])
    above = np.mean([truth > e.high for e in estimates])
    return below, above


def log_ratio(rng, paired=True):
    """Compare two errors that share most of their noise; the true log ratio is ln(1.1²)."""
    common = rng.standard_normal(200)
    a = (1.1 * (common + 0.3 * rng.standard_normal(200))) ** 2
    b = (common + 0.3 * rng.standard_normal(200)) ** 2
    other = b if paired else rng.permutation(b)
    influence = a / a.mean() - other / other.mean()
    return from_influence(math.log(a.mean() / b.mean()), influence)


INTERVALS = {
    "mean": (lambda rng: mean(rng.normal(3.0, 2.0, 12)), 3.0),
    "root mean square": (lambda rng: root_mean_square(rng.normal(0, 2.0, 400) ** 2), 2.0),
    "share": (lambda rng: share(int(rng.binomial(60, 0.8)), 60), 0.8),
    "paired log ratio": (log_ratio, math.log(1.21)),
}


@pytest.mark.parametrize("name", INTERVALS)
def test_intervals_cover_the_truth_in_95_percent(name):
    estimate, truth = INTERVALS[name]
    below, above = coverage(estimate, truth, 2000, seed=3)
    # Two-sided: both tails together near 5 %, neither far from its half.
    assert 0.03 < below + above < 0.07
    assert max(below, above) < 0.05


def test_coverage_test_sees_wrong_intervals():
    def too_narrow(rng):  # the normal quantile with 12 samples and no ddof
        samples = rng.normal(3.0, 2.0, 12)
        half = 1.96 * samples.std() / math.sqrt(12)
        return Estimate(samples.mean(), samples.mean() - half, samples.mean() + half, 1.0, 12)

    assert sum(coverage(too_narrow, 3.0, 2000, seed=3)) > 0.07
    unpaired = sum(coverage(lambda rng: log_ratio(rng, paired=False), math.log(1.21), 2000, 3))
    assert unpaired < 0.03  # ignoring the common noise makes the interval too wide


@pytest.mark.parametrize("bad", [[1.0], [], [[1.0, 2.0]]])
def test_from_influence_refuses_runs_without_an_interval(bad):
    with pytest.raises(ValueError, match="one number for each of at least 2 runs"):
        from_influence(0.0, np.asarray(bad))


@pytest.mark.parametrize("lost", [math.nan, math.inf, -math.inf])
def test_one_run_that_diverges_is_told_and_never_averaged_away(lost):
    squares = np.array([1.0, 2.0, lost, 4.0])
    for found in (
        from_influence(0.0, squares),
        root_mean_square(squares),
        mean(squares),
        estimates.ratio(squares, np.ones(4)),
        estimates.log_ratio(np.ones(4), squares),
        (100 * (rms(np.ones(4)) - rms(squares)) / rms(np.arange(4.0))).estimate(),
        rms(np.stack([squares, np.ones(4)], axis=1)).sum().estimate(),
    ):
        assert found.diverged
        assert found.low == found.high == found.se == math.inf
    assert not rms(np.stack([squares, np.ones(4)], axis=1))[1].estimate().diverged


def test_estimate_refuses_a_value_outside_its_interval():
    with pytest.raises(ValueError, match="not an estimate"):
        Estimate(2.0, 0.0, 1.0, 0.5, 10)


@pytest.mark.parametrize("rounding", [0.0, 1e-9])
def test_estimate_refuses_what_is_not_a_number(rounding):
    with pytest.raises(ValueError, match="not an estimate"):
        exact(math.nan, rounding)


def test_exact_has_no_width():
    assert exact(3) == Estimate(3.0, 3.0, 3.0, 0.0, 0)


# ---------------------------------------------------------------- the delta method

A, B = np.random.default_rng(1).gamma(2.0, size=(2, 40))
FORMS = {
    "sum": lambda a, b: a + b + 1.5,
    "difference": lambda a, b: 2.0 - a - b * 3.0,
    "product": lambda a, b: 2.0 * a * b,
    "quotient": lambda a, b: a / b / 7.0,
    "reciprocal": lambda a, b: 3.0 / (a + b),
    "power": lambda a, b: (a + b) ** 3,
    "rate": lambda a, b: 100.0 * (b - a**0.5) / (b - 0.1 * a),
}


def influence_by_difference(form, step=1e-6):
    """Derivative of the number when the mean moves towards the scores of one run."""
    runs = []
    for a, b in zip(A - A.mean(), B - B.mean(), strict=True):
        ahead, behind = (
            form(A.mean() + sign * step * a, B.mean() + sign * step * b) for sign in (1, -1)
        )
        runs.append((ahead - behind) / (2 * step))
    return np.array(runs)


@pytest.mark.parametrize("name", FORMS)
def test_influence_is_the_derivative_along_each_run(name):
    form = FORMS[name]
    found = form(average(A), average(B))
    assert found.value == pytest.approx(form(A.mean(), B.mean()), rel=1e-14)
    np.testing.assert_allclose(found.influence, influence_by_difference(form), rtol=1e-7)


@pytest.mark.parametrize("name", ["sqrt", "log"])
def test_functions_are_the_derivative_along_each_run(name):
    def form(a, b):
        return getattr(np, name)(a / b)

    found = getattr(average(A) / average(B), name)()
    assert found.value == pytest.approx(form(A.mean(), B.mean()), rel=1e-14)
    np.testing.assert_allclose(found.influence, influence_by_difference(form), rtol=1e-7)


def test_a_sum_over_time_is_the_sum_of_its_parts():
    squares = np.random.default_rng(2).gamma(1.0, size=(30, 5))
    whole = rms(squares).sum()
    parts = [rms(squares[:, k]) for k in range(5)]
    by_hand = parts[0] + parts[1] + parts[2] + parts[3] + parts[4]
    assert whole.value == pytest.approx(by_hand.value)
    np.testing.assert_allclose(whole.influence, by_hand.influence, atol=1e-15)
    assert rms(squares)[2].value == parts[2].value
    np.testing.assert_allclose(rms(squares).mean().influence, whole.influence / 5)


def test_paired_scores_are_paired_by_themselves():
    # The same error in both scores cancels in their ratio: its interval has no width.
    ratio = (rms(4.0 * A) / rms(A)).estimate()
    assert (ratio.low, ratio.high) == pytest.approx((2.0, 2.0))
    free = rms(4.0 * A).estimate()
    assert free.high - free.low > 0.1


def test_a_score_that_is_zero_in_every_run_is_zero_exactly():
    assert rms(np.zeros(5)).estimate() == estimates.Estimate(0.0, 0.0, 0.0, 0.0, 5)


def test_ratio_is_positive_and_its_interval_that_of_the_logarithm():
    log, ratio = estimates.log_ratio(A, B), estimates.ratio(A, B)
    assert np.log([ratio.value, ratio.low, ratio.high]) == pytest.approx(
        [log.value, log.low, log.high]
    )
    assert log.value == pytest.approx(0.5 * np.log(A.mean() / B.mean()))
    assert (rms(A) / rms(B)).estimate_of_log() == ratio


def test_an_array_on_the_left_is_no_array_of_statistics():
    assert isinstance(np.float64(2.0) * average(A), Statistic)
    assert isinstance(np.float64(2.0) - average(A), Statistic)


COVERED = {
    "ratio of RMS": (lambda a, b: estimates.ratio(a**2, b**2), np.sqrt(6.0 / 20.0)),
    "log ratio": (lambda a, b: estimates.log_ratio(a**2, b**2), 0.5 * np.log(6.0 / 20.0)),
    "mean": (lambda a, b: estimates.mean(a), 2.0),
    "RMS": (lambda a, b: estimates.root_mean_square(a**2), np.sqrt(6.0)),
    "rate": (
        lambda a, b: ((average(b) - average(a)) / (average(b) - 0.5)).estimate(),
        2.0 / 3.5,
    ),
}


@pytest.mark.parametrize("name", COVERED)
def test_intervals_hold_the_truth_as_often_as_they_say(name):
    # a ~ gamma(2), b = a' + gamma(2): correlated, with known first and second moments.
    form, truth = COVERED[name]
    generator = np.random.default_rng(3)
    held = 0
    for _ in range(1000):
        a = generator.gamma(2.0, size=200)
        b = a + generator.gamma(2.0, size=200)
        found = form(a, b)
        held += found.low <= truth <= found.high
    assert 0.93 <= held / 1000 <= 0.97


def test_consistency_bounds_hold_a_mean_nees_as_often_as_they_say():
    generator = np.random.default_rng(4)
    low, high = estimates.consistency_bounds(3, 50)
    means = generator.chisquare(3, size=(4000, 50)).mean(axis=1)
    assert ((low <= means) & (means <= high)).mean() == pytest.approx(0.95, abs=0.01)


def test_what_rounding_leaves_of_zero_is_zero():
    assert [estimates.exact(x, 1e-9).value for x in (4e-14, -4e-14, 1e-9, -2e-3)] == [
        0.0,
        0.0,
        1e-9,
        -2e-3,
    ]
    assert estimates.exact(4e-14).value == 4e-14


def test_an_estimate_over_a_number():
    one = estimates.over(Estimate(6.0, 4.0, 8.0, 1.0, 9), 2.0)
    assert one == Estimate(3.0, 2.0, 4.0, 0.5, 9)
