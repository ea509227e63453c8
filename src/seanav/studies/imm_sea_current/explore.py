"""Paper 4, to explore: three numbers to move, a short mission flown again in under a second."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from seanav import montecarlo
from seanav.estimates import significant
from seanav.filters.ins.score import Flight
from seanav.models import currents, inertial
from seanav.studies.imm_sea_current import beyond, figures, run, scores
from seanav.studies.imm_sea_current.scenario import Scenario

MINUTES = 20  # of the mission: one small lap
RATE = 10  # inertial samples per second: with white noise and a bias as good as 100
STRIDE = 20  # s between what is drawn
OTHER = 0.5  # m/s: what the second sub-filter of the IMM expects


def scenario() -> Scenario:
    """Return the paper's scenario, but short; its current may start anywhere."""
    return Scenario(runs=run.LANES, duration_s=60.0 * MINUTES, initial_current="stationary")


@lru_cache(maxsize=1)
def sensors() -> run.Sensors:
    """Return what the sensors of all runs feel, made once: no slider changes it."""
    one = scenario()
    steps, runs = int(one.duration_s), one.runs
    errors, path = one.sensor_errors, one.path()
    theta, dv = np.empty((steps, 3, runs)), np.empty((steps, 3, runs))
    unit, noise = np.empty((steps + 1, 3, runs)), np.empty((steps, 1, runs))
    bias = np.empty((6, runs))
    scale = np.repeat([errors.accelerometer_bias, errors.gyro_bias], 3)
    for lane, draws in enumerate(montecarlo.streams(one.seed, "explore", runs)):
        bias[:, lane] = scale * draws.standard_normal(6)
        theta[..., lane], dv[..., lane] = inertial.sensor_increments(
            path, errors, draws, bias[:, lane], rate=RATE
        )
        start, drive = draws.standard_normal(3), draws.standard_normal((steps, 3))
        unit[..., lane] = currents.gauss_markov(drive, start, 1.0, one.correlation_time_s)
        noise[..., lane] = draws.standard_normal((steps, 1))
    return run.Sensors(runs, theta, dv, unit, noise, np.zeros((16, runs)), bias)


def fly(sigma_true: float, sigma_filter: float, keep: float) -> dict[str, Flight]:
    """Fly one lap with each filter, all over the same sea and with the same sensors.

    Parameters
    ----------
    sigma_true : float
        Standard deviation of the true current, m/s.
    sigma_filter : float
        What the single filters, and the first sub-filter of the IMM, expect, m/s.
    keep : float
        Diagonal p of the transition matrix, from 0 to 1.

    Returns
    -------
    dict of name to Flight with series
    """
    one = scenario()
    pair = run.AFEKF(one, sigma_filter, OTHER)
    filters = [
        run.PURE,
        run.optimal(sigma_true),
        run.EKF(sigma_filter),
        run.AFEKF(one, sigma_filter),
        replace(beyond.with_chain(pair, keep), name=pair.name),
    ]
    return {f.name: run.fly(one, sensors(), f, sigma_true, stride=STRIDE) for f in filters}


def picture(sigma_true: float = 1.0, sigma_filter: float = 0.1, keep: float = 0.9) -> Figure:
    """Draw position errors and the IMM's belief against time.

    Parameters
    ----------
    sigma_true, sigma_filter, keep : float
        As for `fly`.

    Returns
    -------
    Figure
        Left the RMS position error over the runs (its mean over time in the legend), right
        the probability of the sub-filter that expects `sigma_filter`.
    """
    flights = fly(sigma_true, sigma_filter, keep)
    fig, (left, right) = plt.subplots(1, 2, figsize=(9.2, 3.6), width_ratios=(3, 2))
    for name, flight in flights.items():
        look = figures.style(name) | {"markevery": 6}
        rms = scores.radial_curves(flight)[0]
        t = np.arange(1, len(rms) + 1) * STRIDE / 60
        label = f"{name}: {significant(scores.position_rms(flight))} m"
        left.plot(t, rms, label=label, **look)
    left.set(xlabel="time (min)", ylabel="position RMS (m)", ylim=(0, None))
    left.set_title(rf"true current $\sigma_T$ = {sigma_true:g} m/s", fontsize=10)
    left.legend(fontsize=8)
    belief = flights[list(flights)[-1]].series.mode_probability[:, 0]
    low, high = np.quantile(belief, (0.1, 0.9), axis=1)
    right.fill_between(t, low, high, alpha=0.2, color="0.4", label="8 of 10 runs")
    right.plot(t, belief.mean(axis=1), **figures.style(name) | {"markevery": 6}, label="mean")
    right.set(xlabel="time (min)", ylabel="mode probability", ylim=(0, 1))
    right.set_title(f"sub-filter with {sigma_filter:g} m/s, p = {keep:g}", fontsize=10)
    right.legend(fontsize=8)
    return fig
