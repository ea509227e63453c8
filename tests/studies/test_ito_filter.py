"""The study of paper 1, against independent references."""

import dataclasses

import attrs
import numpy as np
import pytest
import sympy as sp
from matplotlib import pyplot as plt
from scipy import stats

from seanav import estimates
from seanav.checks import ParameterError
from seanav.estimates import significant
from seanav.filters import moments
from seanav.filters.moments import continuous_discrete
from seanav.models import bodies
from seanav.studies.ito_filter import beyond, figures, run, scores
from seanav.studies.ito_filter.claims import CLAIMS
from seanav.studies.ito_filter.scenario import VEHICLES, Scenario, body_origins

SMALL = Scenario(
    runs=4, particle_runs=2, mission=4.0, particles=50, map_noise=(1.0,), map_interval=(0.5, 1.0)
)
LOST = estimates.mean(np.array([1.0, np.nan]))  # of two runs one has diverged


# ---------------------------------------------------------------- the stochastic equation


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_short_horizon_monte_carlo_has_the_predicted_mean_and_variance(vehicle):
    # From a Gaussian start the closure's first derivatives are exact: the horizon is short.
    steps = {"torpedo_step": 0.005, "sphere_step": 0.005, "filter_step": 0.005}
    scenario = attrs.evolve(Scenario(), runs=40_000, interval=0.05, mission=0.1, seed=5, **steps)
    truth = run.simulate(scenario, vehicle)
    one = attrs.evolve(scenario, runs=2, particle_runs=2)
    free = run.estimate(one, run.simulate(one, vehicle), scenario.cases[0], corrected=False)
    x, mean, P = truth.x[:, 1], free.mean[0, 1], free.P[0, 1]
    se = x.std(axis=0) / np.sqrt(len(x))
    # 4.2 standard errors: one false alarm in 3000 for the twelve comparisons.
    assert (np.abs(x.mean(axis=0) - mean) < 4.2 * se).all()
    assert (np.abs(x.var(axis=0) / np.diag(P) - 1) < 4.2 * np.sqrt(2 / len(x))).all()
    start = scenario.prior(vehicle)[1]
    assert np.abs(np.diag(P) / np.diag(start) - 1).max() > 0.1, "the horizon must show a change"


def test_consistency_bound_holds_and_a_mistuned_filter_breaks_it():
    # Sphere, nearly linear: mean NEES of independent runs at one time is chi-square.
    scenario = attrs.evolve(Scenario(), runs=200, mission=4.0, seed=11)
    truth = run.simulate(scenario, "sphere")
    case = scenario.cases[0]
    low, high = stats.chi2.ppf([1e-4, 1 - 1e-4], 6 * 200) / 200
    right = scores.score(truth, run.estimate(scenario, truth, case))
    assert low < right.nees_by_time[3] < high
    bold = attrs.evolve(truth, parameters=bodies.SPHERE.parameters(0.6 * scenario.noise("sphere")))
    wrong = scores.score(truth, run.estimate(scenario, bold, case))
    assert wrong.nees_by_time[3] > high
    shy = attrs.evolve(truth, parameters=bodies.SPHERE.parameters(1.8 * scenario.noise("sphere")))
    assert scores.score(truth, run.estimate(scenario, shy, case)).nees_by_time[3] < low


def test_large_noise_is_the_open_loop():
    truth = run.simulate(SMALL, "torpedo")
    near, far = (run.open_loop_limit(SMALL, truth, SMALL.cases[1], R) for R in (1e6, 1e8))
    # A correction is P Cᵀ R⁻¹ times a residual of size √R: it falls as 1/√R.
    assert far == pytest.approx(near / 10, rel=0.02)
    assert far < 10 / np.sqrt(1e8)


# ---------------------------------------------------------------- closed forms


def test_planar_closed_form_against_simulation():
    z0, r0, variance, d, k, g, end = 1.0 + 0.5j, 0.4, 0.02, 0.05, 0.5, 0.4, 3.0
    rng = np.random.default_rng(3)
    start = np.tile([z0.real, z0.imag, r0], (20_000, 1))
    start[:, 2] += np.sqrt(variance) * rng.standard_normal(20_000)
    noise = rng.standard_normal((20_000, 600, 1))
    x = moments.Simulator(beyond.planar())(start, noise, 0.005, None, [d, k, g], 600)[:, -1]
    mean, trace = beyond.planar_exact(z0, r0, variance, d, k, g, [end])
    assert x[:, 0].mean() == pytest.approx(mean[0].real, abs=0.02)
    assert x[:, 1].mean() == pytest.approx(mean[0].imag, abs=0.02)
    assert x[:, 0].var() + x[:, 1].var() == pytest.approx(trace[0], rel=0.03)


