"""Places in order, from the one track or route of a GPX file (GPS exchange format, 1.0 or 1.1)."""

import re
from pathlib import Path

import gpxpy
import gpxpy.gpx
import numpy as np

from seanav.checks import ParameterError
from seanav.records.table import Record, opened

MOST_BYTES = 20 * 2**20
NAMESPACE = re.compile(r"<(\w+):gpx\b")


def read_gpx(name: str, path: str, *, least: int = 2) -> Record:
    """Read the one track or route of a user's GPX file; segments of a track are joined.

    Times, heights and waypoints are left alone.

    Parameters
    ----------
    name, path : str
        Parameter and value, for the errors.
    least : int
        Fewest points.

    Returns
    -------
    Record
        Columns ``latitude_deg`` and ``longitude_deg``; `time` counts the points.

    Raises
    ------
    ParameterError
        One line: if the file is no GPX, holds none or several tracks and routes, or too few
        points, or, with its row, a point is not on Earth.

    References
    ----------
    GPX 1.1 schema, https://www.topografix.com/GPX/1/1/
    """
    text, source = opened(name, path, MOST_BYTES), Path(path).name
    if re.search(r"<!(DOCTYPE|ENTITY)", text):  # GPX has none; entities can be made to explode
        raise ParameterError(name, source, "must be GPX; it has a document type of its own")
    if found := NAMESPACE.search(text):
        text = re.sub(rf"(</?){found[1]}:", r"\1", text)  # gpxpy knows names without prefix only
    try:
        gpx = gpxpy.parse(text)
    except (gpxpy.gpx.GPXException, ValueError) as error:
        raise ParameterError(name, source, f"must be GPX: {_of_gpxpy(error)}") from None
    points = _points(name, source, gpx)
    if len(points) < least:
        allowed = f"must have a track or route of at least {least} points, has {len(points)}"
        raise ParameterError(name, source, allowed)
    columns = {
        "latitude_deg": np.array([point.latitude for point in points], dtype=float),
        "longitude_deg": np.array([point.longitude for point in points], dtype=float),
    }
    record = Record(name, source, np.arange(len(points), dtype=float), columns, _rows(text, points))
    for column, low, high in (("latitude_deg", -90, 90), ("longitude_deg", -360, 360)):
        inside = (record[column] >= low) & (record[column] <= high)  # not a number: neither
        if not inside.all():
            k = int(np.argmin(inside))
            allowed = f"{column} = {record[column][k]:g}: must be from {low} to {high}"
            raise record.refuse(k, allowed)
    return record


def _points(name, source, gpx):
    ways = [[p for segment in track.segments for p in segment.points] for track in gpx.tracks]
    ways += [list(route.points) for route in gpx.routes]
    ways = [way for way in ways if way]
    if len(ways) == 1:
        return ways[0]
    has = f"has {len(gpx.tracks)} tracks and {len(gpx.routes)} routes"
    if not ways and gpx.waypoints:
        has = f"has {len(gpx.waypoints)} waypoints, which have no order"
    elif not ways:
        has = "has none with points"
    raise ParameterError(name, source, f"must hold one track or one route; {has}")


def _rows(text, points):
    # gpxpy forgets the lines; what is commented out has none of the points.
    plain = re.sub(r"<!--.*?-->", lambda found: "\n" * found[0].count("\n"), text, flags=re.DOTALL)
    ends = [found.start() for found in re.finditer("\n", plain)]
    starts = [found.start() for found in re.finditer(r"<(?:trkpt|rtept)[\s/>]", plain)]
    if len(starts) != len(points):
        return np.arange(1, len(points) + 1)
    return np.searchsorted(ends, starts) + 1


def _of_gpxpy(error):
    words = " ".join(str(error).split())
    found = re.match(r"Invalid value for <\w+>\.\.\. (.*) \(", words)
    if found:
        return f"{found[1]!r} must be a number"
    if re.match(r"(latitude|longitude) is mandatory", words):
        return f"a point has no {words.split()[0]}"
    return words.removeprefix("Error parsing XML: ")
