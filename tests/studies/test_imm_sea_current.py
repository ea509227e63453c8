"""Paper 4: whole missions against exact covariances, limits that are known, bad input."""

import dataclasses
import math

import attrs
import numpy as np
import pytest
from scipy import stats

from seanav import estimates, montecarlo
from seanav.checks import ParameterError
from seanav.filters import ins
from seanav.models import currents, earth, inertial
from seanav.studies.imm_sea_current import (
    appendix,
    beyond,
    conditions,
    linear,
    printed,
    run,
    scores,
    tables,
)
from seanav.studies.imm_sea_current.flown import Flown, condition, crossing
from seanav.studies.imm_sea_current.scenario import Scenario

SHORT = Scenario(runs=16, duration_s=1200.0, seed=11)
SIGMA = 0.3


def _same(one, other):
    """Whether two flights agree in every bit but the covariances at the end."""
    pairs = zip(flat(one._replace(P=None)), flat(other._replace(P=None)), strict=True)
    return all(np.array_equal(a, b) for a, b in pairs)


def _picked(tree, keep):
    """Return the runs `keep` of a flight."""
    if isinstance(tree, tuple):
        return type(tree)(*(_picked(part, keep) for part in tree))
    return tree[..., keep]


def flat(tree):
    return [x for part in tree for x in flat(part)] if isinstance(tree, tuple) else [tree]


@pytest.fixture(scope="module")
def sensors():
    return run.sense(SHORT, 0)


def _fly(sensors, filter_, scenario=SHORT, sigma=SIGMA, stride=60):
    return run.fly(scenario, sensors, filter_, sigma, stride=stride)


def test_factor_of_one_is_the_plain_filter_bit_for_bit(sensors):
    capped = attrs.evolve(SHORT, fading_cap=1.0)
    for form in ("literal", "literal-gain", "block", "variance", "sigma"):
        faded = _fly(sensors, run.Filter("f", (0.1,), form), capped)
        plain = _fly(sensors, run.EKF(0.1))
        assert _same(faded, plain)
    assert not _same(_fly(sensors, run.AFEKF(SHORT, 0.1)), _fly(sensors, run.EKF(0.1)))


def test_imm_that_never_switches_is_its_first_filter(sensors):
    chain = ((1.0, 0.0), (0.0, 1.0))
    for form in ("none", "sigma"):
        pair = run.Filter("pair", (0.1, 0.5), form, chain, (1.0, 0.0))
        single = _fly(sensors, run.Filter("one", (0.1,), form))
        both = _fly(sensors, pair)
        assert both.series.errors == pytest.approx(single.series.errors, rel=1e-6, abs=1e-12)
        assert (both.series.mode_probability[:, 0] == 1.0).all()


def test_imm_of_identical_filters_is_that_filter(sensors):
    for count in (2, 3):
        T = np.full((count, count), 0.1 / (count - 1))
        np.fill_diagonal(T, 0.9)
        same = run.Filter("same", (0.2,) * count, "sigma", T, (1 / count,) * count)
        many, one = _fly(sensors, same), _fly(sensors, run.Filter("one", (0.2,), "sigma"))
        assert many.series.errors == pytest.approx(one.series.errors, rel=1e-6, abs=1e-12)
        assert many.series.nees == pytest.approx(one.series.nees, rel=1e-6, abs=1e-12)
        assert many.series.mode_probability == pytest.approx(1 / count)


def test_imm_is_better_than_its_worse_half_and_listens_to_the_better_one(sensors):
    calm = _fly(sensors, run.EKF(0.1, 1.0), sigma=0.05)
    rough = _fly(sensors, run.EKF(0.1, 1.0), sigma=1.0)
    assert calm.mode_probability[0].mean() > 0.6 > rough.mode_probability[0].mean()
    assert calm.mode_probability.sum(axis=0) == pytest.approx(1.0)


def test_literal_fading_diverges_and_the_default_does_not(sensors):
    exact = Scenario(runs=16, duration_s=1200.0, seed=11, fading_cap=1e6)
    good = _fly(sensors, run.AFEKF(SHORT, SIGMA))
    bad = _fly(sensors, run.Filter("literal", (SIGMA,), "literal"), exact)
    position = [scores.position_rms(m) for m in (good, bad)]
    assert not position[1] < 10 * position[0]


def test_matched_filter_carries_the_linear_covariance():
    scenario = Scenario(runs=2, duration_s=1200.0, initial_current="stationary")
    _, covariances = linear.design(scenario, SIGMA)
    sensors = run.sense(scenario, 0)
    flight = run.fly(scenario, sensors, run.EKF(SIGMA), SIGMA, stride=1200)
    # The NEES of the kernel's own P and of the linear covariance agree on the same error.
    e = flight.series.errors[0].copy()
    e[:2] /= linear.metres(scenario)[-1][:, None]
    P = covariances[-1][np.ix_(ins.KEPT, ins.KEPT)]
    scale = np.sqrt(np.diag(P))
    P = P / np.outer(scale, scale)
    nees = np.einsum("ir,ir->r", e / scale[:, None], np.linalg.solve(P, e / scale[:, None]))
    assert flight.series.nees[0] == pytest.approx(nees, rel=0.02)


@pytest.fixture(scope="module")
def drawn():
    """300 missions of ten minutes, every initial error drawn from what the filter believes."""
    scenario = Scenario(
        runs=304,
        duration_s=600.0,
        corner_radius=150.0,
        initial_current="stationary",
        initial_errors="drawn",
        initial_tilt_rad=1e-4,
        initial_heading_rad=1e-3,
        seed=8,
    )
    jobs = [(run.EKF(SIGMA), SIGMA), (run.EKF(SIGMA), 2 * SIGMA)]
    return scenario, run.fly_all(scenario, jobs, stride=300)


def _bounds(count, freedom):
    total = stats.chi2(count * freedom)
    return total.ppf(0.0005) / count, total.ppf(0.9995) / count


def test_matched_filter_is_consistent_and_a_mistuned_one_is_not(drawn):
    scenario, (matched, mistuned) = drawn
    low, high = _bounds(scenario.runs, 16)
    for record in matched.series.nees:
        assert low < record.mean() < high
    assert not low < mistuned.series.nees[-1].mean() < high
    steps = int(scenario.duration_s)
    low, high = _bounds(scenario.runs * steps, 1)
    assert low < matched.nis.mean() < high
    assert not low < mistuned.nis.mean() < high


