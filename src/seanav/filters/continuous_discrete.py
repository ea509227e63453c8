"""Filters between discrete measurements of a continuous process: two stages, one loop.

Between measurements mean and covariance are integrated together, as one system of
differential equations (no frozen Jacobian); at a measurement they are corrected in
Joseph form. With the closure ``"ekf"`` this is the continuous–discrete EKF, with
``"gaussian"`` the filter of paper 1. The particle filter is the reference.
"""

from dataclasses import dataclass

import numpy as np

from seanav._compile import kernel
from seanav.checks import ParameterError, integer
from seanav.filters.generated import steps_within


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


def update(mean, P, z, R, H=None, predicted=None, spread=None):
    """Correct `mean` and `P` in place with a measurement; return the NIS, shape (runs,).

    Parameters
    ----------
    mean : ndarray, shape (runs, n); P : ndarray, shape (runs, n, n)
    z : ndarray, shape (runs, k)
    R : ndarray, shape (k, k)
        Covariance of the measurement noise.
    H : ndarray, shape (k, n) or (runs, k, n)
    predicted : ndarray, shape (runs, k), optional
        Default: H mean, a linear measurement.
    spread : ndarray, shape (runs, k, k), optional
        Second-order part of the innovation covariance (`moments.measurement`).

    References
    ----------
    Jazwinski (1970), theorem 8.1 and section 9.3; R. S. Bucy and P. D. Joseph,
    *Filtering for Stochastic Processes*, 1968, for the form of the covariance.
    """
    H, R = (np.ascontiguousarray(np.atleast_3d(a.T).T, dtype=float) for a in (H, R))
    if predicted is None:
        predicted = np.einsum("rai,ri->ra", np.broadcast_to(H, (len(mean), *H.shape[1:])), mean)
    if spread is not None:
        R = R + spread
    nis = np.empty(len(mean))
    z = np.ascontiguousarray(z, dtype=float)
    _update(mean, P, np.ascontiguousarray(predicted), H, np.ascontiguousarray(R), z, nis)
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


def checked_noise(R):
    """Return `R` as (k, k) array, or raise `ParameterError` if it is no covariance."""
    R = np.asarray(R, dtype=float)
    square = R.ndim == 2 and R.shape[0] == R.shape[1]
    if not square or not np.isfinite(R).all() or not np.allclose(R, R.T):
        raise ParameterError("R", R.tolist(), "must be a symmetric matrix")
    if np.linalg.eigvalsh(R).min() <= 0:
        raise ParameterError("R", R.tolist(), "must be positive definite")
    return R


def run(propagate, x0, P0, z, interval, step, R=None, H=None, forces=None, parameters=()):
    """Run a continuous–discrete filter on a batch of measurement records.

    Parameters
    ----------
    propagate : seanav.filters.generated.Propagator
    x0 : ndarray, shape (n,); P0 : ndarray, shape (n, n)
        Prior at time 0.
    z : ndarray, shape (runs, samples - 1, k)
        Measurements at the times `interval`, 2 `interval`, …
    interval, step : float
        Between measurements, and the largest integration step, s.
    R : ndarray, shape (k, k), optional
        None: never correct (the one-stage estimator, prediction only).
    H : ndarray (k, n) or seanav.filters.generated.Predictor
        Linear measurement, or one that is expanded to second order.
    forces : callable, optional
        Inputs at given times: (times,) -> (times, inputs).
    parameters : sequence of float

    Returns
    -------
    Track
    """
    runs, count = z.shape[:2]
    n = len(x0)
    mean = np.tile(np.asarray(x0, dtype=float), (runs, 1))
    P = np.tile(np.asarray(P0, dtype=float), (runs, 1, 1))
    if R is not None:
        R = checked_noise(R)
    means, Ps = np.empty((runs, count + 1, n)), np.empty((runs, count + 1, n, n))
    nis = np.full((runs, count + 1), np.nan)
    means[:, 0], Ps[:, 0] = mean, P
    steps = steps_within(interval, step)
    for k in range(count):
        times = interval * (k + np.arange(2 * steps + 1) / (2 * steps))
        propagate(mean, P, interval, step, forces(times) if forces else None, parameters)
        if R is not None and callable(H):
            now = forces(times[-1:]) if forces else None
            predicted, slope, spread = H(mean, P, now, parameters)
            nis[:, k + 1] = update(mean, P, z[:, k], R, slope, predicted, spread)
        elif R is not None:
            nis[:, k + 1] = update(mean, P, z[:, k], R, H)
        means[:, k + 1], Ps[:, k + 1] = mean, P
    return Track(means, Ps, nis)


@kernel
def systematic(weights, offset):
    """Return the indices of systematic resampling, for weights that sum to one."""
    count = len(weights)
    chosen = np.empty(count, np.int64)
    total, source = weights[0], 0
    for i in range(count):
        level = (i + offset) / count
        while total < level and source < count - 1:
            source += 1
            total += weights[source]
        chosen[i] = source
    return chosen


def particle_filter(
    simulate, x0, P0, z, interval, step, R, H, generators, particles, forces=None, parameters=()
):
    """Run a bootstrap particle filter on each record, systematic resampling at each sample.

    Parameters
    ----------
    simulate : seanav.filters.generated.Simulator
    generators : list of numpy.random.Generator, one per run
    particles : int

    Others as in `run`; `H` is a (k, n) array.

    Returns
    -------
    Track
        `nis` holds the effective sample size 1/Σw² before resampling: near 1 the
        filter has collapsed and is no reference.

    References
    ----------
    N. J. Gordon, D. J. Salmond and A. F. M. Smith, "Novel approach to
    nonlinear/non-Gaussian Bayesian state estimation", *IEE Proceedings F* 140 (1993).
    """
    integer("particles", particles, at_least=2)
    runs, count = z.shape[:2]
    n = len(x0)
    inverse = np.linalg.inv(checked_noise(R))
    root = np.linalg.cholesky(P0)
    steps = steps_within(interval, step)
    means, Ps = np.empty((runs, count + 1, n)), np.empty((runs, count + 1, n, n))
    sizes = np.full((runs, count + 1), np.nan)
    means[:, 0], Ps[:, 0] = x0, P0
    for r, generator in enumerate(generators):
        x = x0 + np.einsum("ij,pj->pi", root, generator.standard_normal((particles, n)))
        for k in range(count):
            times = interval * (k + np.arange(steps + 1) / steps)
            noise = generator.standard_normal((particles, steps, simulate.model.diffusion.shape[1]))
            inputs = forces(times) if forces else None
            simulate(x, noise, interval / steps, inputs, parameters, steps)
            residual = z[r, k] - np.einsum("ai,pi->pa", H, x)
            log = -0.5 * np.einsum("pa,ab,pb->p", residual, inverse, residual)
            weights = np.exp(log - log.max())
            weights /= weights.sum()
            means[r, k + 1] = np.einsum("p,pi->i", weights, x)
            offset = x - means[r, k + 1]
            Ps[r, k + 1] = np.einsum("pi,pj->ij", weights[:, None] * offset, offset)
            sizes[r, k + 1] = 1.0 / (weights**2).sum()
            x = x[systematic(weights, generator.random())]
    return Track(means, Ps, sizes)
