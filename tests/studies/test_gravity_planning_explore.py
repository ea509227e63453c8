"""Paper 5's picture with sliders, and what else its figures promise."""

import attrs
import numpy as np
import pytest
from matplotlib import pyplot as plt

from seanav.models import gravity, paths
from seanav.studies.gravity_planning import explore, figures, run
from seanav.studies.gravity_planning.scenario import Scenario


@pytest.fixture(scope="module")
def scenario():
    return Scenario(map_source="synthetic", samples=40)


@pytest.fixture(scope="module")
def chart(scenario):
    return scenario.map()


@pytest.fixture(autouse=True)
def close():
    yield
    plt.close("all")


def texts(fig):
    return [ax.get_title() for ax in fig.axes]


def test_default_picture_is_test_1(scenario, chart):
    fig = explore.picture(scenario=scenario, chart=chart)
    plan = run.plan(scenario, chart, scenario.start_1, 2.0)
    longer = paths.length(run.plan_path(plan, chart, 40)) - np.hypot(7e3, 64e3)
    assert f"{longer / 1e3:.3g} km longer" in texts(fig)[0]
    assert len(fig.axes[1].lines) == 4  # RMSE and bound of both paths


def test_the_same_sliders_give_the_same_numbers(scenario, chart):
    first, second = (explore.picture(1.0, 30, 58, scenario=scenario, chart=chart) for _ in range(2))
    for a, b in zip(first.axes[1].lines, second.axes[1].lines, strict=True):
        np.testing.assert_array_equal(a.get_ydata(), b.get_ydata())


def test_start_on_the_goal_or_off_the_map_is_said_or_moved(scenario, chart):
    assert (
        "move it" in texts(explore.picture(2.0, *scenario.goal, scenario=scenario, chart=chart))[0]
    )
    off = explore.picture(2.0, 500, -3, scenario=scenario, chart=chart)
    edge = explore.picture(2.0, 100, 0, scenario=scenario, chart=chart)
    assert texts(off) == texts(edge)


def test_on_a_plane_the_direct_path_reaches_the_closed_form():
    # Without process noise the readings only add: P = (P0⁻¹ + k HHᵀ/R)⁻¹ after k of them.
    north, east = np.mgrid[0:101, 0:101] * 1e3
    plane = gravity.GravityMap(2e-8 * east + 1e-8 * north, 1000.0, "plane", "analytic")
    scenario = Scenario(process_noise=0.0)
    _, scores = explore.sail(scenario, plane, (58, 73), 2.0)
    H = np.array([2e-8, 1e-8])
    P = np.linalg.inv(np.eye(2) / 1e6 + 99 * np.outer(H, H) / (2e-5) ** 2)
    assert scores["Direct"].bound[-1] == pytest.approx(np.sqrt(np.trace(P)), rel=1e-9)
    assert scores["Direct"].rmse[-1] == pytest.approx(np.sqrt(np.trace(P)), rel=0.02)
    assert len(scores["Direct"].squared) == explore.RUNS


def test_more_noise_makes_every_path_worse(scenario, chart):
    sums = [
        explore.sail(scenario, chart, (30, 58), mgal)[1]["Direct"].rmse.sum()
        for mgal in (0.5, 2.0, 8.0)
    ]
    assert sums == sorted(sums)


# Figures ------------------------------------------------------------------------------------


def test_contours_are_labelled_with_their_values(scenario, chart):
    fig = figures.anomaly_map(chart, {"goal": scenario.goal})
    labels = {float(t.get_text().replace("−", "-")) for t in fig.axes[0].texts[:-1]}
    field = chart.anomaly_mgal
    assert len(labels) >= 4
    assert field.min() < min(labels)
    assert max(labels) < field.max()


def test_a_map_that_says_nothing_is_drawn(recwarn):
    flat = gravity.GravityMap(np.zeros((20, 20)), 1000.0, "flat", "analytic")
    figures.anomaly_map(flat, {}).canvas.draw()
    assert not recwarn.list


def test_sums_have_no_numbers_over_their_error_bars(scenario, chart):
    small = attrs.evolve(scenario, runs=40)
    curves, _ = run.fan(chart, small.start_1, small.goal, (5.5,), small.samples)
    curves["Planned"] = curves["L3"]
    scores = run.run_all(small, chart, run.draw(small), curves, [2.0])
    assert not figures.sums(scores, 0).axes[0].texts


def test_ellipse_of_a_covariance_has_its_deviations_as_half_widths():
    P = np.array([[4e6, 1e6], [1e6, 1e6]])
    east, north = figures.ellipses({"P": P}).axes[0].lines[0].get_data()
    assert east.max() == pytest.approx(2.0, rel=1e-3)
    assert north.max() == pytest.approx(1.0, rel=1e-3)