def test_linear_twin_and_exact_covariance_agree():
    scenario = Scenario(duration_s=1200.0, initial_current="zero")
    for sigma_filter in (0.1, 0.5):
        for sigma_true in (0.05, 1.0):
            exact = linear.scores(scenario, sigma_filter, sigma_true)[:4]
            exact[2:] = np.radians(exact[2:])
            twin = linear.twin(scenario, sigma_filter, sigma_true, 100)
            se = twin.std(axis=1, ddof=1) / 10
            assert (np.abs(twin.mean(axis=1) - exact**2) < 3.5 * se).all()


def test_wrong_correlation_time_reduces_to_the_right_one():
    scenario = Scenario(duration_s=1200.0, initial_current="stationary")
    right = linear.wrong_time(scenario, 0.5, 7200.0, 0.3, 7200.0)
    assert right == pytest.approx(linear.scores(scenario, 0.5, 0.3)[4], rel=1e-6)
    assert linear.wrong_time(scenario, 0.5, 600.0, 0.3, 7200.0) > right


def test_wrong_correlation_time_matches_flown_missions():
    scenario = attrs.evolve(SHORT, runs=160, initial_current="stationary")
    for true, assumed in ((7200.0, 100.0), (100.0, 7200.0)):
        scenario = attrs.evolve(scenario, correlation_time_s=true)
        filter_ = run.Filter("wrong time", (0.5,), correlation_time_s=assumed)
        (flown,) = run.fly_all(scenario, [(filter_, SIGMA)])
        exact = linear.wrong_time(scenario, 0.5, assumed, SIGMA, true)
        tcep = scores.tcep(flown)
        assert abs(tcep.value - exact) < 3.5 * tcep.se
        # A true current that decays as the filter believes would give another error.
        wrong = linear.wrong_time(scenario, 0.5, assumed, SIGMA, assumed)
        assert abs(tcep.value - wrong) > 3.5 * tcep.se


def test_turning_the_square_by_half_a_turn_changes_little():
    both = []
    for heading in (math.pi / 2, -math.pi / 2):
        base = Scenario()
        path = dataclasses.replace(base.path(), heading=heading)
        turned = type("Turned", (Scenario,), {"path": lambda self, path=path: path})()
        both.append(linear.scores(turned, 0.5, 0.5))
    assert both[1] == pytest.approx(both[0], rel=0.01)


def test_rms_of_plain_filters_matches_linear_covariance(drawn):
    scenario, (matched, _) = drawn
    exact = linear.scores(scenario, SIGMA, SIGMA)
    for k, cell in enumerate(scores.cells(matched)):
        assert abs(cell.value - exact[k]) < 3.5 * cell.se + 0.01 * exact[k], k


def test_threads_and_number_of_runs_do_not_change_a_run():
    jobs = [(run.AFEKF(SHORT, 0.1, 0.5), SIGMA)]
    many = attrs.evolve(SHORT, runs=40)
    one = run.fly_all(many, jobs, threads=1)[0]
    two = run.fly_all(many, jobs, threads=2)[0]
    fewer = run.fly_all(attrs.evolve(SHORT, runs=21), jobs)[0]
    assert _same(one, two)
    assert fewer.nis.shape == (21,)
    assert _same(fewer, one.runs(21))


def test_three_axes_help_and_stay_consistent():
    # With all axes the log sees the whole current: better attitude, NIS of three.
    scenario = attrs.evolve(SHORT, log_axes=3, initial_current="stationary", runs=16)
    forward = attrs.evolve(scenario, log_axes=1)
    three = run.fly_all(scenario, [(run.EKF(SIGMA), SIGMA)])[0]
    one = run.fly_all(forward, [(run.EKF(SIGMA), SIGMA)])[0]
    assert three.nis.mean() == pytest.approx(3.0, abs=0.1)
    assert three.mean_squares.velocity.mean() < one.mean_squares.velocity.mean()


def test_a_lane_without_a_run_is_no_run():
    scenario = Scenario(runs=8, duration_s=600.0, corner_radius=150.0)
    sensed = run.sense(scenario, 0)
    by_hand = run.fly(scenario, sensed, run.EKF(0.1), 1.0)
    (flown,) = run.fly_all(scenario, [(run.EKF(0.1), 1.0)])
    assert by_hand.nis.shape == (8,)
    assert scores.tcep(by_hand) == scores.tcep(flown)
    # The idle lanes repeat the first run: as runs they would count it nine times.
    every = run.fly(scenario, dataclasses.replace(sensed, runs=run.LANES), run.EKF(0.1), 1.0)
    assert _same(every.runs(8), by_hand)
    assert scores.tcep(every).value != pytest.approx(scores.tcep(by_hand).value, rel=0.01)


def test_each_batch_is_sensed_once_however_many_there_are(monkeypatch):
    sensed, made = [], inertial.sensor_increments

    def counted(*arguments):
        sensed.append(arguments)
        return made(*arguments)

    monkeypatch.setattr(inertial, "sensor_increments", counted)
    jobs = [(run.EKF(s), SIGMA) for s in (0.1, 0.2, 0.3, 0.4, 0.5)]
    few = Scenario(runs=run.LANES, duration_s=60.0, trajectory="circle", seed=21)
    run.fly_all(few, jobs, threads=2)  # two threads want the same batch at once
    assert len(sensed) == few.runs
    # What a later study of the same world needs again is kept, up to a bound.
    run.fly_all(few, jobs[:1])
    assert len(sensed) == few.runs
    sensed.clear()
    many = attrs.evolve(few, runs=run.LANES * (run.KEPT + 2), seed=22)
    run.fly_all(many, jobs, threads=2)
    assert len(sensed) == many.runs
    run.fly_all(many, jobs, threads=2)
    assert len(sensed) == many.runs + 2 * run.LANES


@pytest.mark.parametrize("kept", [1, 16])
def test_results_do_not_depend_on_how_the_work_is_split(kept, monkeypatch):
    scenario = Scenario(runs=40, duration_s=60.0, trajectory="circle", seed=23)
    jobs = [(run.EKF(s), SIGMA) for s in (0.1, 0.2, 0.3, 0.4)] + [(run.EKF(0.1, 0.5), SIGMA)]
    expected = [
        ins.Flight.join([run.fly(scenario, run.sense(scenario, b), *job) for b in range(3)])
        for job in jobs
    ]
    monkeypatch.setattr(run, "KEPT", kept)
    for threads in (1, 3):
        flown = run.fly_all(scenario, jobs, threads=threads)
        assert all(_same(a, b) for a, b in zip(flown, expected, strict=True))


