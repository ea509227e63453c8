"""What is right in the exercises of notebook 5, and the mistakes that are told apart.

Lengths in km, gravity in mGal, unless a name says otherwise.
"""

import numpy as np

from seanav.exercises.judge import Exercise
from seanav.filters.gravity import pcrb

KM, MGAL = 1e3, 1e-5


def _bound(slopes, noise, Q=0.0):
    """Return the bound (steps + 1, 2, 2) in km²; slopes (steps, 2) in mGal/km."""
    slopes = np.vstack([np.zeros(2), slopes]) * MGAL / KM
    return pcrb.pcrb(slopes, noise * MGAL, np.eye(2) * KM**2, np.eye(2) * Q * KM**2) / KM**2


def _root(P):
    return np.sqrt(np.trace(P, axis1=-2, axis2=-1))


# 5.1 One reading ------------------------------------------------------------------------------


def _one_reading(R=4.0, slope=3.0):
    """Return the root of the trace after one reading of variance R, km."""
    return _root(_bound([[0.0, slope]], np.sqrt(R)))[-1]


def _one_reading_twice():
    """Return what would be left if the reading told of both axes, km."""
    return np.sqrt(2.0) * np.sqrt(_one_reading() ** 2 - 1.0)


# 5.2 Drift of the INS -------------------------------------------------------------------------


def _drift(length=64_400.0, speed=5.0, rate=0.01):
    """Return the standard deviation per axis that a random walk adds on the way, m."""
    return np.sqrt(rate**2 * length / speed)


# 5.3 The step in information ------------------------------------------------------------------


def _step(J, H, R, Q):
    """Return the information after one step of (17)."""
    J, H, Q = (np.asarray(x, dtype=float) for x in (J, H, Q))
    return np.linalg.inv(np.linalg.inv(J) + Q) + np.outer(H, H) / R


_STEPS = (
    (np.eye(2), np.array([1.0, 0.0]), 4.0, np.zeros((2, 2))),
    (np.diag([1.0, 4.0]), np.array([1.5, -2.0]), 4.0, np.eye(2) * 0.3),
    (np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([0.3, 2.5]), 9.0, np.diag([0.1, 0.4])),
)


# 5.4 A second gravimeter ----------------------------------------------------------------------


def _turning_field(count=99):
    """Return slopes (count, 2) of 0.5 mGal/km that turn by 0.05 rad from reading to reading."""
    angle = 0.05 * np.arange(1, count + 1)
    return 0.5 * np.column_stack([np.cos(angle), np.sin(angle)])


def _second_gravimeter(measure=_root):
    """Return the factor by which two gravimeters make the sum along the path smaller."""
    one, two = (measure(_bound(_turning_field(), 2.0 / np.sqrt(count))).sum() for count in (1, 2))
    return one / two


def _trace(P):
    return np.trace(P, axis1=-2, axis2=-1)


# 5.5 A plane and a field that turns -----------------------------------------------------------