def test_planar_closure_keeps_the_energy_and_misplaces_a_little_of_the_mean():
    setup = dict(z0=1 + 0j, r0=0.4, variance=0.02, d=0.05, k=0.5, g=0.4)
    times = np.linspace(0, 2, 21)
    exact, closure = (f(times=times, **setup) for f in (beyond.planar_exact, planar_gaussian))
    energy = np.abs(closure[0]) ** 2 + closure[1]
    np.testing.assert_allclose(energy, np.exp(-0.1 * times), rtol=1e-8)
    # What the mean lacks is in the covariance: the defect is of fourth order in time.
    defect = closure[1] - exact[1]
    np.testing.assert_allclose(defect, np.abs(exact[0]) ** 2 - np.abs(closure[0]) ** 2, atol=1e-8)
    assert 0 < defect[10] < 0.01 * closure[1][10]
    assert abs(closure[0][-1] - exact[0][-1]) < 0.006
    assert abs(beyond.planar_closure("ekf", times=times, **setup)[0][-1] - exact[0][-1]) > 0.08


def planar_gaussian(**setup):
    return beyond.planar_closure("gaussian", **setup)


def test_reduction_agrees_with_fokker_planck_while_it_is_nearly_gaussian():
    setup = ((0.1, 0.2), 0.5, np.zeros(2), 0.005 * np.eye(2))
    out, _ = beyond.sway_yaw_reference(*setup, half_widths=(0.6, 1.2))
    mean, P = out["Fokker–Planck"]
    np.testing.assert_allclose(out["gaussian"][0], mean, atol=1e-4)
    np.testing.assert_allclose(out["gaussian"][1], P, rtol=5e-3)
    # What neither of the others gives: the truncated mean is right, its covariance is not.
    np.testing.assert_allclose(out["second order"][0], mean, atol=2e-4)
    assert out["second order"][1][1, 1] > 1.05 * P[1, 1]
    assert out["ekf"][1][1, 1] > 1.05 * P[1, 1]
    assert abs(out["ekf"][0][1] - mean[1]) > 1e-3


# ---------------------------------------------------------------- times and their labels