def test_flights_of_all_runs_carry_no_covariances():
    scenario = Scenario(runs=2, duration_s=60.0, trajectory="circle", sigma_true=(0.3,))
    for flights in run.sweep(scenario, [run.EKF(0.1)], stride=30).values():
        assert flights[0].P.size == 0
        assert flights[0].series.errors.size == 0


def test_what_is_stored_cannot_be_written_to():
    sensed = run.sense(SHORT, 0)
    arrays = [getattr(sensed, f.name) for f in dataclasses.fields(sensed) if f.name != "runs"]
    arrays += [*SHORT.path().states(), *SHORT.path().increments(), *SHORT.path().increments(10)]
    arrays += [*linear.model(SHORT.path(), 7200.0), linear.gains(SHORT, 0.1)]
    arrays += [*linear.mean_squares(SHORT, 0.1), linear.metres(SHORT)]
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0


def test_one_update_needs_no_more_noise_than_its_own():
    world = {"velocity_std": 0.3, "drift": 2e-2, "log_noise": 0.05, "correlation_time": 100.0}
    long = montecarlo.normals(3, "appendix B", 5, (61, 3))
    short = montecarlo.normals(3, "appendix B", 5, (2, 3))
    first = appendix.simulate(0.4, 60, long, **world)[0]
    assert np.array_equal(appendix.simulate(0.4, 1, short, **world)[0], first)


def _errorless_drift(path):
    """RMS distance (m) of errorless increments, merged to 1 Hz, from the path they belong to."""
    theta, dv = inertial.preintegrate(*path.increments(), 100)
    latitude, longitude, v_n, heading = path.states()
    q = np.array([math.cos(heading[0] / 2), 0.0, 0.0, math.sin(heading[0] / 2)])
    track = inertial.mechanise([latitude[0], longitude[0], 0.0], v_n[0], q, theta, dv, 1.0)
    R_n, R_t = earth.radii(path.latitude)
    north, east = track[:, 0] - latitude, track[:, 1] - longitude
    return math.sqrt(((north * R_n) ** 2 + (east * R_t * np.cos(latitude)) ** 2).mean())


# The sharpest corners that are allowed, on laps that add their errors up; and sharper ones.
ALLOWED = [("square", 4, 1), ("laps", 3, 100), ("laps", 4, 100), ("polygon", 100, 1)]
SHARPER = [("square", 4, 1, 10.0), ("laps", 4, 100, 30.0), ("polygon", 100, 1, 60.0)]
SMALLEST = 0.01 * min(row[0] for table in printed.CELLS.values() for row in table.values())


@pytest.mark.parametrize(("shape", "sides", "laps"), ALLOWED)
def test_the_sharpest_turns_cost_less_than_a_hundredth_of_the_smallest_error(shape, sides, laps):
    radius = {"trajectory": shape, "sides": sides, "laps": laps}
    with pytest.raises(ParameterError, match="must be at least") as refused:
        Scenario(**radius, corner_radius=1.0)
    least = float(str(refused.value).split("at least ")[1].split()[0])
    assert _errorless_drift(Scenario(**radius, corner_radius=least).path()) < SMALLEST


@pytest.mark.parametrize(("shape", "sides", "laps", "radius"), SHARPER)
def test_turns_that_are_refused_would_be_seen(shape, sides, laps, radius):
    path = dataclasses.replace(
        Scenario().path(), shape=shape, sides=sides, laps=laps, corner_radius=radius
    )
    assert _errorless_drift(path) > SMALLEST
    with pytest.raises(ParameterError, match="must be at least"):
        Scenario(trajectory=shape, sides=sides, laps=laps, corner_radius=radius)


def _flight(means, series=None):
    """A flight with these numbers: five mean squares, four more scores, modes."""
    series = np.zeros((1, 18, len(means[0]))) if series is None else series
    nis, nees, beta, squared_nis = means[5:9]
    return ins.Flight(
        ins.MeanSquares(*means[:5]),
        nis,
        beta,
        squared_nis,
        nees,
        means[9:],
        ins.Series(series[:, :16], series[:, 16], series[:, 17:]),
        np.zeros((1, 0, len(means[0]))),
    )


def _mission(mean_squares):
    means = np.zeros((10, len(mean_squares[0])))
    means[: len(mean_squares)] = mean_squares
    return _flight(means)


def test_tcep_and_rate_by_hand():
    pure, best = _mission([[400.0, 400.0], [100.0, 100.0]]), _mission([[1.0, 1.0], [1.0, 1.0]])
    some = _mission([[100.0, 100.0], [25.0, 25.0]])
    assert scores.tcep(pure).value == pytest.approx(0.589 * 30)
    assert scores.rate(some, pure, best).value == pytest.approx(100 * 15 / 28)
    first, second = (some, pure, best), (pure, pure, best)
    assert scores.rate_difference(first, second).value == pytest.approx(100 * 15 / 28)
    zero = scores.advantage_difference(first, second, first, second)
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
        missions.append(_flight(means, series))
    return missions


SCORES = {
    "rate": lambda a, b, c, d: scores.rate(a, b, c),
    "rate_difference": lambda a, b, c, d: scores.rate_difference((a, b, c), (d, b, c)),
    "advantage_difference": lambda a, b, c, d: scores.advantage_difference(
        (a, b, c), (d, b, c), (c, b, c), (d, b, a)
    ),
    "tcep": lambda a, b, c, d: scores.tcep(a),
    "tcep_ratio": lambda a, b, c, d: scores.tcep_ratio(a, b),
    "cells": lambda a, b, c, d: scores.cells(a)[1],
    "ratio": lambda a, b, c, d: scores.ratio(a, b, 2),
    "mode": lambda a, b, c, d: scores.mode(a),
    "mode_difference": lambda a, b, c, d: scores.mode_difference(a, b),
    "mode_contrast_difference": lambda a, b, c, d: scores.mode_contrast_difference(a, b, -1),
    "fall of RMS": lambda a, b, c, d: scores.falls(a, 2, 9)[0],
    "fall of TCEP": lambda a, b, c, d: scores.falls(a, 2, 9)[1],
}


