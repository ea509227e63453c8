"""Paper 5: plans, bounds and filters along a path, and the Monte Carlo runs along many.

The paths themselves are from `seanav.models.paths`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from seanav import estimates, montecarlo
from seanav.filters.gravity import labels, matching, pcrb, planning, point_mass
from seanav.models import gravity, paths
from seanav.models.units import KM, MGAL
from seanav.studies.gravity_planning.scenario import Scenario
from seanav.studies.gravity_planning.scores import Score

BATCH = 250  # runs per unit of parallel work; fixed, so that results do not depend on threads


def problem(
    scenario: Scenario,
    chart: gravity.GravityMap,
    start: Sequence[int],
    noise_mgal: float,
    goal: Sequence[int] | None = None,
) -> dict[str, Any]:
    """Return the keyword arguments that both planners take."""
    return {
        "gradient": gravity.gradient(chart),
        "spacing": chart.spacing,
        "start": start,
        "goal": scenario.goal if goal is None else goal,
        "noise": noise_mgal * MGAL,
        "P0": scenario.P0,
        "process_noise": scenario.Q_rate,
        "speed": scenario.speed,
    }


def plan(
    scenario: Scenario,
    chart: gravity.GravityMap,
    start: Sequence[int],
    noise_mgal: float,
    goal: Sequence[int] | None = None,
) -> planning.Plan:
    """Plan with the paper's A* for one noise level; see `seanav.filters.gravity.planning.plan`."""
    return planning.plan(**problem(scenario, chart, start, noise_mgal, goal))


def plan_labels(
    scenario: Scenario,
    chart: gravity.GravityMap,
    start: Sequence[int],
    noise_mgal: float,
    goal: Sequence[int] | None = None,
    **options: Any,
) -> labels.LabelPlan:
    """Plan with the multi-label search; see `seanav.filters.gravity.labels.plan_labels`."""
    return labels.plan_labels(**problem(scenario, chart, start, noise_mgal, goal), **options)


def fan(
    chart: gravity.GravityMap,
    start: Sequence[int],
    goal: Sequence[int],
    amplitudes_km: Sequence[float],
    samples: int,
) -> tuple[dict[str, np.ndarray], int]:
    """Return the direct path and the bows that stay on the map, and how many did not.

    Parameters
    ----------
    start, goal : (2,) array_like
        Nodes (east, north).
    amplitudes_km : sequence of float
        Left to right; they are named L3, L4, … as in the paper.

    Returns
    -------
    dict of str to (samples, 2) ndarray in m, int
    """
    ends = np.asarray(start) * chart.spacing, np.asarray(goal) * chart.spacing
    fanned = {"Direct": paths.bow(*ends, 0.0, samples)}
    for number, amplitude in enumerate(amplitudes_km, start=3):
        curve = paths.bow(*ends, amplitude * KM, samples)
        if paths.inside(curve, chart.extent):
            fanned[f"L{number}"] = curve
    return fanned, len(amplitudes_km) + 1 - len(fanned)


def nearest(sailed: dict[str, np.ndarray], count: int) -> list[str]:
    """Return the names of the `count` bows nearest to the planned path, nearest first."""

    def gap(name):
        steps = sailed["Planned"][:, None] - sailed[name][None]
        return np.hypot(steps[..., 0], steps[..., 1]).min(axis=1).mean()

    bows = [name for name in sailed if name not in ("Planned", "Direct")]
    return sorted(bows, key=gap)[:count]


def plan_path(
    result: labels.LabelPlan | planning.Plan, chart: gravity.GravityMap, samples: int
) -> np.ndarray:
    """Return the planned nodes as `samples` equidistant points in m."""
    return paths.resample(result.nodes * chart.spacing, samples)


@dataclass(frozen=True)
class Noise:
    """Common random numbers of all paths, noise levels and filters; unit variance."""

    initial: np.ndarray  # (runs, 2), its moments over the runs are the nominal ones
    drift: np.ndarray  # (runs, samples, 2)
    measurement: np.ndarray  # (runs, samples)


