"""Inertial navigation: error model, sensor errors, preintegration, strapdown mechanisation.

The error state has 18 elements: position (latitude, longitude, height: rad, rad, m),
velocity (NED, m/s), attitude phi (rad), accelerometer bias (m/s²), gyro bias (rad/s) and
sea current (NED, m/s). Errors are estimate minus truth, C(q̂) = (I − [φ×]) C(q).

References
----------
Cha, Hwang and Park, *The Journal of Navigation*, 2022, equations (10), (A1)-(A11);
Titterton and Weston, *Strapdown Inertial Navigation Technology*, 2nd ed., IET, 2004,
chapters 11 and 12. P. G. Savage, "Strapdown inertial navigation integration algorithm
design", *Journal of Guidance, Control, and Dynamics* 21 (1998), parts 1 and 2.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from seanav._compile import kernel
from seanav.checks import ParameterError, array, integer, number
from seanav.models import attitude, earth, units
from seanav.models.attitude import skew
from seanav.models.trajectories import Trajectory

STATES = 18
P_, V_, PHI, BA, BG, VC = (slice(i, i + 3) for i in range(0, STATES, 3))
SLAVED = (2, 5)  # height and vertical velocity, held by the depth gauge


def error_dynamics(
    position: ArrayLike,
    v_n: ArrayLike,
    C_bn: ArrayLike,
    f_n: ArrayLike,
    correlation_time: float,
    *,
    slaved: bool = True,
) -> np.ndarray:
    """Return F of equation (10) with (A1)-(A11), shape (18, 18).

    Parameters
    ----------
    position : (3,)
        Latitude, longitude (rad), height (m).
    v_n, f_n : (3,)
        Velocity (m/s) and specific force (m/s²) in n.
    C_bn : (3, 3)
        Body to n.
    correlation_time : float
        T_c of the sea current, s.
    slaved : bool
        Hold height and vertical velocity: their rows and columns are zero.

    Raises
    ------
    seanav.checks.ParameterError
        If a shape does not fit, a number is not finite or out of its bounds.
    """
    L, _, h = array("position", position, (3,))
    v_n, f_n = array("v_n", v_n, (3,)), array("f_n", f_n, (3,))
    C_bn = array("C_bn", C_bn, (3, 3))
    correlation_time = number("correlation_time", correlation_time, above=0)
    s, c = math.sin(L), math.cos(L)
    t = s / c
    R_n, R_t = earth.radii(L)
    R_nn, R_tt = earth.radii_slopes(L)
    M, T = R_n + h, R_t + h
    w_ie = earth.earth_rate(L)
    rho = earth.transport_rate(L, h, v_n)

    W_p, R_p, R_v = _slopes_of_rates(L, h, v_n)

    F = np.zeros((STATES, STATES))
    F[P_, P_] = [
        [rho[1] * R_nn / M, 0.0, rho[1] / M],
        [rho[0] / c * (t - R_tt / T), 0.0, -rho[0] / (T * c)],
        [0.0, 0.0, 0.0],
    ]
    F[P_, V_] = np.diag([1 / M, 1 / (T * c), -1.0])
    F[V_, P_] = skew(v_n) @ (2 * W_p + R_p)
    F[5, 0] += _gravity_slope(L, h)
    F[5, 2] += -2.0 / earth.SEMI_MAJOR * earth.gravity(L, 0.0)
    F[V_, V_] = -skew(2 * w_ie + rho) + skew(v_n) @ R_v
    F[V_, PHI] = skew(f_n)
    F[V_, BA] = -C_bn
    F[PHI, P_] = W_p + R_p
    F[PHI, V_] = R_v
    F[PHI, PHI] = -skew(w_ie + rho)
    F[PHI, BG] = C_bn
    F[VC, VC] = -np.eye(3) / correlation_time
    if slaved:
        F[SLAVED, :] = 0.0
        F[:, SLAVED] = 0.0
    return F


def _slopes_of_rates(L, h, v_n):
    """Return the slopes of earth rate and transport rate: W_p, R_p by position, R_v by velocity."""
    s, c = math.sin(L), math.cos(L)
    t = s / c
    R_n, R_t = earth.radii(L)
    R_nn, R_tt = earth.radii_slopes(L)
    M, T = R_n + h, R_t + h
    v_N, v_E, _ = v_n
    W_p = np.zeros((3, 3))
    W_p[:, 0] = -earth.RATE * s, 0.0, -earth.RATE * c
    R_p = np.zeros((3, 3))
    R_p[:, 0] = -v_E * R_tt / T**2, v_N * R_nn / M**2, -v_E / (T * c**2) + v_E * t * R_tt / T**2
    R_p[:, 2] = -v_E / T**2, v_N / M**2, v_E * t / T**2
    R_v = np.zeros((3, 3))
    R_v[0, 1], R_v[1, 0], R_v[2, 1] = 1 / T, -1 / M, -t / T
    return W_p, R_p, R_v


def _gravity_slope(L, h):
    s, c = math.sin(L), math.cos(L)
    e2, k = earth.ECCENTRICITY_SQUARED, earth.SOMIGLIANA
    w = 1 - e2 * s * s
    relative = 2 * k * s * c / (1 + k * s * s) + e2 * s * c / w
    return relative * earth.gravity(L, h)


# ---------------------------------------------------------------- sensors


@dataclass(frozen=True)
class SensorErrors:
    """Errors of the inertial sensors, SI units; defaults are Table 1 of the paper.

    A bias is constant over a run and drawn with this standard deviation per axis.
    """

    accelerometer_bias: float = 0.05e-3 * units.G0  # m/s²
    gyro_bias: float = math.radians(0.02) / 3600  # rad/s
    accelerometer_noise: float = 0.01e-3 * units.G0  # m/s²/√Hz
    gyro_noise: float = math.radians(0.005) / 60  # rad/√s

    def __post_init__(self):
        for name, value in vars(self).items():
            number(name, value, at_least=0)


@kernel
def _preintegrate(rotation, velocity, per_step, theta, dv):
    # See `preintegrate`; theta and dv are filled.
    for step in range(theta.shape[0]):
        q, total = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        first = step * per_step
        b, p = _vector(rotation, max(first - 1, 0)), _vector(velocity, max(first - 1, 0))
        for k in range(first, first + per_step):
            a, u = _vector(rotation, k), _vector(velocity, k)
            turn, d = _corrected(a, u, b, p)
            b, p = a, u
            felt = attitude._rotate(q, d)
            total = total[0] + felt[0], total[1] + felt[1], total[2] + felt[2]
            q = attitude._multiply(q, attitude._from_small_rotation(turn))
        theta[step, 0], theta[step, 1], theta[step, 2] = attitude._rotation_vector(q)
        dv[step, 0], dv[step, 1], dv[step, 2] = total


@kernel
def _vector(rows, k):
    return rows[k, 0], rows[k, 1], rows[k, 2]


@kernel
def _corrected(a, u, b, p):
    """Return rotation vector and velocity increment of a fast interval, in its first axes.

    `a`, `u` are the integrals of angular rate and specific force over it, `b`, `p` those of
    the interval before: the sums alone miss coning, rotation and sculling.
    """
    coning = attitude._cross(b, a)
    turn = a[0] + coning[0] / 12.0, a[1] + coning[1] / 12.0, a[2] + coning[2] / 12.0
    once = attitude._cross(a, u)
    twice = attitude._cross(a, once)
    d0 = u[0] + 0.5 * once[0] + twice[0] / 6.0
    d1 = u[1] + 0.5 * once[1] + twice[1] / 6.0
    d2 = u[2] + 0.5 * once[2] + twice[2] / 6.0
    sculling = attitude._plus_cross(attitude._cross(b, u), p, a)
    return turn, (d0 + sculling[0] / 12.0, d1 + sculling[1] / 12.0, d2 + sculling[2] / 12.0)


def preintegrate(
    rotation: ArrayLike, velocity: ArrayLike, per_step: int
) -> tuple[np.ndarray, np.ndarray]:
    """Merge fast body increments into slow ones, coning and sculling included.

    Parameters
    ----------
    rotation, velocity : array (per_step * steps, 3)
        Integrals of angular rate (rad) and specific force (m/s) over fast intervals.
    per_step : int
        Fast intervals in one slow interval.

    Returns
    -------
    theta, dv : ndarray (steps, 3)
        Rotation vector of a slow interval; velocity increment in the body axes at its start.

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit, a number is not finite, or the fast intervals make no whole
        number of slow ones.

    Notes
    -----
    Savage's two-sample corrections inside an interval (products of neighbours over 12),
    then exact composition: dv accumulates through the rotation matrix, which is kept as a
    quaternion and turned into a rotation vector at the end.
    """
    sizes = {}
    rotation = array("rotation", rotation, ("fast intervals", 3), sizes)
    velocity = array("velocity", velocity, ("fast intervals", 3), sizes)
    per_step = integer("per_step", per_step, at_least=1)
    steps, left = divmod(len(rotation), per_step)
    if left:
        raise ParameterError("per_step", per_step, f"must divide {len(rotation)} fast intervals")
    theta, dv = np.empty((steps, 3)), np.empty((steps, 3))
    _preintegrate(rotation, velocity, per_step, theta, dv)
    return theta, dv


def sensor_increments(
    trajectory: Trajectory,
    errors: SensorErrors,
    generator: np.random.Generator,
    initial_bias: ArrayLike,
    *,
    rate: int = 100,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the increments that erring sensors report at 1 Hz, from `rate` samples a second.

    Parameters
    ----------
    trajectory : seanav.models.trajectories.Trajectory
        Its `increments(rate)` are the errorless ones.
    errors : SensorErrors
    generator : numpy.random.Generator
        Of the noise of this run.
    initial_bias : (6,)
        Accelerometer (m/s²) and gyro (rad/s) biases of this run.
    rate : int
        Samples per second.

    Returns
    -------
    theta, dv : (steps, 3)

    Raises
    ------
    seanav.checks.ParameterError
        If there are not six finite biases or `rate` is no positive integer.
    """
    initial_bias = array("initial_bias", initial_bias, (6,))
    rate = integer("rate", rate, at_least=1, at_most=10_000)
    rotation, velocity = trajectory.increments(rate)
    noise = generator.standard_normal((rotation.shape[0], 6))
    spread = 1.0 / math.sqrt(rate)
    rotation = rotation + (initial_bias[3:] / rate + errors.gyro_noise * spread * noise[:, 3:])
    velocity = velocity + (
        initial_bias[:3] / rate + errors.accelerometer_noise * spread * noise[:, :3]
    )
    return preintegrate(rotation, velocity, rate)