@pytest.mark.parametrize("name", SCORES)
def test_intervals_of_scores_match_jackknife(name, made_up):
    score = SCORES[name]

    def without(left_out):
        keep = np.arange(RUNS) != left_out
        return score(*(_picked(m, keep) for m in made_up)).value

    leave = np.array([without(r) for r in range(RUNS)])
    se = math.sqrt((RUNS - 1) / RUNS * ((leave - leave.mean()) ** 2).sum())
    assert score(*made_up).se == pytest.approx(se, rel=0.02)


def test_scores_by_their_definitions(made_up):
    a, b, c, d = made_up
    rates = [scores.rate(m, b, c).value for m in (a, d)]
    three = (a, b, c), (d, b, c)
    got = scores.advantage_difference(*three, *three[::-1]).value
    assert got == pytest.approx(2 * (rates[0] - rates[1]))
    tcep = [0.589 * np.sqrt(np.mean(m.mean_squares[:2], axis=1)).sum() for m in (a, b)]
    assert scores.tcep_ratio(a, b).value == pytest.approx(tcep[0] / tcep[1])
    rms = [np.sqrt(m.mean_squares.levelling.mean()) for m in (a, b)]
    assert scores.ratio(a, b, 2).value == pytest.approx(rms[0] / rms[1])
    levelling, heading = np.degrees([rms[0], np.sqrt(a.mean_squares.heading.mean())])
    assert [x.value for x in scores.cells(a)[2:]] == pytest.approx([levelling, heading])
    # Two models: mu1 − mu2 is 2 mu1 − 1.
    contrast = [2 * m.mode_probability[0].mean() - 1 for m in (a, b)]
    got = scores.mode_contrast_difference(a, b, -1).value
    assert got == pytest.approx(contrast[1] - contrast[0])


