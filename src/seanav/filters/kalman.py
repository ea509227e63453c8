"""The linear Kalman filter for a batch of runs: algebra only, runs innermost.

The small kernels are the parts of one step. They work on arrays whose last axis is the
run, so that the compiler vectorises over the runs, and other filters of this package are
built from them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seanav._compile import kernel
from seanav.checks import array, covariance


class Track(NamedTuple):
    """What a filter returns for a batch of runs; views with the runs innermost in memory.

    Attributes
    ----------
    x : ndarray (runs, steps, n)
        Estimates after each measurement.
    P : ndarray (runs, steps, n, n)
        Their covariances, as the filter believes.
    innovation : ndarray (runs, steps, m)
        Measurement minus its prediction.
    nis : ndarray (runs, steps)
        Innovation squared, normalised by the covariance S the gain is computed with.
    """

    x: np.ndarray
    P: np.ndarray
    innovation: np.ndarray
    nis: np.ndarray


# ---------------------------------------------------------------- parts of one step


@kernel
def _propagate(Phi, x, offset, P, half, x_out, P_out):
    """Put Phi x + offset and Phi P Phiᵀ, without process noise, into `x_out` and `P_out`."""
    n, runs = x.shape
    for i in range(n):
        mean = x_out[i]
        for r in range(runs):
            mean[r] = offset[i]
        for j in range(n):
            row = half[i, j]
            for r in range(runs):
                row[r] = 0.0
        for k in range(n):
            gain = Phi[i, k]
            if gain != 0.0:  # a transition matrix is mostly zeros
                before = x[k]
                for r in range(runs):
                    mean[r] += gain * before[r]
                for j in range(n):
                    row, old = half[i, j], P[k, j]
                    for r in range(runs):
                        row[r] += gain * old[r]
    for i in range(n):
        for j in range(i + 1):
            row = P_out[i, j]
            for r in range(runs):
                row[r] = 0.0
            for k in range(n):
                gain = Phi[j, k]
                if gain != 0.0:
                    old = half[i, k]
                    for r in range(runs):
                        row[r] += gain * old[r]
            _mirror(P_out, i, j)


@kernel
def _mirror(P, i, j):
    """Copy P[i, j] to P[j, i]."""
    if i != j:
        here, there = P[i, j], P[j, i]
        for r in range(here.shape[0]):
            there[r] = here[r]


@kernel
def _add_constant(P, Q):
    """Add the matrix `Q`, the same for all runs, to `P`."""
    n, _, runs = P.shape
    for i in range(n):
        for j in range(n):
            row, add = P[i, j], Q[i, j]
            for r in range(runs):
                row[r] += add


@kernel
def _innovate(H, z, x, out):
    """Put z − H x into `out` (m, runs)."""
    m, n = H.shape
    runs = x.shape[1]
    for a in range(m):
        row, measured = out[a], z[a]
        for r in range(runs):
            row[r] = measured[r]
        for k in range(n):
            gain = H[a, k]
            if gain != 0.0:
                state = x[k]
                for r in range(runs):
                    row[r] -= gain * state[r]


@kernel
def _innovation_covariance(H, R, P, PHt, S):
    """Put P Hᵀ into `PHt` (n, m, runs) and H P Hᵀ + R into `S` (m, m, runs)."""
    m, n = H.shape
    runs = P.shape[2]
    for i in range(n):
        for a in range(m):
            row = PHt[i, a]
            for r in range(runs):
                row[r] = 0.0
            for k in range(n):
                gain = H[a, k]
                if gain != 0.0:
                    old = P[i, k]
                    for r in range(runs):
                        row[r] += gain * old[r]
    for a in range(m):
        for b in range(a + 1):
            row, start = S[a, b], R[a, b]
            for r in range(runs):
                row[r] = start
            for k in range(n):
                gain = H[a, k]
                if gain != 0.0:
                    old = PHt[k, b]
                    for r in range(runs):
                        row[r] += gain * old[r]
            _mirror(S, a, b)


@kernel
def _factorise(S, L):
    """Put the Cholesky factor of `S` into `L`, with the inverse of its diagonal on the diagonal."""
    m, _, runs = S.shape
    for b in range(m):
        for a in range(b, m):
            row, start = L[a, b], S[a, b]
            for r in range(runs):
                row[r] = start[r]
            for k in range(b):
                left, right = L[a, k], L[b, k]
                for r in range(runs):
                    row[r] -= left[r] * right[r]
        pivot = L[b, b]
        for r in range(runs):
            pivot[r] = 1.0 / np.sqrt(pivot[r])
        for a in range(b + 1, m):
            row = L[a, b]
            for r in range(runs):
                row[r] *= pivot[r]


@kernel
def _normalised_square(L, innovation, white, out):
    """Put the innovation in units of its own spread into `white` and its square into `out`."""
    m, runs = innovation.shape
    for r in range(runs):
        out[r] = 0.0
    for a in range(m):
        row, start = white[a], innovation[a]
        for r in range(runs):
            row[r] = start[r]
        for b in range(a):
            left, done = L[a, b], white[b]
            for r in range(runs):
                row[r] -= left[r] * done[r]
        pivot = L[a, a]
        for r in range(runs):
            row[r] *= pivot[r]
            out[r] += row[r] * row[r]


@kernel
def _correct(H, R, L, PHt, innovation, x, P, K, A, half):
    """Correct `x` and `P` in place with the gain P Hᵀ S⁻¹; covariance in Joseph's form."""
    m, n = H.shape
    runs = x.shape[1]
    for i in range(n):
        # Solve K S = P Hᵀ by the factor of S: forward, then backward.
        for a in range(m):
            row, start = K[i, a], PHt[i, a]
            for r in range(runs):
                row[r] = start[r]
            for b in range(a):
                left, done = L[a, b], K[i, b]
                for r in range(runs):
                    row[r] -= left[r] * done[r]
            pivot = L[a, a]
            for r in range(runs):
                row[r] *= pivot[r]
        for a in range(m - 1, -1, -1):
            row = K[i, a]
            for b in range(a + 1, m):
                left, done = L[b, a], K[i, b]
                for r in range(runs):
                    row[r] -= left[r] * done[r]
            pivot = L[a, a]
            for r in range(runs):
                row[r] *= pivot[r]
        state = x[i]
        for a in range(m):
            gain, step = K[i, a], innovation[a]
            for r in range(runs):
                state[r] += gain[r] * step[r]
        for j in range(n):
            row = A[i, j]
            same = 1.0 if i == j else 0.0
            for r in range(runs):
                row[r] = same
            for a in range(m):
                if H[a, j] != 0.0:
                    gain, weight = K[i, a], H[a, j]
                    for r in range(runs):
                        row[r] -= gain[r] * weight
    for i in range(n):
        for j in range(n):
            row = half[i, j]
            for r in range(runs):
                row[r] = 0.0
            for k in range(n):
                left, right = A[i, k], P[k, j]
                for r in range(runs):
                    row[r] += left[r] * right[r]
    for i in range(n):
        for j in range(i + 1):
            row = P[i, j]
            for r in range(runs):
                row[r] = 0.0
            for k in range(n):
                left, right = half[i, k], A[j, k]
                for r in range(runs):
                    row[r] += left[r] * right[r]
            for a in range(m):
                for b in range(m):
                    if R[a, b] != 0.0:
                        weight, left, right = R[a, b], K[i, a], K[j, b]
                        for r in range(runs):
                            row[r] += weight * left[r] * right[r]
            _mirror(P, i, j)


