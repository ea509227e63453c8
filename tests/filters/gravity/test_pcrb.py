import itertools

import filterpy.kalman
import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from seanav.checks import ParameterError
from seanav.filters.gravity import pcrb

NOISE = 0.7
P0 = np.array([[4.0, 1.5], [1.5, 2.0]])
Q = np.array([[0.3, -0.1], [-0.1, 0.2]])


def slopes(steps, seed=0):
    return np.random.default_rng(seed).normal(size=(steps, 2))


def below(one, other, start=0.0):
    """P1 ⪯ P2 up to the rounding of both, computed from covariances of trace `start`."""
    return np.linalg.eigvalsh(other - one).min() >= -1e-12 * max(np.trace(other), start)


def test_bound_is_last_block_of_inverse_of_whole_trajectory_information():
    H, steps = slopes(6), 6
    J = np.zeros((steps, 2, steps, 2))
    J[0, :, 0] += np.linalg.inv(P0)
    for t in range(1, steps):
        J[t, :, t] += np.outer(H[t], H[t]) / NOISE**2
        for a, b, sign in ((t, t, 1), (t - 1, t - 1, 1), (t, t - 1, -1), (t - 1, t, -1)):
            J[a, :, b] += sign * np.linalg.inv(Q)
    joint = np.linalg.inv(J.reshape(2 * steps, 2 * steps))
    np.testing.assert_allclose(pcrb.pcrb(H, NOISE, P0, Q)[-1], joint[-2:, -2:], rtol=1e-12)


def test_first_sample_is_the_prior_and_its_slope_does_not_matter():
    H = slopes(4)
    bound = pcrb.pcrb(H, NOISE, P0, Q)
    np.testing.assert_array_equal(bound[0], P0)
    H[0] = 100.0
    np.testing.assert_array_equal(pcrb.pcrb(H, NOISE, P0, Q), bound)


def test_equation_17_is_equation_20_21_by_woodbury():
    h, inv = slopes(2)[1], np.linalg.inv
    information = np.outer(h, h) / NOISE**2
    first = inv(information + inv(Q) - inv(Q) @ inv(inv(P0) + inv(Q)) @ inv(Q))
    second = inv(information + inv(Q + P0))
    recursion = pcrb.pcrb(np.stack([h, h]), NOISE, P0, Q)[1]
    np.testing.assert_allclose(first, recursion, rtol=1e-12)
    np.testing.assert_allclose(second, recursion, rtol=1e-12)


def test_bound_on_a_plane_is_the_covariance_of_an_independent_kalman_filter():
    h = np.array([0.4, -1.1])
    reference = filterpy.kalman.KalmanFilter(dim_x=2, dim_z=1)
    reference.P, reference.Q, reference.R = P0.copy(), Q, np.array([[NOISE**2]])
    reference.F, reference.H = np.eye(2), h[None]
    for bound in pcrb.pcrb(np.tile(h, (20, 1)), NOISE, P0, Q)[1:]:
        reference.predict()
        reference.update(np.zeros(1))
        np.testing.assert_allclose(bound, reference.P, rtol=1e-10)


def test_without_process_noise_information_adds_in_any_order():
    H = slopes(8)
    total = np.linalg.inv(P0) + H[1:].T @ H[1:] / NOISE**2
    for order in (H, np.concatenate([H[:1], H[:0:-1]])):
        last = pcrb.pcrb(order, NOISE, P0, np.zeros((2, 2)))[-1]
        np.testing.assert_allclose(last, np.linalg.inv(total), rtol=1e-12)


def test_process_noise_may_change_along_the_path():
    H = slopes(5)
    Qs = Q * np.arange(1.0, 6.0)[:, None, None]
    P = P0
    for bound, h, q in zip(pcrb.pcrb(H, NOISE, P0, Qs)[1:], H[1:], Qs[1:], strict=True):
        P = np.linalg.inv(np.linalg.inv(P + q) + np.outer(h, h) / NOISE**2)
        np.testing.assert_allclose(bound, P, rtol=1e-12)


