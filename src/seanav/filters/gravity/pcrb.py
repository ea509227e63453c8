"""Posterior Cramér-Rao bound of a position that is measured through a scalar map.

The position error is a random walk and each measurement sees one slope of the map, so
the bound is a Riccati recursion with the slopes taken at the truth (paper 5, equations
20 and 21). Covariances are handled by their three numbers ee, en, nn.
"""

import numpy as np
from numpy.typing import ArrayLike

from seanav import checks
from seanav._compile import kernel


@kernel
def _update(ee, en, nn, slope_e, slope_n, R):
    """Return ee, en, nn after one measurement of variance R with slopes (east, north).

    P − P H Hᵀ P / (HᵀP H + R), written without the difference: every term of the two
    variances is a sum of positive ones, so rounding cannot make them negative.
    """
    determinant = max(ee * nn - en * en, 0.0)
    S = R + max(slope_e * (slope_e * ee + 2.0 * slope_n * en) + slope_n * slope_n * nn, 0.0)
    return (
        (ee * R + determinant * slope_n * slope_n) / S,
        (en * R - determinant * slope_e * slope_n) / S,
        (nn * R + determinant * slope_e * slope_e) / S,
    )


@kernel
def _recursion(information, P0, Q, bound):
    # A step's information J = aaᵀ + bbᵀ (Cholesky) acts as two scalar measurements.
    ee, en, nn = P0[0, 0], P0[0, 1], P0[1, 1]
    for t in range(len(bound)):
        if t > 0:
            ee, en, nn = ee + Q[t, 0, 0], en + Q[t, 0, 1], nn + Q[t, 1, 1]
            J_ee, J_en, J_nn = information[t, 0], information[t, 1], information[t, 2]
            if J_ee > 0.0:
                a = np.sqrt(J_ee)
                ee, en, nn = _update(ee, en, nn, a, J_en / a, 1.0)
                J_nn = J_nn - J_en * J_en / J_ee
            if J_nn > 0.0:
                ee, en, nn = _update(ee, en, nn, 0.0, np.sqrt(J_nn), 1.0)
        bound[t, 0, 0], bound[t, 1, 1] = ee, nn
        bound[t, 0, 1] = bound[t, 1, 0] = en


@kernel
def _along(slopes, R, P0, Q, bound):
    ee, en, nn = P0[0, 0], P0[0, 1], P0[1, 1]
    for t in range(len(slopes)):
        if t > 0:
            ee, en, nn = ee + Q[t, 0, 0], en + Q[t, 0, 1], nn + Q[t, 1, 1]
            ee, en, nn = _update(ee, en, nn, slopes[t, 0], slopes[t, 1], R)
        bound[t, 0, 0], bound[t, 1, 1] = ee, nn
        bound[t, 0, 1] = bound[t, 1, 0] = en


def deviation(noise: float) -> float:
    """Return the checked standard deviation of a measurement; its square is a number too."""
    return checks.number("noise", noise, above=1e-100, below=1e100)


def _inputs(
    gradients: ArrayLike, noise: float, P0: ArrayLike, Q: ArrayLike, axes: list[str]
) -> tuple[np.ndarray, float, np.ndarray, np.ndarray]:
    sizes = {}
    gradients = checks.array("gradients", gradients, (*axes, "steps", 2), sizes)
    noise, P0 = deviation(noise), checks.covariance("P0", P0, 2, definite=True)
    shape = (2, 2) if checks.dimensions(Q) < 3 else ("steps", 2, 2)
    Q = np.broadcast_to(checks.array("Q", Q, shape, sizes), (sizes["steps"], 2, 2))
    for matrix in np.unique(Q[1:], axis=0):
        checks.covariance("Q", matrix, 2)
    return gradients, noise, P0, np.ascontiguousarray(Q)


def _demand_sound(bound, noise, P0, Q):
    # Of numbers of extreme size or ratio, rounding may leave no covariance.
    ee, en, nn = bound[..., 0, 0], bound[..., 0, 1], bound[..., 1, 1]
    with np.errstate(all="ignore"):
        sound = np.isfinite(bound).all() and (ee > 0).all() and (ee * nn > en * en).all()
    if not sound:
        values = (noise, P0.tolist(), Q[-1].tolist())
        allowed = "must leave the bound finite and positive definite in double precision"
        raise checks.ParameterError("noise, P0, Q", values, allowed)


