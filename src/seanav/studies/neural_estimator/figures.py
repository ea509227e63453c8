"""Paper 2: the drawings; each function returns a figure and computes nothing new."""

from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from seanav import plots
from seanav.filters.neural import READINGS, Network
from seanav.studies.neural_estimator.run import Course
from seanav.studies.neural_estimator.scenario import STEP, Scenario


def _asked(scenario):
    return {"measurement": "z", "estimate": "filter"}[scenario.examination_input]


def style(name: str) -> dict[str, Any]:
    """Return the line style of an estimator, the same in every figure."""
    kinds = {"teacher": "Kalman", "frozen": "network", "re-taught": "adaptive"}
    return plots.look(kinds.get(name, "other")) | {"linewidth": 1.1}


def perceptron(hidden: int, shown: int = 5) -> Figure:
    """Draw the layers of the network (Figure 1)."""
    fig, ax = plt.subplots(figsize=(6.4, 3.6))
    layers = (
        (0, 2, ("$v_N$", "$v_E$")),
        (2, shown, ()),
        (4, 2, (r"$\hat v_N$", r"$\hat v_E$")),
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
    return plots.diagram(boxes, arrows, (7.8, 3.2))


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
    """Draw the four stages with their steps (Figure 5)."""
    first = scenario.examination
    lines = (
        f"1  settling\nsteps 0 to {scenario.settle - 1}",
        f"2  collecting\nsteps {scenario.settle} to {first - 1}",
        f"3  teaching\nat step {first - 1}",
        f"4  examination\nsteps {first} to {scenario.steps - 1}",
        f"re-teaching\nevery {scenario.interval} steps",
    )
    places = [(0.0, 1.0), (2.6, 1.0), (5.2, 1.0), (7.8, 1.0), (6.5, -0.2)]
    boxes = {
        str(n): (*place, text) for n, (place, text) in enumerate(zip(places, lines, strict=True))
    }
    arrows = [(start, end, "") for start, end in ("01", "12", "23", "34", "42")]
    return plots.diagram(boxes, arrows, (8.2, 2.6))


def examples(done: dict[str, Course], names: tuple[str, ...], run: int = 0) -> Figure:
    """Draw one run of every course, both components (Figure 6)."""
    fig, axes = plt.subplots(len(done), 2, figsize=(8.4, 2.1 * len(done)), sharex=True)
    for row, (course, result) in zip(axes, done.items(), strict=True):
        time = STEP * np.arange(len(result.truth))
        for k, ax in enumerate(row):
            ax.plot(time, result.z[run, :, k], ".", color="0.7", markersize=3, label="unfiltered")
            ax.plot(time, result.truth[:, k], color="black", linestyle="-", label="truth")
            for name in names:
                estimate = result.estimates[name][run, :, k]
                ax.plot(time, estimate, label=name, **style(name))
            ax.set_ylabel(f"{('north', 'east')[k]} (m/s)")
            ax.set_title(course)
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
