"""Gravity anomaly on a flat kilometre grid, and how to read it between the nodes."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from seanav import checks
from seanav._compile import kernel
from seanav.checks import ParameterError, array, integer, number
from seanav.models.units import MGAL

MOST_NODES = 5001  # per side of a map

# Earth of paper 5, below its (32). A flattening of 1/298.3 is the one printed there.
EARTH_RADIUS = 6378137.0
FLATTENING = 1 / 298.3


@dataclass(frozen=True, eq=False)
class GravityMap:
    """Gravity anomaly on a square grid.

    Parameters
    ----------
    anomaly : array (north, east)
        Anomaly, m/s². Node [i, j] lies at north = i·spacing, east = j·spacing, in metres
        from the lower left corner.
    spacing : float
        Distance between nodes, m.
    name : str
        Short name for titles.
    source : str
        Where the values come from, in words that can be cited.
    centre : tuple of float or None
        (latitude, longitude) of the middle of the grid, degrees; None for a map of no place.

    Raises
    ------
    ParameterError
        If the grid has fewer than 3 × 3 nodes or a value that is not finite, or the spacing is
        not positive.
    """

    anomaly: np.ndarray
    spacing: float = 1000.0
    name: str = ""
    source: str = ""
    centre: tuple[float, float] | None = None

    def __post_init__(self):
        # One memory layout, so that each kernel is compiled for one signature; a copy, so
        # that the map keeps what was checked.
        object.__setattr__(self, "anomaly", _nodes("anomaly", self.anomaly).copy())
        object.__setattr__(self, "spacing", number("spacing", self.spacing, above=0))
        if self.centre is not None:
            object.__setattr__(self, "centre", _place("centre", self.centre))

    @classmethod
    def from_mgal(
        cls,
        anomaly_mgal: ArrayLike,
        spacing: float,
        *,
        name: str,
        source: str,
        centre: tuple[float, float] | None = None,
    ) -> Self:
        """Map of values in mGal, rounded to a millionth of a milligal.

        The Fourier transforms and splines behind a map differ in their last digit between
        machines, and a planner that meets two equal costs would turn such a digit into
        another path. The rounding, far below any gravimeter, takes it away.

        Parameters
        ----------
        anomaly_mgal : array (north, east)
            Anomaly, mGal.
        spacing, name, source, centre
            As for the class.

        Returns
        -------
        GravityMap

        Raises
        ------
        ParameterError
            As the class.
        """
        rounded = np.round(_nodes("anomaly_mgal", anomaly_mgal), 6)
        return cls(rounded * MGAL, spacing, name, source, centre)

    @property
    def anomaly_mgal(self) -> np.ndarray:
        """Anomaly in mGal, shape (north, east)."""
        return self.anomaly / MGAL

    @property
    def extent(self) -> tuple[float, ...]:
        """Length of the map's sides (east, north), m."""
        north, east = self.anomaly.shape
        return (east - 1) * self.spacing, (north - 1) * self.spacing


def _nodes(name, value):
    """Return a checked grid (north, east) of at least 3 × 3 finite values."""
    grid = array(name, value, ("north", "east"))
    if min(grid.shape) < 3:
        raise ParameterError(name, grid.shape, "must have at least 3 × 3 nodes")
    return grid


def _place(name, value):
    """Return a checked (latitude, longitude), degrees, away from the poles."""
    latitude, longitude = array(name, value, (2,)).tolist()
    return number(f"latitude of {name}", latitude, at_least=-89, at_most=89), longitude


def gradient(gravity_map: GravityMap) -> np.ndarray:
    """Gradient of the anomaly at the nodes, by differences.

    Central differences inside, second-order one-sided differences on the border; exact for
    a quadratic surface.

    Parameters
    ----------
    gravity_map : GravityMap

    Returns
    -------
    array (2, north, east)
        ∂h/∂east, then ∂h/∂north, s⁻².

    Raises
    ------
    ParameterError
        If it is no `GravityMap`.
    """
    if not isinstance(gravity_map, GravityMap):
        raise ParameterError("gravity_map", gravity_map, "must be a GravityMap")
    d_north, d_east = np.gradient(gravity_map.anomaly, gravity_map.spacing, edge_order=2)
    return np.stack([d_east, d_north])


@kernel
def _bilinear(grid, spacing, east, north):
    """Value of a grid at one point, between its four neighbours.

    A point off the grid gets the value of the nearest point on its border; a NaN coordinate
    gives NaN.

    Parameters
    ----------
    grid : array (north, east)
        Nodal values, float64, C-contiguous.
    spacing : float
        Distance between nodes, m.
    east, north : float
        Point, m from the lower left corner.

    Returns
    -------
    float
        In the unit of the grid.
    """
    if np.isnan(east) or np.isnan(north):
        return np.nan  # as an integer it would index anywhere
    rows, columns = grid.shape
    y = min(max(north / spacing, 0.0), rows - 1.0)
    x = min(max(east / spacing, 0.0), columns - 1.0)
    i = min(int(y), rows - 2)
    j = min(int(x), columns - 2)
    y -= i
    x -= j
    low = (1.0 - x) * grid[i, j] + x * grid[i, j + 1]
    high = (1.0 - x) * grid[i + 1, j] + x * grid[i + 1, j + 1]
    return (1.0 - y) * low + y * high


