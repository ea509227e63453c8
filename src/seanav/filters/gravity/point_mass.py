"""Point-mass filter: Bayes' rule on a grid, the reference for the matching filters.

The unknown is where the vehicle is relative to the position that the INS indicates. A
grid of such displacements moves along with the INS, every cell carries a weight, and no
linearisation is made: what remains is the width of a cell, and the edge of the grid.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from seanav._compile import kernel
from seanav.checks import ParameterError, number
from seanav.filters.gravity.matching import _demand_finite, checked
from seanav.models.gravity.map import _bilinear

# A weight below this fraction of the largest is set to zero. It spares most of the work,
# and what is lost is far below the effect of the cells' width.
_NEGLIGIBLE = 1e-12
_MOST_CELLS = 4_000_000


@kernel
def _diffuse(weight, scratch, box, a, b):
    # Three-point convolution (a, 1 − 2a, a) east and (b, 1 − 2b, b) north: its variance
    # is 2a cell², exactly. The box of cells in use grows by one to each side.
    i0, i1 = max(box[0] - 1, 0), min(box[1] + 1, weight.shape[0])
    j0, j1 = max(box[2] - 1, 0), min(box[3] + 1, weight.shape[1])
    for i in range(i0, i1):
        for j in range(j0, j1):
            left = weight[i, j - 1] if j > 0 else 0.0
            right = weight[i, j + 1] if j + 1 < weight.shape[1] else 0.0
            scratch[i, j] = (1.0 - 2.0 * a) * weight[i, j] + a * (left + right)
    for i in range(i0, i1):
        for j in range(j0, j1):
            below = scratch[i - 1, j] if i > i0 else 0.0
            above = scratch[i + 1, j] if i + 1 < i1 else 0.0
            weight[i, j] = (1.0 - 2.0 * b) * scratch[i, j] + b * (below + above)
    box[0], box[1], box[2], box[3] = i0, i1, j0, j1


@kernel
def _misfit(grid, spacing, measured, east, north, cell, box, column, share, line, weight, out):
    # Squared difference of the measurement and the bilinear map in every cell of the box
    # that has a weight; returns the least. Cell (i, j) is at (east + j cell, north + i cell).
    # The map is interpolated north once per row and then east, with `column` and `share`
    # the same for all rows. Like `models.gravity._bilinear`, it is clamped at the border;
    # max(0, NaN) is 0, so that no index is made of NaN.
    rows, columns = grid.shape
    i0, i1, j0, j1 = box
    for j in range(j0, j1):
        u = min(max(0.0, (east + j * cell) / spacing), columns - 1.0)
        column[j] = min(int(u), columns - 2)
        share[j] = u - column[j]
    first, last = column[j0], column[j1 - 1] + 2
    least = np.inf
    for i in range(i0, i1):
        v = min(max(0.0, (north + i * cell) / spacing), rows - 1.0)
        row = min(int(v), rows - 2)
        t = v - row
        for c in range(first, last):
            line[c] = grid[row, c] + t * (grid[row + 1, c] - grid[row, c])
        for j in range(j0, j1):
            if weight[i, j] == 0.0:
                continue
            c = column[j]
            difference = measured - (line[c] + share[j] * (line[c + 1] - line[c]))
            out[i, j] = difference * difference
            least = min(least, out[i, j])
    return least


@kernel
def _multiply(weight, misfit, least, R, box):
    # Only ratios of weights matter. The likelihood of the best cell is set to one, so that
    # an outlier, which is unlikely everywhere, does not underflow to a sum of zero.
    i0, i1, j0, j1 = box
    largest = 0.0
    for i in range(i0, i1):
        for j in range(j0, j1):
            if weight[i, j] > 0.0:
                weight[i, j] *= math.exp((least - misfit[i, j]) / (2.0 * R))
                largest = max(largest, weight[i, j])
    for i in range(i0, i1):
        for j in range(j0, j1):
            ratio = weight[i, j] / largest
            weight[i, j] = ratio if ratio >= _NEGLIGIBLE else 0.0


@kernel
def _empty(weight, i0, i1, j0, j1):
    for i in range(i0, i1):
        for j in range(j0, j1):
            if weight[i, j] > 0.0:
                return False
    return True


@kernel
def _shrink(weight, box):
    while box[0] + 1 < box[1] and _empty(weight, box[0], box[0] + 1, box[2], box[3]):
        box[0] += 1
    while box[0] + 1 < box[1] and _empty(weight, box[1] - 1, box[1], box[2], box[3]):
        box[1] -= 1
    while box[2] + 1 < box[3] and _empty(weight, box[0], box[1], box[2], box[2] + 1):
        box[2] += 1
    while box[2] + 1 < box[3] and _empty(weight, box[0], box[1], box[3] - 1, box[3]):
        box[3] -= 1


@kernel
def _moments(weight, box, sums):
    # Mean (east, north) and central second moments in cells. Sums run down the columns,
    # which the compiler can vectorise without changing the order of any addition.
    i0, i1, j0, j1 = box
    sums[:] = 0.0
    for i in range(i0, i1):
        y = float(i - i0)
        for j in range(j0, j1):
            sums[0, j] += weight[i, j]
            sums[1, j] += weight[i, j] * y
            sums[2, j] += weight[i, j] * (y * y)
    total, x_, y_, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(j0, j1):
        x = float(j - j0)
        total += sums[0, j]
        x_ += sums[0, j] * x
        y_ += sums[1, j]
        xx += sums[0, j] * (x * x)
        xy += sums[1, j] * x
        yy += sums[2, j]
    x_, y_, xx, xy, yy = x_ / total, y_ / total, xx / total, xy / total, yy / total
    return j0 + x_, i0 + y_, xx - x_ * x_, xy - x_ * y_, yy - y_ * y_


@kernel
def _posterior(grid, spacing, truth, start, drift, noise, R, prior, a, b, cell):
    runs, steps = noise.shape
    errors, P = np.empty((runs, steps, 2)), np.empty((runs, steps, 3))
    rows, columns = prior.shape
    centre_east, centre_north = (columns - 1) // 2, (rows - 1) // 2
    weight, scratch = np.empty((rows, columns)), np.empty((rows, columns))
    column, share = np.empty(columns, np.int64), np.empty(columns)
    line, sums = np.empty(grid.shape[1]), np.empty((3, columns))
    box = np.empty(4, np.int64)
    for r in range(runs):
        weight[:] = prior
        box[0], box[1], box[2], box[3] = 0, rows, 0, columns
        e, n = start[r, 0], start[r, 1]
        for k in range(steps):
            if k > 0:
                e, n = e + drift[r, k, 0], n + drift[r, k, 1]
                if a > 0.0 or b > 0.0:
                    _diffuse(weight, scratch, box, a, b)
                east = truth[k, 0] + e - centre_east * cell
                north = truth[k, 1] + n - centre_north * cell
                measured = _bilinear(grid, spacing, truth[k, 0], truth[k, 1]) + noise[r, k]
                least = _misfit(
                    grid,
                    spacing,
                    measured,
                    east,
                    north,
                    cell,
                    box,
                    column,
                    share,
                    line,
                    weight,
                    scratch,
                )
                _multiply(weight, scratch, least, R, box)
                _shrink(weight, box)
            x, y, xx, xy, yy = _moments(weight, box, sums)
            errors[r, k, 0] = e + (x - centre_east) * cell
            errors[r, k, 1] = n + (y - centre_north) * cell
            P[r, k, 0], P[r, k, 1], P[r, k, 2] = xx * cell**2, xy * cell**2, yy * cell**2
    return errors, P


def point_mass(
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
    cell: float = 100.0,
    span_sigmas: float = 4.5,
) -> tuple[np.ndarray, ...]:
    """Posterior mean and covariance of the position, for a batch of independent runs.

    Discretisation: cells of width `cell` around the INS position, out to `span_sigmas`
    standard deviations of P0 on each axis; a weight is the density at the cell's centre.
    The drift of the INS spreads the weights by a three-point convolution per axis that
    has exactly the variance of Q. A weight below 1e-12 of the largest is set to zero.

    Parameters
    ----------
    anomaly, spacing, truth, initial_error, drift, noise, R, P0, Q
        As in `seanav.filters.gravity.matching.sitan`; Q diagonal and at most `cell`² on each axis.
    cell : float
        Width of a cell, m. As a rule no wider than the smallest standard deviation of
        the posterior; halve it to see what it does.
    span_sigmas : float
        Half width of the grid in standard deviations of P0.

    Returns
    -------
    errors : ndarray (runs, steps, 2)
        Posterior mean minus truth, (east, north) in metres; sample 0 is the start.
    P : ndarray (runs, steps, 3)
        Posterior covariance as (east-east, east-north, north-north) in m².

    Raises
    ------
    ParameterError
        As in `seanav.filters.gravity.matching.sitan`; Q not diagonal or above `cell`²; more than
        four million cells.

    Notes
    -----
    The posterior mean has the least mean square error when truths are drawn around the
    INS position. In a simulation with one fixed truth it may be slightly above or below
    another filter, and P above or below the mean square error.

    Source: N. Bergman, *Recursive Bayesian Estimation: Navigation and Tracking
    Applications*, thesis, Linköping University, 1999 (point-mass filter).
    """
    grid, inputs = checked(anomaly, spacing, truth, initial_error, drift, noise, R, P0, Q)
    *given, prior_P, drift_Q = inputs
    cell = number("cell", cell, above=0, at_most=1e7)
    span = number("span_sigmas", span_sigmas, above=0)
    prior = _prior(prior_P, cell, span)
    if drift_Q[0, 1] != 0.0 or drift_Q.max() > cell**2:
        allowed = f"must be diagonal and at most cell² = {cell**2:g}"
        raise ParameterError("Q", drift_Q.tolist(), allowed)
    a, b = drift_Q.diagonal() / (2.0 * cell**2)
    results = _posterior(grid, *given, prior, a, b, cell)
    _demand_finite(*results)
    return results


def _prior(P0, cell, span):
    half_east, half_north = np.ceil(span * np.sqrt(P0.diagonal()) / cell)
    if not (2 * half_east + 1) * (2 * half_north + 1) <= _MOST_CELLS:
        raise ParameterError("cell", cell, f"must be wider: above {_MOST_CELLS:,} cells")
    east = cell * np.arange(-half_east, half_east + 1)
    north = cell * np.arange(-half_north, half_north + 1)[:, None]
    (ee, en), (_, nn) = np.linalg.inv(P0)
    return np.exp(-0.5 * (ee * east**2 + 2.0 * en * east * north + nn * north**2))
