"""Exercises of paper 4: currents, the rate, signs, fading, models that interact."""

import math
from collections.abc import Callable, Sequence
from functools import cache, partial

import numpy as np
from scipy import integrate, stats

from seanav.exercises import imm_seas as seas
from seanav.exercises.judge import Exercise
from seanav.filters import imm
from seanav.models import currents
from seanav.models.attitude import skew
from seanav.studies.imm_sea_current import appendix, explore

# ---------------------------------------------------------------- 4.1: a current from zero

SIGMA, HOURS, MEMORY = 0.4, 1.5, 2.0  # m/s, h, h


def _grown() -> float:
    variance = currents.decay(HOURS, MEMORY)[1]
    return SIGMA * math.sqrt(variance)


# ---------------------------------------------------------------- 4.2: the rate

PURE, BEST, OURS = 2000.0, 500.0, 2300.0  # m


def _rate(pure: float = PURE, best: float = BEST, ours: float = OURS) -> float:
    return 100 * (pure - ours) / (pure - best)


# ---------------------------------------------------------------- 4.3: a row of H

HEADING, SPEED = math.radians(60.0), 10.0  # m/s over ground, straight ahead
CURRENT = np.array([0.6, -0.2, 0.0])  # m/s, north, east, down


def _row(
    current: np.ndarray = CURRENT, turn: float = -1.0, water: float = -1.0, heading: float = HEADING
) -> np.ndarray:
    ahead = np.array([math.cos(heading), math.sin(heading), 0.0])
    relative = SPEED * ahead - current
    return np.concatenate([ahead, turn * ahead @ skew(relative), water * ahead])


def _in_body_axes(vector: np.ndarray) -> np.ndarray:
    c, s = math.cos(HEADING), math.sin(HEADING)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ vector


# ---------------------------------------------------------------- 4.4: one second of the IMM

KEEP, MU, RESIDUAL, VARIANCES = 0.95, np.array([0.8, 0.2]), 0.25, (0.01, 0.09)


def _belief(
    keep: float = KEEP,
    root: float = 0.5,
    inside: float = 1.0,
    half: float = 0.5,
    mu: Sequence[float] = (0.8, 0.2),
    power: float = 2.0,
) -> float:
    """Return the probability of model 1.

    `root` and `inside` are powers of S in (24), `power` that of the residual.
    """
    S = np.array(VARIANCES)
    prior = np.array([[keep, 1 - keep], [1 - keep, keep]]).T @ np.array(mu)
    mass = prior * S**-root * np.exp(-half * RESIDUAL**power / S**inside)
    return float(mass[0] / mass.sum())


def _from_kernel() -> float:
    T = np.array([[KEEP, 1 - KEEP], [1 - KEEP, KEEP]])
    predicted, _ = imm.interact(T, MU[:, None])
    logs = [[imm.log_likelihood(RESIDUAL**2, S)] for S in VARIANCES]
    return float(imm.probabilities(predicted, logs)[0, 0])


# ---------------------------------------------------------------- 4.5: the fading factor


def _mean_square(last):
    return float(last @ last) / (len(last) - 1)


def fading_factor(
    residuals: Sequence[float],
    S: float,
    window: int,
    *,
    variance: Callable = _mean_square,
    least: float = 1.0,
) -> float:
    """Return beta of (15) and (16) after the last of `residuals`, of variance S by the filter.

    `variance` takes the residuals in the window; beta is not below `least`.
    """
    last = np.asarray(residuals, dtype=float)[-window:]
    return 1.0 if len(last) < 2 else max(least, float(variance(last)) / S)


def _all(residuals, S, window):
    return fading_factor(residuals, S, len(residuals))


def _full_window(residuals, S, window):
    return fading_factor(residuals, S, window, variance=lambda last: last @ last / (window - 1))


def _root(residuals, S, window):
    return math.sqrt(fading_factor(residuals, S, window))


# ---------------------------------------------------------------- 4.6: how fast (17) diverges

WINDOW = 40


def growth(window: int, *, both: bool = False, divided: int = 1) -> float:
    """Return the mean of ln beta per step with a perfect model; `both`: without the maximum."""
    law = stats.chi2(window)
    least = 0.0 if both else window - divided

    def part(x):
        return math.log(x / (window - divided)) * law.pdf(x)

    return float(integrate.quad(part, least, law.isf(1e-14), limit=200)[0])