def matched(drawn: np.ndarray) -> np.ndarray:
    """Return random numbers whose sample mean is 0 and whose sample covariance is 1.

    Moment matching. With hardly any process noise the filter's error is, as long as the map
    is a plane, P(t) P(0)⁻¹ times the initial error and a part due to the readings. So a mean
    square of the initial errors that is by chance 1 + s times the nominal one makes the first
    part's too 1 + s times as large, in every path at once; and a bias where there is none.
    Matched, the first part is exactly what its expectation is.

    Parameters
    ----------
    drawn : ndarray, shape (runs, 2)
        Standard normal numbers, at least three runs.

    Returns
    -------
    ndarray, shape (runs, 2)
    """
    centred = drawn - drawn.mean(axis=0)
    factor = np.linalg.cholesky(centred.T @ centred / len(centred))
    return np.linalg.solve(factor, centred.T).T


def drawn_initial(scenario: Scenario) -> np.ndarray:
    """Return the initial errors (runs, 2) as drawn, of unit variance, before `matched`."""
    return montecarlo.normals(scenario.seed, "initial error", scenario.runs, (2,))


def draw(scenario: Scenario) -> Noise:
    """Draw the random numbers of a scenario, one stream per run and purpose.

    The moments of the initial errors are `matched`, over all runs.
    """
    seed, runs, samples = scenario.seed, scenario.runs, scenario.samples
    return Noise(
        matched(drawn_initial(scenario)),
        montecarlo.normals(seed, "drift", runs, (samples, 2)),
        montecarlo.normals(seed, "measurement", runs, (samples,)),
    )


def Q_step(scenario: Scenario, points: np.ndarray) -> np.ndarray:
    """Return the process noise between two samples of a path, (2, 2) m²."""
    seconds = paths.length(points) / (len(points) - 1) / scenario.speed
    return np.eye(2) * scenario.Q_rate * seconds


def bound(
    scenario: Scenario, chart: gravity.GravityMap, points: np.ndarray, noise_mgal: float
) -> np.ndarray:
    """Return the PCRB along a path (samples, 2), linearised at the truth: (samples, 2, 2) m²."""
    slopes = gravity.interpolate(gravity.gradient(chart), chart.spacing, points)
    return pcrb.pcrb(slopes, noise_mgal * MGAL, scenario.P0, Q_step(scenario, points))


def expected_bound(
    scenario: Scenario,
    chart: gravity.GravityMap,
    points: np.ndarray,
    noise_mgal: float,
    nodes: int = 7,
) -> np.ndarray:
    """Return the PCRB with the information averaged over the prior: (samples, 2, 2) m².

    The expectation is over the truth, which lies around the planned path as the INS error
    does, by Gauss-Hermite quadrature with `nodes` points per axis.
    """
    offsets, weights = np.polynomial.hermite_e.hermegauss(nodes)
    shifts = np.stack(np.meshgrid(offsets, offsets), axis=-1).reshape(-1, 2)
    truths = points + scenario.initial_std_km * KM * shifts[:, None]
    slopes = gravity.interpolate(gravity.gradient(chart), chart.spacing, truths)
    # The mean of w·HHᵀ with weights that sum to one is the plain mean of scaled gradients.
    share = np.outer(weights, weights).ravel() / weights.sum() ** 2
    slopes *= np.sqrt(share * len(share))[:, None, None]
    Q = Q_step(scenario, points)
    return pcrb.expected_pcrb(slopes, noise_mgal * MGAL, scenario.P0, Q)


def root_trace(P: np.ndarray) -> np.ndarray:
    """Return the root of the trace of covariances (…, 2, 2): the two-dimensional RMSE."""
    return np.sqrt(np.trace(P, axis1=-2, axis2=-1))


def filter_inputs(
    scenario: Scenario,
    chart: gravity.GravityMap,
    noise: Noise,
    points: np.ndarray,
    noise_mgal: float,
    assumed_mgal: float | None = None,
) -> tuple:
    """Return the positional arguments that every matching filter takes."""
    Q = Q_step(scenario, points)
    return (
        chart.anomaly,
        chart.spacing,
        points,
        noise.initial * scenario.initial_std_km * KM,
        noise.drift * np.sqrt(Q[0, 0]),
        noise.measurement * noise_mgal * MGAL,
        ((assumed_mgal or noise_mgal) * MGAL) ** 2,
        scenario.P0,
        Q,
    )


