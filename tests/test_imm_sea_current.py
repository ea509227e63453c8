"""Paper 4: whole missions against exact covariances, limits that are known, bad input."""

import dataclasses
import math

import numpy as np
import pytest
from scipy import stats

from seanav.checks import ParameterError
from seanav.filters import ins
from seanav.models import currents, inertial
from seanav.studies import imm_appendix, imm_beyond, imm_linear, imm_scores
from seanav.studies import imm_sea_current as study

SHORT = study.Scenario(runs=16, duration_s=1200.0, seed=11)
SIGMA = 0.3


@pytest.fixture(scope="module")
def sensors():
    return study.sense(SHORT, 0)


def _fly(sensors, filter_, scenario=SHORT, sigma=SIGMA, stride=60):
    return study.fly(scenario, sensors, filter_, sigma, stride=stride)


def test_factor_of_one_is_the_plain_filter_bit_for_bit(sensors):
    capped = dataclasses.replace(SHORT, fading_cap=1.0)
    for form in ("literal", "literal-gain", "block", "variance", "sigma"):
        faded = _fly(sensors, study.Filter("f", (0.1,), form), capped)
        plain = _fly(sensors, study.EKF(0.1))
        assert np.array_equal(faded.series, plain.series)
    assert not np.array_equal(
        _fly(sensors, study.AFEKF(SHORT, 0.1)).series, _fly(sensors, study.EKF(0.1)).series
    )


def test_imm_that_never_switches_is_its_first_filter(sensors):
    chain = ((1.0, 0.0), (0.0, 1.0))
    for form in ("none", "sigma"):
        pair = study.Filter("pair", (0.1, 0.5), form, chain, (1.0, 0.0))
        single = _fly(sensors, study.Filter("one", (0.1,), form))
        both = _fly(sensors, pair)
        assert both.series[:, :16] == pytest.approx(single.series[:, :16], rel=1e-6, abs=1e-12)
        assert np.array_equal(both.series[:, 17], np.ones_like(both.series[:, 17]))


def test_imm_of_identical_filters_is_that_filter(sensors):
    for count in (2, 3):
        T = np.full((count, count), 0.1 / (count - 1))
        np.fill_diagonal(T, 0.9)
        same = study.Filter("same", (0.2,) * count, "sigma", T, (1 / count,) * count)
        many, one = _fly(sensors, same), _fly(sensors, study.Filter("one", (0.2,), "sigma"))
        assert many.series[:, :17] == pytest.approx(one.series[:, :17], rel=1e-6, abs=1e-12)
        assert many.series[:, 17:] == pytest.approx(1 / count)


def test_imm_is_better_than_its_worse_half_and_listens_to_the_better_one(sensors):
    calm = _fly(sensors, study.EKF(0.1, 1.0), sigma=0.05)
    rough = _fly(sensors, study.EKF(0.1, 1.0), sigma=1.0)
    assert calm.means[9].mean() > 0.6 > rough.means[9].mean()
    assert (calm.means[9] + calm.means[10]) == pytest.approx(1.0)


def test_literal_fading_diverges_and_the_default_does_not(sensors):
    exact = study.Scenario(runs=16, duration_s=1200.0, seed=11, fading_cap=1e6)
    good = _fly(sensors, study.AFEKF(SHORT, SIGMA))
    bad = _fly(sensors, study.Filter("literal", (SIGMA,), "literal"), exact)
    position = [np.sqrt((m.means[0] + m.means[1]).mean()) for m in (good, bad)]
    assert not position[1] < 10 * position[0]


def test_matched_filter_carries_the_linear_covariance():
    scenario = study.Scenario(runs=2, duration_s=1200.0, initial_current="stationary")
    _, covariances = imm_linear.design(scenario, SIGMA)
    sensors = study.sense(scenario, 0)
    path = scenario.path()
    z_free = study.fly(scenario, sensors, study.EKF(SIGMA), SIGMA, stride=1200)
    assert z_free.series.shape == (1, 18, study.LANES)
    # The NEES of the kernel's own P and of the linear covariance agree on the same error.

    e = z_free.series[0, :16].copy()
    e[:2] /= imm_linear.metres(scenario)[-1][:, None]
    P = covariances[-1][np.ix_(ins.KEPT, ins.KEPT)]
    scale = np.sqrt(np.diag(P))
    P = P / np.outer(scale, scale)
    nees = np.einsum("ir,ir->r", e / scale[:, None], np.linalg.solve(P, e / scale[:, None]))
    assert z_free.series[0, 16] == pytest.approx(nees, rel=0.02)
    assert path.duration == 1200.0


