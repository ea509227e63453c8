"""What is drawn is what was handed over."""

import numpy as np
import pytest
from matplotlib import pyplot as plt

from seanav import plots
from seanav.estimates import Estimate


@pytest.fixture(autouse=True)
def close():
    yield
    plt.close("all")


def estimates(values):
    return [Estimate(v, v - 1, v + 2, 0.5, 10) for v in values]


def test_a_band_has_the_values_and_the_ends_of_the_intervals():
    _, axes = plt.subplots()
    plots.band(axes, [0, 1], estimates([3, 5]), "name", color="red")
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), [3, 5])
    (patch,) = axes.collections
    corners = patch.get_paths()[0].vertices
    assert corners[:, 1].min() == 2
    assert corners[:, 1].max() == 7


def test_a_filter_that_diverged_leaves_a_gap():
    _, axes = plt.subplots()
    lost = Estimate(np.inf, np.inf, np.inf, np.inf, 10)
    plots.band(axes, [0, 1, 2], [*estimates([3]), lost, *estimates([5])], "name")
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), [3, np.nan, 5])


def test_curves_draw_numbers_and_estimates_side_by_side():
    series = {"exact": [1.0, 2.0], "sampled": estimates([3, 4])}
    styles = {"exact": plots.look("truth")}
    fig = plots.curves([1, 10], series, "x", "y", styles=styles, logx=True, level=1, vertical=2)
    (axes,) = fig.axes
    assert axes.get_xscale() == "log"
    assert [line.get_label() for line in axes.lines[:2]] == ["exact", "sampled"]
    assert axes.lines[0].get_linestyle() == ":"
    assert len(axes.collections) == 1
    assert len(axes.lines) == 4


def test_kinds_of_estimators_can_be_told_apart():
    looks = [tuple(map(str, plots.KINDS[kind])) for kind in plots.KINDS]
    assert len(set(looks)) == len(looks)
    assert plots.look("Kalman", 1)["marker"] != plots.look("Kalman", 2)["marker"]


def test_arrows_of_a_diagram_begin_and_end_at_their_boxes():
    boxes = {"a": (0, 0, "first"), "b": (3, 1, "second")}
    fig = plots.diagram(boxes, [("a", "b", "goes to")], (5, 2))
    (axes,) = fig.axes
    texts = {text.get_text(): text for text in axes.texts}
    assert {"first", "second", "goes to"} <= set(texts)
    (arrow,) = [text.arrow_patch for text in axes.texts if getattr(text, "arrow_patch", None)]
    assert arrow.patchA is texts["first"].get_bbox_patch()
    assert arrow.patchB is texts["second"].get_bbox_patch()
