"""Exercises of the foundations: frames, filter, steps, Monte Carlo, consistency, verdicts."""

import math

import numpy as np

from seanav import claims
from seanav.estimates import Estimate
from seanav.exercises.judge import Exercise
from seanav.models.attitude import C_bn_from_rpy

# ---------------------------------------------------------------- 0.1: a velocity in two frames

HEADING, V_B = math.radians(120.0), np.array([5.0, 0.5, 0.0])


def _north_east(heading=HEADING, v_b=V_B, turn=lambda C: C):
    return (turn(C_bn_from_rpy((0.0, 0.0, heading))) @ v_b)[:2]


# ---------------------------------------------------------------- 0.2: one update by hand


def _updated(gain=0.9):
    # Prior 100 m, variance 225 m²; fix 112 m, variance 25 m².
    P = (1 - gain) ** 2 * 225.0 + gain**2 * 25.0
    return np.array([100.0 + gain * 12.0, math.sqrt(P)])


def _with_gain(gain):
    # Whoever takes a wrong gain may find the spread in one of several ways.
    mean, joseph = _updated(gain)
    spreads = (joseph, math.sqrt((1 - gain) * 225.0), (1 - gain) * 15.0, _updated()[1])
    return [np.array([mean, spread]) for spread in spreads]


# ---------------------------------------------------------------- 0.3, 0.4: one step exactly

MEMORY, SPREAD, STEP = 120.0, 0.3, 30.0  # s, m/s, s


def process_noise(dt: float, tau: float, sigma: float) -> np.ndarray:
    """Return Q (2, 2) of position and a Gauss-Markov speed over one step."""
    a = math.exp(-dt / tau)
    pp = 2 * sigma**2 * tau * (dt - 2 * tau * (1 - a) + tau / 2 * (1 - a * a))
    pv, vv = sigma**2 * tau * (1 - a) ** 2, sigma**2 * (1 - a * a)
    return np.array([[pp, pv], [pv, vv]])


def _euler(dt, tau, sigma):
    return np.diag([0.0, 2 * sigma**2 / tau * dt])


def _walk(dt, tau, sigma):
    q = 2 * sigma**2 / tau
    return q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])


def _speed_alone(dt, tau, sigma):
    return np.diag([0.0, process_noise(dt, tau, sigma)[1, 1]])


def _uncorrelated(dt, tau, sigma):
    return np.diag(np.diag(process_noise(dt, tau, sigma)))


def _speed_first(dt, tau, sigma):
    return process_noise(dt, tau, sigma)[::-1, ::-1]


# ---------------------------------------------------------------- 0.5, 0.6: how many runs

QUANTILE, HALF_WIDTH, CORRELATION, WIDER = 1.96, 0.02, 0.98, 1.2


def _saved(ratio=WIDER, twice=2.0):
    """Return var(B - A) on separate noise over that on common noise; sd(B) = ratio sd(A)."""
    apart = 1 + ratio**2
    return apart / (apart - twice * CORRELATION * ratio)


# ---------------------------------------------------------------- 0.7: a verdict

ENDS = ((0.80, 0.75, 0.86), (0.93, 0.88, 1.03), (0.97, 0.95, 0.99))


def _verdict(outcome=lambda condition: condition.outcome):
    conditions = [
        claims.Condition(f"{k}", Estimate(*ends, (ends[2] - ends[1]) / 4, 100), high=1.0)
        for k, ends in enumerate(ENDS)
    ]
    return claims.verdict(map(outcome, conditions))


# ---------------------------------------------------------------- 0.8: a filter with a wrong Q


def _steady(q, r):
    """Return gain and updated variance of the steady filter of a random walk."""
    predicted = (q + math.sqrt(q * q + 4 * q * r)) / 2
    gain = predicted / (predicted + r)
    return gain, gain * r


def _nees(q=4.0, r=100.0, believed_q=1.0):
    gain, believed = _steady(believed_q, r)
    keep = 1 - gain
    return (keep**2 * q + gain**2 * r) / (1 - keep**2) / believed


def _nees_of_prediction():
    _, believed = _steady(1.0, 100.0)
    return (_nees() * believed + 4.0) / (believed + 1.0)


