"""Paths on a plane map: polylines (k, 2) of (east, north) in metres."""

import numpy as np
from numpy.typing import ArrayLike

from seanav.checks import ParameterError, array, integer, number


def length(points: ArrayLike) -> float:
    """Return the length of a polyline (k, 2), in the unit of its points."""
    points = array("points", points, ("points", 2))
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def resample(points: ArrayLike, count: int) -> np.ndarray:
    """Return `count` points (count, 2) at equal distances along a polyline (k, 2)."""
    points = array("points", points, ("points", 2))
    along = np.concatenate([[0.0], np.hypot(*np.diff(points, axis=0).T).cumsum()])
    even = np.linspace(0.0, along[-1], integer("count", count, at_least=2, at_most=10**6))
    return np.column_stack([np.interp(even, along, points[:, axis]) for axis in (0, 1)])


def bow(start: ArrayLike, goal: ArrayLike, amplitude: float, count: int) -> np.ndarray:
    """Return a half-sine bow between two points, (count, 2), equidistant samples.

    A positive amplitude (m) bows to the left of the map; on a path due east or west it
    bows to the north.

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit, a number is not finite, or the points are one.
    """
    start, goal = array("start", start, (2,)), array("goal", goal, (2,))
    amplitude = number("amplitude", amplitude)
    along = goal - start
    if not along.any():
        raise ParameterError("goal", goal.tolist(), "must differ from start")
    side = np.array([-along[1], along[0]]) / np.hypot(*along)
    if side[0] > 0 or (side[0] == 0 and side[1] < 0):
        side = -side
    share = np.linspace(0.0, 1.0, 2001)[:, None]
    return resample(start + share * along + amplitude * np.sin(np.pi * share) * side, count)


def inside(points: ArrayLike, extent: ArrayLike) -> bool:
    """Tell whether every point (k, 2) lies on a map of `extent` (2,) from the origin."""
    points, extent = array("points", points, ("points", 2)), array("extent", extent, (2,))
    return bool((points >= 0).all() and (points <= extent).all())


def displaced(points: ArrayLike, amplitude: float) -> np.ndarray:
    """Return a path (k, 2) moved sideways by a half-sine bow of `amplitude` m, equidistant."""
    points = array("points", points, ("points", 2))
    count = len(points)
    ends = points[0], points[-1]
    moved = points + bow(*ends, amplitude, count) - bow(*ends, 0.0, count)
    return resample(moved, count)
