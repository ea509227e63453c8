"""Sliders of paper 2: the picture is drawn everywhere, and its numbers are those of theory."""

import numpy as np
import pytest
from matplotlib import pyplot as plt

from seanav.studies.neural_estimator import explore


@pytest.mark.parametrize("values", [(), (0.9, 0.3)], ids=["default", "a tight turn"])
def test_all_errors_lie_in_the_picture(values):
    fig = explore.picture(*values)
    left, right = fig.axes
    assert len(left.lines) == 5  # four curves and the beginning of the examination
    assert len(right.lines) == 6
    errors = [x for line in right.lines[:5] for x in line.get_ydata()]
    assert right.get_ylim()[0] < min(errors)
    assert right.get_ylim()[1] > max(errors)
    plt.close(fig)


def examined(w1, rate):
    scenario, truth, estimates = explore.voyage(w1, rate)
    late = np.arange(scenario.steps) >= scenario.examination + 40
    return scenario, {name: (x - truth)[:, late] for name, x in estimates.items()}


def weights(scenario, w1):
    """Return what an estimate at rest takes of the measurements, from a single one."""
    P = scenario.R
    for _ in range(500):
        K = (P + scenario.q) / (P + scenario.q + scenario.R)
        P = K * scenario.R
    z, x, h = 1.0, K, [K]
    for _ in range(300):
        blend = w1 * z + (1 - w1) * x
        z, x = 0.0, (1 - K) * blend
        h.append(x)
    return np.array(h)


@pytest.mark.parametrize(
    ("name", "w1"), [("KF", 0.0), ("GLS", 1.0), ("intermediate", 0.6), ("unfiltered", None)]
)
@pytest.mark.parametrize("rate", [0.0, 0.5])
def test_errors_of_the_filters_are_noise_and_lag(name, w1, rate):
    scenario, errors = examined(0.6, rate)
    h = np.ones(1) if w1 is None else weights(scenario, w1)
    # A vector that turns by one angle per step: what the filter makes of it, less itself.
    turned = np.exp(-1j * np.deg2rad(rate) * 3.0 * np.arange(len(h)))
    late = scenario.speed**2 * abs(h @ turned - 1) ** 2 / 2
    expected = np.sqrt(scenario.R * (h**2).sum() + late)
    found = np.sqrt((errors[name] ** 2).mean())
    assert found == pytest.approx(expected, rel=0.05)


def test_the_network_beats_its_teacher_on_a_steady_course_and_loses_in_a_turn():
    for rate, better in ((0.0, True), (0.1, False)):
        _, errors = examined(0.3, rate)
        size = {name: np.sqrt((e**2).mean()) for name, e in errors.items()}
        assert (size["frozen network"] < size["intermediate"]) is np.bool_(better)


def test_the_same_values_give_the_same_numbers():
    first, again = (explore.voyage(0.3, 0.02)[2] for _ in range(2))
    assert all(np.array_equal(first[name], again[name]) for name in first)
