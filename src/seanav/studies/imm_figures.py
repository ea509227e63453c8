"""Paper 4: the pictures. Each function returns a matplotlib figure."""

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.ticker import NullFormatter

from seanav.models import earth
from seanav.models.units import KM
from seanav.montecarlo import Estimate
from seanav.studies import imm_scores

SIGMA = r"$\sigma_T$ (m/s)"
STYLES = {
    "pure navigation": {"color": "k", "ls": ":"},
    "optimal EKF": {"color": "k", "ls": "-", "marker": "o"},
    "0.1": {"color": "C1", "ls": "--", "marker": "^"},
    "0.5": {"color": "C2", "ls": "-.", "marker": "s"},
    "1": {"color": "C3", "ls": ":", "marker": "D"},
    "0.1,0.5": {"color": "C1", "ls": "--", "marker": "v"},
    "0.1,1": {"color": "C2", "ls": "-.", "marker": "P"},
}


def _style(name):
    key = name if name in STYLES else name.split()[-1]
    return {"markersize": 4, **STYLES.get(key, {})}


def _axes(columns=2, height=3.4, rows=1):
    fig, axes = plt.subplots(rows, columns, figsize=(4.6 * columns, height * rows))
    return fig, axes


def structure(models=2):
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


def trajectory(path):
    """Draw the path (figure 2)."""
    latitude, longitude, _, _ = path.states()
    R_n, R_t = earth.radii(path.latitude)
    fig, axis = plt.subplots(figsize=(4.6, 4.2))
    east = (longitude - longitude[0]) * R_t * np.cos(path.latitude) / KM
    north = (latitude - latitude[0]) * R_n / KM
    axis.plot(east, north)
    axis.plot(east[0], north[0], "o", label="start")
    axis.annotate(
        "", (east[900], north[900]), (east[600], north[600]), arrowprops={"arrowstyle": "->"}
    )
    axis.set(xlabel="east (km)", ylabel="north (km)", aspect="equal")
    axis.legend()
    return fig


def tcep_and_rate(grid, results, names, linear=None):
    """Draw (a) TCEP and (b) its rate against sigma_T with 95 % bands (figures 3 to 5).

    `linear` maps names to exact TCEPs on the grid, drawn as thin dashes.
    """
    fig, (left, right) = _axes()
    pure, best = results["pure navigation"], results["optimal EKF"]
    for name in ["pure navigation", "optimal EKF", *names]:
        style = _style(name)
        estimates = [imm_scores.tcep(m) for m in results[name]]
        _band(left, grid, estimates, name, style)
        if linear and name in linear:
            left.plot(grid, linear[name], "--", color="0.4", lw=0.8)
        if name in names:
            rates = [imm_scores.rate(*one) for one in zip(results[name], pure, best, strict=True)]
            _band(right, grid, rates, name, style)
    left.set(xlabel=SIGMA, ylabel="TCEP (m)", ylim=(0, None), title="(a)")
    right.axhline(100, color="k", lw=0.8)
    right.axhline(90, color="0.6", lw=0.8, ls=":")
    right.set(xlabel=SIGMA, ylabel="TCEP rate (%)", title="(b)")
    left.legend(fontsize=7)
    return fig


def _band(axis, x, estimates, name, style):
    axis.plot(x, [e.value for e in estimates], label=name, **style)
    low, high = [e.low for e in estimates], [e.high for e in estimates]
    axis.fill_between(x, low, high, color=style.get("color"), alpha=0.15, lw=0)


def modes(grid, results, names):
    """Draw the mean mode probabilities of both sub-filters (figure 6)."""
    fig, axes = _axes()
    for model, axis in enumerate(axes):
        for name in names:
            _band(
                axis, grid, [imm_scores.mode(m, model) for m in results[name]], name, _style(name)
            )
        axis.set(xlabel=SIGMA, ylabel=f"probability of sub-filter {model + 1}")
        axis.set(ylim=(0, 1), title="(a)" if model == 0 else "(b)")
        axis.legend(fontsize=7)
    return fig


def rates(grid, results, panels):
    """Draw TCEP rates with bands; `panels` maps a title to the names of its curves."""
    fig, axes = plt.subplots(
        1, len(panels), figsize=(5.0 * len(panels), 3.6), squeeze=False, sharey=True
    )
    pure, best = results["pure navigation"], results["optimal EKF"]
    for axis, (title, names) in zip(axes[0], panels.items(), strict=True):
        for k, name in enumerate(names):
            one = [imm_scores.rate(*three) for three in zip(results[name], pure, best, strict=True)]
            style = {"color": f"C{k}", "marker": "osD^vPX*"[k % 8], "markersize": 4}
            _band(axis, grid, one, name, style)
        axis.axhline(90, color="0.6", lw=0.8, ls=":")
        axis.set(xlabel=SIGMA, ylabel="TCEP rate (%)", title=title)
        axis.legend(fontsize=7)
    return fig


def lines(x, curves, xlabel, ylabel, *, logx=False, logy=False, vertical=None, marker=None):
    """Draw named curves in one panel; a curve of estimates gets its 95 % band."""
    fig, axis = plt.subplots(figsize=(5.4, 3.6))
    for k, (name, y) in enumerate(curves.items()):
        style = {"color": f"C{k}", "marker": marker, "markersize": 4}
        if isinstance(y[0], Estimate):
            _band(axis, x, y, name, style)
        else:
            axis.plot(x, y, label=name, **style)
    if vertical is not None:
        axis.axvline(vertical, color="0.6", ls=":")
    axis.set(xlabel=xlabel, ylabel=ylabel)
    for log, which in ((logx, axis.xaxis), (logy, axis.yaxis)):
        if log:
            which.axes.set(**{f"{which.axis_name}scale": "log"})
            which.set_major_formatter("{x:g}")
            which.set_minor_formatter(NullFormatter())
    axis.legend(fontsize=7)
    return fig


def bars(names, values, xlabel, *, log=False, mark=None, most=np.inf):
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
