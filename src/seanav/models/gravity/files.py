"""A user's own gravity grid: NetCDF or GeoTIFF, resampled to the kilometre grid."""

import contextlib
import logging
import os
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rasterio.errors import RasterioError
from scipy.interpolate import RectBivariateSpline

from seanav.checks import ParameterError, choice, integer, number
from seanav.models.gravity.geotiff import open_geotiff
from seanav.models.gravity.grids import Grid, extent, window
from seanav.models.gravity.map import MOST_NODES, GravityMap, square_nodes
from seanav.models.gravity.netcdf import open_netcdf
from seanav.models.gravity.quality import MAP_UNITS, check_values, to_mgal

# Another installation's GDAL and PROJ find their data by these, and rasterio would too.
_FOREIGN = ("PROJ_LIB", "PROJ_DATA", "GDAL_DATA")


@contextlib.contextmanager
def _alone():
    # Without the variables rasterio takes the data of the version that it came with. And what
    # the libraries only warn of, such as tags of a camera, is no concern of a reader of maps.
    theirs = {name: os.environ.pop(name) for name in _FOREIGN if name in os.environ}
    log = logging.getLogger("rasterio")
    level = log.level
    log.setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        log.setLevel(level)
        os.environ.update(theirs)


def _opened(source, variable):
    with open(source, "rb") as file:
        start = file.read(4)
    if start.startswith(b"CDF") or start == b"\x89HDF":
        return open_netcdf(source, variable)
    if start in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        return open_geotiff(source, variable)
    raise ParameterError("map_source", source, "must be a NetCDF or GeoTIFF grid")


@contextlib.contextmanager
def _open(path: str | Path, variable: str | int | None) -> Iterator[Grid]:
    if not isinstance(path, str | os.PathLike) or not Path(path).is_file():
        allowed = "must be 'geoid', 'synthetic' or the path of an existing file"
        raise ParameterError("map_source", path, allowed)
    source = str(path)
    try:
        with _alone(), _opened(source, variable) as grid:
            yield grid
    except (OSError, RuntimeError, RasterioError) as error:
        # One line: the libraries' own messages may have several.
        cause = " ".join(str(error).split())
        raise ParameterError("map_source", source, f"must be readable: {cause}") from error


def _read(grid, rows, columns):
    # Indices may run backwards, and across the ±180° meridian round the whole band: one
    # block holds them all, the rest is dropped.
    spans = [slice(int(k.min()), int(k.max()) + 1) for k in (rows, columns)]
    return grid.read(*spans)[np.ix_(rows - rows.min(), columns - columns.min())]


def _single(values, starts, places, grid, what):
    # One row for each place: a gridline-registered globe holds one meridian twice.
    low, high = (f.reduceat(values, starts, axis=0) for f in (np.fmin, np.fmax))
    known = values[np.isfinite(values)]
    differ = high - low > 1e-4 * np.ptp(known) if known.size else np.zeros(low.shape, dtype=bool)
    if differ.any():
        place = places[starts][differ.any(axis=1)][0]
        allowed = f"must have each {what} once; {place:g} occurs twice, with different values"
        raise ParameterError("map_source", grid.source, allowed)
    return low


