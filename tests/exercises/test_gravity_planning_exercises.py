"""Notebook 5: every right answer found another way, and common wrong ones get their hint."""

import numpy as np
import pytest

from seanav.exercises import exercises
from seanav.exercises.judge import hint

EXERCISES = exercises(5)


def dense(slopes, R, P0, Q):
    """Return the bound of every sample from the whole information matrix of the track."""
    found = [P0]
    for last in range(1, len(slopes) + 1):
        J = np.zeros((last + 1, 2, last + 1, 2))
        J[0, :, 0] += np.linalg.inv(P0)
        for t in range(1, last + 1):
            J[t, :, t] += np.outer(slopes[t - 1], slopes[t - 1]) / R
            for a, b, sign in ((t, t, 1), (t - 1, t - 1, 1), (t, t - 1, -1), (t - 1, t, -1)):
                J[a, :, b] += sign * np.linalg.inv(Q)
        found.append(np.linalg.inv(J.reshape(2 * last + 2, -1))[-2:, -2:])
    return np.array(found)


def roots(P):
    return np.sqrt(P[..., 0, 0] + P[..., 1, 1])


def two_gravimeters():
    # Nothing drifts, so the informations of the readings add up.
    angle = 0.05 * np.arange(1, 100)
    H = 0.5 * np.array([np.cos(angle), np.sin(angle)]).T
    added = np.cumsum(H[:, :, None] * H[:, None, :], axis=0)
    sums = [roots(np.linalg.inv(np.eye(2) + added / R)).sum() + np.sqrt(2) for R in (4.0, 2.0)]
    return sums[0] / sums[1]


def alternating():
    slopes = np.array([[1e4, 0.0], [0.0, 1e4]] * 6)[:11]
    track = dense(slopes, 1.0, np.eye(2), 0.2 * np.eye(2))
    return np.trace(track[3:], axis1=1, axis2=2).sum()


def both_ways():
    east = {"A": 10.0, "B": 2.0}  # information before; each node adds 4
    spent = {"A": 3.0 + 5 * 1.0, "B": 3.2 + 5 * 0.5}
    cost = {k: spent[k] + sum(1 / (east[k] + 4 * n) for n in range(1, 6)) for k in east}
    return cost["A"] / cost["B"]


def bent():
    # The mean of h'² by summing over the prior.
    x = np.linspace(-8, 8, 4001)
    weight = np.exp(-0.5 * x**2)
    mean = (weight * (1 + x**2) ** 2).sum() / weight.sum()
    return [(1 + 1 / 4) ** -0.5, (1 + mean / 4) ** -0.5]


def joint(J, H, R, Q):
    """Return the step from the joint covariance of the two positions, conditioned on a reading."""
    P = np.linalg.inv(J) + Q
    S = H @ P @ H + R
    return np.linalg.inv(P - np.outer(P @ H, P @ H) / S)


def by_directions(G1, P1, G2, P2, epsilon):
    angle = np.linspace(0, np.pi, 721)
    e = np.array([np.cos(angle), np.sin(angle)])
    apart = np.einsum("ik,ij,jk->k", e, (1 + epsilon) * P2 - P1, e)
    return G1 <= G2 and bool((apart >= 0).all())


ANOTHER_WAY = {
    "5.1": lambda: np.sqrt(1 + 1 / (1 + 9 / 4)),
    "5.2": lambda: 0.01 * np.sqrt(12_880),
    "5.3": lambda: joint,
    "5.4": two_gravimeters,
    "5.5": lambda: [np.sqrt(1 + 1 / 91), np.sqrt(2 / 46)],
    "5.6": alternating,
    "5.7": both_ways,
    "5.8": lambda: by_directions,
    "5.9": bent,
}


def test_every_exercise_is_found_another_way():
    assert set(ANOTHER_WAY) == set(EXERCISES)


@pytest.mark.parametrize("number", ANOTHER_WAY)
def test_the_right_answer_found_another_way_is_right(number):
    assert hint(EXERCISES[number], ANOTHER_WAY[number]()) == ""


WRONG = {
    "5.1": (np.sqrt(1 + 2 / 11), np.sqrt(4 / 13), 1 + 4 / 13, -1.1435, 1143.5, 8 / 13, 4 / 13),
    "5.2": (128.8, 1.288, 1.605, 1.135e-3, 2.538),
    "5.3": (
        lambda J, H, R, Q: J + Q + np.outer(H, H) / R,
        lambda J, H, R, Q: J + np.outer(H, H) / R,
        lambda J, H, R, Q: np.linalg.inv(joint(J, H, R, Q)),
        lambda J, H, R, Q: joint(J, H, R**2, Q),
        lambda J, H, R, Q: H @ J @ H,  # a number
        lambda J, H, R, Q: joint(J, 0 * H, R, Q) + H @ H / R,
        lambda J, H, R: J,
        3.0,
    ),
    "5.4": (2**0.5, 2.0, 1 / two_gravimeters(), 1.3437, 1.0),
    "5.5": (
        [0.1048, 0.2085],
        [1.01099, 0.04348],
        [0.2085, 1.0055],
        [0.2085, 0.2085],
        1.0055,
        [1005.5, 208.5],
    ),
    "5.6": (3.6, 0.0, 5.4, 0.2, 1.6),
    "5.7": (1 / both_ways(), 1.784, 0.9375, 1.0769, np.nan, 0.6507, 8.244, 6.139, 2.105),
    "5.8": (
        lambda G1, P1, G2, P2, epsilon: G1 <= G2 and np.trace(P1) <= (1 + epsilon) * np.trace(P2),
        lambda G1, P1, G2, P2, epsilon: (
            G1 <= G2 and bool((np.diag(P1) <= (1 + epsilon) * np.diag(P2)).all())
        ),
        lambda G1, P1, G2, P2, epsilon: by_directions(0, P1, 0, P2, epsilon),
        lambda G1, P1, G2, P2, epsilon: by_directions(G1, P1, G2, P2, 0.0),
        lambda G1, P1, G2, P2, epsilon: G1 <= G2 and bool((P1 <= (1 + epsilon) * P2).all()),
        lambda G1, P1, G2, P2, epsilon: by_directions(G1, P1, (1 + epsilon) * G2, P2, epsilon),
        lambda G1, P1, G2, P2, epsilon: G1 < G2 and by_directions(G1, P1, G2, P2, epsilon),
        lambda G1, P1, G2, P2, epsilon: True,
        True,
    ),
    "5.9": ([0.8944, 0.8944], [0.8944, 0.7071], [0.8, 0.4], [2.0, 0.8165], [0.6325, 0.8944]),
}


@pytest.mark.parametrize("number", WRONG)
def test_common_wrong_answers_get_a_hint(number):
    said = [hint(EXERCISES[number], wrong) for wrong in WRONG[number]]
    assert all(said), said
    assert len(set(said)) >= 3


@pytest.mark.parametrize("number", EXERCISES)
def test_every_declared_mistake_gets_its_own_hint(number):
    exercise = EXERCISES[number]
    for said, mistake in exercise.mistakes.items():
        made = mistake if exercise.cases else mistake()
        for one in made if isinstance(made, list) else [made]:
            assert hint(exercise, one) == said


@pytest.mark.parametrize("number", EXERCISES)
def test_no_hint_gives_the_answer_away(number):
    exercise = EXERCISES[number]
    if not exercise.cases:
        numbers = [f"{x:.3g}" for x in np.ravel(exercise.right())]
        for said in exercise.mistakes:
            assert not any(x in said for x in numbers)
