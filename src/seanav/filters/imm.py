"""Interacting multiple models: mixing, mode probabilities, combination.

Nothing here knows what is estimated. Likelihoods are logarithms throughout, so an outlier
that is improbable under every model cannot make all of them zero. Arrays hold the models
first and independent runs innermost: mode probabilities have shape (models, runs).

References
----------
H. A. P. Blom and Y. Bar-Shalom, "The interacting multiple model algorithm for systems with
Markovian switching coefficients", *IEEE Transactions on Automatic Control* 33 (1988)
780-783; Cha, Hwang and Park, 2022, equations (18)-(26).
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from seanav._compile import kernel
from seanav.checks import ParameterError, array, number


@kernel
def _interact(T, mu, predicted, weights):
    # See `interact`; predicted and weights are filled.
    models, runs = mu.shape
    for j in range(models):
        for r in range(runs):
            predicted[j, r] = 0.0
        for i in range(models):
            for r in range(runs):
                predicted[j, r] += T[i, j] * mu[i, r]
        for i in range(models):
            for r in range(runs):
                # A model that cannot be entered keeps its own estimate.
                if predicted[j, r] > 0.0:
                    weights[j, i, r] = T[i, j] * mu[i, r] / predicted[j, r]
                else:
                    weights[j, i, r] = 1.0 if i == j else 0.0


def interact(T: ArrayLike, mu: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Predict mode probabilities (20) and compute mixing weights (21).

    Parameters
    ----------
    T : array (models, models)
        T[i, j] = Pr(model j now | model i before); rows sum to one.
    mu : array (models, runs)
        Mode probabilities after the last measurement; they sum to one in each run.

    Returns
    -------
    predicted : ndarray (models, runs)
    weights : ndarray (models, models, runs)
        weights[j, i] = Pr(model i before | model j now).

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit or these are no probabilities.
    """
    sizes = {}
    T = _distributions("T", T, ("models", "models"), sizes, axis=1)
    mu = _distributions("mu", mu, ("models", "runs"), sizes)
    predicted, weights = np.empty_like(mu), np.empty((*T.shape, mu.shape[1]))
    _interact(T, mu, predicted, weights)
    return predicted, weights


def _distributions(
    name: str, value: ArrayLike, shape: tuple, sizes: dict, axis: int = 0
) -> np.ndarray:
    p = array(name, value, shape, sizes, at_least=0)
    total = p.sum(axis=axis).ravel()
    worst = float(total[np.abs(total - 1).argmax()])
    if abs(worst - 1) > 1e-9:
        raise ParameterError(f"sum of {name}", worst, "must be 1" + " in every row" * axis)
    return p


@kernel
def _log_likelihood(squared, S):
    return -0.5 * (math.log(2.0 * math.pi * S) + squared / S)


def log_likelihood(squared: float, S: float) -> float:
    """Return the log density of a scalar residual with variance `S`, equation (24).

    Raises
    ------
    seanav.checks.ParameterError
        If the squared residual is negative or the variance not positive.
    """
    return _log_likelihood(number("squared", squared, at_least=0), number("S", S, above=0))


@kernel
def _probabilities(predicted, logs, mu):
    # See `probabilities`; mu is filled. A log-likelihood that is no number makes all modes
    # of its own run no numbers: probability zero would hide that a filter broke down.
    models, runs = mu.shape
    for r in range(runs):
        largest, told = -math.inf, False
        for j in range(models):
            if predicted[j, r] > 0.0:
                largest = max(largest, logs[j, r])
                told |= logs[j, r] != -math.inf
        if not told:
            # So improbable under every model that no density is left to compare (a residual
            # beyond 1e154 squared is infinite): the measurement says nothing of the modes.
            for j in range(models):
                mu[j, r] = predicted[j, r]
            continue
        total = 0.0
        for j in range(models):
            mu[j, r] = 0.0
            if predicted[j, r] > 0.0:
                mu[j, r] = predicted[j, r] * math.exp(logs[j, r] - largest)
            total += mu[j, r]
        for j in range(models):
            mu[j, r] /= total


def probabilities(predicted: ArrayLike, logs: ArrayLike) -> np.ndarray:
    """Return the mode probabilities (models, runs) by Bayes' rule (25).

    Parameters
    ----------
    predicted : array (models, runs)
        As from `interact`.
    logs : array (models, runs)
        Log-likelihoods; -inf is allowed, and in every model it leaves `predicted`.

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit, `predicted` are no probabilities, or a log-likelihood is no
        number or +inf.
    """
    sizes = {}
    predicted = _distributions("predicted", predicted, ("models", "runs"), sizes)
    logs = array("logs", logs, ("models", "runs"), sizes, also=-math.inf)
    mu = np.empty_like(predicted)
    _probabilities(predicted, logs, mu)
    return mu


@kernel
def _mean(weights, deviations, mean):
    """Write the mean of a mixture, equation (26), as a deviation; arguments as in `_mix`."""
    models, size, runs = deviations.shape
    for k in range(size):
        for r in range(runs):
            mean[k, r] = weights[0, r] * deviations[0, k, r]
        for i in range(1, models):
            for r in range(runs):
                mean[k, r] += weights[i, r] * deviations[i, k, r]


@kernel
def _mix(weights, deviations, P, mean, covariance, centred):
    """Write one Gaussian with the moments of a mixture, equations (22) and (26).

    Parameters
    ----------
    weights : (models, runs)
        Sum to one over the models.
    deviations : (models, size, runs)
        States of the models, as deviations from any common point.
    P : (models, size (size + 1) / 2, runs)
        Covariances, upper triangles row by row.
    mean : (size, runs), output
        Deviation of the mixture's mean from that point.
    covariance : (size (size + 1) / 2, runs), output
    centred : (size, runs)
        Workspace.
    """
    models, size, runs = deviations.shape
    _mean(weights, deviations, mean)
    covariance[:] = 0.0
    for i in range(models):
        for k in range(size):
            for r in range(runs):
                centred[k, r] = deviations[i, k, r] - mean[k, r]
        at = np.uint64(0)  # unsigned: the compiler then vectorises over runs
        for k in range(size):
            for m in range(k, size):
                for r in range(runs):
                    moment = P[i, at, r] + centred[k, r] * centred[m, r]
                    covariance[at, r] += weights[i, r] * moment
                at += np.uint64(1)