def test_many_paths_at_once_are_the_paths_one_by_one():
    H = np.stack([slopes(5, seed) for seed in range(3)])
    together = pcrb.pcrb(H, NOISE, P0, Q)
    for path, bound in zip(H, together, strict=True):
        np.testing.assert_array_equal(pcrb.pcrb(path, NOISE, P0, Q), bound)


def test_units_of_the_map_do_not_matter():
    H = slopes(6)
    scaled = pcrb.pcrb(1e-8 * H, 1e-8 * NOISE, P0, Q)
    np.testing.assert_allclose(scaled, pcrb.pcrb(H, NOISE, P0, Q), rtol=1e-12)


def test_turning_the_axes_turns_the_bound():
    H, c, s = slopes(6), np.cos(0.5), np.sin(0.5)
    U = np.array([[c, -s], [s, c]])
    turned_P0, turned_Q = ((M + M.T) / 2 for M in (U @ P0 @ U.T, U @ Q @ U.T))
    turned = pcrb.pcrb(H @ U.T, NOISE, turned_P0, turned_Q)
    np.testing.assert_allclose(turned, U @ pcrb.pcrb(H, NOISE, P0, Q) @ U.T, rtol=1e-11)


finite = st.floats(-1e3, 1e3)
positive = st.floats(1e-3, 1e3)
correlation = st.floats(-0.99, 0.99)


@st.composite
def covariances(draw):
    a, b, r = draw(positive), draw(positive), draw(correlation)
    return np.array([[a * a, r * a * b], [r * a * b, b * b]])


def bounds_of(H, *cases):
    """Bounds of (noise, P0, Q) each; an example that is refused is one that rounding decides."""
    try:
        return [pcrb.pcrb(H, *case) for case in cases]
    except ParameterError:
        largest = max(np.trace(P + len(H) * q) / noise**2 for noise, P, q in cases)
        assert largest * (H**2).sum(axis=1).max() > 1e14
        reject()


paths = st.lists(st.tuples(finite, finite), min_size=2, max_size=8).map(np.array)


@given(paths, positive, covariances(), covariances())
def test_bound_stays_a_covariance_and_no_measurement_hurts(H, noise, prior, q):
    (bound,) = bounds_of(H, (noise, prior, q))
    np.testing.assert_array_equal(bound, bound.swapaxes(1, 2))
    for before, after in itertools.pairwise(bound):
        assert after[0, 0] > 0
        assert after[1, 1] > 0
        assert below(np.zeros((2, 2)), after)
        assert below(after, before + q)


@given(paths, positive, st.floats(1, 10), covariances(), covariances())
def test_bound_grows_with_measurement_noise_process_noise_and_prior(H, noise, more, prior, q):
    cases = (noise, prior, q), (noise * more, prior, q), (noise, prior, q * more)
    bound, *worse = bounds_of(H, *cases, (noise, prior * more, q))
    start = more * np.trace(prior + len(H) * q)  # the updates subtract from this
    assert all(below(bound[t], other[t], start) for other in worse for t in range(len(H)))


def test_expected_bound_uses_the_mean_information():
    draws = np.stack([slopes(5, seed) for seed in range(4)])
    P = P0
    for t, bound in enumerate(pcrb.expected_pcrb(draws, NOISE, P0, Q)):
        if t > 0:
            J = np.mean([np.outer(h, h) for h in draws[:, t]], axis=0) / NOISE**2
            P = np.linalg.inv(np.linalg.inv(P + Q) + J)
        np.testing.assert_allclose(bound, P, rtol=1e-12)


@pytest.mark.parametrize("axis", [0, 1, None])
def test_expected_bound_of_one_certain_path_is_the_bound(axis):
    H = slopes(6)
    if axis is not None:
        H[:, axis] = 0.0  # the factors of the information must survive a zero
    one = pcrb.expected_pcrb(H[None], NOISE, P0, Q)
    np.testing.assert_allclose(one, pcrb.pcrb(H, NOISE, P0, Q), rtol=1e-12)


