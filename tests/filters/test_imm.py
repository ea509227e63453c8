"""Fading, IMM algebra and linear covariance: closed forms, brute force, filterpy."""

import math

import numpy as np
import pytest
from filterpy.kalman import IMMEstimator, KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from seanav.checks import ParameterError
from seanav.filters import fading, imm, linear_covariance


def test_interaction_by_hand():
    T = [[0.9, 0.1], [0.3, 0.7]]
    predicted, weights = imm.interact(T, [[0.6], [0.4]])
    assert predicted[:, 0] == pytest.approx([0.66, 0.34])
    # weights[j, i]: where model j comes from
    assert weights[0, :, 0] == pytest.approx([0.54 / 0.66, 0.12 / 0.66])
    assert weights[1, :, 0] == pytest.approx([0.06 / 0.34, 0.28 / 0.34])


def test_a_model_that_cannot_be_entered_keeps_its_own_estimate():
    predicted, weights = imm.interact([[1.0, 0.0], [1.0, 0.0]], [[0.6], [0.4]])
    assert predicted[:, 0].tolist() == [1.0, 0.0]
    assert weights[:, :, 0].tolist() == [[0.6, 0.4], [0.0, 1.0]]


@settings(deadline=None)  # the first example waits for the compiler
@given(
    st.integers(2, 4).flatmap(
        lambda n: st.tuples(
            st.lists(st.lists(st.floats(0.01, 1), min_size=n, max_size=n), min_size=n, max_size=n),
            st.lists(st.floats(0.01, 1), min_size=n, max_size=n),
            st.lists(st.floats(-1e6, 1e3), min_size=n, max_size=n),
        )
    )
)
def test_probabilities_stay_probabilities(case):
    T, mu, logs = (np.array(part) for part in case)
    T, mu = T / T.sum(axis=1, keepdims=True), mu / mu.sum()
    predicted, weights = imm.interact(T, mu[:, None])
    assert predicted.sum() == pytest.approx(1)
    assert weights.sum(axis=1) == pytest.approx(1)
    after = imm.probabilities(predicted, logs[:, None])
    assert np.isfinite(after).all()
    assert after.sum() == pytest.approx(1)


def test_an_outlier_does_not_reset_the_modes():
    predicted = np.array([[0.5], [0.5]])
    S = (1.0, 1.5)
    logs = np.array([[imm.log_likelihood(1e8, variance)] for variance in S])
    assert (np.exp(logs) == 0).all()  # where plain likelihoods are all zero
    mu = imm.probabilities(predicted, logs)
    assert mu[:, 0] == pytest.approx([0, 1])


def test_an_infinite_residual_under_every_model_says_nothing_of_the_modes():
    predicted = np.array([[0.3, 0.3, 0.3], [0.7, 0.7, 0.7]])
    logs = np.array([[-np.inf, -1.0, -np.inf], [-np.inf, -1.0, -1.0]])
    mu = imm.probabilities(predicted, logs)
    assert mu[:, 0].tolist() == [0.3, 0.7]
    assert mu[:, 1] == pytest.approx([0.3, 0.7])
    assert mu[:, 2].tolist() == [0.0, 1.0]


@pytest.mark.parametrize("logs", [[[np.nan], [-1.0]], [[-np.inf], [np.nan]], [[np.inf], [0.0]]])
def test_a_log_likelihood_that_is_no_number_is_refused_and_stays_in_its_run(logs):
    predicted = np.array([[0.3], [0.7]])
    with pytest.raises(ParameterError, match=r"^logs = (nan|inf): must be finite"):
        imm.probabilities(predicted, logs)
    # Within a mission the run is lost and says so; the others go on.
    both, mu = np.hstack([logs, [[0.0], [0.0]]]), np.empty((2, 2))
    imm._probabilities(np.hstack([predicted] * 2), both, mu)
    assert np.isnan(mu[:, 0]).any()
    assert mu[:, 1] == pytest.approx([0.3, 0.7])


