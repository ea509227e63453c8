"""Rotations: cross-product matrices, rotation vectors, direction cosine matrices.

Source: Titterton and Weston, *Strapdown Inertial Navigation Technology*, 2nd ed., IET,
2004, chapters 3 and 11.
"""

import math

import numpy as np

from seanav.checks import array


def skew(a):
    """Return [a×], shape (3, 3), so that skew(a) @ b = a × b."""
    a = array("a", a, (3,))
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def exp_so3(rotation):
    """Return the rotation matrix of a rotation vector (3,), rad: Rodrigues' formula."""
    rotation = array("rotation", rotation, (3,))
    angle = math.sqrt(float(np.dot(rotation, rotation)))
    K = skew(rotation)
    if angle < 1e-8:
        return np.eye(3) + K + 0.5 * K @ K
    return np.eye(3) + math.sin(angle) / angle * K + (1 - math.cos(angle)) / angle**2 * K @ K


def C_bn_from_rpy(rpy):
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


def attitude_error(C_bn_estimate, C_bn):
    """Return phi (3,), rad, of C(q̂) = (I − [φ×]) C(q), to first order (paper equation (8))."""
    D = array("C_bn_estimate", C_bn_estimate, (3, 3)) @ array("C_bn", C_bn, (3, 3)).T
    return 0.5 * np.array([D[1, 2] - D[2, 1], D[2, 0] - D[0, 2], D[0, 1] - D[1, 0]])