def _of_the_mean(window: int) -> float:
    """Return ln of the mean of beta: the order of the two exchanged."""
    law, full = stats.chi2(window), window - 1
    above = integrate.quad(lambda x: x / full * law.pdf(x), full, law.isf(1e-14), limit=200)[0]
    return math.log(law.cdf(full) + above)


# ---------------------------------------------------------------- 4.7: the sign of the update


@cache
def _grown_by(sign: float = 1.0) -> float:
    """Return by what factor a velocity error of 0.3 m/s grows in a minute without noise."""
    world = {"velocity_std": 0.3, "drift": 2e-3, "log_noise": 0.01, "correlation_time": 7200.0}
    gains, _, _ = appendix.riccati(0.3, 60, **world)
    a = currents.decay(1.0, 7200.0)[0]
    e = np.array([0.3, 0.0])
    for K in gains:
        e = np.array([1.0, a]) * e
        e = e + sign * K * (e[0] - e[1])
    return float(e[0] / 0.3)


EXERCISES = {
    "4.1": Exercise(
        right=_grown,
        mistakes={
            "The variance forgets twice as fast as the current itself.": lambda: (
                SIGMA * math.sqrt(1 - math.exp(-HOURS / MEMORY))
            ),
            "That is a variance; a standard deviation is asked for.": lambda: _grown() ** 2,
            "That is what is left of a current that was there at the start.": lambda: (
                SIGMA * math.exp(-HOURS / MEMORY)
            ),
            "That is a random walk: this current is drawn back towards zero.": lambda: (
                SIGMA * math.sqrt(2 * HOURS / MEMORY)
            ),
            "After ninety minutes it has not yet reached its stationary law.": lambda: SIGMA,
            "It is the variances that add up: take the root of the share.": lambda: [
                SIGMA * (1 - math.exp(-2 * HOURS / MEMORY)),
                SIGMA * (1 - math.exp(-HOURS / MEMORY)),
            ],
        },
        rtol=5e-3,
    ),
    "4.2": Exercise(
        right=_rate,
        mistakes={
            "Pure navigation is the zero of this scale, the optimal EKF its hundred.": lambda: [
                100 - _rate(),
                100 * (OURS - BEST) / (PURE - BEST),
            ],
            "Divide by what the optimal EKF gains, not by what pure navigation is off.": lambda: (
                100 * (PURE - OURS) / PURE
            ),
            "Compare with pure navigation, not with the optimal EKF.": lambda: 100 * BEST / OURS,
            "Not the errors are compared but what is gained on pure navigation.": lambda: [
                100 * OURS / PURE,
                100 * OURS / BEST,
            ],
        },
        rtol=5e-3,
    ),
    "4.3": Exercise(
        right=_row,
        mistakes={
            "The log sees the speed through the water, not over the ground.": lambda: _row(
                np.zeros(3)
            ),
            "A current along the course lowers what the log reads: look at its sign.": lambda: _row(
                water=1.0
            ),
            "Look at the attitude's three numbers: the signs of (8) and of the current.": lambda: (
                _row(turn=1.0)
            ),
            "West is minus east.": lambda: _row(CURRENT * [1, -1, 1]),
            "A heading of zero is north, and the north component comes first.": lambda: _row(
                heading=math.pi / 2 - HEADING
            ),
            "The errors are north, east and down: turn what is ahead into these axes.": lambda: (
                _row(_in_body_axes(CURRENT), heading=0.0)
            ),
        },
        rtol=2e-3,
    ),
    "4.4": Exercise(
        right=_from_kernel,
        mistakes={
            "A density is divided by the root of 2πS: without it a vague model wins.": lambda: (
                _belief(root=0.0)
            ),
            "First let the chain act for one second, (20).": lambda: _belief(keep=1.0),
            "S is a variance already.": lambda: [
                _belief(root=1.0, inside=2.0),
                _belief(root=1.0),
            ],
            "There is a half in the exponent.": lambda: _belief(half=1.0),
            "That is the other model.": lambda: 1 - _belief(),
            "The residual is squared in (24).": lambda: _belief(power=1.0),
            "The models are not equally likely before the measurement.": lambda: [
                _belief(mu=(0.5, 0.5)),
                _belief(keep=1.0, mu=(KEEP, 1 - KEEP)),
            ],
            "That is before the measurement; what does the residual say?": lambda: float(
                KEEP * MU[0] + (1 - KEEP) * MU[1]
            ),
        },
        rtol=5e-3,
    ),
    "4.5": Exercise(
        right=fading_factor,
        cases=[
            ([0.3], 0.01, 20),
            ([0.1, -0.1, 0.05], 0.02, 20),
            ([0.3, 0.25, 0.35, 0.2], 0.01, 20),
            ([2.0, 0.3, 0.1, -0.4, 0.35], 0.02, 3),
        ],
        mistakes={
            "Divide by n − 1, as (15) does.": partial(
                fading_factor, variance=lambda x: x @ x / len(x)
            ),
            "The residuals should have the mean zero: do not subtract their own.": partial(
                fading_factor, variance=partial(np.var, ddof=1)
            ),
            "(16) never shrinks the covariance.": partial(fading_factor, least=0.0),
            "Only the last `window` residuals count.": _all,
            "At the start there are fewer residuals than the window holds.": _full_window,
            "(16) is a ratio of variances: take no root.": _root,
        },
        rtol=1e-6,
    ),
    "4.6": Exercise(
        right=lambda: math.log(2) / growth(WINDOW),
        mistakes={
            "That is for a window of 20.": lambda: math.log(2) / growth(20),
            "The maximum in (16) keeps the upward half only.": lambda: (
                math.log(2) / abs(growth(WINDOW, both=True))
            ),
            "Ŝ is divided by M − 1.": lambda: math.log(2) / growth(WINDOW, divided=0),
            "That is the time to grow e-fold, not twofold.": lambda: 1 / growth(WINDOW),
            "The logarithm of a mean is not the mean of the logarithms.": lambda: (
                math.log(2) / _of_the_mean(WINDOW)
            ),
            "β multiplies a variance, and it is the variance that is asked for.": lambda: [
                2 * math.log(2) / growth(WINDOW),
                math.log(2) / growth(WINDOW) / 2,
            ],
            "That is the growth in one step; how long does a doubling take?": lambda: growth(
                WINDOW
            ),
        },
        rtol=2e-2,
    ),
    "4.7": Exercise(
        right=lambda: math.log10(_grown_by()),
        mistakes={
            "That is the filter that subtracts Kρ; here it is added.": lambda: math.log10(
                _grown_by(-1.0)
            ),
            "Powers of ten are asked for: take the logarithm to the base 10.": lambda: [
                math.log(_grown_by()),
                _grown_by(),
            ],
            "Compare with the error at the start.": lambda: [
                math.log10(0.3 * _grown_by()),
                0.3 * _grown_by(),
            ],
            "An error is doubled while the gain is near one only: run the recursion.": lambda: (
                60 * math.log10(2)
            ),
        },
        rtol=1e-2,
    ),
    "4.8": Exercise(
        right=seas.crossing,
        mistakes={
            "That is for the gyros of Table 1.": lambda: seas.crossing(1.0),
            "Here the true current starts from zero.": lambda: seas.crossing(start="stationary"),
            "It is the gyros that are better, not the accelerometers.": lambda: seas.crossing(
                what="accelerometer_bias_mg"
            ),
        },
        rtol=5e-3,
    ),
    "4.9": Exercise(
        right=seas.best_choice,
        mistakes={
            "Judge a filter by the sea where its rate is least, not on average.": lambda: (
                seas.best_choice(np.mean)
            ),
            "Judge a filter by the sea where its rate is least, not by the best one.": lambda: (
                seas.best_choice(np.max)
            ),
            "The second number is the least rate of that filter.": lambda: np.array(
                [seas.best_choice()[0], seas.rates().min()]
            ),
            "Of the three rates of that filter the least one is asked for.": lambda: [
                np.array(
                    [
                        seas.best_choice()[0],
                        how(seas.rates()[seas.CHOICES.index(seas.best_choice()[0])]),
                    ]
                )
                for how in (np.mean, np.median, np.max)
            ],
        },
        rtol=1e-2,
    ),
    "4.10": Exercise(
        right=seas.best_pair,
        mistakes={
            "Judge a pair by the sea where its rate is least, not by the strong one.": lambda: (
                seas.SECOND[int(np.argmax(seas.pair_rates()[:, -1]))]
            ),
            "Judge a pair by the sea where its rate is least, not by the calm one.": lambda: (
                seas.SECOND[int(np.argmax(seas.pair_rates()[:, 0]))]
            ),
            "That is the better one on the long mission: fly the short one.": lambda: explore.OTHER,
        },
    ),
}
