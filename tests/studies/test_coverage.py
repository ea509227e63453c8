"""Every paired comparison holds the truth in 95 of 100 repetitions, and sees that it is paired.

Runs are made up: squared errors of mean one, most of whose chance two filters share, times a
number that is known. What a comparison should find is computed from those numbers by hand.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from seanav import estimates
from seanav.filters.ins.score import Flight, MeanSquares, Series
from seanav.studies.adaptive_fading import scores as fading
from seanav.studies.gravity_planning import scores as planning
from seanav.studies.imm_sea_current import scores as current
from seanav.studies.ito_filter import scores as ito
from seanav.studies.neural_estimator import scores as neural

RUNS, TRIALS = 100, 1000
TCEP = {"pure": 2 * 0.589 * 3.0, "best": 2 * 0.589, "own": 2 * 0.589 * math.sqrt(2.0)}


def chance(rng, *shape, own=0.3, filters=2):
    """Return squared errors of mean one, (filters, RUNS, *shape)."""
    common = rng.standard_normal((RUNS, *shape))
    each = rng.standard_normal((filters, RUNS, *shape))
    return (common + own * each) ** 2 / (1 + own**2)


def flight(squares, modes=None):
    """Return a flight whose mean squares are all the given ones, (RUNS,)."""
    modes = np.full((2, RUNS), 0.5) if modes is None else modes
    nothing = np.zeros(RUNS)
    none = Series(np.zeros((0, 16, RUNS)), np.zeros((0, RUNS)), np.zeros((0, 2, RUNS)))
    return Flight(
        MeanSquares(*[squares] * 5), nothing, nothing, nothing, nothing, modes, none, nothing
    )


def three(rng):
    """Return flights of a filter, of pure navigation and of the optimal EKF."""
    shared = rng.chisquare(4, RUNS) / 4
    own = 0.9 * shared + 0.1 * rng.chisquare(4, RUNS) / 4
    return flight(2.0 * own), flight(9.0 * shared), flight(1.0 * shared)


def modes(rng):
    """Return two flights, the second with a first mode probability that is 0.1 higher."""
    common = rng.uniform(0.3, 0.5, RUNS)
    first = common + rng.normal(0, 0.02, RUNS), common + 0.1 + rng.normal(0, 0.02, RUNS)
    return [flight(np.ones(RUNS), np.array([one, 1 - one])) for one in first]


def recorded(rng):
    """Return a flight whose position errors shrink to half at the second of two records."""
    errors = rng.standard_normal((2, 16, RUNS))
    errors[1] = 0.5 * (0.8 * errors[0] + 0.6 * errors[1])
    none = np.zeros((2, 2, RUNS))
    return flight(np.ones(RUNS))._replace(series=Series(errors, none[0], none))


def paths(rng, factors=(1.2, 1.0), bends=((1.0, 1.0, 1.0), (1.0, 1.0, 1.0))):
    """Return two paths' scores: RMSE of each sample is its factor times its bend."""
    found = []
    for each, factor, bend in zip(chance(rng, 3), factors, bends, strict=True):
        squared = each * (factor * np.array(bend)) ** 2
        found.append(planning.Score(squared, np.ones(3), 2000.0))
    return found


def ito_pair(rng):
    a, b, c = chance(rng, 6, filters=3)
    squares = (1.44 * a, b, 9.0 * c)
    one, other, far = (ito.Score(s, np.ones(s.shape), s[:, 0], s[0]) for s in squares)
    return ito.Result(None, None, None, {"gaussian": one, "ekf": other, "prediction only": far})


def growing(rng):
    """Return errors (RUNS, 100 steps, 1) that are 1.5 times as large in the last fifth."""
    level = np.exp(0.3 * rng.standard_normal((RUNS, 1, 1)))
    errors = level * rng.standard_normal((RUNS, 100, 1))
    errors[:, 80:] *= 1.5
    return errors


CASE = SimpleNamespace(times=np.arange(1, 101) * 1.0)
SCENARIO = SimpleNamespace(duration=100.0)
RATE = 100 * (TCEP["pure"] - TCEP["own"]) / (TCEP["pure"] - TCEP["best"])


def steady_and_random(rng):
    """Return errors (RUNS, 20, 1): a common one of 0.5 under noise of one."""
    return 0.5 + rng.standard_normal((RUNS, 20, 1))


def pairs_won(rng):
    a, b = chance(rng)
    return neural.won(a, b)


def two_draws(rng):
    """Return results of two draws of the weights: variance 1 of the runs, 0.25 of the weights."""
    return rng.standard_normal(RUNS) + 0.5 * rng.standard_normal((2, RUNS))


def correlated(rng):
    return rng.multivariate_normal([0, 0], [[1, 0.6], [0.6, 1]], RUNS).T


def scaled(rng, *factors):
    return [f * one for f, one in zip(factors, chance(rng), strict=True)]


