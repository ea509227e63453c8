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
    monkeypatch.setattr(ipywidgets, "interact", None)
    image = lesson.explore(picture, "A line", **CONTROLS)
    assert seen == [(2.0, "b")]
    assert image._repr_png_()[1]["alt"] == "A line"
    assert list(tmp_path.iterdir()) == []  # it is no result


def test_by_hand_there_is_a_control_for_each_value_and_a_new_picture_when_it_moves(
    seen, monkeypatch
):
    made = {}
    monkeypatch.delenv("SEANAV_RESULTS", raising=False)

    def interact(show, **widgets):
        made.update(widgets)
        show(**{name: widget.value for name, widget in widgets.items()})
        show(height=3.0, kind="a")

    monkeypatch.setattr(ipywidgets, "interact", interact)
    shown = []
    monkeypatch.setattr(lesson, "display", shown.append)
    assert lesson.explore(picture, "A line", **CONTROLS) is None
    assert seen == [(2.0, "b"), (3.0, "a")]
    assert len(shown) == 2
    assert (made["height"].min, made["height"].max, made["height"].step) == (0.0, 4.0, 0.5)
    assert made["height"].description == "height, m"
    assert made["kind"].options == ("a", "b")


def test_whole_numbers_get_a_slider_of_whole_numbers(monkeypatch):
    monkeypatch.delenv("SEANAV_RESULTS", raising=False)
    monkeypatch.setattr(ipywidgets, "interact", lambda show, **widgets: made.update(widgets))
    made = {}
    lesson.explore(picture, "A line", height=Slider("height", 1, 9, 2, 3))
    assert isinstance(made["height"], ipywidgets.IntSlider)
