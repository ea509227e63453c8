"""Which variables of a NetCDF file are the coordinates of a grid: CF before names.

CF Conventions 1.11, sections 4.1, 4.2 (latitude, longitude), 5.2 (two-dimensional ones), 5.6
and appendix F (grid mappings).
"""

import re
from typing import Any

import numpy as np
from rasterio.crs import CRS
from rasterio.errors import CRSError

from seanav.checks import ParameterError
from seanav.models.gravity.packing import text, unpacking

_STANDARD = {
    "latitude": "latitude",
    "longitude": "longitude",
    "projection_y_coordinate": "northing",
    "projection_x_coordinate": "easting",
}
_NAMES = {
    "lat": "latitude",
    "latitude": "latitude",
    "lon": "longitude",
    "long": "longitude",
    "longitude": "longitude",
    "northing": "northing",
    "northings": "northing",
    "easting": "easting",
    "eastings": "easting",
    "y": "y",
    "x": "x",
}
_AXES = {"y": ("y", "latitude", "northing"), "x": ("x", "longitude", "easting")}
_DEGREES = re.compile(r"(deg|degs|degree|degrees|°)(n|north|e|east|)")
_METRES = {"m": 1.0, "metre": 1.0, "metres": 1.0, "meter": 1.0, "meters": 1.0}
_METRES |= {f"k{unit}": 1e3 for unit in _METRES} | {"kilometre": 1e3, "kilometers": 1e3}

# The pairs that can place a grid, the best first.
_PAIRS = [("latitude", "longitude"), ("northing", "easting"), ("y", "x")]

_PROJECTIONS = {
    "transverse_mercator": "tmerc",
    "mercator": "merc",
    "polar_stereographic": "stere",
    "stereographic": "stere",
    "lambert_conformal_conic": "lcc",
    "lambert_azimuthal_equal_area": "laea",
    "albers_conical_equal_area": "aea",
}
_PARAMETERS = {
    "latitude_of_projection_origin": "lat_0",
    "longitude_of_projection_origin": "lon_0",
    "longitude_of_central_meridian": "lon_0",
    "straight_vertical_longitude_from_pole": "lon_0",
    "scale_factor_at_central_meridian": "k_0",
    "scale_factor_at_projection_origin": "k_0",
    "false_easting": "x_0",
    "false_northing": "y_0",
    "semi_major_axis": "a",
    "semi_minor_axis": "b",
    "inverse_flattening": "rf",
    "earth_radius": "R",
}


def numeric(variable: Any) -> bool:
    """Whether a variable holds real numbers."""
    return getattr(variable.dtype, "kind", "O") in "iuf"


def _unit(variable):
    return re.sub(r"[\s_]", "", text(variable, "units").lower())


def meaning(variable: Any) -> tuple[str, bool]:
    """Return what a coordinate is, and whether CF says so or only its name.

    Parameters
    ----------
    variable : netCDF4.Variable

    Returns
    -------
    str
        "latitude", "longitude", "northing", "easting", "y", "x" or "" (none of them).
    bool
        True: by its standard_name, its units, or its axis together with units of an angle.
    """
    standard = text(variable, "standard_name").lower()
    if standard in _STANDARD:
        return _STANDARD[standard], True
    unit, axis = _unit(variable), text(variable, "axis").lower()
    angle = _DEGREES.fullmatch(unit)
    if angle and angle[2]:
        return ("latitude" if angle[2] in ("n", "north") else "longitude"), True
    if unit and not angle and unit not in _METRES:
        return "", False  # a quantity
    named = _NAMES.get(variable.name.strip().lower(), "")
    if axis in _AXES and named not in _AXES[axis]:
        named = axis
    for generic, (_, degrees, metres) in _AXES.items():
        if unit in _METRES and named in (generic, degrees):
            return metres, axis == generic
        if angle and axis == generic:
            return degrees, True
    return named, False


def _counts(values):
    # Numbers of the nodes: 0, 1, 2, … or 1, 2, 3, …, or of their middles, up or down.
    steps, low = np.diff(values), values.min(initial=np.inf)
    return low in (0.0, 0.5, 1.0) and len(steps) > 0 and abs(steps[0]) == 1 and np.ptp(steps) == 0


