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

from seanav._compile import kernel
from seanav.checks import ParameterError, array, integer, number
from seanav.models import earth
from seanav.models.attitude import skew

STATES = 18
P_, V_, PHI, BA, BG, VC = (slice(i, i + 3) for i in range(0, STATES, 3))
SLAVED = (2, 5)  # height and vertical velocity, held by the depth gauge


def error_dynamics(position, v_n, C_bn, f_n, correlation_time, *, slaved=True):
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
    v_N, v_E, _ = v_n
    w_ie = earth.earth_rate(L)
    rho = earth.transport_rate(L, h, v_n)

    W_p = np.zeros((3, 3))  # of the earth rate, by position
    W_p[:, 0] = -earth.RATE * s, 0.0, -earth.RATE * c
    R_p = np.zeros((3, 3))  # of the transport rate, by position
    R_p[:, 0] = -v_E * R_tt / T**2, v_N * R_nn / M**2, -v_E / (T * c**2) + v_E * t * R_tt / T**2
    R_p[:, 2] = -v_E / T**2, v_N / M**2, v_E * t / T**2
    R_v = np.zeros((3, 3))  # of the transport rate, by velocity
    R_v[0, 1], R_v[1, 0], R_v[2, 1] = 1 / T, -1 / M, -t / T

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

    accelerometer_bias: float = 0.05e-3 * 9.80665  # m/s²
    gyro_bias: float = math.radians(0.02) / 3600  # rad/s
    accelerometer_noise: float = 0.01e-3 * 9.80665  # m/s²/√Hz
    gyro_noise: float = math.radians(0.005) / 60  # rad/√s

    def __post_init__(self):
        for name, value in vars(self).items():
            number(name, value, at_least=0)


@kernel
def _preintegrate(rotation, velocity, per_step, theta, dv):
    # See `preintegrate`; theta and dv are filled.
    steps = theta.shape[0]
    for step in range(steps):
        w, x, y, z = 1.0, 0.0, 0.0, 0.0
        sx = sy = sz = 0.0
        for k in range(step * per_step, (step + 1) * per_step):
            ax, ay, az = rotation[k, 0], rotation[k, 1], rotation[k, 2]
            ux, uy, uz = velocity[k, 0], velocity[k, 1], velocity[k, 2]
            j = k - 1 if k > 0 else 0
            bx, by, bz = rotation[j, 0], rotation[j, 1], rotation[j, 2]
            px, py, pz = velocity[j, 0], velocity[j, 1], velocity[j, 2]
            # Rotation vector of this fast interval: sum and coning.
            tx = ax + (by * az - bz * ay) / 12.0
            ty = ay + (bz * ax - bx * az) / 12.0
            tz = az + (bx * ay - by * ax) / 12.0
            # Velocity increment in the axes at its start: rotation and sculling.
            cx, cy, cz = ay * uz - az * uy, az * ux - ax * uz, ax * uy - ay * ux
            dx = ux + 0.5 * cx + (ay * cz - az * cy) / 6.0
            dy = uy + 0.5 * cy + (az * cx - ax * cz) / 6.0
            dz = uz + 0.5 * cz + (ax * cy - ay * cx) / 6.0
            dx += (by * uz - bz * uy + py * az - pz * ay) / 12.0
            dy += (bz * ux - bx * uz + pz * ax - px * az) / 12.0
            dz += (bx * uy - by * ux + px * ay - py * ax) / 12.0
            # s += C d, with d rotated by the quaternion: d + 2 q × (q × d + w d).
            ex, ey, ez = (
                y * dz - z * dy + w * dx,
                z * dx - x * dz + w * dy,
                x * dy - y * dx + w * dz,
            )
            sx += dx + 2.0 * (y * ez - z * ey)
            sy += dy + 2.0 * (z * ex - x * ez)
            sz += dz + 2.0 * (x * ey - y * ex)
            square = tx * tx + ty * ty + tz * tz
            half = 0.5 - square / 48.0
            c = 1.0 - square / 8.0 + square * square / 384.0
            tx, ty, tz = half * tx, half * ty, half * tz
            w, x, y, z = (
                w * c - x * tx - y * ty - z * tz,
                x * c + w * tx + y * tz - z * ty,
                y * c + w * ty + z * tx - x * tz,
                z * c + w * tz + x * ty - y * tx,
            )
        sine = math.sqrt(x * x + y * y + z * z)
        scale = 2.0 * math.atan2(sine, w) / sine if sine > 1e-12 else 2.0
        theta[step, 0], theta[step, 1], theta[step, 2] = scale * x, scale * y, scale * z
        dv[step, 0], dv[step, 1], dv[step, 2] = sx, sy, sz


def preintegrate(rotation, velocity, per_step):
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