def truths_of_the_map(scenario, vehicle, monkeypatch):
    """Return {interval: truth} that `second_order_map` hands to its filters."""
    truths = {}

    def estimate(scenario, truth, case, closure="gaussian", corrected=True):
        truths[truth.times[1]] = truth
        P = np.broadcast_to(np.eye(6), (*truth.x.shape, 6))
        return continuous_discrete.Track(truth.x + 1.0, P, np.zeros(truth.x.shape[:2]))

    with monkeypatch.context() as patch:
        patch.setattr(run, "estimate", estimate)
        rows = beyond.second_order_map(scenario, vehicle)
    assert sorted({row[1] for row in rows}) == sorted(truths) == sorted(scenario.map_interval)
    return truths


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_truth_of_the_map_has_the_moments_of_its_labelled_times(vehicle, monkeypatch):
    # A body of equal masses with linear drag alone: E|x|² of the scheme is known at each
    # step, and falls by 8 % every 0.01 s.
    rate, noise = 4.0, 0.05
    body = bodies.Body(vehicle, (1.0,) * 3, (1.0,) * 3, (rate,) * 6, (0.0,) * 6, (0.0,) * 6, ())
    monkeypatch.setitem(bodies.BODIES, vehicle, body)
    start = {f"{vehicle}_start": (0.0,) * 6, f"{vehicle}_noise": (noise,) * 6}
    scenario = Scenario(runs=4000, mission=4.0, map_noise=(1.0,), map_interval=(0.25, 0.5), **start)
    variance = np.sum(scenario.prior(vehicle)[1])
    for interval, truth in truths_of_the_map(scenario, vehicle, monkeypatch).items():
        for k in (0, 1):
            steps = round(k * interval / 0.01)
            shrink = (1 - 0.01 * rate) ** (2 * steps)
            added = 6 * noise**2 * 0.01 * (1 - shrink) / (1 - (1 - 0.01 * rate) ** 2)
            # 4.5 standard errors of a sum of 24 000 squares.
            wanted = pytest.approx(shrink * variance + added, rel=4.5 * np.sqrt(2 / 24_000))
            assert np.square(truth.x[:, k]).sum(axis=1).mean() == wanted


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_truth_is_kept_at_the_times_that_label_it(vehicle, monkeypatch):
    scenario = attrs.evolve(SMALL, map_interval=(0.25, 0.5, 1.0))
    noise, step = scenario.noise(vehicle), scenario.map_step
    fine = run.simulate(scenario, vehicle, noise, keep=step, mission=2.0, step="map_step")
    assert fine.times[-1] == pytest.approx(2.0)
    for interval, truth in truths_of_the_map(scenario, vehicle, monkeypatch).items():
        np.testing.assert_allclose(np.diff(truth.times), interval, rtol=1e-12)
        at = np.round(truth.times / step).astype(int)
        np.testing.assert_allclose(fine.times[at], truth.times, rtol=1e-12)
        assert np.array_equal(truth.x, fine.x[:, at])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"keep": 0.25}, "sphere_step = 0.02: must divide keep = 0.25 evenly"),
        ({"keep": 0.01}, "sphere_step = 0.02: must divide keep = 0.01 evenly"),
        ({"mission": 1.7}, "keep = 0.5: must divide mission = 1.7 evenly"),
        ({"mission": 1.79}, "sphere_step = 0.02: must divide mission = 1.79 evenly"),
        ({"mission": 1e9}, "sphere_step = 0.02: must cut mission = 1e.09 into at most"),
        ({"step": "map_step", "keep": 0.015}, "map_step = 0.01: must divide keep = 0.015 evenly"),
    ],
)
def test_times_between_the_steps_are_not_simulated(change, message):
    with pytest.raises(ParameterError, match=message):
        run.simulate(SMALL, "sphere", **change)


def test_half_a_mission_holds_every_interval_of_the_map_whole():
    for mission, intervals, wanted in (
        (40.0, (0.25, 0.5, 1.0, 2.0), 20.0),
        (50.0, (0.25, 0.5, 1.0, 2.0), 26.0),
        (1.0, (0.5, 1.0, 1.5), 3.0),
        (4.0, (2.0,), 4.0),
    ):
        scenario = Scenario(mission=mission, map_interval=intervals)
        assert scenario.map_mission == pytest.approx(wanted)


# ---------------------------------------------------------------- divergence


def test_truth_that_explodes_is_shown_as_diverged_and_no_filter_is_judged_by_it():
    scenario = attrs.evolve(SMALL, torpedo_noise=(30.0,) * 6)
    truth = run.simulate(scenario, "torpedo")
    assert truth.lost.all()
    assert np.isfinite(truth.x[:, 0]).all()
    result = run.run_case(scenario, truth, scenario.cases[0])
    assert all(one.rmse(0).diverged and one.lost == 4 for one in result.scores.values())
    assert np.isnan(result.track.P[:, 1:]).all(), "nothing is estimated of what diverged"
    assert np.isnan(run.cloud(scenario, truth, scenario.cases[0]).mean[:, 1:]).all()
    gain = result.gain()
    assert scores.condition("gain", gain, high=1, lost=4, aside="the vehicle").aside
    assert not scores.condition("gain", gain, high=1, lost=4, aside="the vehicle").counts
    rows = beyond.second_order_map(attrs.evolve(scenario, map_noise=(1.0,)), "torpedo")
    assert all(row[2].diverged and row[3].diverged for row in rows)


def test_a_run_that_explodes_leaves_the_others_alone():
    truth, case = run.simulate(SMALL, "torpedo"), SMALL.cases[0]
    x = truth.x.copy()
    x[2, 1:] = np.nan
    whole, holed = (run.estimate(SMALL, t, case).mean for t in (truth, attrs.evolve(truth, x=x)))
    np.testing.assert_array_equal(np.delete(whole, 2, axis=0), np.delete(holed, 2, axis=0))
    assert np.isnan(holed[2, 1:]).all()


