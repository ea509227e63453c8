"""Filters between discrete measurements, against independent references."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import linalg

from seanav.checks import ParameterError
from seanav.filters import moments
from seanav.filters.moments import continuous_discrete, generated, particles


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
    cloud = particles.particle_filter(
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
    cloud = particles.particle_filter(
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
    chosen = particles.systematic(weights, 0.5)
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
    name = entry.split()[0]
    home = continuous_discrete if hasattr(continuous_discrete, name) else particles
    return getattr(home, name)(**(entries()[entry] | changes))


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
    cloud = particles.particle_filter(move, [0.0], [[0.2]], z, 0.5, 0.05, particles=400, **given)
    assert np.isfinite(cloud.mean).all()
    assert np.abs(cloud.mean).max() < 0.6
    assert cloud.nis[0, -1] > 100
    gone = particles.particle_filter(move, [5.0], [[0.01]], z, 0.5, 0.05, particles=400, **given)
    assert np.isnan(gone.mean[0, 1:]).all()
