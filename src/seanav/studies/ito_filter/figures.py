"""Paper 1: the drawings; each function returns a figure and computes nothing new."""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from numpy.typing import ArrayLike

from seanav import plots
from seanav.filters.moments import Track
from seanav.filters.moments.density import Density
from seanav.studies.ito_filter.own_sde import Own
from seanav.studies.ito_filter.run import History, Truth
from seanav.studies.ito_filter.scenario import COMPONENTS, UNITS, VEHICLES

TRUE: dict[str, Any] = plots.look("truth") | {"linewidth": 1.3}
FILTERED: dict[str, Any] = plots.look("Gaussian") | {"linewidth": 1.3}
FREE: dict[str, Any] = plots.look("other") | {"linewidth": 1.1}
MEASURED: dict[str, Any] = {"color": "0.35", "marker": "o", "markersize": 2.2, "linestyle": "none"}
NAMES = {
    "gaussian": "Gaussian closure",
    "second order": "truncated",
    "ekf": "EKF",
    "exact": "exact",
    "Fokker–Planck": "Fokker–Planck",
}
STYLES: dict[str, dict[str, Any]] = {
    "gaussian": plots.look("Gaussian"),
    "second order": plots.look("second order"),
    "ekf": plots.look("Kalman"),
    "exact": plots.look("truth"),
    "Fokker–Planck": plots.look("truth"),
}

# ---------------------------------------------------------------- trajectories


def draw(ax: Axes, history: History, i: int) -> None:
    """Draw a component in a panel: truth, filter with its band, prediction only, measurements."""
    grid, mean, sd = history.grid, history.mean[:, i], history.sd[:, i]
    low, high, free = mean - 2 * sd, mean + 2 * sd, history.free[:, i]
    ax.fill_between(grid, low, high, color="0.85", linewidth=0, label="± 2 own sd")
    ax.plot(grid, free, label="prediction only", **FREE)
    ax.plot(grid, mean, label="filtered", **FILTERED)
    ax.plot(history.times, history.x[:, i], label="true", **TRUE)
    # The measurements of a large R would leave no room for the curves.
    values = np.concatenate([low, high, free, history.x[:, i]])
    values = values[np.isfinite(values)]
    if len(values) and values.max() > values.min():
        margin = 0.06 * (values.max() - values.min())
        ax.set_ylim(values.min() - margin, values.max() + margin)
    if i in history.case.measured:
        z = history.z[:, history.case.measured.index(i)]
        ax.plot(history.measured_times, z, label="measured", zorder=3, **MEASURED)
    name, unit = COMPONENTS[i], UNITS[i]
    ax.set(xlabel="time (s)", ylabel=f"{name} ({unit})", xlim=(0, history.times[-1]))


def _legend(fig, ax):
    """Put the legend of a panel above all panels."""
    handles, labels = ax.get_legend_handles_labels()
    places = {"loc": "upper right", "bbox_to_anchor": (0.99, 1.0), "borderaxespad": 0.2}
    fig.legend(handles, labels, ncols=5, columnspacing=1.2, handlelength=1.8, **places)


def component(history: History, i: int) -> Figure:
    """Draw one component of one run: true dotted, filtered solid, as in the paper."""
    # Margins by hand, the legend above: 36 of these, and a solver per figure is slow.
    fig, ax = plt.subplots(figsize=(6.4, 3.0), layout="none")
    fig.subplots_adjust(left=0.12, right=0.98, bottom=0.16, top=0.84)
    draw(ax, history, i)
    ax.set_title(f"{history.vehicle}, case {history.case.number}", loc="left")
    _legend(fig, ax)
    return fig


def overview(history: History) -> Figure:
    """Draw all six components of one run."""
    fig, axes = plt.subplots(2, 3, figsize=(9.0, 4.8), sharex=True, layout="none")
    fig.subplots_adjust(left=0.075, right=0.985, bottom=0.105, top=0.885, wspace=0.36, hspace=0.1)
    for i, ax in enumerate(axes.flat):
        draw(ax, history, i)
    for ax in axes[0]:
        ax.set_xlabel("")
    title = f"{history.vehicle}, case {history.case.number}: {history.case.words}"
    axes[0, 0].set_title(title, loc="left")
    _legend(fig, axes.flat[history.case.measured[0]])
    return fig


def opening(history: History, shown: Sequence[int] = (0, 5)) -> Figure:
    """Draw some components of one run side by side: what is measured, and what is not."""
    fig, axes = plt.subplots(1, len(shown), figsize=(9.0, 3.3), layout="none")
    fig.subplots_adjust(left=0.075, right=0.985, bottom=0.15, top=0.82, wspace=0.22)
    for ax, i in zip(axes, shown, strict=True):
        draw(ax, history, i)
        measured = "measured" if i in history.case.measured else "not measured"
        ax.set_title(f"{COMPONENTS[i]}: {measured}", loc="left")
    _legend(fig, axes[0])
    return fig


# ---------------------------------------------------------------- the scalar example