def test_filters_that_diverge_are_shown_as_diverged():
    # Strong noise on a long step of the filters: all of the torpedo's explode.
    scenario = attrs.evolve(SMALL, strong_noise=30.0, filter_step=0.25)
    truth = run.simulate(scenario, "torpedo", scenario.noise("torpedo", 30.0))
    result = run.run_case(scenario, truth, scenario.cases[0])
    lost = [name for name, one in result.scores.items() if not np.isfinite(one.squared).all()]
    assert lost
    assert 0 < result.scores[lost[0]].lost <= 4
    assert result.scores[lost[0]].rmse(0).diverged
    assert scores.shown(result.scores[lost[0]].rmse(0)) == "diverged"
    assert scores.entry(result.scores[lost[0]].rmse(0)) == "diverged"
    assert result.over_open_loop(0, lost[0]).diverged
    condition = scores.condition("torpedo, u", result.over_open_loop(0, lost[0]), high=0.5)
    assert condition.outcome == "fails"
    assert str(condition) == "torpedo, u: diverges, claimed at most 0.500, fails"


def test_what_is_finite_is_shown_and_judged_as_it_is():
    estimate = estimates.mean(np.array([0.2, 0.3]))
    assert scores.shown(estimate) == significant(estimate)
    assert scores.entry(estimate) == pytest.approx(0.25)
    assert (scores.shown(0.25), scores.entry(0.25)) == ("0.250", 0.25)
    assert scores.shown(np.nan) == scores.entry(np.float64("nan")) == "diverged"
    condition = scores.condition("torpedo, u", estimate, high=5)
    assert (condition.estimate, condition.low, condition.high) == (estimate, -np.inf, 5)
    assert scores.condition("far", 0.25, low=0.1).estimate == estimates.exact(0.25)
    assert scores.condition("far", np.nan, low=0.1).outcome == "fails"
    # An EKF that diverges beside a closure that does not is no fault of the closure.
    assert scores.condition("gain", LOST, high=1, lost=0).outcome == "holds"
    assert scores.condition("gain", LOST, high=1, lost=3).outcome == "fails"


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "change",
    [
        {},
        {"strong_noise": 30.0, "filter_step": 0.25, "map_noise": (30.0,)},
        {"torpedo_noise": (30.0,) * 6, "sphere_noise": (300.0,) * 6},
        {"interval": 20.0, "mission": 40.0},
        {"mission": 1.0, "map_interval": (1.0,)},
    ],
)
def test_figures_draw_what_there_is(change):
    scenario = attrs.evolve(SMALL, **change)
    results = run.run_all(scenario, scenario.strong_noise)
    maps = {v: beyond.second_order_map(scenario, v) for v in VEHICLES}
    factors = [0.5, 1.0, scenario.strong_noise]
    own = beyond.sensitivity(scenario, "torpedo", [1e-4, 1e4], factors)
    assert own.shape == (3, 2, 8, 6)
    sds = np.sqrt(own.mean(axis=2))
    history = run.history(scenario, "torpedo", scenario.cases[0])
    drawn = [
        figures.opening(history),
        figures.overview(history),
        figures.component(history, 3),
        figures.nees(results, estimates.consistency_bounds(6, scenario.runs)),
        figures.second_order_map(maps),
        figures.sensitivity([1e-4, 1e4], factors, sds),
    ]
    for fig in drawn:
        fig.canvas.draw()
        plt.close(fig)