@pytest.fixture(scope="module")
def drawn():
    """300 missions of ten minutes, every initial error drawn from what the filter believes."""
    scenario = study.Scenario(
        runs=304,
        duration_s=600.0,
        corner_radius=150.0,
        initial_current="stationary",
        initial_errors="drawn",
        initial_tilt_rad=1e-4,
        initial_heading_rad=1e-3,
        seed=8,
    )
    jobs = [(study.EKF(SIGMA), SIGMA), (study.EKF(SIGMA), 2 * SIGMA)]
    return scenario, study.fly_all(scenario, jobs, stride=300)


def _bounds(count, freedom):
    total = stats.chi2(count * freedom)
    return total.ppf(0.0005) / count, total.ppf(0.9995) / count


def test_matched_filter_is_consistent_and_a_mistuned_one_is_not(drawn):
    scenario, (matched, mistuned) = drawn
    low, high = _bounds(scenario.runs, 16)
    for record in matched.series:
        assert low < record[16].mean() < high
    assert not low < mistuned.series[-1, 16].mean() < high
    steps = int(scenario.duration_s)
    low, high = _bounds(scenario.runs * steps, 1)
    assert low < matched.means[5].mean() < high
    assert not low < mistuned.means[5].mean() < high


def test_linear_twin_and_exact_covariance_agree():
    scenario = study.Scenario(duration_s=1200.0, initial_current="zero")
    for sigma_filter in (0.1, 0.5):
        for sigma_true in (0.05, 1.0):
            exact = imm_linear.scores(scenario, sigma_filter, sigma_true)[:4]
            exact[2:] = np.radians(exact[2:])
            twin = imm_linear.twin(scenario, sigma_filter, sigma_true, 100)
            se = twin.std(axis=1, ddof=1) / 10
            assert (np.abs(twin.mean(axis=1) - exact**2) < 3.5 * se).all()


def test_wrong_correlation_time_reduces_to_the_right_one():
    scenario = study.Scenario(duration_s=1200.0, initial_current="stationary")
    right = imm_linear.wrong_time(scenario, 0.5, 7200.0, 0.3, 7200.0)
    assert right == pytest.approx(imm_linear.scores(scenario, 0.5, 0.3)[4], rel=1e-6)
    assert imm_linear.wrong_time(scenario, 0.5, 600.0, 0.3, 7200.0) > right


def test_wrong_correlation_time_matches_flown_missions():
    scenario = dataclasses.replace(SHORT, runs=160, initial_current="stationary")
    for true, assumed in ((7200.0, 100.0), (100.0, 7200.0)):
        scenario = dataclasses.replace(scenario, correlation_time_s=true)
        filter_ = study.Filter("wrong time", (0.5,), correlation_time_s=assumed)
        (flown,) = study.fly_all(scenario, [(filter_, SIGMA)])
        exact = imm_linear.wrong_time(scenario, 0.5, assumed, SIGMA, true)
        tcep = imm_scores.tcep(flown)
        assert abs(tcep.value - exact) < 3.5 * tcep.se
        # A true current that decays as the filter believes would give another error.
        wrong = imm_linear.wrong_time(scenario, 0.5, assumed, SIGMA, assumed)
        assert abs(tcep.value - wrong) > 3.5 * tcep.se


def test_turning_the_square_by_half_a_turn_changes_little():
    scores = []
    for heading in (math.pi / 2, -math.pi / 2):
        base = study.Scenario()
        path = dataclasses.replace(base.path(), heading=heading, _cache={})
        turned = type("Turned", (study.Scenario,), {"path": lambda self, path=path: path})()
        scores.append(imm_linear.scores(turned, 0.5, 0.5))
    assert scores[1] == pytest.approx(scores[0], rel=0.01)


def test_rms_of_plain_filters_matches_linear_covariance(drawn):
    scenario, (matched, _) = drawn
    exact = imm_linear.scores(scenario, SIGMA, SIGMA)
    for k, cell in enumerate(imm_scores.cells(matched)):
        assert abs(cell.value - exact[k]) < 3.5 * cell.se + 0.01 * exact[k], k


def test_threads_and_number_of_runs_do_not_change_a_run():
    jobs = [(study.AFEKF(SHORT, 0.1, 0.5), SIGMA)]
    many = dataclasses.replace(SHORT, runs=40)
    one = study.fly_all(many, jobs, threads=1)[0].means
    two = study.fly_all(many, jobs, threads=2)[0].means
    fewer = study.fly_all(dataclasses.replace(SHORT, runs=21), jobs)[0].means
    assert np.array_equal(one, two)
    assert fewer.shape[1] == 21
    assert np.array_equal(fewer, one[:, :21])