def test_information_map_is_the_root_trace_of_equation_19():
    gradient = np.random.default_rng(3).normal(size=(2, 3, 4))
    M = pcrb.information(gradient, NOISE)
    for i, j in np.ndindex(3, 4):
        H = gradient[:, i, j][None]
        expected = np.sqrt(np.trace(H.T @ np.linalg.inv([[NOISE**2]]) @ H))
        assert M[i, j] == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("noise", [0.0, -1.0, np.nan])
def test_noise_must_be_positive(noise):
    for call in (
        lambda: pcrb.pcrb(slopes(3), noise, P0, Q),
        lambda: pcrb.expected_pcrb(slopes(3)[None], noise, P0, Q),
        lambda: pcrb.information(np.ones((2, 2, 2)), noise),
    ):
        with pytest.raises(
            ParameterError, match=r"^noise = .*: must be a finite number above 1e-100 and"
        ):
            call()


@pytest.mark.parametrize(
    "prior", [np.zeros((2, 2)), [[1, 2], [2, 1]], [[1, 0.5], [0, 1]], -np.eye(2)]
)
def test_prior_must_be_a_covariance(prior):
    with pytest.raises(ParameterError, match=r"^P0 = .* must be symmetric and positive definite$"):
        pcrb.pcrb(slopes(3), NOISE, prior, Q)


BAD = {
    "gradients": [
        slopes(3)[:, :1],
        slopes(3)[0],
        slopes(0),
        slopes(3) * np.nan,
        slopes(3) * 1j,
        [[0, 1], [1]],
        "slopes",
    ],
    "P0": [np.eye(3), "unit", P0 * np.inf, [[1, 2], [3]]],
    "Q": [
        np.tile(Q, (2, 1, 1)),
        np.tile(Q, (3, 1, 1)) * np.nan,
        np.stack([Q, Q, -Q]),
        -Q,
        np.eye(3),
        0.1,
        [[1, 2], [3]],
    ],
    "noise": [1e-170, 1e170, np.inf, "1"],
}


@pytest.mark.parametrize(("name", "value"), [(n, v) for n, values in BAD.items() for v in values])
@pytest.mark.parametrize("function", [pcrb.pcrb, pcrb.expected_pcrb])
def test_what_is_no_input_is_named_in_one_line(function, name, value):
    given = {"gradients": slopes(3), "noise": NOISE, "P0": P0, "Q": Q} | {name: value}
    if function is pcrb.expected_pcrb:
        given["gradients"] = [given["gradients"]]
    with pytest.raises(ParameterError, match=rf"^{name} = .*: must ") as caught:
        function(**given)
    assert "\n" not in str(caught.value)


def test_a_bound_that_rounding_decides_is_refused():
    # Two readings that tell next to everything: what is left of P0 is a matter of rounding.
    for noise, prior in ((1e-30, P0), (NOISE, 1e200 * P0), (NOISE, 1e-200 * P0)):
        for call in (
            lambda n, P: pcrb.pcrb(slopes(9), n, P, 0 * Q),
            lambda n, P: pcrb.expected_pcrb(slopes(9)[None], n, P, 0 * Q),
        ):
            with pytest.raises(ParameterError, match=r"^noise, P0, Q = .*: must leave the bound"):
                call(noise, prior)


def test_type_and_layout_of_the_slopes_do_not_matter():
    H = np.round(4 * slopes(6))
    for other in (H.astype(int), H.astype(np.float32), np.asfortranarray(H), H.tolist()):
        np.testing.assert_array_equal(pcrb.pcrb(other, NOISE, P0, Q), pcrb.pcrb(H, NOISE, P0, Q))


@pytest.mark.parametrize("map_", [np.ones((2, 3)), np.ones((3, 2, 2)), np.full((2, 3, 3), np.nan)])
def test_information_map_needs_two_slopes_at_each_node(map_):
    with pytest.raises(ParameterError, match=r"^gradient = .*: must "):
        pcrb.information(map_, NOISE)
