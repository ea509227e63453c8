"""Exercises of notebook 3: what is right, found another way, and the hints of wrong answers."""

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view
from scipy import stats
from scipy.linalg import expm, solve_discrete_are

from seanav.exercises import adaptive_fading, find
from seanav.exercises.judge import hint
from seanav.filters import adaptive
from seanav.models import vehicles

TURN = 180 / np.pi


def false_alarm():
    # Count: the first alarm comes at step k with probability (1 − α)^(k − 1) α.
    return sum(0.99 ** (k - 1) * 0.01 for k in range(1, 101))


def one_factor():
    # The filter itself, over one step, its start at P and its innovation 0.8.
    track = adaptive.run(
        [[0.9]], [[0.0]], [[1.0]], [[0.01]], [[0.09]], [[0.0]], [[0.04]], [[[0.8]]],
        method="single",
    )  # fmt: skip
    return track.factors[0, 0, 0]


def longest_step():
    # By bisection on what Euler's rule does to the mode.
    low, high = 0.1, 3.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        grows = abs(1 + middle * complex(-0.8, 1.0)) > 1
        low, high = (low, middle) if grows else (middle, high)
    return low


def staying_error():
    # Step by step: the filter adds 0.02 to the truth's nothing, then corrects.
    found = []
    for gain in (0.25, 0.75):
        estimate = truth = 0.0
        for _ in range(500):
            predicted = 0.9 * estimate + 0.02
            truth = 0.9 * truth
            estimate = predicted + gain * (truth - predicted)
        found.append(estimate - truth)
    return found


def blind_factors():
    # Matrices in each unit, by the weights that the filter uses.
    found = {"single": [], "multiple": []}
    for turn in (1.0, TURN):
        T = np.diag([1.0, 1.0, turn])
        base, Q = T @ (1.5e-4 * np.eye(3)) @ T, T @ (1e-5 * np.eye(3)) @ T
        off = np.array([0.0, 3 * np.sqrt(1.6e-4), 0.0])
        for method, row in found.items():
            W = adaptive.weights(np.eye(3), Q, method)
            row.append(max(1.0, np.einsum("ab,ab", W[1], np.outer(off, off) - base)))
    return [*found["single"], *found["multiple"]]


def best_scale():
    # Without random numbers: a fixed gain makes mean and covariance of the error linear.
    plane = vehicles.steering()
    Phi, B = np.eye(3) + 0.1 * plane.A, 0.1 * plane.B
    true_Q, R, score = 1e-5 * np.eye(3), 1e-4 * np.eye(3), {}
    for scale in (1, 3, 10, 30, 100):
        P = solve_discrete_are(Phi.T, np.eye(3), scale * true_Q, R)
        A = np.eye(3) - P @ np.linalg.inv(P + R)
        mean, cov, squares = np.zeros(3), np.zeros((3, 3)), []
        for k in range(1000):
            # After 50 s the filter adds the rudder's effect, the vehicle does not feel it.
            added = 0.2 * np.sin(2 * np.pi * k * 0.1 / 20) * B if k >= 500 else 0.0
            mean = A @ (Phi @ mean + added)
            cov = A @ (Phi @ cov @ Phi.T + true_Q) @ A.T + (np.eye(3) - A) @ R @ (np.eye(3) - A).T
            if k >= 520:
                squares.append(mean**2 + np.diagonal(cov))
        score[scale] = np.log(np.mean(squares, axis=0)).mean()
    return min(score, key=score.get)


def sum_alarm(beta, length, m, alpha):
    sums = sliding_window_view(beta, length).sum(axis=1)
    (late,) = np.nonzero(stats.chi2.sf(sums, length * m) < alpha)
    return late[0] + length - 1 if len(late) else -1