def _plane_and_turn(measure=_root, noise=2.0, readings=40):
    """Return what is left after 40 readings of one slope, and of two at right angles, km."""
    plane = np.tile([3.0, 0.0], (readings, 1))
    turn = plane.copy()
    turn[readings // 2 :] = [0.0, 3.0]
    return np.array([measure(_bound(slopes, noise)[-1]) for slopes in (plane, turn)])


# 5.6 A heuristic that promises too much -------------------------------------------------------


def _alternating(nodes=9, q=0.2):
    """Return the cost to go, km², where readings without noise see east and north in turn."""
    axes = np.resize([[1.0, 0.0], [0.0, 1.0]], (nodes + 2, 2))  # the first two settle it
    track = _bound(axes * 1e6, 1.0, q)
    return _trace(track)[3:].sum()


# 5.7 One label per cell -----------------------------------------------------------------------

_LABELS = {"A": (3.0, np.diag([0.1, 1.0])), "B": (3.2, np.diag([0.5, 0.5]))}


def _to_goal(P, slopes=(4.0, 0.0), noise=2.0, nodes=5):
    """Return the cost of the nodes still to come, all with the slope east, km²."""
    J, cost = np.linalg.inv(P), 0.0
    for _ in range(nodes):
        J = _step(J, slopes, noise**2, np.zeros((2, 2)))
        cost += np.trace(np.linalg.inv(J))
    return cost


def _both_labels(*, counted=True, cell=False, **other):
    """Return the costs of the two paths, km²; `cell` counts the cell where they meet again."""
    return [counted * G + cell * np.trace(P) + _to_goal(P, **other) for G, P in _LABELS.values()]


def _one_label(**other):
    """Return the cost of the path of A* over that of the cheaper one."""
    kept, cheaper = _both_labels(**other)
    return kept / cheaper


# 5.8 Which label may go -----------------------------------------------------------------------


def _dominates(G1, P1, G2, P2, epsilon):
    """Return 1.0 if the first label makes the second one superfluous, else 0.0."""
    apart = (1 + epsilon) * np.asarray(P2, dtype=float) - np.asarray(P1, dtype=float)
    return float(G1 <= G2 and np.linalg.eigvalsh(apart)[0] >= 0)


def _by(measure):
    def compared(G1, P1, G2, P2, epsilon):
        apart = (1 + epsilon) * np.asarray(P2, dtype=float) - np.asarray(P1, dtype=float)
        return float(G1 <= G2 and measure(apart) >= 0)

    return compared


_LABEL_CASES = (
    (1.0, np.diag([0.5, 0.5]), 2.0, np.diag([0.6, 0.7]), 0.0),
    (2.0, np.diag([0.5, 0.5]), 1.0, np.diag([0.6, 0.7]), 0.0),  # dearer
    (1.0, np.diag([0.1, 1.0]), 1.0, np.diag([0.9, 0.9]), 0.0),  # the trace alone would say yes
    (1.0, np.array([[0.5, 0.4], [0.4, 0.5]]), 1.0, np.diag([0.6, 0.6]), 0.0),  # so the diagonal
    # Entry by entry says no to the first of these two, and yes to the second.
    (1.0, np.array([[0.3, 0.1], [0.1, 0.3]]), 2.0, np.diag([0.6, 0.6]), 0.0),
    (1.0, np.array([[0.5, -0.4], [-0.4, 0.5]]), 2.0, np.diag([0.6, 0.6]), 0.0),
    (1.0, np.diag([0.48, 0.48]), 2.0, np.diag([0.5, 0.5]), 0.3),
    (1.0, np.diag([0.6, 0.6]), 2.0, np.diag([0.5, 0.5]), 0.3),  # only with the tolerance
    (1.0, np.diag([0.7, 0.7]), 1.0, np.diag([0.5, 0.5]), 0.3),
    (1.1, np.diag([0.4, 0.4]), 1.0, np.diag([0.5, 0.5]), 0.3),  # dearer, if by little
    (1.0, np.diag([0.4, 0.4]), 1.0, np.diag([0.5, 0.5]), 0.0),  # at one cost
)


# 5.9 At the truth, or over the prior ----------------------------------------------------------


def _two_bounds(squares=(1.0, 6.0), R=4.0):
    """Return the roots of the bound at the truth 0 and of the one over the prior, km.

    The squares are of the slope 1 + x²: at 0, and in the mean, 1 + 2 E[x²] + E[x⁴].
    """
    return 1 / np.sqrt(1 + np.array(squares) / R)


EXERCISES = {
    "5.1": Exercise(
        right=_one_reading,
        mistakes={
            "Two milligal are the standard deviation; R is a variance.": lambda: _one_reading(
                R=2.0
            ),
            "One reading says nothing across its slope: what of the other axis?": lambda: np.sqrt(
                4 / 13
            ),
            "That is the trace; the question asks for its root.": lambda: _one_reading() ** 2,
            "Informations add, not covariances: work with the inverse of P.": lambda: np.sqrt(
                2.0 + 4.0 / 9.0
            ),
            "A reading tells of one axis only: the other one learns nothing.": (_one_reading_twice),
            "That is the north variance alone; the trace has two terms.": lambda: (
                _one_reading() ** 2 - 1.0
            ),
            "The slope enters squared, as R is the square of the noise.": lambda: [
                _one_reading(slope=np.sqrt(3.0)),
                _one_reading(R=2.0, slope=np.sqrt(3.0)),
            ],
        },
        rtol=3e-3,
    ),
    "5.2": Exercise(
        right=_drift,
        mistakes={
            "That grows with the time; in a random walk the variance does.": lambda: (
                0.01 * 64_400 / 5
            ),
            "That is the variance; its root is asked for.": lambda: _drift() ** 2,
            "The question asks for one axis, not for both.": lambda: np.sqrt(2) * _drift(),
            "Q is per second, not per metre: how long is the trip?": lambda: _drift(speed=1.0),
        },
    ),
    "5.3": Exercise(
        right=_step,
        cases=_STEPS,
        mistakes={
            "Process noise adds to the covariance, not to the information.": lambda J, H, R, Q: (
                J + Q + np.outer(H, H) / R
            ),
            "The process noise is missing.": lambda J, H, R, Q: J + np.outer(H, H) / R,
            "That is the covariance; the information is its inverse.": lambda J, H, R, Q: (
                np.linalg.inv(_step(J, H, R, Q))
            ),
            "R is a variance already: do not square it.": lambda J, H, R, Q: _step(J, H, R**2, Q),
            "H is a row: H transposed times H is a matrix, not a number.": lambda J, H, R, Q: (
                _step(J, np.zeros(2), R, Q) + H @ H / R
            ),
            "Q has no inverse if nothing drifts; add it to the inverse of J.": lambda J, H, R, Q: (
                np.linalg.inv(np.linalg.inv(J) + np.linalg.pinv(Q)) + np.outer(H, H) / R
            ),
            "The reading comes after the drift: add Q first.": lambda J, H, R, Q: np.linalg.inv(
                np.linalg.inv(J + np.outer(H, H) / R) + Q
            ),
        },
        rtol=1e-6,
    ),
    "5.4": Exercise(
        right=_second_gravimeter,
        mistakes={
            "That would be so without a prior, which counts as well.": lambda: np.sqrt(2.0),
            "R is halved, and R is a variance: the noise falls by a root.": lambda: 2.0,
            "Sum the roots of the traces, not the traces.": lambda: _second_gravimeter(_trace),
            "One number over the other: the larger sum comes first.": lambda: (
                1 / _second_gravimeter()
            ),
        },
        rtol=5e-3,
    ),
    "5.5": Exercise(
        right=_plane_and_turn,
        mistakes={
            "That forgets the axis which the plane does not show.": lambda: [
                np.array([np.sqrt(1 / 91), _plane_and_turn()[1]]),
                np.array([0.0, _plane_and_turn()[1]]),
            ],
            "Those are the traces; their roots are asked for.": lambda: _plane_and_turn(_trace),
            "First the plane, then the field that turns.": lambda: _plane_and_turn()[::-1],
            "Without the prior? It is one reading more, of both axes.": lambda: [
                np.array([_plane_and_turn()[0], np.sqrt(2 / 45)]),
                np.array([np.sqrt(1 + 1 / 90), np.sqrt(2 / 45)]),
            ],
            "On a plane the course does not matter: the slope is the same.": lambda: (
                _plane_and_turn()[[1, 1]]
            ),
            "Two milligal are the standard deviation; R is a variance.": lambda: _plane_and_turn(
                noise=np.sqrt(2.0)
            ),
            "Forty readings count, half of them with each slope.": lambda: _plane_and_turn(
                readings=2
            ),
        },
        rtol=1e-3,
    ),
    "5.6": Exercise(
        right=_alternating,
        mistakes={
            "That is what the heuristic promises; what is really left?": lambda: 2 * _alternating(),
            "A reading sees one axis: the other one keeps its drift.": lambda: 0.0,
            "That is before each reading; the cost counts what is left after it.": lambda: (
                3 * _alternating()
            ),
            "Nine nodes are to come, each with its own trace.": lambda: [
                _alternating(nodes=1),
                _alternating(nodes=8),
                _alternating(nodes=10),
            ],
        },
    ),
    "5.7": Exercise(
        right=_one_label,
        mistakes={
            "One path over the other: that of A* comes first.": lambda: 1 / _one_label(),
            "The way to the cell has cost something, too: add G.": lambda: _one_label(
                counted=False
            ),
            "Those are the costs up to the cell; the way goes on.": lambda: [3.0 / 3.2, 3.2 / 3.0],
            "Sum the trace at each of the five nodes, not only at the last.": lambda: (
                (3.0 + 1 / 30 + 1.0) / (3.2 + 1 / 22 + 0.5)
            ),
            "The readings see a slope to the east: the north axis learns nothing.": lambda: (
                _one_label(slopes=(0.0, 4.0))
            ),
            "G holds the cell where the ways meet already; five nodes are to come.": lambda: [
                _one_label(cell=True),
                _one_label(cell=True, nodes=4),
            ],
            "The question asks for one cost over the other, not for a cost.": lambda: [
                *_both_labels(),
                abs(np.subtract(*_both_labels())),
            ],
            "Two milligal are the standard deviation; R is a variance.": lambda: _one_label(
                noise=np.sqrt(2.0)
            ),
        },
        rtol=5e-3,
    ),
    "5.8": Exercise(
        right=_dominates,
        cases=_LABEL_CASES,
        mistakes={
            "The diagonal is not enough: look at all directions.": _by(
                lambda apart: np.diag(apart).min()
            ),
            "A smaller trace is not enough: one direction may be known worse.": _by(np.trace),
            "Entries one by one say nothing of other directions: an eigenvalue does.": _by(np.min),
            "The tolerance is one of the covariances; the costs are compared as they are.": (
                lambda G1, P1, G2, P2, epsilon: _dominates(G1, P1, G2 * (1 + epsilon), P2, epsilon)
            ),
            "At one and the same cost the better informed label is enough.": (
                lambda G1, P1, G2, P2, epsilon: float(G1 < G2) * _dominates(G1, P1, G2, P2, epsilon)
            ),
            "The cost has to be compared as well.": lambda G1, P1, G2, P2, epsilon: _dominates(
                0.0, P1, 0.0, P2, epsilon
            ),
            "The tolerance is missing.": lambda G1, P1, G2, P2, epsilon: _dominates(
                G1, P1, G2, P2, 0.0
            ),
            "The tolerance makes the second covariance larger.": lambda G1, P1, G2, P2, epsilon: (
                _dominates(G1, np.asarray(P1) * (1 + epsilon), G2, P2, 0.0)
            ),
        },
    ),
    "5.9": Exercise(
        right=_two_bounds,
        mistakes={
            "The mean of h'² is not the square of the mean of h'.": lambda: _two_bounds((1.0, 4.0)),
            "The second one is a mean over all places of the prior.": lambda: _two_bounds(
                (1.0, 1.0)
            ),
            "Those are variances; their roots are asked for.": lambda: _two_bounds() ** 2,
            "The prior counts, too.": lambda: 2.0 / np.sqrt([1.0, 6.0]),
            "Two milligal are the standard deviation; R is a variance.": lambda: _two_bounds(R=2.0),
            "First the bound at the truth, then the one over the prior.": lambda: _two_bounds()[
                ::-1
            ],
        },
        rtol=5e-3,
    ),
}
