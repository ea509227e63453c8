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

from seanav._compile import kernel


@kernel
def interact(T, mu, predicted, weights):
    """Predict mode probabilities (20) and compute mixing weights (21).

    Parameters
    ----------
    T : (models, models)
        T[i, j] = Pr(model j now | model i before); rows sum to one.
    mu : (models, runs)
        Mode probabilities after the last measurement.
    predicted : (models, runs), output
    weights : (models, models, runs), output
        weights[j, i] = Pr(model i before | model j now).
    """
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


@kernel
def log_likelihood(squared, S):
    """Return the log density of a scalar residual with variance `S`, equation (24)."""
    return -0.5 * (math.log(2.0 * math.pi * S) + squared / S)


@kernel
def probabilities(predicted, logs, mu):
    """Update the mode probabilities by Bayes' rule (25), from log-likelihoods.

    Parameters
    ----------
    predicted, logs : (models, runs)
    mu : (models, runs), output
    """
    models, runs = mu.shape
    for r in range(runs):
        largest = -math.inf
        for j in range(models):
            if predicted[j, r] > 0.0:
                largest = max(largest, logs[j, r])
        total = 0.0
        for j in range(models):
            mu[j, r] = 0.0
            if predicted[j, r] > 0.0:
                mu[j, r] = predicted[j, r] * math.exp(logs[j, r] - largest)
            total += mu[j, r]
        for j in range(models):
            mu[j, r] /= total


@kernel
def mean(weights, deviations, out):
    """Put the weighted mean of the models' states, equation (26), into `out` (size, runs).

    Parameters
    ----------
    weights : (models, runs)
        Sum to one over the models.
    deviations : (models, size, runs)
        States of the models, as deviations from any common point.
    """
    models, size, runs = deviations.shape
    for k in range(size):
        for r in range(runs):
            out[k, r] = weights[0, r] * deviations[0, k, r]
        for i in range(1, models):
            for r in range(runs):
                out[k, r] += weights[i, r] * deviations[i, k, r]


@kernel
def mix(weights, deviations, P, out, covariance, centred):
    """Return one Gaussian with the moments of a mixture, equations (22) and (26).

    Parameters
    ----------
    weights, deviations
        As in `mean`.
    P : (models, size (size + 1) / 2, runs)
        Covariances, upper triangles row by row.
    out : (size, runs), output
        Deviation of the mixture's mean from that point.
    covariance : (size (size + 1) / 2, runs), output
    centred : (size, runs)
        Workspace.
    """
    models, size, runs = deviations.shape
    mean(weights, deviations, out)
    covariance[:] = 0.0
    for i in range(models):
        for k in range(size):
            for r in range(runs):
                centred[k, r] = deviations[i, k, r] - out[k, r]
        at = np.uint64(0)  # unsigned: the compiler then vectorises over runs
        for k in range(size):
            for m in range(k, size):
                for r in range(runs):
                    moment = P[i, at, r] + centred[k, r] * centred[m, r]
                    covariance[at, r] += weights[i, r] * moment
                at += np.uint64(1)
