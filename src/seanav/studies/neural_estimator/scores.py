"""Paper 2: errors, shares won, what the random weights decide, cost; rows of the tables."""

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from seanav import estimates
from seanav.filters import blended, neural
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

    The phases are every step from 1 on ("all"), "initial" if there is any step in it, and
    those of `Course.parts`.
    """
    result = {}
    for name, course in done.items():
        z = course.z if purpose is None else run.measure(scenario, course.truth, purpose)
        estimates = {w1: run.numerical(scenario, z, w1) for w1 in scenario.w1_grid}
        masks = {"all": np.arange(scenario.steps) >= 1}
        masks |= {phase: course.phases[phase] for phase in course.phases if phase == "initial"}
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


# ---------------------------------------------------------------- independent facts


def cases(done: dict[str, Course]) -> list[tuple[str, str]]:
    """Return (course, phase) of the examination so that no step of a run is told of twice.

    A course with phases stands for itself by them. Courses that are alike up to the end of
    a phase have the same noise and the same past: only the first of them is told of.
    """
    found, kept = [], []
    for name, course in done.items():
        parts = course.parts()
        smaller = {phase: mask for phase, mask in parts.items() if phase != "examination"}
        for phase, mask in (smaller or parts).items():
            end = int(np.flatnonzero(mask)[-1]) + 1
            told = np.zeros_like(mask)
            for truth, other in kept:
                if np.array_equal(truth[:end], course.truth[:end]):
                    told |= other
            if not told[mask].all():
                found.append((name, phase))
            kept.append((course.truth, mask))
    return found


def distinct(done: dict[str, Course], phase: str) -> list[str]:
    """Return the courses whose truth up to the end of a phase is no earlier course's.

    A course without that phase is not among them.
    """
    found: list[str] = []
    for name, course in done.items():
        if phase not in course.phases:
            continue
        end = int(np.flatnonzero(course.phases[phase])[-1]) + 1
        if not any(np.array_equal(done[c].truth[:end], course.truth[:end]) for c in found):
            found.append(name)
    return found


def won_by_courses(done: dict[str, Course], name: str) -> estimates.Estimate:
    """Return the share of runs and courses won against the teacher in the examination.

    The noise of a run is the same on every course: a run counts once, by its share.
    """
    wins = [c.squared(name) < c.squared("teacher") for c in done.values()]
    return estimates.mean(np.mean(wins, axis=0))


def regret_rows(done: dict[str, Course], names: Sequence) -> list:
    """Return rows (estimator, RMSE over courses, low, high, course of most regret, regret).

    RMSE in the examination, every course weighs the same, m/s. Regret: RMSE on a course
    over that of the best of `names` there, minus one.
    """
    squares = {name: np.array([c.squared(name) for c in done.values()]) for name in names}
    best = np.min([np.sqrt(s.mean(axis=1)) for s in squares.values()], axis=0)
    rows = []
    for name, s in squares.items():
        regret = np.sqrt(s.mean(axis=1)) / best - 1
        worst = int(regret.argmax())
        overall = estimates.root_mean_square(s.mean(axis=0))
        rows.append([name, *three(overall), list(done)[worst], float(regret[worst])])
    return rows


# ---------------------------------------------------------------- stabilising, exactly


def stabilising(scenario: Scenario, w1: float, start: str) -> float:
    """Return the numerical filter's RMS error at the end of stage 1 over the one for ever.

    A steady course. The filter is linear, x_{i+1} = α x_i + β z_i + K_{i+1} z_{i+1} with
    α + β + K_{i+1} = 1, and x_i holds K_i z_i: variance and bias follow without sampling.
    Where α is nearly -1 (the printed innovation, weight and gain nearly 1), the quotient
    for ever is 0/0; its limit is the error of one measurement.

    Parameters
    ----------
    w1 : float
        Weight of the running measurement.
    start : {"measured", "zero"}
        As for `run.numerical`.
    """
    R, measured = scenario.R, start == "measured"
    K, _ = blended.gains(scenario.q, R, R if measured else scenario.q, scenario.settle + 1)
    variance, held = (R, 1.0) if measured else (0.0, 0.0)
    bias = 0.0 if measured else scenario.speed / np.sqrt(2)  # rms of two components
    for gain in K[1:]:
        alpha, beta = _carried(scenario, w1, gain)
        new = beta**2 + 2 * alpha * beta * held + gain**2
        variance, held, bias = alpha**2 * variance + new * R, gain, alpha * bias
    gain = blended.steady_gain(scenario.q, R)
    alpha, beta = _carried(scenario, w1, gain)
    rest = R
    if 1 + alpha > 1e-9:
        rest = (beta**2 + 2 * alpha * beta * gain + gain**2) * R / (1 - alpha**2)
    return float(np.sqrt((variance + bias**2) / rest))


def _carried(scenario, w1, gain):
    """Return α and β, what an estimate takes of the last one and of the last measurement."""
    if scenario.innovation == "blended":
        return (1 - gain) * (1 - w1), (1 - gain) * w1
    return 1 - w1 - gain, w1


# ---------------------------------------------------------------- steps in parallel


def parallel_steps(hidden: int) -> dict[str, int]:
    """Return operations one after the other, by name, if all that can runs at once.

    The longest chain: a sum of n terms takes log2(n) steps, rounded up. Gain and
    covariance of the filter wait for nothing that the network need not wait for.
    """
    logistic = 24  # as in `operations`: one after the other
    total = int(np.ceil(np.log2(hidden + 1)))
    layers = (1 + 2) + (1 + total)  # products at once, then sums of 3 and of hidden + 1 terms
    predict = 2 + 2 + 1  # F P, (F P) Fᵀ, + Q; products of 2 by 2 matrices take 2 steps
    gain = 2 + 2 + 1 + 2 + 1 + 2  # G P, (G P) Gᵀ, + R, determinant, division, product
    return {
        "network, logistic computed": layers + 2 * logistic,
        "network, logistic looked up": layers + 2,
        "Kalman filter, matrices": predict + gain + 2 + 1,  # K times innovation, sum
        "filter at constant gain": 2 + 2 + 1 + 2 + 1,  # F x, G x, innovation, K times it, sum
    }