def _one(source, found, what):
    # Of several variables that mean the same: CF before names, and otherwise the same values.
    said = [v for v in found if meaning(v)[1]]
    values = {v.name: _values(source, v) for v in found}
    if not said and len(found) > 1:
        # An axis that only counts its nodes says nothing beside one that does not.
        found = [v for v in found if not _counts(values[v.name])] or found
    first, *others = said or found
    for other in others:
        same = first.dimensions == other.dimensions
        if not same or not np.array_equal(values[first.name], values[other.name], equal_nan=True):
            allowed = f"must have one {what}; {first.name} and {other.name} both are it, and differ"
            raise ParameterError("map_source", source, allowed)
    return first


def _only_counts(source, pair, dimensions, variables):
    lines = [_values(source, v) for group in variables for v in group] if dimensions == 1 else []
    return pair != _PAIRS[0] and all(_counts(line) for line in lines)


def _values(source, variable):
    return unpacking(source, variable)[0](variable[...])


def _system(dataset, grid):
    # The reference system of a variable's grid mapping; None without one that can be read.
    name = text(grid, "grid_mapping").split(":")[0].split(" ")[0]
    if name not in dataset.variables:
        return None
    mapping = dataset[name]
    for key in ("crs_wkt", "spatial_ref", "proj4", "proj4text", "proj4_params", "epsg_code"):
        said = text(mapping, key)
        if said:
            try:
                return CRS.from_user_input(f"EPSG:{said}" if said.isdigit() else said)
            except CRSError:
                continue
    projection = _PROJECTIONS.get(text(mapping, "grid_mapping_name").lower())
    if projection is None:
        return None
    words = [f"+proj={projection}"]
    words += [
        f"+{to}={text(mapping, key)}" for key, to in _PARAMETERS.items() if text(mapping, key)
    ]
    parallels = text(mapping, "standard_parallel").split()
    if projection in ("merc", "stere") and parallels:
        words.append(f"+lat_ts={parallels[0]}")
    else:
        words += [f"+lat_{k}={value}" for k, value in enumerate(parallels, start=1)]
    if not {"+a", "+R"} & {word.split("=")[0] for word in words}:
        words.append("+ellps=WGS84")
    try:
        return CRS.from_string(" ".join([*words, "+units=m"]))
    except CRSError:
        return None


def _pairs(dataset, grid):
    # For each pair of meanings the variables that a grid's coordinates may be: of one dimension,
    # or of two.
    lines, sheets = {}, {}
    for variable in dataset.variables.values():
        own = set(variable.dimensions)
        if variable.name == grid.name or not numeric(variable) or not own <= set(grid.dimensions):
            continue
        what, _ = meaning(variable)
        if what and variable.ndim in (1, 2):
            kinds = lines if variable.ndim == 1 else sheets
            kinds.setdefault(what, []).append(variable)
    for pair in _PAIRS:
        for dimensions, kinds in ((1, lines), (2, sheets)):
            if all(what in kinds for what in pair) and (dimensions == 1 or pair == _PAIRS[0]):
                yield pair, dimensions, [kinds[what] for what in pair]


def _is_grid(dataset, variable):
    # Two dimensions with coordinates, and all others of length one.
    if not numeric(variable) or variable.ndim < 2 or (meaning(variable)[0] and variable.ndim == 2):
        return False
    sizes = dict(zip(variable.dimensions, variable.shape, strict=True))
    for _, dimensions, (rows, columns) in _pairs(dataset, variable):
        for y in rows:
            for x in columns:
                own = set(y.dimensions + x.dimensions)
                sheet = dimensions == 1 or set(y.dimensions) == set(x.dimensions)
                others = [n for d, n in sizes.items() if d not in own]
                if len(own) == 2 and sheet and all(n == 1 for n in others):
                    return True
    return False


def candidates(dataset: Any) -> list[str]:
    """Return the names of the variables that lie on two axes, bounds of cells left out."""
    bounds = {text(v, "bounds") for v in dataset.variables.values()}
    return [
        v.name for v in dataset.variables.values() if v.name not in bounds and _is_grid(dataset, v)
    ]


