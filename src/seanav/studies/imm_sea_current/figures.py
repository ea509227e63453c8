"""Paper 4: the pictures. Each function returns a matplotlib figure."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from seanav import plots
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


def structure(models: int = 2) -> Figure:
    """Draw the four steps of the IMM (figure 1)."""
    fig, axis = plt.subplots(figsize=(8.5, 3.6))
    axis.set(xlim=(0, 10), ylim=(0, 4))
    axis.axis("off")
    box = {"boxstyle": "round,pad=0.35", "fc": "white", "ec": "0.3"}
    arrow = {"arrowstyle": "->", "color": "0.3"}

    def put(x, y, text):
        axis.text(x, y, text, ha="center", va="center", bbox=box, fontsize=9)

    put(1.3, 2, "interaction\n(20)-(22)")
    put(5.9, 0.5, "mode probability (24), (25)")
    put(8.6, 2, "combination\n(26)")
    for j in range(models):
        y = 3.3 - 1.3 * j
        put(4.6, y, f"AFEKF {j + 1}: current model $\\sigma_{{f,{j + 1}}}$\n(14)-(17), (23)")
        axis.annotate("", (3.0, y), (2.2, 2), arrowprops=arrow)
        axis.annotate("", (7.7, 2), (6.2, y), arrowprops=arrow)
        axis.annotate("", (6.6, 0.85), (6.2, y), arrowprops=arrow)
    axis.annotate("", (8.6, 1.5), (7.6, 0.5), arrowprops=arrow)
    axis.annotate("", (1.3, 1.5), (4.0, 0.5), arrowprops=arrow)
    axis.text(2.1, 0.6, "previous $\\mu$, $\\hat x_j$, $P_j$", fontsize=8)
    axis.text(4.6, 3.95, "increments, log", fontsize=8, ha="center")
    return fig


def trajectory(path: Trajectory) -> Figure:
    """Draw the path (figure 2)."""
    latitude, longitude, _, _ = path.states()
    R_n, R_t = earth.radii(path.latitude)
    fig, axis = plt.subplots(figsize=(4.6, 4.2))
    east = (longitude - longitude[0]) * R_t * np.cos(path.latitude) / KM
    north = (latitude - latitude[0]) * R_n / KM
    axis.plot(east, north)
    axis.plot(east[0], north[0], "o", label="start")
    a, b = len(east) // 12, len(east) // 8  # on the first leg of a square
    axis.annotate("", (east[b], north[b]), (east[a], north[a]), arrowprops={"arrowstyle": "->"})
    axis.set(xlabel="east (km)", ylabel="north (km)", aspect="equal")
    axis.legend()
    return fig


def tcep_and_rate(
    flown: Flown, names: Sequence, linear: dict[str, list[float]] | None = None
) -> Figure:
    """Draw (a) TCEP and (b) its rate against sigma_T with 95 % bands (figures 3 to 5).

    `flown` is the sweep, a `flown.Flown`; `linear` maps names to exact TCEPs on the grid,
    drawn as thin dashes.
    """
    fig, (left, right) = _axes()
    grid = flown.grid
    for name in [PURE, BEST, *names]:
        look = style(name)
        plots.band(left, grid, flown.curve(scores.tcep, name), name, **look)
        if linear and name in linear:
            left.plot(grid, linear[name], "--", color="0.4", lw=0.8)
        if name in names:
            plots.band(right, grid, flown.rates(name), name, **look)
    left.set(xlabel=SIGMA, ylabel="TCEP (m)", ylim=(0, None), title="(a)")
    right.axhline(100, color="k", lw=0.8)
    right.axhline(90, color="0.6", lw=0.8, ls=":")
    right.set(xlabel=SIGMA, ylabel="TCEP rate (%)", title="(b)")
    left.legend(fontsize=7)
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
        plots.legend(axis)
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


def bars(
    names: Sequence,
    values: Sequence,
    xlabel: str,
    *,
    log: bool = False,
    mark: float | None = None,
    most: float = np.inf,
) -> Figure:
    """Draw one horizontal bar for each name; one above `most` is cut and says so."""
    fig, axis = plt.subplots(figsize=(6.2, 0.9 + 0.27 * len(names)))
    axis.barh(range(len(names)), np.minimum(values, most), color="0.45")
    for k, value in enumerate(values):
        if value > most:
            axis.text(most, k, "diverges ", ha="right", va="center", color="w", fontsize=8)
    axis.set_yticks(range(len(names)), names, fontsize=8)
    axis.invert_yaxis()
    axis.set(xlabel=xlabel)
    if log:
        axis.set_xscale("log")
    if mark is not None:
        axis.axvline(mark, color="k", ls=":")
    return fig
