"""The batched Kalman filter against filterpy, least squares and the Riccati equation."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from steady import steady_covariance

from seanav.checks import ParameterError
from seanav.filters import kalman
from seanav.models import vehicles


def example(runs=4, steps=30, m=3, seed=0, *, correlated=True):
    """A steering problem whose initial errors, noises and model all fit the filter."""
    rng = np.random.default_rng(seed)
    Phi, B = vehicles.steering().discretise(0.1)
    n = 3
    root = np.eye(n) + (0.3 * rng.normal(size=(n, n)) if correlated else 0.0)
    Q, P0 = 1e-5 * root @ root.T, 1e-2 * root.T @ root
    H = np.eye(n)[:m] + (0.2 * rng.normal(size=(m, n)) if correlated else 0.0)
    R = 1e-4 * (np.eye(m) + (0.3 if correlated else 0.0))
    offsets = np.outer(0.2 * np.sin(0.3 * np.arange(steps)), B)
    noise = rng.normal(size=(runs, steps, n)) @ np.linalg.cholesky(Q).T
    start = rng.normal(size=(runs, n)) @ np.linalg.cholesky(P0).T
    truth = vehicles.simulate(Phi, offsets, noise, start)
    z = truth @ H.T + rng.normal(size=(runs, steps, m)) @ np.linalg.cholesky(R).T
    return (Phi, offsets, H, Q, R, np.zeros((runs, n)), P0, z), truth


@pytest.mark.parametrize("m", [1, 2, 3])
def test_equals_filterpy(m):
    (Phi, offsets, H, Q, R, x0, P0, z), _ = example(m=m)
    ours = kalman.run(Phi, offsets, H, Q, R, x0, P0, z)
    for run in range(len(z)):
        theirs = KalmanFilter(dim_x=3, dim_z=m)
        theirs.x, theirs.P = x0[run].copy(), P0.copy()
        theirs.F, theirs.H, theirs.Q, theirs.R = Phi, H, Q, R
        for k in range(z.shape[1]):
            theirs.predict(u=offsets[k], B=np.eye(3))
            theirs.update(z[run, k])
            np.testing.assert_allclose(ours.x[run, k], theirs.x, rtol=1e-9, atol=1e-13)
            np.testing.assert_allclose(ours.P[run, k], theirs.P, rtol=1e-9, atol=1e-16)
            np.testing.assert_allclose(ours.innovation[run, k], theirs.y, rtol=1e-9, atol=1e-13)
            nis = theirs.y @ np.linalg.solve(theirs.S, theirs.y)
            assert ours.nis[run, k] == pytest.approx(nis, rel=1e-9)


def test_equals_batch_least_squares_on_twenty_steps():
    # The whole history as one Gaussian vector: its last block is what a filter computes.
    (Phi, offsets, H, Q, R, x0, P0, z), _ = example(runs=2, steps=20, m=2)
    n, steps = 3, 20
    white = [np.linalg.inv(np.linalg.cholesky(c)) for c in (P0, Q, R)]
    rows, right = [], []
    size = n * (steps + 1)

    def add(block, blocks, value):
        row = np.zeros((len(block), size))
        for column, part in blocks:
            row[:, n * column : n * column + n] = block @ part
        rows.append(row)
        right.append(block @ value)

    add(white[0], [(0, np.eye(n))], x0[1])
    for k in range(steps):
        add(white[1], [(k + 1, np.eye(n)), (k, -Phi)], offsets[k])
        add(white[2], [(k + 1, H)], z[1, k])
    A = np.vstack(rows)
    solution = np.linalg.lstsq(A, np.concatenate(right))[0]
    P = np.linalg.inv(A.T @ A)
    track = kalman.run(Phi, offsets, H, Q, R, x0, P0, z)
    np.testing.assert_allclose(track.x[1, -1], solution[-n:], rtol=1e-8)
    np.testing.assert_allclose(track.P[1, -1], P[-n:, -n:], rtol=1e-7)


def test_covariance_settles_at_the_riccati_solution():
    problem, _ = example(steps=400, m=2)
    Phi, _, H, Q, R = problem[:5]
    before, after = steady_covariance(Phi, H, Q, R)
    track = kalman.run(*problem)
    np.testing.assert_allclose(track.P[0, -1], after, rtol=1e-8)
    np.testing.assert_allclose(Phi @ track.P[0, -2] @ Phi.T + Q, before, rtol=1e-8)


def test_healthy_statistic_is_chi_square():
    problem, _ = example(runs=400, steps=60)
    beta = kalman.run(*problem).nis
    assert stats.kstest(beta.ravel(), stats.chi2(3).cdf).pvalue > 1e-3
    assert beta.mean() == pytest.approx(3.0, abs=4 * np.sqrt(6 / beta.size))
    tail = stats.chi2.isf(0.05, 3)
    assert (beta > tail).mean() == pytest.approx(0.05, abs=4 * np.sqrt(0.0475 / beta.size))


def consistent(problem, truth):
    """Two-sided 99.9 % bounds on the mean NEES at one time, over independent runs."""
    track = kalman.run(*problem)
    last = kalman.nees(track.x - truth, track.P)[:, -1]
    low, high = stats.chi2.ppf([5e-4, 1 - 5e-4], 3 * len(last)) / len(last)
    return low < last.mean() < high


def test_nees_lies_within_two_sided_bounds_and_mistuned_filters_do_not():
    problem, truth = example(runs=400, steps=60)
    assert consistent(problem, truth)
    for factor in (0.25, 4.0):
        Phi, offsets, H, Q, R, *rest = problem
        assert not consistent((Phi, offsets, H, factor * Q, factor * R, *rest), truth)


def test_nees_is_the_quadratic_form():
    problem, truth = example(runs=3, steps=5)
    track = kalman.run(*problem)
    e = track.x - truth
    expected = np.einsum("rki,rkij,rkj->rk", e, np.linalg.inv(track.P), e)
    np.testing.assert_allclose(kalman.nees(e, track.P), expected, rtol=1e-9)
    for broken in (0.0, -1.0):
        P = np.array(track.P)
        P[1, 2] *= broken  # singular, or with negative variances
        found = kalman.nees(e, P)
        assert np.isnan(found[1, 2])
        assert np.isfinite(np.delete(found.ravel(), 1 * 5 + 2)).all()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 3))
def test_covariance_is_symmetric_positive_and_shrinks_at_a_measurement(seed, m):
    problem, _ = example(runs=2, steps=8, m=m, seed=seed)
    track = kalman.run(*problem)
    Phi, Q, P0 = problem[0], problem[3], problem[6]
    assert (track.P.transpose(0, 1, 3, 2) == track.P).all()
    before = P0
    for k in range(8):
        after = track.P[0, k]
        before = Phi @ before @ Phi.T + Q
        assert np.linalg.eigvalsh(after).min() > 0
        assert np.linalg.eigvalsh(before - after).min() > -1e-12 * np.trace(before)
        before = after


def test_the_order_of_independent_measurements_does_not_matter():
    (Phi, offsets, H, Q, R, x0, P0, z), _ = example()
    R = np.diag(np.diagonal(R))
    turned = [2, 0, 1]
    one = kalman.run(Phi, offsets, H, Q, R, x0, P0, z)
    other = kalman.run(Phi, offsets, H[turned], Q, R[turned][:, turned], x0, P0, z[..., turned])
    np.testing.assert_allclose(one.x, other.x, rtol=1e-9, atol=1e-13)


def test_runs_do_not_touch_each_other():
    problem, _ = example(runs=5)
    *rest, x0, P0, z = problem
    whole = kalman.run(*problem)
    alone = kalman.run(*rest, x0[3:4], P0, z[3:4])
    assert (whole.x[3] == alone.x[0]).all()


@pytest.mark.parametrize(
    ("index", "value", "line"),
    [
        (1, np.zeros((3, 3)), "offsets = (3, 3): must have the shape (30, 3)"),
        (2, np.zeros((2, 3)), "H = (2, 3): must have the shape (3, 3)"),
        (3, -np.eye(3), "must be symmetric and positive semidefinite"),
        (3, np.triu(np.ones((3, 3))), "must be symmetric and positive semidefinite"),
        (4, np.zeros((3, 3)), "must be symmetric and positive definite"),
        (7, np.full((4, 30, 3), np.nan), "z = nan: must be finite everywhere"),
        (7, np.zeros((4, 30)), "must have the shape (runs, steps, measurements)"),
    ],
)
def test_bad_input_is_one_clear_line(index, value, line):
    problem = list(example()[0])
    problem[index] = value
    with pytest.raises(ParameterError) as error:
        kalman.run(*problem)
    assert line in str(error.value)