def test_pictures_of_the_scalar_example_hold_what_they_are_given():
    times = np.array([0.0, 1.0, 2.0])
    fig = figures.closures(
        times, np.array([[1, 0.5, 0], [1, 4, 9]]), {n: np.ones((2, 3)) for n in moments.CLOSURES}
    )
    assert [ax.get_title() for ax in fig.axes] == ["EKF", "truncated", "Gaussian closure"]
    for ax in fig.axes:
        assert ax.lines[0].get_ydata().tolist() == [1, 0.5, 0]
        assert ax.collections[0].get_datalim(ax.transData).bounds[1::2] == (-3, 6)
    plt.close(fig)
    W = np.array([0.0, 3.0, 1.0])
    fig = figures.quadratic_variation({2.0: (times[::2], W[::2]), 1.0: (times, W), 0.5: (times, W)})
    sums = [line.get_ydata().tolist() for line in fig.axes[1].lines[:2]]
    assert sums == [[1.0], [9.0, 13.0]]
    plt.close(fig)


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_a_drawn_run_is_the_first_of_the_study(vehicle):
    case = SMALL.cases[2]
    truth = run.simulate(SMALL, vehicle)
    track, free = (run.estimate(SMALL, truth, case, corrected=c) for c in (True, False))
    drawn = run.history(SMALL, vehicle, case)
    each = (len(drawn.times) - 1) // (len(truth.times) - 1)
    assert each > 1
    np.testing.assert_allclose(drawn.x[::each], truth.x[0], rtol=1e-12)
    np.testing.assert_allclose(drawn.z, run.measure(SMALL, truth, case)[0], rtol=1e-12)
    # At a measurement the grid stands still: before it the prediction, after it the estimate.
    before, after = (np.flatnonzero(np.diff(drawn.grid) == 0) + k for k in (0, 1))
    assert len(before) == len(truth.times) - 1
    np.testing.assert_allclose(drawn.grid[after], truth.times[1:])
    np.testing.assert_allclose(drawn.mean[after], track.mean[0, 1:], rtol=1e-12)
    own = np.sqrt(np.diagonal(track.P[0, 1:], axis1=1, axis2=2))
    np.testing.assert_allclose(drawn.sd[after], own, rtol=1e-12)
    assert (drawn.sd[after] < drawn.sd[before])[:, 3:].all()
    np.testing.assert_allclose(drawn.free[before], free.mean[0, 1:], rtol=1e-9)
    assert np.abs(drawn.mean[before] - drawn.mean[after]).max() > 1e-3


def test_lines_of_the_map_that_fall_are_counted():
    values = {(1.0, 0.5): 0.9, (1.0, 1.0): 0.8, (2.0, 0.5): 0.95, (2.0, 1.0): 0.7}
    rows = [(f, t, estimates.exact(value)) for (f, t), value in reversed(values.items())]
    assert beyond.falling(rows, 1) == (2, 2)
    assert beyond.falling(rows, 0) == (1, 2)
    assert beyond.falling([*rows, (4.0, 1.0, LOST), (4.0, 0.5, LOST)], 1) == (2, 3)
    assert beyond.falling([*rows, (4.0, 1.0, LOST), (4.0, 0.5, LOST)], 0) == (0, 2)
    # From a filter that diverged to one that did not is no fall.
    half = [(4.0, 0.5, LOST), (4.0, 1.0, estimates.exact(0.1))]
    assert beyond.falling([*rows, *half], 1) == (2, 3)


def test_map_is_drawn_in_the_order_it_is_given():
    rows = [
        (factor, interval, estimates.exact(factor + interval / 10), estimates.exact(1.0))
        for factor in (2.0, 1.0)
        for interval in (3.0, 2.0)
    ]
    fig = figures.second_order_map({"torpedo": rows, "sphere": rows})
    ax = fig.axes[0]
    words = {text.get_text(): text.get_position() for text in ax.texts}
    across = {
        label.get_text(): x for x, label in zip(ax.get_xticks(), ax.get_xticklabels(), strict=True)
    }
    up = {
        label.get_text(): y for y, label in zip(ax.get_yticks(), ax.get_yticklabels(), strict=True)
    }
    assert words["2.300"] == (across["3"], up["2"])
    assert words["1.200"] == (across["2"], up["1"])
    plt.close(fig)


# ---------------------------------------------------------------- study


def test_sphere_hides_its_linear_velocity_from_angular_rates():
    ranks = {row[:2]: row[-1] for row in beyond.observability_rows(4)}
    assert ranks == {
        ("torpedo", "linear"): 6,
        ("torpedo", "angular"): 6,
        ("sphere", "linear"): 6,
        ("sphere", "angular"): 3,
    }