def _lines_of(source, y, x):
    # One-dimensional axes and their dimensions, of one- or two-dimensional coordinates.
    if y.ndim == 1:
        return (_values(source, y), _values(source, x)), y.dimensions + x.dimensions
    latitude, longitude = _values(source, y), _values(source, x)
    if x.dimensions != y.dimensions:
        longitude = longitude.T
    for dimensions in (y.dimensions, y.dimensions[::-1]):
        rows, columns = latitude.mean(axis=1), longitude.mean(axis=0)
        # Single precision is good for that; nodes off their row by more are not.
        bent = [np.ptp(latitude, axis=1).max(), np.ptp(longitude, axis=0).max()]
        steps = [np.median(np.abs(np.diff(a))) if len(a) > 1 else 0 for a in (rows, columns)]
        if all(b <= 0.05 * s for b, s in zip(bent, steps, strict=True)):
            return (rows, columns), dimensions
        latitude, longitude = latitude.T, longitude.T
    allowed = (
        f"must have rows of one latitude and columns of one longitude; the two-dimensional "
        f"{y.name} and {x.name} are bent against each other"
    )
    raise ParameterError("map_source", source, allowed)


def _in_degrees(source, variables, values, pair):
    # Axes in degrees, or a refusal.
    names = " and ".join(v.name for v in variables)
    for variable, what in zip(variables, pair, strict=True):
        unit, angle = text(variable, "units"), _DEGREES.fullmatch(_unit(variable))
        wrong = ("e", "east") if what in ("latitude", "y") else ("n", "north")
        if unit and (not angle or angle[2] in wrong):
            allowed = f"must have {names} in degrees; {variable.name} is in {unit!r}"
            raise ParameterError("map_source", source, allowed)
    unsaid = [v for v in variables if not meaning(v)[1] and not text(v, "units")]
    if any(_counts(line) for v, line in zip(variables, values, strict=True) if v in unsaid):
        allowed = f"must have {names} in degrees, stated by their units; they only count the nodes"
        raise ParameterError("map_source", source, allowed)
    y, x = values
    if not (np.all(np.abs(y) <= 90.01) and np.all(np.abs(x) <= 720.01)):
        raise ParameterError("map_source", source, f"must have {names} in degrees")


def axes(source: str, dataset: Any, grid: Any) -> tuple:
    """Return the axes of a grid, its dimensions and its reference system.

    Latitude and longitude come first, then northing and easting in a stated reference system,
    then latitude and longitude of two dimensions if they are those of straight rows and
    columns, then y and x that do not say what they are.

    Parameters
    ----------
    source : str
        Path of the file, for errors.
    dataset : netCDF4.Dataset
    grid : netCDF4.Variable
        One of `candidates`.

    Returns
    -------
    (y, x), (rows, columns), crs
        Coordinates (n,), names of the dimensions, and the reference system or None (degrees).

    Raises
    ------
    ParameterError
        If two variables claim to be the same coordinate, or what there is does not place the
        grid.
    """
    crs = _system(dataset, grid)
    projected = crs is not None and crs.is_projected
    found = list(_pairs(dataset, grid))
    if projected:  # y and x are its own, and better than degrees of two dimensions
        found.sort(key=lambda one: (_only_counts(source, *one), one[1]))
    pair, _, (rows, columns) = found[0]
    y, x = _one(source, rows, pair[0]), _one(source, columns, pair[1])
    values, dimensions = _lines_of(source, y, x)
    if min(map(len, values)) < 2:
        allowed = f"must have two values or more on {y.name} and {x.name}"
        raise ParameterError("map_source", source, allowed)
    if not all(np.isfinite(line).all() for line in values):
        allowed = f"must have a value at every place of {y.name} and {x.name}"
        raise ParameterError("map_source", source, allowed)
    if projected and _only_counts(source, pair, y.ndim, ([y], [x])):
        allowed = f"must have {y.name} and {x.name} in metres; they only count the nodes"
        raise ParameterError("map_source", source, allowed)
    if pair == _PAIRS[0] or (pair == _PAIRS[2] and not projected):
        _in_degrees(source, (y, x), values, pair)
        return values, dimensions, None
    if not projected:
        allowed = (
            f"must state the reference system of {y.name} and {x.name}, by a grid_mapping with "
            f"crs_wkt or a projection of the CF conventions; it is missing, or not one of those"
        )
        raise ParameterError("map_source", source, allowed)
    size = crs.linear_units_factor[1]
    scales = [_METRES.get(_unit(v), size) / size for v in (y, x)]
    return tuple(a * s for a, s in zip(values, scales, strict=True)), dimensions, crs
