"""The response of a filter's error to a disturbance that is given, against closed forms."""

import numpy as np
import pytest

from seanav.checks import ParameterError
from seanav.filters import linear_covariance


def test_a_constant_disturbance_is_taken_for_the_state():
    # One state, gain K: d(k+1) = (1 - K) d(k) - K s, so d(k) = -s (1 - (1 - K)^k).
    steps, K, s = 40, 0.2, np.array([0.5, -1.0, 0.0])
    one = np.ones((steps, 1))
    found = linear_covariance.respond(one[:, :, None], one, K * one, s * one, 1)
    powers = (1 - K) ** np.arange(1, steps + 1)
    assert np.allclose(found[:, 0], -(1 - powers)[:, None] * s, atol=1e-12)


def test_it_is_the_recursion_written_with_matrices():
    rng = np.random.default_rng(1)
    steps, n, runs = 12, 4, 3
    Phi = np.eye(n) + 0.1 * rng.standard_normal((steps, n, n))
    H, K = rng.standard_normal((2, steps, n))
    seen = rng.standard_normal((steps, runs))
    d, expected = np.zeros((n, runs)), []
    for k in range(steps):
        d = Phi[k] @ d
        d = d - np.outer(K[k], H[k] @ d + seen[k])
        expected.append(d[:2])
    assert np.allclose(linear_covariance.respond(Phi, H, K, seen, 2), expected, atol=1e-12)


def test_a_random_disturbance_has_the_second_moment_that_achieve_gives():
    # What is seen is white: then it is noise of the measurement, and its moments are known.
    rng = np.random.default_rng(2)
    steps, n, runs, R = 30, 2, 40_000, 0.3
    Phi = np.tile([[1.0, 0.1], [0.0, 0.95]], (steps, 1, 1))
    H, K = np.tile([1.0, 0.0], (steps, 1)), np.tile([0.3, 0.2], (steps, 1))
    seen = np.sqrt(R) * rng.standard_normal((steps, runs))
    found = linear_covariance.respond(Phi, H, K, seen, n)[-1]
    exact = linear_covariance.achieve(Phi, np.zeros(n), H, R, np.zeros((n, n)), K)[-1]
    assert np.allclose(found @ found.T / runs, exact, rtol=0.03, atol=0.003)


@pytest.mark.parametrize("kept", [0, 3, 1.5])
def test_states_to_keep_are_named(kept):
    one = np.ones((2, 1))
    with pytest.raises(ParameterError, match=r"^kept = "):
        linear_covariance.respond(one[:, :, None], one, one, one, kept)
