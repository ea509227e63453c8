"""Paper 4 by linear covariance: what the EKFs do on average, without a random number.

Exact for the linearised model with gains on the true path; see
`seanav.filters.linear_covariance`.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from seanav import montecarlo
from seanav.checks import read_only
from seanav.filters import linear_covariance
from seanav.models import currents, earth, inertial
from seanav.models.trajectories import Trajectory
from seanav.studies.imm_sea_current.scenario import Scenario
from seanav.studies.imm_sea_current.scores import TCEP


@lru_cache(maxsize=4)
def _inertial_transitions(path):
    """Return the transitions of the 15 inertial states along the true path."""
    latitude = path.states()[0]
    steps = len(latitude) - 1
    middle = path.course(np.arange(steps) + 0.5)[0]
    felt = path.increments(10)[1].reshape(steps, -1, 3).sum(axis=1)
    F = np.empty((steps, 15, 15))
    s, c = np.sin(middle), np.cos(middle)
    for k in range(steps):
        C_bn = np.array([[c[k], -s[k], 0.0], [s[k], c[k], 0.0], [0.0, 0.0, 1.0]])
        position = (0.5 * (latitude[k] + latitude[k + 1]), 0.0, 0.0)
        v = path.speed * C_bn[:, 0]
        F[k] = inertial.error_dynamics(position, v, C_bn, C_bn @ felt[k], 1.0)[:15, :15]
    (transitions,) = read_only(np.eye(15) + F + 0.5 * F @ F)
    return transitions


@lru_cache(maxsize=4)
def model(path: Trajectory, correlation_time: float) -> tuple[np.ndarray, ...]:
    """Return Phi (steps, 18, 18) and H (steps, 18) along the true path."""
    _, _, v_n, heading = path.states()
    steps = len(heading) - 1
    Phi, H = np.zeros((steps, 18, 18)), np.zeros((steps, 18))
    Phi[:, :15, :15] = _inertial_transitions(path)
    Phi[:, range(15, 18), range(15, 18)] = currents.decay(1.0, correlation_time)[0]
    ahead = np.stack([np.cos(heading), np.sin(heading), np.zeros(steps + 1)], axis=1)[1:]
    H[:, 3:5] = ahead[:, :2]
    H[:, 6:9] = -np.cross(ahead, v_n[1:])
    H[:, 15:18] = -ahead
    return read_only(Phi, H)


def process_noise(scenario: Any, variance: float) -> np.ndarray:
    """Return the diagonal of Q per second, (18,), with the current's own `variance`."""
    errors = scenario.sensor_errors
    sensors = [0.0] * 3 + [errors.accelerometer_noise**2] * 2 + [0.0]
    return np.array(sensors + [errors.gyro_noise**2] * 3 + [0.0] * 6 + [variance] * 3)


def believed_start(scenario: Any, sigma: float) -> np.ndarray:
    """Return the covariance that a filter starts with, (18, 18)."""
    std = scenario.initial_std()
    held = np.array([*std[:2], 0.0, *std[2:4], 0.0, *std[4:]])
    return np.diag(np.r_[held**2, [sigma**2] * 3])


def true_start(scenario: Any, sigma: float) -> np.ndarray:
    """Return the true second moment of the errors at the start, (18, 18)."""
    M = believed_start(scenario, sigma if scenario.initial_current == "stationary" else 0.0)
    if scenario.initial_errors == "none":
        M[:9, :9] = 0.0
    return M


@lru_cache(maxsize=16)
def gains(scenario: Any, sigma_filter: float, correlation_time: float | None = None) -> np.ndarray:
    """Return the gains (steps, 18) of one EKF."""
    (K,) = read_only(design(scenario, sigma_filter, correlation_time)[0])
    return K


def design(
    scenario: Any, sigma_filter: float, correlation_time: float | None = None
) -> tuple[np.ndarray, ...]:
    """Return the gains (steps, 18) and covariances (steps + 1, 18, 18) of one EKF."""
    T_c = correlation_time or scenario.correlation_time_s
    Phi, H = model(scenario.path(), T_c)
    q = currents.decay(1.0, T_c)[1] * sigma_filter**2
    R = scenario.log_noise**2
    return linear_covariance.design(
        Phi, process_noise(scenario, q), H, R, believed_start(scenario, sigma_filter)
    )


@lru_cache(maxsize=16)
def mean_squares(scenario: Any, sigma_filter: float | None) -> tuple[np.ndarray, ...]:
    """Return A and B, (steps + 1, 18) each: mean squares of the errors are A + sigma_T² B.

    `sigma_filter` None is pure navigation.
    """
    Phi, H = model(scenario.path(), scenario.correlation_time_s)
    K = gains(scenario, sigma_filter) if sigma_filter else read_only(np.zeros_like(H))[0]
    q = currents.decay(1.0, scenario.correlation_time_s)[1]
    R = scenario.log_noise**2

    def moments(sigma):
        M = linear_covariance.achieve(
            Phi, process_noise(scenario, q * sigma**2), H, R, true_start(scenario, sigma), K
        )
        return np.einsum("kii->ki", M)

    A = moments(0.0)
    return read_only(A, moments(1.0) - A)


def metres(scenario: Any) -> np.ndarray:
    """Return metres per radian of latitude and longitude, (steps + 1, 2)."""
    return _metres(scenario.path())


@lru_cache(maxsize=4)
def _metres(path):
    latitude = path.states()[0]
    R_n, R_t = earth.radii(latitude)
    (scale,) = read_only(np.stack([R_n, R_t * np.cos(latitude)], axis=1))
    return scale