@pytest.mark.parametrize(
    ("T", "mu", "line"),
    [
        ([[0.9, 0.2], [0.1, 0.8]], [[0.5], [0.5]], "sum of T = 1.1: must be 1 in every row"),
        ([[0.9, 0.1], [0.1, 0.9]], [[0.5], [0.6]], "sum of mu = 1.1: must be 1"),
        ([[1.1, -0.1], [0.1, 0.9]], [[0.5], [0.5]], "T = -0.1: must be at least 0 everywhere"),
        ([[0.9, 0.1], [0.1, 0.9]], [[1.0]], "mu = (1, 1): must have the shape (2, 1)"),
    ],
)
def test_what_is_no_chain_is_one_clear_line(T, mu, line):
    with pytest.raises(ParameterError) as caught:
        imm.interact(T, mu)
    assert line in str(caught.value)


def test_log_likelihood_is_the_gaussian_density():
    assert imm.log_likelihood(0.49, 2.0) == pytest.approx(
        math.log(math.exp(-0.49 / 4) / math.sqrt(4 * math.pi))
    )


def test_mixture_has_the_moments_of_the_mixture():
    random = np.random.default_rng(0)
    models, size, runs = 3, 4, 2
    weights = random.random((models, runs))
    weights /= weights.sum(axis=0)
    d = random.standard_normal((models, size, runs))
    A = random.standard_normal((models, runs, size, size))
    full = A @ A.transpose(0, 1, 3, 2)
    i, j = np.triu_indices(size)
    P = np.ascontiguousarray(full[:, :, i, j].transpose(0, 2, 1))
    mean, packed = np.empty((size, runs)), np.empty((len(i), runs))
    imm._mix(weights, d, P, mean, packed, np.empty((size, runs)))
    for r in range(runs):
        m = np.einsum("m,mk->k", weights[:, r], d[:, :, r])
        second = sum(
            weights[k, r] * (full[k, r] + np.outer(d[k, :, r], d[k, :, r])) for k in range(models)
        )
        assert mean[:, r] == pytest.approx(m)
        assert packed[:, r] == pytest.approx((second - np.outer(m, m))[i, j])


def _linear_imm(z, F, Q, H, R, T, mu0, x0, P0):
    """A plain IMM of linear filters made of this package's kernels."""
    models, n = len(Q), len(x0)
    x = np.repeat(np.array(x0)[None, :, None], models, axis=0)
    P = np.repeat(np.array(P0)[None], models, axis=0)
    i, j = np.triu_indices(n)
    mu = np.array(mu0)[:, None]
    means, probabilities = [], []
    for measured in z:
        predicted, weights = imm.interact(T, mu)
        packed = np.ascontiguousarray(P[:, i, j][:, :, None])
        mixed = []
        for m in range(models):
            mean, covariance = np.empty((n, 1)), np.empty((len(i), 1))
            imm._mix(weights[m], x, packed, mean, covariance, np.empty((n, 1)))
            full = np.zeros((n, n))
            full[i, j] = full[j, i] = covariance[:, 0]
            mixed.append((mean[:, 0], full))
        logs = np.empty((models, 1))
        for m, (mean, covariance) in enumerate(mixed):
            prior, C = F @ mean, F @ covariance @ F.T + Q[m]
            S = H @ C @ H + R
            rho = measured - H @ prior
            logs[m] = imm.log_likelihood(rho**2, S)
            K = C @ H / S
            x[m, :, 0], P[m] = prior + K * rho, C - np.outer(K, K) * S
        mu = imm.probabilities(predicted, logs)
        means.append(np.einsum("mr,mkr->k", mu, x))
        probabilities.append(mu[:, 0].copy())
    return np.array(means), np.array(probabilities)


def test_imm_posterior_matches_filterpy():
    random = np.random.default_rng(5)
    F, H, R = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([1.0, 0.0]), 1.0
    Q = [np.diag([0.01, 0.01]), np.diag([0.3, 0.2])]
    T, mu0, P0 = np.array([[0.9, 0.1], [0.2, 0.8]]), [0.7, 0.3], np.diag([2.0, 1.0])
    z = np.cumsum(random.standard_normal(40)) + random.standard_normal(40)
    filters = []
    for q in Q:
        one = KalmanFilter(dim_x=2, dim_z=1)
        one.x, one.P, one.F, one.H = np.zeros((2, 1)), P0.copy(), F, H[None]
        one.R, one.Q = np.array([[R]]), q
        filters.append(one)
    theirs = IMMEstimator(filters, np.array(mu0), T)
    means, probabilities = _linear_imm(z, F, Q, H, R, T, mu0, np.zeros(2), P0)
    for k, measured in enumerate(z):
        theirs.predict()
        theirs.update(np.array([[measured]]))
        assert probabilities[k] == pytest.approx(theirs.mu, rel=1e-9)
        assert means[k] == pytest.approx(theirs.x.ravel(), rel=1e-9, abs=1e-9)


