"""Paper 5: a user's own path from a file onto the map, and a built-in one."""

import numpy as np

from seanav.checks import ParameterError
from seanav.models import gravity, paths
from seanav.models.units import KM
from seanav.records import opened, read_csv
from seanav.records.gpx import read_gpx

LAYOUTS = (("east_km", "north_km"), ("latitude_deg", "longitude_deg"))
BOUNDS = {
    # Wide: a place beside the map is refused with a word on what may be wrong with it.
    "east_km": (-1e7, 1e7),
    "north_km": (-1e7, 1e7),
    "latitude_deg": (-360.0, 360.0),
    "longitude_deg": (-360.0, 360.0),
}


def read(name: str, path: str, chart: gravity.GravityMap) -> np.ndarray:
    """Return the corners of the path in a file, (corners, 2) east and north on the map, m.

    Parameters
    ----------
    name, path : str
        Parameter and value: a table (CSV) with ``east_km, north_km`` from the map's lower left
        corner or with ``latitude_deg, longitude_deg``, or a GPX file with one track or route.
    chart : GravityMap

    Raises
    ------
    ParameterError
        As `seanav.records.read_csv` and `seanav.records.gpx.read_gpx`; with its row, if a
        place is not on the map; if the path has no length, or degrees meet a map of no place.
    """
    if opened(name, path).lstrip().startswith("<") or path.lower().endswith(".gpx"):
        record = read_gpx(name, path)
    else:
        record = read_csv(name, path, LAYOUTS, bounds=BOUNDS, time=False)
    corners = _on_map(record, chart)
    if paths.length(corners) == 0:
        allowed = "must lead from one place to another; all its points are the same"
        raise ParameterError(name, record.source, allowed)
    return corners


def _on_map(record, chart):
    if "east_km" in record.columns:
        corners = np.column_stack([record["east_km"], record["north_km"]]) * KM
        large = np.abs(corners).max() > 10 * max(chart.extent)  # not just beside the map
        others = {"are they metres?": corners / KM} if large else {}
    else:
        if chart.centre is None:
            allowed = "must have the columns east_km, north_km: this map has no place on Earth"
            raise ParameterError(record.name, record.source, allowed)
        places = record["latitude_deg"], record["longitude_deg"]
        corners, swapped = _local(*places, chart), _local(*places[::-1], chart)
        others = {"are latitude and longitude swapped?": swapped}
    off = ~_inside(corners, chart)
    if not off.any():
        return corners
    k = int(np.argmax(off))
    hint = [words for words, guess in others.items() if _inside(guess, chart).all()]
    place = ", ".join(f"{column} = {x[k]:g}" for column, x in record.columns.items())
    where = f"{place}: must lie on the map, {_sides(record, chart)}"
    raise record.refuse(k, "; ".join([where, *hint]))


def _inside(corners, chart):
    return ((corners >= 0) & (corners <= chart.extent)).all(axis=1)


def _local(latitude, longitude, chart):
    known = np.abs(latitude) <= 90  # others are far from every map
    east, north = gravity.geodetic_to_local(np.where(known, latitude, 0.0), longitude, chart.centre)
    there = np.column_stack([east, north]) + np.array(chart.extent) / 2
    return np.where(known[:, None], there, np.inf)


def _sides(record, chart):
    half = np.array(chart.extent) / 2
    if "east_km" in record.columns:
        east, north = 2 * half / KM
        return f"0 … {east:g} km east and 0 … {north:g} km north"
    ends = (gravity.local_to_geodetic(*(sign * half), chart.centre) for sign in (-1, 1))
    (south, west), (north, east) = ends
    return f"latitude {south:.3f} … {north:.3f}, longitude {west:.3f} … {east:.3f}"


def zigzag(start: np.ndarray, goal: np.ndarray, extent: tuple, amplitude: float) -> np.ndarray:
    """Return a path that tacks from `start` to `goal`, (8, 2) m; off the map it hugs the border.

    Parameters
    ----------
    start, goal : (2,) ndarray
        East and north, m.
    extent : tuple of float
        Sides of the map, m.
    amplitude : float
        Distance of the turns from the straight line, m.
    """
    along = goal - start
    side = np.array([-along[1], along[0]]) / np.hypot(*along)
    shares = np.array([0.0, *np.arange(1, 12, 2) / 12, 1.0])
    turns = amplitude * np.array([0.0, *[1.0, -1.0] * 3, 0.0])
    return np.clip(start + shares[:, None] * along + turns[:, None] * side, 0.0, extent)
