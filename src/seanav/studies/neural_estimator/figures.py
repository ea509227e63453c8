"""Paper 2: the drawings; each function returns a figure and computes nothing new."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from seanav import plots
from seanav.estimates import Estimate
from seanav.filters.neural import READINGS, Network
from seanav.studies.neural_estimator.own_track import Track
from seanav.studies.neural_estimator.run import Course
from seanav.studies.neural_estimator.scenario import STEP, Scenario


def _asked(scenario):
    return {"measurement": "z", "estimate": "filter"}[scenario.examination_input]


# The numerical filters are one family: GLS at its one end, KF at the other.
KINDS = {
    "unfiltered": plots.look("open loop"),
    "KF": plots.look("other"),
    "GLS": plots.look("second order"),
    "intermediate": plots.look("Kalman"),
    "frozen network": plots.look("network"),
}
DOTS: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 3, "color": "0.65"}


def style(name: str) -> dict[str, Any]:
    """Return the line style of an estimator, the same in every figure."""
    kinds = {"teacher": "Kalman", "frozen": "network", "re-taught": "adaptive"}
    return plots.look(kinds.get(name, "other")) | {"linewidth": 1.2}


def outside(fig: Figure, columns: int = 3) -> Figure:
    """Move the legend of a figure with one panel below it, where it covers no curve."""
    axes = fig.axes[0]
    if (legend := axes.get_legend()) is not None:
        legend.remove()
        handles, labels = axes.get_legend_handles_labels()
        fig.legend(handles, labels, loc="outside lower center", ncols=columns)
    return fig


def opening(
    scenario: Scenario,
    truth: np.ndarray,
    z: np.ndarray,
    teacher: np.ndarray,
    network: np.ndarray,
) -> Figure:
    """Draw the east component of one run, (steps, 2) each in m/s, with the stages of the cycle."""
    fig, ax = plt.subplots(figsize=(7.2, 3.6))
    time, first = STEP * np.arange(scenario.steps), scenario.examination
    ax.plot(time, z[:, 1], label="measured", **DOTS)
    ax.plot(time, truth[:, 1], label="truth", color="black", linestyle="-")
    ax.plot(time, teacher[:, 1], label="teacher: numerical filter", **style("teacher"))
    ax.plot(time[first:], network[first:, 1], label="its pupil: network", **style("frozen"))
    _stages(ax, scenario)
    ax.set(xlabel="time (s)", ylabel="speed to the east (m/s)")
    fig.legend(loc="outside lower center", ncols=4)
    return fig


def _stages(ax, scenario):
    # Stages 1 and 2 are shaded, 3 is a moment, 4 is the rest; their numbers stand at the top.
    ends = [STEP * x for x in (0, scenario.settle, scenario.examination, scenario.steps)]
    for n, (begin, end) in enumerate(pairwise(ends)):
        ax.axvspan(begin, end, color=("0.84", "0.93", "1.0")[n], linewidth=0, zorder=0)
        number = ("1", "2", "4")[n]
        top = {"ha": "center", "va": "bottom", "fontsize": 9}
        ax.text((begin + end) / 2, 1.0, number, transform=ax.get_xaxis_transform(), **top)
    ax.axvline(ends[2], color="0.3", linewidth=1.2, linestyle="-", zorder=1)
    ax.text(ends[2], 1.0, "3", transform=ax.get_xaxis_transform(), **top)


def perceptron(hidden: int, shown: int = 5) -> Figure:
    """Draw the layers of the network (Figure 1)."""
    fig, ax = plt.subplots(figsize=(6.4, 3.6))
    layers = (
        (0, 2, ("$z_E$", "$z_N$")),
        (2, shown, ()),
        (4, 2, (r"$\hat x_E$", r"$\hat x_N$")),
    )
    places = [np.linspace(-1, 1, count) * (count - 1) / 2 for _, count, _ in layers]
    for (x0, *_), y0, (x1, *_), y1 in zip(layers, places, layers[1:], places[1:], strict=False):
        for a in y0:
            for b in y1:
                ax.plot([x0, x1], [a, b], color="0.6", linewidth=0.7, linestyle="-")
    for (x, _, names), y in zip(layers, places, strict=True):
        ax.plot(np.full(len(y), x), y, "o", color="white", markeredgecolor="black", markersize=17)
        for name, height in zip(names, y, strict=False):
            ax.text(x + (0.35 if x else -0.35), height, name, ha="center", va="center")
    ax.text(2, -2.75, f"{hidden} logistic neurons, {shown} drawn", ha="center")
    ax.text(0, -1.4, "scaled input", ha="center")
    ax.text(4, -1.4, "logistic output", ha="center")
    ax.set(xlim=(-1, 5), ylim=(-3, 2.4))
    ax.axis("off")
    return fig


def system(scenario: Scenario) -> Figure:
    """Draw the numerical-neural system (Figure 2)."""
    boxes = {
        "z": (0, 1, "running\nmeasurements"),
        "filter": (2, 2, f"numerical filter\nw1 = {scenario.w1:g}"),
        "lesson": (2, 0, f"teaching sequence\n{scenario.pairs} pairs"),
        "network": (6, 1, f"network\n2-{scenario.hidden}-2"),
        "out": (9, 1, "filtered\nspeed vector"),
    }
    arrows = [
        ("z", "filter", ""),
        ("z", "lesson", ""),
        ("filter", "lesson", ""),
        ("lesson", "network", "teaching"),
        (_asked(scenario), "network", "examination"),
        ("network", "out", ""),
    ]
    return plots.diagram(boxes, arrows, (7.5, 3.2), 0.5)


def teaching(scenario: Scenario) -> Figure:
    """Draw the teaching of the network (Figure 3)."""
    boxes = {
        "pair": (0, 1, "teaching pair"),
        "network": (3, 2, "network"),
        "difference": (6, 1, "teacher − output"),
        "rule": (3, 0, f"delta rule\nrate {scenario.rate:g}"),
        "stop": (9, 1, f"{scenario.reading} error < {scenario.delta:g}\nor {scenario.max_epochs}"
                 " epochs"),
    }  # fmt: skip
    arrows = [
        ("pair", "network", "input"),
        ("pair", "difference", "teacher's answer"),
        ("network", "difference", "output"),
        ("difference", "rule", "back"),
        ("rule", "network", "new weights"),
        ("difference", "stop", ""),
    ]
    return plots.diagram(boxes, arrows, (7.8, 3.2), 0.27)


def examination(scenario: Scenario) -> Figure:
    """Draw the examination (Figure 4)."""
    boxes = {
        "z": (0, 1, "running\nmeasurements"),
        "filter": (3, 2, "numerical filter\ngoes on"),
        "network": (5, 0, "taught network"),
        "compare": (8, 1, "two estimates\nside by side"),
    }
    arrows = [
        ("z", "filter", ""),
        (_asked(scenario), "network", ""),
        ("filter", "compare", ""),
        ("network", "compare", ""),
    ]
    return plots.diagram(boxes, arrows, (7.2, 3.2))


def algorithm(scenario: Scenario) -> Figure:
    """Draw the cycle as a flow chart: boxes do, rhombs decide (Figure 5)."""
    fig, ax = plt.subplots(figsize=(8.8, 6.4))
    first, answers = scenario.examination, {"measurement": "z", "estimate": "x"}
    asked = answers[scenario.examination_input]
    boxes = {
        "measure": (0.0, 8.0, "next step i\nmeasure z(i)"),
        "filter": (0.0, 6.8, f"numerical filter, w1 = {scenario.w1:g}\nestimate x(i)"),
        "settle": (3.3, 5.4, "1  settling\ngive out x(i)"),
        "collect": (3.3, 3.7, "2  collecting\nkeep the pair z(i), x(i)\ngive out x(i)"),
        "examine": (0.0, 2.0, f"4  examination\ngive out the network's\nanswer to {asked}(i)"),
        "again": (3.3, 0.5, f"re-teaching: {scenario.pairs} newest\npairs, cap:\n"
                  f"{scenario.reteach_epochs} epochs"),
        "teach": (8.6, 2.0, f"3  teaching: one epoch\ndelta rule, rate {scenario.rate:g}\n"
                  f"cap: {scenario.max_epochs} epochs"),
        "ready": (8.6, 6.8, "keep the weights"),
    }  # fmt: skip
    rhombs = {
        "early": (0.0, 5.4, f"i < {scenario.settle} ?"),
        "lesson": (0.0, 3.7, f"i < {first} ?"),
        "full": (5.9, 3.7, f"{scenario.pairs} pairs ?"),
        "due": (0.0, 0.5, f"{scenario.interval} steps since\nthe last teaching ?"),
        "stop": (8.6, 4.4, f"{scenario.reading} error\n< {scenario.delta:g}, or\n"
                 "at the cap ?"),
    }  # fmt: skip
    shapes: dict[str, Any] = {}
    centre: dict[str, tuple[float, float]] = {}
    for name, (x, y, text) in boxes.items():
        drawn = ax.text(x, y, text, ha="center", va="center", fontsize=9, bbox=_BOX, zorder=3)
        shapes[name], centre[name] = drawn.get_bbox_patch(), (x, y)
    for name, (x, y, text) in rhombs.items():
        half, high = (1.45, 0.8) if "\n" in text else (1.0, 0.5)
        tips = [(x - half, y), (x, y + high), (x + half, y), (x, y - high)]
        shapes[name], centre[name] = Polygon(tips, fc="white", ec="black", zorder=3), (x, y)
        ax.add_patch(shapes[name])
        ax.text(x, y, text, ha="center", va="center", fontsize=8.5, zorder=4)
    for begin, corners, end in _WAYS:
        way = [centre[begin], *corners, centre[end]]
        ax.plot(*zip(*way[:-1], strict=True), color="black", linewidth=1, linestyle="-", zorder=1)
        ends = {"patchB": shapes[end]} | ({} if corners else {"patchA": shapes[begin]})
        ax.annotate("", way[-1], way[-2], arrowprops=_ARROW | ends, zorder=2)
    for x, y, word in _WORDS:
        ax.text(x, y, word, fontsize=8.5, ha="center", va="center")
    ax.set(xlim=(-2.4, 10.7), ylim=(-0.5, 8.6))
    ax.axis("off")
    return fig


_BOX = {"boxstyle": "round,pad=0.4", "facecolor": "0.92", "edgecolor": "black"}
_ARROW = {"arrowstyle": "-|>", "color": "black", "shrinkA": 0, "shrinkB": 0}
# The ways through the flow chart, by their corners, and the words at the rhombs.
_WAYS: tuple[tuple[str, tuple[tuple[float, float], ...], str], ...] = (
    ("measure", (), "filter"),
    ("filter", (), "early"),
    ("early", (), "settle"),
    ("early", (), "lesson"),
    ("lesson", (), "collect"),
    ("lesson", (), "examine"),
    ("examine", (), "due"),
    ("due", (), "again"),
    ("again", ((8.6, 0.5),), "teach"),
    ("collect", (), "full"),
    ("full", ((7.15, 3.7), (7.15, 2.0)), "teach"),
    ("teach", (), "stop"),
    ("stop", ((10.4, 4.4), (10.4, 2.0)), "teach"),
    ("stop", (), "ready"),
    ("ready", ((8.6, 8.0),), "measure"),
    ("settle", ((5.9, 5.4), (5.9, 8.0)), "measure"),
    ("full", ((5.9, 8.0),), "measure"),
    ("due", ((-2.2, 0.5), (-2.2, 8.0)), "measure"),
)
_WORDS = (
    (1.3, 5.58, "yes"),
    (0.3, 4.68, "no"),
    (1.3, 3.88, "yes"),
    (0.3, 2.98, "no"),
    (1.65, 0.68, "yes"),
    (-1.65, 0.68, "no"),
    (7.3, 3.88, "yes"),
    (6.2, 4.4, "no"),
    (8.95, 5.4, "yes"),
    (10.15, 4.58, "no"),
)


def examples(
    scenario: Scenario, done: dict[str, Course], names: tuple[str, ...], run: int = 0
) -> Figure:
    """Draw one run of every course, both components, with the stages (Figure 6)."""
    fig, axes = plt.subplots(len(done), 2, figsize=(8.4, 2.2 * len(done)), sharex=True)
    first = scenario.examination
    for row, (course, result) in zip(axes, done.items(), strict=True):
        time = STEP * np.arange(len(result.truth))
        for k, ax in enumerate(row):
            ax.plot(time, result.z[run, :, k], label="unfiltered", **DOTS)
            ax.plot(time, result.truth[:, k], color="black", linestyle="-", label="truth")
            for name in names:
                # Until the examination an estimate is the teacher's, whoever gives it.
                begin = 0 if name == "teacher" else first
                estimate = result.estimates[name][run, begin:, k]
                ax.plot(time[begin:], estimate, label=name, **style(name))
            _stages(ax, scenario)
            ax.set_ylabel(f"{('north', 'east')[k]} (m/s)")
            ax.set_title(course, pad=14)
    for ax in axes[-1]:
        ax.set_xlabel("time (s)")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside lower center", ncols=6)
    return fig


def teaching_errors(history: np.ndarray, delta: float) -> Figure:
    """Draw the median of the three error readings against the epoch, with Δ."""
    fig, ax = plt.subplots()
    epoch = np.arange(1, len(history) + 1)
    for name, errors in zip(READINGS, np.moveaxis(history, 1, 0), strict=True):
        ax.plot(epoch, np.nanmedian(errors, axis=1), label=f"{name} error")
    ax.axhline(delta, color="0.5", linewidth=1, linestyle="-", label=f"Δ = {delta:g}")
    ax.set(xlabel="epoch", ylabel="error, scaled units", xscale="log", yscale="log")
    ax.legend()
    return fig


def speed_plane(
    network: Network, x: np.ndarray, t: np.ndarray, truth: np.ndarray, reach: float = 1.5
) -> Figure:
    """Draw where one network sends the points of the speed plane, with its teacher's cloud.

    `x`, `t`: measurements and teacher's answers (pairs, 2); `truth` (2,), all in m/s.
    """
    fig, ax = plt.subplots(figsize=(5.4, 5.0))
    axis = np.linspace(-reach, reach, 9)
    north, east = np.meshgrid(truth[0] + axis, truth[1] + axis)
    grid = np.stack([north.ravel(), east.ravel()], axis=1)
    answer = network(grid[:, :, None])[:, :, 0]
    move = answer - grid
    for (n0, e0), (dn, de) in zip(grid, move, strict=True):
        ax.plot([e0, e0 + de], [n0, n0 + dn], color="0.8", linewidth=0.6, linestyle="-")
    ax.plot(*x.T[::-1], "x", color="#0072b2", label="measurements of the lesson")
    ax.plot(*t.T[::-1], "o", color="#d55e00", markersize=4, label="teacher's answers")
    ax.plot(*answer.T[::-1], ".", color="black", markersize=4, label="outputs over the grid")
    ax.plot(*truth[::-1], "*", color="#009e73", markersize=12, label="truth")
    ax.set(xlabel="east (m/s)", ylabel="north (m/s)", aspect="equal")
    fig.legend(loc="outside lower center", ncols=2)
    return fig


OWN = {"coloured KF": "optimal", "KF": "Kalman", "re-taught": "adaptive", "hybrid": "hybrid"}


def own_track(own: Track, found: dict[str, np.ndarray]) -> Figure:
    """Draw the window in which the reference changes most, with one draw of the weights."""
    window = int(np.ptp(own.truth, axis=1).sum(axis=1).argmax())
    run_ = window * len(found["KF"]) // len(own.z)
    fig, axes = plt.subplots(2, 1, figsize=(7.2, 5.0), sharex=True)
    minutes = STEP * np.arange(1, own.z.shape[1] + 1) / 60
    for k, (ax, component) in enumerate(zip(axes, ("north", "east"), strict=True)):
        ax.plot(minutes, own.z[window, :, k], label="measured", **DOTS)
        ax.plot(minutes, own.truth[window, :, k], label="reference", color="black", linestyle=":")
        for name, kind in OWN.items():
            ax.plot(minutes, found[name][run_, :, k], label=name, **plots.look(kind))
        ax.set(ylabel=f"{component} (m/s)")
    axes[1].set(xlabel="time (min)")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return fig


def own_errors(found: list[Estimate], expected: Sequence[float]) -> Figure:
    """Draw the correlation of measured errors at lags 1, 2, … and what two laws expect."""
    lags = np.arange(1, len(found) + 1)
    fig, ax = plt.subplots(figsize=(6.4, 3.4))
    ends = np.abs(np.array([[e.value - e.low, e.high - e.value] for e in found]).T)
    ax.errorbar(lags, [e.value for e in found], ends, fmt="o", color="#0072b2", label="this track")
    ax.plot(lags, expected, label="white position errors", **plots.look("Kalman", 1))
    ax.axhline(0.0, color="black", linewidth=1, label="white speed errors")
    ax.set(xlabel=f"lag (steps of {STEP:g} s)", ylabel="correlation", ylim=(-1, 1))
    ax.legend()
    return fig
