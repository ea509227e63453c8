"""The continuous–discrete filter and the study of paper 1, against independent references."""

from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib import pyplot as plt
from scipy import linalg, stats

from seanav import estimates
from seanav.checks import ParameterError
from seanav.filters import continuous_discrete, generated, moments
from seanav.models import bodies
from seanav.report import significant
from seanav.studies import ito_beyond as beyond
from seanav.studies import ito_figures as draw
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


def entries():
    """Return {function: its arguments by name} with which each entry of the module runs."""
    _, _, model, H, R, z = linear_setup(3, 4, 0)
    common = {"x0": np.ones(3), "P0": np.eye(3), "z": z, "interval": 0.4, "R": R, "H": H}
    propagate = generated.Propagator(moments.close(model, "gaussian"))
    predictor = generated.Predictor(moments.measurement(model, ["x", "z"]))
    cloud = {"simulate": generated.Simulator(model), "particles": 20, "step": 0.1}
    cloud["generators"] = [np.random.default_rng(k) for k in range(3)]
    now = {"mean": np.ones((3, 3)), "P": np.tile(np.eye(3), (3, 1, 1)), "z": z[:, 0]}
    return {
        "run": {"propagate": propagate, "step": 0.05} | common,
        "run expanded": {"propagate": propagate, "step": 0.05} | common | {"H": predictor},
        "particle_filter": cloud | common,
        "update": now | {"R": R, "H": H},
        "systematic": {"weights": np.array([0.5, 0.3, 0.2]), "offset": 0.5},
    }


def call(entry, **changes):
    """Call an entry with some arguments changed."""
    return getattr(continuous_discrete, entry.split()[0])(**(entries()[entry] | changes))


@pytest.mark.parametrize("entry", entries())
def test_entries_run_as_they_are(entry):
    call(entry)


FILTERS = ("run", "run expanded", "particle_filter")
LINEAR = ("run", "particle_filter", "update")
ALL = (*FILTERS, "update")
NOT_FINITE = np.array([[1.0, 0.0, 0.0], [0.0, np.nan, 0.0]])


