"""Paper 3: the drawings; each function returns a figure and computes nothing new."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull

from seanav import plots
from seanav.estimates import Estimate
from seanav.studies.adaptive_fading.beyond import Detection
from seanav.studies.adaptive_fading.own_log import Log
from seanav.studies.adaptive_fading.run import Outcome, Problem

GREEK = {"psi": "ψ", "theta": "θ"}
OTHERS = {"larger Q": "P", "input bias": "X"}


def style(name: str) -> dict[str, Any]:
    """Return the line style and marker of a filter, the same in every figure."""
    kinds = {"OKF": "optimal", "larger Q": "Kalman", "input bias": "hybrid"}
    single, printed = name.startswith("SFF"), name.endswith("(1)")
    fading = "adaptive" if single else "adaptive, one per state"
    # The filters that rest on one innovation: thinner, with open marks.
    look: dict[str, Any] = {"linewidth": 0.9 if printed else 1.5, "markersize": 5}
    look["marker"] = OTHERS.get(name, "o" if name == "OKF" else "s" if single else "^")
    if printed:
        look["markerfacecolor"] = "white"
    return plots.look(kinds.get(name, fading)) | look


def statistic_sketch(
    times: np.ndarray,
    panels: Mapping[str, np.ndarray],
    beta: np.ndarray,
    limit: float,
    fault_time: float,
) -> Figure:
    """Draw one state of one run, true and estimated, above β of the same run.

    `panels` maps a label to the curve; the first one is the truth.
    """
    fig, (top, bottom) = plt.subplots(2, 1, figsize=(6.8, 4.4), sharex=True, height_ratios=(3, 2))
    kinds = ("truth", "Kalman", "adaptive")
    for kind, (label, curve) in zip(kinds, panels.items(), strict=False):
        look = {"color": "black", "linestyle": "-"} if kind == "truth" else plots.look(kind)
        top.plot(times, curve, label=label, **(look | {"linewidth": 1.2, "marker": None}))
    bottom.semilogy(times, beta, color="0.35", linewidth=0.7, linestyle="-", label="β")
    bottom.axhline(limit, color="#d55e00", linestyle="--", label="threshold")
    for ax in (top, bottom):
        ax.axvline(fault_time, color="black", linestyle=":", linewidth=1)
    top.set_ylabel("yaw rate r (rad/s)")
    bottom.set(xlabel="time (s)", ylabel="β of the OKF", ylim=(1e-2, None))
    top.legend(ncols=3, loc="lower left", bbox_to_anchor=(0, 1.0))
    bottom.legend(ncols=2, loc="upper left")
    return fig


# ---------------------------------------------------------------- figure 1

# Where the eye is, in body axes (forward, starboard, down): before, starboard of and above.
_EYE = np.array([0.62, 0.62, -0.42])


def _seen(points):
    """Return points (..., 3) of body axes on the paper, (..., 2), and their height above it."""
    toward = _EYE / np.linalg.norm(_EYE)
    up = np.array([0.0, 0.0, -1.0])
    up = up - (up @ toward) * toward
    up /= np.linalg.norm(up)
    right = np.cross(up, toward)
    return points @ np.column_stack([right, up]), points @ toward


def _turn(ax, axis, at, radius):
    """Draw a positive rotation about an axis: from the next axis to the one after it."""
    angle = np.linspace(-0.2 * np.pi, 1.4 * np.pi, 80)
    first, second = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
    ring = np.outer(np.cos(angle), first) + np.outer(np.sin(angle), second)
    flat, _ = _seen(at * np.eye(3)[axis] + radius * ring)
    ax.plot(*flat[:-1].T, color="#0072b2", linewidth=1.4, linestyle="-")
    head = {"arrowstyle": "-|>", "color": "#0072b2", "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", flat[-1], flat[-4], arrowprops=head | {"mutation_scale": 14})


def axes_of_motion() -> Figure:
    """Draw the right-handed body axes with the six velocities and three angles.

    The projection is orthographic, seen from before, starboard and above; each blue arrow is a
    positive rotation by the right-hand rule.
    """
    fig, ax = plt.subplots(figsize=(6.8, 4.6))
    polar, around = np.meshgrid(np.linspace(0, np.pi, 40), np.linspace(0, 2 * np.pi, 60))
    thick = 0.3 * np.sin(polar) ** 0.7
    hull = np.stack([1.7 * np.cos(polar), thick * np.cos(around), thick * np.sin(around)], -1)
    flat, _ = _seen(hull.reshape(-1, 3))
    # Fins first: the hull, which is nearer to the eye, hides where they begin.
    for across in ((0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)):
        corners = [(-1.25, 0.15), (-1.6, 0.15), (-1.6, 0.6), (-1.4, 0.6)]
        fin = np.array([[x, 0, 0] + h * np.array(across) for x, h in corners])
        ax.fill(*_seen(fin)[0].T, facecolor="0.75", edgecolor="black", linewidth=0.8, linestyle="-")
    edge = flat[ConvexHull(flat).vertices]
    ax.fill(*edge.T, facecolor="0.9", edgecolor="black", linewidth=1, linestyle="-")
    lengths, centre = (3.1, 2.6, 2.4), _seen(np.zeros(3))[0]
    labels = (
        ("$x_b$, forward\nsurge $u$, force $X$\nroll φ, rate $p$", (0.1, -0.12), "left", "top"),
        ("$y_b$, starboard\nsway $v$, force $Y$\npitch θ, rate $q$", (-0.1, -0.1), "right", "top"),
        ("$z_b$, down\nheave $w$, force $Z$\nyaw ψ, rate $r$", (0.45, 0.2), "left", "center"),
    )
    for axis, (text, shift, side, level) in enumerate(labels):
        tip = _seen(lengths[axis] * np.eye(3)[axis])[0]
        arrow = {"arrowstyle": "-|>", "color": "black", "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", tip, centre, arrowprops=arrow | {"linewidth": 1.4, "mutation_scale": 16})
        ax.text(tip[0] + shift[0], tip[1] + shift[1], text, ha=side, va=level, fontsize=10)
        _turn(ax, axis, 0.8 * lengths[axis], 0.32)
    ax.plot(*centre, "o", color="black", markersize=4)
    tail = _seen(np.array([-1.5, 0.0, -0.6]))[0]
    ax.annotate("rudder $δ_r$", tail, tail + np.array([0.5, 0.55]), arrowprops={"arrowstyle": "-"})
    plane = _seen(np.array([-1.5, -0.6, 0.0]))[0]
    ax.annotate(
        "stern planes $δ_s$", plane, plane + np.array([0.55, 0.3]), arrowprops={"arrowstyle": "-"}
    )
    ax.set(aspect="equal", xlim=(-3.4, 3.9), ylim=(-2.6, 1.7))
    ax.axis("off")
    return fig


# ---------------------------------------------------------------- figures 2 to 7


def statistic(
    case: Problem,
    outcome: Outcome,
    limit: float,
    fault_time: float,
    run: int = 0,
    highest: float | None = None,
) -> Figure:
    """Draw β of one run before and after adaptation against its threshold.

    `highest` ends the axis where the figures of other filters end theirs.
    """
    fig, ax = plt.subplots(figsize=(6.8, 3.4))
    ax.semilogy(case.times, outcome.before[run], color="0.6", linewidth=0.9, linestyle="-",
                label="β before adaptation")  # fmt: skip
    if outcome.factors is not None:
        ax.semilogy(case.times, outcome.after[run], color="#003f66", linewidth=0.8,
                    linestyle="-", label="β after adaptation")  # fmt: skip
    ax.axhline(limit, color="#d55e00", linestyle="--", label="threshold")
    ax.axvline(fault_time, color="black", linestyle=":", linewidth=1)
    ax.set(xlabel="time (s)", ylabel="β")
    ax.set_ylim(1e-2, highest if highest is not None and np.isfinite(highest) else None)
    ax.legend(ncols=3, loc="upper center", bbox_to_anchor=(0.5, 1.16))
    return fig


def estimates(
    case: Problem,
    truth: np.ndarray,
    outcomes: Mapping[str, Outcome],
    name: str,
    fault_time: float,
    run: int = 0,
) -> Figure:
    """Draw true and estimated states of one run, and the RMSE over all runs beside them.

    The optimal filter is drawn with the filter `name`; all `outcomes` together set the axes, so
    that the figures of different filters can be laid side by side.
    """
    n = len(case.states)
    fig, axes = plt.subplots(n, 2, figsize=(8.6, 1.75 * n), sharex=True, width_ratios=(2, 1.3))
    drawn = list(dict.fromkeys(("OKF", name)))
    for i, (state, unit) in enumerate(zip(case.states, case.units, strict=True)):
        left, right = axes[i]
        rms = {o: np.sqrt((x.errors[:, :, i] ** 2).mean(axis=0)) for o, x in outcomes.items()}
        curves = {o: truth[run, :, i] + x.errors[run, :, i] for o, x in outcomes.items()}
        left.plot(case.times, truth[run, :, i], color="black", linewidth=1, label="true")
        for one in drawn:
            kind = "Kalman" if one == "OKF" else "adaptive"
            both = plots.look(kind) | {"linewidth": 1.1, "label": one}
            left.plot(case.times, curves[one], **both)
            right.plot(case.times, rms[one], **both)
        left.set_ylabel(f"{GREEK.get(state, state)} ({unit})")
        left.set_ylim(_room(truth[run, :, i], *curves.values()))
        settled = case.times > min(1.0, 0.5 * fault_time)  # the start would fill the axis
        right.set(ylabel=f"RMSE ({unit})")
        right.set_ylim(0.0, _room(*(x[settled] for x in rms.values()))[1])
        for ax in (left, right):
            ax.axvline(fault_time, color="black", linestyle=":", linewidth=1)
    axes[0, 0].legend(ncols=3, loc="lower left", bbox_to_anchor=(0, 1.0))
    for ax in axes[-1]:
        ax.set_xlabel("time (s)")
    return fig


def _room(*curves):
    """Return the ends of an axis that all curves fit in, also where there is nothing to see."""
    values = np.concatenate(curves)
    values = values[np.isfinite(values)]
    low, high = (values.min(), values.max()) if len(values) else (0.0, 0.0)
    margin = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    return low - margin, high + margin


# ---------------------------------------------------------------- beyond the paper


def divergence(cases: dict[str, tuple[np.ndarray, ...]]) -> Figure:
    """Draw the optimal filter's RMSE of ψ; `cases` maps a label to (times, rmse)."""
    fig, ax = plt.subplots()
    for label, (times, rms) in cases.items():
        ax.plot(times, rms, label=label)
    ax.set(xlabel="time (s)", ylabel="RMSE of ψ (rad)", yscale="log")
    ax.legend()
    return fig