def test_curves_against_time_by_their_definitions(made_up):
    one = made_up[0]
    north, east = one.series.errors[:, 0], one.series.errors[:, 1]
    rms, cep, tcep = scores.radial_curves(one)
    for k in (0, 5, 11):
        radius = np.sort(np.sqrt(north[k] ** 2 + east[k] ** 2))
        assert rms[k] == pytest.approx(np.sqrt((radius**2).mean()))
        assert scores.radial_rms(one)[k].value == pytest.approx(rms[k])
        assert scores.mode_curve(one)[k].value == pytest.approx(
            one.series.mode_probability[k, 0].mean()
        )
        assert cep[k] == pytest.approx(radius[RUNS // 2 - 1 : RUNS // 2 + 1].mean())
        assert tcep[k] == pytest.approx(
            0.589 * sum(np.sqrt((x[: k + 1] ** 2).mean()) for x in (north, east))
        )
    swing, smooth = scores.falls(one, 2, 9)
    assert swing.value == pytest.approx(rms[9] / rms[2])
    assert smooth.value == pytest.approx(tcep[9] / tcep[2])


def test_bands_against_time_hold_the_curves(made_up):
    bands = scores.radial_bands(made_up[0])
    for curve, values in zip(bands.values(), scores.radial_curves(made_up[0]), strict=True):
        assert [e.value for e in curve] == pytest.approx(list(values))


def test_the_interval_of_a_median_covers_the_true_one(made_up):
    # Errors of one metre per axis: half of them lie within 1.1774 m of the truth.
    one, random, inside = made_up[0], np.random.default_rng(3), 0
    for _ in range(20):
        errors = random.standard_normal((12, 18, 100))
        flight = one._replace(series=one.series._replace(errors=errors))
        cep = scores.radial_bands(flight)["CEP"]
        inside += sum(e.low <= math.sqrt(2 * math.log(2)) <= e.high for e in cep)
    assert inside / 240 == pytest.approx(0.96, abs=0.03)


def test_appendix_B_against_the_normal_equations():
    # One update of two correlated numbers, as the inverse of summed information.
    P, R = np.array([[2.0, 0.7], [0.7, 3.0]]), 0.4
    H = np.array([[1.0, -1.0]])
    after = np.linalg.inv(np.linalg.inv(P) + H.T @ H / R)
    assert appendix.one_step(2.0, 0.7, 3.0, R) == pytest.approx(after[0, 0])
    world = {"velocity_std": 0.3, "drift": 2e-2, "log_noise": 0.05, "correlation_time": 100.0}
    _, _, after = appendix.riccati(0.4, 50, **world)
    noise = np.random.default_rng(2).standard_normal((4000, 51, 3))
    errors = appendix.simulate(0.4, 50, noise, **world)
    for k in (0, 10, 49):
        sample = errors[k] @ errors[k].T / 4000
        assert sample == pytest.approx(after[k], rel=0.1)


def test_studies_beyond_the_paper_change_what_they_say(sensors):
    assert np.array(beyond.chain(0.8, 3)) == pytest.approx(
        np.array([[0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8]])
    )
    pair = beyond.with_chain(run.EKF(0.1, 0.5), 0.95)
    assert np.array(pair.transition) == pytest.approx(np.array([[0.95, 0.05], [0.05, 0.95]]))
    assert pair.initial_probabilities == (0.5, 0.5)
    change = beyond.changing(SHORT, low=0.05, high=1.0)
    mode = change["IMM-EKF 0.1,0.5"].series.mode_probability[:, 0].mean(axis=1)
    assert mode[:10].mean() > mode[-5:].mean()
    # Printed cells off by a common factor are that far off, whatever their number.
    own = dict.fromkeys(printed.CELLS)
    for table, sigma in printed.SIGMA.items():
        exact = {f"EKF {one:g}": linear.scores(SHORT, one, sigma)[:4] for one in (0.1, 0.5)}
        sign = 1 if table == 2 else -1
        own[table] = {name: row * np.exp(0.3 * sign) for name, row in exact.items()}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(printed, "CELLS", own)
        assert beyond.table_distance(SHORT) == pytest.approx(0.3)


def test_crossing_is_interpolated():
    assert scores.crossing([0.0, 1.0, 2.0], [0.0, 1.0, 3.0], [2.0] * 3) == pytest.approx(1.5)
    assert scores.crossing([0.0, 1.0], [0.0, 1.0], [2.0] * 2) is None


def test_changing_sigma_scales_the_current(sensors):
    steps = int(SHORT.duration_s)
    constant = _fly(sensors, run.EKF(0.1))
    assert _same(constant, _fly(sensors, run.EKF(0.1), sigma=np.full(steps, SIGMA)))
    # The current doubles at half time, and nothing before it: errors part from there on.
    doubled = np.where(np.arange(steps) < steps // 2, SIGMA, 2 * SIGMA)
    later, half = _fly(sensors, run.EKF(0.1), sigma=doubled), constant.series.nees.shape[0] // 2
    assert np.array_equal(later.series.errors[:half], constant.series.errors[:half])
    assert scores.tcep(later).value > 1.2 * scores.tcep(constant).value


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"runs": 1}, "runs = 1: must be an integer of at least 2"),
        (
            {"sigma_filter": (0.1, 0.0)},
            r"sigma_filter = 0\.0: must be a finite number at least 0\.001",
        ),
        ({"sigma_true": (-0.1,)}, r"sigma_true = -0\.1: must be a finite number at least 0\.001"),
        ({"sigma_true": "0.1"}, "sigma_true = '0.1': must be a list"),
        ({"transition": ((0.9, 0.2), (0.1, 0.9))}, "transition = .*whose rows sum to one"),
        (
            {"transition": ((1.1, -0.1), (0.1, 0.9))},
            "transition = 1.1: .* at least 0 and at most 1",
        ),
        ({"initial_probabilities": (0.5, 0.6)}, "initial_probabilities = .*sum to one"),
        ({"initial_probabilities": (1.0,)}, "initial_probabilities = .*must be a list of 2 values"),
        ({"fading_window": 1}, "fading_window = 1: must be an integer of at least 2"),
        ({"fading_form": "some"}, "fading_form = 'some': must be one of 'none'"),
        ({"trajectory": "spiral"}, "trajectory = 'spiral': must be one of 'square'"),
        ({"corner_radius": 20e3}, r"corner_radius = 20000\.0: must be at most"),
        ({"log_axes": 2}, "log_axes = 2: must be one of 1, 3"),
        ({"initial_current": "none"}, "initial_current = 'none': must be one of"),
        ({"log_noise": 0.0}, r"log_noise = 0\.0: must be a finite number at least 0\.0001"),
        ({"duration_s": 100.5}, r"duration_s = 100\.5: must be whole seconds"),
        # Work and memory are bounded, and nothing is allocated before the refusal.
        ({"runs": 10**9}, "runs = 1000000000: must be an integer of at least 2 and at most 10000"),
        ({"duration_s": 1e9}, r"duration_s = 1000000000\.0: .* at least 60 and at most 21600"),
        ({"duration_s": 59}, "duration_s = 59: .* at least 60"),
        ({"runs": 10_000, "duration_s": 21600}, "runs = 10000: must be at most 3333 with"),
        ({"laps": 10**7}, "laps = 10000000: .* at most 100$"),
        ({"sides": 10**7}, "sides = 10000000: .* at most 100$"),
        ({"fading_window": 10**9}, "fading_window = 1000000000: .* at most 1000$"),
        ({"speed_kn": 1e5}, r"speed_kn = 100000\.0: .* at most 60"),
        ({"sigma_true": [0.1] * 10**4}, "sigma_true = .*must be a list of 1 to 32 values"),
        ({"sigma_filter": [0.1] * 7}, "sigma_filter = .*must be a list of 1 to 6 values"),
        ({"transition": np.eye(3)}, "transition = .*must be a list of 2 values"),
        ({"sigma_filter": [0.5, 0.5]}, "sigma_filter = .*must hold every value once"),
        ({"sigma_true": [0.5, 0.1, 0.5]}, "sigma_true = .*must hold every value once"),
        ({"log_noise": 1e-30}, "log_noise = 1e-30: must be a finite number at least 0.0001"),
        # The least radius, and a lap on which no radius would do.
        ({"corner_radius": 3.0}, r"corner_radius = 3\.0: must be at least 52 m at 20 kn"),
        ({"corner_radius": 0.01}, r"corner_radius = 0\.01: must be at least 52 m"),
        (
            {"trajectory": "polygon", "sides": 100, "corner_radius": 160.0},
            r"corner_radius = 160\.0: must be at least 164 m at 20 kn and 100 sides",
        ),
        (
            {"trajectory": "laps", "laps": 100, "duration_s": 600.0, "corner_radius": 9.0},
            "laps = 100: must leave at least 32 s for a lap",
        ),
        (
            {"trajectory": "polygon", "sides": 90, "duration_s": 60.0, "corner_radius": 9.0},
            "sides = 90: must leave at least 90 s for a lap",
        ),
    ],
)
def test_bad_input_is_one_clear_line(change, line):
    with pytest.raises(ParameterError, match=line) as caught:
        Scenario(**change)
    assert "\n" not in str(caught.value)


def test_models_and_chain_must_fit(sensors):
    triple = run.EKF(0.1, 0.5, 1.0)
    with pytest.raises(ParameterError, match="must fit the 3 models of IMM-EKF"):
        _fly(sensors, triple)


def test_nonlinear_filter_with_H_at_the_truth_is_the_linear_model():
    """Runs with errorless inertial sensors against the linear error equations, step by step."""
    scenario = Scenario(runs=2, duration_s=1800.0)
    path, steps = scenario.path(), 1800
    sensed = run.sense(scenario, 0)
    theta, dv = inertial.preintegrate(*path.increments(), 100)
    theta, dv = (np.repeat(x[:, :, None], run.LANES, axis=2) for x in (theta, dv))
    sensed = dataclasses.replace(sensed, theta=theta, dv=dv, bias=np.zeros((6, run.LANES)))
    (Phi, H), K = linear.model(path, 7200.0), linear.gains(scenario, 0.1)
    unit, a = sensed.unit_current, currents.decay(1.0, 7200.0)[0]

    def distance(sigma, about):
        e, expected = np.zeros((18, run.LANES)), []
        for k in range(steps):
            e = Phi[k] @ e
            e[15:] -= sigma * (unit[k + 1] - a * unit[k])
            e = e - np.outer(K[k], H[k] @ e - scenario.log_noise * sensed.log_noise[k, 0])
            expected.append(e[ins.KEPT][2:7, : scenario.runs])
        expected = np.array(expected[299::300])
        filter_ = dataclasses.replace(run.EKF(0.1), about=about)
        flown = run.fly(scenario, sensed, filter_, sigma, stride=300)
        scale = np.sqrt((expected**2).mean(axis=(0, 2)))[:, None]
        return np.abs((flown.series.errors[:, 2:7] - expected) / scale).max()

    # What the linear model leaves out is of second order: relative to the error it grows with it.
    near, far = distance(0.5, "truth"), distance(2.0, "truth")
    assert 3 < far / near < 6
    assert distance(0.5, "estimate") > 10 * near