@pytest.mark.parametrize("words", beyond.MEASURED)
def test_observability_matrix_is_the_slope_of_the_outputs_derivatives(words):
    # Independent of the Lie derivatives: the output of the noise-free body as a power series
    # in time, from Picard's iteration in exact numbers, and central differences of the start.
    point = beyond.point("torpedo")
    model, h = run.body(), sp.Rational(1, 10**6)
    drift = [
        f.xreplace({k: v for k, v in point.items() if k not in model.states}) for f in model.drift
    ]
    start = [point[x] for x in model.states]

    def derivatives(start):
        t = sp.Symbol("t")
        path = [sp.Poly(x, t) for x in start]
        for _ in range(2):
            at = dict(zip(model.states, (p.as_expr() for p in path), strict=True))
            rates = [sp.Poly(f.xreplace(at), t) for f in drift]
            path = [
                sp.Poly([c for c in (r.integrate(t) + x).all_coeffs()[-3:]], t)
                for r, x in zip(rates, start, strict=True)
            ]
        chosen = path[beyond.MEASURED[words]]
        return [float(p.coeff_monomial(t**k) * sp.factorial(k)) for k in range(3) for p in chosen]

    numbers = np.array(beyond.observability_matrix(words).xreplace(point), dtype=float)
    for j in range(6):
        ends = []
        for sign in (1, -1):
            moved = list(start)
            moved[j] += sign * h
            ends.append(derivatives(moved))
        slope = (np.array(ends[0]) - ends[1]) / float(2 * h)
        np.testing.assert_allclose(numbers[:, j], slope, rtol=1e-6, atol=1e-6)


def test_a_minor_that_is_not_zero_says_what_the_rank_says():
    ranks = {row[:2]: row[4] for row in beyond.observability_rows(3)}
    for (vehicle, words), rank in ranks.items():
        assert (beyond.minor(words, vehicle)[1] != 0) == (rank == 6)


def test_remark_two_is_bayes_rule():
    for words in beyond.MEASURED:
        assert beyond.remark_two(words) == (0, 0)
    # One state measured directly: precisions add, the mean is weighed by them.
    P, R = sp.diag(4, 1, 1, 1, 1, 1), sp.eye(3)
    mean, z, C = sp.zeros(6, 1), sp.Matrix([5, 0, 0]), sp.eye(6)[:3, :]
    after, covariance = beyond.information_form(mean, P, z, C, R)
    assert (after[0], covariance[0, 0]) == (4, sp.Rational(4, 5))
    assert covariance[1, 1] == sp.Rational(1, 2)
    assert covariance[5, 5] == 1


def test_remark_two_sees_a_wrong_form(monkeypatch):
    right = beyond.information_form

    def wrong(mean, P, z, C, R):
        after, covariance = right(mean, P, z, C, 2 * R)
        return after, covariance

    monkeypatch.setattr(beyond, "information_form", wrong)
    assert all(count > 0 for count in beyond.remark_two.__wrapped__("linear"))  # not the kept one


def test_roll_is_hardly_seen_by_velocities_however_often_they_are_measured():
    scenario = attrs.evolve(SMALL, runs=12)
    ratios = beyond.roll_by_interval(scenario)
    assert list(ratios) == [0.5, 0.05]
    for ratio in ratios.values():
        assert 0.95 < ratio.value < 1.01
    # A truth whose steps do not fit into the filter's is measured at its own interval only.
    odd = attrs.evolve(
        SMALL, torpedo_step=0.0125, interval=0.5, filter_step=0.02, map_interval=(0.5,)
    )
    assert list(beyond.roll_by_interval(odd)) == [0.5]


def test_map_tells_both_closures():
    scenario = attrs.evolve(SMALL, map_noise=(2.0,), map_interval=(1.0,))
    ((factor, interval, gaussian, truncated),) = beyond.second_order_map(scenario, "torpedo")
    assert (factor, interval) == (2.0, 1.0)
    assert gaussian != truncated


def test_claims_are_declared_in_order():
    assert [claim.number for claim in CLAIMS] == [f"1.{k}" for k in range(1, len(CLAIMS) + 1)]


def test_cases_measure_what_the_paper_says():
    one, two, three = Scenario().cases
    for case, H in ((one, np.eye(3, 6)), (two, np.eye(3, 6)), (three, np.eye(3, 6, 3))):
        assert np.array_equal(case.H, H)
    assert one.R < two.R == three.R
    truth = run.simulate(SMALL, "torpedo")
    z = run.measure(SMALL, truth, attrs.evolve(three, R=1e-12))
    np.testing.assert_allclose(z, truth.x[:, 1:, 3:], atol=1e-5)
    strong = Scenario().noise("sphere", 3.0) / Scenario().noise("sphere")
    np.testing.assert_allclose(strong, [1, 1, 1, 3, 3, 3])