def detection(curves: dict[str, Detection]) -> Figure:
    """Draw the mean delay to the first alarm against the rate of false alarms."""
    fig, ax = plt.subplots(figsize=(6.8, 4.2))
    for k, (fault, curve) in enumerate(curves.items()):
        label = "no fault (chance)" if fault == "none" else fault
        ax.loglog(curve.alphas, curve.delay, marker=plots.MARKERS[k], markersize=4, label=label)
    ax.set(xlabel="false alarms per sample, α", ylabel="mean delay to the first alarm (s)")
    ax.legend(ncols=2)
    return fig


def win_shares(series: Mapping[str, Mapping[str, Sequence[tuple[str, Estimate]]]]) -> Figure:
    """Draw the share of random settings that a filter wins, in bins, with 95 % intervals.

    Parameters
    ----------
    series : mapping
        Pair of filters -> result of `beyond.binned_shares`: criterion -> (bin, share).
    """
    first = next(iter(series.values()))
    fig, axes = plt.subplots(2, 3, figsize=(9.4, 5.6), sharey=True)
    for ax, criterion in zip(axes.flat, first, strict=False):
        for k, (pair, table) in enumerate(series.items()):
            _bars(ax, table[criterion], k, len(series), pair)
        ax.axhline(0.5, color="0.4", linewidth=1, linestyle="--")
        labels = [label for label, _ in first[criterion]]
        ax.set_xticks(range(len(labels)), labels)
        ax.set(xlabel=criterion, ylim=(0, 1), xlim=(-0.6, len(labels) - 0.4))
        ax.grid(visible=False, axis="x")
    for ax in axes[:, 0]:
        ax.set_ylabel("share won")
    for ax in axes.flat[len(first) :]:
        ax.axis("off")
    axes[0, 0].legend(ncols=2, loc="lower left", bbox_to_anchor=(0, 1.0))
    return fig


