"""Whether the values of a gravity grid can be what they are taken for."""

import re

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from seanav.checks import ParameterError
from seanav.models.gravity.grids import Grid
from seanav.models.units import MGAL

# Free-air anomalies at sea stay within some hundred mGal; what is larger is another quantity, or
# a fill value such as 999 or -9999. And 100 km of sea floor flatter than a tenth of a milligal
# does not exist; values in m/s² taken for mGal are that flat.
LARGEST_MGAL = 800.0
SMALLEST_RANGE_MGAL = 0.1

# A node is refused that lies further from its neighbours than both: see `outliers`.
OUTLIER_SPREADS = 15.0
OUTLIER_MGAL = 5.0
SIDE = 5  # nodes, of the neighbourhood

_UNITS = {
    f"{prefix}{unit}": factor * size
    for prefix, factor in (("", 1.0), ("c", 1e-2), ("m", 1e-3), ("u", 1e-6), ("n", 1e-9))
    for unit, size in (("m/s2", 1.0), ("m/s/s", 1.0), ("ms-2", 1.0), ("gal", 1e-2))
} | {"milligal": MGAL, "milligals": MGAL, "mgals": MGAL, "microgal": 1e-6 * 1e-2}

# What a user may say of a file that does not say it itself.
MAP_UNITS = ("file", "mGal", "m/s2", "µGal", "uGal")


def _spelled(unit):
    # µ has two code points; exponents, products and brackets have many spellings.
    same = str.maketrans("µμ²⁻−", "uu2--", " ^*.·()[]{}_")
    words = re.sub("met(er|re)s?(?![a-z])", "m", unit.strip().lower())
    return re.sub("sec(onds?)?(?![a-z])", "s", words).translate(same)


def to_mgal(grid: Grid, map_unit: str) -> float:
    """Return the factor from the unit of a grid to mGal.

    Parameters
    ----------
    grid : Grid
    map_unit : str
        One of `MAP_UNITS`. "file": the unit that the file states. Otherwise the unit of a
        file that states none, or one that is not known here.

    Raises
    ------
    ParameterError
        If the unit is not stated at all, is not known, or is stated and another one.
    """
    known, said = _spelled(grid.unit), _spelled(map_unit)
    if map_unit != "file":
        if known in _UNITS and _UNITS[known] != _UNITS[said]:
            allowed = f"must be 'file': {grid.label} has the unit {grid.unit!r}"
            raise ParameterError("map_unit", map_unit, allowed)
        return _UNITS[said] / MGAL
    if not known:
        units = ", ".join(map(repr, MAP_UNITS[1:]))
        allowed = f"must name the unit of {grid.label}, one of {units}: the file states none"
        raise ParameterError("map_unit", map_unit, allowed)
    if known not in _UNITS:
        allowed = (
            f"must be in mGal or m/s² (or a prefix of them), or map_unit must name its unit; "
            f"{grid.label} has the unit {grid.unit!r}"
        )
        raise ParameterError("map_source", grid.source, allowed)
    return _UNITS[known] / MGAL


def _fit(sides, place):
    # For one place of a neighbourhood: the others' least-squares surface of second degree, as
    # the matrix of their residuals and the weights of its value there, with its variance.
    y, x = (
        a.ravel() for a in np.mgrid[: sides[0], : sides[1]] - np.array(sides)[:, None, None] // 2
    )
    powers = [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (0, 2)]
    powers = [p for p in powers if sum(p) < 2 or min(sides) == SIDE]  # too few nodes: a plane
    terms = np.stack([y**i * x**j for i, j in powers], axis=1).astype(float)
    others = np.delete(terms, place, axis=0)
    weights = terms[place] @ np.linalg.pinv(others)
    residuals = np.eye(len(others)) - others @ np.linalg.pinv(others)
    return residuals, weights, 1 + weights @ weights, len(others) - len(powers)


def _judge(windows, place, sides):
    # Misfit of the node at one place of each window, and its neighbours' spread.
    residuals, weights, variance, freedom = _fit(sides, place)
    misfit, spread = np.empty(windows.shape[:2]), np.empty(windows.shape[:2])
    for row, one in enumerate(windows):  # a row at a time: all at once would be 25 maps
        nodes = one.reshape(len(one), -1)
        others = np.delete(nodes, place, axis=1)
        misfit[row] = nodes[:, place] - others @ weights
        spread[row] = np.sqrt(variance * ((others @ residuals) ** 2).sum(axis=1) / freedom)
    return misfit, spread