# ---------------------------------------------------------------- mechanisation


@kernel
def _advance(latitude, height, v_N, v_E, q, theta, dv, dt):
    """Advance one interval.

    Parameters
    ----------
    latitude, height : float
        rad, m.
    v_N, v_E : float
        m/s; the vertical velocity is held at zero.
    q : 4 floats
        Quaternion body to n, scalar first.
    theta, dv : 3 floats
        Rotation vector (rad) and velocity increment (m/s) in the body axes at the start.
    dt : float
        s.

    Returns
    -------
    dlatitude, dlongitude : float
        Steps of the position, rad.
    v_N, v_E, q
        At the end of the interval.
    f_n : 3 floats
        Mean specific force in n, m/s².
    """
    s, c = math.sin(latitude), math.cos(latitude)
    R_n, R_t = earth._radii_at(s)
    M, T, t = R_n + height, R_t + height, s / c
    # Velocity half-way, from the force alone: the Coriolis terms only need it roughly.
    a = attitude._rotate(q, dv)
    mN, mE = v_N + 0.5 * a[0], v_E + 0.5 * a[1]
    oN, oD = earth.RATE * c, -earth.RATE * s
    rN, rE, rD = mE / T, -mN / M, -mE / T * t
    # Half the turn of the n axes: the specific force is felt on average half-way through it.
    hN, hE, hD = 0.5 * dt * (oN + rN), 0.5 * dt * rE, 0.5 * dt * (oD + rD)
    turned = attitude._cross((hN, hE, hD), a)
    fN, fE, fD = a[0] - turned[0], a[1] - turned[1], a[2] - turned[2]
    nN = v_N + fN + dt * (2.0 * oD + rD) * mE
    nE = v_E + fE - dt * (2.0 * oD + rD) * mN
    dL = 0.5 * dt * (v_N + nN) / M
    # Cosine of the latitude half-way; the next term is below 1e-20.
    middle = c - 0.5 * dL * (s + 0.25 * dL * c)
    dlongitude = 0.5 * dt * (v_E + nE) / (T * middle)
    # q <- exp(-omega_in dt) q exp(theta)
    q = attitude._multiply(q, attitude._from_rotation_vector(theta))
    q = attitude._multiply(attitude._from_half_angles((-hN, -hE, -hD)), q)
    return dL, dlongitude, nN, nE, attitude._normalise(q), (fN / dt, fE / dt, fD / dt)