EXERCISES = {
    "0.1": Exercise(
        right=_north_east,
        mistakes={
            "That is the way back, from n to b: use the matrix, not its transpose.": lambda: (
                _north_east(turn=np.transpose)
            ),
            "Sines and cosines take radians.": lambda: _north_east(heading=120.0),
            "North comes first in n, then east.": lambda: _north_east()[::-1],
            "The second body axis points to starboard.": lambda: _north_east(v_b=V_B * (1, -1, 1)),
        },
        rtol=2e-3,
    ),
    "0.2": Exercise(
        right=_updated,
        mistakes={
            "Weights go by variances, not by standard deviations.": lambda: _with_gain(
                15.0 / (15.0 + 5.0)
            ),
            "The more certain of the two gets the larger weight.": lambda: _with_gain(0.1),
            "The second number should be a standard deviation.": lambda: _updated() ** (1, 2),
        },
        rtol=1e-3,
    ),
    "0.3": Exercise(
        right=lambda: process_noise(STEP, MEMORY, SPREAD)[1, 1],
        mistakes={
            "That is Euler's rule, which is good for steps far below the memory only.": lambda: (
                _euler(STEP, MEMORY, SPREAD)[1, 1]
            ),
            "A variance is carried by the square of the transition.": lambda: (
                SPREAD**2 * (1 - math.exp(-STEP / MEMORY))
            ),
            "That part is inherited from the last step; what is asked for is new.": lambda: (
                SPREAD**2 * math.exp(-2 * STEP / MEMORY)
            ),
            "The square of 1 - a belongs to Q_pv; here it is the speed alone.": lambda: [
                unit * (1 - math.exp(-STEP / MEMORY)) ** 2
                for unit in (SPREAD**2, SPREAD**2 * MEMORY)
            ],
        },
        rtol=5e-3,
    ),
    "0.4": Exercise(
        right=process_noise,
        cases=[(10.0, 120.0, 0.3), (1.2, 120.0, 0.3), (60.0, 120.0, 0.5), (200.0, 40.0, 1.0)],
        mistakes={
            "That is Euler's rule: noise of the speed reaches the position within a step.": _euler,
            "That is the limit of a long memory: here the speed forgets.": _walk,
            "The noise of the speed moves the position within the same step.": _speed_alone,
            "Position and speed get noises with something in common: Q_pv.": _uncorrelated,
            "The position comes first, then the speed.": _speed_first,
        },
        rtol=1e-5,
    ),
    "0.5": Exercise(
        right=lambda: (QUANTILE / HALF_WIDTH) ** 2 / 2,
        mistakes={
            "That is for the mean square; the relative error of its root is half.": lambda: (
                2 * (QUANTILE / HALF_WIDTH) ** 2
            ),
            "That is one standard error: how many of them are in 95 %?": lambda: (
                1 / HALF_WIDTH**2 / 2
            ),
            "What is the variance of the square of a normal number?": lambda: [
                (QUANTILE / HALF_WIDTH) ** 2 / 4,
                (QUANTILE / HALF_WIDTH) ** 2,
            ],
            "The number of runs goes with the square of the precision.": lambda: (
                QUANTILE / HALF_WIDTH / math.sqrt(2)
            ),
        },
        rtol=1e-2,
    ),
    "0.6": Exercise(
        right=_saved,
        mistakes={
            "So much narrower is the interval; runs go with its square.": lambda: math.sqrt(
                _saved()
            ),
            "The other way round: with noise of its own a filter needs more runs.": lambda: (
                1 / _saved()
            ),
            "The two variances differ, and both stand in (D2).": lambda: _saved(ratio=1.0),
            "1.2 is the ratio of the standard deviations; variances go with its square.": lambda: (
                _saved(ratio=math.sqrt(WIDER))
            ),
            "Write down the variance of a difference, with its covariance.": lambda: [
                _saved(twice=1.0),
                1 / (1 - CORRELATION**2),
                2 / (1 - CORRELATION),
            ],
        },
    ),
    "0.7": Exercise(
        right=_verdict,
        mistakes={
            "Look at the whole intervals, not at the values alone.": lambda: "reproduced",
            "Nothing lies wholly outside the region.": lambda: ["mixed", "not reproduced"],
            "There are numbers, so it was tested.": lambda: "cannot be tested",
        },
    ),
    "0.8": Exercise(
        right=_nees,
        mistakes={
            "Two Q are at work: the true one moves the ship, the believed one sets the gain.": (
                lambda: _nees(believed_q=4.0)
            ),
            "The believed variance divides, the actual one is divided.": lambda: 1 / _nees(),
            "The true random walk adds to the actual error in every step.": lambda: _nees(q=0.0),
            "The actual error comes with the gain of the told Q, not with the best.": lambda: (
                _steady(4.0, 100.0)[1] / _steady(1.0, 100.0)[1]
            ),
            "Q is one part of the error, the fix another: that is the ratio of the Q.": lambda: 4.0,
            "That is the prediction; the estimate after the fix is asked for.": _nees_of_prediction,
        },
    ),
}