def test_three_axes_help_and_stay_consistent():
    # With all axes the log sees the whole current: better attitude, NIS of three.
    scenario = dataclasses.replace(SHORT, log_axes=3, initial_current="stationary", runs=16)
    forward = dataclasses.replace(scenario, log_axes=1)
    three = study.fly_all(scenario, [(study.EKF(SIGMA), SIGMA)])[0]
    one = study.fly_all(forward, [(study.EKF(SIGMA), SIGMA)])[0]
    assert three.means[5].mean() == pytest.approx(3.0, abs=0.1)
    assert three.means[2].mean() < one.means[2].mean()


def _mission(mean_squares):
    means = np.zeros((10, len(mean_squares[0])))
    means[: len(mean_squares)] = mean_squares
    return study.Mission(
        means, np.empty((0, 18, means.shape[1])), np.empty((1, 136, means.shape[1]))
    )


def test_tcep_and_rate_by_hand():
    pure, best = _mission([[400.0, 400.0], [100.0, 100.0]]), _mission([[1.0, 1.0], [1.0, 1.0]])
    some = _mission([[100.0, 100.0], [25.0, 25.0]])
    assert imm_scores.tcep(pure).value == pytest.approx(0.589 * 30)
    assert imm_scores.rate(some, pure, best).value == pytest.approx(100 * 15 / 28)
    first, second = (some, pure, best), (pure, pure, best)
    assert imm_scores.rate_difference(first, second).value == pytest.approx(100 * 15 / 28)
    zero = imm_scores.advantage_difference(first, second, first, second)
    assert (zero.value, zero.se) == pytest.approx((0, 0))


RUNS = 400


@pytest.fixture(scope="module")
def made_up():
    """Four missions of made-up errors that share part of their luck, with series."""
    random = np.random.default_rng(0)
    shared = random.chisquare(3, (10, RUNS))
    missions = []
    for size in (3.0, 9.0, 1.0, 5.0):
        means = size * (shared + random.chisquare(3, (10, RUNS)))
        means[9] = random.random(RUNS)
        series = (
            size * random.standard_normal((12, 18, RUNS)) * np.linspace(1, 2, 12)[:, None, None]
        )
        missions.append(study.Mission(means, series, np.empty((1, 136, RUNS))))
    return missions


SCORES = {
    "rate": lambda a, b, c, d: imm_scores.rate(a, b, c),
    "rate_difference": lambda a, b, c, d: imm_scores.rate_difference((a, b, c), (d, b, c)),
    "advantage_difference": lambda a, b, c, d: imm_scores.advantage_difference(
        (a, b, c), (d, b, c), (c, b, c), (d, b, a)
    ),
    "tcep": lambda a, b, c, d: imm_scores.tcep(a),
    "tcep_log_ratio": lambda a, b, c, d: imm_scores.tcep_log_ratio(a, b),
    "cells": lambda a, b, c, d: imm_scores.cells(a)[1],
    "log_ratios": lambda a, b, c, d: imm_scores.log_ratios(a, b)[2],
    "mode": lambda a, b, c, d: imm_scores.mode(a),
    "mode_difference": lambda a, b, c, d: imm_scores.mode_difference(a, b),
    "mode_contrast_difference": lambda a, b, c, d: imm_scores.mode_contrast_difference(a, b, -1),
    "fall of RMS": lambda a, b, c, d: imm_scores.falls(a, 2, 9)[0],
    "fall of TCEP": lambda a, b, c, d: imm_scores.falls(a, 2, 9)[1],
}


@pytest.mark.parametrize("name", SCORES)
def test_intervals_of_scores_match_jackknife(name, made_up):
    score = SCORES[name]

    def without(run):
        keep = np.arange(RUNS) != run
        return score(
            *(study.Mission(m.means[:, keep], m.series[..., keep], m.P) for m in made_up)
        ).value

    leave = np.array([without(run) for run in range(RUNS)])
    se = math.sqrt((RUNS - 1) / RUNS * ((leave - leave.mean()) ** 2).sum())
    assert score(*made_up).se == pytest.approx(se, rel=0.02)


