"""The drawings of paper 5; each function returns a matplotlib figure and computes nothing new."""

from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from seanav.models.gravity.map import GravityMap
from seanav.models.paths import length
from seanav.models.units import KM, MGAL
from seanav.studies.gravity_planning.beyond import Case, Comparison
from seanav.studies.gravity_planning.scores import Score

MARKERS = "osv^<>DPXd*"
DASHES = ("-", (0, (6, 2)), (0, (4, 1, 1, 1)), (0, (1, 1)), (0, (8, 2, 2, 2)))


def style(name: str, index: int) -> dict[str, Any]:
    """Return the line style of a path: planned and direct stand out, bows differ in grey too."""
    if name == "Planned":
        return {"color": "black", "linewidth": 2.4, "zorder": 5}
    if name == "Direct":
        return {"color": "0.45", "linewidth": 2.0, "linestyle": "--", "zorder": 4}
    return {
        "color": plt.cm.viridis(0.85 * index / 12),  # its bright end is lost on white
        "linestyle": DASHES[index % len(DASHES)],
        "linewidth": 1.1,
        "marker": MARKERS[index % len(MARKERS)],
        "markevery": (7 + 2 * index, 24),
        "markersize": 5,
    }


def hidden_markov() -> Figure:
    """Draw the hidden Markov model of gravity-aided navigation."""
    fig, ax = plt.subplots(figsize=(8.0, 1.9))
    steps = ("t-1", "t", "t+1")
    arrow = {"arrowstyle": "-|>", "color": "black", "shrinkA": 19, "shrinkB": 19}
    for column, step in enumerate(steps):
        for row, letter in ((1.0, "x"), (0.0, "y")):
            face = "white" if letter == "x" else "0.85"
            ax.add_patch(Circle((1.6 * column, row), 0.27, facecolor=face, edgecolor="black"))
            ax.text(1.6 * column, row, f"${letter}_{{{step}}}$", ha="center", va="center")
        ax.annotate("", (1.6 * column, 0.0), (1.6 * column, 1.0), arrowprops=arrow)
        ax.text(1.6 * column + 0.08, 0.5, r"$h(x)+m+w$", va="center")
    for begin in np.arange(-1, 3) * 1.6:
        ax.annotate("", (begin + 1.6, 1.0), (begin, 1.0), arrowprops=arrow)
        ax.text(begin + 0.8, 1.1, r"$+u+v$", ha="center")
    ax.text(-1.55, 1.0, "hidden position", va="center", ha="right")
    ax.text(-1.55, 0.0, "gravity reading", va="center", ha="right")
    ax.set(xlim=(-3.2, 4.9), ylim=(-0.4, 1.45), aspect="equal")
    ax.axis("off")
    return fig


def field(
    ax: Axes,
    chart: GravityMap,
    values: np.ndarray,
    label: str,
    levels: int,
    *,
    bar: bool = True,
) -> None:
    """Draw values at the nodes of a map as shades and contours, every second one labelled."""
    north, east = (np.arange(count) * chart.spacing / KM for count in values.shape)
    # Only the light half of the greys, so that labels and paths can be read on all of them.
    top = values.max() + (values.max() - values.min())
    look = {"cmap": "Greys", "vmin": values.min(), "vmax": top} if top > values.max() else {}
    shades = ax.contourf(east, north, values, levels, **look)
    lines = ax.contour(east, north, values, levels, colors="0.35", linewidths=0.4)
    ax.clabel(lines, np.asarray(lines.levels)[::2], fmt="%g", fontsize=8, inline_spacing=2)
    if bar:
        ax.figure.colorbar(shades, ax=ax, label=label, shrink=0.8)
    ax.set(xlabel="east (km)", ylabel="north (km)", aspect="equal")
    ax.grid(False)


def mark(ax: Axes, points_km: dict[str, tuple[int, ...]]) -> None:
    """Mark named nodes (east, north) on a map."""
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
    field(ax, chart, chart.anomaly / MGAL, "gravity anomaly (mGal)", 16)
    mark(ax, points_km)
    return fig


