"""Answers to the exercises of notebook 3, computed when they are asked for."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from scipy import integrate, stats

from seanav.exercises.judge import Exercise
from seanav.studies.adaptive_fading import run, scores
from seanav.studies.adaptive_fading.scenario import Scenario

# ---------------------------------------------------------------- 3.2: one factor by hand

PHI, P, Q, R, INNOVATION = 0.9, 0.04, 0.01, 0.09, 0.8


def _factor(left: float, squared: float = INNOVATION**2) -> float:
    """Return Λ of a scalar filter; `left` is what is taken off the squared innovation."""
    return (squared - left) / Q


# ---------------------------------------------------------------- 3.4: the error that stays


def _staying(gain: float, forgets: float = 0.9, kept: bool = True) -> float:
    """Return the steady mean error of a scalar filter that adds 0.02 too much in each step."""
    left = 1.0 - gain
    return (left if kept else 1.0) * 0.02 / (1.0 - left * forgets)


def _both(**options: Any) -> np.ndarray:
    return np.array([_staying(gain, **options) for gain in (0.25, 0.75)])


# ---------------------------------------------------------------- 3.5: blind in degrees


def _factors(
    scale: float,
    floor: float = 1.0,
    base: float = 1.5e-4,
    squared: float = 9.0 * 1.6e-4,
    rate: float = 1.0,
) -> tuple[float, float]:
    """Return the single factor and that of the yaw rate, the heading scaled by `scale`.

    `base` is taken off the innovation of the yaw rate, whose square is `squared`. Mistakes
    change these, or scale the yaw rate with the heading, by `rate`.
    """
    units = np.array([1.0, rate if scale > 1.0 else 1.0, scale]) ** 2
    left, noise = base * units, 1e-5 * units
    seen = np.array([0.0, squared, 0.0]) * units
    single = (seen.sum() - left.sum()) / noise.sum()
    return max(floor, single), max(floor, (seen[1] - left[1]) / noise[1])


def _four(scale: float, **options: Any) -> np.ndarray:
    """Return both single factors, then both of the yaw rate: in radians, and scaled."""
    singles, multiples = zip(_factors(1.0, **options), _factors(scale, **options), strict=True)
    return np.array([*singles, *multiples])


# ---------------------------------------------------------------- 3.6: a larger Q

SCALES = (1, 3, 10, 30, 100)


@cache
def _errors() -> np.ndarray:
    """Return the RMSE after the fault of the five filters, (5, states), by 20 runs."""
    scenario = Scenario(runs=20)
    case = run.problem(scenario)
    truth, z = run.simulate(case, run.draw(scenario))
    squares = [
        scores.squares(run.estimate(scenario, case, z, scale=scale).x - truth, case.faulty)
        for scale in SCALES
    ]
    return np.sqrt(np.mean(squares, axis=1))


def _best(score: Callable[[np.ndarray], np.ndarray]) -> int:
    return SCALES[int(np.argmin(score(_errors())))]


# ---------------------------------------------------------------- 3.7: a better alarm


def _first_alarm(beta: np.ndarray, length: int, m: int, alpha: float) -> int:
    """Return the first step at which the sum of the last `length` values is too large, or −1."""
    limit = stats.chi2.isf(alpha, m * length)
    for k in range(length - 1, len(beta)):
        if np.sum(beta[k - length + 1 : k + 1]) > limit:
            return k
    return -1


def _of_one(beta, length, m, alpha):
    return _with_limit(beta, length, stats.chi2.isf(alpha, m))


def _of_scaled(beta, length, m, alpha):
    return _with_limit(beta, length, length * stats.chi2.isf(alpha, m))


def _with_limit(beta, length, limit):
    over = np.convolve(beta, np.ones(length), mode="valid") > limit
    return int(over.argmax()) + length - 1 if over.any() else -1


def _of_lower_tail(beta, length, m, alpha):
    return _with_limit(beta, length, stats.chi2.ppf(alpha, m * length))


def _of_unfinished(beta, length, m, alpha):
    # The sum of what there is, also before `length` values are there.
    sums = np.convolve(beta, np.ones(length))[: len(beta)]
    over = sums > stats.chi2.isf(alpha, m * length)
    return int(over.argmax()) if over.any() else -1


def _from_start(beta, length, m, alpha):
    k = _first_alarm(beta, length, m, alpha)
    return k - length + 1 if k >= 0 else -1


def _series(seed: int, shift: float) -> np.ndarray:
    """Return β of 200 steps whose innovations are off by `shift` deviations from step 100 on."""
    white = np.random.default_rng(seed).standard_normal((200, 3))
    white[100:] += shift
    return (white**2).sum(axis=1)


# ---------------------------------------------------------------- 3.8: which measurement tells


def _telling() -> set[str]:
    """Return the states whose measurement alone makes the model with a fin offset observable."""
    case = run.problem(Scenario())
    n = len(case.B)
    whole = np.eye(n + 1)
    whole[:n, :n], whole[:n, n] = case.Phi, case.B
    found = set()
    for row, state in enumerate(case.states):
        observed = np.array([np.linalg.matrix_power(whole, k)[row] for k in range(n + 1)])
        if np.linalg.matrix_rank(observed, tol=1e-8) == n + 1:
            found.add(state)
    return found


# ---------------------------------------------------------------- 3.9: the rule (24)


def _share(first: float) -> float:
    """Return P(first · χ²₁ + χ²₂ > first + 2): χ²₂ is exponential with the mean 2."""
    mean = first + 2.0
    edge = np.sqrt(mean / first)

    def beyond(x):
        return 2.0 * stats.norm.pdf(x) * np.exp(-(mean - first * x**2) / 2.0)

    return float(2.0 * stats.norm.sf(edge) + integrate.quad(beyond, 0.0, edge)[0])


EXERCISES = {
    "3.1": Exercise(
        right=lambda: 1.0 - 0.99**100,
        mistakes={
            "That is how many alarms there are on average, not the probability of any.": lambda: (
                100 * 0.01
            ),
            "That is the probability that there is no alarm at all.": lambda: 0.99**100,
            "That is the probability of exactly one alarm.": lambda: 100 * 0.01 * 0.99**99,
            "The level is that of this question, not of the first cell.": lambda: 1.0 - 0.95**100,
            "That is one test; there are a hundred.": lambda: 0.01,
            "All hundred tests need not fail: one alarm is enough.": lambda: 0.01**100,
        },
        rtol=5e-3,
    ),
    "3.2": Exercise(
        right=lambda: _factor(PHI**2 * P + R),
        mistakes={
            "The measurement's noise R is a part of the innovation, too.": lambda: _factor(
                PHI**2 * P
            ),
            "Q is scaled by the factor: it must not be taken off once more.": lambda: _factor(
                PHI**2 * P + Q + R
            ),
            "P is carried on by Φ on both sides.": lambda: [_factor(PHI * P + R), _factor(P + R)],
            "A variance is compared with the square of the innovation.": lambda: _factor(
                PHI**2 * P + R, INNOVATION
            ),
            "R is a variance already.": lambda: _factor(PHI**2 * P + R**2),
            "That is what is left for the process noise: how many times Q is it?": lambda: (
                Q * _factor(PHI**2 * P + R)
            ),
            "That is β, which tests the innovation: here it is to be explained.": lambda: (
                INNOVATION**2 / (PHI**2 * P + Q + R)
            ),
            "That is the gain that the factor leads to.": lambda: 1.0 - R / INNOVATION**2,
        },
        rtol=2e-3,
    ),
    "3.3": Exercise(
        right=lambda: 1.6 / (0.8**2 + 1.0**2),
        mistakes={
            "That holds for a mode that does not swing: the imaginary part counts.": lambda: (
                2 / 0.8
            ),
            "|1 + κT| < 1 has to be squared and solved; 2 / |κ| is for a real mode.": lambda: (
                2 / np.hypot(0.8, 1.0)
            ),
            "(A1) divides by |κ|², neither by |κ| nor by one part of κ alone.": lambda: [
                1.6 / np.hypot(0.8, 1.0),
                1 / 0.8,
            ],
            "|κ|² is the sum of the squares of both parts, not κ².": lambda: [
                1.6 / (0.8**2 - 1.0),
                1.6 / (1.0 - 0.8**2),
                1.6 / (0.8 + 1.0) ** 2,
            ],
        },
    ),
    "3.4": Exercise(
        right=_both,
        mistakes={
            "The measurement also corrects what the latest step adds.": lambda: _both(kept=False),
            "The state itself forgets, too: Φ is below one.": lambda: _both(forgets=1.0),
            "A measurement takes the part K off the error; the part that stays is 1 − K.": lambda: (
                np.array([0.25 * 0.02 / (1 - 0.25 * 0.9), 0.75 * 0.02 / (1 - 0.75 * 0.9)])
            ),
            "That is the error after the first step; it is carried on to the next one.": lambda: (
                np.array([0.75, 0.25]) * 0.02
            ),
            "The error that is carried on is corrected in each step, too.": lambda: (
                np.array([0.75, 0.25]) * 0.02 / (1 - 0.9)
            ),
        },
    ),
    "3.5": Exercise(
        right=lambda: _four(np.degrees(1.0)),
        mistakes={
            "A factor is never below one.": lambda: _four(np.degrees(1.0), floor=-np.inf),
            "Q is scaled by the factor: it must not be taken off once more.": lambda: _four(
                np.degrees(1.0), base=1.6e-4
            ),
            "The heading's own terms change with its unit.": lambda: _four(1.0),
            "What is there without process noise, S₀, must be taken off first.": lambda: _four(
                np.degrees(1.0), base=0.0
            ),
            "The deviations are those of S, which has the process noise in it.": lambda: _four(
                np.degrees(1.0), squared=9.0 * 1.5e-4
            ),
            "Three standard deviations are nine variances.": lambda: _four(
                np.degrees(1.0), squared=3.0 * 1.6e-4
            ),
            "Only the heading changes its unit; the yaw rate stays in rad/s.": lambda: _four(
                np.degrees(1.0), rate=np.degrees(1.0)
            ),
        },
        rtol=5e-3,
    ),
    "3.6": Exercise(
        right=lambda: _best(lambda rmse: np.log(rmse).mean(axis=1)),
        mistakes={
            "That one is the best as long as nothing is broken.": lambda: 1,
            "So large a Q follows the noise of each measurement.": lambda: 100,
            "Compare the geometric mean of all three states, not one of them.": lambda: [3, 30],
        },
    ),
    "3.7": Exercise(
        right=_first_alarm,
        mistakes={
            "How many degrees of freedom has a sum of several values of β?": _of_one,
            "The threshold of a sum is not the sum of the thresholds.": _of_scaled,
            "An alarm is raised at the last step of its window, not at the first.": _from_start,
            "A threshold is passed with the probability α: which tail is that?": _of_lower_tail,
            "Before `length` values are there, there is no sum to be tested.": _of_unfinished,
        },
        cases=[
            (np.array([1.0, 3.0, *[1.0] * 8]), 5, 3, 0.99),
            (_series(1, 1.0), 10, 3, 1e-3),
            (_series(2, 0.9), 5, 3, 1e-3),
            (_series(3, 1.5), 1, 3, 1e-4),
            (_series(4, 0.0), 20, 3, 1e-9),
        ],
        rtol=1e-6,
    ),
    "3.8": Exercise(
        right=_telling,
        mistakes={
            "Neither v nor r ever tells where the heading began.": lambda: [
                {"v", "r", "psi"},
                {"v", "r"},
                {"r", "psi"},
                {"v", "psi"},
                {"v"},
                {"r"},
            ],
            "What does a constant offset of the fin do to the heading in the end?": lambda: set(),
        },
    ),
    "3.9": Exercise(
        right=lambda: _share(4.0),
        mistakes={
            "That is for equal variances: here one measurement has most of the sum.": lambda: (
                stats.chi2.sf(3, 3)
            ),
            "That is as if one measurement were alone.": lambda: stats.chi2.sf(1, 1),
            "The sum is compared with its mean: each square is multiplied by its variance.": (
                lambda: stats.chi2.sf(6, 3)
            ),
            "That is the probability of the opposite.": lambda: 1 - _share(4.0),
            "A mean is not a median: the sum of squares is not symmetric about it.": lambda: 0.5,
        },
        rtol=1.5e-2,
    ),
}
