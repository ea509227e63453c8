"""Gravity anomaly of a geoid, by Fourier transform on a flat earth."""

from typing import Any

import japan_geoid
import numpy as np
from scipy import fft
from scipy.interpolate import RectBivariateSpline
from scipy.signal.windows import tukey

from seanav.checks import ParameterError, integer, number
from seanav.models.gravity.map import MOST_NODES, GravityMap, geodetic_to_local, square_nodes

NORMAL_GRAVITY_MGAL = 9.81e5
MEAN_RADIUS = 6371e3  # m

# JPGEO2024: 1′ × 1.5′, 15–50° N, 120–160° E.
_LATITUDES, _LONGITUDES = (15, 50), (120, 160)
_PER_DEGREE_NORTH, _PER_DEGREE_EAST = 60, 40

HALF_WIDTH_DEG = 3.5
# Cosine taper: this share of the window's width at each of its ends.
TAPER = 0.15
PADDING = 2

SOURCE = (
    "free-air anomaly computed from the geoid model JPGEO2024 of the Geospatial Information "
    "Authority of Japan (CC BY 4.0), as carried by the package japan-geoid"
)


def vertical_gradient(
    disturbance: np.ndarray,
    north_spacing: float,
    east_spacing: float,
    shape: tuple[int, ...] | None = None,
) -> np.ndarray:
    """Differentiate a potential given on a plane downward: the operator |k|.

    A harmonic potential that vanishes high above the plane decays as exp(−|k| z), so its
    downward derivative on the plane is |k| times its Fourier transform.

    Parameters
    ----------
    disturbance : array (north, east)
        Potential, taken as periodic beyond its edges after zero padding.
    north_spacing, east_spacing : float
        Distance between nodes, m.
    shape : tuple of int, optional
        Size to pad to with zeros; without it the field is periodic as it stands.

    Returns
    -------
    array (north, east)
        Unit of the input per metre.
    """
    rows, columns = shape or disturbance.shape
    spectrum = fft.rfft2(disturbance, (rows, columns))
    k_north = 2 * np.pi * fft.fftfreq(rows, north_spacing)[:, None]
    k_east = 2 * np.pi * fft.rfftfreq(columns, east_spacing)
    derivative = fft.irfft2(np.hypot(k_north, k_east) * spectrum, (rows, columns))
    return derivative[: disturbance.shape[0], : disturbance.shape[1]]


def without_trend(values: np.ndarray) -> np.ndarray:
    """Values of a grid less their least-squares quadratic surface.

    Parameters
    ----------
    values : array (north, east)

    Returns
    -------
    array (north, east)
    """
    north, east = (np.linspace(-1, 1, n) for n in values.shape)
    y, x = (a.ravel() for a in np.meshgrid(north, east, indexing="ij"))
    surface = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    coefficients = np.linalg.lstsq(surface, values.ravel())[0]
    return values - (surface @ coefficients).reshape(values.shape)


def anomaly_of_undulation(
    undulation: np.ndarray, north_spacing: float, east_spacing: float
) -> np.ndarray:
    """Free-air anomaly of a window of a geoid, flat-earth approximation.

    With T = γN (Bruns) the anomaly is Δg = −∂T/∂r − 2T/r: in the plane
    Δg(k) = γ|k|N(k) − 2γN/R. The order of the steps follows from what the transform
    assumes, a periodic field. The quadratic trend of N goes first: it is what jumps most
    at the edges, and a window cannot tell such wavelengths from a level. The taper then
    brings the rest to zero without a step, and the padding keeps one edge's field from
    reaching round to the other. The term 2γN/R needs no transform and takes the untapered
    N. Values in the tapered outer part of the window are meaningless, and so is the level.

    Parameters
    ----------
    undulation : array (north, east)
        Geoid height N, m.
    north_spacing, east_spacing : float
        Distance between nodes, m.

    Returns
    -------
    array (north, east)
        Anomaly, mGal.
    """
    undulation = without_trend(undulation)
    rows, columns = undulation.shape
    taper = tukey(rows, 2 * TAPER)[:, None] * tukey(columns, 2 * TAPER)
    padded = (PADDING * rows, PADDING * columns)
    slope = vertical_gradient(undulation * taper, north_spacing, east_spacing, padded)
    return NORMAL_GRAVITY_MGAL * (slope - 2 / MEAN_RADIUS * undulation)


