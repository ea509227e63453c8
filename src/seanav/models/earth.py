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
from numpy.typing import ArrayLike

from seanav._compile import kernel
from seanav.checks import array, number

RATE = 7.292115e-5  # rad/s
SEMI_MAJOR = 6378137.0  # m
ECCENTRICITY_SQUARED = 6.69437999014e-3
GRAVITY_EQUATOR = 9.7803253359  # m/s²
SOMIGLIANA = 1.931852652458e-3  # k of the closed formula of normal gravity


_POLE = math.pi / 2


@kernel
def _radii_at(sine):
    """Return R_n and R_t (m) as `radii`, from the sine of the latitude."""
    w = 1.0 - ECCENTRICITY_SQUARED * sine * sine
    R_t = SEMI_MAJOR / np.sqrt(w)
    return R_t * (1.0 - ECCENTRICITY_SQUARED) / w, R_t


@kernel
def _radii(latitude):
    return _radii_at(np.sin(latitude))


@kernel
def _slopes_at(sine, cosine, R_n, R_t):
    """Return dR_n/dL and dR_t/dL (m/rad), from sine and cosine of the latitude and the radii."""
    w = 1.0 - ECCENTRICITY_SQUARED * sine * sine
    R_nn = 3.0 * R_n * ECCENTRICITY_SQUARED * sine * cosine / w
    return R_nn, R_t * ECCENTRICITY_SQUARED * sine * cosine / w


def _latitude(value):
    if isinstance(value, (np.ndarray, list, tuple)):
        return array("latitude", value, (...,), at_least=-_POLE, at_most=_POLE)
    return _one_latitude(value)


def _one_latitude(value):
    return number("latitude", value, at_least=-_POLE, at_most=_POLE)


def radii(latitude: ArrayLike) -> tuple:
    """Return the meridian and transverse radii of curvature R_n, R_t (m).

    Parameters
    ----------
    latitude : float or array of any shape
        rad.

    Returns
    -------
    R_n, R_t : float or ndarray, as the latitude
    """
    return _radii(_latitude(latitude))


def radii_slopes(latitude: float) -> tuple[float, float]:
    """Return dR_n/dL and dR_t/dL (m/rad), called R_nn and R_tt in equation (A1)."""
    latitude = _one_latitude(latitude)
    s, c = math.sin(latitude), math.cos(latitude)
    return _slopes_at(s, c, *_radii_at(s))


@kernel
def _gravity(latitude, height):
    s = np.sin(latitude)
    surface = GRAVITY_EQUATOR * (1.0 + SOMIGLIANA * s * s)
    surface = surface / np.sqrt(1.0 - ECCENTRICITY_SQUARED * s * s)
    return surface * (1.0 - 2.0 * height / SEMI_MAJOR)


def gravity(latitude: ArrayLike, height: float) -> float | np.ndarray:
    """Return normal gravity (m/s²): Somigliana's formula, linear in the height (m).

    `latitude` (rad) is a number or an array of any shape, and so is what is returned.
    """
    return _gravity(_latitude(latitude), number("height", height))


def earth_rate(latitude: float) -> np.ndarray:
    """Return the earth rate omega_ie in n, shape (3,), rad/s."""
    latitude = _one_latitude(latitude)
    return np.array([RATE * math.cos(latitude), 0.0, -RATE * math.sin(latitude)])


def transport_rate(latitude: float, height: float, v_n: ArrayLike) -> np.ndarray:
    """Return the transport rate omega_en in n, shape (3,), rad/s, at velocity `v_n` (m/s)."""
    R_n, R_t = radii(_one_latitude(latitude))
    height = number("height", height)
    north, east, _ = array("v_n", v_n, (3,))
    around = east / (R_t + height)
    return np.array([around, -north / (R_n + height), -around * math.tan(latitude)])
