"""Beyond paper 2: at which turn rate the network loses, and what it has learnt."""

import numpy as np

from seanav.estimates import Estimate, rms
from seanav.filters.neural import Network, Teaching
from seanav.studies.neural_estimator import run
from seanav.studies.neural_estimator.scenario import Scenario


def break_even(
    rates: tuple[float, ...], a: list[np.ndarray], b: list[np.ndarray]
) -> Estimate | None:
    """Return the turn rate where the errors of a and b are equal, with its interval.

    Parameters
    ----------
    rates : sequence of float
        Turn rates in growing order.
    a, b : list of ndarray, shape (runs,)
        Squared errors at each rate, the same noise at every rate.

    Returns
    -------
    Estimate or None
        Linear interpolation of the log ratio at its first change of sign; None if it
        has none.
    """
    logs = [(rms(p) / rms(q)).log() for p, q in zip(a, b, strict=True)]
    for low, high, left, right in zip(logs, logs[1:], rates, rates[1:], strict=False):
        if low.value < 0 <= high.value:
            return (left - low / (high - low) * (right - left)).estimate()
    return None


def turn_sweep(scenario: Scenario, taught: list[Teaching]) -> dict[str, list[np.ndarray]]:
    """Return name -> list over turn rates of squared errors (runs,) in the examination."""
    result = {"teacher": [], "frozen": []}
    for rate in scenario.turn_rates_deg_s:
        truth = run.turning(scenario, rate)
        z = run.measure(scenario, truth)
        teacher = run.numerical(scenario, z)
        exam = np.arange(scenario.steps) >= scenario.examination
        for name, errors in result.items():
            estimate = teacher
            if name != "teacher":
                estimate = run.examine(scenario, z, teacher, taught, name)
            errors.append(run.squared(estimate, truth, exam))
    return result


def slope(network: Network, centre: np.ndarray, step: float = 0.5) -> np.ndarray:
    """Return d output / d input of each run's network at `centre` (2, runs), (2, 2, runs)."""
    result = np.empty((2, 2, centre.shape[1]))
    for k in range(2):
        shift = np.zeros_like(centre)
        shift[k] = step
        answers = network(np.stack([centre + shift, centre - shift]))
        result[:, k] = (answers[0] - answers[1]) / (2 * step)
    return result
