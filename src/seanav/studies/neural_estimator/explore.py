"""Paper 2, to explore: a ship that turns, its filters between KF and GLS, and a frozen network."""

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from seanav import plots
from seanav.studies.neural_estimator import figures, run
from seanav.studies.neural_estimator.scenario import STEP, Scenario

# So few that a slider answers at once; the teaching has long come to rest by its last epoch.
RUNS, EPOCHS = 32, 100


def voyage(
    w1: float = 0.3, turn_rate_deg_s: float = 0.02
) -> tuple[Scenario, np.ndarray, dict[str, np.ndarray]]:
    """Return the scenario, the truth and the estimates of a ship that turns at a constant rate.

    It is steady while the network is taught, by the intermediate method with weight `w1`,
    and turns from the first step of the examination on.

    Returns
    -------
    scenario : Scenario
    truth : ndarray, shape (steps, 2)
        m/s, north and east.
    estimates : dict
        Name -> ndarray, shape (runs, steps, 2), m/s.
    """
    scenario = Scenario(w1=w1, runs=RUNS, max_epochs=EPOCHS)
    truth = run.turning(scenario, turn_rate_deg_s)
    z = run.measure(scenario, truth)
    teacher = run.numerical(scenario, z)
    taught = run.first_teaching(scenario, z, teacher)
    return (
        scenario,
        truth,
        {
            "unfiltered": z,
            "KF": run.numerical(scenario, z, 0.0),
            "GLS": run.numerical(scenario, z, 1.0),
            "intermediate": teacher,
            "frozen network": run.examine(scenario, z, teacher, taught),
        },
    )


def picture(w1: float = 0.3, turn_rate_deg_s: float = 0.02) -> Figure:
    """Draw one run in the east, and the error of all runs over time.

    Parameters
    ----------
    w1 : float
        Weight of the running measurement in the intermediate method, from 0 to 1.
    turn_rate_deg_s : float
        Turn rate in the examination, deg/s.
    """
    scenario, truth, estimates = voyage(w1, turn_rate_deg_s)
    time, first = STEP * np.arange(scenario.steps), scenario.examination
    fig, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.9))
    for name, x in estimates.items():
        begin = first if name == "frozen network" else 0
        error = np.sqrt(((x - truth)[:, begin:] ** 2).mean(axis=(0, 2)))
        rmse = np.sqrt(((x - truth)[:, first:] ** 2).mean())
        style = figures.KINDS[name] | {"linewidth": 1.2}
        right.plot(time[begin:], error, label=f"{name}: {rmse:.3f} m/s", **style)
        if name not in ("KF", "GLS"):
            dots = {"linestyle": "none", "marker": ".", "markersize": 3, "color": "0.6"}
            one = dots if name == "unfiltered" else style
            left.plot(time[begin:], x[0, begin:, 1], label=name, **one)
    left.plot(time, truth[:, 1], label="truth", **plots.look("truth"))
    left.set(xlabel="time (s)", ylabel="east (m/s)", title="one run")
    right.set(xlabel="time (s)", ylabel="rms error (m/s)", yscale="log")
    right.set(ylim=(0.03, 20), title=f"{RUNS} runs; the numbers: examination")
    for ax in (left, right):
        ax.axvline(STEP * first, color="0.5", linewidth=1, linestyle="-")
    fig.legend(*left.get_legend_handles_labels(), loc="outside lower left", ncols=2)
    fig.legend(*right.get_legend_handles_labels(), loc="outside lower right", ncols=2)
    fig.suptitle(f"w1 = {w1:.2f}, turn rate {turn_rate_deg_s:.3f} deg/s", fontsize=10)
    return fig
