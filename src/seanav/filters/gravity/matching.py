"""Gravity matching with a Kalman filter: SITAN, and the point-gradient EKF beside it.

An inertial navigation system (INS) drifts; a gravimeter compares what it measures with
an anomaly map and the difference corrects the position. The state is the position
error, its transition is the identity, and the map is the only nonlinearity, so the two
filters differ in one thing: from where they take the slope H of the map.

Both run in closed loop: the correction goes back into the INS, so the error left after
an update is the error that the next step starts from.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seanav._compile import kernel
from seanav.checks import ParameterError, array, choice, covariance, integer, number
from seanav.models.gravity.map import MOST_NODES, _bilinear, _nodes


class Tracks(NamedTuple):
    """What a matching filter returns for a batch of runs.

    Attributes
    ----------
    errors : ndarray (runs, steps, 2)
        Estimate minus truth, (east, north) in metres; sample 0 is the start.
    P : ndarray (runs, steps, 3)
        The filter's own covariance as (east-east, east-north, north-north) in m².
    nis : ndarray (runs, steps)
        Normalised innovation squared; NaN at sample 0, which has no measurement.
    """

    errors: np.ndarray
    P: np.ndarray
    nis: np.ndarray


@kernel
def _summed_area(values):
    """Return T, one longer on each axis, with ``T[i, j] = values[:i, :j].sum()``."""
    rows, columns = values.shape
    table = np.zeros((rows + 1, columns + 1))
    for i in range(rows):
        row = 0.0
        for j in range(columns):
            row += values[i, j]
            table[i + 1, j + 1] = table[i, j + 1] + row
    return table


@kernel
def _block(table, i0, i1, j0, j1):
    return table[i1, j1] - table[i0, j1] - table[i1, j0] + table[i0, j0]


@kernel
def _block_gradient(table, spacing, i, j, size):
    # See `block_gradient`. The table, `_summed_area` of the map, makes the cost
    # independent of L.
    top, bottom, left, right = i + size + 1, i - size, j - size, j + size + 1
    scale = size * (size + 1.0) * (2.0 * size + 1.0) * spacing
    east = _block(table, bottom, top, j + 1, right) - _block(table, bottom, top, left, j)
    north = _block(table, i + 1, top, left, right) - _block(table, bottom, i, left, right)
    return east / scale, north / scale


def block_gradient(
    anomaly: ArrayLike, spacing: float, i: int, j: int, size: int
) -> tuple[float, ...]:
    """Slope of the plane fitted to the (2L+1) × (2L+1) nodes around node (i, j).

    On a plane the columns right of the centre minus those left of it add up to
    L(L+1)(2L+1)δ times the east slope, so the fit is exact there.

    Parameters
    ----------
    anomaly : array (rows, columns)
        Map; node [i, j] at north i·spacing and east j·spacing; at least 3 × 3.
    spacing : float
        Distance δ of the nodes, m.
    i, j : int
        Centre node, north and east; at least `size` nodes away from every border.
    size : int
        L, at least 1.

    Returns
    -------
    east, north : float
        Slope in map units per metre.

    Raises
    ------
    ParameterError
        A value is not finite, or the block does not lie on the map.

    Notes
    -----
    Source: equations (36) and (37) of the paper. In our copy they take one block from the
    map and the other from the measurement, of which there is only one; the difference
    of two blocks of the map is what gives a slope.
    """
    grid = _nodes("anomaly", anomaly)
    spacing = number("spacing", spacing, above=0)
    rows, columns = grid.shape
    size = integer("size", size, at_least=1, at_most=(min(rows, columns) - 1) // 2)
    i = integer("i", i, at_least=size, at_most=rows - 1 - size)
    j = integer("j", j, at_least=size, at_most=columns - 1 - size)
    return _block_gradient(_summed_area(grid), spacing, i, j, size)


# An index made of NaN would point anywhere: max(0, NaN) is 0, and max(NaN, 0) is not.


@kernel
def _point_gradient(grid, spacing, east, north):
    """Slope (east, north) of the bilinear map at a point; zero across a clamped border."""
    rows, columns = grid.shape
    x, y = east / spacing, north / spacing
    u, v = min(max(0.0, x), columns - 1.0), min(max(0.0, y), rows - 1.0)
    i, j = min(int(v), rows - 2), min(int(u), columns - 2)
    s, t = u - j, v - i
    a, b, c, d = grid[i, j], grid[i, j + 1], grid[i + 1, j], grid[i + 1, j + 1]
    slope_east = ((b - a) * (1.0 - t) + (d - c) * t) / spacing if u == x else 0.0
    slope_north = ((c - a) * (1.0 - s) + (d - b) * s) / spacing if v == y else 0.0
    return slope_east, slope_north


@kernel
def _window(ee, en, nn, spacing, sigmas, largest):
    """Half width L of the fitted block, in nodes, for a covariance.

    The paper says only that the covariance sets it. Here: `sigmas` times the largest
    standard deviation (the square root of the larger eigenvalue), to the nearest whole
    number of nodes, within 1 and `largest`.
    """
    middle, half = 0.5 * (ee + nn), 0.5 * (ee - nn)
    sigma = np.sqrt(middle + np.sqrt(half * half + en * en))
    return int(max(1.0, min(float(largest), np.floor(sigmas * sigma / spacing + 0.5))))


@kernel
def _nearest_block(table, spacing, east, north, size):
    rows, columns = table.shape[0] - 1, table.shape[1] - 1
    # The centre keeps one node to every border, and the window shrinks to stay on the map.
    i = int(min(max(1.0, np.floor(north / spacing + 0.5)), rows - 2.0))
    j = int(min(max(1.0, np.floor(east / spacing + 0.5)), columns - 2.0))
    size = min(size, i, j, rows - 1 - i, columns - 1 - j)
    return _block_gradient(table, spacing, i, j, size)


@kernel
def _update(ee, en, nn, he, hn, R):
    """Covariance after one scalar measurement with slope (he, hn) and variance R.

    (P⁻¹ + HᵀH/R)⁻¹ = (R P + |P| adj(HᵀH)) / S for two states: no difference of nearly
    equal numbers on the diagonal, so the result stays positive.

    Returns
    -------
    ee, en, nn, S, ke, kn : float
        New covariance, variance S of the innovation, and gain.
    """
    ge, gn = ee * he + en * hn, en * he + nn * hn
    S = he * ge + hn * gn + R
    determinant = ee * nn - en * en
    return (
        (R * ee + determinant * hn * hn) / S,
        (R * en - determinant * he * hn) / S,
        (R * nn + determinant * he * he) / S,
        S,
        ge / S,
        gn / S,
    )


@kernel
def _filter(grid, spacing, truth, start, drift, noise, R, P0, Q, by_block, sigmas, largest):
    runs, steps = noise.shape
    errors, P = np.empty((runs, steps, 2)), np.empty((runs, steps, 3))
    nis = np.full((runs, steps), np.nan)
    table = _summed_area(grid)
    field = np.empty(steps)
    for k in range(steps):
        field[k] = _bilinear(grid, spacing, truth[k, 0], truth[k, 1])
    for r in range(runs):
        e, n = start[r, 0], start[r, 1]
        ee, en, nn = P0[0, 0], P0[0, 1], P0[1, 1]
        errors[r, 0, 0], errors[r, 0, 1] = e, n
        P[r, 0, 0], P[r, 0, 1], P[r, 0, 2] = ee, en, nn
        for k in range(1, steps):
            e, n = e + drift[r, k, 0], n + drift[r, k, 1]
            ee, en, nn = ee + Q[0, 0], en + Q[0, 1], nn + Q[1, 1]
            east, north = truth[k, 0] + e, truth[k, 1] + n
            innovation = field[k] + noise[r, k] - _bilinear(grid, spacing, east, north)
            if by_block:
                size = _window(ee, en, nn, spacing, sigmas, largest)
                he, hn = _nearest_block(table, spacing, east, north, size)
            else:
                he, hn = _point_gradient(grid, spacing, east, north)
            ee, en, nn, S, ke, kn = _update(ee, en, nn, he, hn, R)
            e, n = e + ke * innovation, n + kn * innovation
            errors[r, k, 0], errors[r, k, 1] = e, n
            P[r, k, 0], P[r, k, 1], P[r, k, 2] = ee, en, nn
            nis[r, k] = innovation * innovation / S
    return errors, P, nis


def sitan(
    anomaly: ArrayLike,
    spacing: float,
    truth: ArrayLike,
    initial_error: ArrayLike,
    drift: ArrayLike,
    noise: ArrayLike,
    R: float,
    P0: ArrayLike,
    Q: ArrayLike,
    *,
    gradient: str = "block",
    window_sigmas: float = 1.0,
    largest_window: int = 15,
) -> Tracks:
    """Correct the INS along a trajectory with SITAN, equations (33)–(37), in independent runs.

    A run depends on its own rows only: batches may be cut as one likes, to the last bit.

    Parameters
    ----------
    anomaly : array (rows, columns)
        Map, m/s²; node [i, j] at north i·spacing and east j·spacing; at least 3 × 3.
    spacing : float
        Distance of the nodes, m.
    truth : array (steps, 2)
        True (east, north) positions, m.
    initial_error : array (runs, 2)
        INS position minus truth at sample 0, m.
    drift : array (runs, steps, 2)
        What the INS error grows by on the way to sample k, m; sample 0 is not used.
    noise : array (runs, steps)
        Measurement errors, m/s²: y = h(truth) + noise; sample 0 is not used.
    R : float
        Variance that the filter assumes for the measurement, (m/s²)².
    P0, Q : array (2, 2)
        Covariance at sample 0, and of the drift from one sample to the next, m².
    gradient : {"block", "point"}
        Slope of a plane fitted around the nearest node (SITAN), or of the map (EKF).
    window_sigmas, largest_window : float, int
        Half width of the block in largest standard deviations, and its limit in nodes.

    Returns
    -------
    Tracks
        Sample 0 is the start, every later one after its measurement.

    Raises
    ------
    ParameterError
        A shape does not fit, a value is not finite, R ≤ 0, P0 not positive definite, … or a
        result would not be finite.
    """
    grid, inputs = checked(anomaly, spacing, truth, initial_error, drift, noise, R, P0, Q)
    choice("gradient", gradient, ["block", "point"])
    sigmas = number("window_sigmas", window_sigmas, at_least=0)
    largest = integer("largest_window", largest_window, at_least=1, at_most=MOST_NODES)
    tracks = Tracks(*_filter(grid, *inputs, gradient == "block", sigmas, largest))
    _demand_finite(tracks.errors, tracks.P, tracks.nis[:, 1:])
    return tracks


def _demand_finite(*results):
    # Numbers of extreme size overflow on their way through a filter.
    with np.errstate(all="ignore"):  # a sum shows what is not finite, in one pass
        sums = [result.sum() for result in results]
    if not np.isfinite(sums).all():
        allowed = "must leave errors and covariances that are finite in double precision"
        raise ParameterError("the inputs of the filter", "of extreme size", allowed)


def checked(
    anomaly: ArrayLike,
    spacing: float,
    truth: ArrayLike,
    initial_error: ArrayLike,
    drift: ArrayLike,
    noise: ArrayLike,
    R: float,
    P0: ArrayLike,
    Q: ArrayLike,
) -> tuple[np.ndarray, tuple[Any, ...]]:
    """Return the inputs of a matching filter as arrays that fit together, or raise.

    The map comes back with its mid-range at zero. A filter sees differences of the map
    only, and rounding is least around zero.

    Returns
    -------
    grid : ndarray
        The centred map.
    inputs : tuple
        All other inputs, in order.

    Raises
    ------
    ParameterError
        As in `sitan`.
    """
    grid = _nodes("anomaly", anomaly)
    spacing = number("spacing", spacing, above=0)
    sizes = {}
    truth = array("truth", truth, ("steps", 2), sizes)
    noise = array("noise", noise, ("runs", "steps"), sizes)
    initial_error = array("initial_error", initial_error, ("runs", 2), sizes)
    drift = array("drift", drift, ("runs", "steps", 2), sizes)
    R = number("R", R, above=0)
    P0, Q = covariance("P0", P0, 2, definite=True), covariance("Q", Q, 2)
    centred = grid - 0.5 * (grid.min() + grid.max())
    return centred, (spacing, truth, initial_error, drift, noise, R, P0, Q)
