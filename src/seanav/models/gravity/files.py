"""A user's own gravity grid: NetCDF or GeoTIFF, resampled to the kilometre grid."""

import contextlib
import os
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import netCDF4
import numpy as np
import rasterio
from rasterio.errors import NotGeoreferencedWarning, RasterioError
from rasterio.warp import transform
from scipy.interpolate import RectBivariateSpline

from seanav.checks import ParameterError, choice, integer, number
from seanav.models.gravity.map import MOST_NODES, GravityMap, square_nodes
from seanav.models.units import MGAL

# Free-air anomalies at sea stay within some hundred mGal, and 100 km of sea floor flatter
# than a tenth of a milligal does not exist; values in m/s² taken for mGal are that flat.
LARGEST_MGAL = 1000.0
SMALLEST_RANGE_MGAL = 0.1

_UNITS = {
    f"{prefix}{unit}": factor * size
    for prefix, factor in (("", 1.0), ("c", 1e-2), ("m", 1e-3), ("u", 1e-6), ("n", 1e-9))
    for unit, size in (("m/s2", 1.0), ("m/s/s", 1.0), ("ms-2", 1.0), ("gal", 1e-2))
} | {"milligal": MGAL, "milligals": MGAL, "mgals": MGAL, "microgal": 1e-6 * 1e-2}

# What a user may say of a file that does not say it itself.
MAP_UNITS = ("file", "mGal", "m/s2", "µGal", "uGal")

# Another installation's GDAL and PROJ find their data by these, and rasterio would too.
_FOREIGN = ("PROJ_LIB", "PROJ_DATA", "GDAL_DATA")

_LATITUDE_NAMES = ("lat", "latitude", "y")
_LONGITUDE_NAMES = ("lon", "longitude", "x")


@dataclass(frozen=True)
class _Grid:
    # What both formats are reduced to: values on two axes, read a block at a time.
    label: str
    unit: str
    y: np.ndarray
    x: np.ndarray
    geographic: bool  # axes are latitude and longitude in degrees
    read: Callable  # (row slice, column slice) -> float64 block, NaN where there is no value
    locate: Callable  # (latitude, longitude) -> (y, x)


def _select(source, variable, candidates):
    # The one candidate, or the one that was asked for.
    names = ", ".join(map(repr, candidates))
    if variable is None or variable == "":
        if len(candidates) == 1:
            return candidates[0]
        allowed = f"must name one of {names}: {source} holds several grids"
        raise ParameterError("map_variable", variable, allowed)
    if str(variable) not in candidates:
        raise ParameterError("map_variable", variable, f"must be one of {names}, in {source}")
    return str(variable)


def _netcdf_axis(dataset, names):
    for variable in dataset.variables.values():
        numeric = getattr(variable.dtype, "kind", "O") in "iuf"
        if variable.name.lower() in names and variable.ndim == 1 and numeric:
            return variable
    return None


@contextlib.contextmanager
def _open_netcdf(source, variable):
    with netCDF4.Dataset(source) as dataset:
        latitude = _netcdf_axis(dataset, _LATITUDE_NAMES)
        longitude = _netcdf_axis(dataset, _LONGITUDE_NAMES)
        if latitude is None or longitude is None:
            needs = "one-dimensional lat and lon, latitude and longitude, or y and x"
            raise ParameterError("map_source", source, f"must be a grid with {needs}")
        axes = latitude.dimensions + longitude.dimensions
        candidates = [
            v.name
            for v in dataset.variables.values()
            if set(axes) <= set(v.dimensions)
            and getattr(v.dtype, "kind", "O") in "iuf"
            and all(n == 1 for d, n in zip(v.dimensions, v.shape, strict=True) if d not in axes)
        ]
        if not candidates or axes[0] == axes[1]:
            allowed = f"must be a grid: no variable lies on {latitude.name} and {longitude.name}"
            raise ParameterError("map_source", source, allowed)
        values = dataset[_select(source, variable, candidates)]

        y, x = (np.ma.filled(axis[:].astype(float), np.nan) for axis in (latitude, longitude))
        units = [str(getattr(axis, "units", "degrees")).lower() for axis in (latitude, longitude)]
        degrees = all(unit.startswith("degree") for unit in units)
        if not (degrees and np.all(np.abs(y) <= 90.01) and np.all(np.abs(x - 90) <= 270.01)):
            allowed = f"must have {latitude.name} and {longitude.name} in degrees"
            raise ParameterError("map_source", source, allowed)
        if min(len(y), len(x)) < 2:
            allowed = f"must have two values or more on {latitude.name} and {longitude.name}"
            raise ParameterError("map_source", source, allowed)

        def read(rows, columns):
            index = tuple({axes[0]: rows, axes[1]: columns}.get(d, 0) for d in values.dimensions)
            # Packing and fill values are undone by netCDF4.
            block = np.ma.filled(values[index].astype(float), np.nan)
            transposed = values.dimensions.index(axes[0]) > values.dimensions.index(axes[1])
            return block.T if transposed else block

        yield _Grid(
            values.name,
            str(getattr(values, "units", "")),
            y,
            x,
            True,
            read,
            lambda lat, lon: (lat, lon),
        )