@kernel
def _bilinear_many(grids, spacing, points, values):
    for n in range(points.shape[0]):
        for k in range(grids.shape[0]):
            values[n, k] = _bilinear(grids[k], spacing, points[n, 0], points[n, 1])


def interpolate(grid: ArrayLike, spacing: float, points: ArrayLike) -> np.ndarray:
    """Bilinear values of a grid, or of each grid of a stack, at many points.

    Parameters
    ----------
    grid : array (north, east) or (layers, north, east)
        Nodal values, such as `GravityMap.anomaly` or what `gradient` returns.
    spacing : float
        Distance between nodes, m.
    points : array (..., 2)
        East and north, m from the lower left corner. A point off the grid gets the value
        of the nearest point on its border.

    Returns
    -------
    array (...) or (..., layers)
        In the unit of the grid; for a gradient the last axis is (∂h/∂east, ∂h/∂north).

    Raises
    ------
    ParameterError
        If shapes do not fit, a value is not finite, the grid has fewer than 2 × 2 nodes, or
        the spacing is not positive.
    """
    several = checks.dimensions(grid) > 2
    grid = array("grid", grid, ("layers", "north", "east") if several else ("north", "east"))
    if min(grid.shape[-2:]) < 2:
        raise ParameterError("grid", grid.shape, "must have at least 2 × 2 nodes")
    spacing = number("spacing", spacing, above=0)
    points = array("points", points, (..., 2))
    stack = grid if several else grid[None]
    values = np.empty((points.size // 2, len(stack)))
    _bilinear_many(stack, spacing, points.reshape(-1, 2), values)
    return values.reshape(points.shape[:-1] + grid.shape[:-2])


def _radii(latitude_deg):
    # Radii of curvature of paper 5: first order in the flattening.
    sin2 = np.sin(np.radians(latitude_deg)) ** 2
    meridian = EARTH_RADIUS * (1 - 2 * FLATTENING + 3 * FLATTENING * sin2)
    prime_vertical = EARTH_RADIUS * (1 + FLATTENING * sin2)
    return meridian, prime_vertical


def geodetic_to_local(
    latitude_deg: ArrayLike, longitude_deg: ArrayLike, centre: tuple[float, float]
) -> tuple:
    """East and north distance from a centre.

    Parameters
    ----------
    latitude_deg, longitude_deg : array (...)
        Points, degrees; any 360° turn of the longitude.
    centre : tuple of float
        (latitude, longitude), degrees.

    Returns
    -------
    east, north : array (...)
        Metres from the centre. Paper 5, (31)–(32).

    Raises
    ------
    ParameterError
        If a number is not finite, or a latitude beyond a pole.
    """
    centre = _place("centre", centre)
    latitude_deg = array("latitude_deg", latitude_deg, (...,), at_least=-90, at_most=90)
    longitude_deg = array("longitude_deg", longitude_deg, (...,))
    meridian, prime_vertical = _radii(centre[0])
    turn = longitude_deg - centre[1]
    turn = turn - 360.0 * np.round(turn / 360.0)
    east = np.radians(turn) * np.cos(np.radians(centre[0])) * prime_vertical
    north = np.radians(latitude_deg - centre[0]) * meridian
    return east, north


def local_to_geodetic(east: ArrayLike, north: ArrayLike, centre: tuple[float, float]) -> tuple:
    """Latitude and longitude of points given by their distance from a centre.

    The inverse of `geodetic_to_local`.

    Parameters
    ----------
    east, north : array (...)
        Metres from the centre.
    centre : tuple of float
        (latitude, longitude), degrees.

    Returns
    -------
    latitude_deg, longitude_deg : array (...)
        Degrees; the longitude within 180° of the centre's.

    Raises
    ------
    ParameterError
        If a number is not finite, or the centre at a pole.
    """
    centre = _place("centre", centre)
    east, north = array("east", east, (...,)), array("north", north, (...,))
    meridian, prime_vertical = _radii(centre[0])
    latitude = centre[0] + np.degrees(north / meridian)
    across = np.cos(np.radians(centre[0])) * prime_vertical
    return latitude, centre[1] + np.degrees(east / across)


def square_nodes(centre: tuple[float, float], size: int, spacing: float) -> tuple[np.ndarray, ...]:
    """Latitudes of the rows and longitudes of the columns of a square map.

    Parameters
    ----------
    centre : tuple of float
        (latitude, longitude) of the middle of the map, degrees.
    size : int
        Nodes per side.
    spacing : float
        Distance between nodes, m.

    Returns
    -------
    latitude_deg, longitude_deg : array (size,)
        Degrees, by `local_to_geodetic`.

    Raises
    ------
    ParameterError
        If a number is not usable; a side has at most `MOST_NODES` nodes.
    """
    size = integer("size", size, at_least=1, at_most=MOST_NODES)
    spacing = number("spacing", spacing, above=0)
    offset = (np.arange(size) - (size - 1) / 2) * spacing
    return local_to_geodetic(offset, offset, centre)