def telling():
    # Hautus' test on the exact step, eigenvalue by eigenvalue.
    plane = vehicles.steering()
    joined = np.zeros((4, 4))
    joined[:3, :3], joined[:3, 3] = plane.A, plane.B
    whole, found = expm(0.1 * joined), []
    for row, state in enumerate(plane.states):
        tests = [
            np.vstack([whole - value * np.eye(4), np.eye(4)[row]])
            for value in np.linalg.eigvals(whole)
        ]
        if all(np.linalg.svd(test)[1][-1] > 1e-6 for test in tests):
            found.append(state)
    return found


def rule_24():
    white = np.random.default_rng(7).standard_normal((2_000_000, 3)) ** 2
    return (white @ [4.0, 1.0, 1.0] > 6.0).mean()


ANOTHER_WAY = {
    "3.1": false_alarm,
    "3.2": one_factor,
    "3.3": longest_step,
    "3.4": staying_error,
    "3.5": blind_factors,
    "3.6": best_scale,
    "3.7": lambda: sum_alarm,
    "3.8": telling,
    "3.9": rule_24,
}


def test_there_is_another_way_for_every_exercise():
    assert list(ANOTHER_WAY) == list(adaptive_fading.EXERCISES)


@pytest.mark.parametrize("number", ANOTHER_WAY)
def test_what_is_right_is_right_another_way(number):
    assert hint(find(number), ANOTHER_WAY[number]()) == ""


def declared(number):
    exercise = find(number)
    for said, mistake in exercise.mistakes.items():
        if exercise.cases:
            yield said, mistake
            continue
        made = mistake()
        for one in made if isinstance(made, list) else [made]:
            yield said, one


DECLARED = [(number, k, *pair) for number in ANOTHER_WAY for k, pair in enumerate(declared(number))]


@pytest.mark.parametrize(
    ("number", "said", "answer"),
    [(number, said, answer) for number, _, said, answer in DECLARED],
    ids=[f"{number}-{k}" for number, k, *_ in DECLARED],
)
def test_a_declared_mistake_gets_its_own_hint(number, said, answer):
    assert hint(find(number), answer) == said


@pytest.mark.parametrize(
    ("number", "answer", "word"),
    [
        ("3.1", 63.4, "power of ten"),
        ("3.1", 0.01 * 100, "on average"),
        ("3.1", 0.994, "first cell"),
        ("3.2", -51.76, "sign"),
        ("3.2", 0.5176, "how many times Q"),
        ("3.2", 4.83, "That is β"),
        ("3.2", 51.76 / 2, "half"),
        ("3.3", -0.9756, "sign"),
        ("3.3", 1.249, "divides by"),
        ("3.3", 1 / 0.9756**0.5 * 0.9756, "root"),
        ("3.4", [-0.04615, -0.00645], "sign"),
        ("3.4", 0.04615, "shape"),
        ("3.4", [0.015, 0.005], "first step"),
        ("3.5", [33.0, 129.0, 1.0, 129.0], "order"),
        ("3.5", [33.0, 1.0], "shape"),
        ("3.5", [48.0, 1.0, 144.0, 144.0], "taken off"),
        ("3.5", [33.0, 57.0, 129.0, 129.0], "Only the heading"),
        ("3.6", 7.0, "steps"),
        ("3.7", 3.0, "function itself"),
        ("3.7", lambda beta, length, m, alpha: beta[len(beta)], "raised IndexError"),
        ("3.7", lambda beta, length, m, alpha: None, "does not fit"),
        ("3.8", "psi", "set of words"),
        ("3.8", {"theta"}, "steps"),
        ("3.9", 35.2, "power of ten"),
        ("3.9", 0.05, "steps"),
        ("3.9", 0.5, "not a median"),
    ],
)
def test_a_common_wrong_answer_gets_a_hint(number, answer, word):
    assert word in hint(find(number), answer)


def test_a_student_s_monte_carlo_of_rule_24_is_right():
    white = np.random.default_rng(11).standard_normal((200_000, 3)) ** 2
    assert hint(find("3.9"), (white @ [4.0, 1.0, 1.0] > 6.0).mean()) == ""
