"""Rotations: quaternions for the kernels, matrices for everything else.

The kernels take and return tuples of numbers, a vector as (x, y, z) and a unit quaternion as
(w, x, y, z): such tuples vanish when a kernel is compiled into its caller, so a loop over
runs stays as fast as the products written out. The quaternion of C_bn turns body axes into
n; the product p q means first q, then p.

Source: Titterton and Weston, *Strapdown Inertial Navigation Technology*, 2nd ed., IET,
2004, chapters 3 and 11.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from seanav._compile import kernel
from seanav.checks import array

# ---------------------------------------------------------------- kernels, numbers in tuples


@kernel
def _dot(a, b):
    """Return a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _cross(a, b):
    """Return a × b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def _plus_cross(v, a, b):
    """Return v + a × b, added from left to right."""
    return (
        v[0] + a[1] * b[2] - a[2] * b[1],
        v[1] + a[2] * b[0] - a[0] * b[2],
        v[2] + a[0] * b[1] - a[1] * b[0],
    )


@kernel
def _multiply(p, q):
    """Return the quaternion product p q."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[1] * q[0] + p[0] * q[1] + p[2] * q[3] - p[3] * q[2],
        p[2] * q[0] + p[0] * q[2] + p[3] * q[1] - p[1] * q[3],
        p[3] * q[0] + p[0] * q[3] + p[1] * q[2] - p[2] * q[1],
    )


@kernel
def _conjugate(q):
    """Return the quaternion of the inverse rotation."""
    return q[0], -q[1], -q[2], -q[3]


@kernel
def _rotate(q, v):
    """Return C v with C the matrix of `q`: v + 2 u × (u × v + w v), where q = (w, u)."""
    u = (q[1], q[2], q[3])
    inner = _cross(u, v)
    inner = inner[0] + q[0] * v[0], inner[1] + q[0] * v[1], inner[2] + q[0] * v[2]
    outer = _cross(u, inner)
    return v[0] + 2.0 * outer[0], v[1] + 2.0 * outer[1], v[2] + 2.0 * outer[2]


@kernel
def _from_rotation_vector(theta):
    """Return the quaternion of a rotation vector (rad): a series, for at most some 0.1 rad.

    The first terms left out are theta⁶ / 46080 and theta⁷ / 645120.
    """
    square = _dot(theta, theta)
    half = 0.5 - square / 48.0 + square * square / 3840.0
    w = 1.0 - square / 8.0 + square * square / 384.0
    return w, half * theta[0], half * theta[1], half * theta[2]


@kernel
def _from_small_rotation(theta):
    """Return the quaternion of a rotation vector of some milliradians, as of a fast interval.

    The first term left out is theta⁵ / 3840, below rounding there.
    """
    square = _dot(theta, theta)
    half = 0.5 - square / 48.0
    w = 1.0 - square / 8.0 + square * square / 384.0
    return w, half * theta[0], half * theta[1], half * theta[2]


@kernel
def _from_half_angles(half):
    """Return the quaternion of the tiny rotation vector 2 `half`, to second order."""
    return 1.0 - 0.5 * _dot(half, half), half[0], half[1], half[2]


@kernel
def _rotation_vector(q):
    """Return the rotation vector (rad) of a quaternion, the shorter way round for w ≥ 0."""
    vector = (q[1], q[2], q[3])
    sine = math.sqrt(_dot(vector, vector))
    scale = 2.0 * math.atan2(sine, q[0]) / sine if sine > 1e-12 else 2.0
    return scale * vector[0], scale * vector[1], scale * vector[2]


@kernel
def _column(q, axis):
    """Return a column of the matrix of `q`: in n, the unit vector of body axis 0, 1 or 2."""
    w, x, y, z = q
    if axis == 0:
        return 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)
    if axis == 1:
        return 2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)
    return 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)


@kernel
def _normalise(q):
    """Return `q` at length one: one Newton step, enough for a length off by rounding."""
    w, x, y, z = q
    scale = 1.5 - 0.5 * (w * w + x * x + y * y + z * z)
    return w * scale, x * scale, y * scale, z * scale


# ---------------------------------------------------------------- matrices


def skew(a: ArrayLike) -> np.ndarray:
    """Return [a×], shape (3, 3), so that skew(a) @ b = a × b."""
    a = array("a", a, (3,))
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def exp_so3(rotation: ArrayLike) -> np.ndarray:
    """Return the rotation matrix of a rotation vector (3,), rad: Rodrigues' formula."""
    rotation = array("rotation", rotation, (3,))
    angle = math.sqrt(float(np.dot(rotation, rotation)))
    K = skew(rotation)
    if angle < 1e-8:
        return np.eye(3) + K + 0.5 * K @ K
    return np.eye(3) + math.sin(angle) / angle * K + (1 - math.cos(angle)) / angle**2 * K @ K


def C_bn_from_rpy(rpy: ArrayLike) -> np.ndarray:
    """Return C_bn (3, 3), body to NED, from roll, pitch and yaw (rad)."""
    rpy = array("rpy", rpy, (3,))
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy), np.cos(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def attitude_error(C_bn_estimate: ArrayLike, C_bn: ArrayLike) -> np.ndarray:
    """Return phi (3,), rad, of C(q̂) = (I − [φ×]) C(q), to first order (paper equation (8))."""
    D = array("C_bn_estimate", C_bn_estimate, (3, 3)) @ array("C_bn", C_bn, (3, 3)).T
    return 0.5 * np.array([D[1, 2] - D[2, 1], D[2, 0] - D[0, 2], D[0, 1] - D[1, 0]])
