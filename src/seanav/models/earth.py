"""WGS-84 ellipsoid, gravity on it, earth and transport rates.

Latitudes are in rad, from -π/2 to π/2; anything else is a `seanav.checks.ParameterError`.

References
----------
P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation
Systems*, 2nd ed., Artech House, 2013, chapter 2.
D. H. Titterton and J. L. Weston, *Strapdown Inertial Navigation Technology*, 2nd ed.,
IET, 2004, chapters 3 and 12.
"""

import math

import numpy as np

from seanav.checks import array, number

RATE = 7.292115e-5  # rad/s
SEMI_MAJOR = 6378137.0  # m
ECCENTRICITY_SQUARED = 6.69437999014e-3
GRAVITY_EQUATOR = 9.7803253359  # m/s²
SOMIGLIANA = 1.931852652458e-3  # k of the closed formula of normal gravity


def _latitude(value):
    return number("latitude", value, at_least=-math.pi / 2, at_most=math.pi / 2)


def radii(latitude):
    """Return the meridian and transverse radii of curvature R_n, R_t (m)."""
    s = math.sin(_latitude(latitude))
    w = 1.0 - ECCENTRICITY_SQUARED * s * s
    R_t = SEMI_MAJOR / math.sqrt(w)
    return R_t * (1.0 - ECCENTRICITY_SQUARED) / w, R_t


def radii_slopes(latitude):
    """Return dR_n/dL and dR_t/dL (m/rad), called R_nn and R_tt in equation (A1)."""
    latitude = _latitude(latitude)
    s, c = math.sin(latitude), math.cos(latitude)
    w = 1.0 - ECCENTRICITY_SQUARED * s * s
    e2 = ECCENTRICITY_SQUARED
    R_nn = 3.0 * SEMI_MAJOR * (1.0 - e2) * e2 * s * c / w**2.5
    return R_nn, SEMI_MAJOR * e2 * s * c / w**1.5


def gravity(latitude, height):
    """Return normal gravity (m/s²): Somigliana's formula, linear in the height (m)."""
    s = math.sin(_latitude(latitude))
    surface = GRAVITY_EQUATOR * (1.0 + SOMIGLIANA * s * s)
    surface /= math.sqrt(1.0 - ECCENTRICITY_SQUARED * s * s)
    return surface * (1.0 - 2.0 * number("height", height) / SEMI_MAJOR)


def earth_rate(latitude):
    """Return the earth rate omega_ie in n, shape (3,), rad/s."""
    latitude = _latitude(latitude)
    return np.array([RATE * math.cos(latitude), 0.0, -RATE * math.sin(latitude)])


def transport_rate(latitude, height, v_n):
    """Return the transport rate omega_en in n, shape (3,), rad/s, at velocity `v_n` (m/s)."""
    R_n, R_t = radii(latitude)
    latitude, height = _latitude(latitude), number("height", height)
    north, east, _ = array("v_n", v_n, (3,))
    around = east / (R_t + height)
    return np.array([around, -north / (R_n + height), -around * math.tan(latitude)])
