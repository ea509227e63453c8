"""Paper 1, to explore: measurement noise and process noise of the torpedo, live."""

from typing import Any

import attrs
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from seanav import plots
from seanav.studies.ito_filter import figures, run, scores
from seanav.studies.ito_filter.scenario import COMPONENTS, Case, Scenario

SETS = {"linear velocities": (0, 1, 2), "angular velocities": (3, 4, 5)}
# Fewer and shorter missions, longer steps: a picture in well under a second.
SMALL = Scenario(
    runs=24,
    particle_runs=2,
    mission=20.0,
    torpedo_step=0.025,
    filter_step=0.1,
    map_interval=(0.5, 1.0),
)
FILTERS = ("gaussian", "ekf")
BARS: dict[str, dict[str, Any]] = {
    "gaussian": {"color": plots.KINDS["Gaussian"][0]},
    "ekf": {"color": plots.KINDS["Kalman"][0], "hatch": "///"},
}


def ratios(R: float, noise: float, measured: str = "linear velocities") -> dict[str, np.ndarray]:
    """Return RMSE over that of prediction only, and own sd over RMSE, of a small study.

    Parameters
    ----------
    R : float
        Variance of the measurement noise, (m/s)² or (rad/s)².
    noise : float
        Factor on the torpedo's diffusion; truth and filters know it.
    measured : {"linear velocities", "angular velocities"}

    Returns
    -------
    dict
        Filter -> (2, 6), a row per ratio; NaN where a filter diverged.
    """
    case = Case(1, SETS[measured], R, measured)
    truth = run.simulate(SMALL, "torpedo", noise * SMALL.noise("torpedo"))
    free = scores.score(truth, run.estimate(SMALL, truth, case, corrected=False), False)
    out = {}
    for name in FILTERS:
        one = scores.score(truth, run.estimate(SMALL, truth, case, name), False)
        error = one.squared.mean(axis=0)
        own = one.variance.mean(axis=0)
        out[name] = np.sqrt([error / free.squared.mean(axis=0), own / error])
    return out


def picture(
    log_R: float = -4.0,
    noise: float = 1.0,
    measured: str = "linear velocities",
    component: str = "r",
) -> Figure:
    """Draw one run of a component, and what all components of a few runs make of it.

    Parameters
    ----------
    log_R : float
        Decimal logarithm of the variance of the measurement noise, (m/s)² or (rad/s)².
    noise : float
        Factor on the torpedo's diffusion.
    measured : {"linear velocities", "angular velocities"}
    component : {"u", "v", "w", "p", "q", "r"}
        What the left panel shows.

    Returns
    -------
    Figure
        Left: truth, filter and prediction only. Right, per component: RMSE over that of
        prediction only, and the filter's own standard deviation over its RMSE.
    """
    case = Case(1, SETS[measured], 10.0**log_R, measured)
    diffusion = tuple(noise * SMALL.noise("torpedo"))
    history = run.history(attrs.evolve(SMALL, torpedo_noise=diffusion), "torpedo", case)
    fig, axes = plt.subplots(1, 3, figsize=(9.4, 3.4), width_ratios=(1.7, 1, 1), layout="none")
    fig.subplots_adjust(left=0.07, right=0.99, bottom=0.14, top=0.83, wspace=0.22)
    figures.draw(axes[0], history, COMPONENTS.index(component))
    axes[0].legend(ncols=3, loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.2)
    places = np.arange(6)
    for shift, (name, rows) in zip(
        (-0.2, 0.2), ratios(case.R, noise, measured).items(), strict=True
    ):
        for ax, row in zip(axes[1:], rows, strict=True):
            ax.bar(places + shift, row, width=0.38, label=figures.NAMES[name], **BARS[name])
    for ax, title in zip(axes[1:], ("RMSE / prediction only", "own sd / RMSE"), strict=True):
        ax.axhline(1, color="black", linewidth=1)
        ax.set_xticks(places, COMPONENTS)
        ax.set_title(title)
        ax.grid(False, axis="x")
    axes[1].set_ylim(0, 1.6)
    axes[1].legend(loc="upper left", ncols=1)
    return fig
