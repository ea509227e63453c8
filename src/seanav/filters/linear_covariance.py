"""What a Kalman filter with a wrong model really does: exact second moments.

The gains are those of the filter's own model; the error they cause under the true model
is followed through the same linear recursion. Both moments are linear in the true noise,
so the mean square for a true strength s of one source is A + s² B.

Source: P. S. Maybeck, *Stochastic Models, Estimation, and Control*, vol. 1, Academic
Press, 1979, section 6.8.
"""

import numpy as np
from numpy.typing import ArrayLike

from seanav._compile import kernel
from seanav.checks import array, covariance, integer, number


@kernel
def _sandwich(Phi, P, Q, work, out):
    n = P.shape[0]
    for i in range(n):
        for j in range(n):
            work[i, j] = 0.0
        for k in range(n):
            if Phi[i, k] != 0.0:
                for j in range(n):
                    work[i, j] += Phi[i, k] * P[k, j]
    for i in range(n):
        for j in range(i + 1):
            out[j, i] = Q[i] if i == j else 0.0
        for k in range(n):
            if Phi[i, k] != 0.0:
                for j in range(i + 1):
                    out[j, i] += work[j, k] * Phi[i, k]
        # Mirrored: rounding must not make it unsymmetric, which grows.
        for j in range(i):
            out[i, j] = out[j, i]


@kernel
def _innovation(prior, h, R, u):
    n = len(h)
    for i in range(n):
        u[i] = 0.0
        for j in range(n):
            u[i] += prior[i, j] * h[j]
    S = R
    for i in range(n):
        S += h[i] * u[i]
    return S


@kernel
def _design(Phi, Q, H, R, P0, gains, covariances):
    n = P0.shape[0]
    P, work, u = P0.copy(), np.empty((n, n)), np.empty(n)
    prior = np.empty((n, n))
    covariances[0] = P
    for step in range(Phi.shape[0]):
        _sandwich(Phi[step], P, Q, work, prior)
        S = _innovation(prior, H[step], R, u)
        for i in range(n):
            gains[step, i] = u[i] / S
            for j in range(n):
                P[i, j] = prior[i, j] - u[i] * u[j] / S
        covariances[step + 1] = P


@kernel
def _achieve(Phi, Q, H, R, M0, gains, moments):
    n = M0.shape[0]
    M, work, u = M0.copy(), np.empty((n, n)), np.empty(n)
    prior = np.empty((n, n))
    moments[0] = M
    for step in range(Phi.shape[0]):
        _sandwich(Phi[step], M, Q, work, prior)
        S = _innovation(prior, H[step], R, u)
        for i in range(n):
            for j in range(n):
                ki, kj = gains[step, i], gains[step, j]
                M[i, j] = prior[i, j] - ki * u[j] - u[i] * kj + ki * S * kj
        moments[step + 1] = M


@kernel
def _respond(Phi, H, gains, seen, d, work, out):
    steps, n = H.shape
    runs = seen.shape[1]
    for k in range(steps):
        for i in range(n):
            for r in range(runs):
                work[i, r] = 0.0
            for j in range(n):
                if Phi[k, i, j] != 0.0:
                    for r in range(runs):
                        work[i, r] += Phi[k, i, j] * d[j, r]
        for r in range(runs):
            rho = seen[k, r]
            for i in range(n):
                rho += H[k, i] * work[i, r]
            for i in range(n):
                d[i, r] = work[i, r] - gains[k, i] * rho
            for i in range(out.shape[1]):
                out[k, i, r] = d[i, r]


def design(
    Phi: ArrayLike, Q: ArrayLike, H: ArrayLike, R: float, P0: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """Return gains (steps, n) and covariances (steps + 1, n, n) of the filter's own model.

    Parameters
    ----------
    Phi : array (steps, n, n)
    Q : array (n,)
        Diagonal of the process noise per step.
    H : array (steps, n)
        Row of the one measurement at the end of each step.
    R : float
        Variance of its noise, above 0.
    P0 : array (n, n)

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit, a number is not finite, or a variance or covariance is none.
    """
    Phi, Q, H, P0 = _checked(Phi, Q, H, "P0", P0)
    gains = np.empty_like(H)
    covariances = np.empty((len(Phi) + 1, *P0.shape))
    _design(Phi, Q, H, number("R", R, above=0), P0, gains, covariances)
    return gains, covariances


def achieve(
    Phi: ArrayLike, Q: ArrayLike, H: ArrayLike, R: float, M0: ArrayLike, gains: ArrayLike
) -> np.ndarray:
    """Return the true second moments (steps + 1, n, n) of the error under given `gains`.

    Arguments and errors as in `design`, but of the true world: R may be 0, and gains 0 is
    a filter without updates.
    """
    Phi, Q, H, M0 = _checked(Phi, Q, H, "M0", M0)
    gains = array("gains", gains, H.shape)
    moments = np.empty((len(Phi) + 1, *M0.shape))
    _achieve(Phi, Q, H, number("R", R, at_least=0), M0, gains, moments)
    return moments


def respond(
    Phi: ArrayLike, H: ArrayLike, gains: ArrayLike, seen: ArrayLike, kept: int
) -> np.ndarray:
    """Return the errors (steps, kept, runs) of the first states that a disturbance causes.

    A disturbance that is no noise, such as a current that was measured, is seen by the
    measurement and by nothing else. The error that it causes is the filter's linear response
    to it, from an error of zero: its square adds to the moments that the noises cause.

    Parameters
    ----------
    Phi : array (steps, n, n); H, gains : array (steps, n)
        As in `design`.
    seen : array (steps, runs)
        What the disturbance adds to the predicted less the measured value.
    kept : int
        Number of states whose errors are returned.

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit or a number is not finite.
    """
    sizes: dict = {}
    Phi = array("Phi", Phi, ("steps", "states", "states"), sizes)
    H = array("H", H, ("steps", "states"), sizes)
    gains = array("gains", gains, ("steps", "states"), sizes)
    seen = array("seen", seen, ("steps", "runs"), sizes)
    n, runs = H.shape[1], seen.shape[1]
    kept = integer("kept", kept, at_least=1, at_most=n)
    out = np.empty((len(H), kept, runs))
    _respond(Phi, H, gains, seen, np.zeros((n, runs)), np.empty((n, runs)), out)
    return out


def _checked(
    Phi: ArrayLike, Q: ArrayLike, H: ArrayLike, name: str, start: ArrayLike
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    sizes = {}
    Phi = array("Phi", Phi, ("steps", "states", "states"), sizes)
    Q = array("Q", Q, ("states",), sizes, at_least=0)
    H = array("H", H, ("steps", "states"), sizes)
    return Phi, Q, H, covariance(name, start, len(Q))
