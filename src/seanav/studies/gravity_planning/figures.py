"""The drawings of paper 5; each function returns a matplotlib figure and computes nothing new."""

from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from seanav.models.gravity.map import GravityMap
from seanav.models.units import KM, MGAL
from seanav.studies.gravity_planning.beyond import Case, Comparison
from seanav.studies.gravity_planning.scores import Score

MARKERS = "osv^<>DPXd*"


def style(name: str, index: int) -> dict[str, Any]:
    """Return the line style of a path: planned and direct stand out, bows differ in grey too."""
    if name == "Planned":
        return {"color": "black", "linewidth": 2.4, "zorder": 5}
    if name == "Direct":
        return {"color": "0.45", "linewidth": 2.0, "linestyle": "--", "zorder": 4}
    return {
        "color": plt.cm.viridis(index / 12),
        "linewidth": 1.1,
        "marker": MARKERS[index % len(MARKERS)],
        "markevery": (7 + 2 * index, 24),
        "markersize": 5,
    }


def hidden_markov() -> Figure:
    """Draw the hidden Markov model of gravity-aided navigation."""
    fig, ax = plt.subplots(figsize=(7.0, 2.9))
    steps = ("t-1", "t", "t+1")
    arrow = {"arrowstyle": "-|>", "color": "black", "shrinkA": 19, "shrinkB": 19}
    for column, step in enumerate(steps):
        for row, letter in ((1.0, "x"), (0.0, "y")):
            face = "white" if letter == "x" else "0.85"
            ax.add_patch(Circle((1.6 * column, row), 0.27, facecolor=face, edgecolor="black"))
            ax.text(1.6 * column, row, f"${letter}_{{{step}}}$", ha="center", va="center")
        ax.annotate("", (1.6 * column, 0.0), (1.6 * column, 1.0), arrowprops=arrow)
        ax.text(1.6 * column + 0.08, 0.5, r"$h(x)+w$", va="center")
    for begin in np.arange(-1, 3) * 1.6:
        ax.annotate("", (begin + 1.6, 1.0), (begin, 1.0), arrowprops=arrow)
        ax.text(begin + 0.8, 1.1, r"$+u+v$", ha="center")
    ax.text(-1.55, 1.0, "hidden position", va="center", ha="right")
    ax.text(-1.55, 0.0, "gravity reading", va="center", ha="right")
    ax.set(xlim=(-3.4, 4.9), ylim=(-0.4, 1.45), aspect="equal")
    ax.axis("off")
    return fig


def _field(ax, chart, field, label, levels):
    north, east = (np.arange(count) * chart.spacing / KM for count in field.shape)
    shades = ax.contourf(east, north, field, levels, cmap="Greys", alpha=0.75)
    ax.contour(east, north, field, levels, colors="0.35", linewidths=0.4)
    ax.figure.colorbar(shades, ax=ax, label=label)
    ax.set(xlabel="east (km)", ylabel="north (km)", aspect="equal")


def _mark(ax, points_km):
    for name, (east, north) in points_km.items():
        ax.plot(east, north, "o", color="white", markeredgecolor="black", zorder=7)
        ax.annotate(
            name,
            (east, north),
            (5, 5),
            textcoords="offset points",
            zorder=7,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 1},
        )


def anomaly_map(chart: GravityMap, points_km: dict[str, tuple[int, ...]]) -> Figure:
    """Draw the map with its starts and goal."""
    fig, ax = plt.subplots(figsize=(6.6, 5.4))
    _field(ax, chart, chart.anomaly / MGAL, "gravity anomaly (mGal)", 16)
    _mark(ax, points_km)
    return fig


