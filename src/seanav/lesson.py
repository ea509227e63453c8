"""What a notebook shows without keeping it as a result: pictures, and sliders to explore."""

import os
from collections.abc import Callable, Sequence
from typing import Any

import attrs
from IPython.display import Image, display
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from seanav._pictures import live, shown

STYLE = "seanav.seanav"


@attrs.frozen
class Slider:
    """A number to be changed: its name with the unit, its ends, its step and its first value."""

    label: str
    low: float
    high: float
    step: float
    value: float


@attrs.frozen
class Choice:
    """One of several values: its name and its first value."""

    label: str
    options: Sequence
    value: Any


def figure(number: int | str, fig: Figure, caption: str) -> Image:
    """Close `fig`, print its caption and return the picture, with the caption for who cannot see.

    Results of a paper go through `seanav.report.Report.figure`, which keeps them too.
    """
    _, small = shown(fig, caption)
    plt.close(fig)
    print(f"Figure {number}. {caption}")
    return small


def explore(
    picture: Callable[..., Figure], caption: str, **controls: Slider | Choice
) -> Image | None:
    """Let a reader change the arguments of `picture` and see the figure anew at once.

    Parameters
    ----------
    picture : callable
        It takes a value for each control, by name, and returns a figure, within a second.
    caption : str
        What the figure shows.
    controls : Slider or Choice

    Returns
    -------
    Image or None
        In a strict run, where nobody moves a slider: the picture of the first values.
    """
    if os.environ.get("SEANAV_RESULTS"):
        with plt.style.context(STYLE, after_reset=True):
            fig = picture(**{name: control.value for name, control in controls.items()})
            return figure("Explore", fig, caption)
    import ipywidgets  # slow to import, and only needed by hand

    widgets = {name: _widget(ipywidgets, control) for name, control in controls.items()}
    # One picture whose bytes change: an output that is emptied first would make the page jump.
    drawn = ipywidgets.Image(format="png", layout={"max_width": "100%", "object_fit": "contain"})

    def draw(_=None):
        with plt.style.context(STYLE, after_reset=True):
            fig = picture(**{name: widget.value for name, widget in widgets.items()})
            drawn.value = live(fig)
            plt.close(fig)

    draw()
    for widget in widgets.values():
        widget.observe(draw, names="value")
    print(caption)
    display(ipywidgets.VBox([*widgets.values(), drawn]))
    return None


def _widget(ipywidgets, control):
    look = {"description": control.label, "style": {"description_width": "initial"}}
    if isinstance(control, Choice):
        options = list(control.options)
        return ipywidgets.Dropdown(options=options, value=control.value, **look)
    whole = all(isinstance(x, int) for x in (control.low, control.high, control.step))
    kind = ipywidgets.IntSlider if whole else ipywidgets.FloatSlider
    return kind(
        value=control.value,
        min=control.low,
        max=control.high,
        step=control.step,
        # A picture for the value where the slider is let go, not for each one on the way.
        continuous_update=False,
        readout_format="d" if whole else ".3g",
        layout={"width": "36em"},
        **look,
    )
