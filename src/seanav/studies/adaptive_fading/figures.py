"""Paper 3: the drawings; each function returns a figure and computes nothing new."""

from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from seanav import plots
from seanav.studies.adaptive_fading.beyond import Detection, Setting
from seanav.studies.adaptive_fading.run import Outcome, Problem

GREEK = {"psi": "ψ", "theta": "θ"}


def style(name: str) -> dict[str, Any]:
    """Return the line style of a filter, the same in every figure."""
    kinds = {"OKF": "optimal", "larger Q": "Kalman", "input bias": "hybrid"}
    fading = "adaptive" if name.startswith("SFF") else "adaptive, one per state"
    style = plots.look(kinds.get(name, fading))
    # The filters as printed rest on one innovation: thinner.
    return style | {"linewidth": 0.9 if name.endswith("(1)") else 1.5, "marker": None}


def axes_of_motion() -> Figure:
    """Draw the body axes with the six motion variables."""
    fig, ax = plt.subplots(figsize=(6.4, 3.6))
    t = np.linspace(0, 2 * np.pi, 200)
    ax.fill(2.2 * np.cos(t), 0.42 * np.sin(t), color="0.88", edgecolor="black")
    rows = (
        ((3.6, 0.0), "x: surge $u$, force $X$", "roll: φ, $p$"),
        ((1.5, 1.35), "y: sway $v$, force $Y$", "pitch: θ, $q$"),
        ((0.0, -1.7), "z: heave $w$, force $Z$", "yaw: ψ, $r$"),
    )
    for (x, y), along, around in rows:
        ax.annotate("", (x, y), (0, 0), arrowprops={"arrowstyle": "-|>", "color": "black"})
        side = "left" if x > 1 else "center"
        ax.text(x + 0.1 * (x > 1), y - 0.22 * (x == 0), along, ha=side, va="center")
        ax.text(x + 0.1 * (x > 1), y - 0.3 - 0.22 * (x == 0), around, ha=side, va="center")
    for x, y in ((-2.0, 0.0),):
        ax.plot([x, x - 0.45], [y, y + 0.35], color="black")
        ax.plot([x, x - 0.45], [y, y - 0.35], color="black")
        ax.text(x - 0.55, y, "fins: rudder $δ_r$,\nstern planes $δ_s$", ha="right", va="center")
    ax.set(xlim=(-4.6, 6.0), ylim=(-2.5, 1.8), aspect="equal")
    ax.axis("off")
    return fig


def statistic(
    case: Problem, outcome: Outcome, limit: float, fault_time: float, run: int = 0
) -> Figure:
    """Draw β of one run before and after adaptation against its threshold."""
    fig, ax = plt.subplots(figsize=(6.8, 3.4))
    ax.semilogy(case.times, outcome.before[run], color="0.55", linewidth=0.8, linestyle="-",
                label="β before adaptation")  # fmt: skip
    if outcome.factors is not None:
        ax.semilogy(case.times, outcome.after[run], color="#0072b2", linewidth=0.8,
                    linestyle="-", label="β after adaptation")  # fmt: skip
    ax.axhline(limit, color="#d55e00", linestyle="--", label="threshold")
    ax.axvline(fault_time, color="black", linestyle=":", linewidth=1)
    ax.set(xlabel="time (s)", ylabel="β", ylim=(1e-2, None))
    ax.legend(ncols=3, loc="upper center", bbox_to_anchor=(0.5, 1.16))
    return fig


