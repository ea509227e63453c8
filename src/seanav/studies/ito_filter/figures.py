"""Paper 1: the drawings; each function returns a figure and computes nothing new."""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from numpy.typing import ArrayLike

from seanav.filters.moments.density import Density
from seanav.studies.ito_filter.scenario import COMPONENTS, UNITS, VEHICLES
from seanav.studies.ito_filter.scores import Result

TRUE = {"color": "black", "linestyle": ":", "linewidth": 1.3}
FILTERED = {"color": "#0072b2", "linestyle": "-", "linewidth": 1.3}
STYLES = {
    "gaussian": {"color": "#0072b2", "linestyle": "-"},
    "second order": {"color": "#009e73", "linestyle": "-."},
    "ekf": {"color": "#d55e00", "linestyle": "--"},
    "exact": {"color": "black", "linestyle": ":"},
    "Fokker–Planck": {"color": "black", "linestyle": ":"},
}


def _trajectory(ax, result, i, run):
    times, x = result.truth.times, result.truth.x[run, :, i]
    mean, sd = result.track.mean[run, :, i], np.sqrt(result.track.P[run, :, i, i])
    ax.fill_between(times, mean - 2 * sd, mean + 2 * sd, color="0.85", label="± 2 own sd")
    ax.plot(times, mean, label="filtered", **FILTERED)
    ax.plot(times, x, label="true", **TRUE)
    ax.set(xlabel="time (s)", ylabel=f"{COMPONENTS[i]} ({UNITS[i]})", xlim=(0, times[-1]))


def component(result: Result, i: int, run: int = 0) -> Figure:
    """Draw one component of one run: true dotted, filtered solid, as in the paper."""
    # Margins by hand, the legend above: 36 of these, and a solver per figure is slow.
    fig, ax = plt.subplots(figsize=(5.6, 2.8), layout="none")
    fig.subplots_adjust(left=0.13, right=0.98, bottom=0.17, top=0.91)
    _trajectory(ax, result, i, run)
    ax.set_title(f"{result.truth.vehicle}, case {result.case.number}", loc="left")
    ax.legend(ncols=3, loc="lower right", bbox_to_anchor=(1, 1), borderaxespad=0)
    return fig


def overview(result: Result, run: int = 0) -> Figure:
    """Draw all six components of one run."""
    fig, axes = plt.subplots(2, 3, figsize=(9.0, 4.6), sharex=True, layout="none")
    fig.subplots_adjust(left=0.075, right=0.985, bottom=0.11, top=0.92, wspace=0.36, hspace=0.1)
    for i, ax in enumerate(axes.flat):
        _trajectory(ax, result, i, run)
    for ax in axes[0]:
        ax.set_xlabel("")
    title = f"{result.truth.vehicle}, case {result.case.number}: {result.case.words}"
    axes[0, 0].set_title(title, loc="left")
    axes[0, 2].legend(ncols=3, loc="lower right", bbox_to_anchor=(1, 1), borderaxespad=0)
    return fig


def second_order_map(maps: dict[str, Any]) -> Figure:
    """Draw errors of both second-order filters over the EKF's, by noise and interval.

    Upper row: Gaussian closure; lower row: truncated. Blue below one, red above.
    """
    fig, axes = plt.subplots(2, len(maps), figsize=(8.4, 6.4), squeeze=False)
    gains = [g.value for rows in maps.values() for row in rows for g in row[2:]]
    most = max([1e-3, *(abs(g - 1) for g in gains if np.isfinite(g))])
    places = [(k, words) for k, words in enumerate(("Gaussian closure", "truncated"))]
    for (k, words), (column, (vehicle, rows)) in product(places, enumerate(maps.items())):
        ax = axes[k, column]
        factors, intervals = (list(dict.fromkeys(row[k] for row in rows)) for k in (0, 1))
        found = [np.nan if row[2 + k].diverged else row[2 + k].value for row in rows]
        values = np.reshape(found, (len(factors), -1))
        ends = {"vmin": 1 - most, "vmax": 1 + most}
        shade = ax.imshow(values, origin="lower", cmap="RdBu_r", aspect="auto", **ends)
        for index, row in enumerate(rows):
            (a, b), gain = divmod(index, len(intervals)), row[2 + k]
            text, colour = "diverged", "black"
            if not gain.diverged:
                text = f"{gain.value:.3f}{'*' if gain.high < 1 else ''}"
                colour = "white" if abs(gain.value - 1) > 0.6 * most else "black"
            ax.text(b, a, text, ha="center", va="center", color=colour)
        ax.set_xticks(range(len(intervals)), [f"{x:g}" for x in intervals])
        ax.set_yticks(range(len(factors)), [f"{x:g}" for x in factors])
        title = f"{vehicle}, {words}"
        ax.set(xlabel="measurement interval (s)", ylabel="noise factor", title=title)
        ax.grid(False)
    fig.colorbar(shade, ax=axes, label="RMSE over the EKF's")
    return fig