def test_a_controlled_number_is_the_regression_at_the_exact_values():
    random = np.random.default_rng(5)
    x = random.normal([3.0, -1.0], 1.0, (60, 2))
    y = 2.0 + x @ [1.5, -0.7] + 0.1 * random.standard_normal(60)
    exact = [3.0, -1.0]
    controls = [(estimates.average(x[:, k]), exact[k]) for k in (0, 1)]
    got = scores.controlled(estimates.average(y), controls).estimate()
    # Least squares with an intercept, its value at the known means.
    design = np.column_stack([np.ones(60), x - exact])
    (intercept, *_), rest = np.linalg.lstsq(design, y, rcond=None)[:2]
    assert got.value == pytest.approx(intercept)
    assert got.se == pytest.approx(math.sqrt(rest[0] / 57 / 60), rel=1e-6)
    assert got.se < 0.1 * estimates.average(y).estimate().se


def test_sharp_rates_are_right_and_have_honest_intervals():
    random = np.random.default_rng(6)
    means = {"pure": 9.0, "best": 1.0, "own": 2.0}  # of squares, north as east
    tcep = {name: 2 * 0.589 * math.sqrt(mean) for name, mean in means.items()}
    true = 100 * (tcep["pure"] - tcep["own"]) / (tcep["pure"] - tcep["best"])
    exact, covered, plain, sharp = (tcep["pure"], tcep["best"]), 0, [], []
    for _ in range(400):
        shared = random.chisquare(4, (2, 100)) / 4
        own = 0.9 * shared + 0.1 * random.chisquare(4, (2, 100)) / 4
        flights = [_mission(m) for m in (2.0 * own, 9.0 * shared, 1.0 * shared)]
        plain.append(scores.rate(*flights).value)
        one = scores.rate(*flights, exact)
        sharp.append(one.value)
        covered += one.low <= true <= one.high
    assert 0.91 < covered / 400 < 0.98
    assert abs(np.mean(sharp) - true) < 4 * np.std(sharp) / 20 + 0.02
    first, second = (flights[0], *flights[1:], exact), (flights[1], *flights[1:], exact)
    # Pure navigation has the rate 0, whatever the runs.
    difference = scores.rate_difference(first, second)
    assert difference.value == pytest.approx(scores.rate(*first).value)


def test_exact_rates_and_their_ends():
    ends = linear.ends(SHORT, (0.1, 0.5))
    for sigma, (pure, best) in ends.items():
        assert pure == pytest.approx(linear.scores(SHORT, None, sigma)[4])
        assert best == pytest.approx(linear.scores(SHORT, sigma, sigma)[4])
        worse = linear.scores(SHORT, 1.0, sigma)[4]
        assert linear.rate(SHORT, 1.0, sigma) == pytest.approx(100 * (pure - worse) / (pure - best))
        assert linear.rate(SHORT, sigma, sigma) == pytest.approx(100.0)
    assert linear.ends(attrs.evolve(SHORT, log_axes=3), (0.1,)) == {}


def test_first_measurement_correlates_velocity_and_current_as_two_numbers():
    start, after = linear.shared_error(SHORT, SIGMA)
    assert start == 0.0
    # Two independent numbers, of which the difference is measured: normal equations.
    sensor = SHORT.sensor_errors
    velocity = 1e-6 + sensor.accelerometer_noise**2 + sensor.accelerometer_bias**2
    H = np.array([[1.0, -1.0]])
    P = np.linalg.inv(np.diag([1 / velocity, 1 / SIGMA**2]) + H.T @ H / SHORT.log_noise**2)
    assert after == pytest.approx(P[0, 1] / math.sqrt(P[0, 0] * P[1, 1]), rel=0.01)


def test_the_optimal_filter_is_optimal_where_its_model_is_the_truth():
    model = attrs.evolve(SHORT, initial_current="stationary", initial_errors="drawn")
    sea = conditions.Sea(model, Flown((), {}))
    wrong = conditions.suboptimal([sea])
    assert len(wrong) == 11 * 3 - 3
    assert {c.outcome for c in wrong} == {"holds"}
    assert min(c.estimate.value for c in wrong) > 1
    rising = conditions.deteriorates([sea])
    assert len(rising) == 11 - 1
    assert {c.outcome for c in rising} == {"holds"}
    more = conditions.wrong_time([sea], (0.5, 1.0, 2.0), SIGMA)
    assert len(more) == 2
    for c, factor in zip(more, (0.5, 2.0), strict=True):
        by_sigma, by_time = conditions.losses(model, factor, SIGMA)
        assert (c.estimate.value, c.low) == (by_sigma / by_time, 1.0)
    assert conditions.losses(SHORT, 1.0, SIGMA) == (1.0, 1.0)
    assert min(conditions.losses(model, 3.0, SIGMA)) > 1
    three = conditions.Sea(attrs.evolve(SHORT, log_axes=3), Flown((), {}))
    assert three.exact(linear.rate, 0.1, 0.5) == conditions.UNKNOWN


def test_the_two_regions_of_an_exchanged_pair_have_their_signs(monkeypatch):
    monkeypatch.setattr(linear, "rate", lambda scenario, s, sigma: 10.0 if s < sigma else 70.0)
    sea = conditions.Sea(SHORT, Flown((), {}))
    exact = [c for c in conditions.lopsided([sea]) if not c.aside and c.counts]
    assert [c.estimate.value for c in exact] == [60.0] * 3
    assert {c.outcome for c in exact} == {"holds"}
    below = conditions.worse_than_pure([sea])
    assert {c.outcome for c in below} == {"fails"}
    literal = [c.what for c in below if c.group.endswith("“>”")]
    assert [w.split("EKF ")[1].split(" m/s")[0] for w in literal[:2]] == [
        "0.1 at 0.2",
        "0.1 at 0.3",
    ]
    assert len(literal) == 9 + 5
    much = [c.what for c in below if c.group.endswith("times")]
    assert [w.split(" at ")[1].split(" m/s")[0] for w in much] == ["1", "5", "10"]