def scores(scenario: Any, sigma_filter: float | None, sigma_true: float) -> np.ndarray:
    """Return RMS position (m), velocity (m/s), levelling and heading (deg), and TCEP (m)."""
    A, B = mean_squares(scenario, sigma_filter)
    M = A[1:] + sigma_true**2 * B[1:]
    north, east = (M[:, :2] * metres(scenario)[1:] ** 2).mean(axis=0)
    v = math.sqrt(M[:, 3:5].sum(axis=1).mean())
    levelling, heading = math.sqrt(M[:, 6:8].sum(axis=1).mean()), math.sqrt(M[:, 8].mean())
    rms = (math.hypot(math.sqrt(north), math.sqrt(east)), v)
    tcep = TCEP * (math.sqrt(north) + math.sqrt(east))
    return np.array([*rms, math.degrees(levelling), math.degrees(heading), tcep])


@lru_cache(maxsize=1024)
def tcep(scenario: Any, sigma_filter: float | None, sigma_true: float) -> float:
    """Return the TCEP (m) of one EKF, or of pure navigation."""
    return float(scores(scenario, sigma_filter, sigma_true)[4])


def rate(scenario: Any, sigma_filter: float, sigma_true: float) -> float:
    """Return the TCEP rate of one EKF, equation (28), in percent."""
    pure, best = tcep(scenario, None, sigma_true), tcep(scenario, sigma_true, sigma_true)
    return 100 * (pure - tcep(scenario, sigma_filter, sigma_true)) / (pure - best)


def ends(scenario: Any, grid: Sequence[float]) -> dict[float, tuple[float, float]]:
    """Return the TCEPs (m) between which a rate lies, pure and optimal, at each true sigma.

    Empty for a log of three axes: the linear model knows the forward one alone.
    """
    if scenario.log_axes > 1:
        return {}
    return {s: (tcep(scenario, None, s), tcep(scenario, s, s)) for s in grid}


def shared_error(scenario: Any, sigma: float) -> tuple[float, ...]:
    """Return the correlation of velocity and current errors ahead, at the start and updated.

    The second is that after the first measurement of the log.
    """
    H = model(scenario.path(), scenario.correlation_time_s)[1][0]
    ahead = [np.where(np.isin(np.arange(18), part), H, 0.0) for part in ((3, 4), (15, 16))]
    v, c = ahead[0], -ahead[1]
    covariances = design(scenario, sigma)[1][:2]
    return tuple(float(v @ P @ c / math.sqrt(v @ P @ v * (c @ P @ c))) for P in covariances)


def twin(scenario: Scenario, sigma_filter: float, sigma_true: float, runs: int) -> np.ndarray:
    """Simulate the linear error equations themselves; return mean squares (4, runs).

    The rows are position, velocity, levelling and heading, over time: m², (m/s)², rad², rad².
    """
    Phi, H = model(scenario.path(), scenario.correlation_time_s)
    K = gains(scenario, sigma_filter)
    q = currents.decay(1.0, scenario.correlation_time_s)[1] * sigma_true**2
    spread = np.sqrt(process_noise(scenario, q))
    start = np.sqrt(np.diag(true_start(scenario, sigma_true)))
    generators = montecarlo.streams(scenario.seed, "linear twin", runs)
    e = np.stack([start * one.standard_normal(18) for one in generators], axis=1)
    totals, scale = np.zeros((4, runs)), metres(scenario)
    steps = len(H)
    block = 600
    for first in range(0, steps, block):
        count = min(block, steps - first)
        noise = np.stack([one.standard_normal((count, 19)) for one in generators], axis=2)
        for k in range(first, first + count):
            e = Phi[k] @ e + spread[:, None] * noise[k - first, :18]
            rho = H[k] @ e + scenario.log_noise * noise[k - first, 18]
            e = e - np.outer(K[k], rho)
            totals[0] += ((e[:2] * scale[k + 1][:, None]) ** 2).sum(axis=0)
            totals[1] += (e[3:5] ** 2).sum(axis=0)
            totals[2] += (e[6:8] ** 2).sum(axis=0)
            totals[3] += e[8] ** 2
    return totals / steps


def wrong_time(
    scenario: Scenario, sigma_filter: float, time_filter: float, sigma_true: float, time_true: float
) -> float:
    """Return the TCEP (m) of an EKF whose correlation time is wrong as well.

    States 15 to 17 are here the filter's estimate of the current, which decays as the
    filter believes, and 18 to 20 the true current, which decays as it does: 21 in all.
    The log sees their difference.
    """
    own, looked = model(scenario.path(), time_filter)
    Phi, H, K = (np.zeros((len(own), *more)) for more in ((21, 21), (21,), (21,)))
    Phi[:, :18, :18], H[:, :18], H[:, 18:] = own, looked, -looked[:, 15:]
    K[:, :18] = gains(scenario, sigma_filter, time_filter)
    a_true, variance = currents.decay(1.0, time_true)
    Phi[:, range(18, 21), range(18, 21)] = a_true
    q = variance * sigma_true**2
    Q = np.r_[process_noise(scenario, 0.0), [q] * 3]
    M0 = np.zeros((21, 21))
    M0[:18, :18] = true_start(scenario, 0.0)
    if scenario.initial_current == "stationary":
        M0[18:, 18:] = np.eye(3) * sigma_true**2
    M = linear_covariance.achieve(Phi, Q, H, scenario.log_noise**2, M0, K)
    M = np.einsum("kii->ki", M)[1:, :2] * metres(scenario)[1:] ** 2
    return TCEP * np.sqrt(M.mean(axis=0)).sum()
