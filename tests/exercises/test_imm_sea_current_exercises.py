"""Exercises of paper 4: each right answer computed another way, wrong ones recognised."""

import math

import numpy as np
import pytest
from scipy import optimize, stats

from seanav.exercises import check
from seanav.exercises.imm_sea_current import EXERCISES
from seanav.exercises.judge import hint
from seanav.filters import ins
from seanav.models.attitude import exp_so3
from seanav.studies.imm_sea_current import explore, linear, run
from seanav.studies.imm_sea_current.scenario import Scenario


def by_differences():
    """Return the row of H by moving each state a little and looking at the residual."""
    heading, current = math.radians(60.0), np.array([0.6, -0.2, 0.0])
    c, s = math.cos(heading), math.sin(heading)
    C, v = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), 10.0 * np.array([c, s, 0.0])

    def predicted(e):
        attitude = exp_so3(-e[3:6]) @ C
        return (attitude.T @ (v + e[:3] - current - e[6:]))[0]

    step = 1e-6
    return [(predicted(step * e) - predicted(-step * e)) / (2 * step) for e in np.eye(9)]


def one_second():
    """Return the mode probability with densities from scipy."""
    prior = 0.95 * 0.8 + 0.05 * 0.2
    masses = [
        p * stats.norm.pdf(0.25, scale=math.sqrt(S)) for p, S in ((prior, 0.01), (1 - prior, 0.09))
    ]
    return masses[0] / sum(masses)


def factor(residuals, S, window):
    """Return beta by a loop over the window."""
    total, count = 0.0, 0
    for rho in reversed(residuals):
        if count < window:
            total, count = total + rho * rho, count + 1
    return 1.0 if count < 2 else max(1.0, total / (count - 1) / S)


def doubling():
    """Return the time to double from many draws."""
    draws = np.random.default_rng(1).chisquare(40, 4_000_000) / 39
    return math.log(2) / np.log(np.maximum(draws, 1.0)).mean()


def with_the_wrong_sign():
    """Return the growth in powers of ten by a filter of two states, written out."""
    a, R = math.exp(-1 / 7200), 1e-4
    P, Q = np.diag([0.09, 0.09]), np.diag([4e-6, 0.09 * (1 - a * a)])
    h, F, e = np.array([1.0, -1.0]), np.diag([1.0, a]), np.array([0.3, 0.0])
    for _ in range(60):
        P, e = F @ P @ F.T + Q, F @ e
        K = P @ h / (h @ P @ h + R)
        P, e = P - np.outer(K, h @ P), e + K * (h @ e)
    return math.log10(e[0] / 0.3)


def better_gyros():
    """Return the crossing by a search for the root."""
    one = Scenario(gyro_bias_deg_h=0.002)
    pure = linear.tcep(one, None, 0.5)
    return optimize.brentq(lambda s: linear.scores(one, 0.1, s)[4] - pure, 0.1, 1.5, xtol=1e-4)


def best_filter():
    """Return the filter with the largest least rate, and that rate, one by one."""
    one, best = Scenario(), (0.0, -math.inf)
    for sigma in (0.1, 0.2, 0.3, 0.4, 0.5, 0.6):
        found = []
        for sea in (0.05, 0.3, 1.0):
            pure, knowing, own = (linear.scores(one, f, sea)[4] for f in (None, sea, sigma))
            found.append(100 * (pure - own) / (pure - knowing))
        if min(found) > best[1]:
            best = (sigma, min(found))
    return best


def best_pair():
    """Return the second sub-filter with the largest least rate, from the mean squares."""
    lap, sensors = explore.scenario(), explore.sensors()

    def tcep(filter_, sea):
        squares = run.fly(lap, sensors, filter_, sea).mean_squares
        return 0.589 * (math.sqrt(squares.north.mean()) + math.sqrt(squares.east.mean()))

    least = {}
    for second in (0.3, 0.5, 0.8, 1.0):
        found = []
        for sea in (0.05, 0.3, 1.0):
            pure, knowing = tcep(run.PURE, sea), tcep(run.optimal(sea), sea)
            own = tcep(run.EKF(0.1, second), sea)
            found.append((pure - own) / (pure - knowing))
        least[second] = min(found)
    return max(least, key=least.get)


ANOTHER_WAY = {
    "4.1": lambda: 0.4 * math.sqrt(1 - math.exp(-1.5)),
    "4.2": lambda: -20.0,
    "4.3": by_differences,
    "4.4": one_second,
    "4.5": lambda: factor,
    "4.6": doubling,
    "4.7": with_the_wrong_sign,
    "4.8": better_gyros,
    "4.9": best_filter,
    "4.10": best_pair,
}
NUMBERS = [number for number, exercise in EXERCISES.items() if not exercise.cases]


def test_every_exercise_is_computed_another_way():
    assert set(ANOTHER_WAY) == set(EXERCISES)


@pytest.mark.parametrize("number", ANOTHER_WAY)
def test_the_right_answer_computed_another_way_is_right(number, capsys):
    check(number, ANOTHER_WAY[number]())
    assert capsys.readouterr().out == f"{number}: right\n"


@pytest.mark.parametrize("number", NUMBERS)
def test_each_declared_mistake_gets_its_own_hint(number):
    exercise = EXERCISES[number]
    for said, mistake in exercise.mistakes.items():
        made = mistake()
        for wrong in made if isinstance(made, list) else [made]:
            assert hint(exercise, wrong) == said


@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("wrong", [lambda x: -x, lambda x: 2 * x, lambda x: 100 * x])
def test_common_wrong_answers_are_not_right(number, wrong):
    exercise = EXERCISES[number]
    assert hint(exercise, wrong(np.asarray(exercise.right())))
    assert hint(exercise, "a word")


def row_of(ahead, water):
    """Return the nine numbers of H by the vector product."""
    ahead = np.array(ahead)
    return np.r_[ahead, -np.cross(ahead, water), -ahead]


C60, S60 = 0.5, math.sqrt(0.75)
BETAS = np.maximum(np.random.default_rng(2).chisquare(40, 200_000) / 39, 1.0)
BY_HAND = {
    "a root forgotten": ("4.1", 0.4 * (1 - math.exp(-1.5)), "root of the share"),
    "mine over pure": ("4.2", 115.0, "gained"),
    "west is plus": ("4.3", row_of([C60, S60, 0], [4.4, 10 * S60 - 0.2, 0]), "West"),
    "body axes": ("4.3", [1, 0, 0, 0, 0, -0.1 - 0.6 * S60, -1, 0, 0], "turn what is ahead"),
    "sine for cosine": ("4.3", row_of([S60, C60, 0], [10 * S60 - 0.6, 5.2, 0]), "north component"),
    "the prior": ("4.4", 0.77, "before the measurement"),
    "logarithm last": ("4.6", math.log(2) / math.log(BETAS.mean()), "mean of the logarithms"),
    "doubling each second": ("4.7", 18.06, "near one only"),
}


@pytest.mark.parametrize(("number", "wrong", "said"), BY_HAND.values(), ids=list(BY_HAND))
def test_a_mistake_made_by_hand_gets_a_hint_about_it(number, wrong, said):
    assert said in hint(EXERCISES[number], wrong)


@pytest.mark.parametrize("said", EXERCISES["4.5"].mistakes)
def test_wrong_fading_factors_get_their_own_hint(said):
    assert hint(EXERCISES["4.5"], EXERCISES["4.5"].mistakes[said]) == said


def test_the_lap_of_the_last_exercise_has_runs_enough():
    assert explore.sensors().runs == ins.LANES