def _bars(ax: Axes, rows: Sequence[tuple[str, Estimate]], k: int, count: int, label: str) -> None:
    """Draw shares with their intervals, the `k`-th of `count` series, a little apart."""
    x = np.arange(len(rows)) + 0.22 * (k - (count - 1) / 2)
    value, low, high = np.array([(e.value, e.low, e.high) for _, e in rows]).T
    ax.errorbar(
        x, value, (value - low, high - value), linestyle="none", marker="so^"[k], markersize=5,
        color=("black", "#0072b2", "#d55e00")[k], capsize=3, label=label,
        markerfacecolor=("black", "white", "0.6")[k],
    )  # fmt: skip


def window_effect(
    windows: Sequence[int], effect: Mapping[tuple[str, str], Sequence[Estimate]]
) -> Figure:
    """Draw the ratio to the optimal filter over the window, one panel per setting."""
    settings = list(dict.fromkeys(setting for _, setting in effect))
    fig, axes = plt.subplots(1, len(settings), figsize=(8.6, 3.6))
    for ax, setting in zip(np.atleast_1d(axes), settings, strict=True):
        for method, short in (("single", "SFF"), ("multiple", "MFF")):
            plots.band(ax, windows, effect[method, setting], short, **style(short))
        ax.set(xlabel="window μ (steps)", title=setting)
        plots.plain_logarithmic(ax, x=True)
    first = np.atleast_1d(axes)[0]
    first.set_ylabel("RMSE after the fault over the OKF's")
    first.legend()
    return fig


