"""A grid in a file, whatever its format: its axes, its reference system, what it covers."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from rasterio._err import CPLE_BaseError
from rasterio.errors import RasterioError
from rasterio.warp import transform

from seanav.checks import ParameterError

_DEGREES = "EPSG:4326"


@dataclass(frozen=True)
class Grid:
    """What every format is reduced to: values on two axes, read a block at a time.

    Parameters
    ----------
    source, label, unit : str
        The file, the variable or band, and the unit that the file states ("": none).
    y, x : array (rows,), array (columns,)
        The axes, in any order: latitude and longitude in degrees, or the coordinates of `crs`.
    read : function
        Of a slice of rows and one of columns: a float64 block, NaN where there is no value.
    crs : rasterio CRS or None
        Reference system of the axes; None for degrees of latitude and longitude.
    note : str
        What a reader should know who misses values.
    """

    source: str
    label: str
    unit: str
    y: np.ndarray
    x: np.ndarray
    read: Callable
    crs: Any = None
    note: str = ""

    def locate(self, latitude: np.ndarray, longitude: np.ndarray) -> tuple:
        """Return (y, x) of points in degrees, on the grid's axes."""
        # NaN if any of them lies beyond the edge of the projection.
        if self.crs is None:
            return latitude, longitude
        return _transformed(_DEGREES, self.crs, latitude, longitude)

    def degrees(self, y: np.ndarray, x: np.ndarray) -> tuple:
        """Return (latitude, longitude) in degrees of points on the grid's axes."""
        if self.crs is None:
            return y, x
        return _transformed(self.crs, _DEGREES, y, x)

    def period(self, latitude: float) -> float:
        """Return after how much x the same meridian comes again, infinity if it never does."""
        if self.crs is None:
            return 360.0
        if self.crs.is_geographic:
            return 2 * np.pi / self.crs.units_factor[1]
        # On a cylinder the parallel is a straight line, evenly divided by the meridians; one
        # step, where the map is cut, is another.
        turn = np.arange(-180.0, 180.0)
        y, x = self.locate(np.full(360, latitude), turn)
        step = np.median(np.diff(x))
        uneven = np.abs(np.diff(x) - step) > 1e-6 * abs(step)
        straight = np.ptp(y) <= 1e-6 * abs(step) and np.count_nonzero(uneven) <= 1
        return 360.0 * abs(step) if straight else np.inf


def _transformed(source, target, y, x):
    y, x = np.broadcast_arrays(y, x)
    try:
        new_x, new_y = transform(source, target, np.ravel(x), np.ravel(y))
    except (CPLE_BaseError, RasterioError):  # some of them lie beyond the projection's edge
        return np.full(y.shape, np.nan), np.full(y.shape, np.nan)
    return np.reshape(new_y, y.shape), np.reshape(new_x, y.shape)


def select(source: str, variable: Any, candidates: list[str]) -> str:
    """Return the one candidate, or the one that was asked for, else raise `ParameterError`."""
    names = ", ".join(map(repr, candidates))
    if variable is None or variable == "":
        if len(candidates) == 1:
            return candidates[0]
        allowed = f"must name one of {names}: {source} holds several grids"
        raise ParameterError("map_variable", variable, allowed)
    if str(variable) not in candidates:
        raise ParameterError("map_variable", variable, f"must be one of {names}, in {source}")
    return str(variable)


def near(x: np.ndarray, middle: float, period: float) -> np.ndarray:
    """Return x by the turn that lies nearest to `middle`, counted from there."""
    if not np.isfinite(period):
        return x - middle
    return (x - middle + period / 2) % period - period / 2


def _steps(axis):
    # The order that makes an axis rise, its differences, and the usual one: places that occur
    # twice have none.
    order = np.argsort(axis, kind="stable")
    steps = np.diff(axis[order])
    moved = steps[steps > 1e-7 * np.ptp(axis)]
    return order, steps, np.median(moved) if len(moved) else 0.0


