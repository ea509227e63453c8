"""The continuous–discrete filter and the study of paper 1, against independent references."""

from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import linalg, stats

from seanav.checks import ParameterError
from seanav.filters import continuous_discrete, generated, moments
from seanav.models import bodies
from seanav.studies import ito_beyond as beyond
from seanav.studies import ito_filter as study

SMALL = study.Scenario(
    runs=4, particle_runs=2, mission=4.0, particles=50, map_noise=(1.0,), map_interval=(0.5, 1.0)
)


def random_covariance(rng, n):
    root = rng.normal(size=(n, n))
    return root @ root.T + 0.1 * np.eye(n)


# ---------------------------------------------------------------- update


@given(seed=st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_update_agrees_with_filterpy_and_shrinks_the_covariance(seed):
    rng = np.random.default_rng(seed)
    P, R, H = random_covariance(rng, 4), random_covariance(rng, 2), rng.normal(size=(2, 4))
    x, z = rng.normal(size=4), rng.normal(size=2)
    reference = KalmanFilter(dim_x=4, dim_z=2)
    reference.x, reference.P, reference.H, reference.R = x[:, None], P.copy(), H, R
    reference.update(z[:, None])
    mean, after = np.array([x]), np.array([P])
    nis = continuous_discrete.update(mean, after, z[None], R, H)
    np.testing.assert_allclose(mean[0], reference.x[:, 0], rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(after[0], reference.P, rtol=1e-8, atol=1e-10)
    y = z - H @ x
    assert nis[0] == pytest.approx(y @ np.linalg.solve(H @ P @ H.T + R, y), rel=1e-9)
    assert np.array_equal(after[0], after[0].T)
    assert np.linalg.eigvalsh(after[0]).min() > 0
    assert np.linalg.eigvalsh(P - after[0]).min() > -1e-10


def test_update_stays_positive_with_a_nearly_perfect_sensor():
    mean, P = np.zeros((1, 2)), np.array([[[1e8, 1e8 - 1], [1e8 - 1, 1e8]]])
    for _ in range(20):
        continuous_discrete.update(mean, P, np.ones((1, 1)), np.eye(1) * 1e-8, np.eye(1, 2))
    assert np.linalg.eigvalsh(P[0]).min() > 0


def test_order_of_independent_measurements_does_not_matter():
    rng = np.random.default_rng(2)
    P, H, z = random_covariance(rng, 3), rng.normal(size=(2, 3)), rng.normal(size=(1, 2))
    ends = []
    for order in ([0, 1], [1, 0]):
        mean, C = np.zeros((1, 3)), P[None].copy()
        for a in order:
            continuous_discrete.update(mean, C, z[:, [a]], np.eye(1) * (a + 1), H[[a]])
        ends.append((mean, C))
    both = np.zeros((1, 3)), P[None].copy()
    continuous_discrete.update(*both, z, np.diag([1.0, 2.0]), H)
    for one in ends:
        np.testing.assert_allclose(one[0], both[0], rtol=1e-10)
        np.testing.assert_allclose(one[1], both[1], rtol=1e-10)


# ---------------------------------------------------------------- filter loop


def linear_setup(runs, count, seed):
    rng = np.random.default_rng(seed)
    A = np.array([[-0.3, 1.0, 0.0], [-1.0, -0.2, 0.4], [0.0, 0.1, -0.5]])
    G = np.array([[0.3, 0.0], [0.1, 0.4], [0.0, 0.5]])
    model = moments.system("x y z", [f"{a[0]}*x + {a[1]}*y + {a[2]}*z" for a in A], G.tolist())
    H, R = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.diag([0.2, 0.3])
    return A, G, model, H, R, rng.normal(size=(runs, count, 2))


@pytest.mark.parametrize("closure", moments.CLOSURES)
def test_linear_filter_is_the_kalman_filter(closure):
    A, G, model, H, R, z = linear_setup(3, 12, 0)
    n, dt = 3, 0.4
    block = linalg.expm(np.block([[-A, G @ G.T], [np.zeros((n, n)), A.T]]) * dt)
    Phi = block[n:, n:].T
    Q = Phi @ block[:n, n:]
    propagate = generated.Propagator(moments.close(model, closure))
    track = continuous_discrete.run(propagate, np.ones(3), np.eye(3), z, dt, 0.002, R, H)
    for run in range(3):
        x, P = np.ones(3), np.eye(3)
        for k in range(12):
            x, P = Phi @ x, Phi @ P @ Phi.T + Q
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
            x, P = x + K @ (z[run, k] - H @ x), P - K @ H @ P
            np.testing.assert_allclose(track.mean[run, k + 1], x, rtol=1e-9, atol=1e-11)
            np.testing.assert_allclose(track.P[run, k + 1], P, rtol=1e-9, atol=1e-11)


def test_nonlinear_update_of_a_linear_measurement_is_the_linear_one():
    _, _, model, H, R, z = linear_setup(2, 5, 1)
    propagate = generated.Propagator(moments.close(model, "gaussian"))
    predictor = generated.Predictor(moments.measurement(model, ["x", "z"]))
    tracks = [
        continuous_discrete.run(propagate, np.ones(3), np.eye(3), z, 0.4, 0.05, R, how)
        for how in (H, predictor)
    ]
    np.testing.assert_allclose(tracks[0].mean, tracks[1].mean, rtol=1e-12)
    np.testing.assert_allclose(tracks[0].P, tracks[1].P, rtol=1e-12)


def test_nonlinear_update_is_the_best_linear_one_of_gaussian_moments():
    # For quadratic h the second-order expansion is exact, so the update is the linear
    # estimator with the Gaussian moments of x and h, here by Gauss–Hermite nodes.
    model = moments.system("x y", ["-x", "-y"], [1, 1])
    predictor = generated.Predictor(moments.measurement(model, ["x*y", "x**2 + y"]))
    rng = np.random.default_rng(9)
    m0, P0, R = np.array([0.7, -0.4]), random_covariance(rng, 2), np.diag([0.1, 0.2])
    z, shrink = np.array([[[0.5, 1.0]]]), np.exp(-0.2)
    propagate = generated.Propagator(moments.close(model, "gaussian"))
    track = continuous_discrete.run(propagate, m0, P0, z, 0.2, 0.005, R, predictor)
    m, P = shrink * m0, shrink**2 * P0 + (1 - shrink**2) / 2 * np.eye(2)
    nodes, weights = np.polynomial.hermite_e.hermegauss(5)
    weight = np.outer(weights, weights).ravel() / weights.sum() ** 2
    x = m[:, None] + np.linalg.cholesky(P) @ np.array([np.repeat(nodes, 5), np.tile(nodes, 5)])
    h = np.array([x[0] * x[1], x[0] ** 2 + x[1]])
    off = h - (h @ weight)[:, None]
    S, cross = (off * weight) @ off.T + R, ((x - m[:, None]) * weight) @ off.T
    K = np.linalg.solve(S, cross.T).T
    np.testing.assert_allclose(track.mean[0, 1], m + K @ (z[0, 0] - h @ weight), rtol=1e-8)
    np.testing.assert_allclose(track.P[0, 1], P - K @ S @ K.T, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("R", [0.1, 1.0, 10.0])
def test_effective_sample_size_of_a_gaussian_is_known(R):
    # w = exp(-x²/2R), x ~ N(0, 1): (E w)²/E w² = √(R (2 + R))/(1 + R).
    model = moments.system("x", ["-x"], [1])
    cloud = continuous_discrete.particle_filter(
        generated.Simulator(model), np.zeros(1), np.eye(1), np.zeros((1, 1, 1)), 1e-6, 1e-6,
        R * np.eye(1), np.eye(1), [np.random.default_rng(1)], 40_000,
    )  # fmt: skip
    assert cloud.nis[0, 1] / 40_000 == pytest.approx(np.sqrt(R * (2 + R)) / (1 + R), rel=0.03)


def test_particle_filter_agrees_with_the_kalman_filter():
    _, _, model, H, R, z = linear_setup(1, 6, 3)
    count = 20_000
    noise = np.random.default_rng(6).standard_normal((1, 600, 2))
    truth = generated.Simulator(model)(np.ones((1, 3)), noise, 0.004, None, (), 100)
    z = truth[:, 1:] @ H.T + z @ np.sqrt(R)
    exact = continuous_discrete.run(
        generated.Propagator(moments.close(model, "ekf")), np.ones(3), np.eye(3), z, 0.4, 0.01, R, H
    )
    cloud = continuous_discrete.particle_filter(
        generated.Simulator(model), np.ones(3), np.eye(3), z, 0.4, 0.01, R, H,
        [np.random.default_rng(4)], count,
    )  # fmt: skip
    sd = np.sqrt(np.diagonal(exact.P[0], axis1=1, axis2=2))
    # Weights thin the sample: about 6 standard errors of the smallest effective size.
    tolerance = 6 / np.sqrt(np.nanmin(cloud.nis)) + 0.02
    assert (np.abs(cloud.mean - exact.mean)[0] / sd).max() < tolerance
    variances = np.diagonal(cloud.P[0], axis1=1, axis2=2) / sd**2
    np.testing.assert_allclose(variances, 1.0, atol=2 * tolerance)
    assert np.nanmin(cloud.nis) > 500


def test_systematic_resampling_copies_in_proportion():
    weights = np.array([0.5, 0.0, 0.3, 0.2])
    chosen = continuous_discrete.systematic(weights, 0.5)
    counts = np.bincount(chosen, minlength=4)
    assert (np.abs(counts - 4 * weights) < 1).all()
    assert counts[1] == 0


def test_noise_that_is_no_covariance_is_refused():
    for R in ([[1.0, 2.0], [0.0, 1.0]], [[1.0, 2.0], [2.0, 1.0]], [[0.0]], [1.0]):
        with pytest.raises(ParameterError, match=r"R = .*must be (a symmetric|positive)"):
            continuous_discrete.checked_noise(R)


# ---------------------------------------------------------------- the stochastic equation


@pytest.mark.parametrize("vehicle", study.VEHICLES)
def test_short_horizon_monte_carlo_has_the_predicted_mean_and_variance(vehicle):
    # From a Gaussian start the closure's first derivatives are exact: the horizon is short.
    steps = {"torpedo_step": 0.005, "sphere_step": 0.005, "filter_step": 0.005}
    scenario = replace(study.Scenario(), runs=40_000, interval=0.05, mission=0.1, seed=5, **steps)
    truth = study.simulate(scenario, vehicle)
    one = replace(scenario, runs=2, particle_runs=2)
    free = study.estimate(one, study.simulate(one, vehicle), scenario.cases[0], corrected=False)
    x, mean, P = truth.x[:, 1], free.mean[0, 1], free.P[0, 1]
    se = x.std(axis=0) / np.sqrt(len(x))
    # 4.2 standard errors: one false alarm in 3000 for the twelve comparisons.
    assert (np.abs(x.mean(axis=0) - mean) < 4.2 * se).all()
    assert (np.abs(x.var(axis=0) / np.diag(P) - 1) < 4.2 * np.sqrt(2 / len(x))).all()
    start = scenario.prior(vehicle)[1]
    assert np.abs(np.diag(P) / np.diag(start) - 1).max() > 0.1, "the horizon must show a change"


def test_state_dependent_noise_follows_the_lognormal_law():
    model = moments.system("x", ["a*x"], ["b*x"], parameters="a b")
    rng = np.random.default_rng(7)
    noise = rng.standard_normal((4000, 500, 1))
    end = generated.Simulator(model)(np.ones((4000, 1)), noise, 0.002, None, [0.2, 0.4], 500)
    law = stats.lognorm(0.4, scale=np.exp(0.2 - 0.08))
    assert stats.kstest(end[:, -1, 0], law.cdf).pvalue > 1e-3


def test_consistency_bound_holds_and_a_mistuned_filter_breaks_it():
    # Sphere, nearly linear: mean NEES of independent runs at one time is chi-square.
    scenario = replace(study.Scenario(), runs=200, mission=4.0, seed=11)
    truth = study.simulate(scenario, "sphere")
    case = scenario.cases[0]
    low, high = stats.chi2.ppf([1e-4, 1 - 1e-4], 6 * 200) / 200
    right = study.score(truth, study.estimate(scenario, truth, case))
    assert low < right.nees_by_time[3] < high
    bold = replace(truth, parameters=bodies.SPHERE.parameters(0.6 * scenario.noise("sphere")))
    wrong = study.score(truth, study.estimate(scenario, bold, case))
    assert wrong.nees_by_time[3] > high
    shy = replace(truth, parameters=bodies.SPHERE.parameters(1.8 * scenario.noise("sphere")))
    assert study.score(truth, study.estimate(scenario, shy, case)).nees_by_time[3] < low


def test_nees_band_holds_the_mean_of_gaussian_errors_in_95_percent():
    draws = np.random.default_rng(4).standard_normal((4000, 30, 6))
    low, high = study.nees_band(30)
    means = (draws**2).sum(axis=2).mean(axis=1)
    assert np.mean(means < low) == pytest.approx(0.025, abs=0.01)
    assert np.mean(means > high) == pytest.approx(0.025, abs=0.01)


def test_large_noise_is_the_open_loop():
    truth = study.simulate(SMALL, "torpedo")
    near, far = (study.open_loop_limit(SMALL, truth, SMALL.cases[1], R) for R in (1e6, 1e8))
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
    x = generated.Simulator(beyond.planar())(start, noise, 0.005, None, [d, k, g], 600)[:, -1]
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


def test_fokker_planck_of_a_linear_equation_is_van_loans_gaussian():
    A, spread = np.array([[-0.5, 0.4], [-0.3, -0.8]]), np.array([0.2, 0.3])
    mean, P, end = np.array([0.3, -0.2]), np.diag([0.1, 0.15]), 1.0

    def drift(x, y):
        return A[0, 0] * x + A[0, 1] * y, A[1, 0] * x + A[1, 1] * y

    block = linalg.expm(np.block([[-A, np.diag(spread)], [np.zeros((2, 2)), A.T]]) * end)
    Phi = block[2:, 2:].T
    exact = Phi @ P @ Phi.T + Phi @ block[:2, 2:]
    covariances, skews = [], []
    for nodes in (71, 141):
        density = beyond.fokker_planck(drift, spread, mean, P, end, (3.0, 3.5), nodes, 200)
        m, C, third = density.moments()
        np.testing.assert_allclose(m, Phi @ mean, atol=1e-4)
        assert density.p.sum() == pytest.approx(1.0, rel=1e-10)
        covariances.append(C)
        skews.append(third)
    coarse, fine = covariances
    # Second order: half the spacing, a quarter of the error; Richardson takes it out.
    np.testing.assert_allclose(np.diag(coarse - exact) / np.diag(fine - exact), 4.0, rtol=0.1)
    np.testing.assert_allclose((4 * fine - coarse) / 3, exact, atol=1e-5)
    np.testing.assert_allclose((4 * skews[1] - skews[0]) / 3, 0, atol=1e-5)


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


# ---------------------------------------------------------------- study


def test_sphere_hides_its_linear_velocity_from_angular_rates():
    ranks = {row[:2]: row[-1] for row in beyond.observability_rows(4)}
    assert ranks == {
        ("torpedo", "linear"): 6,
        ("torpedo", "angular"): 6,
        ("sphere", "linear"): 6,
        ("sphere", "angular"): 3,
    }


def test_cases_measure_what_the_paper_says():
    one, two, three = study.Scenario().cases
    for case, H in ((one, np.eye(3, 6)), (two, np.eye(3, 6)), (three, np.eye(3, 6, 3))):
        assert np.array_equal(case.H, H)
    assert one.R < two.R == three.R
    truth = study.simulate(SMALL, "torpedo")
    z = study.measure(SMALL, truth, replace(three, R=1e-12))
    np.testing.assert_allclose(z, truth.x[:, 1:, 3:], atol=1e-5)
    strong = study.Scenario().noise("sphere", 3.0) / study.Scenario().noise("sphere")
    np.testing.assert_allclose(strong, [1, 1, 1, 3, 3, 3])


def test_scores_are_what_they_say():
    truth = study.simulate(SMALL, "sphere")
    runs, samples = truth.x.shape[:2]
    error = np.arange(1.0, 7.0)
    P = np.broadcast_to(np.diag(error**2), (runs, samples, 6, 6))
    track = continuous_discrete.Track(truth.x + error, P, np.zeros((runs, samples)))
    score = study.score(truth, track)
    np.testing.assert_allclose(score.squared, np.tile(error**2, (runs, 1)))
    np.testing.assert_allclose(score.nees, 6.0)
    assert score.rmse(2).value == pytest.approx(3.0)
    assert score.own_sd_ratio(4).value == pytest.approx(1.0)
    twice = study.score(truth, replace(track, mean=truth.x + 2 * error))
    ratio = study.root_ratio(twice.squared[:, 0], score.squared[:, 0])
    assert ratio.value == pytest.approx(2.0)
    np.testing.assert_allclose(study.total(twice, score), 4.0)


def test_interval_of_a_ratio_agrees_with_the_jackknife():
    rng = np.random.default_rng(12)
    a = rng.gamma(2.0, size=200)
    b = a + rng.gamma(1.0, size=200)
    left_out = [np.sqrt(np.delete(a, r).mean() / np.delete(b, r).mean()) for r in range(200)]
    jackknife = np.sqrt(199 * np.var(left_out))
    assert study.root_ratio(a, b).se == pytest.approx(jackknife, rel=0.02)


def test_threads_and_number_of_runs_change_nothing(monkeypatch):
    ends = []
    for threads, runs in (("1", 4), ("2", 4), ("2", 3)):
        monkeypatch.setenv("SEANAV_THREADS", threads)
        scenario = replace(SMALL, runs=runs)
        truth = study.simulate(scenario, "torpedo")
        ends.append(study.estimate(scenario, truth, scenario.cases[2]).mean)
    assert np.array_equal(ends[0], ends[1])
    assert np.array_equal(ends[0][:3], ends[2])


def test_cases_share_truth_and_measurement_noise():
    truth = study.simulate(SMALL, "torpedo")
    small, large = (study.measure(SMALL, truth, case) for case in SMALL.cases[:2])
    noise = (small - truth.x[:, 1:, :3]) / 1e-2
    np.testing.assert_allclose(noise, large - truth.x[:, 1:, :3], atol=1e-10)


def test_small_study_runs_through_everything():
    results = study.run_all(SMALL)
    assert set(results) == {(v, k) for v in study.VEHICLES for k in (1, 2, 3)}
    result = results["torpedo", 1]
    assert result.over_open_loop(0).value < 0.5
    cloud = study.particles(SMALL, result.truth, result.case)
    assert cloud.mean.shape == (2, 9, 6)
    assert [row[:2] for row in beyond.second_order_map(SMALL, "sphere")] == [(1.0, 0.5), (1.0, 1.0)]
    sds = beyond.sensitivity(SMALL, "sphere", [1e-4, 1e4], [1.0, 2.0])
    assert (sds[:, 0] <= sds[:, 1]).all()
    assert (sds[0] < sds[1]).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"runs": -1}, "runs = -1: must be an integer of at least 2"),
        ({"small_R": 0.0}, "small_R = 0.0: must be a finite number above 0"),
        ({"large_R": -1.0}, "large_R = -1.0: must be a finite number above 0"),
        ({"torpedo_start": [1.0]}, r"torpedo_start = \[1.0\]: must be 6 numbers"),
        (
            {"sphere_noise": [0.1] * 5 + [0.0]},
            "sphere_noise = 0.0: must be a finite number above 0",
        ),
        ({"sphere_variance": "abc"}, "sphere_variance = 'abc': must be 6 numbers"),
        ({"torpedo_step": 0.03}, "torpedo_step = 0.03: must divide interval = 0.5 evenly"),
        ({"filter_step": 0.7}, "filter_step = 0.7: must be a finite number .*at most 0.5"),
        ({"interval": 0.7}, "torpedo_step|interval"),
        ({"mission": 0.5}, "mission = 0.5: must be a finite number at least 1"),
        ({"particles": 1}, "particles = 1: must be an integer of at least 2"),
        ({"particle_runs": 151}, "particle_runs = 151: must be an integer .*at most 150"),
        ({"map_noise": []}, r"map_noise = \[\]: must be one or more numbers"),
        ({"map_interval": [0.0]}, "map_interval = 0.0: must be a finite number above 0"),
        ({"seed": 1.5}, "seed = 1.5: must be an integer of at least 0"),
        ({"strong_noise": float("nan")}, "strong_noise = nan: must be a finite number above 0"),
    ],
)
def test_bad_parameter_is_one_line(change, message):
    with pytest.raises(ParameterError, match=message) as caught:
        study.Scenario(**change)
    assert "\n" not in str(caught.value)


def test_quick_keeps_a_tenth():
    quick = study.Scenario().quick()
    assert (quick.runs, quick.particle_runs) == (15, 2)


def test_every_parameter_has_an_origin():
    names = {row[0] for row in study.origins(study.Scenario())}
    assert set(study.Scenario.__dataclass_fields__) <= names
    assert {row[3] for row in study.origins(study.Scenario()) if "sphere mass" in row[0]} == {
        "recalled"
    }