def consistency(
    case: Problem, outcomes: dict[str, Outcome], bounds: tuple[float, ...], fault_time: float
) -> Figure:
    """Draw the mean NEES over the runs of each filter, with its two-sided 95 % bounds."""
    fig, ax = plt.subplots(figsize=(6.8, 4.2))
    width = 10  # steps averaged for the eye; the bounds are those of a single step
    for name, outcome in outcomes.items():
        mean = outcome.nees.mean(axis=0)
        smooth = np.convolve(mean, np.ones(width) / width, mode="valid")
        ax.semilogy(case.times[width - 1 :], smooth, label=name, markevery=0.09, **style(name))
    ax.axhspan(*bounds, color="0.6", alpha=0.5, linewidth=0, label="95 % bounds of one step")
    ax.axvline(fault_time, color="black", linestyle=":", linewidth=1)
    ax.set(xlabel="time (s)", ylabel="mean NEES")
    ax.legend(ncols=3, loc="upper center", bbox_to_anchor=(0.5, 1.2))
    return fig


def own_log(own: Log, first: int, before: np.ndarray, limit: float) -> Figure:
    """Draw a log, its first part shaded, and β of the optimal filter on the rest."""
    fig, (top, bottom) = plt.subplots(2, 1, figsize=(7.2, 4.8), sharex=True)
    times = own.dt * np.arange(len(own.z))
    rate = own.z[:, 0 if own.z.shape[1] == 1 else 1]
    top.plot(times, np.degrees(own.rudder), label="rudder (deg)", **plots.look("other"))
    top.plot(times, np.degrees(rate), label="yaw rate (deg/s)", **plots.look("Gaussian"))
    bottom.plot(times[first + 1 :], before, label="OKF", **plots.look("optimal") | {"linewidth": 1})
    bottom.axhline(limit, color="#d55e00", linestyle="--", label="threshold")
    for ax in (top, bottom):
        ax.axvspan(times[0], times[first - 1], color="0.92")
    bottom.set(xlabel="time (s)", ylabel="β", yscale="log", ylim=(1e-3, None))
    top.legend(ncols=2, loc="lower left", bbox_to_anchor=(0, 1.0))
    bottom.legend(loc="lower left")
    return fig