PAIRED = {
    "log ratio": (lambda rng: estimates.log_ratio(*scaled(rng, 1.44, 1.0)), math.log(1.2)),
    "ratio": (lambda rng: estimates.ratio(*scaled(rng, 1.44, 1.0)), 1.2),
    "over": (lambda rng: estimates.over(estimates.ratio(*scaled(rng, 1.44, 1.0)), 2.0), 0.6),
    "3, ratio of a state": (
        lambda rng: fading.ratio(*(s[:, None] for s in scaled(rng, 1.44, 1.0)), 0), 1.2),
    "3, geometric mean": (
        lambda rng: fading.ratio(*(chance(rng, 3) * [[[1.44] * 3], [[1.0] * 3]])), 1.2),
    "3, growth": (lambda rng: fading.growth(growing(rng), CASE, SCENARIO, 0), 1.5),
    "3, systematic share": (
        lambda rng: fading.systematic_share(steady_and_random(rng), np.full(20, True), 0),
        0.25 / 1.25),
    "4, ratio of TCEPs": (
        lambda rng: current.tcep_ratio(*map(flight, scaled(rng, 1.44, 1.0))), 1.2),
    "4, ratio of cells": (
        lambda rng: current.ratio(*map(flight, scaled(rng, 1.44, 1.0)), 1), 1.2),
    "4, rate": (lambda rng: current.rate(*three(rng)), RATE),
    "4, sharp rate": (
        lambda rng: current.rate(*three(rng), (TCEP["pure"], TCEP["best"])), RATE),
    "4, difference of rates": (
        lambda rng: (lambda f: current.rate_difference(f, (f[1], *f[1:])))(three(rng)), RATE),
    "4, difference of advantages": (
        lambda rng: (lambda f: current.advantage_difference(f, (f[1], *f[1:]), (f[2], *f[1:]), f))(
            three(rng)),
        2 * RATE - 100),
    "4, mode difference": (lambda rng: current.mode_difference(*modes(rng)), -0.1),
    "4, mode contrast": (lambda rng: current.mode_contrast_difference(*modes(rng), -1), 0.2),
    "4, fall of the RMS": (lambda rng: current.falls(recorded(rng), 0, 1)[0], 0.5),
    "4, fall of the TCEP": (
        lambda rng: current.falls(recorded(rng), 0, 1)[1], math.sqrt((1 + 0.25) / 2)),
    "5, ratio of sums": (lambda rng: planning.ratio(*paths(rng)), 1.2),
    "5, ratio at a distance": (lambda rng: planning.ratio_at(*paths(rng), 1.0), 1.2),
    "5, ratio of the lowest": (
        lambda rng: planning.lowest_ratio(*paths(rng, bends=((3.0, 1.0, 3.0), (3.0, 3.0, 1.0)))),
        1.2),
    "5, relative growth": (
        lambda rng: planning.growth(
            {"Planned": paths(rng, (1.0, 2.0)), "Direct": paths(rng, (1.5, 3.3))}, "relative"),
        math.log(1.1)),
    "5, absolute growth": (
        lambda rng: planning.growth(
            {"Planned": paths(rng, (1.0, 2.0)), "Direct": paths(rng, (1.5, 3.3))}, "absolute"),
        3 * (1.3 - 0.5) / 1000),
    "5, rank correlation": (
        lambda rng: planning.rank_correlation(*correlated(rng)),
        6 / math.pi * math.asin(0.3)),
    "1, own sd over RMSE": (lambda rng: ito.root_ratio(*scaled(rng, 1.44, 1.0)), 1.2),
    "1, gain": (lambda rng: ito_pair(rng).gain(), 1.2),
    "1, against prediction only": (lambda rng: ito_pair(rng).against_open_loop(), 0.4),
    "1, a component": (lambda rng: ito_pair(rng).over_open_loop(2), 0.4),
    "2, share of runs won": (pairs_won, 0.5),
    "2, share of the weights": (lambda rng: neural.weights_share(*two_draws(rng)), 0.2),
}  # fmt: skip


@pytest.mark.parametrize("name", PAIRED)
def test_the_interval_holds_the_truth_as_often_as_it_says(name):
    compare, truth = PAIRED[name]
    rng = np.random.default_rng(11)
    found = [compare(rng) for _ in range(TRIALS)]
    held = sum(one.low <= truth <= one.high for one in found)
    # 95 % within what a thousand repetitions can tell, and the bias of a hundred runs.
    low, high = stats.binom.ppf([1e-3, 1 - 1e-3], TRIALS, 0.95)
    assert low - 0.01 * TRIALS <= held <= high + 0.01 * TRIALS, held
    middle = np.mean([one.value for one in found])
    spread = np.std([one.value for one in found])
    assert abs(middle - truth) < 0.2 * spread
    said = np.mean([one.high - one.low for one in found]) / (2 * 1.96)
    assert said == pytest.approx(spread, rel=0.15)


def test_intervals_of_half_and_of_double_width_are_seen():
    compare, truth = PAIRED["ratio"]
    rng = np.random.default_rng(11)
    found = [compare(rng) for _ in range(TRIALS)]
    low, high = stats.binom.ppf([1e-3, 1 - 1e-3], TRIALS, 0.95)
    for factor in (0.5, 2.0):
        held = sum(abs(one.value - truth) <= factor * (one.high - one.low) / 2 for one in found)
        assert not low - 0.01 * TRIALS <= held <= high + 0.01 * TRIALS