def pcrb(gradients: ArrayLike, noise: float, P0: ArrayLike, Q: ArrayLike) -> np.ndarray:
    """Bound the error covariance along paths, with the slopes of the map at the truth.

    Parameters
    ----------
    gradients : (..., steps, 2) ndarray
        Slopes of the map (east, north) at each sample, (m/s²)/m. The first is not used.
    noise : float
        Standard deviation of the gravity measurement, m/s².
    P0 : (2, 2) ndarray
        Position covariance at the first sample, before any measurement, m².
    Q : (2, 2) or (steps, 2, 2) ndarray
        Process noise added before each sample, m². ``Q[0]`` is not used.

    Returns
    -------
    (..., steps, 2, 2) ndarray
        The bound in m²; sample 0 is `P0` itself.

    Raises
    ------
    ParameterError
        If shapes do not fit, a number is not finite, `noise` is not above zero, `P0` or `Q`
        is not a covariance, or the bound is none in double precision.

    Notes
    -----
    Paper 5, equations 20 and 21. Not an expectation over the truth: see `expected_pcrb`.
    """
    axes = [f"axis {k}" for k in range(checks.dimensions(gradients) - 2)]
    gradients, noise, P0, Q = _inputs(gradients, noise, P0, Q, axes)
    bound = np.empty((*gradients.shape, 2))
    steps = gradients.shape[-2]
    paths = zip(gradients.reshape(-1, steps, 2), bound.reshape(-1, steps, 2, 2), strict=True)
    for slopes, out in paths:
        _along(slopes, noise**2, P0, Q, out)
    _demand_sound(bound, noise, P0, Q)
    return bound


def expected_pcrb(gradients: ArrayLike, noise: float, P0: ArrayLike, Q: ArrayLike) -> np.ndarray:
    """Bound the error covariance when the truth itself is random.

    The information of each sample, H Hᵀ / R, is averaged over draws of the true path.

    Parameters
    ----------
    gradients : (draws, steps, 2) ndarray
        Slopes of the map (east, north) along each draw of the true path, (m/s²)/m.
    noise, P0, Q
        As for `pcrb`.

    Returns
    -------
    (steps, 2, 2) ndarray
        The bound in m²; sample 0 is `P0` itself.

    Raises
    ------
    ParameterError
        If shapes do not fit, a number is not finite, `noise` is not above zero, `P0` or `Q`
        is not a covariance, or the bound is none in double precision.

    Notes
    -----
    P. Tichavský, C. H. Muravchik, A. Nehorai: Posterior Cramér-Rao bounds for
    discrete-time nonlinear filtering, IEEE Trans. Signal Processing 46 (1998), for
    linear dynamics and additive Gaussian noise.
    """
    gradients, noise, P0, Q = _inputs(gradients, noise, P0, Q, ["draws"])
    east, north = gradients[..., 0], gradients[..., 1]
    products = np.stack([east * east, east * north, north * north], axis=-1)
    bound = np.empty((gradients.shape[1], 2, 2))
    _recursion(products.mean(axis=0) / noise**2, P0, Q, bound)
    _demand_sound(bound, noise, P0, Q)
    return bound


def information(gradient: ArrayLike, noise: float) -> np.ndarray:
    """Return the information map M = √tr(Hᵀ R⁻¹ H) of paper 5, equation 19.

    Parameters
    ----------
    gradient : (2, north, east) ndarray
        Slopes of the map to the east and to the north, (m/s²)/m.
    noise : float
        Standard deviation of the gravity measurement, m/s².

    Returns
    -------
    (north, east) ndarray
        M in 1/m.

    Raises
    ------
    ParameterError
        If `noise` is not above zero, or `gradient` not a finite array of that shape.
    """
    gradient = checks.array("gradient", gradient, (2, "north", "east"))
    return np.hypot(gradient[0], gradient[1]) / deviation(noise)