@kernel
def _mechanise(position, v_n, q, theta, dv, dt, track):
    # See `mechanise`; track is filled.
    latitude, longitude, v_N, v_E = position[0], position[1], v_n[0], v_n[1]
    q_bn = (q[0], q[1], q[2], q[3])
    for step in range(theta.shape[0] + 1):
        row = track[step]
        row[0], row[1], row[2], row[3] = latitude, longitude, v_N, v_E
        row[4], row[5], row[6], row[7] = q_bn
        if step < theta.shape[0]:
            dL, dlongitude, v_N, v_E, q_bn, _ = _advance(
                latitude, position[2], v_N, v_E, q_bn, _vector(theta, step), _vector(dv, step), dt
            )
            latitude += dL
            longitude += dlongitude


def mechanise(
    position: ArrayLike,
    v_n: ArrayLike,
    q: ArrayLike,
    theta: ArrayLike,
    dv: ArrayLike,
    dt: float,
) -> np.ndarray:
    """Integrate increments with height and vertical velocity held.

    Parameters
    ----------
    position : array (3,)
        Latitude, longitude (rad), height (m).
    v_n : array (3,)
        Velocity, m/s; the vertical one is taken as zero.
    q : array (4,)
        Quaternion body to n, scalar first, of length 1.
    theta, dv : array (steps, 3)
        As from `preintegrate`.
    dt : float
        Interval, s.

    Returns
    -------
    ndarray (steps + 1, 8)
        Latitude, longitude, v_N, v_E, quaternion; the start first.

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit, a number is not finite or out of its bounds.
    """
    sizes = {}
    position, v_n = array("position", position, (3,)), array("v_n", v_n, (3,))
    q = array("q", q, (4,))
    if abs(q @ q - 1.0) > 1e-6:
        raise ParameterError("q", q.tolist(), "must have the length 1")
    theta = array("theta", theta, ("steps", 3), sizes)
    dv = array("dv", dv, ("steps", 3), sizes)
    track = np.empty((len(theta) + 1, 8))
    _mechanise(position, v_n, q, theta, dv, number("dt", dt, above=0), track)
    return track