def test_scores_by_their_definitions(made_up):
    a, b, c, d = made_up
    rates = [imm_scores.rate(m, b, c).value for m in (a, d)]
    three = (a, b, c), (d, b, c)
    got = imm_scores.advantage_difference(*three, *three[::-1]).value
    assert got == pytest.approx(2 * (rates[0] - rates[1]))
    tcep = [0.589 * np.sqrt(m.means[:2].mean(axis=1)).sum() for m in (a, b)]
    assert imm_scores.tcep_log_ratio(a, b).value == pytest.approx(np.log(tcep[0] / tcep[1]))
    rms = [np.sqrt(m.means[3].mean()) for m in (a, b)]
    assert imm_scores.log_ratios(a, b)[2].value == pytest.approx(np.log(rms[0] / rms[1]))
    levelling, heading = np.degrees([rms[0], np.sqrt(a.means[4].mean())])
    assert [x.value for x in imm_scores.cells(a)[2:]] == pytest.approx([levelling, heading])
    # Two models: mu1 − mu2 is 2 mu1 − 1.
    contrast = [2 * m.means[9].mean() - 1 for m in (a, b)]
    got = imm_scores.mode_contrast_difference(a, b, -1).value
    assert got == pytest.approx(contrast[1] - contrast[0])


def test_curves_against_time_by_their_definitions(made_up):
    one = made_up[0]
    north, east = one.series[:, 0], one.series[:, 1]
    rms, cep, tcep = imm_scores.radial_curves(one)
    for k in (0, 5, 11):
        radius = np.sort(np.sqrt(north[k] ** 2 + east[k] ** 2))
        assert rms[k] == pytest.approx(np.sqrt((radius**2).mean()))
        assert imm_scores.radial_rms(one)[k].value == pytest.approx(rms[k])
        assert imm_scores.mode_curve(one)[k].value == pytest.approx(one.series[k, 17].mean())
        assert cep[k] == pytest.approx(radius[RUNS // 2 - 1 : RUNS // 2 + 1].mean())
        assert tcep[k] == pytest.approx(
            0.589 * sum(np.sqrt((x[: k + 1] ** 2).mean()) for x in (north, east))
        )
    swing, smooth = imm_scores.falls(one, 2, 9)
    assert swing.value == pytest.approx(np.log(rms[9] / rms[2]))
    assert smooth.value == pytest.approx(np.log(tcep[9] / tcep[2]))


def test_appendix_B_against_the_normal_equations():
    # One update of two correlated numbers, as the inverse of summed information.
    P, R = np.array([[2.0, 0.7], [0.7, 3.0]]), 0.4
    H = np.array([[1.0, -1.0]])
    after = np.linalg.inv(np.linalg.inv(P) + H.T @ H / R)
    assert imm_appendix.one_step(2.0, 0.7, 3.0, R) == pytest.approx(after[0, 0])
    world = {"velocity_std": 0.3, "drift": 2e-2, "log_noise": 0.05, "correlation_time": 100.0}
    _, _, after = imm_appendix.riccati(0.4, 50, **world)
    noise = np.random.default_rng(2).standard_normal((4000, 51, 3))
    errors = imm_appendix.simulate(0.4, 50, noise, **world)
    for k in (0, 10, 49):
        sample = errors[k] @ errors[k].T / 4000
        assert sample == pytest.approx(after[k], rel=0.1)


def test_studies_beyond_the_paper_change_what_they_say(sensors):
    assert np.array(imm_beyond.chain(0.8, 3)) == pytest.approx(
        np.array([[0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8]])
    )
    pair = imm_beyond.with_chain(study.EKF(0.1, 0.5), 0.95)
    assert np.array(pair.transition) == pytest.approx(np.array([[0.95, 0.05], [0.05, 0.95]]))
    assert pair.initial_probabilities == (0.5, 0.5)
    change = imm_beyond.changing(SHORT, low=0.05, high=1.0)
    mode = change["IMM-EKF 0.1,0.5"].series[:, 17].mean(axis=1)
    assert mode[:10].mean() > mode[-5:].mean()
    # Printed cells off by a common factor are that far off, whatever their number.
    own = dict.fromkeys(imm_scores.PRINTED)
    for table, sigma in imm_scores.PRINTED_SIGMA.items():
        exact = {f"EKF {one:g}": imm_linear.scores(SHORT, one, sigma)[:4] for one in (0.1, 0.5)}
        sign = 1 if table == 2 else -1
        own[table] = {name: row * np.exp(0.3 * sign) for name, row in exact.items()}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(imm_scores, "PRINTED", own)
        assert imm_beyond.table_distance(SHORT) == pytest.approx(0.3)


def test_crossing_is_interpolated():
    assert imm_scores.crossing([0.0, 1.0, 2.0], [0.0, 1.0, 3.0], [2.0] * 3) == pytest.approx(1.5)
    assert imm_scores.crossing([0.0, 1.0], [0.0, 1.0], [2.0] * 2) is None


def test_changing_sigma_scales_the_current(sensors):
    steps = int(SHORT.duration_s)
    constant = _fly(sensors, study.EKF(0.1))
    same = _fly(sensors, study.EKF(0.1), sigma=np.full(steps, SIGMA))
    assert np.array_equal(constant.means, same.means)
    assert currents.decay(1.0, 7200.0)[1] > 0


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"runs": 1}, "runs = 1: must be an integer of at least 2"),
        ({"sigma_filter": (0.1, 0.0)}, "sigma_filter = 0.0: must be a finite number above 0"),
        ({"sigma_true": (-0.1,)}, "sigma_true = -0.1: must be a finite number above 0"),
        ({"sigma_true": "0.1"}, "sigma_true = '0.1': must be a list"),
        ({"transition": ((0.9, 0.2), (0.1, 0.9))}, "transition = .*whose rows sum to one"),
        ({"transition": ((1.1, -0.1), (0.1, 0.9))}, "transition = .*whose rows sum to one"),
        ({"initial_probabilities": (0.5, 0.6)}, "initial_probabilities = .*sum to one"),
        ({"initial_probabilities": (1.0,)}, "initial_probabilities = .*must be 2 prob"),
        ({"fading_window": 1}, "fading_window = 1: must be an integer of at least 2"),
        ({"fading_form": "some"}, "fading_form = 'some': must be one of 'none'"),
        ({"trajectory": "spiral"}, "trajectory = 'spiral': must be one of 'square'"),
        ({"corner_radius": 20e3}, r"corner_radius = 20000\.0: must be at most"),
        ({"log_axes": 2}, "log_axes = 2: must be one of 1, 3"),
        ({"initial_current": "none"}, "initial_current = 'none': must be one of"),
        ({"log_noise": 0.0}, "log_noise = 0.0: must be a finite number above 0"),
        ({"duration_s": 100.5}, r"duration = 100\.5: must be a whole number"),
    ],
)
def test_bad_input_is_one_clear_line(change, line):
    with pytest.raises(ParameterError, match=line) as caught:
        study.Scenario(**change)
    assert "\n" not in str(caught.value)


