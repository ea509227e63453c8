"""Paper 4, Appendix B: velocity and current in one dimension."""

import math

import numpy as np

from seanav.filters import linear_covariance
from seanav.models import currents


def one_step(P11: float, P12: float, P22: float, R: float) -> float:
    """Return the velocity variance after one measurement of v − v_c, equation (B3)."""
    return P11 - (P11 - P12) ** 2 / (P11 - 2 * P12 + P22 + R)


def riccati(
    sigma: float,
    steps: int,
    *,
    velocity_std: float,
    drift: float,
    log_noise: float,
    correlation_time: float,
) -> tuple[np.ndarray, ...]:
    """Return gains (steps, 2), covariances before and after each update, (steps, 2, 2).

    The velocity error is a random walk that starts with `velocity_std` (m/s) and gains the
    variance `drift`² (m²/s²) per second.
    """
    a, variance = currents.decay(1.0, correlation_time)
    Phi = np.broadcast_to(np.diag([1.0, a]), (steps, 2, 2)).copy()
    H = np.broadcast_to([1.0, -1.0], (steps, 2)).copy()
    Q = np.array([drift**2, variance * sigma**2])
    P0 = np.diag([velocity_std**2, sigma**2])
    gains, after = linear_covariance.design(Phi, Q, H, log_noise**2, P0)
    before = Phi @ after[:-1] @ Phi.transpose(0, 2, 1) + np.diag(Q)
    return gains, before, after[1:]


def simulate(
    sigma: float,
    steps: int,
    noise: np.ndarray,
    *,
    velocity_std: float,
    drift: float,
    log_noise: float,
    correlation_time: float,
) -> np.ndarray:
    """Return errors after each update, (steps, 2, runs), from standard normal `noise`.

    `noise` has shape (runs, steps + 1, 3); its first row draws the errors at the start.
    """
    options = {"velocity_std": velocity_std, "drift": drift, "log_noise": log_noise}
    gains, _, _ = riccati(sigma, steps, correlation_time=correlation_time, **options)
    a, variance = currents.decay(1.0, correlation_time)
    noise = np.moveaxis(noise, 0, -1)
    e = np.stack([velocity_std * noise[0, 0], sigma * noise[0, 1]])
    errors = np.empty((steps, 2, noise.shape[-1]))
    spread = np.array([[drift], [math.sqrt(variance) * sigma]])
    for k in range(steps):
        e = np.array([[1.0], [a]]) * e + spread * noise[k + 1, :2]
        rho = e[0] - e[1] + log_noise * noise[k + 1, 2]
        e = e - gains[k][:, None] * rho
        errors[k] = e
    return errors