def test_a_filter_that_diverged_fails_and_one_that_was_not_run_does_not_count(made_up):
    a, b, c, _ = made_up
    lost = _mission([[1e20, 1e20], [1e20, 1e20]])
    flown = Flown((0.5,), {"pure navigation": [a], "optimal EKF": [c], "some": [b], "lost": [lost]})
    assert condition("one", flown.sharp_rate("lost", 0.5), 90.0).outcome == "fails"
    assert condition("two", flown.sharp_rate("absent", 0.5), 90.0).outcome == "not run"
    assert flown.least("some") == 0.5
    assert flown.least("lost") is None
    assert flown.rate("some", 0.5) == flown.sharp_rate("some", 0.5)
    assert flown.cell_ratio(1, "some", "optimal EKF", 0.5) == scores.ratio(b, c, 1)


# A made-up sea in which every claim on filters is true, by kind of filter: the TCEP (m) of
# "<kind> <σ_f>" at a true sigma. Pure navigation has 1000 m, the optimal EKF 100 m.
CHAINS = {"p = 0.9": "", "p = 0.95": " p=0.95"}
PAIRS = ("IMM-AFEKF 0.1,0.5", "IMM-AFEKF 0.1,1")


def _true_sea(name, sigma):
    kind, _, rest = name.partition(" ")
    models, _, p = rest.partition(" p=")
    if kind.startswith("IMM"):
        fading, near = kind == "IMM-AFEKF", models == "0.1,0.5"
        return 120.0 - 10 * fading - 5 * near - 2 * (fading and near) - bool(p)
    wrong = abs(math.log(sigma / float(models)))
    if kind == "EKF":
        return 150.0 + 100 * wrong
    return 142.0 + 90 * wrong if sigma > float(models) else 158.0 + 100 * wrong


def _sea(tcep, modes=lambda name, sigma: 0.5):
    """Return the sea in which filters have these TCEPs and mode probabilities in every run."""
    grid, runs = (0.05, 0.1, 0.3, 0.6, 0.9, 1.0), np.array([0.999, 1.001])
    singles = [f"{kind} {s:g}" for kind in ("EKF", "AFEKF") for s in (0.1, 0.5, 1.0)]
    imms = [f"IMM-{kind} {s}" for kind in ("EKF", "AFEKF") for s in ("0.1,0.5", "0.1,1")]
    names = [*singles, *(name + end for name in imms for end in CHAINS.values())]

    def flight(size, mode):
        means = np.zeros((10, 2))
        means[:5] = (size / 0.589 / 2 * runs) ** 2  # position, velocity and attitude alike
        found = _flight(means)
        return found._replace(mode_probability=np.array([mode * runs, 1 - mode * runs]))

    results = {
        "pure navigation": [flight(1000.0, 0.5)] * 6,
        "optimal EKF": [flight(100.0, 0.5)] * 6,
    }
    for name in names:
        results[name] = [flight(tcep(name, s), modes(name, s)) for s in grid]
    scenario = attrs.evolve(SHORT, sigma_true=grid, more_runs=1)
    return conditions.Sea(scenario, Flown(grid, results))


def _modes(name, sigma):
    wide = 0.1 if "0.1,1" in name else 0.0
    return 0.5 + (0.3 + wide) * (0.5 - sigma)


CLAIMED = {
    "4.6": lambda sea: conditions.fading([sea], 1.0, -math.inf, 1.0),
    "4.7": lambda sea: conditions.fading([sea], 0.05, 1.0, 1.1),
    "4.8": lambda sea: conditions.imm_rates([sea], PAIRS, CHAINS, 90.0, math.inf),
    "4.9": lambda sea: conditions.narrow_pair(sea, sea, CHAINS),
    "4.12": lambda sea: conditions.modes(sea, PAIRS, CHAINS),
    "4.14": lambda sea: conditions.prominent([sea]),
    "4.22": conditions.fading_below,
    "4.23": lambda sea: conditions.robust(sea, PAIRS, CHAINS),
    "4.26": lambda sea: conditions.compensates(sea, CHAINS),
    "4.27": lambda sea: conditions.imm_rates([sea], PAIRS, CHAINS, -math.inf, 100.0),
    "4.29": lambda sea: conditions.fading_in_imm(sea, sea, CHAINS),
    "4.30": lambda sea: conditions.better_chain(sea, PAIRS, [0.95]),
    "4.34": conditions.fading_is_robust,
    "4.35": conditions.at_home,
}


# TCEPs (m) of all filters where a mirrored sea does not contradict: all good, all bad.
OTHER_MIRRORS = {"4.14": 110.0, "4.27": 90.0, "4.35": 300.0}


@pytest.mark.parametrize("number", CLAIMED)
def test_conditions_hold_in_a_sea_where_the_claim_is_true_and_fail_in_its_mirror(number):
    true = _sea(_true_sea, _modes)
    # What was better is worse; with fading and without change places, and so do the models.
    false = _sea(
        lambda n, s: 900.0 - _true_sea(n, s) if n[0] == "I" else _true_sea(_swap(n), s),
        lambda n, s: 1 - _modes(n, s),
    )
    if number in OTHER_MIRRORS:
        false = _sea(lambda n, s: OTHER_MIRRORS[number])
    if number == "4.34":  # against 4.7: no sea has both for all sigma_f
        true = _sea(lambda n, s: 150.0 - 10 * n.startswith("AF") + s)
        false = _sea(lambda n, s: 150.0 + 10 * n.startswith("AF") + s)
    assert {c.outcome for c in CLAIMED[number](true)} == {"holds"}
    assert {c.outcome for c in CLAIMED[number](false)} == {"fails"}


def _swap(name):
    return name[2:] if name.startswith("AF") else f"AF{name}"


def test_an_imm_is_held_against_the_worse_half_and_where_the_sea_is_beyond_both():
    # Better than the worse of its halves, worse than the better one.
    between = _sea(lambda n, s: 250.0 if n[0] == "I" else 200.0 if n.endswith("0.1") else 400.0)
    assert {c.outcome for c in conditions.compensates(between, CHAINS)} == {"holds"}
    far = {c.what.removesuffix(", zero start") for c in conditions.prominent([between])}
    assert far == {f"rate of AFEKF {x} m/s" for x in ("0.1 at 1", "0.5 at 0.05", "1 at 0.05")}
    beyond_both = conditions.fading_in_imm(between, between, CHAINS)
    assert {c.what.split(" at ")[1].split()[0] for c in beyond_both} == {"0.6", "0.9", "1"}