def test_models_and_chain_must_fit(sensors):
    triple = study.EKF(0.1, 0.5, 1.0)
    with pytest.raises(ParameterError, match="must fit the 3 models of IMM-EKF"):
        _fly(sensors, triple)


def test_nonlinear_filter_with_H_at_the_truth_is_the_linear_model():
    """Runs with errorless inertial sensors against the linear error equations, step by step."""
    scenario = study.Scenario(runs=2, duration_s=1800.0)
    path, steps = scenario.path(), 1800
    sensed = study.sense(scenario, 0)
    theta, dv = inertial.preintegrate(*path.increments(), 100)
    sides = (np.repeat(x[:, :, None], study.LANES, axis=2) for x in (theta, dv))
    sensed = study.Sensors(
        *map(np.ascontiguousarray, sides),
        sensed.unit_current,
        sensed.log_noise,
        sensed.errors0,
        np.zeros((6, study.LANES)),
    )
    (Phi, H), K = imm_linear.model(path, 7200.0), imm_linear.gains(scenario, 0.1)
    unit, a = sensed.unit_current, currents.decay(1.0, 7200.0)[0]

    def distance(sigma, about):
        e, linear = np.zeros((18, study.LANES)), []
        for k in range(steps):
            e = Phi[k] @ e
            e[15:] -= sigma * (unit[k + 1] - a * unit[k])
            e = e - np.outer(K[k], H[k] @ e - scenario.log_noise * sensed.log_noise[k, 0])
            linear.append(e[ins.KEPT][2:7])
        linear = np.array(linear[299::300])
        filter_ = dataclasses.replace(study.EKF(0.1), about=about)
        flown = study.fly(scenario, sensed, filter_, sigma, stride=300)
        scale = np.sqrt((linear**2).mean(axis=(0, 2)))[:, None]
        return np.abs((flown.series[:, 2:7] - linear) / scale).max()

    # What the linear model leaves out is of second order: relative to the error it grows with it.
    near, far = distance(0.5, "truth"), distance(2.0, "truth")
    assert 3 < far / near < 6
    assert distance(0.5, "estimate") > 10 * near
