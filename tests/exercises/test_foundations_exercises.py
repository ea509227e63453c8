"""Exercises of the foundations, what is right found another way; the sliders of that notebook."""

from pathlib import Path

import matplotlib
import nbformat
import numpy as np
import pytest
from matplotlib import pyplot as plt
from scipy import integrate, optimize, stats
from scipy.linalg import expm

from seanav import estimates
from seanav.exercises import find, foundations
from seanav.exercises.judge import hint
from seanav.filters import kalman

BOOK = Path(__file__).resolve().parents[2] / "notebooks" / "0_foundations.ipynb"


# ---------------------------------------------------------------- right, another way


def north_east():
    # On a compass rose: the ship's head lies at 120°, her starboard at 210°.
    places = [(5.0, 120.0), (0.5, 210.0)]
    return sum(v * np.array([np.cos(np.radians(d)), np.sin(np.radians(d))]) for v, d in places)


def updated():
    # The product of the two densities on a fine grid.
    x = np.linspace(-100, 350, 200_001)
    p = stats.norm.pdf(x, 100, 15) * stats.norm.pdf(112, x, 5)
    p /= p.sum()
    mean = p @ x
    return [mean, np.sqrt(p @ (x - mean) ** 2)]


def by_quadrature(dt, tau, sigma):
    F, q = np.array([[0.0, 1.0], [0.0, -1.0 / tau]]), 2 * sigma**2 / tau

    def integrand(t):
        column = expm(F * t)[:, 1]
        return q * np.outer(column, column)

    return integrate.quad_vec(integrand, 0.0, dt, epsrel=1e-10)[0]


def runs_needed():
    # The interval of the library itself, of squares as normal errors have them.
    def half_width(runs):
        squares = stats.chi2.ppf((np.arange(round(runs)) + 0.5) / round(runs), 1)
        one = estimates.root_mean_square(squares)
        return (one.high - one.low) / 2 / one.value - 0.02

    return optimize.brentq(half_width, 2000, 9000, xtol=1.0)


def pairing_saves():
    # Two such squared errors with that correlation, drawn: the variances of their difference.
    rng = np.random.default_rng(1)
    common, a, b, c = rng.standard_normal((4, 400_000))
    keep, own = np.sqrt(0.98), np.sqrt(0.02)
    first, second, apart = keep * common + own * a, keep * common + own * b, c
    return np.var(1.2 * apart - first) / np.var(1.2 * second - first)


def nees_simulated():
    # The filter of the package on a long walk whose steps are larger than it believes.
    rng = np.random.default_rng(2)
    runs, steps, settled = 400, 400, 150
    truth = np.cumsum(2.0 * rng.standard_normal((runs, steps, 1)), axis=1)
    z = truth + 10.0 * rng.standard_normal((runs, steps, 1))
    one = np.eye(1)
    start = np.zeros((runs, 1))
    track = kalman.run(one, np.zeros((steps, 1)), one, one, 100 * one, start, 10 * one, z)
    return kalman.nees(track.x - truth, track.P)[:, settled:].mean()


RIGHT = {
    "0.1": north_east,
    "0.2": updated,
    "0.3": lambda: by_quadrature(30.0, 120.0, 0.3)[1, 1],
    "0.4": lambda: by_quadrature,
    "0.5": runs_needed,
    "0.6": pairing_saves,
    "0.7": lambda: " Undecided ",
    "0.8": nees_simulated,
}


@pytest.mark.parametrize("number", foundations.EXERCISES)
def test_right_is_what_is_found_another_way(number):
    assert hint(find(number), RIGHT[number]()) == ""


# ---------------------------------------------------------------- wrong answers


def mistakes():
    for number, exercise in foundations.EXERCISES.items():
        for said, mistake in exercise.mistakes.items():
            made = mistake if exercise.cases else mistake()
            for answer in made if isinstance(made, list) else [made]:
                yield number, answer, said


@pytest.mark.parametrize(("number", "answer", "said"), list(mistakes()))
def test_a_declared_mistake_gets_its_own_hint(number, answer, said):
    assert hint(find(number), answer) == said


