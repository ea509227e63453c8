"""Gravity anomaly on a flat kilometre grid, and how to read it between the nodes."""

from dataclasses import dataclass

import numpy as np

from seanav._compile import kernel
from seanav.checks import ParameterError, number

MGAL = 1e-5  # m/s²

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
        # One memory layout, so that each kernel is compiled for one signature.
        anomaly = np.array(self.anomaly, dtype=np.float64, order="C")
        if anomaly.ndim != 2 or min(anomaly.shape) < 3:
            raise ParameterError("anomaly", anomaly.shape, "must have at least 3 × 3 nodes")
        missing = np.count_nonzero(~np.isfinite(anomaly))
        if missing:
            raise ParameterError("anomaly", f"{missing} nodes", "must be finite at every node")
        object.__setattr__(self, "anomaly", anomaly)
        object.__setattr__(self, "spacing", number("spacing", self.spacing, above=0))

    @classmethod
    def from_mgal(cls, anomaly_mgal, spacing, *, name, source, centre=None):
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
        """
        return cls(np.round(anomaly_mgal, 6) * MGAL, spacing, name, source, centre)

    @property
    def anomaly_mgal(self):
        """Anomaly in mGal, shape (north, east)."""
        return self.anomaly / MGAL

    @property
    def extent(self):
        """Length of the map's sides (east, north), m."""
        north, east = self.anomaly.shape
        return (east - 1) * self.spacing, (north - 1) * self.spacing


def gradient(gravity_map):
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
    """
    d_north, d_east = np.gradient(gravity_map.anomaly, gravity_map.spacing, edge_order=2)
    return np.stack([d_east, d_north])


@kernel
def bilinear(grid, spacing, east, north):
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
            values[n, k] = bilinear(grids[k], spacing, points[n, 0], points[n, 1])


def interpolate(grid, spacing, points):
    """Bilinear values of a grid, or of each grid of a stack, at many points.

    Parameters
    ----------
    grid : array (north, east) or (layers, north, east)
        Nodal values, such as `GravityMap.anomaly` or what `gradient` returns.
    spacing : float
        Distance between nodes, m.
    points : array (..., 2)
        East and north, m from the lower left corner; off the grid as in `bilinear`.

    Returns
    -------
    array (...) or (..., layers)
        In the unit of the grid; for a gradient the last axis is (∂h/∂east, ∂h/∂north).
    """
    grid = np.ascontiguousarray(grid, dtype=np.float64)
    points = np.asarray(points, dtype=np.float64)
    stack = grid if grid.ndim == 3 else grid[None]
    values = np.empty((points.size // 2, len(stack)))
    _bilinear_many(stack, float(spacing), np.ascontiguousarray(points.reshape(-1, 2)), values)
    return values.reshape(points.shape[:-1] + grid.shape[:-2])


def _radii(latitude_deg):
    # Radii of curvature of paper 5: first order in the flattening.
    sin2 = np.sin(np.radians(latitude_deg)) ** 2
    meridian = EARTH_RADIUS * (1 - 2 * FLATTENING + 3 * FLATTENING * sin2)
    prime_vertical = EARTH_RADIUS * (1 + FLATTENING * sin2)
    return meridian, prime_vertical


def geodetic_to_local(latitude_deg, longitude_deg, centre):
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
    """
    meridian, prime_vertical = _radii(centre[0])
    turn = np.asarray(longitude_deg, dtype=np.float64) - centre[1]
    turn = turn - 360.0 * np.round(turn / 360.0)
    east = np.radians(turn) * np.cos(np.radians(centre[0])) * prime_vertical
    north = np.radians(np.asarray(latitude_deg, dtype=np.float64) - centre[0]) * meridian
    return east, north


def local_to_geodetic(east, north, centre):
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
    """
    meridian, prime_vertical = _radii(centre[0])
    latitude = centre[0] + np.degrees(np.asarray(north, dtype=np.float64) / meridian)
    across = np.cos(np.radians(centre[0])) * prime_vertical
    return latitude, centre[1] + np.degrees(np.asarray(east, dtype=np.float64) / across)


def square_nodes(centre, size, spacing):
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
    """
    offset = (np.arange(size) - (size - 1) / 2) * spacing
    return local_to_geodetic(offset, offset, centre)
