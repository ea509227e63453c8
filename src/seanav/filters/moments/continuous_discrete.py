"""Filters between discrete measurements of a continuous process: two stages, one loop.

Between measurements mean and covariance are integrated together, as one system of
differential equations (no frozen Jacobian); at a measurement they are corrected in
Joseph form. With the closure ``"ekf"`` this is the continuous–discrete EKF, with
``"gaussian"`` the filter of paper 1.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from seanav import checks
from seanav._compile import kernel
from seanav.checks import ParameterError
from seanav.filters.moments.generated import Propagator


@kernel
def _update(mean, P, predicted, H, R, z, nis):
    # One pass per run; R and H may be shared (first axis 1).
    runs, n = mean.shape
    k = z.shape[1]
    PH, K = np.empty((n, k)), np.empty((n, k))
    L, residual = np.zeros((k, k)), np.empty(k)
    A, AP = np.empty((n, n)), np.empty((n, n))
    for run in range(runs):
        h = min(run, H.shape[0] - 1)
        r = min(run, R.shape[0] - 1)
        for i in range(n):
            for a in range(k):
                total = 0.0
                for j in range(n):
                    total += P[run, i, j] * H[h, a, j]
                PH[i, a] = total
        for a in range(k):  # Cholesky factor of S = H P Hᵀ + R
            for b in range(a + 1):
                total = R[r, a, b]
                for i in range(n):
                    total += H[h, a, i] * PH[i, b]
                for c in range(b):
                    total -= L[a, c] * L[b, c]
                if a == b:
                    L[a, a] = np.sqrt(total)
                else:
                    L[a, b] = total / L[b, b]
        for i in range(n):  # K = P Hᵀ S⁻¹, by forward and back substitution
            for a in range(k):
                total = PH[i, a]
                for c in range(a):
                    total -= L[a, c] * K[i, c]
                K[i, a] = total / L[a, a]
            for a in range(k - 1, -1, -1):
                total = K[i, a]
                for c in range(a + 1, k):
                    total -= L[c, a] * K[i, c]
                K[i, a] = total / L[a, a]
        square = 0.0
        for a in range(k):
            residual[a] = z[run, a] - predicted[run, a]
        for i in range(n):
            for a in range(k):
                mean[run, i] += K[i, a] * residual[a]
        for a in range(k):  # |L⁻¹ residual|², the normalised innovation squared
            for c in range(a):
                residual[a] -= L[a, c] * residual[c]
            residual[a] /= L[a, a]
            square += residual[a] ** 2
        nis[run] = square
        for i in range(n):  # Joseph: (I − K H) P (I − K H)ᵀ + K R Kᵀ
            for j in range(n):
                total = 1.0 if i == j else 0.0
                for a in range(k):
                    total -= K[i, a] * H[h, a, j]
                A[i, j] = total
        for i in range(n):
            for j in range(n):
                total = 0.0
                for c in range(n):
                    total += A[i, c] * P[run, c, j]
                AP[i, j] = total
        for i in range(n):
            for j in range(i, n):
                total = 0.0
                for c in range(n):
                    total += AP[i, c] * A[j, c]
                for a in range(k):
                    for b in range(k):
                        total += K[i, a] * R[r, a, b] * K[j, b]
                P[run, i, j] = P[run, j, i] = total


def update(
    mean: ArrayLike,
    P: np.ndarray,
    z: ArrayLike,
    R: Any,
    H: ArrayLike | None,
    predicted: ArrayLike | None = None,
    spread: ArrayLike | None = None,
) -> np.ndarray:
    """Correct `mean` and `P` in place with a measurement; return the NIS, shape (runs,).

    Parameters
    ----------
    mean : ndarray, shape (runs, n); P : ndarray, shape (runs, n, n)
        Writable arrays of float64, C-contiguous.
    z : array, shape (runs, k)
    R : array, shape (k, k)
        Covariance of the measurement noise, positive definite.
    H : array, shape (k, n) or (runs, k, n)
    predicted : array, shape (runs, k), optional
        Default: H mean, a linear measurement.
    spread : array, shape (runs, k, k), optional
        Second-order part of the innovation covariance (`moments.measurement`).

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit, a number is not finite or `R` or `P` is no covariance.

    References
    ----------
    Jazwinski (1970), theorem 8.1 and section 9.3; R. S. Bucy and P. D. Joseph,
    *Filtering for Stochastic Processes*, 1968, for the form of the covariance.
    """
    sizes = {}
    mean = checks.in_place("mean", mean, ("runs", "states"), sizes)
    P = checks.in_place("P", P, ("runs", "states", "states"), sizes)
    z = checks.array("z", z, ("runs", "measurements"), sizes)
    R = checks.covariance("R", R, z.shape[1], definite=True)
    H, predicted, spread = _expansion(H, predicted, spread, sizes)
    variances = np.diagonal(P, axis1=1, axis2=2)
    if (variances < 0).any():
        raise ParameterError("P", float(variances.min()), "must have no variance below zero")
    scale = np.sqrt(variances.max())  # rounding only, whatever the units
    if np.abs(P - P.transpose(0, 2, 1)).max() > 1e-9 * scale**2:
        raise ParameterError("P", P.shape, "must be symmetric, run by run")
    return _corrected(mean, P, z, R, H, predicted, spread)


def _expansion(H, predicted, spread, sizes):
    """Return the checked linear or expanded measurement; H as (runs or 1, k, n)."""
    each = checks.array("H", H, (...,)).ndim == 3
    shape = ("runs", "measurements", "states") if each else ("measurements", "states")
    H = checks.array("H", H, shape, sizes)
    if predicted is not None:
        predicted = checks.array("predicted", predicted, ("runs", "measurements"), sizes)
    if spread is not None:
        shape = ("runs", "measurements", "measurements")
        spread = checks.array("spread", spread, shape, sizes)
    return H if each else H[None], predicted, spread


def _corrected(mean, P, z, R, H, predicted=None, spread=None):
    """`update` of what has been checked; H is (runs or 1, k, n)."""
    if predicted is None:
        predicted = np.einsum("rai,ri->ra", np.broadcast_to(H, (len(mean), *H.shape[1:])), mean)
    R = R[None] if spread is None else R + spread
    nis = np.empty(len(mean))
    _update(mean, P, np.ascontiguousarray(predicted), H, R, z, nis)
    return nis


@dataclass(frozen=True, eq=False)
class Track:
    """What a filter estimated, sample 0 being the start.

    Attributes
    ----------
    mean : ndarray, shape (runs, samples, n)
    P : ndarray, shape (runs, samples, n, n)
        After the measurement of each sample.
    nis : ndarray, shape (runs, samples)
        NaN at sample 0. For the particle filter: effective sample size.
    """

    mean: np.ndarray
    P: np.ndarray
    nis: np.ndarray


def _prepared(
    x0: ArrayLike, P0: ArrayLike, z: ArrayLike, interval: float, step: float, R: Any, H: Any, *,
    cloud: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, Any, Any, int]:  # fmt: skip
    """Return the checked arguments that all filters share, and the steps of an interval.

    A `cloud` of particles is drawn from P0 and weighed by R and an array H.
    """
    sizes = {}
    z = checks.array("z", z, ("runs", "samples", "measurements"), sizes)
    x0 = checks.array("x0", x0, ("states",), sizes)
    P0 = checks.covariance("P0", P0, len(x0), definite=cloud)
    if R is not None or cloud:
        R = checks.covariance("R", R, z.shape[2], definite=True)
        if not callable(H) or cloud:
            H = checks.array("H", H, ("measurements", "states"), sizes)
    return x0, P0, z, R, H, checks.parts("step", step, "interval", interval)


@kernel
def _set_aside(mean, P, gone, limit, x0, P0):
    # Marks runs that have diverged; the prior takes their place, to do no harm in the batch.
    runs, n = mean.shape
    some = False
    for run in range(runs):
        for i in range(n):
            # Written so that NaN counts as diverged.
            if not (abs(mean[run, i]) < limit and P[run, i, i] >= 0.0):
                gone[run] = True
            for j in range(n):
                if not abs(P[run, i, j]) < limit * limit:
                    gone[run] = True
        if gone[run]:
            some = True
            mean[run] = x0
            P[run] = P0
    return some


def run(
    propagate: Propagator,
    x0: ArrayLike,
    P0: ArrayLike,
    z: np.ndarray,
    interval: float,
    step: float,
    R: Any = None,
    H: Any = None,
    forces: Callable | None = None,
    parameters: ArrayLike = (),
    limit: float = 1e100,
) -> Track | None:
    """Run a continuous–discrete filter on a batch of measurement records.

    Parameters
    ----------
    propagate : seanav.filters.moments.generated.Propagator
    x0 : array, shape (n,); P0 : array, shape (n, n)
        Prior at time 0; a certain start, P0 = 0, is allowed.
    z : array, shape (runs, samples - 1, k)
        Measurements at the times `interval`, 2 `interval`, …
    interval, step : float
        Between measurements and of the integration, s; the step divides the interval.
    R : array, shape (k, k), optional
        Positive definite. None: never correct (the one-stage estimator, prediction only).
    H : array (k, n) or seanav.filters.moments.generated.Predictor
        Linear measurement, or one that is expanded to second order.
    forces : callable, optional
        Inputs at given times: (times,) -> (times, inputs).
    parameters : sequence of float
    limit : float
        A run has diverged, and is NaN from then on, when its mean leaves ±`limit`, its
        covariance ±`limit`², or a variance is negative. The others go on.

    Returns
    -------
    Track

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit, a number is not finite, `R` or `P0` is no covariance, or the
        step does not divide the interval.
    """
    x0, P0, z, R, H, steps = _prepared(x0, P0, z, interval, step, R, H, cloud=False)
    limit = checks.number("limit", limit, above=0, at_most=1e100)
    (runs, count, k), n = z.shape, len(x0)
    mean, P = np.tile(x0, (runs, 1)), np.tile(P0, (runs, 1, 1))
    means, Ps = np.empty((runs, count + 1, n)), np.empty((runs, count + 1, n, n))
    nis = np.full((runs, count + 1), np.nan)
    means[:, 0], Ps[:, 0] = mean, P
    gone = np.zeros(runs, dtype=bool)
    for t in range(count):
        times = interval * (t + np.arange(2 * steps + 1) / (2 * steps))
        inputs = forces(times) if forces else None
        propagate(mean, P, interval, interval / steps, inputs, parameters)
        if R is not None and callable(H):
            _set_aside(mean, P, gone, limit, x0, P0)
            inputs = forces(times[-1:]) if forces else None
            predicted, slope, spread = H(mean, P, inputs, parameters)
            sizes = {"runs": runs, "measurements": k, "states": n}
            expanded = _expansion(slope, predicted, spread, sizes)
            nis[:, t + 1] = _corrected(mean, P, z[:, t], R, *expanded)
        elif R is not None:
            nis[:, t + 1] = _corrected(mean, P, z[:, t], R, H[None])
        some_gone = _set_aside(mean, P, gone, limit, x0, P0)
        means[:, t + 1], Ps[:, t + 1] = mean, P
        if some_gone:
            means[gone, t + 1], Ps[gone, t + 1], nis[gone, t + 1] = np.nan, np.nan, np.nan
    return Track(means, Ps, nis)
