"""Paper 4: the pictures. Each function returns a matplotlib figure."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from seanav import plots
from seanav.estimates import significant
from seanav.models import earth
from seanav.models.trajectories import Trajectory
from seanav.models.units import KM
from seanav.studies.imm_sea_current import scores
from seanav.studies.imm_sea_current.flown import BEST, PURE, Flown

SIGMA = r"$\sigma_T$ (m/s)"


def style(name: str) -> dict[str, Any]:
    """Return the line style of a filter, the same in every figure."""
    if name == "pure navigation":
        return plots.look("open loop")
    if name == "optimal EKF":
        return plots.look("optimal", 0)
    kinds = {"EKF": "Kalman", "AFEKF": "adaptive", "IMM-EKF": "hybrid"}
    kind, sigma, *chain = name.split()
    marker = {"0.1": 1, "0.5": 2, "1": 3, "0.1,0.5": 1, "0.1,1": 2, "0.1,0.5,1": 3}.get(sigma, 4)
    look = plots.look(kinds.get(kind, "interacting models"), marker)
    # Another transition matrix: the same colour and marker, hollow and dotted.
    return look | {"linestyle": ":", "markerfacecolor": "white"} if chain else look


def _axes(columns=2, height=3.4, rows=1):
    fig, axes = plt.subplots(rows, columns, figsize=(4.6 * columns, height * rows))
    return fig, axes


def structure() -> Figure:
    """Draw one second of the IMM of two adaptive fading EKFs (figure 1)."""
    boxes = {
        "mix": (0.0, 1.5, "interaction\n(20)–(22)"),
        "increments": (2.3, 1.5, "increments\n$\\theta$, $\\Delta v$"),
        "log": (3.9, 1.5, "log\n$z$"),
        "modes": (6.4, 1.5, "mode probabilities\n(24), (25)"),
        "all": (9.0, 1.5, "combination\n(26)"),
        "kept": (3.1, -1.4, "kept for the next second: $\\mu_j$, $\\hat x_j^+$, $P_j^+$"),
    }
    arrows = [("modes", "all", "$\\mu_j$, $\\hat x_j^+$, $P_j^+$")]
    for j, y in ((1, 3.0), (2, 0.0)):
        text = f"AFEKF {j}: current model $\\sigma_{{f,{j}}}$\n(14)–(17), (23)"
        boxes[f"filter {j}"] = (3.1, y, text)
        arrows += [
            ("mix", f"filter {j}", f"$\\hat x_{j}^0$, $P_{j}^0$"),
            ("increments", f"filter {j}", ""),
            ("log", f"filter {j}", ""),
            (f"filter {j}", "modes", f"$\\rho_{j}$, $S_{j}$, $\\hat x_{j}^+$, $P_{j}^+$"),
        ]
    arrows += [("modes", "kept", ""), ("kept", "mix", "")]
    return plots.diagram(boxes, arrows, (9.2, 4.2), 0.5)


def pattern(F: np.ndarray, struck: Sequence[int]) -> Figure:
    """Draw which elements of an error dynamics matrix are not zero; `struck` states are out."""
    fig, axis = plt.subplots(figsize=(4.6, 4.6))
    rows, columns = np.nonzero(F)
    axis.plot(columns, rows, "s", color="k", ms=6)
    for state in struck:
        axis.axhline(state, color="0.6", lw=4, alpha=0.6, ls="-")
        axis.axvline(state, color="0.6", lw=4, alpha=0.6, ls="-")
    for edge in range(3, len(F), 3):
        axis.axhline(edge - 0.5, color="0.3", lw=0.7, ls="-")
        axis.axvline(edge - 0.5, color="0.3", lw=0.7, ls="-")
    names = [r"$\delta p$", r"$\delta v$", r"$\varphi$"]
    names += [r"$\delta b_a$", r"$\delta b_g$", r"$\delta v_c$"]
    axis.set_xticks(range(1, len(F), 3), names)
    axis.set_yticks(range(1, len(F), 3), names)
    axis.set(xlim=(-0.5, len(F) - 0.5), ylim=(len(F) - 0.5, -0.5), aspect="equal")
    axis.set(xlabel="driven by the error of", ylabel="rate of the error of")
    axis.grid(False)
    return fig


def trajectory(path: Trajectory) -> Figure:
    """Draw the path (figure 2)."""
    latitude, longitude, _, _ = path.states()
    R_n, R_t = earth.radii(path.latitude)
    fig, axis = plt.subplots(figsize=(4.6, 4.2))
    east = (longitude - longitude[0]) * R_t * np.cos(path.latitude) / KM
    north = (latitude - latitude[0]) * R_n / KM
    axis.plot(east, north)
    axis.plot(east[0], north[0], "o")
    axis.annotate("start", (east[0], north[0]), (6, 6), textcoords="offset points")
    a, b = len(east) // 12, len(east) // 8  # on the first leg of a square
    axis.annotate("", (east[b], north[b]), (east[a], north[a]), arrowprops={"arrowstyle": "->"})
    axis.set(xlabel="east (km)", ylabel="north (km)", aspect="equal")
    return fig


def tcep_and_rate(
    flown: Flown, names: Sequence, linear: dict[str, list[float]] | None = None
) -> Figure:
    """Draw (a) TCEP and (b) its rate against sigma_T with 95 % bands (figures 3 to 5).

    `flown` is the sweep, a `flown.Flown`; `linear` maps names to exact TCEPs on the grid,
    drawn as crosses.
    """
    fig, (left, right) = _axes()
    grid = flown.grid
    for name in [PURE, BEST, *names]:
        look = style(name)
        plots.band(left, grid, flown.curve(scores.tcep, name), name, **look)
        if name in names:
            plots.band(right, grid, flown.rates(name), name, **look)
    for k, exact in enumerate((linear or {}).values()):
        label = "exact (linear covariance)" if k == 0 else None
        left.plot(grid, exact, ls="none", marker="x", color="black", ms=5, label=label)
    left.set(xlabel=SIGMA, ylabel="TCEP (m)", ylim=(0, None), title="(a)")
    right.axhline(100, color="k", lw=0.8)
    right.axhline(90, color="0.6", lw=0.8, ls=":")
    right.set(xlabel=SIGMA, ylabel="TCEP rate (%)", title="(b)")
    handles, labels = left.get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside lower center", ncols=4)
    return fig


def modes(flown: Flown, names: Sequence) -> Figure:
    """Draw the mean mode probabilities of both sub-filters (figure 6)."""
    fig, axes = _axes()
    for model, axis in enumerate(axes):
        for name in names:
            curve = flown.curve(lambda m, k=model: scores.mode(m, k), name)
            plots.band(axis, flown.grid, curve, name, **style(name))
        axis.set(xlabel=SIGMA, ylabel=f"probability of sub-filter {model + 1}")
        axis.set(ylim=(0, 1), title="(a)" if model == 0 else "(b)")
        plots.legend(axis)
    return fig


def rates(flown: Flown, panels: dict) -> Figure:
    """Draw TCEP rates with bands; `panels` maps a title to the names of its curves."""
    panels = panels or {"nothing was run": []}
    fig, axes = plt.subplots(
        1, len(panels), figsize=(5.0 * len(panels), 3.6), squeeze=False, sharey=True
    )
    for axis, (title, names) in zip(axes[0], panels.items(), strict=True):
        for k, name in enumerate(names):
            look = {"color": f"C{k}", "marker": "osD^vPX*"[k % 8], "markersize": 4}
            plots.band(axis, flown.grid, flown.rates(name), name, **look)
        axis.axhline(90, color="0.6", lw=0.8, ls=":")
        axis.set(xlabel=SIGMA, ylabel="TCEP rate (%)", title=title)
        plots.legend(axis, loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=2)
    return fig


def losses(grid: Sequence, panels: dict[str, dict[str, list[float]]]) -> Figure:
    """Draw what each EKF loses against the optimal one (%); one panel for each start."""
    panels = panels or {"nothing is known exactly": {}}
    fig, axes = plt.subplots(
        1, len(panels), figsize=(4.6 * len(panels), 3.4), squeeze=False, sharey=True
    )
    for axis, (title, curves) in zip(axes[0], panels.items(), strict=True):
        for name, curve in curves.items():
            axis.plot(grid, curve, label=name, **style(name) | {"markevery": 4})
        axis.axhline(0, color="k", lw=0.8)
        axis.set(xlabel=SIGMA, ylabel="TCEP above the optimal one (%)", title=title)
        axis.set(ylim=(-5, 40))
        plots.legend(axis)
    return fig


def bars(names: Sequence, values: Sequence, xlabel: str, *, mark: float | None = None) -> Figure:
    """Draw one horizontal bar for each name; `mark` is a dotted line."""
    fig, axis = plt.subplots(figsize=(6.2, 0.9 + 0.27 * len(names)))
    axis.barh(range(len(names)), values, color="0.45")
    axis.set_yticks(range(len(names)), names, fontsize=8)
    axis.invert_yaxis()
    axis.set(xlabel=xlabel)
    if mark is not None:
        axis.axvline(mark, color="k", ls=":")
    return fig


def pairs_of_bars(
    names: Sequence, series: Mapping[str, Sequence], xlabel: str, most: float
) -> Figure:
    """Draw, for each name, one horizontal bar of each series, on a logarithmic axis.

    A bar above `most` is cut and says that it diverges.
    """
    fig, axis = plt.subplots(figsize=(6.8, 1.0 + 0.42 * len(names)))
    height = 0.8 / len(series)
    looks: tuple[dict[str, Any], ...] = (
        {"color": "0.35"},
        {"color": "0.8", "hatch": "///", "edgecolor": "0.2"},
    )
    for k, (label, values) in enumerate(series.items()):
        places = np.arange(len(names)) + (k - (len(series) - 1) / 2) * height
        axis.barh(places, np.minimum(values, most), height, label=label, **looks[k % 2])
        for place, value in zip(places, values, strict=True):
            said = "diverges" if value > most else significant(value)
            axis.text(min(value, most) * 1.05, place, said, va="center", fontsize=8)
    axis.set_yticks(range(len(names)), names)
    axis.invert_yaxis()
    axis.set(xlabel=xlabel, xscale="log", xlim=(None, most * 4))
    axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=len(series), fontsize=8)
    return fig


def printed_and_ours(rows: Mapping[str, Sequence[tuple]], shares: Sequence[float]) -> Figure:
    """Draw ours / printed of the cells of a table, one panel for each column.

    Parameters
    ----------
    rows : mapping
        (filter, start of the current) -> for each column (ratio, low, high).
    shares : sequence of float
        For each column twice the relative standard error of the printed number: a grey stripe.
    """
    fig, axes = plt.subplots(
        1, len(scores.COLUMNS), figsize=(9.4, 1.1 + 0.3 * max(len(rows), 4)), sharey=True
    )
    for axis, column, share, j in zip(axes, scores.COLUMNS, shares, range(len(axes)), strict=True):
        axis.axvspan(1 - share, 1 + share, color="0.88")
        axis.axvline(1.0, color="k", lw=0.8)
        for place, (name, cells) in enumerate(rows.items()):
            value, low, high = cells[j]
            hollow = {"mfc": "white"} if "stationary" in name else {}
            axis.plot([low, high], [place, place], color="0.3", ls="-", lw=1.2)
            axis.plot(value, place, "o", color="0.1", ms=5, **hollow)
        axis.set(xlabel="ours / printed", title=column.split("_")[0])
    axes[0].set_yticks(range(len(rows)), list(rows), fontsize=8)
    axes[0].invert_yaxis()
    return fig