def run(
    scenario: Scenario,
    chart: gravity.GravityMap,
    noise: Noise,
    points: np.ndarray,
    noise_mgal: float,
    *,
    method: str = "sitan",
    assumed_mgal: float | None = None,
) -> Score:
    """Run one filter along one path on every row of `noise`.

    Parameters
    ----------
    points : (samples, 2) ndarray
        True positions, m.
    method : {"sitan", "ekf", "point mass"}
    assumed_mgal : float, optional
        The noise the filter believes in; the true one by default.

    Returns
    -------
    Score
    """
    inputs = filter_inputs(scenario, chart, noise, points, noise_mgal, assumed_mgal)
    if method == "point mass":
        # A tenth of the prior's deviation, 100 m at most, and no less than the drift needs.
        cell = max(min(100.0, 0.1 * scenario.initial_std_km * KM), 1.01 * np.sqrt(inputs[-1][0, 0]))
        errors = point_mass.point_mass(*inputs, cell=cell)[0]
    else:
        slope = {"sitan": "block", "ekf": "point"}[method]
        sigmas = scenario.window_sigmas
        errors = matching.sitan(*inputs, gradient=slope, window_sigmas=sigmas).errors
    limit = root_trace(bound(scenario, chart, points, noise_mgal))
    return Score((errors**2).sum(axis=2), limit, paths.length(points), noise.initial)


def run_all(
    scenario: Scenario,
    chart: gravity.GravityMap,
    noise: Noise,
    sailed: dict[str, np.ndarray],
    noises_mgal: Sequence,
    **options: Any,
) -> dict[str, list[Score]]:
    """Run every path at every noise level in parallel: {name: [Score, …]}."""
    batches = [
        Noise(*(part[begin : begin + BATCH] for part in vars(noise).values()))
        for begin in range(0, len(noise.initial), BATCH)
    ]
    jobs = [(name, level, rows) for name in sailed for level in noises_mgal for rows in batches]
    parts = montecarlo.parallel_map(
        lambda job: run(scenario, chart, job[2], sailed[job[0]], job[1], **options),
        jobs,
        label="Monte Carlo",
    )
    whole = [
        replace(
            group[0],
            squared=np.concatenate([part.squared for part in group]),
            initial=noise.initial,
        )
        for group in (parts[i : i + len(batches)] for i in range(0, len(parts), len(batches)))
    ]
    count = len(noises_mgal)
    return {name: whole[i * count : (i + 1) * count] for i, name in enumerate(sailed)}


def plane_check(scenario: Scenario, noise: Noise) -> tuple[estimates.Estimate, ...]:
    """Return how the filter compares with the bound at the end of a path on a plane map.

    On a plane SITAN's fit is exact, so it is the Kalman filter of a linear Gaussian problem.

    Returns
    -------
    covariance : Estimate
        Largest difference of the filter's own covariance from the PCRB, in parts of the
        PCRB's trace; it depends on no random number.
    errors : Estimate
        The mean squared error in the metric of the PCRB, half of the normalised squared
        error (NEES / 2): one if the bound is reached along both axes, the one that the
        plane shows and the one that it does not.
    """
    nodes = np.arange(121.0) * KM
    plane = 1e-8 * nodes[None, :] + 2e-8 * nodes[:, None]
    chart = gravity.GravityMap(plane, KM, "plane", "analytic")
    points = paths.resample(np.array([[40e3, 40e3], [80e3, 60e3]]), scenario.samples)
    inputs = filter_inputs(scenario, chart, noise, points, scenario.planning_noise_mgal)
    tracks = matching.sitan(*inputs)
    P = bound(scenario, chart, points, scenario.planning_noise_mgal)[-1]
    ee, en, nn = tracks.P[0, -1]
    apart = np.abs(np.array([[ee, en], [en, nn]]) - P).max() / np.trace(P)
    last = tracks.errors[:, -1]
    squared = np.einsum("ri,ij,rj->r", last, np.linalg.inv(P), last)
    return estimates.exact(apart, estimates.ROUNDING), estimates.mean(squared / 2)
