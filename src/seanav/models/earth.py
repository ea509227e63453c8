"""WGS-84 ellipsoid, gravity on it, earth and transport rates.

References
----------
P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation
Systems*, 2nd ed., Artech House, 2013, chapter 2.
D. H. Titterton and J. L. Weston, *Strapdown Inertial Navigation Technology*, 2nd ed.,
IET, 2004, chapters 3 and 12.
"""

import math

import numpy as np

from seanav._compile import kernel

RATE = 7.292115e-5  # rad/s
SEMI_MAJOR = 6378137.0  # m
ECCENTRICITY_SQUARED = 6.69437999014e-3
GRAVITY_EQUATOR = 9.7803253359  # m/s²
SOMIGLIANA = 1.931852652458e-3  # k of the closed formula of normal gravity


@kernel
def radii_at(sine):
    """Return R_n and R_t (m) as `radii`, from the sine of the latitude."""
    w = 1.0 - ECCENTRICITY_SQUARED * sine * sine
    R_t = SEMI_MAJOR / np.sqrt(w)
    return R_t * (1.0 - ECCENTRICITY_SQUARED) / w, R_t


@kernel
def radii(latitude):
    """Return the meridian and transverse radii of curvature R_n, R_t (m).

    `latitude` (rad) is a number or an array of any shape, in a kernel or outside; the radii
    have its shape.
    """
    return radii_at(np.sin(latitude))


@kernel
def slopes_at(sine, cosine, R_n, R_t):
    """Return dR_n/dL and dR_t/dL (m/rad), from sine and cosine of the latitude and the radii."""
    w = 1.0 - ECCENTRICITY_SQUARED * sine * sine
    R_nn = 3.0 * R_n * ECCENTRICITY_SQUARED * sine * cosine / w
    return R_nn, R_t * ECCENTRICITY_SQUARED * sine * cosine / w


@kernel
def radii_slopes(latitude):
    """Return dR_n/dL and dR_t/dL (m/rad), called R_nn and R_tt in equation (A1)."""
    s, c = np.sin(latitude), np.cos(latitude)
    R_n, R_t = radii_at(s)
    return slopes_at(s, c, R_n, R_t)


@kernel
def gravity(latitude, height):
    """Return normal gravity (m/s²): Somigliana's formula, linear in the height (m).

    `latitude` (rad) and `height` are numbers or arrays.
    """
    s = np.sin(latitude)
    surface = GRAVITY_EQUATOR * (1.0 + SOMIGLIANA * s * s)
    surface = surface / np.sqrt(1.0 - ECCENTRICITY_SQUARED * s * s)
    return surface * (1.0 - 2.0 * height / SEMI_MAJOR)


def earth_rate(latitude):
    """Return the earth rate omega_ie in n, shape (3,), rad/s."""
    return np.array([RATE * math.cos(latitude), 0.0, -RATE * math.sin(latitude)])


def transport_rate(latitude, height, v_n):
    """Return the transport rate omega_en in n, shape (3,), rad/s, at velocity `v_n` (m/s)."""
    R_n, R_t = radii(latitude)
    north, east = v_n[0], v_n[1]
    around = east / (R_t + height)
    return np.array([around, -north / (R_n + height), -around * math.tan(latitude)])