def test_conditions_of_the_tables_hold_where_the_tables_are_true_and_fail_in_the_mirror():
    true, false = _sea(_true_sea), _sea(lambda n, s: 900.0 - _true_sea(n, s))
    for test in (tables.best_and_worst, lambda seas: tables.discrepancy(seas, CHAINS)):
        assert {c.outcome for c in test([true])} == {"holds"}
        assert {c.outcome for c in test([false])} == {"fails"}
    # The printed position errors themselves, and with one filter twice as good.

    def as_printed(better):
        def tcep(name, sigma):
            table = 2 if sigma == printed.SIGMA[2] else 3
            cells = printed.CELLS[table].get(name.partition(" p=")[0], (300.0,))
            return cells[0] * (better if name.startswith("AFEKF 0.1") else 1.0)

        found = tables.ratios([_sea(tcep)], CHAINS)
        return {c.what: c.estimate.value / math.sqrt(c.low * c.high) for c in found}

    assert list(as_printed(1.0).values()) == pytest.approx([1.0] * len(as_printed(1.0)))
    for what, off in as_printed(0.5).items():
        assert off == pytest.approx(0.5 if ": AFEKF 0.1 over" in what else 1.0), what


def test_standard_error_at_the_runs_of_the_paper():
    four_times = estimates.Estimate(1.0, 0.9, 1.1, 0.05, 400)
    assert tables.paper_se(four_times, 400) == pytest.approx(0.1)


# Of 20 runs one whole batch need not be flown again, of 4 none.
@pytest.mark.parametrize(("runs", "more"), [(4, 4), (20, 2)])
def test_open_conditions_have_more_runs_and_decided_ones_do_not(runs, more):
    few = attrs.evolve(SHORT, runs=runs, more_runs=more, sigma_true=(0.05, 0.3, 1.0))
    filters = [run.EKF(0.1), run.AFEKF(few, 0.1), run.EKF(0.5), run.AFEKF(few, 0.5)]
    sea = conditions.Sea(few, Flown(few.sigma_true, run.sweep(few, filters, stride=60)))
    before = conditions.fading_below(sea)
    after = conditions.longer(conditions.fading_below, sea)
    assert sea.flown.longer.asked == {}
    many = run.sweep(few.longer(), filters)
    direct = conditions.fading_below(conditions.Sea(few, Flown(few.sigma_true, many)))
    counts = {c.what: c.estimate.count for c in after if c.counts}
    assert set(counts.values()) == {runs, runs * more}
    for one, other, expected in zip(before, after, direct, strict=True):
        assert other.estimate == (expected if one.outcome == "undecided" else one).estimate
    # Where a rate is least is known only if all points were flown with as many runs.
    assert sea.flown.longer.least("AFEKF 0.1") is None
    direct = Flown(few.sigma_true, many)
    for c in conditions.longer(conditions.fading_is_robust, sea):
        names = [f"{kind} {c.group.split()[2]}" for kind in ("AFEKF", "EKF")]
        flown = direct if c.counts and c.estimate.count == runs * more else sea.flown
        assert c.estimate == flown.least_difference(*names)
    none = attrs.evolve(few, more_runs=1)
    same = conditions.longer(conditions.fading_below, conditions.Sea(none, sea.flown))
    assert [c.what for c in same] == [c.what for c in after]
    # Flights of the same scenario share what was flown.
    again = conditions.Sea(few, Flown(sea.flown.grid, sea.flown.results, beside=sea.flown))
    assert conditions.fading_below(again) == after
    assert again.flown.longer.asked == {}


def test_a_crossing_is_said_in_words_at_both_ends():
    grid = np.array([0.1, 0.2, 0.4])
    assert crossing(grid, [1.0, 2.0, 4.0], 3.0) == "0.300"
    assert crossing(grid, [5.0, 6.0, 7.0], 3.0) == "below 0.1"
    assert crossing(grid, [1.0, 1.5, 2.0], 3.0) == "beyond 0.4"


def test_growth_of_the_appendix_compares_a_strong_current_with_a_weak_one():
    P = {s: np.full((3, 2, 2), s) for s in (0.1, 1.0)}
    P[0.1][0, 0, 1] = 0.0
    found = conditions.appendix_growth(P, {"P₁₂": (0, 1), "P₁₁": (0, 0)}, "after", (1, 3))
    assert [c.outcome for c in found] == ["not run", "holds", "holds", "holds"]
    assert found[1].estimate.value == pytest.approx(10)


def test_filters_that_claims_speak_of_are_found_by_name():
    found = beyond.filters(Scenario())
    assert found["AFEKF 0.5"] == run.AFEKF(Scenario(), 0.5)
    assert found["IMM-EKF 0.1,0.5 p=0.95"].transition == beyond.chain(0.95)
    assert all(name == one.name for name, one in found.items())


def test_tables_list_every_printed_cell_and_an_imm_for_each_reading_of_T():
    chains = beyond.diagonals(Scenario())
    assert chains == {"p = 0.9": "", "p = 0.95": " p=0.95"}
    names = [own for _, own, _, _ in tables.rows(2, chains)]
    assert names[-2:] == ["IMM-AFEKF 0.1,0.5", "IMM-AFEKF 0.1,0.5 p=0.95"]
    assert len(names) == len(printed.CELLS[2]) + 1
    assert beyond.other_p(Scenario(transition=((0.95, 0.05), (0.05, 0.95)))) == 0.9
    starts = [
        beyond.other_start(attrs.evolve(SHORT, initial_current=s)) for s in ("zero", "stationary")
    ]
    assert [one.initial_current for one in starts] == ["stationary", "zero"]


def test_a_jump_of_the_current_leaves_what_was_before_it():
    early, late = (beyond.changing(SHORT, at=at)["EKF 0.1"] for at in (0.25, 0.75))
    quarter = early.series.errors.shape[0] // 4
    assert np.array_equal(early.series.errors[:quarter], late.series.errors[:quarter])
    assert not np.array_equal(early.series.errors[quarter], late.series.errors[quarter])
