"""Paper 3: the picture behind the sliders, and two of its numbers by hand."""

import numpy as np
import pytest
from matplotlib import pyplot as plt
from scipy import stats
from steady import steady_covariance

from seanav.studies.adaptive_fading import explore


@pytest.fixture(autouse=True)
def _close():
    yield
    plt.close("all")


def test_it_draws_at_the_defaults():
    fig = explore.picture()
    assert len(fig.axes) == 3
    assert len(fig.axes[0].lines) == 4  # three filters and the fault
    fig.canvas.draw()


def test_the_same_values_give_the_same_numbers():
    one, two = (explore.explored(0.05, 5, 0.5) for _ in range(2))
    np.testing.assert_array_equal(one.errors["MFF"], two.errors["MFF"])


def test_without_a_fault_alarms_are_as_frequent_as_the_level_says():
    case, limit, _, before = explore.explored(0.1, 20, 0.0)
    samples = case.healthy | case.faulty
    assert limit == pytest.approx(stats.chi2.isf(0.1, 3))
    rate = (before["OKF"][:, samples] > limit).mean()
    count = explore.RUNS * samples.sum()
    assert abs(rate - 0.1) < 4 * np.sqrt(0.1 * 0.9 / count)


def test_mean_error_of_the_optimal_filter_follows_its_closed_recursion():
    # With a steady gain the mean of the errors is driven by what the fin no longer adds.
    lost = 0.7
    case, _, errors, _ = explore.explored(0.05, 20, lost)
    before, P = steady_covariance(case.Phi, case.H, case.Q, case.R)
    A = np.eye(3) - before @ case.H.T @ np.linalg.inv(case.H @ before @ case.H.T + case.R) @ case.H
    angles = 0.2 * np.sin(2 * np.pi * (case.times - 0.1) / 20)
    mean, bias = np.zeros(3), []
    for angle, time in zip(angles, case.times, strict=True):
        missing = lost * angle * case.B if time > explore.BASIS.fault_time + 0.05 else 0.0
        mean = A @ (case.Phi @ mean + missing)
        bias.append(mean)
    late = case.times > 45
    seen = errors["OKF"].mean(axis=0)[late] - np.array(bias)[late]
    spread = np.sqrt(np.diagonal(P) / explore.RUNS)
    assert (np.abs((seen / spread).mean(axis=0)) < 0.7).all()  # correlated over seconds
    assert np.abs((seen / spread).std(axis=0) - 1).max() < 0.3