def nees(results: dict, band: tuple[float, ...]) -> Figure:
    """Draw the NEES over time of the three closures, all cases."""
    fig, axes = plt.subplots(2, 3, figsize=(9.0, 4.8), sharex=True, sharey="row")
    for row, vehicle in zip(axes, VEHICLES, strict=True):
        for number, ax in zip((1, 2, 3), row, strict=True):
            result = results[vehicle, number]
            ax.axhspan(*band, color="0.85", label="95 % if consistent")
            for name in ("gaussian", "second order", "ekf"):
                values = result.scores[name].nees_by_time
                ax.plot(result.truth.times[1:], values, label=name, linewidth=1, **STYLES[name])
            ax.set_title(f"{vehicle}, case {number}")
    for ax in axes[1]:
        ax.set_xlabel("time (s)")
    for ax in axes[:, 0]:
        ax.set_ylabel("mean NEES")
    axes[0, 0].legend(loc="upper right")
    return fig


def sensitivity(variances: ArrayLike, factors: Sequence, sds: np.ndarray) -> Figure:
    """Draw the filter's own sd of u and r over R, for several strengths of G."""
    fig, axes = plt.subplots(1, 2, figsize=(8.0, 3.2))
    for ax, i in zip(axes, (0, 5), strict=True):
        for factor, sd, style in zip(factors, sds, ("-", "--", "-."), strict=True):
            ax.loglog(variances, sd[:, i], linestyle=style, label=f"noise × {factor:g}")
        ax.set(xlabel="R (m²/s²)", ylabel=f"own sd of {COMPONENTS[i]} ({UNITS[i]})")
    axes[0].legend()
    return fig


def planar(times: np.ndarray, curves: dict[str, tuple[np.ndarray, ...]]) -> Figure:
    """Draw mean and variance of the planar body: exact and closures, {name: (z, trace)}."""
    fig, (left, right) = plt.subplots(1, 2, figsize=(8.0, 3.4))
    for name, (z, trace) in curves.items():
        left.plot(z.real, z.imag, label=name, **STYLES[name])
        right.plot(times, trace, label=name, **STYLES[name])
    left.set(xlabel="E u (m/s)", ylabel="E v (m/s)", aspect="equal")
    right.set(xlabel="time (s)", ylabel="var u + var v (m²/s²)")
    left.legend()
    return fig


def density(field: Density, summaries: dict[str, tuple[np.ndarray, ...]]) -> Figure:
    """Draw a density of sway and yaw with the 2-sigma ellipses of closures."""
    fig, ax = plt.subplots(figsize=(5.6, 4.4))
    levels = np.linspace(0, field.p.max(), 9)[1:]
    ax.contourf(field.x, field.y, field.p.T, [0.02 * field.p.max(), *levels], cmap="Greys")
    for name, (mean, P) in summaries.items():
        values, vectors = np.linalg.eigh(P)
        tilt = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
        width, height = 4 * np.sqrt(values[::-1])
        ellipse = Ellipse(
            tuple(mean), width, height, angle=tilt, fill=False, linewidth=1.6, label=name
        )
        ellipse.set(edgecolor=STYLES[name]["color"], linestyle=STYLES[name]["linestyle"])
        ax.add_patch(ellipse)
    ax.set(xlabel="v (m/s)", ylabel="r (rad/s)", xlim=(-1.2, 1.4), ylim=(-3.2, 3.0))
    ax.legend(loc="upper right")
    return fig