def _uncovered(grid, latitude, longitude):
    (south, north, west, east), middle = extent(grid)
    advice = "it is too small for the map"
    if abs(middle[0]) <= 80:
        side, spacing = len(latitude), np.diff(latitude)[0]
        offset = (np.arange(side) - (side - 1) / 2) * spacing
        stretch = np.cos(np.radians(latitude[side // 2])) / np.cos(np.radians(middle[0]))
        wide = (longitude - longitude.mean()) * stretch
        if window(grid, (middle[0] + offset, middle[1] + wide), 0) is not None:
            advice = (
                f"its middle is map_latitude_deg = {middle[0]:g}, map_longitude_deg = {middle[1]:g}"
            )
    allowed = (
        f"must cover {latitude[0]:.2f}…{latitude[-1]:.2f}° N, "
        f"{longitude[0]:.2f}…{longitude[-1]:.2f}° E without a gap; it spans "
        f"{south:.2f}…{north:.2f}° N, {west:.2f}…{east:.2f}° E; {advice}"
    )
    return ParameterError("map_source", grid.source, allowed)


def _sample(grid, factor, nodes):
    # Values at the nodes, mGal; the factor is that from the unit of the file.
    for margin in (3, 0):  # the spline likes neighbours, but they may be land
        found = window(grid, nodes, margin)
        if found is None:
            raise _uncovered(grid, *nodes)
        (rows, row_starts), (columns, column_starts), (y, x), axis = found
        values = _read(grid, rows, columns) * factor
        names = ("y", "x") if grid.crs is not None else ("latitude", "longitude")
        values = _single(values, row_starts, grid.y[rows], grid, names[0])
        values = _single(values.T, column_starts, grid.x[columns], grid, names[1]).T
        rows, columns = rows[row_starts], columns[column_starts]
        missing = np.count_nonzero(~np.isfinite(values))
        if not missing:
            break
    else:
        note = f"; {grid.note}" if grid.note else ""
        allowed = f"must have a value at every node of the window; {grid.label} lacks {missing}"
        raise ParameterError("map_source", grid.source, allowed + note)
    check_values(grid, values, grid.y[rows], grid.x[columns])
    order = [min(3, len(index) - 1) for index in (rows, columns)]
    spline = RectBivariateSpline(grid.y[rows], axis[columns], values, kx=order[0], ky=order[1])
    return spline.ev(y, x)


def centre(
    path: str | Path,
    latitude_deg: float,
    longitude_deg: float,
    size: int = 101,
    spacing: float = 1000.0,
    variable: str | int | None = None,
) -> tuple[float, float]:
    """Centre of a map that a file can give: the wanted one, or else the middle of the file.

    Parameters
    ----------
    path, latitude_deg, longitude_deg, size, spacing, variable
        As of `from_file`.

    Returns
    -------
    latitude_deg, longitude_deg : float
        Degrees. The wanted centre if the file covers the map around it, or covers none around
        its own middle either; else that middle, rounded to 1e-4°.

    Raises
    ------
    ParameterError
        As `from_file`, if the file cannot be opened as a grid.
    """
    wanted = (float(latitude_deg), float(longitude_deg))
    with _open(path, variable) as grid:
        if window(grid, square_nodes(wanted, size, spacing), 0) is None:
            _, middle = extent(grid)
            fits = abs(middle[0]) <= 80
            if fits and window(grid, square_nodes(middle, size, spacing), 0) is not None:
                return middle
    return wanted


def from_file(
    path: str | Path,
    latitude_deg: float,
    longitude_deg: float,
    size: int = 101,
    spacing: float = 1000.0,
    variable: str | int | None = None,
    unit: str = "file",
) -> GravityMap:
    """Gravity map cut from a grid in a file.

    NetCDF 3 or 4 (HDF5) or GeoTIFF, in degrees, rising or falling, by any turn, or in any
    reference system that the file states. The coordinates of a NetCDF file are found by the
    CF conventions, then by their names, see `seanav.models.gravity.coordinates`. Packed values
    and fill values are undone. Only the window is read, and resampled by a cubic spline.

    Parameters
    ----------
    path : str or path
        The file.
    latitude_deg, longitude_deg : float
        Middle of the map, degrees (WGS 84).
    size : int
        Nodes per side.
    spacing : float
        Distance between nodes, m.
    variable : str, optional
        Variable of a NetCDF file, or band of a GeoTIFF by its number, from 1, or its
        description; needed if there are several.
    unit : {"file", "mGal", "m/s2", "µGal", "uGal"}
        "file": the unit that the file states, which it must. Otherwise the unit of a file
        that states none, or one that is not known here.

    Returns
    -------
    GravityMap

    Raises
    ------
    ParameterError
        If the file is missing or not such a grid, holds several, does not say what or where
        it is, says it in two ways that differ, does not cover the window without a hole, is
        not in a unit of gravity, or in another one than `unit`, or holds values that no
        anomaly has (`seanav.models.gravity.quality`).
    """
    latitude_deg = number("map_latitude_deg", latitude_deg, at_least=-80, at_most=80)
    longitude_deg = number("map_longitude_deg", longitude_deg, at_least=-180, at_most=360)
    size = integer("map_size", size, at_least=3, at_most=MOST_NODES)
    spacing = number("map_spacing", spacing, above=0)
    choice("map_unit", unit, MAP_UNITS)
    place = (latitude_deg, longitude_deg)
    with _open(path, variable) as grid:
        factor = to_mgal(grid, unit)
        values = _sample(grid, factor, square_nodes(place, size, spacing))
        label = grid.label
    name = Path(path).name
    return GravityMap.from_mgal(values, spacing, name=name, source=f"{name}, {label}", centre=place)