@pytest.mark.parametrize(
    ("where", "change", "message"),
    [
        (LINEAR, {"H": np.array([1.0, 0.0, 0.0])}, r"H = \(3,\): must have the shape \(2, 3\)"),
        (LINEAR, {"H": np.eye(3)}, r"H = \(3, 3\): must have the shape \(2, 3\)"),
        (LINEAR, {"H": np.eye(2)}, r"H = \(2, 2\): must have the shape \(2, 3\)"),
        (LINEAR, {"H": NOT_FINITE}, "H = nan: must be finite"),
        (LINEAR, {"H": None}, "H = None"),
        (FILTERS, {"P0": np.eye(1)}, r"P0 = \(1, 1\): must have the shape \(3, 3\)"),
        (FILTERS, {"P0": np.diag([1.0, 1.0, -1.0])}, "P0 = .*must be symmetric and positive"),
        (FILTERS, {"P0": np.eye(3) + np.eye(3, k=1)}, "P0 = .*must be symmetric and positive"),
        (("particle_filter",), {"P0": np.zeros((3, 3))}, "P0 = .*symmetric and positive definite"),
        (FILTERS, {"x0": np.ones((3, 1))}, r"x0 = \(3, 1\): must have the shape \(states,\)"),
        (FILTERS, {"x0": np.ones(4)}, r"P0 = \(3, 3\): must have the shape \(4, 4\)"),
        (FILTERS, {"x0": np.array([1.0, np.inf, 0.0])}, "x0 = inf: must be finite"),
        (FILTERS, {"z": np.zeros((3, 4))}, r"z = \(3, 4\): must have the shape"),
        (FILTERS, {"z": np.full((3, 4, 2), np.nan)}, "z = nan: must be finite"),
        (FILTERS, {"z": np.zeros((3, 0, 2))}, r"z = \(3, 0, 2\): must have the shape"),
        (FILTERS, {"z": np.zeros((3, 4, 3))}, r"(R|H|predicted) = .*must have the shape"),
        (FILTERS, {"interval": -0.4}, "interval = -0.4: must be a finite number above 0"),
        (FILTERS, {"step": 0.0}, "step = 0.0: must be a finite number above 0"),
        (FILTERS, {"step": 0.15}, "step = 0.15: must divide interval = 0.4 evenly"),
        (FILTERS, {"step": 0.8}, "step = 0.8: must divide interval = 0.4 evenly"),
        (FILTERS, {"step": 1e-12}, "step = 1e-12: must cut interval = 0.4 into at most"),
        (ALL, {"R": np.eye(3)}, r"R = \(3, 3\): must have the shape \(2, 2\)"),
        (ALL, {"R": np.ones(2)}, r"R = \(2,\): must have the shape \(2, 2\)"),
        (
            ALL,
            {"R": np.array([[1.0, 2.0], [0.0, 1.0]])},
            "R = .*must be symmetric and positive def",
        ),
        (
            ALL,
            {"R": np.array([[1.0, 2.0], [2.0, 1.0]])},
            "R = .*must be symmetric and positive def",
        ),
        (ALL, {"R": np.zeros((2, 2))}, "R = .*must be symmetric and positive definite"),
        (("update",), {"mean": np.ones(3)}, r"mean = \(3,\): must have the shape"),
        (("update",), {"mean": np.ones((3, 3), int)}, "mean = .*int64.*changed in place"),
        (("update",), {"P": np.ones((3, 1, 1))}, r"P = \(3, 1, 1\): must have the shape"),
        (("update",), {"P": np.eye(3)[None].copy()}, r"P = \(1, 3, 3\): must have the shape"),
        (("update",), {"P": np.tile(np.eye(3, dtype=int), (3, 1, 1))}, "P = .*changed in place"),
        (("update",), {"P": np.triu(np.ones((3, 3, 3)))}, "P = .*must be symmetric"),
        (
            ("update",),
            {"P": np.tile(-9 * np.eye(3), (3, 1, 1))},
            "P = -9.0: must have no variance below zero",
        ),
        (("update",), {"z": np.zeros((4, 2))}, r"z = \(4, 2\): must have the shape \(3, "),
        (("update",), {"H": np.zeros((2, 2, 3))}, r"H = \(2, 2, 3\): must have the shape"),
        (
            ("update",),
            {"predicted": np.zeros((3, 1))},
            r"predicted = \(3, 1\): must have the shape",
        ),
        (("update",), {"spread": np.zeros((2, 2))}, r"spread = \(2, 2\): must have the shape"),
        (("particle_filter",), {"generators": []}, "generators = .*must be 3 random generators"),
        (("particle_filter",), {"particles": 1}, "particles = 1: must be an integer"),
        (("systematic",), {"weights": np.ones((2, 2))}, r"weights = \(2, 2\): must have the shape"),
        (("systematic",), {"weights": np.zeros(0)}, r"weights = \(0,\): must have the shape"),
        (("systematic",), {"weights": np.array([0.5, 0.2])}, "weights = 0.7: must .*sum to one"),
        (
            ("systematic",),
            {"weights": np.array([1.5, -0.5])},
            "weights = -0.5: must not be negative",
        ),
        (("systematic",), {"offset": 1.0}, "offset = 1.0: must be a finite number"),
    ],
)
def test_input_that_does_not_fit_is_refused(where, change, message):
    for entry in where:
        if "H" in change and entry == "run expanded":
            continue
        with pytest.raises(ParameterError, match=message) as caught:
            call(entry, **change)
        assert "\n" not in str(caught.value)


def test_refused_update_changes_nothing():
    given = entries()["update"]
    with pytest.raises(ParameterError):
        continuous_discrete.update(**given | {"z": np.zeros((3, 3))})
    assert (given["mean"] == 1.0).all()
    assert (given["P"] == np.eye(3)).all()


@pytest.mark.parametrize("entry", FILTERS)
def test_integers_and_lists_are_as_good_as_floats(entry):
    given = entries()[entry]
    whole = {"x0": [1, 1, 1], "P0": np.eye(3, dtype=int), "z": np.ones((3, 4, 2), int)}
    if entry != "run expanded":
        whole["H"] = given["H"].astype(int).tolist()
    ends = [call(entry, **whole), call(entry, z=np.ones((3, 4, 2)))]
    assert np.array_equal(ends[0].mean, ends[1].mean)
    assert np.array_equal(ends[0].P, ends[1].P)