def test_scores_are_what_they_say():
    truth = run.simulate(SMALL, "sphere")
    runs, samples = truth.x.shape[:2]
    error = np.arange(1.0, 7.0)
    P = np.broadcast_to(np.diag(error**2), (runs, samples, 6, 6))
    track = continuous_discrete.Track(truth.x + error, P, np.zeros((runs, samples)))
    score = scores.score(truth, track)
    np.testing.assert_allclose(score.squared, np.tile(error**2, (runs, 1)))
    np.testing.assert_allclose(score.nees, 6.0)
    assert score.rmse(2).value == pytest.approx(3.0)
    assert score.own_sd_ratio(4).value == pytest.approx(1.0)
    twice = scores.score(truth, dataclasses.replace(track, mean=truth.x + 2 * error))
    ratio = scores.root_ratio(twice.squared[:, 0], score.squared[:, 0])
    assert ratio.value == pytest.approx(2.0)
    np.testing.assert_allclose(scores.total(twice, score), 4.0)


def test_interval_of_a_ratio_agrees_with_the_jackknife():
    rng = np.random.default_rng(12)
    a = rng.gamma(2.0, size=200)
    b = a + rng.gamma(1.0, size=200)
    left_out = [np.sqrt(np.delete(a, r).mean() / np.delete(b, r).mean()) for r in range(200)]
    jackknife = np.sqrt(199 * np.var(left_out))
    assert scores.root_ratio(a, b).se == pytest.approx(jackknife, rel=0.02)


def test_threads_and_number_of_runs_change_nothing(monkeypatch):
    ends = []
    for threads, runs in (("1", 4), ("2", 4), ("2", 3)):
        monkeypatch.setenv("SEANAV_THREADS", threads)
        scenario = attrs.evolve(SMALL, runs=runs)
        truth = run.simulate(scenario, "torpedo")
        ends.append(run.estimate(scenario, truth, scenario.cases[2]).mean)
    assert np.array_equal(ends[0], ends[1])
    assert np.array_equal(ends[0][:3], ends[2])


def test_cases_share_truth_and_measurement_noise():
    truth = run.simulate(SMALL, "torpedo")
    small, large = (run.measure(SMALL, truth, case) for case in SMALL.cases[:2])
    noise = (small - truth.x[:, 1:, :3]) / 1e-2
    np.testing.assert_allclose(noise, large - truth.x[:, 1:, :3], atol=1e-10)


