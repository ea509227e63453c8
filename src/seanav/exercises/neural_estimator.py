"""Exercises of paper 2: the filter at rest, what a network can learn, where it loses."""

import math

import numpy as np

from seanav.exercises.judge import Exercise
from seanav.filters import blended

# The numbers of the questions: m/s, (m/s)² per step, s, logistic units, s.
NOISE, Q, W1, DELTA, STEP = 0.3, 0.005, 0.3, 0.001, 3.0
R, RANGE = NOISE**2, 20.0  # (m/s)²; m/s of the scaled interval
K = blended.steady_gain(Q, R)

# ---------------------------------------------------------------- 2.3: the price of a weight


def _spread(w1):
    return math.sqrt(blended.steady_variance(K, w1, R))


def _without_memory_of_the_gain():
    # h1 without the part φ K.
    phi = (1 - K) * (1 - W1)
    h1 = (1 - K) * W1
    return math.sqrt(K**2 + h1**2 / (1 - phi**2)) / math.sqrt(K / (2 - K))


# ---------------------------------------------------------------- 2.4: how late a filter is


def _late(w1=0.0):
    return STEP * (1 - K) / (1 - (1 - K) * (1 - w1))


# ---------------------------------------------------------------- 2.5: backpropagation


def hidden_errors(t: np.ndarray, o: np.ndarray, v: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the errors of the hidden neurons (H,), from the outputs (2,) and weights (2, H)."""
    return y * (1 - y) * (((t - o) * o * (1 - o)) @ v)


def _no_slope_of_the_output(t, o, v, y):
    return y * (1 - y) * ((t - o) @ v)


def _no_slope_of_the_hidden(t, o, v, y):
    return ((t - o) * o * (1 - o)) @ v


def _signal_for_slope(t, o, v, y):
    return y * (((t - o) * o * (1 - o)) @ v)


def _uphill(t, o, v, y):
    return -hidden_errors(t, o, v, y)


def _signals_for_weights(t, o, v, y):
    return y * (1 - y) * ((t - o) * o * (1 - o)).sum() * y


_LAYERS = np.random.default_rng(25).uniform(0.05, 0.95, (2, 3, 6))
CASES = [(a[0, :2], a[1, :2], np.array([3, -2])[:, None] * (a[:2] - 0.5), a[2]) for a in _LAYERS]

# ---------------------------------------------------------------- 2.6: how many pairs


def weights(w1: float, count: int) -> np.ndarray:
    """Return what an estimate takes of the last `count` measurements, the newest first."""
    phi = (1 - K) * (1 - w1)
    h = (phi * K + (1 - K) * w1) * phi ** np.arange(-1.0, count - 1)
    h[0] = K
    return h


def _mean_of_answers(pairs):
    # The weights of the mean of so many answers in a row, of a filter long at rest.
    return NOISE * np.linalg.norm(np.convolve(weights(W1, 400), np.full(pairs, 1 / pairs)))


# ---------------------------------------------------------------- 2.9, 2.10


def _floor(scaled=DELTA, part=lambda h: h[1:], size=RANGE):
    return scaled * size / np.linalg.norm(part(weights(W1, 400)))


TEACHER, CONSTANT, SPEED, EXAM = 0.142, 0.067, 6.0, 160  # m/s, m/s, m/s, steps


def _break_even(gap=TEACHER**2 - CONSTANT**2, step=STEP, components=2, drift=None):
    i = np.arange(EXAM)
    drift = math.sqrt((i**2).mean()) if drift is None else drift
    return math.degrees(math.sqrt(components * gap) / (SPEED * step * drift))


EXERCISES = {
    "2.1": Exercise(
        right=lambda: K,
        mistakes={
            "The factor 1 - K is missing in what the gain has to fulfil.": lambda: math.sqrt(Q / R),
            "R is a variance, the square of the noise.": lambda: blended.steady_gain(Q, NOISE),
            "The covariance before the prediction is not zero once it rests.": lambda: Q / (Q + R),
            "That is the weight of the prediction; the measurement's is asked for.": lambda: 1 - K,
            "That is the ratio of the variances only: the gain fulfils an equation of degree two, "
            "(A5).": lambda: Q / R,
            "That is a variance: the one of the error after a measurement.": lambda: K * R,
        },
    ),
    "2.2": Exercise(
        right=lambda: 5 * 100 + 2,
        mistakes={
            "Each hidden and each output neuron has a threshold, too.": lambda: [400, 402],
            "The output neurons have thresholds as well.": lambda: 500,
            "That is one of the two layers of weights only.": lambda: [200, 202, 300],
        },
        rtol=1e-4,
    ),
    "2.3": Exercise(
        right=lambda: _spread(W1) / _spread(0.0),
        mistakes={
            "That is the ratio of the variances.": lambda: (_spread(W1) / _spread(0.0)) ** 2,
            "That is by how much it is larger; the factor is the ratio of the two.": lambda: (
                _spread(W1) / _spread(0.0) - 1
            ),
            "That is one standard deviation; its ratio to the Kalman filter's is asked for.": (
                lambda: [_spread(W1), _spread(0.0)]
            ),
            "w1 is the weight of the measurement, w2 that of the last estimate.": lambda: (
                _spread(1 - W1) / _spread(0.0)
            ),
            "The Kalman filter is at w1 = 0.": lambda: [
                _spread(W1) / _spread(1.0),
                _spread(1.0) / _spread(W1),
            ],
            "The last measurement counts twice: in the blend, and in the estimate that is "
            "blended.": _without_memory_of_the_gain,
        },
        rtol=2e-3,
    ),
    "2.4": Exercise(
        right=_late,
        mistakes={
            "That is a number of steps; seconds are asked for.": lambda: _late() / STEP,
            "The newest measurement is not late at all: begin to count at 0.": lambda: STEP / K,
            "That is GLS. The Kalman filter has w1 = 0.": lambda: _late(1.0),
            "That is the intermediate method. The Kalman filter has w1 = 0.": lambda: _late(W1),
            "That is the time in which an old error falls to 1/e, not the mean age.": lambda: (
                -STEP / math.log(1 - K)
            ),
        },
    ),
    "2.5": Exercise(
        right=hidden_errors,
        cases=CASES,
        mistakes={
            "The error of an output neuron holds the slope of its own logistic function.": (
                _no_slope_of_the_output
            ),
            "The slope of the hidden neuron's own logistic function is missing.": (
                _no_slope_of_the_hidden
            ),
            "The second factor of the slope of the hidden neuron is missing, 1 less its signal.": (
                _signal_for_slope
            ),
            "That leads uphill: the error is minus the derivative.": _uphill,
            "The errors come back through the weights, not through the signals.": (
                _signals_for_weights
            ),
        },
        rtol=1e-6,
    ),
    "2.6": Exercise(
        right=lambda: _mean_of_answers(60),
        mistakes={
            "The answers are not independent: neighbours share their measurements.": lambda: (
                _spread(W1) / math.sqrt(60)
            ),
            "That is the lesson of 20 pairs.": lambda: _mean_of_answers(20),
            "That is the error of a single answer.": lambda: _spread(W1),
        },
        rtol=2e-2,
    ),
    "2.7": Exercise(
        right=lambda: 1 - 0.99**32,
        mistakes={
            "Probabilities add up only if no two of the events can happen together.": lambda: 0.32,
            "That is the probability that the test stays quiet.": lambda: 0.99**32,
            "That is one look; there are many.": lambda: [0.01, 0.99],
            "Count the looks, not the steps of the examination.": lambda: 1 - 0.99**EXAM,
        },
    ),
    "2.8": Exercise(
        right=lambda: "noise",
        mistakes={
            "Teach at ten times the rate, and look at the last epoch again.": lambda: "rate",
            "How much did the last four hundred epochs change in Figure B3?": lambda: "epochs",
        },
    ),
    "2.9": Exercise(
        right=_floor,
        mistakes={
            "The part of the answer that goes with its own measurement can be learnt.": lambda: (
                _floor(part=lambda h: h)
            ),
            "Δ is in scaled units: what is one of them in m/s?": lambda: _floor(size=1.0),
            "That is the mean square; the question is about its root.": lambda: _floor(
                math.sqrt(DELTA)
            ),
            "That would be so if all of the noise stayed; only a part of it does.": lambda: (
                DELTA * RANGE
            ),
            "That is the part that can be learnt; the rest of the answer cannot.": lambda: _floor(
                part=lambda h: h[:1]
            ),
        },
    ),
    "2.10": Exercise(
        right=_break_even,
        mistakes={
            "The drift of the vector is shared by two components.": lambda: [
                _break_even(components=1),
                _break_even(components=4),
            ],
            "A step lasts three seconds.": lambda: _break_even(step=1.0),
            "The constant has an error of its own before any drift.": lambda: _break_even(
                gap=TEACHER**2
            ),
            "The drift grows all the time: its mean square counts, not its end or its mean.": (
                lambda: [_break_even(drift=EXAM - 1), _break_even(drift=(EXAM - 1) / 2)]
            ),
            "Squares of errors add up and subtract, errors do not.": lambda: _break_even(
                gap=(TEACHER - CONSTANT) ** 2
            ),
        },
    ),
}
