"""Exercises 4.8 to 4.10: which filter is best in which sea, computed or flown."""

import math
from collections.abc import Callable
from functools import cache

import attrs
import numpy as np

from seanav.studies.imm_sea_current import explore, linear, run, scores
from seanav.studies.imm_sea_current.scenario import Scenario

# ---------------------------------------------------------------- 4.8: better gyros


@cache
def crossing(better: float = 10.0, start: str = "zero", what: str = "gyro_bias_deg_h") -> float:
    """Return the true sigma (m/s) at which EKF 0.1 is as good as pure navigation.

    Of the sensors `what` is so many times better than in Table 1.
    """
    one = Scenario(initial_current=start)
    one = attrs.evolve(one, **{what: getattr(one, what) / better})
    fine = np.linspace(0.05, 2.0, 391)
    curve = [linear.tcep(one, 0.1, s) for s in fine]
    level = linear.tcep(one, None, 1.0)
    found = scores.crossing(fine, curve, np.full(len(fine), level))
    return math.nan if found is None else found


# ---------------------------------------------------------------- 4.9: the best single filter

CHOICES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)  # m/s, of the filter
SEAS = (0.05, 0.3, 1.0)  # m/s


@cache
def rates() -> np.ndarray:
    """Return the rates (28), in percent, of each choice (rows) in each sea (columns)."""
    one = Scenario()
    return np.array([[linear.rate(one, f, s) for s in SEAS] for f in CHOICES])


def best_choice(rule: Callable = np.min) -> np.ndarray:
    """Return the choice that is best by a `rule` over the seas, and its least rate."""
    judged = rule(rates(), axis=1)
    k = int(np.argmax(judged))
    return np.array([CHOICES[k], np.min(rates()[k])])


# ---------------------------------------------------------------- 4.10: the best pair

SECOND = (0.3, 0.5, 0.8, 1.0)  # m/s, of the second sub-filter


@cache
def pair_rates() -> np.ndarray:
    """Return the rates of IMMs of plain EKFs, each pair (rows) in each sea (columns), flown."""
    lap, sensors = explore.scenario(), explore.sensors()

    def tcep(filter_, sigma):
        return scores.tcep(run.fly(lap, sensors, filter_, sigma)).value

    pure = tcep(run.PURE, 1.0)
    best = [tcep(run.optimal(s), s) for s in SEAS]
    found = [[tcep(run.EKF(0.1, second), s) for s in SEAS] for second in SECOND]
    return 100 * (pure - np.array(found)) / (pure - np.array(best))


def best_pair(rule: Callable = np.min) -> float:
    """Return the second belief (m/s) that is best by a `rule` over the seas."""
    return SECOND[int(np.argmax(rule(pair_rates(), axis=1)))]