def test_certain_start_is_allowed_where_no_cloud_is_drawn():
    track = call("run", P0=np.zeros((3, 3)))
    assert (track.P[:, 0] == 0).all()
    assert np.isfinite(track.mean).all()


def test_only_the_run_that_diverges_is_lost():
    # x' = x³ from 0.5 explodes after 2 s, from 0.1 after 50 s; the measurements hold one run.
    model = moments.system("x", ["x**3"], [0.01])
    propagate = generated.Propagator(moments.close(model, "ekf"))
    z = np.zeros((2, 40, 1))
    z[1] = 1e5
    track = continuous_discrete.run(
        propagate, [0.1], [[1e-4]], z, 0.1, 0.05, 1e-2 * np.eye(1), np.eye(1), limit=1e4
    )
    first = int(np.isnan(track.mean[1, :, 0]).argmax())
    assert 0 < first < 40
    for part in (track.mean, track.P, track.nis[:, 1:]):
        assert np.isfinite(part[0]).all()
    assert np.isnan(track.mean[1, first:]).all()
    assert np.isnan(track.P[1, first:]).all()
    assert np.abs(track.mean[1, :first]).max() < 1e4
    alone = continuous_discrete.run(
        propagate, [0.1], [[1e-4]], z[:1], 0.1, 0.05, 1e-2 * np.eye(1), np.eye(1), limit=1e4
    )
    assert np.array_equal(alone.mean[0], track.mean[0])


def test_particles_that_explode_carry_no_weight():
    # x' = 4 x³ − x: beyond 0.5 a particle runs away, the others stay and are enough.
    model = moments.system("x", ["4*x**3 - x"], [0.1])
    given = {"R": np.eye(1), "H": np.eye(1), "generators": [np.random.default_rng(1)]}
    move, z = generated.Simulator(model), np.zeros((1, 30, 1))
    cloud = continuous_discrete.particle_filter(
        move, [0.0], [[0.2]], z, 0.5, 0.05, particles=400, **given
    )
    assert np.isfinite(cloud.mean).all()
    assert np.abs(cloud.mean).max() < 0.6
    assert cloud.nis[0, -1] > 100
    gone = continuous_discrete.particle_filter(
        move, [5.0], [[0.01]], z, 0.5, 0.05, particles=400, **given
    )
    assert np.isnan(gone.mean[0, 1:]).all()


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


# ---------------------------------------------------------------- times and their labels


def truths_of_the_map(scenario, vehicle, monkeypatch):
    """Return {interval: truth} that `second_order_map` hands to its filters."""
    truths = {}

    def estimate(scenario, truth, case, closure="gaussian", corrected=True):
        truths[truth.times[1]] = truth
        P = np.broadcast_to(np.eye(6), (*truth.x.shape, 6))
        return continuous_discrete.Track(truth.x + 1.0, P, np.zeros(truth.x.shape[:2]))

    with monkeypatch.context() as patch:
        patch.setattr(study, "estimate", estimate)
        rows = beyond.second_order_map(scenario, vehicle)
    assert sorted({row[1] for row in rows}) == sorted(truths) == sorted(scenario.map_interval)
    return truths


@pytest.mark.parametrize("vehicle", study.VEHICLES)
def test_truth_of_the_map_has_the_moments_of_its_labelled_times(vehicle, monkeypatch):
    # A body of equal masses with linear drag alone: E|x|² of the scheme is known at each
    # step, and falls by 8 % every 0.01 s.
    rate, noise = 4.0, 0.05
    body = bodies.Body(vehicle, (1.0,) * 3, (1.0,) * 3, (rate,) * 6, (0.0,) * 6, (0.0,) * 6, ())
    monkeypatch.setitem(bodies.BODIES, vehicle, body)
    start = {f"{vehicle}_start": (0.0,) * 6, f"{vehicle}_noise": (noise,) * 6}
    scenario = study.Scenario(
        runs=4000, mission=4.0, map_noise=(1.0,), map_interval=(0.25, 0.5), **start
    )
    variance = np.sum(scenario.prior(vehicle)[1])
    for interval, truth in truths_of_the_map(scenario, vehicle, monkeypatch).items():
        for k in (0, 1):
            steps = round(k * interval / 0.01)
            shrink = (1 - 0.01 * rate) ** (2 * steps)
            added = 6 * noise**2 * 0.01 * (1 - shrink) / (1 - (1 - 0.01 * rate) ** 2)
            # 4.5 standard errors of a sum of 24 000 squares.
            wanted = pytest.approx(shrink * variance + added, rel=4.5 * np.sqrt(2 / 24_000))
            assert np.square(truth.x[:, k]).sum(axis=1).mean() == wanted