def test_window_and_factor():
    window, total = np.zeros((3, 2)), np.empty(2)
    residuals = np.array([[1.0, 2.0], [3.0, 1.0], [2.0, 2.0], [5.0, 0.5]])
    for step, residual in enumerate(residuals):
        fading._remember(window, step, residual**2, total)
        expected = (residuals[max(0, step - 2) : step + 1] ** 2).sum(axis=0)
        assert total == pytest.approx(expected)
    assert fading._factor(9.0, 1, 1.0, 100.0) == 1.0  # one residual says nothing
    assert fading._factor(9.0, 4, 1.0, 100.0) == pytest.approx(3.0)  # over n − 1
    assert fading._factor(9.0, 4, 100.0, 100.0) == 1.0
    assert fading._factor(9.0, 4, 1e-9, 100.0) == 100.0


def test_mean_log_factor_of_a_matched_filter():
    # E ln max(1, chi²_20 / 19) for 20 independent residuals: the drift behind the divergence
    # of equation (17) read literally.
    from scipy import integrate, stats

    expected, _ = integrate.quad(
        lambda x: math.log(x / 19) * stats.chi2(20).pdf(x), 19, 200, epsabs=1e-10
    )
    draws = np.random.default_rng(1).chisquare(20, 200000)
    ours = np.mean([math.log(fading._factor(value, 20, 1.0, 10.0)) for value in draws])
    assert ours == pytest.approx(expected, abs=2e-3)
    assert expected == pytest.approx(0.13, abs=0.02)


def _small_system():
    random = np.random.default_rng(7)
    steps, n = 60, 3
    Phi = np.eye(n) + 0.05 * random.standard_normal((steps, n, n))
    return Phi, random.standard_normal((steps, n)), np.array([0.02, 0.05, 0.01]), np.eye(n)


def test_design_matches_filterpy():
    Phi, H, Q, P0 = _small_system()
    gains, covariances = linear_covariance.design(Phi, Q, H, 0.3, P0)
    theirs = KalmanFilter(dim_x=3, dim_z=1)
    theirs.P, theirs.Q, theirs.R = P0.copy(), np.diag(Q), np.array([[0.3]])
    for k in range(len(Phi)):
        theirs.predict(F=Phi[k])
        theirs.update(np.zeros((1, 1)), H=H[k][None])
        assert covariances[k + 1] == pytest.approx(theirs.P, rel=1e-9, abs=1e-12)
        assert gains[k] == pytest.approx(theirs.K.ravel(), rel=1e-9, abs=1e-12)


def test_matched_filter_achieves_its_own_covariance():
    Phi, H, Q, P0 = _small_system()
    gains, covariances = linear_covariance.design(Phi, Q, H, 0.3, P0)
    achieved = linear_covariance.achieve(Phi, Q, H, 0.3, P0, gains)
    assert achieved == pytest.approx(covariances, rel=1e-9, abs=1e-12)


def test_mismatched_filter_achieves_what_simulation_shows():
    Phi, H, Q, P0 = _small_system()
    gains, covariances = linear_covariance.design(Phi, 0.2 * Q, H, 0.3, P0)
    achieved = linear_covariance.achieve(Phi, Q, H, 0.3, P0, gains)
    random, runs = np.random.default_rng(3), 40000
    e = random.standard_normal((3, runs))
    for k in range(len(Phi)):
        e = Phi[k] @ e + np.sqrt(Q)[:, None] * random.standard_normal((3, runs))
        rho = H[k] @ e + math.sqrt(0.3) * random.standard_normal(runs)
        e = e - np.outer(gains[k], rho)
    sample = e @ e.T / runs
    spread = np.sqrt(np.outer(np.diag(achieved[-1]), np.diag(achieved[-1])) * 2 / runs)
    assert (np.abs(sample - achieved[-1]) < 4 * spread).all()
    # The filter's own figure is far off, so the test can tell the two apart.
    assert np.abs(np.diag(sample - covariances[-1]) / np.diag(spread)).max() > 20
