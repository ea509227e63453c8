"""The short mission of paper 4's sliders: it is drawn everywhere, and its numbers are right."""

import math

import attrs
import numpy as np
import pytest
from matplotlib import pyplot as plt

from seanav.studies.imm_sea_current import explore, linear, scores


@pytest.fixture(autouse=True)
def close():
    yield
    plt.close("all")


def test_the_defaults_are_drawn():
    fig = explore.picture()
    names = [text.get_text() for text in fig.axes[0].get_legend().get_texts()]
    assert [name.split(":")[0] for name in names] == [
        "pure navigation",
        "optimal EKF",
        "EKF 0.1",
        "AFEKF 0.1",
        "IMM-AFEKF 0.1,0.5",
    ]


def test_the_optimal_filter_agrees_with_linear_covariance():
    # Sixteen runs know a root mean square to 18 %; three times that is asked for.
    for sigma in (0.1, 1.0):
        flight = explore.fly(sigma, 0.1, 0.9)["optimal EKF"]
        exact = linear.scores(explore.scenario(), sigma, sigma)[0]
        assert scores.position_rms(flight) == pytest.approx(exact, rel=0.5)
        assert scores.nis(flight).value == pytest.approx(1.0, abs=0.05)


def test_equal_sub_filters_are_one_filter():
    flights = explore.fly(0.6, explore.OTHER, 0.9)
    both = [scores.position_rms(flights[name]) for name in ("AFEKF 0.5", "IMM-AFEKF 0.5,0.5")]
    assert both[0] == pytest.approx(both[1], rel=1e-6)


def test_a_model_that_is_kept_for_ever_is_found_for_ever():
    # With p = 1 only the likelihoods move the probabilities: in the end they are certain.
    mu = explore.fly(1.0, 0.1, 1.0)["IMM-AFEKF 0.1,0.5"].series.mode_probability[-1]
    assert (np.maximum(mu[0], mu[1]) > 0.99).all()
    np.testing.assert_allclose(mu.sum(axis=0), 1.0)


def test_ten_samples_a_second_are_as_good_as_a_hundred():
    # The same biases and noises at another rate: pure navigation drifts as far, in the mean.
    one = attrs.evolve(explore.scenario(), initial_current="zero")
    exact = linear.scores(one, None, 1.0)[0]
    drift = scores.position_rms(explore.fly(1.0, 0.1, 0.9)["pure navigation"])
    assert math.log(drift / exact) == pytest.approx(0.0, abs=0.5)
