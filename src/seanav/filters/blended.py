"""The numerical filter that teaches the network of paper 2: Kalman, least squares, or between.

Stateczny, "Neural state estimation in sea navigation" (2000): equations of section 2 in the
form that makes the paper's own sentences true. The state is a speed vector measured directly,
F = G = I, so that every gain is one number. The weight w1 blends the last estimate with the
last measurement before each correction.
"""

from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from seanav import checks


def gains(q: float, R: float, P0: float, steps: int) -> tuple[np.ndarray, ...]:
    """Return the gains K and covariances P of a speed component by the Riccati recursion.

    Step 0 is the start: K[0] = 0 there, P[0] = P0. The same for each component.

    Parameters
    ----------
    q, R, P0 : float
        Variances, (m/s)²: process noise per step, measurement noise, start.
    steps : int
        Number of steps, start included.

    Returns
    -------
    K, P : ndarray, shape (steps,)
        P is the filter's own error covariance; it is the truth for w1 = 0 only.
    """
    q = checks.number("q", q, at_least=0)
    R = checks.number("R", R, above=0)
    P0 = checks.number("P0", P0, at_least=0)
    steps = checks.integer("steps", steps, at_least=1, at_most=10**7)
    K, P = np.zeros(steps), np.full(steps, P0)
    for i in range(1, steps):
        predicted = P[i - 1] + q
        K[i] = predicted / (predicted + R)
        P[i] = predicted - K[i] * predicted
    return K, P


def steady_gain(q: float, R: float) -> float:
    """Return the limit of the gain: the positive root of K² R = q (1 - K)."""
    ratio = checks.number("q", q, at_least=0) / checks.number("R", R, above=0)
    return (np.sqrt(ratio**2 + 4 * ratio) - ratio) / 2


def estimate(
    z: np.ndarray, K: ArrayLike, w1: ArrayLike, x0: ArrayLike, innovation: str = "blended"
) -> np.ndarray:
    """Return the intermediate estimate; w1 = 0 is the Kalman filter, w1 = 1 GLS.

    x_p = w1 z_i + (1 - w1) x_i is carried forward and corrected by z_{i+1}.

    Parameters
    ----------
    z : array, shape (runs, steps, 2)
        Measured speed vectors, m/s.
    K : array, shape (steps,)
        Gains from 0 to 1; K[0] is not used.
    w1 : float or array, shape (runs, steps)
        Weight of the running measurement in [0, 1], at step i for the way to i + 1.
    x0 : array, shape (runs, 2)
        Estimate at step 0, m/s.
    innovation : {"blended", "printed"}
        What the measurement is compared with: x_p, or the x_{i+1|i} = F x_i of the
        printed equation, which is not GLS for w1 = 1.

    Returns
    -------
    ndarray, shape (runs, steps, 2)

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit, a number is not finite, a weight or gain lies outside [0, 1],
        or `innovation` is unknown.

    Notes
    -----
    Paper, section 2, third set of equations.
    """
    checks.choice("innovation", innovation, ("blended", "printed"))
    z, K, x0, sizes = _series(z, K, x0)
    if isinstance(w1, Real):
        weight = np.full(z.shape[:2], checks.number("w1", w1, at_least=0, at_most=1))
    else:
        weight = checks.array("w1", w1, ("runs", "steps"), sizes, at_least=0, at_most=1)
    x = np.empty_like(z)
    x[:, 0] = x0
    for i in range(z.shape[1] - 1):
        w = weight[:, i, None]
        blend = w * z[:, i] + (1 - w) * x[:, i]
        expected = blend if innovation == "blended" else x[:, i]
        x[:, i + 1] = blend + K[i + 1] * (z[:, i + 1] - expected)
    return x


def _series(
    z: ArrayLike, K: ArrayLike, x0: ArrayLike
) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict]:
    # The measurements, gains and starts of `estimate`, and the lengths of their axes.
    sizes = {}
    z = checks.array("z", z, ("runs", "steps", 2), sizes)
    K = checks.array("K", K, ("steps",), sizes, at_least=0, at_most=1)
    x0 = checks.array("x0", x0, ("runs", 2), sizes)
    return z, K, x0, sizes


def manoeuvre_weight(
    z: np.ndarray,
    K: ArrayLike,
    P: ArrayLike,
    R: float,
    q: float,
    x0: ArrayLike,
    *,
    memory: int = 5,
    threshold: float = 9.21,
) -> np.ndarray:
    """Return a w1 that rises smoothly with the manoeuvre, shape (runs, steps).

    The squared sum of the last `memory` Kalman innovations over its variance is
    chi-squared with two degrees of freedom on a steady course; d⁴/(d⁴ + threshold²)
    is the weight. It uses measurements up to its own step only.

    Parameters
    ----------
    z, x0
        As in `estimate`.
    K, P : array, shape (steps,)
        From `gains` with the same `R` and `q`.
    R, q : float
        Variances, (m/s)².
    memory : int
        Innovations that are summed, at least 1.
    threshold : float
        Where the weight is one half, above 0; default: the 99 % point.

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit, or a number is not finite or out of its bounds.
    """
    memory = checks.integer("memory", memory, at_least=1)
    threshold = checks.number("threshold", threshold, above=0)
    q, R = checks.number("q", q, at_least=0), checks.number("R", R, above=0)
    z, K, x0, sizes = _series(z, K, x0)
    P = checks.array("P", P, ("steps",), sizes, at_least=0)
    kalman = estimate(z, K, 0.0, x0)
    innovation = np.zeros_like(z)
    innovation[:, 1:] = z[:, 1:] - kalman[:, :-1]
    variance = np.concatenate([[0.0], P[:-1] + q + R])
    d2 = np.zeros(z.shape[:2])
    for i in range(1, z.shape[1]):
        first = max(1, i - memory + 1)
        total = innovation[:, first : i + 1].sum(axis=1)
        d2[:, i] = (total**2).sum(axis=1) / variance[first : i + 1].sum()
    return d2**2 / (d2**2 + threshold**2)


def steady_variance(K: float, w1: float, R: float) -> float:
    """Return the error variance per component on a steady course, (m/s)².

    The estimate is a moving average of the measurements with weights h0, h1, h1 φ,
    h1 φ² …: h0 = K, φ = (1 - K)(1 - w1), h1 = φ K + (1 - K) w1. K is above 0 and at most
    1, w1 from 0 to 1; a `seanav.checks.ParameterError` says what is not.
    """
    K = checks.number("K", K, above=0, at_most=1)
    w1 = checks.number("w1", w1, at_least=0, at_most=1)
    R = checks.number("R", R, above=0)
    phi = (1 - K) * (1 - w1)
    first = phi * K + (1 - K) * w1
    return R * (K**2 + first**2 / (1 - phi**2))