def _window(name, degrees, coverage, per_degree):
    # Nodes of the geoid within the half width of a point: their coordinate in degrees.
    low, high = coverage[0] + HALF_WIDTH_DEG, coverage[1] - HALF_WIDTH_DEG
    allowed = (
        f"must be between {low:g} and {high:g}: the anomaly needs the geoid {HALF_WIDTH_DEG:g}° "
        f"around it, which is given for {_LATITUDES[0]}–{_LATITUDES[1]}° N, "
        f"{_LONGITUDES[0]}–{_LONGITUDES[1]}° E"
    )
    if not low <= number(name, degrees) <= high:
        raise ParameterError(name, degrees, allowed)
    first = round((degrees - HALF_WIDTH_DEG - coverage[0]) * per_degree)
    count = round(2 * HALF_WIDTH_DEG * per_degree) + 1
    return coverage[0] + np.arange(first, first + count) / per_degree


def from_geoid(
    latitude_deg: float = 18.8,
    longitude_deg: float = 128.0,
    size: int = 101,
    spacing: float = 1000.0,
) -> GravityMap:
    """Real gravity map, computed from the geoid around Japan and the open Pacific.

    `anomaly_of_undulation` on a window of ±3.5°, then a cubic spline to the nodes. The
    scale of the plane is that of the map's centre; half a degree from it the error of
    that is below 1 % of the anomaly.

    Parameters
    ----------
    latitude_deg, longitude_deg : float
        Middle of the map, degrees.
    size : int
        Nodes per side.
    spacing : float
        Distance between nodes, m.

    Returns
    -------
    GravityMap
        Its level is arbitrary: the trend of the window has been removed.

    Raises
    ------
    ParameterError
        If the window leaves the geoid or the map leaves the middle of the window.
    """
    latitude = _window("map_latitude_deg", latitude_deg, _LATITUDES, _PER_DEGREE_NORTH)
    longitude = _window("map_longitude_deg", longitude_deg, _LONGITUDES, _PER_DEGREE_EAST)
    size = integer("map_size", size, at_least=3, at_most=MOST_NODES)
    spacing = number("map_spacing", spacing, above=0)
    centre = (float(latitude_deg), float(longitude_deg))
    at_latitude, at_longitude = square_nodes(centre, size, spacing)

    sound = (1 - 2 * TAPER) * HALF_WIDTH_DEG  # half width of what the taper leaves alone
    reach = max(at_latitude[-1] - latitude_deg, at_longitude[-1] - longitude_deg)
    if reach > sound:
        allowed = f"must keep the map within {sound:g}° of its centre (spacing {spacing:g} m)"
        raise ParameterError("map_size", size, allowed)

    undulation: Any = japan_geoid.load_embedded_jpgeo2024().get_heights(
        *np.meshgrid(longitude, latitude)
    )
    if np.isnan(undulation).any():
        where = "must have the geoid given all around it; it has holes there"
        raise ParameterError("map_latitude_deg, map_longitude_deg", centre, where)
    east, north = geodetic_to_local(latitude[:2], longitude[:2], centre)
    anomaly = anomaly_of_undulation(undulation, north[1] - north[0], east[1] - east[0])
    return GravityMap.from_mgal(
        RectBivariateSpline(latitude, longitude, anomaly)(at_latitude, at_longitude),
        spacing,
        name=f"geoid, {latitude_deg:g}° N {longitude_deg:g}° E",
        source=SOURCE,
        centre=centre,
    )