# ---------------------------------------------------------------- the filter


@kernel
def _run(Phi, offsets, H, Q, R, x, P, z, x_out, P_out, innovations, nis):
    steps, m, runs = z.shape
    n = Phi.shape[0]
    half, A = np.empty((n, n, runs)), np.empty((n, n, runs))
    PHt, K = np.empty((n, m, runs)), np.empty((n, m, runs))
    S, L, white = np.empty((m, m, runs)), np.empty((m, m, runs)), np.empty((m, runs))
    for k in range(steps):
        x_new, P_new = x_out[k], P_out[k]
        _propagate(Phi, x, offsets[k], P, half, x_new, P_new)
        _add_constant(P_new, Q)
        _innovate(H, z[k], x_new, innovations[k])
        _innovation_covariance(H, R, P_new, PHt, S)
        _factorise(S, L)
        _normalised_square(L, innovations[k], white, nis[k])
        _correct(H, R, L, PHt, innovations[k], x_new, P_new, K, A, half)
        x, P = x_new, P_new


def run(
    Phi: ArrayLike,
    offsets: ArrayLike,
    H: ArrayLike,
    Q: ArrayLike,
    R: ArrayLike,
    x0: ArrayLike,
    P0: ArrayLike,
    z: ArrayLike,
) -> Track:
    """Run the Kalman filter (17)–(21) over a batch of runs.

    Parameters
    ----------
    Phi : array (n, n)
        Transition over one step.
    offsets : array (steps, n)
        What the known input adds during each step.
    H : array (m, n)
        Measurement matrix.
    Q : array (n, n)
        Covariance of the process noise in the states, G Q Gᵀ in the paper's letters.
    R : array (m, m)
        Covariance of the measurement noise.
    x0 : array (runs, n)
        Estimates before the first step.
    P0 : array (n, n)
        Their covariance.
    z : array (runs, steps, m)
        Measurements, the first after one step.

    Returns
    -------
    Track

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit, a number is not finite, or a covariance is not symmetric
        and positive (R definite, Q and P0 semidefinite).
    """
    model, x, P, z, out = _prepare(Phi, offsets, H, Q, R, x0, P0, z)
    _run(*model, x, P, z, *out)
    return _track(*out)


