"""Paper 3: a small Monte Carlo behind the sliders of the notebook."""

from typing import NamedTuple

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from seanav.filters import adaptive
from seanav.studies.adaptive_fading import figures, run, scores
from seanav.studies.adaptive_fading.scenario import Scenario

RUNS = 20
BASIS = Scenario(runs=RUNS, duration=80.0, fault_time=40.0)


class Explored(NamedTuple):
    """What three filters do to one fault; the first axis of each array is the run."""

    case: run.Problem
    limit: float  # threshold of β
    errors: dict[str, np.ndarray]  # filter -> (runs, steps, n)
    before: dict[str, np.ndarray]  # filter -> (runs, steps) β before adaptation


def explored(alpha: float, window: int, lost: float) -> Explored:
    """Run the optimal filter and both fading ones through a fault of the rudder.

    Parameters
    ----------
    alpha : float
        Level of significance of the test.
    window : int
        μ, steps.
    lost : float
        Part of the rudder's effect that is lost: 0 none, 1 all of it, 2 makes a reversal.

    Returns
    -------
    Explored
        Seeded: the same noise for any values.
    """
    case = run.problem(BASIS, fault="none")
    starts = np.arange(len(case.times)) * BASIS.dt
    left = np.where(starts >= BASIS.fault_time - 1e-9, 1.0 - lost, 1.0)
    case = case._replace(actual=case.believed * left[:, None])
    truth, z = run.simulate(case, run.draw(BASIS, purpose="explore"))
    options: dict[str, dict] = {
        "OKF": {},
        "SFF": {"method": "single", "window": window},
        "MFF": {"method": "multiple", "window": window},
    }
    errors: dict[str, np.ndarray] = {}
    before: dict[str, np.ndarray] = {}
    for name, given in options.items():
        track = run.estimate(BASIS, case, z, alpha=alpha, **given)
        errors[name] = track.x - truth
        before[name] = getattr(track, "before", track.nis)
    return Explored(case, adaptive.threshold(alpha, len(case.H)), errors, before)


def picture(alpha: float = 0.05, window: int = 20, lost: float = 1.0) -> Figure:
    """Draw what the level, the window and the size of the fault do to both fading filters.

    Parameters
    ----------
    alpha : float
        Level of significance: the share of healthy samples at which the filter adapts.
    window : int
        μ, number of innovations that the factors rest on.
    lost : float
        Part of the rudder's effect that is lost.

    Returns
    -------
    Figure
        RMSE of the yaw rate over time; RMSE over the optimal filter's before and after the
        fault, and the share of samples with β, before adaptation, above its threshold.
    """
    case, limit, errors, before = explored(alpha, window, lost)
    fig, (left, middle, right) = plt.subplots(1, 3, figsize=(9.4, 3.4), width_ratios=(2, 1, 1))
    for name, error in errors.items():
        rms = np.sqrt((error[:, :, 1] ** 2).mean(axis=0))
        look = figures.style(name) | {"marker": None}
        left.plot(case.times, rms, label=name, **look)
    left.axvline(BASIS.fault_time, color="black", linestyle=":", linewidth=1)
    high = max(np.sqrt((e[:, case.times > 1, 1] ** 2).mean(axis=0)).max() for e in errors.values())
    left.set(xlabel="time (s)", ylabel="RMSE of r (rad/s)", ylim=(0, 1.05 * high))
    left.legend(ncols=3, loc="lower left", bbox_to_anchor=(0, 1.0))
    for k, (name, hatch) in enumerate((("SFF", ""), ("MFF", "///"))):
        pairs = (case.healthy, case.faulty)
        squares = [[scores.squares(errors[n], s) for n in (name, "OKF")] for s in pairs]
        place = np.arange(2) + 0.36 * (k - 0.5)
        look = {"width": 0.34, "color": "0.85", "edgecolor": "black", "hatch": hatch, "label": name}
        middle.bar(place, [scores.ratio(one, other).value for one, other in squares], **look)
        right.bar(place, [(before[name][:, s] > limit).mean() for s in pairs], **look)
    middle.axhline(1.0, color="black", linewidth=1, linestyle="-")
    middle.set_ylabel("RMSE over the OKF's")
    right.axhline(alpha, color="#d55e00", linewidth=1.2, linestyle="--", label="α")
    right.set(ylabel="share of β above its threshold", ylim=(0, 1))
    for ax in (middle, right):
        ax.set_xticks([0, 1], ["healthy", "faulty"])
        ax.legend(ncols=3, loc="lower left", bbox_to_anchor=(-0.1, 1.0), columnspacing=1.0)
    return fig