@pytest.mark.parametrize("vehicle", study.VEHICLES)
def test_truth_is_kept_at_the_times_that_label_it(vehicle, monkeypatch):
    scenario = replace(SMALL, map_interval=(0.25, 0.5, 1.0))
    noise, step = scenario.noise(vehicle), scenario.map_step
    fine = study.simulate(scenario, vehicle, noise, keep=step, mission=2.0, step="map_step")
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
        study.simulate(SMALL, "sphere", **change)


def test_half_a_mission_holds_every_interval_of_the_map_whole():
    for mission, intervals, wanted in (
        (40.0, (0.25, 0.5, 1.0, 2.0), 20.0),
        (50.0, (0.25, 0.5, 1.0, 2.0), 26.0),
        (1.0, (0.5, 1.0, 1.5), 3.0),
        (4.0, (2.0,), 4.0),
    ):
        scenario = study.Scenario(mission=mission, map_interval=intervals)
        assert scenario.map_mission == pytest.approx(wanted)


# ---------------------------------------------------------------- divergence


def test_truth_that_explodes_is_told_in_one_line():
    scenario = replace(SMALL, torpedo_noise=(30.0,) * 6)
    told = "torpedo_step = 0.01: is too long for .*torpedo_noise times strong_noise.* diverges"
    with pytest.raises(ParameterError, match=told) as caught:
        study.simulate(scenario, "torpedo")
    assert "\n" not in str(caught.value)
    with pytest.raises(ParameterError, match=r"map_step = 0\.01: is too long"):
        beyond.second_order_map(replace(scenario, map_noise=(1.0,)), "torpedo")


def test_filters_that_diverge_are_shown_as_diverged():
    # Strong noise on a long step of the filters: all of the torpedo's explode.
    scenario = replace(SMALL, strong_noise=30.0, filter_step=0.25)
    truth = study.simulate(scenario, "torpedo", scenario.noise("torpedo", 30.0))
    result = study.run_case(scenario, truth, scenario.cases[0])
    lost = [name for name, one in result.scores.items() if not np.isfinite(one.squared).all()]
    assert lost
    assert 0 < result.scores[lost[0]].lost <= 4
    assert result.scores[lost[0]].rmse(0) is None
    assert study.shown(result.scores[lost[0]].rmse(0)) == "diverged"
    assert study.entry(result.scores[lost[0]].rmse(0)) == "diverged"
    assert result.over_open_loop(0, lost[0]) is None
    condition = study.condition("torpedo, u", None, high=0.5)
    assert condition.outcome == "fails"
    assert str(condition) == "torpedo, u: filters that diverged: 1.00, claimed at most 0, fails"


def test_what_is_finite_is_shown_and_judged_as_it_is():
    estimate = estimates.mean(np.array([0.2, 0.3]))
    assert study.shown(estimate) == significant(estimate)
    assert study.entry(estimate) == pytest.approx(0.25)
    assert (study.shown(0.25), study.entry(0.25)) == ("0.250", 0.25)
    assert study.shown(np.nan) == study.entry(np.float64("nan")) == "diverged"
    condition = study.condition("torpedo, u", estimate, high=5)
    assert (condition.estimate, condition.low, condition.high) == (estimate, -np.inf, 5)
    assert study.condition("far", 0.25, low=0.1).estimate == estimates.exact(0.25)
    assert study.condition("far", np.nan, low=0.1).outcome == "fails"
    # An EKF that diverges beside a closure that does not is no fault of the closure.
    assert study.condition("gain", None, high=1, lost=0).outcome == "holds"
    assert study.condition("gain", None, high=1, lost=3).outcome == "fails"


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "change",
    [
        {},
        {"strong_noise": 30.0, "filter_step": 0.25, "map_noise": (30.0,)},
        {"interval": 20.0, "mission": 40.0},
        {"mission": 1.0, "map_interval": (1.0,)},
    ],
)
def test_figures_draw_what_there_is(change):
    scenario = replace(SMALL, **change)
    results = study.run_all(scenario, scenario.strong_noise)
    maps = {v: beyond.second_order_map(scenario, v) for v in study.VEHICLES}
    factors = [0.5, 1.0, scenario.strong_noise]
    sds = beyond.sensitivity(scenario, "torpedo", [1e-4, 1e4], factors)
    figures = [
        draw.overview(results["torpedo", 1]),
        draw.component(results["torpedo", 2], 3),
        draw.nees(results, study.nees_band(scenario.runs)),
        draw.second_order_map(maps),
        draw.sensitivity([1e-4, 1e4], factors, sds),
    ]
    for fig in figures:
        fig.canvas.draw()
        plt.close(fig)


