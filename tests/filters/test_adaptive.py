"""The fading factors of paper 3 against the identities they are built to fulfil."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from test_kalman import example

from seanav.checks import ParameterError
from seanav.filters import adaptive, kalman

OPTIONS = [
    {"method": method, "window": window, "trigger": trigger}
    for method in ("single", "multiple")
    for window in (1, 7)
    for trigger in ("chi2", "trace")
]


def faulty(**options):
    """A problem in which the input stops working half way, unknown to the filter."""
    problem, truth = example(**options)
    *rest, z = problem
    z = z.copy()
    z[:, z.shape[1] // 2 :] += 0.1
    return (*rest, z), truth


def plain(problem, run, *, method, window=1, trigger="chi2", alpha=0.05):
    """The equations of the paper one by one, for one run."""
    Phi, offsets, H, Q, R, x0, P0, z = problem
    x, P, innovations = x0[run], P0, []
    xs, Ps, before, after, factors = [], [], [], [], []
    for k in range(z.shape[1]):
        x = Phi @ x + offsets[k]  # (18)
        base = Phi @ P @ Phi.T
        d = z[run, k] - H @ x  # (23)
        innovations.append(d)
        S = H @ (base + Q) @ H.T + R
        before.append(d @ np.linalg.inv(S) @ d)  # (39)
        fault = before[-1] > stats.chi2.isf(alpha, len(d))  # (41)
        if trigger == "trace":
            fault = d @ d > np.trace(S)  # (24)
        factor = np.ones(len(x))
        if fault:
            latest = innovations[-window:]
            C = sum(np.outer(e, e) for e in latest) / len(latest)
            excess = C - H @ base @ H.T - R
            if method == "single":
                factor[:] = np.trace(excess) / np.trace(H @ Q @ H.T)  # (26)
            else:
                factor = np.diag(np.linalg.pinv(H) @ excess @ np.linalg.inv(H @ Q @ H.T) @ H)
            factor = np.maximum(1, factor)  # (31)
        root = np.diag(np.sqrt(factor))
        P = base + root @ Q @ root  # (27), (32)
        S = H @ P @ H.T + R
        after.append(d @ np.linalg.inv(S) @ d)
        K = P @ H.T @ np.linalg.inv(S)  # (19)
        x = x + K @ d  # (17)
        P = P - K @ S @ K.T  # (20)
        for values, value in zip((xs, Ps, factors), (x, P, factor), strict=True):
            values.append(value)
    return tuple(map(np.array, (xs, Ps, before, after, factors)))


@pytest.mark.parametrize("m", [2, 3])
@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_equals_the_equations_written_one_by_one(options, m):
    problem, _ = faulty(m=m)
    track = adaptive.run(*problem, **options)
    assert (track.factors > 1).any()
    for run in range(2):
        x, P, before, after, factors = plain(problem, run, **options)
        np.testing.assert_allclose(track.x[run], x, rtol=1e-8, atol=1e-12)
        np.testing.assert_allclose(track.P[run], P, rtol=1e-7, atol=1e-14)
        np.testing.assert_allclose(track.before[run], before, rtol=1e-8)
        np.testing.assert_allclose(track.nis[run], after, rtol=1e-8)
        np.testing.assert_allclose(track.factors[run], factors, rtol=1e-7)


@pytest.mark.parametrize("method", ["single", "multiple"])
def test_factors_of_one_are_the_optimal_filter_bit_for_bit(method):
    problem, _ = faulty(correlated=False)
    optimal = kalman.run(*problem)
    adapted = adaptive.run(*problem, method=method, alpha=1e-300)
    assert (adapted.factors == 1).all()
    assert (adapted.x == optimal.x).all()
    assert (adapted.P == optimal.P).all()
    assert (adapted.nis == optimal.nis).all()


def covariances_after(problem, track):
    """S with the factors of each step, from the covariances that the filter reports."""
    Phi, _, H, Q, R, _, P0, _ = problem
    previous = np.concatenate([np.broadcast_to(P0, (len(track.x), 1, 3, 3)), track.P[:, :-1]], 1)
    root = np.sqrt(track.factors)
    base = Phi @ previous @ Phi.T
    plain = H @ (base + Q) @ H.T + R
    return H @ (base + root[..., None] * Q * root[..., None, :]) @ H.T + R, plain


def test_single_factor_makes_the_trace_equal_the_squared_innovation():
    problem, _ = faulty()
    track = adaptive.run(*problem, method="single")
    adapted = track.factors[..., 0] > 1
    S, _ = covariances_after(problem, track)
    squares = (track.innovation**2).sum(axis=2)
    assert 20 < adapted.sum() < adapted.size
    trace = np.trace(S, axis1=2, axis2=3)
    np.testing.assert_allclose(trace[adapted], squares[adapted], rtol=1e-9)


def test_multiple_factors_lift_each_diagonal_to_its_squared_innovation():
    problem, _ = faulty(correlated=False)
    track = adaptive.run(*problem, method="multiple")
    adapted = (track.factors > 1).any(axis=2)
    S, plain_S = covariances_after(problem, track)
    diagonal, floor = (np.diagonal(s, axis1=2, axis2=3) for s in (S, plain_S))
    expected = np.where(adapted[..., None], np.maximum(floor, track.innovation**2), floor)
    assert 20 < adapted.sum() < adapted.size
    np.testing.assert_allclose(diagonal, expected, rtol=1e-9)


@pytest.mark.parametrize("trigger", ["chi2", "trace"])
def test_nothing_is_adapted_where_the_trigger_is_silent(trigger):
    problem, _ = faulty()
    track = adaptive.run(*problem, method="multiple", trigger=trigger)
    _, S = covariances_after(problem, track)
    quiet = track.before <= stats.chi2.isf(0.05, 3)
    if trigger == "trace":
        quiet = (track.innovation**2).sum(axis=2) < np.trace(S, axis1=2, axis2=3)
    assert 0 < quiet.sum() < quiet.size
    assert (track.factors[quiet] == 1).all()


def test_the_single_factor_without_its_floor_breaks_down():
    problem, _ = faulty(runs=20, steps=300)
    floored = adaptive.run(*problem, method="single", trigger="trace")
    assert (floored.factors >= 1).all()
    assert np.isfinite(floored.x).all()
    # Under the trace rule (26) exceeds 1 by construction; under χ² nothing keeps it there.
    without = adaptive.run(*problem, method="single", window=20, floor=-np.inf)
    lost = ~np.isfinite(without.x).all(axis=(1, 2))
    negative = (without.factors < 0).any(axis=(1, 2))
    assert negative.any()
    assert lost.any() or (np.diagonal(without.P, axis1=2, axis2=3) < 0).any()


def scaled(problem, units):
    """The same problem with every state measured in other units."""
    Phi, offsets, H, Q, R, x0, P0, z = problem
    T = np.diag(units)
    both = [T @ matrix @ T for matrix in (Q, R, P0)]
    Phi = T @ Phi @ np.linalg.inv(T)
    return Phi, offsets * units, H, both[0], both[1], x0 * units, both[2], z * units


@settings(max_examples=20, deadline=None)
@given(st.lists(st.floats(-3, 3), min_size=3, max_size=3), st.sampled_from([1, 7]))
def test_units_do_not_matter_to_multiple_factors(exponents, window):
    problem, _ = faulty(correlated=False)
    units = 10.0 ** np.array(exponents)
    one = adaptive.run(*problem, method="multiple", window=window)
    other = adaptive.run(*scaled(problem, units), method="multiple", window=window)
    np.testing.assert_allclose(other.x, one.x * units, rtol=1e-7, atol=1e-9 * units.max())


def test_units_do_matter_to_the_single_factor():
    problem, _ = faulty(correlated=False)
    units = np.array([1.0, 1.0, 180 / np.pi])
    one = adaptive.run(*problem, method="single")
    other = adaptive.run(*scaled(problem, units), method="single")
    assert np.abs(other.x / units - one.x).max() > 1e-3


def test_an_unmeasured_state_keeps_its_factor_of_one():
    (Phi, offsets, _, Q, R, x0, P0, z), _ = faulty(correlated=False)
    H = np.eye(3)[:2]
    track = adaptive.run(
        Phi, offsets, H, Q, R[:2, :2], x0, P0, z[..., :2], method="multiple", window=5
    )
    assert (track.factors[..., :2] > 1).any()
    assert (track.factors[..., 2] == 1).all()


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from(OPTIONS), st.integers(1, 3))
def test_covariance_stays_symmetric_and_positive(seed, options, m):
    problem, _ = faulty(runs=2, seed=seed, m=m)
    track = adaptive.run(*problem, **options)
    assert (track.P.transpose(0, 1, 3, 2) == track.P).all()
    assert np.linalg.eigvalsh(track.P).min() > 0
    assert (track.nis <= track.before * (1 + 1e-9)).all()


def test_false_alarms_come_at_the_rate_alpha_when_nothing_has_been_adapted_yet():
    problem, _ = example(runs=4000, steps=1)
    for alpha in (0.01, 0.05, 0.3):
        before = adaptive.run(*problem, method="multiple", alpha=alpha).before
        rate = (before > adaptive.threshold(alpha, 3)).mean()
        assert rate == pytest.approx(alpha, abs=4 * np.sqrt(alpha / 4000))


def test_threshold_is_the_tabulated_one():
    assert adaptive.threshold(0.05, 3) == pytest.approx(7.8147, abs=1e-4)
    assert adaptive.threshold(0.01, 4) == pytest.approx(13.2767, abs=1e-4)


def test_only_the_window_counts():
    # Innovations older than the window must not matter: change them through z and x0 of
    # a system without memory, in which each estimate is the newest measurement.
    n, steps = 2, 6
    rng = np.random.default_rng(3)
    z = rng.normal(size=(2, steps, n)) * 5
    z[1, steps - 3 :] = z[0, steps - 3 :]
    args = (np.zeros((n, n)), np.zeros((steps, n)), np.eye(n), np.eye(n), np.eye(n))
    rest = (np.zeros((2, n)), np.eye(n), z)
    short = adaptive.run(*args, *rest, method="multiple", window=3, alpha=0.99).factors[:, -1]
    longer = adaptive.run(*args, *rest, method="multiple", window=4, alpha=0.99).factors[:, -1]
    assert (short > 1).any()
    assert (short[0] == short[1]).all()
    assert (longer[0] != longer[1]).any()


@pytest.mark.parametrize(
    ("index", "value", "options", "line"),
    [
        (2, np.ones((3, 3)), {}, "must have full row rank"),
        (2, np.ones((3, 3)), {"method": "single"}, "must have full row rank"),
        (3, np.diag([1.0, 1.0, 0.0]), {}, "Q = [[1.0, 0.0, 0.0], [0.0, 1.0"),
        (3, np.outer([1, 2, 3], [1, 2, 3]), {}, "must not make H Q Hᵀ singular"),
        (3, np.zeros((3, 3)), {"method": "single"}, "must give H Q Hᵀ a positive"),
        (2, np.eye(3), {"window": 0}, "window = 0: must be an integer of at least 1"),
        (2, np.eye(3), {"alpha": 0.0}, "alpha = 0.0: must be a finite number above 0 and below 1"),
        (2, np.eye(3), {"alpha": 1}, "alpha = 1: must be a finite number above 0 and below 1"),
        (2, np.eye(3), {"trigger": "sum"}, "trigger = 'sum': must be one of 'chi2', 'trace'"),
        (2, np.eye(3), {"method": "triple"}, "method = 'triple': must be one of"),
    ],
)
def test_bad_input_is_one_clear_line(index, value, options, line):
    problem = list(example(correlated=False)[0])
    problem[index] = value
    with pytest.raises(ParameterError) as error:
        adaptive.run(*problem, **({"method": "multiple"} | options))
    assert line in str(error.value)
    assert "\n" not in str(error.value)