def covering(axis: np.ndarray, low: float, high: float, margin: int) -> tuple | None:
    """Find the part of an axis that encloses an interval.

    Parameters
    ----------
    axis : array (n,)
        Coordinates in any order.
    low, high : float
        The interval.
    margin : int
        Further places on each side, as far as there are any.

    Returns
    -------
    indices, starts : array (m,), array (places,), or None
        Indices of `axis` in rising order, and where in them each place begins: a place may
        occur twice. None if the interval is not covered without a gap.
    """
    order, steps, step = _steps(axis)
    starts = np.flatnonzero(np.append(True, steps > 1e-3 * step))
    places = axis[order][starts]
    slack = 1e-6 * step
    if len(places) < 2 or not (places[0] - slack <= low and high <= places[-1] + slack):
        return None
    first = np.searchsorted(places, low + slack, side="right") - 1
    last = np.searchsorted(places, high - slack, side="left")
    if np.max(np.diff(places[first : last + 1])) > 1.5 * step:
        return None  # a gap, such as the one between the ends of a regional grid
    first, last = max(first - margin, 0), min(last + margin, len(places) - 1)
    begin = starts[first]
    end = starts[last + 1] if last + 1 < len(starts) else len(order)
    return order[begin:end], starts[first : last + 1] - begin


def window(grid: Grid, nodes: tuple[np.ndarray, ...], margin: int) -> tuple | None:
    """Find what of a grid encloses the nodes of a map.

    Parameters
    ----------
    grid : Grid
    nodes : (array (n,), array (n,))
        Latitudes and longitudes along the sides of the map, degrees.
    margin : int
        Further rows and columns on each side, as far as there are any.

    Returns
    -------
    rows, columns, (y, x), axis, or None
        Each of the first two as `covering` returns it; the nodes, (n, n) each, and the
        columns' axis (columns,), with x counted from the middle of the map, whatever turn the
        file is in. None if the grid does not cover them.
    """
    y, x = grid.locate(*np.meshgrid(*nodes, indexing="ij"))
    if not (np.isfinite(y).all() and np.isfinite(x).all()):
        return None
    middle, period = x[len(x) // 2, len(x) // 2], grid.period(nodes[0][len(x) // 2])
    x, axis = near(x, middle, period), near(grid.x, middle, period)
    rows = covering(grid.y, y.min(), y.max(), margin)
    columns = covering(axis, x.min(), x.max(), margin)
    return None if rows is None or columns is None else (rows, columns, (y, x), axis)


def _ends(axis, period):
    # First and last place of an axis that may run round the earth: it begins after the widest
    # gap. The last may be counted a turn further on.
    if not np.isfinite(period):
        return axis.min(), axis.max()
    turned = np.sort(axis % period)
    gaps = np.diff(turned, append=turned[0] + period)
    widest = np.argmax(gaps)
    if gaps[widest] <= 1.5 * np.median(gaps[gaps > 1e-7 * period]):
        return axis.min(), axis.max()  # all the way round
    first = turned[(widest + 1) % len(turned)]
    return first, first + period - gaps[widest]


def extent(grid: Grid) -> tuple:
    """Return what a grid spans and its middle, in degrees.

    Parameters
    ----------
    grid : Grid

    Returns
    -------
    (south, north, west, east), (latitude, longitude)
        Degrees; the middle is rounded to 1e-4°, its longitude lies within ±180°.
    """
    low, high = grid.y.min(), grid.y.max()
    first, last = _ends(grid.x, grid.period(0.0))
    middle = grid.degrees(np.array([(low + high) / 2]), np.array([(first + last) / 2]))
    latitude, longitude = (float(a[0]) for a in middle)
    y, x = np.meshgrid(np.linspace(low, high, 9), np.linspace(first, last, 9), indexing="ij")
    north, east = grid.degrees(y, x)
    if grid.crs is not None:  # a projection back to degrees may have changed the turn
        east = longitude + near(east, longitude, 360.0)
    turn = longitude - near(np.array(longitude), 0.0, 360.0)
    spans = [f(a) for a in (north, east - turn) for f in (np.nanmin, np.nanmax)]
    return tuple(map(float, spans)), (round(latitude, 4), round(float(longitude - turn), 4))