def sensor_increments(trajectory, errors, generator, initial_bias, *, rate=100):
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
    """Advance one interval in place of `q`; return latitude and longitude rates and velocity.

    Parameters
    ----------
    latitude, height : float
        rad, m.
    v_N, v_E : float
        m/s; the vertical velocity is held at zero.
    q : (4,), changed
        Quaternion body to n, scalar first.
    theta, dv : (3,)
        Rotation vector (rad) and velocity increment (m/s) in the body axes at the start.
    dt : float
        s.

    Returns
    -------
    dlatitude, dlongitude, v_N, v_E, f_N, f_E, f_D
        Steps of the position (rad), new velocity and mean specific force in n (m/s²).
    """
    s, c = math.sin(latitude), math.cos(latitude)
    w2 = 1.0 - earth.ECCENTRICITY_SQUARED * s * s
    R_t = earth.SEMI_MAJOR / math.sqrt(w2)
    R_n = R_t * (1.0 - earth.ECCENTRICITY_SQUARED) / w2
    M, T, t = R_n + height, R_t + height, s / c
    # Specific force in n, the n axes turned half a step.
    qw, qx, qy, qz = q[0], q[1], q[2], q[3]
    ex = qy * dv[2] - qz * dv[1] + qw * dv[0]
    ey = qz * dv[0] - qx * dv[2] + qw * dv[1]
    ez = qx * dv[1] - qy * dv[0] + qw * dv[2]
    aN = dv[0] + 2.0 * (qy * ez - qz * ey)
    aE = dv[1] + 2.0 * (qz * ex - qx * ez)
    aD = dv[2] + 2.0 * (qx * ey - qy * ex)
    # Velocity half-way, from the force alone: the Coriolis terms only need it roughly.
    mN, mE = v_N + 0.5 * aN, v_E + 0.5 * aE
    oN, oD = earth.RATE * c, -earth.RATE * s
    rN, rE, rD = mE / T, -mN / M, -mE / T * t
    hN, hE, hD = 0.5 * dt * (oN + rN), 0.5 * dt * rE, 0.5 * dt * (oD + rD)
    fN = aN - (hE * aD - hD * aE)
    fE = aE - (hD * aN - hN * aD)
    fD = aD - (hN * aE - hE * aN)
    nN = v_N + fN + dt * (2.0 * oD + rD) * mE
    nE = v_E + fE - dt * (2.0 * oD + rD) * mN
    dL = 0.5 * dt * (v_N + nN) / M
    # Cosine of the latitude half-way; the next term is below 1e-20.
    middle = c - 0.5 * dL * (s + 0.25 * dL * c)
    dlongitude = 0.5 * dt * (v_E + nE) / (T * middle)
    # q <- exp(-omega_in dt) q exp(theta)
    square = theta[0] * theta[0] + theta[1] * theta[1] + theta[2] * theta[2]
    half = 0.5 - square / 48.0 + square * square / 3840.0
    bw = 1.0 - square / 8.0 + square * square / 384.0
    bx, by, bz = half * theta[0], half * theta[1], half * theta[2]
    pw = qw * bw - qx * bx - qy * by - qz * bz
    px = qx * bw + qw * bx + qy * bz - qz * by
    py = qy * bw + qw * by + qz * bx - qx * bz
    pz = qz * bw + qw * bz + qx * by - qy * bx
    nw = 1.0 - 0.5 * (hN * hN + hE * hE + hD * hD)
    qw = nw * pw + hN * px + hE * py + hD * pz
    qx = nw * px - hN * pw - hE * pz + hD * py
    qy = nw * py - hE * pw - hD * px + hN * pz
    qz = nw * pz - hD * pw - hN * py + hE * px
    # One Newton step from length one: enough for a length off by rounding.
    length = 1.5 - 0.5 * (qw * qw + qx * qx + qy * qy + qz * qz)
    q[0], q[1], q[2], q[3] = qw * length, qx * length, qy * length, qz * length
    return dL, dlongitude, nN, nE, fN / dt, fE / dt, fD / dt


@kernel
def _mechanise(position, v_n, q, theta, dv, dt, track):
    # See `mechanise`; track is filled.
    latitude, longitude, v_N, v_E = position[0], position[1], v_n[0], v_n[1]
    attitude = q.copy()
    for step in range(theta.shape[0] + 1):
        track[step, 0], track[step, 1], track[step, 2], track[step, 3] = (
            latitude,
            longitude,
            v_N,
            v_E,
        )
        track[step, 4:] = attitude
        if step < theta.shape[0]:
            dL, dlongitude, v_N, v_E, _, _, _ = _advance(
                latitude, position[2], v_N, v_E, attitude, theta[step], dv[step], dt
            )
            latitude += dL
            longitude += dlongitude


def mechanise(position, v_n, q, theta, dv, dt):
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