def estimates(
    case: Problem, truth: np.ndarray, outcome: Outcome, fault_time: float, run: int = 0
) -> Figure:
    """Draw true and estimated states of one run, and the RMSE over all runs beside them."""
    n = len(case.states)
    fig, axes = plt.subplots(n, 2, figsize=(8.6, 1.75 * n), sharex=True, width_ratios=(2, 1.3))
    for i, (state, unit) in enumerate(zip(case.states, case.units, strict=True)):
        left, right = axes[i]
        left.plot(case.times, truth[run, :, i], color="black", linewidth=1, label="true")
        estimate = truth[run, :, i] + outcome.errors[run, :, i]
        left.plot(case.times, estimate, "--", color="#d55e00", linewidth=1, label="estimated")
        left.set_ylabel(f"{GREEK.get(state, state)} ({unit})")
        rms = np.sqrt((outcome.errors[:, :, i] ** 2).mean(axis=0))
        right.plot(case.times, rms, color="#0072b2", linewidth=1, linestyle="-")
        right.set(ylabel=f"RMSE ({unit})", ylim=(0, None))
        for ax in (left, right):
            ax.axvline(fault_time, color="black", linestyle=":", linewidth=1)
    axes[0, 0].legend(ncols=2, loc="lower left", bbox_to_anchor=(0, 1.0))
    for ax in axes[-1]:
        ax.set_xlabel("time (s)")
    return fig


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
    for fault, curve in curves.items():
        label = "no fault (chance)" if fault == "none" else fault
        ax.loglog(curve.alphas, curve.delay, marker="o", markersize=3, label=label)
    ax.set(xlabel="false alarms per sample, α", ylabel="mean delay to the first alarm (s)")
    ax.legend(ncols=2)
    return fig


def _clear(setting):
    return not setting.ratios["MFF", "SFF"].low <= 1 <= setting.ratios["MFF", "SFF"].high


def _point(setting):
    """Return mean noise ratio, spread of Q, window (moved a little apart) and the result."""
    noise = np.log10(setting.R).mean() - np.log10(setting.Q).mean()
    spread = np.log10(max(setting.Q) / min(setting.Q))
    window = setting.window * (1 + 0.25 * ((spread * 7.3) % 1 - 0.5))
    return noise, spread, window, np.clip(np.log2(setting.ratios["MFF", "SFF"].value), -1, 1)


def sweep_map(settings: list[Setting]) -> Figure:
    """Draw where MFF beats SFF at equal windows, over noise ratio and window."""
    fig, axes = plt.subplots(1, 2, figsize=(9.4, 4.2), sharey=True)
    faults = sorted({s.fault for s in settings})
    markers = dict(zip(faults, "osv^D", strict=False))
    for fault in faults:
        for clear in (False, True):
            points = [_point(s) for s in settings if s.fault == fault and _clear(s) == clear]
            if not points:
                continue
            noise, spread, window, log = np.array(points).T
            for ax, x in zip(axes, (noise, spread), strict=True):
                dots = ax.scatter(
                    x,
                    window,
                    c=log,
                    cmap="PuOr_r",
                    vmin=-1,
                    vmax=1,
                    marker=markers[fault],
                    s=34 if clear else 12,
                    edgecolor="black",
                    linewidth=0.5,
                )
    axes[0].set(xlabel="log₁₀ of mean R / mean Q (geometric)", ylabel="window μ", yscale="log")
    axes[1].set_xlabel("log₁₀ of largest Q / smallest Q")
    fig.colorbar(dots, ax=axes, label="log₂ of RMSE of MFF / SFF (negative: MFF better)")
    handles = [
        Line2D([], [], marker=m, linestyle="", color="0.5", markeredgecolor="black", label=f)
        for f, m in markers.items()
    ]
    axes[1].legend(handles=handles, loc="upper left", bbox_to_anchor=(0, 1.12), ncols=5)
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
        ax.semilogy(case.times[width - 1 :], smooth, label=name, **style(name))
    ax.axhspan(*bounds, color="0.6", alpha=0.5, linewidth=0, label="95 % bounds of one step")
    ax.axvline(fault_time, color="black", linestyle=":", linewidth=1)
    ax.set(xlabel="time (s)", ylabel="mean NEES")
    ax.legend(ncols=3, loc="upper center", bbox_to_anchor=(0.5, 1.2))
    return fig
