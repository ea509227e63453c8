"""Pictures without a report, and sliders: still in a strict run, alive by hand."""

import io

import ipywidgets
import PIL.Image
import pytest
from matplotlib import pyplot as plt

from seanav import lesson
from seanav.lesson import Choice, Slider


def picture(height=1.0, kind="a"):
    fig, axes = plt.subplots()
    axes.plot([0, 1], [0, height], label=kind)
    picture.seen.append((height, kind))
    return fig


CONTROLS = {
    "height": Slider("height, m", 0.0, 4.0, 0.5, 2.0),
    "kind": Choice("kind", ["a", "b"], "b"),
}


@pytest.fixture(autouse=True)
def seen():
    plt.close("all")  # a notebook that failed in this process may have left some
    picture.seen = []
    yield picture.seen
    assert plt.get_fignums() == []  # every figure was closed


def test_a_figure_has_its_caption_as_words(capsys):
    image = lesson.figure(3, picture(), "A line")
    assert capsys.readouterr().out == "Figure 3. A line\n"
    assert image._repr_png_()[1]["alt"] == "A line"
    with PIL.Image.open(io.BytesIO(image.data)) as drawn:
        assert drawn.width == pytest.approx(image.width * 100 / 96, abs=2)


def test_a_strict_run_shows_the_first_values_once(seen, monkeypatch, tmp_path):
    monkeypatch.setenv("SEANAV_RESULTS", str(tmp_path))
    monkeypatch.setattr(ipywidgets, "VBox", None)
    image = lesson.explore(picture, "A line", **CONTROLS)
    assert seen == [(2.0, "b")]
    assert image._repr_png_()[1]["alt"] == "A line"
    assert list(tmp_path.iterdir()) == []  # it is no result


@pytest.fixture
def by_hand(monkeypatch):
    """Return what shows `picture` with controls by hand: the controls by name, and the image."""
    monkeypatch.delenv("SEANAV_RESULTS", raising=False)
    shown = []
    monkeypatch.setattr(lesson, "display", shown.append)

    def explored(**controls):
        assert lesson.explore(picture, "A line", **controls) is None
        (box,) = shown
        *made, image = box.children
        return dict(zip(controls, made, strict=True)), image

    return explored


def test_by_hand_there_is_a_control_for_each_value(by_hand, seen):
    controls, image = by_hand(**CONTROLS)
    height = controls["height"]
    assert (height.min, height.max, height.step, height.value) == (0.0, 4.0, 0.5, 2.0)
    assert height.description == "height, m"
    assert controls["kind"].options == ("a", "b")
    assert seen == [(2.0, "b")]
    assert bytes(image.value).startswith(b"\x89PNG")


def test_a_control_that_moves_changes_the_picture_in_its_place(by_hand, seen):
    controls, image = by_hand(**CONTROLS)
    before = bytes(image.value)
    controls["height"].value = 3.0
    controls["kind"].value = "a"
    assert seen == [(2.0, "b"), (3.0, "b"), (3.0, "a")]
    assert bytes(image.value) != before


def test_whole_numbers_get_a_slider_of_whole_numbers(by_hand):
    controls, _ = by_hand(height=Slider("height", 1, 9, 2, 3))
    assert isinstance(controls["height"], ipywidgets.IntSlider)