@contextlib.contextmanager
def _own_data():
    # Without the variables rasterio takes the data of the version that it came with.
    theirs = {name: os.environ.pop(name) for name in _FOREIGN if name in os.environ}
    try:
        yield
    finally:
        os.environ.update(theirs)


def _band(source, variable, dataset):
    # Number and name of a band. Its number always serves, its description if it is the only
    # one of that text.
    texts = dataset.descriptions
    names = [
        text if text and texts.count(text) == 1 else str(band)
        for band, text in enumerate(texts, start=1)
    ]
    numbers = [str(band) for band in range(1, dataset.count + 1)]
    if str(variable) in numbers and str(variable) not in names:
        return int(variable), names[int(variable) - 1]
    label = _select(source, variable, names)
    return names.index(label) + 1, label


@contextlib.contextmanager
def _open_geotiff(source, variable):
    with _own_data(), _placed_geotiff(source, variable) as grid:
        yield grid


@contextlib.contextmanager
def _placed_geotiff(source, variable):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)  # said below, as an error
        dataset = rasterio.open(source)
    with dataset:
        matrix = dataset.transform
        placed = dataset.crs and (dataset.crs.is_geographic or dataset.crs.is_projected)
        if not placed or matrix.b != 0 or matrix.d != 0:
            needs = "a geographic or projected reference system, and rows that run along its x axis"
            raise ParameterError("map_source", source, f"must have {needs}")
        band, label = _band(source, variable, dataset)
        scale, offset = dataset.scales[band - 1], dataset.offsets[band - 1]

        def read(rows, columns):
            window = ((rows.start, rows.stop), (columns.start, columns.stop))
            block = dataset.read(band, window=window, masked=True).astype(float)
            return np.ma.filled(block * scale + offset, np.nan)

        def locate(latitude, longitude):
            x, y = transform("EPSG:4326", dataset.crs, longitude.ravel(), latitude.ravel())
            return np.reshape(y, latitude.shape), np.reshape(x, latitude.shape)

        yield _Grid(
            label,
            dataset.units[band - 1] or "",
            matrix.f + matrix.e * (np.arange(dataset.height) + 0.5),
            matrix.c + matrix.a * (np.arange(dataset.width) + 0.5),
            dataset.crs.is_geographic,
            read,
            locate,
        )


def _open(source, variable):
    with open(source, "rb") as file:
        start = file.read(4)
    if start.startswith(b"CDF") or start == b"\x89HDF":
        return _open_netcdf(source, variable)
    if start in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        return _open_geotiff(source, variable)
    raise ParameterError("map_source", source, "must be a NetCDF or GeoTIFF grid")


def _covering(axis, low, high, margin):
    # Indices of the axis, in rising order, that enclose [low, high]; None if it does not.
    order = np.argsort(axis)
    step = np.median(np.diff(axis[order]))
    # A global grid may hold the same meridian twice, as −180° and 180°.
    order = order[np.diff(axis[order], prepend=-np.inf) > 1e-3 * step]
    values = axis[order]
    slack = 1e-6 * step
    if len(values) < 2 or low < values[0] - slack or high > values[-1] + slack:
        return None
    first = np.searchsorted(values, low + slack, side="right") - 1
    last = np.searchsorted(values, high - slack, side="left")
    if np.max(np.diff(values[first : last + 1])) > 1.5 * step:
        return None  # a gap, such as the one between the ends of a regional grid
    return order[max(first - margin, 0) : last + margin + 1]


def _read(grid, rows, columns):
    # Indices may run backwards, and across the ±180° meridian round the whole band: one
    # block holds them all, the rest is dropped.
    spans = [slice(int(k.min()), int(k.max()) + 1) for k in (rows, columns)]
    return grid.read(*spans)[np.ix_(rows - rows.min(), columns - columns.min())]