def test_lines_of_the_map_that_fall_are_counted():
    values = {(1.0, 0.5): 0.9, (1.0, 1.0): 0.8, (2.0, 0.5): 0.95, (2.0, 1.0): 0.7}
    rows = [(f, t, estimates.exact(value)) for (f, t), value in reversed(values.items())]
    assert beyond.falling(rows, 1) == (2, 2)
    assert beyond.falling(rows, 0) == (1, 2)
    assert beyond.falling([*rows, (4.0, 1.0, None), (4.0, 0.5, None)], 1) == (2, 3)
    assert beyond.falling([*rows, (4.0, 1.0, None), (4.0, 0.5, None)], 0) == (0, 2)


def test_map_is_drawn_in_the_order_it_is_given():
    rows = [
        (factor, interval, estimates.exact(factor + interval / 10))
        for factor in (2.0, 1.0)
        for interval in (3.0, 2.0)
    ]
    fig = draw.second_order_map({"torpedo": rows, "sphere": rows})
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
        ({"small_R": 0.0}, "small_R = 0.0: must be a finite number at least 1e-12"),
        ({"large_R": -1.0}, "large_R = -1.0: must be a finite number at least 1e-12"),
        ({"large_R": 1e300}, "large_R = 1e.300: must be a finite number .*at most 1e.12"),
        ({"map_R": 1e-300}, "map_R = 1e-300: must be a finite number at least 1e-12"),
        ({"torpedo_start": [1.0]}, r"torpedo_start = \[1.0\]: must be 6 numbers"),
        ({"torpedo_start": [1e9] * 6}, "torpedo_start = 1000000000.0: must be .*at most 1000"),
        ({"sphere_noise": [0.1] * 5 + [0.0]}, "sphere_noise = 0.0: must be a finite number at l"),
        ({"sphere_noise": [1e300] * 6}, "sphere_noise = 1e.300: must be .*at most 1000"),
        ({"sphere_variance": "abc"}, "sphere_variance = 'abc': must be 6 numbers"),
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
        ({"runs": 10}, "particle_runs = 12: must be .* at most runs = 10"),
        ({"particles": 1}, "particles = 1: must be an integer of at least 2"),
        ({"particles": 10**9}, "particles = 1000000000: must be at most"),
        ({"particle_runs": 151}, "particle_runs = 151: must be .*at most runs = 150"),
        ({"map_noise": []}, r"map_noise = \[\]: must be 1 to 20 numbers"),
        ({"map_noise": [1.0] * 21}, "map_noise = .*: must be 1 to 20 numbers"),
        ({"map_noise": [1.0, 2.0, 1.0]}, "map_noise = .*: must hold every number once"),
        ({"map_noise": [1e300]}, "map_noise = 1e.300: must be .*at most 1000"),
        ({"map_interval": [0.0]}, "map_interval = 0.0: must be a finite number at least 0.001"),
        ({"map_interval": [0.3, 0.5]}, "map_interval = 0.5: must be a multiple of .* 0.3"),
        ({"map_interval": [0.5, 0.3]}, "map_interval = 0.5: must be a multiple of .* 0.3"),
        ({"map_interval": [0.01]}, "filter_step = 0.05: must divide map_interval = 0.01 evenly"),
        ({"map_interval": [0.5, 0.5]}, "map_interval = .*: must hold every number once"),
        ({"map_interval": [0.05, 997.0]}, "map_interval = .*map_step"),
        ({"seed": 1.5}, "seed = 1.5: must be an integer of at least 0"),
        ({"strong_noise": float("nan")}, "strong_noise = nan: must be a finite number"),
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
