"""Exercises of paper 2: each answer by another way, and the mistakes that students make."""

import numpy as np
import pytest
from scipy import optimize, signal, stats

from seanav.exercises import find
from seanav.exercises.judge import hint
from seanav.exercises.neural_estimator import CASES

NOISE, Q, STEP = 0.3, 0.005, 3.0


def at_rest():
    """Return the gain of the recursion after so many steps that it stands still."""
    P = 1.0
    for _ in range(1000):
        P += Q
        K = P / (P + NOISE**2)
        P *= 1 - K
    return K


def answers(z, w1):
    """Return the estimates of the filter at rest, step by step, from a start at `z[0]`."""
    K, x = at_rest(), np.array(z)
    for i in range(1, len(z)):
        blend = w1 * z[i - 1] + (1 - w1) * x[i - 1]
        x[i] = blend + K * (z[i] - blend)
    return x


def impulse(w1, count=600):
    z = np.zeros(count)
    z[1] = 1.0
    return answers(z, w1)[1:]


def spread(w1):
    return NOISE * np.sqrt((impulse(w1) ** 2).sum())


def lag(w1):
    ramp = np.arange(500.0)
    return STEP * (ramp - answers(ramp, w1))[-1]


def mean_of_answers(pairs):
    box = np.full(pairs, 1 / pairs)
    return NOISE * np.sqrt((signal.fftconvolve(impulse(0.3), box) ** 2).sum())


def residual(noise):
    """Return the rms, in scaled units, of the answers less a line through the measurements."""
    h = impulse(0.3)
    slope = optimize.minimize_scalar(lambda g: (h[0] - g) ** 2 + (h[1:] ** 2).sum()).x
    left = h.copy()
    left[0] -= slope
    return noise * np.sqrt((left**2).sum()) / 20


def break_even():
    time = STEP * np.arange(160)

    def gap(rate_deg_s):
        turned = 6.0 * np.exp(1j * np.deg2rad(rate_deg_s) * time) - 6.0
        return 0.067**2 + (abs(turned) ** 2).mean() / 2 - 0.142**2

    return optimize.brentq(gap, 1e-5, 0.1)


def errors_by_differences(t, o, v, y):
    """Return minus the derivative of half the squared error by each hidden net input."""
    net, start = np.log(y / (1 - y)), np.log(o / (1 - o))

    def half_square(moved):
        out = start + v @ (1 / (1 + np.exp(-moved)) - y)
        return ((t - 1 / (1 + np.exp(-out))) ** 2).sum() / 2

    return -optimize.approx_fprime(net, half_square, 1e-7)


BY_ANOTHER_WAY = {
    "2.1": at_rest,
    "2.2": lambda: sum(a * b + b for a, b in ((2, 100), (100, 2))),
    "2.3": lambda: spread(0.3) / spread(0.0),
    "2.4": lambda: lag(0.0),
    "2.6": lambda: mean_of_answers(60),
    "2.7": lambda: stats.binom.sf(0, 32, 0.01),
    "2.8": lambda: " Noise ",
    "2.9": lambda: optimize.brentq(lambda noise: residual(noise) - 0.001, 1e-3, 1.0),
    "2.10": break_even,
}


@pytest.mark.parametrize("number", BY_ANOTHER_WAY)
def test_right_by_another_way(number):
    assert hint(find(number), BY_ANOTHER_WAY[number]()) == ""


def test_errors_of_hidden_neurons_are_derivatives():
    exercise = find("2.5")
    for case in CASES:
        assert np.allclose(exercise.right(*case), errors_by_differences(*case), rtol=1e-4)
    assert hint(exercise, lambda t, o, v, y: (v.T @ ((t - o) * o * (1 - o))) * (y - y**2)) == ""


# What a student may hand in, and a word of the hint.
WRONG = {
    "2.1": [(0.2357, "1 - K"), (0.121, "variance"), (0.0526, "zero"), (0.79, "prediction"),
            (0.0556, "degree two"), (0.01886, "variance"), (20.96, "power of ten")],
    "2.2": [(400, "threshold"), (500, "output"), (300, "one of the two"), (1004, "twice")],
    "2.3": [(1.910, "variances"), (1.915, "w2"), (0.578, "w1 = 0"), (1.034, "twice"),
            (0.382, "by how much"), (0.142, "one standard"), (13.82, "power of ten")],
    "2.4": [(3.772, "steps"), (14.3, "newest"), (2.37, "GLS"), (5.31, "intermediate"),
            (12.76, "1/e"), (-11.3, "sign")],
    "2.6": [(0.0183, "independent"), (0.0641, "20"), (0.1419, "single"), (3.82, "power of ten")],
    "2.7": [(0.32, "add up"), (0.725, "quiet"), (0.01, "one look"), (0.7997, "steps"),
            (27.5, "power of ten")],
    "2.8": [("rate", "ten times"), ("Epochs", "four hundred"), (1, "words"), ("luck", "steps")],
    "2.9": [(0.0423, "learnt"), (0.00236, "scaled"), (1.492, "root"), (0.0954, "rest"),
            (0.02, "all of the noise"), (47.2, "power of ten")],
    "2.10": [(0.00433, "components"), (0.0184, "three"), (0.00354, "grows"), (0.00367, "Squares"),
             (0.00695, "own"), (0.000107, "degrees")],
}  # fmt: skip


@pytest.mark.parametrize(("number", "answer", "word"), [(n, *w) for n in WRONG for w in WRONG[n]])
def test_a_common_mistake_gets_its_hint(number, answer, word):
    assert word in hint(find(number), answer)


@pytest.mark.parametrize(
    ("wrong", "word"),
    [
        (lambda t, o, v, y: y * (1 - y) * ((t - o) @ v), "output neuron"),
        (lambda t, o, v, y: ((t - o) * o * (1 - o)) @ v, "hidden"),
        (lambda t, o, v, y: y * (((t - o) * o * (1 - o)) @ v), "second factor"),
        (lambda t, o, v, y: y * (1 - y) * (((o - t) * o * (1 - o)) @ v), "uphill"),
        (lambda t, o, v, y: y * (1 - y) * ((t - o) * o * (1 - o)).sum() * y, "weights"),
        (lambda t, o, v, y: (t - o) * o * (1 - o), "shape"),
        (lambda t, o: t - o, "raised"),
        (np.zeros(6), "without calling"),
    ],
)
def test_a_wrong_function_gets_its_hint(wrong, word):
    assert word in hint(find("2.5"), wrong)