def paths(
    chart: GravityMap,
    information: np.ndarray,
    curves: dict[str, np.ndarray],
    points_km: dict[str, tuple[int, ...]],
) -> Figure:
    """Draw the information map with every path; `information` in 1/km."""
    fig, ax = plt.subplots(figsize=(6.6, 5.6))
    _field(ax, chart, information, r"information $M$ (1/km)", 12)
    for index, (name, points) in enumerate(curves.items()):
        look = style(name, index)
        look.pop("marker", None)
        ax.plot(*(points.T / KM), label=name, **look)
        if name not in ("Planned", "Direct"):
            box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.6}
            middle = points[len(points) // 2] / KM
            ax.annotate(name, middle, ha="center", va="center", fontsize="small", bbox=box)
    _mark(ax, points_km)
    handles, names = ax.get_legend_handles_labels()
    ax.legend(handles[:2], names[:2], loc="upper right", fontsize="small", frameon=True)
    return fig


def _decades(ax):
    ax.set_yscale("log")
    low, high = ax.get_ylim()
    ticks = [0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0]
    ax.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.set_yticks([], minor=True)
    ax.set_ylim(low, high)  # setting ticks has widened it


def rmse_curves(scores: dict[str, list[Score]], level: int) -> Figure:
    """Draw the RMSE along every path, with the 95 % band of the planned one."""
    fig, ax = plt.subplots(figsize=(7.4, 4.6))
    for index, (name, row) in enumerate(scores.items()):
        one = row[level]
        along = np.linspace(0.0, one.length / KM, len(one.rmse))
        ax.plot(along, one.rmse / KM, label=name, **style(name, index))
        if name in ("Planned", "Direct"):
            low, high = one.band()
            ax.fill_between(along, low / KM, high / KM, color="0.5", alpha=0.35, linewidth=0)
    planned = scores["Planned"][level]
    along = np.linspace(0.0, planned.length / KM, len(planned.rmse))
    ax.plot(along, planned.bound / KM, ":", color="black", label="PCRB, planned")
    ax.set(xlabel="distance along the path (km)", ylabel="RMSE (km)")
    _decades(ax)
    ax.legend(ncols=2, frameon=False, fontsize="small")
    return fig


def sums(scores: dict[str, list[Score]], level: int) -> Figure:
    """Draw the sums of RMSE with their 95 % intervals, and the PCRB's sum beside each."""
    fig, ax = plt.subplots(figsize=(7.4, 3.8))
    for index, (name, row) in enumerate(scores.items()):
        total = row[level].total
        shade = {"Planned": "black", "Direct": "0.45"}.get(name, "0.75")
        ax.bar(index, total.value / KM, color=shade, edgecolor="black", width=0.65)
        error = [[(total.value - total.low) / KM], [(total.high - total.value) / KM]]
        ax.errorbar(index, total.value / KM, error, color="0.2", capsize=4)
        ax.plot(index, row[level].bound.sum() / KM, "D", color="white", markeredgecolor="black")
        ax.annotate(
            f"{total.value / KM:.1f}",
            (index, max(total.high, row[level].bound.sum()) / KM),
            (0, 6),
            textcoords="offset points",
            ha="center",
        )
    ax.plot([], [], "D", color="white", markeredgecolor="black", label="sum of the root PCRB")
    ax.set_xticks(range(len(scores)), list(scores))
    ax.set(ylabel="sum of RMSE (km)")
    ax.margins(y=0.15)
    ax.legend(frameon=False)
    return fig


def shares(rows: list) -> Figure:
    """Draw the share of pairs won per map and noise; rows of `beyond.share_table`."""
    fig, ax = plt.subplots(figsize=(6.6, 3.8))
    for index, name in enumerate(dict.fromkeys(row[0] for row in rows)):
        mgal, share, low, high = np.array([row[1:5] for row in rows if row[0] == name]).T
        ax.errorbar(
            mgal + 0.06 * (index - 1),
            share,
            [share - low, high - share],
            color=str(0.3 * index),
            marker=MARKERS[index],
            capsize=4,
            label=name,
        )
    ax.set(xlabel="noise (mGal)", ylabel="share of pairs won", ylim=(0, 1.05))
    ax.legend(frameon=False, loc="lower left")
    return fig


def comparisons(grouped: dict[str, list[Comparison]]) -> Figure:
    """Draw the cost of one label, and achieved RMSE against the bound, pair by pair."""
    fig, (left, right) = plt.subplots(1, 2, figsize=(9.4, 4.2))
    for index, (name, results) in enumerate(grouped.items()):
        look = {"color": str(0.3 * index), "marker": MARKERS[index], "linestyle": "none"}
        excess = np.sort([one.cost / one.label_cost - 1 for one in results])
        left.plot(100 * excess, np.linspace(0, 1, len(excess)), label=name, **look)
        for one in results:
            for path, face in (("Planned", str(0.3 * index)), ("Direct", "white")):
                score = one.scores[path]
                right.plot(
                    score.bound.sum() / KM,
                    score.total.value / KM,
                    markerfacecolor=face,
                    markeredgecolor=str(0.3 * index),
                    **{**look, "color": None},
                )
    ends = np.array(right.get_xlim())
    right.plot(ends, ends, color="0.5", linewidth=0.8, label="bound = achieved")
    right.plot([], [], "o", color="black", label="planned (filled)")
    right.plot([], [], "o", color="black", markerfacecolor="white", label="direct (open)")
    left.set(xlabel="cost of A* above multi-label (%)", ylabel="share of pairs below")
    right.set(xlabel="sum of root PCRB (km)", ylabel="sum of RMSE, SITAN (km)")
    left.legend(frameon=False)
    right.legend(frameon=False, fontsize="small")
    return fig


def methods(cases: dict[str, Case]) -> Figure:
    """Draw RMSE of the filters and the two bounds, one panel per case."""
    fig, axes = plt.subplots(1, len(cases), figsize=(9.4, 4.0), sharey=True)
    looks = {"sitan": "-", "ekf": "--", "point mass": "-."}
    for ax, (name, case) in zip(np.atleast_1d(axes), cases.items(), strict=True):
        along = np.linspace(0.0, case.length / KM, len(case.at_truth))
        for index, (method, one) in enumerate(case.scores.items()):
            ax.plot(along, one.rmse / KM, looks[method], color=str(0.25 * index), label=method)
            low, high = one.band()
            ax.fill_between(along, low / KM, high / KM, color="0.5", alpha=0.2, linewidth=0)
        ax.plot(along, case.at_truth / KM, ":", color="black", label="PCRB at the truth")
        ax.plot(along, case.expected / KM, ":", color="0.6", linewidth=2.5, label="PCRB, prior")
        ax.set(title=name, xlabel="distance along the path (km)")
        _decades(ax)
    np.atleast_1d(axes)[0].set_ylabel("RMSE (km)")
    np.atleast_1d(axes)[-1].legend(frameon=False, fontsize="small")
    return fig


def noise_growth(rows: list, held_mgal: float) -> Figure:
    """Draw how the sum of RMSE grows with the noise; rows of `printed.noise_growth`."""
    tests = list(dict.fromkeys(row[0] for row in rows))
    fig, axes = plt.subplots(1, len(tests), figsize=(8.4, 3.6), sharey=True, squeeze=False)
    for ax, test in zip(axes[0], tests, strict=True):
        mgal, *lines = np.array([row[1:] for row in rows if row[0] == test], dtype=float).T
        names = ("printed", "noise known", f"{held_mgal:g} mGal held")
        for line, label, look in zip(lines, names, ("k-o", "k--s", "k:^"), strict=True):
            ax.plot(mgal, line, look, label=label)
        ax.set(title=f"test {test}", xlabel="noise (mGal)")
    axes[0, 0].set_ylabel(f"sum of RMSE over that at {rows[0][1]:g} mGal")
    axes[0, 0].legend(frameon=False)
    return fig