def test_small_study_runs_through_everything():
    results = run.run_all(SMALL)
    assert set(results) == {(v, k) for v in VEHICLES for k in (1, 2, 3)}
    result = results["torpedo", 1]
    assert result.over_open_loop(0).value < 0.5
    cloud = run.cloud(SMALL, result.truth, result.case)
    assert cloud.mean.shape == (2, 9, 6)
    assert [row[:2] for row in beyond.second_order_map(SMALL, "sphere")] == [(1.0, 0.5), (1.0, 1.0)]
    sds = beyond.sensitivity(SMALL, "sphere", [1e-4, 1e4], [1.0, 2.0])
    assert (sds[:, 0] <= sds[:, 1]).all()
    assert (sds[0] < sds[1]).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"runs": -1}, "runs = -1: must be an integer of at least 2"),
        ({"small_R": 0.0}, "small_R = 0.0: must be a finite number at least 1e-12"),
        ({"large_R": -1.0}, "large_R = -1.0: must be a finite number at least 1e-12"),
        ({"large_R": 1e300}, "large_R = 1e.300: must be a finite number .*at most 1e.12"),
        ({"map_R": 1e-300}, "map_R = 1e-300: must be a finite number at least 1e-12"),
        ({"torpedo_start": [1.0]}, r"torpedo_start = \[1.0\]: must be a list of 6 values"),
        ({"torpedo_start": [1e9] * 6}, "torpedo_start = 1000000000.0: must be .*at most 1000"),
        ({"sphere_noise": [0.1] * 5 + [0.0]}, "sphere_noise = 0.0: must be a finite number at l"),
        ({"sphere_noise": [1e300] * 6}, "sphere_noise = 1e.300: must be .*at most 1000"),
        ({"sphere_variance": "abc"}, "sphere_variance = 'abc': must be a list of 6 values"),
        ({"torpedo_step": 0.03}, "torpedo_step = 0.03: must divide interval = 0.5 evenly"),
        ({"torpedo_step": 0.5}, "torpedo_step = 0.5: must be at most half .* fastest axis, 0.124"),
        ({"sphere_step": 0.5}, "sphere_step = 0.5: must be at most half .* fastest axis, 0.192"),
        ({"map_step": 0.125}, "map_step = 0.125: must be at most half .* fastest axis, 0.124"),
        ({"torpedo_step": 0.1}, "torpedo_step = 0.1: twice .*must divide interval = 0.5 evenly"),
        ({"torpedo_step": 0.02}, "torpedo_step = 0.02: twice .*must divide interval = 0.5 evenly"),
        ({"torpedo_step": 1e-12}, "torpedo_step = 1e-12: must be a finite number at least 0.0001"),
        ({"sphere_step": 0.04}, "sphere_step = 0.04: must divide interval = 0.5 evenly"),
        ({"filter_step": 0.7}, "filter_step = 0.7: must divide interval = 0.5 evenly"),
        ({"filter_step": 0.2}, "filter_step = 0.2: must divide interval = 0.5 evenly"),
        ({"filter_step": 0.5}, "filter_step = 0.5: must divide map_interval = 0.25 evenly"),
        ({"filter_step": 1e-12}, "filter_step = 1e-12: must be a finite number at least 0.0001"),
        ({"map_step": 0.02}, "map_step = 0.02: must divide map_interval = 0.25 evenly"),
        ({"map_step": 0.0}, "map_step = 0.0: must be a finite number at least 0.0001"),
        ({"interval": 0.7}, "interval = 0.7: must divide mission = 40 evenly"),
        ({"interval": 1e-9}, "interval = 1e-09: must be a finite number at least 0.001"),
        ({"interval": 1e9}, "interval = 1000000000.0: must be a finite number"),
        ({"mission": 0.5}, "mission = 0.5: must be a finite number at least 1"),
        ({"mission": 1e9}, "mission = 1000000000.0: must be a finite number .*at most 100000"),
        ({"mission": 9e3}, "torpedo_step = 0.01: must cut mission = 9000 into at most 100000"),
        ({"runs": 10**9}, "runs = 1000000000: must be at most .* mission, interval"),
        ({"runs": 10**400}, "runs = .*: must be"),
        ({"particles": 1}, "particles = 1: must be an integer of at least 2"),
        ({"particles": 10**9}, "particles = 1000000000: must be at most"),
        ({"particle_runs": 1}, "particle_runs = 1: must be an integer of at least 2"),
        ({"map_noise": []}, r"map_noise = \[\]: must be a list of 1 to 20 values"),
        ({"map_noise": [1.0] * 21}, "map_noise = .*: must be a list of 1 to 20 values"),
        ({"map_noise": [1.0, 2.0, 1.0]}, "map_noise = .*: must hold every value once"),
        ({"map_noise": [1e300]}, "map_noise = 1e.300: must be .*at most 1000"),
        ({"map_interval": [0.0]}, "map_interval = 0.0: must be a finite number at least 0.001"),
        ({"map_interval": [0.3, 0.5]}, "map_interval = 0.5: must be a multiple of .* 0.3"),
        ({"map_interval": [0.5, 0.3]}, "map_interval = 0.5: must be a multiple of .* 0.3"),
        ({"map_interval": [0.01]}, "filter_step = 0.05: must divide map_interval = 0.01 evenly"),
        ({"map_interval": [0.5, 0.5]}, "map_interval = .*: must hold every value once"),
        ({"map_interval": [0.05, 997.0]}, "map_interval = .*map_step"),
        ({"seed": 1.5}, "seed = 1.5: must be an integer of at least 0"),
        ({"strong_noise": float("nan")}, "strong_noise = nan: must be a finite number"),
    ],
)
def test_bad_parameter_is_one_line(change, message):
    with pytest.raises(ParameterError, match=message) as caught:
        Scenario(**change)
    assert "\n" not in str(caught.value)


def test_quick_keeps_a_tenth():
    quick = Scenario().quick()
    assert (quick.runs, quick.particle_runs) == (15, 2)


def test_fewer_runs_than_the_particle_filter_wants_are_all_it_gets():
    scenario = attrs.evolve(SMALL, runs=3, particle_runs=12)
    truth = run.simulate(scenario, "torpedo")
    assert len(run.cloud(scenario, truth, scenario.cases[1]).mean) == 3


def test_origins_are_told_of_every_number():
    names = {row[0] for row in (*body_origins(), *Scenario().origins())}
    assert set(Scenario.declared()) <= names
    assert {row[3] for row in body_origins() if "sphere mass" in row[0]} == {"recalled"}
