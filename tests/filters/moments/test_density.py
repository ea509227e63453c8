"""The Fokker–Planck equation on a grid, against a linear equation whose density is known."""

import numpy as np
import pytest
from scipy import linalg

from seanav.filters import moments


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
        density = moments.fokker_planck(drift, spread, mean, P, end, (3.0, 3.5), nodes, 200)
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
