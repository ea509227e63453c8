"""Pictures that more than one paper draws: curves with bands, diagrams, one look per filter."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import ArrayLike

from seanav.estimates import Estimate

# Colour and dash of each kind of estimator, the same in every paper. The colours are those of
# Okabe and Ito, told apart in grey by the dashes.
KINDS = {
    "truth": ("black", ":"),
    "measurement": ("0.6", "none"),
    "open loop": ("0.35", (0, (1, 2))),
    "optimal": ("black", "-"),
    "Kalman": ("#d55e00", "--"),
    "second order": ("#009e73", "-."),
    "Gaussian": ("#0072b2", "-"),
    "adaptive": ("#0072b2", "-."),
    "adaptive, one per state": ("#56b4e9", (0, (3, 1, 1, 1))),
    "interacting models": ("#009e73", "-"),
    "network": ("#cc79a7", "-"),
    "hybrid": ("#e69f00", (0, (5, 1, 1, 1, 1, 1))),
    "other": ("0.35", (0, (5, 2))),
}
MARKERS = "os^vDPX*<>"


def look(kind: str, variant: int | None = None) -> dict:
    """Return the line style of a kind of estimator; `variant` chooses a marker."""
    color, dash = KINDS[kind]
    marker = None if variant is None else MARKERS[variant % len(MARKERS)]
    return {"color": color, "linestyle": dash, "marker": marker, "markersize": 4}


def band(
    axes: Axes,
    x: ArrayLike,
    estimates: Sequence[Estimate | str],
    label: str | None = None,
    **style: Any,
) -> None:
    """Draw estimates over `x` as a line with the band of their 95 % intervals.

    There is a gap where a filter diverged, and where a reason stands for a missing number.
    """
    value, low, high = np.array([_ends(e) for e in estimates]).T
    missing = " (diverged)" if any(map(_lost, estimates)) else " (not run)"
    label = f"{label}{missing}" if label and np.isnan(value).all() else label
    (line,) = axes.plot(x, value, label=label, **style)
    axes.fill_between(x, low, high, color=line.get_color(), alpha=0.15, linewidth=0)


def _ends(estimate):
    if isinstance(estimate, str) or estimate.diverged:
        return (np.nan,) * 3
    return estimate.value, estimate.low, estimate.high


def _lost(estimate):
    return estimate.endswith("diverged") if isinstance(estimate, str) else estimate.diverged


def legend(axes: Axes, **options: Any) -> None:
    """Draw the legend of `axes` if there is anything to tell apart."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(**options)


def curves(
    x: ArrayLike,
    series: Mapping[str, Sequence],
    xlabel: str,
    ylabel: str,
    *,
    styles: Mapping[str, dict] | None = None,
    logx: bool = False,
    logy: bool = False,
    level: float | None = None,
    vertical: float | None = None,
    size: tuple[float, float] = (6.4, 4.0),
) -> Figure:
    """Draw named curves in one panel.

    Parameters
    ----------
    series : mapping
        Name -> numbers, or estimates, which get their band.
    styles : mapping, optional
        Name -> line style such as `look` returns; otherwise colours and markers in turn.
    level, vertical : float, optional
        A thin line across, such as ratio 1, or up, such as the default of a parameter.
    """
    fig, axes = plt.subplots(figsize=size)
    for n, (name, y) in enumerate(series.items()):
        style = (styles or {}).get(name, {"marker": MARKERS[n % len(MARKERS)], "markersize": 4})
        if any(isinstance(one, (Estimate, str)) for one in y):
            band(axes, x, y, name, **style)
        else:
            axes.plot(x, y, label=name, **style)
    if level is not None:
        axes.axhline(level, color="0.5", linewidth=1, linestyle="-")
    if vertical is not None:
        axes.axvline(vertical, color="0.5", linewidth=1, linestyle=":")
    axes.set(xlabel=xlabel, ylabel=ylabel)
    plain_logarithmic(axes, x=logx, y=logy)
    legend(axes, ncols=2 if len(series) > 6 else 1)
    return fig


def plain_logarithmic(axes: Axes, *, x: bool = False, y: bool = False) -> None:
    """Make axes logarithmic with plain numbers at the decades."""
    for wanted, axis in ((x, axes.xaxis), (y, axes.yaxis)):
        if wanted:
            axes.set(**{f"{axis.axis_name}scale": "log"})
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(NullFormatter())


# ---------------------------------------------------------------- diagrams

_ARROW = {"arrowstyle": "-|>", "color": "black", "shrinkA": 2, "shrinkB": 2}
_BOX = {"boxstyle": "round,pad=0.45", "facecolor": "0.93", "edgecolor": "black"}
_LABEL = {"boxstyle": "square,pad=0.15", "facecolor": "white", "edgecolor": "none"}


def diagram(
    boxes: Mapping[str, tuple[float, float, str]],
    arrows: Sequence[tuple[str, str, str]],
    size: tuple[float, float],
    at: float = 0.4,
) -> Figure:
    """Draw boxes and the arrows between them.

    Parameters
    ----------
    boxes : mapping
        Name -> (x, y, text).
    arrows : sequence
        (from, to, text), the text at the part `at` of the way.
    size : (width, height), inches
    """
    fig, axes = plt.subplots(figsize=size)
    drawn = {}
    for name, (x, y, text) in boxes.items():
        drawn[name] = axes.text(x, y, text, ha="center", va="center", bbox=_BOX, fontsize=9)
    places = np.array([(x, y) for x, y, _ in boxes.values()])
    (left, bottom), (right, top) = places.min(axis=0), places.max(axis=0)
    axes.set(xlim=(left - 1, right + 1), ylim=(bottom - 0.6, top + 0.6))
    axes.axis("off")
    for begin, end, text in arrows:
        here, there = np.array(boxes[begin][:2]), np.array(boxes[end][:2])
        ends = {"patchA": drawn[begin].get_bbox_patch(), "patchB": drawn[end].get_bbox_patch()}
        axes.annotate("", tuple(there), tuple(here), arrowprops=_ARROW | ends)
        if text:
            x, y = here + at * (there - here)
            axes.text(x, y, text, ha="center", va="center", fontsize=8, bbox=_LABEL)
    return fig
