"""Kalman filters that scale Q by fading factors once their innovations look too large.

Single fading factor: one number for the whole of Q, from the trace of the innovations'
covariance, (26). Multiple fading factors: one number for each state, from its diagonal,
(29)–(32). Either is used only at steps where a test on the innovation says fault.

`seanav.filters.fading`, of another paper, is the other adaptive fading: its one factor is
never below one, comes from the last residuals without a test, and scales a standard deviation
of the model (of one block of states) or P itself. Here the factors scale the process noise
covariance Q of each state, from the same innovations.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import chi2

from seanav._compile import kernel
from seanav.checks import ParameterError, array, choice, covariance, integer, number
from seanav.filters import kalman

METHODS = ("single", "multiple")


class AdaptiveTrack(NamedTuple):
    """A `seanav.filters.kalman.Track` and what the adaptation did.

    Attributes
    ----------
    x, P, innovation : ndarray
        As in `Track`.
    nis : ndarray (runs, steps)
        β of (39) AFTER adaptation: small by construction, it no longer tells of faults.
    before : ndarray (runs, steps)
        β BEFORE adaptation: the number on which the decision rests.
    factors : ndarray (runs, steps, n)
        Fading factors; all equal for the single one, 1 where nothing was adapted.
    """

    x: np.ndarray
    P: np.ndarray
    innovation: np.ndarray
    nis: np.ndarray
    before: np.ndarray
    factors: np.ndarray


def threshold(alpha: float, m: int) -> float:
    """Return the value that β exceeds with probability `alpha` in a healthy system, (40).

    Parameters
    ----------
    alpha : float
        Level of significance, between 0 and 1, ends excluded.
    m : int
        Number of measurements: the degrees of freedom.
    """
    alpha = number("alpha", alpha, above=0, below=1)
    return float(chi2.isf(alpha, integer("m", m, at_least=1, at_most=10**6)))


def weights(H: ArrayLike, Q: ArrayLike, method: str) -> np.ndarray:
    """Return W (n, m, m) with factor_i = Σ_ab W[i, a, b] (C − H Phi P Phiᵀ Hᵀ − R)_ab.

    `C` is the innovations' sample covariance. Single: (26), W = I / tr(H Q Hᵀ) for every
    i. Multiple: the diagonal of H⁺ (C − …) (H Q Hᵀ)⁻¹ H, which is (29) for a square H.
    The pseudo-inverse extends (29) to fewer measurements than states; the factor of a
    state that no measurement contains is then 0 and the floor of (31) keeps it at 1.

    Parameters
    ----------
    H : array (m, n)
        Measurement matrix.
    Q : array (n, n)
        Covariance of the process noise in the states, G Q Gᵀ in the paper's letters.
    method : {"single", "multiple"}

    Raises
    ------
    seanav.checks.ParameterError
        As for `seanav.filters.kalman.run`, and if H has not full row rank or H Q Hᵀ is
        singular.
    """
    choice("method", method, METHODS)
    H = array("H", H, ("measurements", "states"))
    m, n = H.shape
    Q = covariance("Q", Q, n)
    if np.linalg.matrix_rank(H) < m:
        raise ParameterError("H", H.tolist(), "must have full row rank")
    noise = H @ Q @ H.T
    if method == "single":
        if not np.trace(noise) > 0:
            raise ParameterError("Q", Q.tolist(), "must give H Q Hᵀ a positive trace")
        return np.repeat((np.eye(m) / np.trace(noise))[None], n, axis=0)
    # Singular or not must not depend on units: judge the correlation matrix.
    spread = np.sqrt(np.diagonal(noise))
    usable = (spread > 0).all()
    if not usable or np.linalg.cond(noise / np.outer(spread, spread)) > 1e12:
        raise ParameterError("Q", Q.tolist(), "must not make H Q Hᵀ singular")
    right = np.linalg.solve(noise, H)  # (m, n)
    return np.ascontiguousarray(np.einsum("ia,bi->iab", np.linalg.pinv(H), right))


@kernel
def _inflate(P, Q, factors, out):
    # √Λ Q √Λ: equal to Λ Q for a diagonal Q, and symmetric for any other. The sign matters
    # only for the single factor without its floor, which may be negative.
    n, _, runs = P.shape
    for i in range(n):
        for j in range(i + 1):
            row, old, left, right, q = out[i, j], P[i, j], factors[i], factors[j], Q[i, j]
            for r in range(runs):
                row[r] = old[r] + np.copysign(np.sqrt(left[r] * right[r]), left[r]) * q
            kalman._mirror(out, i, j)


class _Model(NamedTuple):
    """The model of `seanav.filters.kalman.run`."""

    Phi: np.ndarray
    offsets: np.ndarray
    H: np.ndarray
    Q: np.ndarray
    R: np.ndarray


class _Rule(NamedTuple):
    """When and how much to fade."""

    W: np.ndarray  # see `weights`
    window: int
    limit: float  # of β
    use_trace: bool  # (24) instead of (41)
    floor: float


class _Told(NamedTuple):
    """What is told of every step: `AdaptiveTrack` with the runs innermost."""

    x: np.ndarray
    P: np.ndarray
    innovation: np.ndarray
    nis: np.ndarray
    before: np.ndarray
    factors: np.ndarray


@kernel
def _fading(rule, innovations, k, S, S0, beta, fault, factors):
    # S contains Q once, S0 not at all; both contain R.
    W, floor, limit = rule.W, rule.floor, rule.limit
    m, runs = innovations.shape[1], innovations.shape[2]
    n = W.shape[0]
    first = max(0, k + 1 - rule.window)
    for r in range(runs):
        fault[r] = beta[r] - limit
    if rule.use_trace:
        for r in range(runs):
            fault[r] = 0.0
        for a in range(m):
            one, spread = innovations[k, a], S[a, a]
            for r in range(runs):
                fault[r] += one[r] * one[r] - spread[r]
    for i in range(n):
        row = factors[i]
        for r in range(runs):
            row[r] = 0.0
    for a in range(m):
        for b in range(m):
            # S is not needed any more: its place takes the excess C − S0.
            excess, base = S[a, b], S0[a, b]
            for r in range(runs):
                excess[r] = 0.0
            for step in range(first, k + 1):
                left, right = innovations[step, a], innovations[step, b]
                for r in range(runs):
                    excess[r] += left[r] * right[r]
            count = float(k + 1 - first)
            for r in range(runs):
                excess[r] = excess[r] / count - base[r]
            for i in range(n):
                weight = W[i, a, b]
                if weight != 0.0:
                    row = factors[i]
                    for r in range(runs):
                        row[r] += weight * excess[r]
    for i in range(n):
        row = factors[i]
        for r in range(runs):
            at_least = max(floor, row[r])
            row[r] = at_least if fault[r] > 0.0 else 1.0


@kernel
def _run(model, rule, x, P, z, told):
    Phi, offsets, H, Q, R = model
    x_out, P_out, innovations, nis, before, factors = told
    steps, m, runs = z.shape
    n = Phi.shape[0]
    half, A, base = np.empty((n, n, runs)), np.empty((n, n, runs)), np.empty((n, n, runs))
    PHt, K = np.empty((n, m, runs)), np.empty((n, m, runs))
    S, S0, L = np.empty((m, m, runs)), np.empty((m, m, runs)), np.empty((m, m, runs))
    white, fault = np.empty((m, runs)), np.empty(runs)
    for k in range(steps):
        x_new, P_new = x_out[k], P_out[k]
        kalman._propagate(Phi, x, offsets[k], P, half, x_new, base)
        kalman._innovate(H, z[k], x_new, innovations[k])
        kalman._innovation_covariance(H, R, base, PHt, S0)
        # Once with Q as it is, to decide and to find the factors; once more with them.
        factors[k, :, :] = 1.0
        _inflate(base, Q, factors[k], P_new)
        _normalise(H, R, P_new, innovations[k], PHt, S, L, white, before[k])
        _fading(rule, innovations, k, S, S0, before[k], fault, factors[k])
        _inflate(base, Q, factors[k], P_new)
        _normalise(H, R, P_new, innovations[k], PHt, S, L, white, nis[k])
        kalman._correct(H, R, L, PHt, innovations[k], x_new, P_new, K, A, half)
        x, P = x_new, P_new


@kernel
def _normalise(H, R, P, innovation, PHt, S, L, white, nis):
    kalman._innovation_covariance(H, R, P, PHt, S)
    kalman._factorise(S, L)
    kalman._normalised_square(L, innovation, white, nis)


def run(
    Phi: ArrayLike, offsets: ArrayLike, H: ArrayLike, Q: ArrayLike, R: ArrayLike,
    x0: ArrayLike, P0: ArrayLike, z: ArrayLike, *, method: str, window: int = 1,
    trigger: str = "chi2", alpha: float = 0.05, floor: float = 1.0,
) -> AdaptiveTrack:  # fmt: skip
    """Run a Kalman filter with single or multiple fading factors over a batch of runs.

    Parameters
    ----------
    Phi, offsets, H, Q, R, x0, P0, z
        As for `seanav.filters.kalman.run`; Q is G Q Gᵀ.
    method : {"single", "multiple"}
        (26) and (27), or (29)–(32).
    window : int
        μ, number of latest innovations averaged, the present one included; at the start
        as many as there are. 1 is (26) as printed.
    trigger : {"chi2", "trace"}
        Adapt where β > χ²_α, (41), or where the trace rule (24) says so.
    alpha : float
        Level of significance of the χ² test.
    floor : float
        Least factor where adapted, 1 as in (31); (26) as printed has none: ``-inf``.

    Returns
    -------
    AdaptiveTrack

    Raises
    ------
    seanav.checks.ParameterError
        As for `seanav.filters.kalman.run` and `weights`, and for a window below 1, an
        `alpha` outside (0, 1), or an unknown method or trigger.
    """
    choice("method", method, METHODS)
    choice("trigger", trigger, ("chi2", "trace"))
    window = integer("window", window, at_least=1)
    if not (isinstance(floor, float) and floor == -np.inf):  # which is no floor at all
        floor = number("floor", floor)
    model, x, P, measured, out = kalman._prepare(Phi, offsets, H, Q, R, x0, P0, z)
    limit = threshold(alpha, measured.shape[1])
    W = weights(model[2], model[3], method)
    told = _Told(*(*out, np.empty_like(out[3]), np.empty_like(out[0])))  # before and factors
    window = min(window, measured.shape[0])  # there are no more
    rule = _Rule(W, window, limit, trigger == "trace", floor)
    _run(_Model(*model), rule, x, P, measured, told)
    return AdaptiveTrack(*kalman._track(*out), told.before.T, told.factors.transpose(2, 0, 1))
