"""What the sliders of paper 1 draw, and that its numbers have the right limits."""

import attrs
import numpy as np
import pytest
from matplotlib import pyplot as plt

from seanav.models import bodies
from seanav.studies.ito_filter import explore, run
from seanav.studies.ito_filter.scenario import COMPONENTS, Case

SETS = tuple(explore.SETS)


@pytest.mark.parametrize("component", COMPONENTS)
def test_it_draws_the_component_that_was_chosen(component):
    fig = explore.picture(component=component)
    assert len(fig.axes) == 3
    assert fig.axes[0].get_ylabel().startswith(component)
    plt.close(fig)


@pytest.mark.parametrize("measured", SETS)
def test_a_measurement_of_endless_noise_is_prediction_only(measured):
    (error, own) = explore.ratios(1e9, 1.0, measured)["gaussian"]
    np.testing.assert_allclose(error, 1, atol=1e-3)
    assert ((0.7 < own) & (own < 1.3)).all()


def test_an_exact_measurement_leaves_its_own_noise():
    # R far below what the vehicle does in half a second: the estimate is the measurement.
    R = 1e-8
    case = Case(1, explore.SETS["linear velocities"], R, "exact")
    truth = run.simulate(explore.SMALL, "torpedo")
    free = run.estimate(explore.SMALL, truth, case, corrected=False)
    off = (free.mean - truth.x)[:, 1:, :3]
    error = explore.ratios(R, 1.0)["gaussian"][0][:3] * np.sqrt((off**2).mean(axis=(0, 1)))
    np.testing.assert_allclose(error, np.sqrt(R), rtol=0.05)


def test_noise_is_of_the_truth_and_of_the_filters():
    # Twice the diffusion: a filter that did not know it would have too small an own sd.
    for noise in (1.0, 2.0):
        own = explore.ratios(1e-4, noise)["gaussian"][1]
        assert ((0.85 < own) & (own < 1.15)).all()
    shy = attrs.evolve(explore.SMALL, torpedo_noise=tuple(2 * explore.SMALL.noise("torpedo")))
    truth = run.simulate(shy, "torpedo")
    blind = attrs.evolve(truth, parameters=bodies.TORPEDO.parameters())
    track = run.estimate(shy, blind, Case(1, (0, 1, 2), 1e-4, "blind"))
    ratio = np.diagonal(track.P, axis1=2, axis2=3).mean(axis=(0, 1))
    ratio = np.sqrt(ratio / ((track.mean - truth.x) ** 2).mean(axis=(0, 1)))
    assert (ratio[3:] < 0.75).all()
