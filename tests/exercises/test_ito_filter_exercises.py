"""The answers to the exercises of paper 1, each computed another way; wrong ones get a hint."""

from itertools import product

import numpy as np
import pytest
import sympy as sp
from scipy import integrate, optimize

from seanav.exercises import check
from seanav.exercises.ito_filter import EXERCISES
from seanav.exercises.judge import hint
from seanav.filters import moments
from seanav.models import bodies

# Probabilists' Gauss–Hermite: exact for polynomials up to degree 39.
NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(20)
WEIGHTS = WEIGHTS / WEIGHTS.sum()


def mean_of(function, m, P):
    return float(WEIGHTS @ function(m + np.sqrt(P) * NODES))


def gaussian_rates(drift, m, P, g):
    mean = mean_of(drift, m, P)
    return mean, 2 * mean_of(lambda x: (x - m) * drift(x), m, P) + g**2


def expanded_rates(drift, m, P, g, curved):
    h = 1e-3
    slope = (drift(m + h) - drift(m - h)) / (2 * h)
    bend = (drift(m + h) - 2 * drift(m) + drift(m - h)) / h**2
    return drift(m) + curved * bend * P / 2, 2 * slope * P + g**2


def square():
    # The square of an Ornstein–Uhlenbeck process has a mean in closed form.
    def mean(t):
        return 9 * np.exp(-2 * t) + 9 / 2 * (1 - np.exp(-2 * t))

    return (mean(1e-5) - mean(-1e-5)) / 2e-5


def pairs():
    root = np.linalg.cholesky([[2.0, 1.0], [1.0, 3.0]])
    points = np.array(list(product(NODES, NODES))) @ root.T
    weights = np.array([a * b for a, b in product(WEIGHTS, WEIGHTS)])
    x, y = points.T
    return [weights @ (x**2 * y**2), weights @ (x**3 * y)]


def nees():
    root = np.random.default_rng(3).standard_normal((6, 6))
    P = root @ root.T
    return np.trace(np.linalg.solve(4 * P, P))


def closures():
    def drift(x):
        return -x - 2 * x**3

    at = (drift, 0.5, 0.2, 1.5)
    return [expanded_rates(*at, 0), expanded_rates(*at, 1), gaussian_rates(*at)]


def at_rest():
    def rate(P):
        return gaussian_rates(lambda x: -x - 2 * x**3, 0.0, P, 1.0)[1]

    return optimize.brentq(rate, 0.01, 1.0)


def dragged():
    def density(z):
        return np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)

    def rates(t, y):
        m, s = y[0], np.sqrt(y[1])
        spans = [(-12.0, -m / s), (-m / s, 12.0)]  # the kink lies at x = 0

        def over(function):
            return sum(
                integrate.quad(lambda z: function(m + s * z) * density(z), *span)[0]
                for span in spans
            )

        mean = over(lambda x: -x * abs(x))
        return mean, 2 * over(lambda x: -(x - m) * x * abs(x)) + 0.25

    return integrate.solve_ivp(rates, (0.0, 2.0), (0.5, 0.2), rtol=1e-8).y[0, -1]


def surge():
    # For a square of Gaussians the second-order update is the best linear one: no expansion.
    sd = np.sqrt([0.05, 0.02, 0.02])
    points = np.array(list(product(NODES[::1], repeat=3))) * sd + [1.0, 0.0, 0.0]
    weights = np.prod(list(product(WEIGHTS, repeat=3)), axis=1)
    speed = (points**2).sum(axis=1)
    predicted = weights @ speed
    both = weights @ ((speed - predicted) * (points[:, 0] - 1.0))
    variance = weights @ (speed - predicted) ** 2 + 1e-3
    return 1.0 + both / variance * (1.3 - predicted)


def by_quadrature(m, P, a, c, g):
    return gaussian_rates(lambda x: -a * x - c * x**5, m, P, g)


def ranks():
    drift, diffusion, names = bodies.equations()
    model = moments.system(bodies.STATES, drift, diffusion, bodies.INPUTS, names)
    numbers = dict(zip(names, bodies.SPHERE.parameters(), strict=True)) | {"m3": 200.0}
    numbers |= dict(zip(bodies.INPUTS, bodies.SPHERE.inputs, strict=True))
    at = {x.name: x for x in (*model.inputs, *model.parameters)}
    f = model.drift.subs({at[name]: value for name, value in numbers.items()})
    point = dict(zip(model.states, (0.9, -0.7, 1.1, 0.6, -0.8, 0.5), strict=True))
    outputs, rows, out = sp.Matrix(model.states[3:]), [], []
    for _ in range(4):
        slope = outputs.jacobian(model.states)
        rows.append(np.array(slope.subs(point), dtype=float))
        matrix = np.vstack(rows)
        matrix /= np.linalg.norm(matrix, axis=1, keepdims=True)
        out.append(np.linalg.matrix_rank(matrix, tol=1e-9))
        outputs = slope * f
    return out


OTHERWISE = {
    "1.1": square,
    "1.2": pairs,
    "1.3": nees,
    "1.4": closures,
    "1.5": at_rest,
    "1.6": dragged,
    "1.7": surge,
    "1.8": lambda: by_quadrature,
    "1.9": ranks,
}


@pytest.mark.parametrize("number", EXERCISES)
def test_the_answer_found_another_way_is_right(number, capsys):
    check(number, OTHERWISE[number]())
    assert capsys.readouterr().out == f"{number}: right\n"


DECLARED = [(number, said) for number, one in EXERCISES.items() for said in one.mistakes]


@pytest.mark.parametrize(("number", "said"), DECLARED)
def test_every_declared_mistake_gets_its_own_hint(number, said):
    exercise = EXERCISES[number]
    wrong = exercise.mistakes[said] if exercise.cases else exercise.mistakes[said]()
    for one in wrong if isinstance(wrong, list) else [wrong]:
        assert hint(exercise, one) == said


COMMON = {
    "1.1": (9.0, [-9.0], "nine", float("nan")),
    "1.2": ([6.0, 8.0], 8.0, [[8.0], [6.0]], [-8.0, -6.0]),
    "1.3": (-1.5, 15.0, 6.0, None),
    "1.4": (np.zeros((3, 2)), np.zeros((2, 3)), 0.0, [[np.nan, 0]] * 3),
    "1.5": (-0.2171, 0.466, 2.171, 0.2171 / 2),
    "1.6": (-0.12366, 1.2366, 0.5, "0.12"),
    "1.7": (1.0, 1.3, [1.1012, 0.0, 0.0], -1.1012),
    "1.8": (0.5, lambda m, P, a, c, g: (0.0, 0.0), lambda m: m, lambda m, P, a, c, g: "no"),
    "1.9": ([3, 3, 3, 3], [3, 5, 6], 6, [6, 6, 5, 3], {"u", "v"}),
}


@pytest.mark.parametrize("number", EXERCISES)
def test_common_wrong_answers_get_a_hint_that_gives_nothing_away(number):
    assert len(COMMON[number]) >= 3
    for answer in COMMON[number]:
        said = hint(EXERCISES[number], answer)
        assert said.endswith((".", "?")) or "raised" in said
        assert len(said) < 120