def _prepare(Phi, offsets, H, Q, R, x0, P0, z):
    """Check the inputs of a filter and lay them out with the runs innermost."""
    sizes = {}
    z = array("z", z, ("runs", "steps", "measurements"), sizes, contiguous=False)
    Phi = array("Phi", Phi, ("states", "states"), sizes)
    H = array("H", H, ("measurements", "states"), sizes)
    offsets = array("offsets", offsets, ("steps", "states"), sizes)
    x0 = array("x0", x0, ("runs", "states"), sizes)
    (runs, steps, m), n = z.shape, len(Phi)
    Q, P0 = covariance("Q", Q, n), covariance("P0", P0, n)
    R = covariance("R", R, m, definite=True)
    x = np.ascontiguousarray(x0.T)
    P = np.repeat(P0[:, :, None], runs, axis=2)
    z = np.ascontiguousarray(z.transpose(1, 2, 0))
    shapes = ((steps, n, runs), (steps, n, n, runs), (steps, m, runs), (steps, runs))
    return (Phi, offsets, H, Q, R), x, P, z, tuple(np.empty(shape) for shape in shapes)


def _track(x: np.ndarray, P: np.ndarray, innovation: np.ndarray, nis: np.ndarray) -> Track:
    """Return kernel outputs, runs innermost, as a `Track`, runs first; nothing is copied."""
    return Track(
        x.transpose(2, 0, 1), P.transpose(3, 0, 1, 2), innovation.transpose(2, 0, 1), nis.T
    )


@kernel
def _nees(errors, P, out):
    steps, n, runs = errors.shape
    L, white = np.empty((n, n, runs)), np.empty((n, runs))
    for k in range(steps):
        _factorise(P[k], L)
        _normalised_square(L, errors[k], white, out[k])


def nees(errors: ArrayLike, P: ArrayLike) -> np.ndarray:
    """Return the normalised estimation error squared, (runs, steps).

    NaN where a P is not positive definite: rounding has used up what the filter knew of it.

    Parameters
    ----------
    errors : array (runs, steps, n)
        Estimate minus truth.
    P : array (runs, steps, n, n)
        Covariances of a `Track`.

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit or a number is not finite.
    """
    sizes, axes = {}, ("runs", "steps", "states")
    errors = array("errors", errors, axes, sizes, contiguous=False)
    P = array("P", P, (*axes, "states"), sizes, contiguous=False)
    out = np.empty(errors.shape[1::-1])
    _nees(
        np.ascontiguousarray(errors.transpose(1, 2, 0)),
        np.ascontiguousarray(P.transpose(1, 2, 3, 0)),
        out,
    )
    out[~np.isfinite(out)] = np.nan
    return out.T
