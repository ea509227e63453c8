"""Paper 2: errors, shares won, what the random weights decide, cost; rows of the tables."""

import numpy as np

from seanav import estimates


def squared(estimate, truth, mask):
    """Return each run's mean squared error per component over a phase, (runs,) (m/s)²."""
    return ((estimate - truth)[:, mask] ** 2).mean(axis=(1, 2))


def rmse(estimate, truth, mask):
    """Return the RMSE per component over runs and the steps of a phase, an Estimate in m/s."""
    return estimates.root_mean_square(squared(estimate, truth, mask))


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


def score_rows(done, names, phases=None):
    """Return rows (course, phase, estimator, RMSE, low, high, won, low, high)."""
    rows = []
    for course, result in done.items():
        for phase in result.phases if phases is None else phases:
            for name in names:
                error = rmse(result.estimates[name], result.truth, result.phases[phase])
                share = won(result.squared(name, phase), result.squared("teacher", phase))
                rows.append([course, phase, name, *three(error), *three(share)])
    return rows


def three(estimate):
    """Return value, low and high of an Estimate."""
    return [estimate.value, estimate.low, estimate.high]


def factor_rows(varied):
    """Return rows (level, course, phase, RMSE, low, high, won against its teacher, low, high)."""
    rows = []
    for level, by_course in varied.items():
        for course, by_phase in by_course.items():
            for phase, (network, teacher) in by_phase.items():
                error, share = estimates.root_mean_square(network), won(network, teacher)
                rows.append([level, course, phase, *three(error), *three(share)])
    return rows


def stops(history, delta):
    """Return per reading the share of runs below Δ in time and their median epoch, or None."""
    rows = []
    for errors in np.moveaxis(history, 1, 0):
        below = errors < delta
        met = below.any(axis=0)
        epoch = float(np.median(below.argmax(axis=0)[met]) + 1) if met.any() else None
        rows.append((estimates.share(int(met.sum()), met.size), epoch))
    return rows