COMMON = [
    ("0.1", [-2.933, -4.08], "steps once more"),  # a sign of one component
    ("0.1", [-5.70, 7.93], "steps once more"),  # m/s taken for knots
    ("0.1", [-2.933, 4.080, 0.0], "shape"),
    ("0.2", [106.0, 4.743], "steps once more"),  # the mean of the two
    ("0.2", [110.8, 15.81], "steps once more"),  # variances added
    ("0.2", [109.0, 4.743], "by variances"),  # weights by standard deviations, the spread right
    ("0.2", 110.8, "shape"),
    ("0.3", 0.0354**0.5, "square, or the root"),
    ("0.3", 0.0708, "twice, or half"),
    ("0.3", 0.00441, "Q_pv"),  # 0.3² (1 - a)²
    ("0.3", 0.0021, "steps once more"),
    ("0.4", foundations.process_noise(10.0, 120.0, 0.3), "function itself"),
    ("0.4", lambda dt, tau, sigma: np.full((2, 2), np.nan), "not finite"),
    (
        "0.4",
        lambda dt, tau, sigma: foundations.process_noise(dt, tau, sigma)[::-1, ::-1],
        "position comes first",
    ),
    ("0.4", lambda dt, tau, sigma: np.eye(2), "numbers"),
    ("0.4", lambda dt, tau, sigma: 1 / 0, "ZeroDivisionError"),
    ("0.5", 48, "power of ten"),
    ("0.5", 5000, "close"),
    ("0.5", -4802, "sign"),
    ("0.6", 0.0361, "other way round"),
    ("0.6", 50.0, "variances differ"),
    ("0.6", 768.8, "square, or the root"),
    ("0.6", 2.773, "power of ten"),
    ("0.7", "holds", "steps once more"),
    ("0.7", 1, "words"),
    ("0.7", None, "words"),
    ("0.8", 2.425**0.5, "square, or the root"),
    ("0.8", 4.85, "twice, or half"),
    ("0.8", 0.524, "true random walk"),
    ("0.8", 1.90, "gain of the told Q"),  # Riccati(true) / Riccati(told)
    ("0.8", 4.0, "ratio of the Q"),
]


@pytest.mark.parametrize(("number", "answer", "word"), COMMON)
def test_a_common_wrong_answer_gets_a_hint(number, answer, word):
    assert word in hint(find(number), answer)


def test_every_exercise_has_three_wrong_answers_here():
    numbers = [number for number, *_ in COMMON]
    assert all(numbers.count(number) >= 3 for number in foundations.EXERCISES)


# ---------------------------------------------------------------- the notebook's sliders


@pytest.fixture(scope="module")
def lesson():
    """Run the cells of the notebook that the sliders need: what is imported and defined."""
    needed = (
        "# The ship",
        "import attrs",
        "SEED = checks",
        "Phi, offset, Q",
        "def sail",
        "def navigate",
    )
    needed += ("def consistency", "def picture")
    cells = [c for c in nbformat.read(BOOK, as_version=4).cells if c.cell_type == "code"]
    names = {}
    with plt.style.context("default"):
        for beginning in needed:
            (source,) = [c.source for c in cells if c.source.startswith(beginning)]
            exec(source, names)
    return names


def test_sliders_draw_at_their_defaults_and_corners(lesson):
    matplotlib.use("Agg")
    corners = [{}] + [
        {"log10_Q": Q, "log10_R": R, "runs": runs}
        for Q in (-2.0, 2.0)
        for R in (-2.0, 2.0)
        for runs in (10, 300)
    ]
    for values in corners:
        fig = lesson["picture"](**values)
        curves = [line.get_ydata() for axes in fig.axes for line in axes.lines]
        assert len(curves) == 5
        assert all(np.isfinite(y).all() for y in curves)
        plt.close(fig)


def test_sliders_at_zero_show_the_error_that_theory_knows(lesson):
    fig = lesson["picture"](log10_Q=0.0, log10_R=0.0, runs=300)
    error, best, believed, nees, nis = (line.get_ydata() for a in fig.axes for line in a.lines)
    plt.close(fig)
    assert np.array_equal(error, best)
    # Settled: the solution of the Riccati equation, and χ² with two degrees of freedom.
    P = np.eye(2)
    for _ in range(200):
        M = lesson["Phi"] @ P @ lesson["Phi"].T + lesson["Q"]
        P = M - M @ np.linalg.inv(M + lesson["R"]) @ M
    assert believed[-1] == pytest.approx(np.sqrt(P[0, 0]), rel=1e-5)
    assert error[-20:].mean() == pytest.approx(believed[-1], rel=0.1)
    for mean in (nees.mean(), nis.mean()):
        assert mean == pytest.approx(2.0, abs=0.15)


def test_sliders_moved_together_change_what_is_believed_and_not_what_is_estimated(lesson):
    fig = lesson["picture"](log10_Q=1.0, log10_R=1.0, runs=50)
    error, best, *_, nees, _ = (line.get_ydata() for axes in fig.axes for line in axes.lines)
    plt.close(fig)
    # Only the start differs: P0 stays.
    assert error[-10:] == pytest.approx(best[-10:], rel=1e-2)
    assert nees[-10:].mean() == pytest.approx(0.2, abs=0.05)
