"""The steady state of a Kalman filter, by the solver of scipy: a reference for ours."""

import numpy as np
from scipy import linalg


def steady_covariance(Phi, H, Q, R):
    """Covariances before and after a measurement, (n, n) each: the discrete Riccati equation."""
    before = linalg.solve_discrete_are(Phi.T, H.T, Q, R)
    gain = np.linalg.solve(H @ before @ H.T + R, H @ before).T
    return before, before - gain @ H @ before