def paths(
    chart: GravityMap,
    information: np.ndarray,
    curves: dict[str, np.ndarray],
    points_km: dict[str, tuple[int, ...]],
) -> Figure:
    """Draw the information map with every path; `information` in 1/km."""
    fig, ax = plt.subplots(figsize=(6.6, 5.6))
    field(ax, chart, information, r"information $M$ (1/km)", 8)
    for index, (name, points) in enumerate(curves.items()):
        look = style(name, index)
        look.pop("marker", None)
        ax.plot(*(points.T / KM), label=name, **look)
        if name not in ("Planned", "Direct"):
            box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.6}
            middle = points[len(points) // 3 : -len(points) // 3]
            apart = np.linalg.norm(middle[:, None] - curves["Planned"], axis=2).min(axis=1)
            place = middle[apart.argmax()] / KM  # not upon the plan
            ax.annotate(name, place, ha="center", va="center", fontsize="small", bbox=box)
    mark(ax, points_km)
    handles, names = ax.get_legend_handles_labels()
    ax.legend(handles[:2], names[:2], loc="upper right", frameon=True)
    return fig


def opening(
    chart: GravityMap,
    curves: dict[str, np.ndarray],
    limits: dict[str, np.ndarray],
    points_km: dict[str, tuple[int, ...]],
) -> Figure:
    """Draw two ways over the map, and the root of the bound (samples,) m along each."""
    fig, (left, right) = plt.subplots(1, 2, figsize=(9.4, 4.2), width_ratios=(1.3, 1))
    fig.set_layout_engine("constrained", wspace=0.08)
    field(left, chart, chart.anomaly / MGAL, "gravity anomaly (mGal)", 12)
    for name, points in curves.items():
        left.plot(*(points.T / KM), label=name, **style(name, 0))
        along = np.linspace(0.0, length(points) / KM, len(points))
        right.plot(along, limits[name] / KM, label=name, **style(name, 0))
    mark(left, points_km)
    right.set(xlabel="distance along the path (km)", ylabel="bound on the position error (km)")
    right.set_ylim(bottom=0.0)
    right.legend()
    return fig


def ellipses(covariances: dict[str, np.ndarray]) -> Figure:
    """Draw the one-sigma ellipses of named covariances (2, 2) m²."""
    fig, ax = plt.subplots(figsize=(4.4, 4.2))
    turn = np.linspace(0.0, 2 * np.pi, 181)
    circle = np.array([np.cos(turn), np.sin(turn)])
    for index, (name, P) in enumerate(covariances.items()):
        shape = np.linalg.cholesky(P) @ circle / KM
        ax.plot(*shape, color=str(0.22 * index), linestyle=DASHES[index], label=name)
    ax.set(xlabel="east error (km)", ylabel="north error (km)", aspect="equal")
    ax.margins(y=0.4)
    ax.legend(loc="upper left")
    return fig


def two_plans(
    chart: GravityMap,
    information: np.ndarray,
    plans: dict[str, dict[str, np.ndarray]],
    ends_km: dict[str, dict[str, tuple[int, ...]]],
) -> Figure:
    """Draw, per test, the path of A* and the cheapest one known; `information` in 1/km."""
    fig, axes = plt.subplots(1, len(plans), figsize=(9.4, 4.6), sharey=True)
    looks = {"A*": {"color": "black", "linewidth": 2.2}}
    other = {"color": "#d55e00", "linewidth": 2.0, "linestyle": "--"}
    for ax, (test, curves) in zip(axes, plans.items(), strict=True):
        field(ax, chart, information, "", 8, bar=False)
        for name, points in curves.items():
            ax.plot(*(points.T / KM), label=name, **looks.get(name, other))
        mark(ax, ends_km[test])
        ax.set(title=test)
    axes[-1].legend(loc="upper right", frameon=True)
    return fig


def _decades(ax):
    ax.set_yscale("log")
    low, high = ax.get_ylim()
    ticks = [0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0]
    ax.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.set_yticks([], minor=True)
    ax.set_ylim(low, high)  # setting ticks has widened it


def _ratio(ax, along, one, **look):
    """Draw RMSE over the bound with its 95 % band."""
    ax.plot(along, one.rmse / one.bound, **look)
    low, high = one.band()
    ax.fill_between(along, low / one.bound, high / one.bound, color="0.5", alpha=0.3, linewidth=0)


def rmse_curves(scores: dict[str, list[Score]], level: int) -> Figure:
    """Draw the RMSE along every path, and of two of them over the bound; 95 % bands."""
    fig, (top, low) = plt.subplots(2, 1, figsize=(7.4, 6.0), sharex=True, height_ratios=(2.4, 1))
    for index, (name, row) in enumerate(scores.items()):
        one, look = row[level], style(name, index)
        along = np.linspace(0.0, one.length / KM, len(one.rmse))
        top.plot(along, one.rmse / KM, label=name, **look)
        if name in ("Planned", "Direct"):
            ends = (end / KM for end in one.band())
            top.fill_between(along, *ends, color="0.5", alpha=0.35, linewidth=0)
            _ratio(low, along, one, **look)
    low.axhline(1.0, color="0.5", linewidth=0.8)
    top.set(ylabel="RMSE (km)")
    low.set(xlabel="distance along the path (km)", ylabel="RMSE over\nroot PCRB")
    _decades(top)
    top.legend(ncols=2)
    return fig


def sums(scores: dict[str, list[Score]], level: int) -> Figure:
    """Draw the sums of RMSE with their 95 % intervals, and the PCRB's sum beside each."""
    fig, ax = plt.subplots(figsize=(7.4, 3.8))
    for index, (name, row) in enumerate(scores.items()):
        total = row[level].total
        shade = {"Planned": "0.35", "Direct": "0.6"}.get(name, "0.88")
        ax.bar(index, total.value / KM, color=shade, edgecolor="black", width=0.8)
        error = [[(total.value - total.low) / KM], [(total.high - total.value) / KM]]
        ax.errorbar(index - 0.18, total.value / KM, error, color="black", capsize=3)
        bound = row[level].bound.sum() / KM
        ax.plot(index + 0.18, bound, "D", color="white", markeredgecolor="black")
    ax.plot([], [], "D", color="white", markeredgecolor="black", label="sum of the root PCRB")
    label = "95 % interval of the sum of RMSE"
    ax.errorbar([], [], [], color="black", capsize=3, linestyle="none", label=label)
    ax.set_xticks(range(len(scores)), list(scores))
    ax.set(ylabel="sum of RMSE (km)")
    ax.margins(y=0.22)
    ax.legend(ncols=2, loc="upper center")
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
    ax.legend(loc="lower left")
    return fig


def comparisons(grouped: dict[str, list[Comparison]]) -> Figure:
    """Draw the cost of one label, and achieved RMSE over the bound, pair by pair."""
    fig, (left, right) = plt.subplots(1, 2, figsize=(9.4, 4.2))
    for index, (name, results) in enumerate(grouped.items()):
        look = {"color": str(0.3 * index), "marker": MARKERS[index], "linestyle": "none"}
        excess = np.sort([one.cost / one.label_cost - 1 for one in results])
        left.plot(100 * excess, np.linspace(0, 1, len(excess)), label=name, **look)
        for one in results:
            for path, face in (("Planned", str(0.3 * index)), ("Direct", "white")):
                score = one.scores[path]
                look |= {"markerfacecolor": face, "markeredgecolor": str(0.3 * index)}
                right.plot(score.bound.sum() / KM, score.over_bound.value, **look)
    right.axhline(1.0, color="0.5", linewidth=0.8)
    right.plot([], [], "o", color="black", label="planned (filled)")
    right.plot([], [], "o", color="black", markerfacecolor="white", label="direct (open)")
    left.set(xlabel="cost of A* above multi-label (%)", ylabel="share of pairs below")
    right.set(xlabel="sum of root PCRB (km)", ylabel="sum of RMSE over that of root PCRB")
    left.legend()
    right.legend()
    return fig


def methods(cases: dict[str, Case]) -> Figure:
    """Draw RMSE of the filters and the bounds, and both over the bound at the truth, per case."""
    fig, axes = plt.subplots(
        2, len(cases), figsize=(9.4, 5.6), sharex="col", sharey="row", squeeze=False
    )
    looks = {"sitan": "-", "ekf": "--", "point mass": "-."}
    for (top, low), (name, case) in zip(axes.T, cases.items(), strict=True):
        along = np.linspace(0.0, case.length / KM, len(case.at_truth))
        for index, (method, one) in enumerate(case.scores.items()):
            look = {"color": str(0.25 * index), "linestyle": looks[method], "label": method}
            top.plot(along, one.rmse / KM, **look)
            _ratio(low, along, one, **look)
        look = {"linestyle": ":", "color": "#d55e00", "linewidth": 2.5, "label": "PCRB, prior"}
        top.plot(along, case.expected / KM, **look)
        low.plot(along, case.expected / case.at_truth, **look)
        look = {"color": "0.5", "linewidth": 0.8, "label": "PCRB at the truth"}
        top.plot(along, case.at_truth / KM, **look)
        low.axhline(1.0, **look)
        top.set(title=name)
        low.set(xlabel="distance along the path (km)")
        _decades(top)
    axes[0, 0].set_ylabel("RMSE (km)")
    axes[1, 0].set_ylabel("over the root PCRB\nat the truth")
    axes[0, -1].legend()
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
    axes[0, 0].legend()
    return fig