def outliers(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find nodes that lie far outside the spread of their neighbours, such as fill values.

    A surface of second degree is laid through the other 24 nodes of the 5 × 5 around a node
    (at a border, of the outermost 5 × 5). Its own distance from that surface is held against
    the standard deviation with which the others predict it, the externally studentized
    residual of regression diagnostics (Cook and Weisberg, *Residuals and Influence in
    Regression*, 1982, section 2.2.1), but with the median over the map where that is larger.
    A node is an outlier beyond `OUTLIER_SPREADS` of it and `OUTLIER_MGAL`.

    The threshold is ours. The largest ratios met are 8.5 on real anomalies, from the geoid all
    around Japan with its trenches and seamounts, at steps of 1′ × 1.5′, 3′ × 3′ and 1 km (252
    maps), 10.3 over an isolated point mass as deep as the step is wide, a field sharper than a
    grid of that step can hold, and 4.6 in white noise. A single node of -999 reaches more than
    100. One of 0, where the anomaly is more than 10 mGal, reaches 10 to 50 at 1′ × 1.5′ and
    more in smoother maps, but 3 to 6 at 3′: in a coarse, rough grid it is not told from the sea.

    Parameters
    ----------
    values : array (rows, columns)
        Anomaly, mGal, evenly spaced along each axis.

    Returns
    -------
    found : array (rows, columns) of bool
    misfit : array (rows, columns)
        Distance from the neighbours' surface, mGal.
    """
    sides = tuple(min(SIDE, n) for n in values.shape)
    misfit, spread = np.zeros(values.shape), np.full(values.shape, np.inf)
    if sides[0] * sides[1] < 6:  # a plane needs three, its spread some more
        return misfit > 0, misfit
    windows = sliding_window_view(values, sides)
    counts = windows.shape[:2]
    for place in range(sides[0] * sides[1]):
        at = np.unravel_index(place, sides)
        # The middle of every window; the border's nodes are judged by the outermost windows.
        chosen = []
        for k, side, count in zip(at, sides, counts, strict=True):
            first = 0 if k <= side // 2 else count - 1
            last = count if k >= side // 2 else 1
            chosen.append(slice(first, last))
        target = tuple(
            slice(c.start + int(k), c.stop + int(k)) for c, k in zip(chosen, at, strict=True)
        )
        misfit[target], spread[target] = _judge(windows[tuple(chosen)], place, sides)
    usual = np.maximum(spread, np.median(spread))
    found = (np.abs(misfit) > OUTLIER_SPREADS * usual) & (np.abs(misfit) > OUTLIER_MGAL)
    return found, misfit


def _place(grid, y, x):
    latitude, longitude = (float(a[0]) for a in grid.degrees(np.array([y]), np.array([x])))
    return f"{latitude:.4f}° N, {longitude:.4f}° E"


def check_values(grid: Grid, values: np.ndarray, y: np.ndarray, x: np.ndarray) -> None:
    """Refuse values that no gravity anomaly has.

    Parameters
    ----------
    grid : Grid
        Where they come from.
    values : array (rows, columns)
        Anomaly, mGal.
    y, x : array (rows,), array (columns,)
        Where on the grid's axes.

    Raises
    ------
    ParameterError
        If a node is an outlier, or all of them too large or too flat.
    """
    found, misfit = outliers(values)
    if found.any():
        row, column = np.unravel_index(np.argmax(np.abs(misfit) * found), found.shape)
        count = np.count_nonzero(found)
        more = f" (one of {count} such nodes)" if count > 1 else ""
        allowed = (
            f"must have no node far outside its neighbours' spread; {grid.label} is "
            f"{values[row, column]:.6g} mGal at {_place(grid, y[row], x[column])}, "
            f"{abs(misfit[row, column]):.4g} from what they say{more}: declare a fill value"
        )
        raise ParameterError("map_source", grid.source, allowed)
    largest, spread = np.max(np.abs(values)), np.ptp(values)
    if largest > LARGEST_MGAL or spread < SMALLEST_RANGE_MGAL:
        row, column = np.unravel_index(np.argmax(np.abs(values)), values.shape)
        allowed = (
            f"must be an anomaly in mGal, within ±{LARGEST_MGAL:g} and spread over at least "
            f"{SMALLEST_RANGE_MGAL:g}; {grid.label} (unit {grid.unit or 'not stated'}) spans "
            f"{values.min():.4g} to {values.max():.4g}, largest at "
            f"{_place(grid, y[row], x[column])}"
        )
        raise ParameterError("map_source", grid.source, allowed)
