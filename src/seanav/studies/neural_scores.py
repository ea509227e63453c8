"""Scores of paper 2: errors, shares won, paired comparisons, break-even, cost."""

import numpy as np

from seanav import estimates


def squared(estimate, truth, mask):
    """Return each run's mean squared error per component over a phase, (runs,) (m/s)²."""
    return ((estimate - truth)[:, mask] ** 2).mean(axis=(1, 2))


def rmse(estimate, truth, mask):
    """Return the RMSE per component over runs and the steps of a phase, an Estimate in m/s."""
    return estimates.root_mean_square(squared(estimate, truth, mask))


def log_ratio(a, b):
    """Return ln(RMSE a / RMSE b) from paired squared errors (runs,); negative: a is better."""
    influence = (a / a.mean() - b / b.mean()) / 2
    return estimates.from_influence(np.log(a.mean() / b.mean()) / 2, influence)


def won(a, b):
    """Return the share of runs in which a has the smaller error; a tie is not won."""
    return estimates.share(int((a < b).sum()), len(a))


def weights_share(a, b):
    """Return the share of the variance of the error score that the random weights decide.

    `a` and `b` (runs,) are scores of the same data with two draws of the weights: half
    the mean squared difference, over the variance of one score.
    """
    both = np.concatenate([a, b])
    within = (a - b) ** 2 / 2
    total = ((a - both.mean()) ** 2 + (b - both.mean()) ** 2) / 2
    value = within.mean() / total.mean()
    return estimates.from_influence(value, (within - value * total) / total.mean())


def break_even(rates, a, b):
    """Return the turn rate where the errors of a and b are equal, with its interval.

    Parameters
    ----------
    rates : sequence of float
        Turn rates in growing order.
    a, b : list of ndarray, shape (runs,)
        Squared errors at each rate, the same noise at every rate.

    Returns
    -------
    Estimate or None
        Linear interpolation of the log ratio at its first change of sign; None if it
        has none.
    """
    level = [np.log(p.mean() / q.mean()) / 2 for p, q in zip(a, b, strict=True)]
    influence = [(p / p.mean() - q / q.mean()) / 2 for p, q in zip(a, b, strict=True)]
    for n in range(len(rates) - 1):
        low, high = level[n], level[n + 1]
        if low < 0 <= high:
            part = -low / (high - low)
            slope = (high - low) / (rates[n + 1] - rates[n])
            at_root = (1 - part) * influence[n] + part * influence[n + 1]
            root = rates[n] + part * (rates[n + 1] - rates[n])
            return estimates.from_influence(root, -at_root / slope)
    return None


def operations(hidden, pairs, epochs, steps):
    """Return arithmetic operations by name: per step of network and filters, per teaching.

    Counted: + - × ÷, in the logistic function those of the kernel. The Kalman filter is
    the one for full 2 by 2 matrices.
    """
    logistic = 24  # reduction 7, square and Padé quotient 14, power of two and sum 2, division 1
    network = hidden * (4 + logistic) + 2 * (2 * hidden + logistic)
    product, total = 12, 4  # 2 by 2: product of matrices, sum of matrices
    predict = 6 + 2 * product + total
    update = product * 2 + total + 8 + product + 2 + 6 + 6 + 2 + 2 * product + total
    correction = network + 2 * 5 + hidden * 14
    return {
        "network": network,
        "Kalman filter, matrices": predict + update,
        "filter at constant gain": 2 * 3,
        "network, teaching included": network + correction * pairs * epochs / steps,
    }
