"""Paper 2: errors, shares won, what the random weights decide, cost; rows of the tables."""

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from seanav import estimates
from seanav.filters import neural
from seanav.studies.neural_estimator import run
from seanav.studies.neural_estimator.run import Course
from seanav.studies.neural_estimator.scenario import Scenario


def rmse(estimate: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> estimates.Estimate:
    """Return the RMSE per component over runs and the steps of a phase, an Estimate in m/s."""
    return estimates.root_mean_square(run.squared(estimate, truth, mask))


def won(a: np.ndarray, b: np.ndarray) -> estimates.Estimate:
    """Return the share of runs in which a has the smaller error; a tie is not won."""
    return estimates.share(int((a < b).sum()), len(a))


def weights_share(a: np.ndarray, b: np.ndarray) -> estimates.Estimate:
    """Return the share of the variance of the error score that the random weights decide.

    `a` and `b` (runs,) are scores of the same data with two draws of the weights: half
    the mean squared difference, over the variance of one score.
    """
    both = np.concatenate([a, b])
    within = (a - b) ** 2 / 2
    total = ((a - both.mean()) ** 2 + (b - both.mean()) ** 2) / 2
    value = within.mean() / total.mean()
    return estimates.from_influence(value, (within - value * total) / total.mean())


def operations(hidden: int, pairs: int, epochs: int, steps: int) -> dict[str, Any]:
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


def score_rows(done: dict[str, Course], names: Sequence, phases: list[str] | None = None) -> list:
    """Return rows (course, phase, estimator, RMSE, low, high, won, low, high)."""
    rows = []
    for course, result in done.items():
        for phase in result.phases if phases is None else phases:
            for name in names:
                error = rmse(result.estimates[name], result.truth, result.phases[phase])
                share = won(result.squared(name, phase), result.squared("teacher", phase))
                rows.append([course, phase, name, *three(error), *three(share)])
    return rows


def three(estimate: estimates.Estimate) -> list[float]:
    """Return value, low and high of an Estimate."""
    return [estimate.value, estimate.low, estimate.high]


def factor_rows(varied: dict) -> list:
    """Return rows (level, course, phase, RMSE, low, high, won against its teacher, low, high)."""
    rows = []
    for level, by_course in varied.items():
        for course, by_phase in by_course.items():
            for phase, (network, teacher) in by_phase.items():
                error, share = estimates.root_mean_square(network), won(network, teacher)
                rows.append([level, course, phase, *three(error), *three(share)])
    return rows


def stops(history: np.ndarray, delta: float) -> list:
    """Return per reading the share of runs below Δ in time and their median epoch, or None."""
    rows = []
    for errors in np.moveaxis(history, 1, 0):
        below = errors < delta
        met = below.any(axis=0)
        epoch = float(np.median(below.argmax(axis=0)[met]) + 1) if met.any() else None
        rows.append((estimates.share(int(met.sum()), met.size), epoch))
    return rows


def weight_sweep(scenario: Scenario, done: dict[str, Course], purpose: str | None = None) -> dict:
    """Return course -> phase -> w1 -> squared errors (runs,) of the numerical filter.

    The phases are every step from 1 on ("all"), "initial" and those of `Course.parts`.
    """
    result = {}
    for name, course in done.items():
        z = course.z if purpose is None else run.measure(scenario, course.truth, purpose)
        estimates = {w1: run.numerical(scenario, z, w1) for w1 in scenario.w1_grid}
        masks = {"all": np.arange(scenario.steps) >= 1, "initial": course.phases["initial"]}
        result[name] = {
            phase: {w1: run.squared(x, course.truth, mask) for w1, x in estimates.items()}
            for phase, mask in (masks | course.parts()).items()
        }
    return result


def histories(taught: list[neural.Teaching]) -> np.ndarray:
    """Return the teaching errors of all runs, (epochs, 3, runs), NaN after a batch stopped."""
    longest = max(len(teaching.history) for teaching in taught)
    parts = []
    for teaching in taught:
        missing = ((0, longest - len(teaching.history)), (0, 0), (0, 0))
        parts.append(np.pad(teaching.history, missing, constant_values=np.nan))
    return np.concatenate(parts, axis=2)


def uncapped(scenario: Scenario, course: Course) -> np.ndarray:
    """Return the teaching errors of a `Course` as if Δ stopped nobody, (epochs, 3, runs)."""
    if any(teaching.met.any() for teaching in course.taught):
        endless = attrs.evolve(scenario, delta=1e-12)
        teacher = course.estimates["teacher"]
        return histories(run.first_teaching(endless, course.z, teacher))
    return histories(course.taught)