def _sample(grid, source, latitude, longitude):
    # Values at the nodes, in the unit of the file.
    y, x = grid.locate(*np.meshgrid(latitude, longitude, indexing="ij"))
    axis = grid.x
    if grid.geographic:
        # Count longitude from the middle of the window, whatever turn the file is in.
        middle = longitude[len(longitude) // 2]
        axis, x = ((a - middle + 180.0) % 360.0 - 180.0 for a in (axis, x))
    for margin in (3, 0):  # the spline likes neighbours, but they may be land
        rows = _covering(grid.y, y.min(), y.max(), margin)
        columns = _covering(axis, x.min(), x.max(), margin)
        if rows is None or columns is None:
            allowed = (
                f"must cover {latitude[0]:.2f}…{latitude[-1]:.2f}° N, "
                f"{longitude[0]:.2f}…{longitude[-1]:.2f}° E without a gap; it spans "
                f"{grid.y.min():g}…{grid.y.max():g} by {grid.x.min():g}…{grid.x.max():g}"
            )
            raise ParameterError("map_source", source, allowed)
        values = _read(grid, rows, columns)
        missing = np.count_nonzero(~np.isfinite(values))
        if not missing:
            break
    else:
        allowed = f"must have a value at every node of the window; {grid.label} lacks {missing}"
        raise ParameterError("map_source", source, allowed)
    order = [min(3, len(index) - 1) for index in (rows, columns)]
    spline = RectBivariateSpline(grid.y[rows], axis[columns], values, kx=order[0], ky=order[1])
    return spline.ev(y, x)


def _spelled(unit):
    # µ has two code points; exponents and products have many spellings.
    same = str.maketrans("µμ²⁻", "uu2-", " ^*.·()")
    return unit.strip().lower().translate(same)


def _in_mgal(values, unit, map_unit, source, label):
    known, said = _spelled(unit), _spelled(map_unit)
    if map_unit != "file":
        if known in _UNITS and _UNITS[known] != _UNITS[said]:
            allowed = f"must be 'file': {label} has the unit {unit!r}"
            raise ParameterError("map_unit", map_unit, allowed)
        known, unit = said, map_unit
    if known and known not in _UNITS:
        allowed = (
            f"must be in mGal or m/s² (or a prefix of them), or map_unit must name its unit; "
            f"{label} has the unit {unit!r}"
        )
        raise ParameterError("map_source", source, allowed)
    values = values * (_UNITS[known] / MGAL if known else 1.0)
    largest, spread = np.max(np.abs(values)), np.ptp(values)
    if largest > LARGEST_MGAL or spread < SMALLEST_RANGE_MGAL:
        allowed = (
            f"must be an anomaly in mGal, within ±{LARGEST_MGAL:g} and spread over at least "
            f"{SMALLEST_RANGE_MGAL:g}; {label} spans {values.min():.4g} to {values.max():.4g} "
            f"(unit {unit or 'not stated'})"
        )
        raise ParameterError("map_source", source, allowed)
    return values


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

    NetCDF 3 or 4 (HDF5) with one-dimensional ``lat``/``lon``, ``latitude``/``longitude`` or
    ``y``/``x`` in degrees, rising or falling, 0…360° or ±180°; GeoTIFF in any coordinate
    reference system. Packed values and fill values are undone. Only the window is read, and
    resampled by a cubic spline.

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
        "file": the unit that the file states; if it states none, mGal is assumed, and values
        in µm/s² then pass unnoticed. Otherwise the unit of a file that states none, or one
        that is not known here.

    Returns
    -------
    GravityMap

    Raises
    ------
    ParameterError
        If the file is missing or not such a grid, holds several, does not cover the window
        without a hole, or is not in a unit of gravity, or in another one than `unit`.
    """
    latitude_deg = number("map_latitude_deg", latitude_deg, at_least=-80, at_most=80)
    longitude_deg = number("map_longitude_deg", longitude_deg, at_least=-180, at_most=360)
    size = integer("map_size", size, at_least=3, at_most=MOST_NODES)
    spacing = number("map_spacing", spacing, above=0)
    choice("map_unit", unit, MAP_UNITS)
    if not isinstance(path, str | os.PathLike) or not Path(path).is_file():
        allowed = "must be 'geoid', 'synthetic' or the path of an existing file"
        raise ParameterError("map_source", path, allowed)
    source = str(path)
    centre = (latitude_deg, longitude_deg)
    try:
        with _open(source, variable) as grid:
            values = _sample(grid, source, *square_nodes(centre, size, spacing))
            values = _in_mgal(values, grid.unit, unit, source, grid.label)
    except (OSError, RuntimeError, RasterioError) as error:
        # One line: the libraries' own messages may have several.
        cause = " ".join(str(error).split())
        raise ParameterError("map_source", source, f"must be readable: {cause}") from error
    name = Path(source).name
    return GravityMap.from_mgal(
        values, spacing, name=name, source=f"{name}, {grid.label}", centre=centre
    )
