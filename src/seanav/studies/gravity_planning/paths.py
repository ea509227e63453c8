"""Paper 5: the paths that are compared, in metres from the lower left corner of the map."""

import numpy as np

from seanav.models.units import KM


def length(points):
    """Return the length of a polyline (k, 2), in the unit of its points."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def resample(points, count):
    """Return `count` points (count, 2) at equal distances along a polyline (k, 2)."""
    along = np.concatenate([[0.0], np.hypot(*np.diff(points, axis=0).T).cumsum()])
    even = np.linspace(0.0, along[-1], count)
    return np.column_stack([np.interp(even, along, points[:, axis]) for axis in (0, 1)])


def bow(start, goal, amplitude, count):
    """Return a half-sine bow between two points, (count, 2), equidistant samples.

    A positive amplitude (m) bows to the left of the map, as the paper numbers its
    curves; on a path due east or west it bows to the north.
    """
    start, goal = np.asarray(start, float), np.asarray(goal, float)
    along = goal - start
    side = np.array([-along[1], along[0]]) / np.hypot(*along)
    if side[0] > 0 or (side[0] == 0 and side[1] < 0):
        side = -side
    share = np.linspace(0.0, 1.0, 2001)[:, None]
    return resample(start + share * along + amplitude * np.sin(np.pi * share) * side, count)


def displaced(points, amplitude):
    """Return a path (k, 2) moved sideways by a half-sine bow of `amplitude` m, equidistant."""
    return resample(
        points
        + bow(points[0], points[-1], amplitude, len(points))
        - bow(points[0], points[-1], 0.0, len(points)),
        len(points),
    )


def nearest(paths, count):
    """Return the names of the `count` bows nearest to the planned path, nearest first."""

    def gap(name):
        steps = paths["Planned"][:, None] - paths[name][None]
        return np.hypot(steps[..., 0], steps[..., 1]).min(axis=1).mean()

    bows = [name for name in paths if name not in ("Planned", "Direct")]
    return sorted(bows, key=gap)[:count]


def on_map(points, chart):
    """Tell whether every point (k, 2) in m lies on the map."""
    return bool((points >= 0).all() and (points <= np.asarray(chart.extent)).all())


def fan(chart, start, goal, amplitudes_km, samples):
    """Return the direct path and the bows that stay on the map, and how many did not.

    Parameters
    ----------
    start, goal : (2,) array_like
        Nodes (east, north).
    amplitudes_km : sequence of float
        Left to right; they are named L3, L4, … as in the paper.

    Returns
    -------
    dict of str to (samples, 2) ndarray in m, int
    """
    ends = np.asarray(start) * chart.spacing, np.asarray(goal) * chart.spacing
    paths = {"Direct": bow(*ends, 0.0, samples)}
    for number, amplitude in enumerate(amplitudes_km, start=3):
        curve = bow(*ends, amplitude * KM, samples)
        if on_map(curve, chart):
            paths[f"L{number}"] = curve
    return paths, len(amplitudes_km) + 1 - len(paths)