def quadratic_variation(paths: dict[float, tuple[np.ndarray, np.ndarray]]) -> Figure:
    """Draw one Wiener path and the sum of its squared increments, {step: (times, W)}."""
    fig, (left, right) = plt.subplots(1, 2, figsize=(8.0, 3.0))
    styles = zip(paths.items(), ("-", "--", "-."), ("0.55", "#d55e00", "#0072b2"), strict=True)
    for (step, (times, W)), dash, color in styles:
        style = {"linestyle": dash, "color": color, "label": f"Δt = {step:g} s", "linewidth": 1.2}
        left.plot(times, W, **style)
        right.plot(times[1:], np.cumsum(np.diff(W) ** 2), **style)
    right.plot(times, times, label="t", **TRUE)
    left.set(xlabel="time (s)", ylabel="W")
    right.set(xlabel="time (s)", ylabel="Σ (ΔW)²")
    right.legend()
    return fig


def closures(times: np.ndarray, sampled: np.ndarray, closed: dict[str, np.ndarray]) -> Figure:
    """Draw mean ± sd of closures side by side over sampled ones.

    `sampled` and each of `closed` have the shape (2, times): mean and variance.
    """
    fig, axes = plt.subplots(1, len(closed), figsize=(9.0, 3.2), sharex=True, sharey=True)
    mean, sd = sampled[0], np.sqrt(sampled[1])
    for ax, (name, (m, P)) in zip(axes, closed.items(), strict=True):
        ax.fill_between(times, mean - sd, mean + sd, color="0.85", label="sampled, ± sd")
        ax.plot(times, mean, label="sampled, mean", **TRUE)
        style = STYLES[name]
        ax.plot(times, m, color=style["color"], label="closed, mean")
        for sign in (-1, 1):
            label = "closed, ± sd" if sign == 1 else None
            ax.plot(times, m + sign * np.sqrt(P), color=style["color"], ls="--", lw=1, label=label)
        ax.set(title=NAMES[name], xlabel="time (s)")
    axes[0].set_ylabel("x")
    axes[-1].legend(loc="upper right")
    return fig


# ---------------------------------------------------------------- beyond one run


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
            ax.axhline(6, color="0.5", linewidth=0.8)
            for name in ("gaussian", "second order", "ekf"):
                values = result.scores[name].nees_by_time
                style = {"label": NAMES[name], "linewidth": 1.1, **STYLES[name]}
                ax.plot(result.truth.times[1:], values, **style)
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
        for factor, sd, dash, mark in zip(factors, sds, ("-", "--", "-."), "o^s", strict=True):
            style: dict[str, Any] = {"linestyle": dash, "marker": mark, "markersize": 4}
            ax.loglog(variances, sd[:, i], label=f"noise × {factor:g}", **style)
        ax.set(xlabel="R (m²/s²)", ylabel=f"own sd of {COMPONENTS[i]} ({UNITS[i]})")
    axes[0].legend()
    return fig


def planar(times: np.ndarray, curves: dict[str, tuple[np.ndarray, ...]]) -> Figure:
    """Draw mean and variance of the planar body: exact and two closures, {name: (z, trace)}."""
    fig, (left, right) = plt.subplots(1, 2, figsize=(8.0, 3.4))
    every = max(1, round(2.0 / (times[1] - times[0])))  # a mark every two seconds
    for (name, (z, trace)), mark in zip(curves.items(), ("o", "s", "^"), strict=True):
        marks: dict[str, Any] = {"marker": mark, "markersize": 4, "markevery": every}
        left.plot(z.real, z.imag, label=NAMES[name], **STYLES[name] | marks)
        right.plot(times, trace, label=NAMES[name], **STYLES[name])
    left.set(xlabel="mean u (m/s)", ylabel="mean v (m/s)", aspect="equal")
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
            tuple(mean), width, height, angle=tilt, fill=False, linewidth=1.6, label=NAMES[name]
        )
        ellipse.set(edgecolor=STYLES[name]["color"], linestyle=STYLES[name]["linestyle"])
        ax.add_patch(ellipse)
    ax.set(xlabel="v (m/s)", ylabel="r (rad/s)", xlim=(-1.2, 1.4), ylim=(-3.2, 3.0))
    ax.legend(loc="upper right")
    return fig


def own_sde(own: Own, truth: Truth, track: Track, free: Track) -> Figure:
    """Draw the first run of a user's system: truth, filter with its band, prediction only."""
    n = len(own.names)
    fig, axes = plt.subplots(n, 1, figsize=(7.2, 1.0 + 1.7 * n), sharex=True, squeeze=False)
    for i, ax in enumerate(axes[:, 0]):
        mean, sd = track.mean[0, :, i], np.sqrt(track.P[0, :, i, i])
        ax.fill_between(truth.times, mean - 2 * sd, mean + 2 * sd, color="0.85", linewidth=0)
        ax.plot(truth.times, free.mean[0, :, i], label="prediction only", **FREE)
        ax.plot(truth.times, mean, label="filtered, ± 2 own sd", **FILTERED)
        ax.plot(truth.times, truth.x[0, :, i], label="true", **TRUE)
        ax.set(ylabel=f"{own.names[i]} ({own.units[i]})" if own.units[i] else own.names[i])
    axes[-1, 0].set(xlabel="time")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    fig.legend(handles, labels, ncols=3, loc="outside upper left")
    return fig
