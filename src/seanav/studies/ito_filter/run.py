"""Paper 1: truth, measurements and filters of both vehicles."""

from functools import cache

import attrs
import numpy as np

from seanav import checks, montecarlo
from seanav.filters import moments
from seanav.filters.moments import Track, continuous_discrete, particles
from seanav.models import bodies
from seanav.studies.ito_filter import scores
from seanav.studies.ito_filter.scenario import STEPS, VEHICLES, Case, Scenario
from seanav.studies.ito_filter.scores import Result

LIMIT = 1e6  # m/s and rad/s; whatever is faster has diverged
POINTS = 10  # of a drawn curve between two measurements, about
DRAWN = 400  # samples; of more than these none is drawn between the measurements
BATCH = 50  # runs per unit of parallel work; fixed, so that results do not depend on threads

# ---------------------------------------------------------------- symbols, compiled once


@cache
def body() -> moments.System:
    """Return the six-state equation in symbols, of both vehicles."""
    drift, diffusion, names = bodies.equations()
    return moments.system(bodies.STATES, drift, diffusion, bodies.INPUTS, names)


@cache
def propagator(closure: str) -> moments.Propagator:
    """Return the compiled moment equations of a closure."""
    return moments.Propagator(moments.close(body(), closure))


@cache
def simulator() -> moments.Simulator:
    """Return the compiled equation itself."""
    return moments.Simulator(body())


# ---------------------------------------------------------------- truth and measurements


@attrs.frozen(eq=False)
class Truth:
    """Simulated vehicles.

    Attributes
    ----------
    vehicle : str
    parameters : ndarray, shape (24,)
        Of the body, diffusion included: the filters know it.
    times : ndarray, shape (samples,)
    x : ndarray, shape (runs, samples, 6)
        NaN after the start in a run that is lost.
    """

    vehicle: str
    parameters: np.ndarray
    times: np.ndarray
    x: np.ndarray

    @property
    def lost(self) -> np.ndarray:
        """Whether the simulation of a run diverged, (runs,): the step is too long for it."""
        return np.isnan(self.x[:, -1, 0])


def simulate(
    scenario: Scenario,
    vehicle: str,
    noise: np.ndarray | None = None,
    keep: float | None = None,
    mission: float | None = None,
    step: str | None = None,
) -> Truth:
    """Simulate the runs of a vehicle.

    Parameters
    ----------
    scenario : Scenario
    vehicle : str
    noise : array, shape (6,), optional
        Diffusion; default: the scenario's.
    keep, mission : float, optional
        Time between the states that are kept and of all, s; default: interval and mission
        of the scenario.
    step : str, optional
        Name of the scenario's step, Euler–Maruyama; default: the vehicle's.

    Raises
    ------
    seanav.checks.ParameterError
        If the step does not divide `keep`, or `keep` the mission.
    """
    craft = bodies.BODIES[vehicle]
    noise = scenario.noise(vehicle) if noise is None else noise
    name = step or f"{vehicle}_step"
    length = getattr(scenario, name)
    mission = scenario.mission if mission is None else mission
    keep = scenario.interval if keep is None else keep
    steps = checks.parts(name, length, "mission", mission, at_most=STEPS)
    every = checks.parts(name, length, "keep", keep, at_most=STEPS)
    checks.parts("keep", keep, "mission", mission, at_most=STEPS)
    parameters = craft.parameters(noise)
    forces = craft.forces(np.arange(steps + 1) * length)
    x0, P0 = scenario.prior(vehicle)
    first = montecarlo.normals(scenario.seed, f"{vehicle} start", scenario.runs, (6,))
    starts = x0 + first @ np.sqrt(P0)
    generators = montecarlo.streams(scenario.seed, f"{vehicle} process", scenario.runs)
    move = simulator()

    def batch(chosen):
        normal = np.array([generators[r].standard_normal((steps, 6)) for r in chosen])
        return move(starts[chosen], normal, length, forces, parameters, every)

    tracks = montecarlo.parallel_map(batch, batches(scenario.runs), label=f"{vehicle}, truth")
    x = np.concatenate(tracks)
    # Written so that NaN counts as diverged. Which noise is too strong for a step, chance decides.
    x[~(np.abs(x) < LIMIT).all(axis=(1, 2)), 1:] = np.nan
    return Truth(vehicle, parameters, np.arange(x.shape[1]) * keep, x)


def batches(runs: int) -> list[list[int]]:
    """Return run numbers in lists of fixed size."""
    return [list(range(k, min(k + BATCH, runs))) for k in range(0, runs, BATCH)]


def measure(scenario: Scenario, truth: Truth, case: Case) -> np.ndarray:
    """Return the measurements of a case, (runs, samples - 1, 3); 0 in runs that are lost."""
    runs, samples = truth.x.shape[:2]
    shape = (samples - 1, 3)
    purpose = f"{truth.vehicle} measurement"
    noise = montecarlo.normals(scenario.seed, purpose, runs, shape)
    z = truth.x[:, 1:] @ case.H.T + np.sqrt(case.R) * noise
    z[truth.lost] = 0.0  # a filter takes no NaN
    return z


# ---------------------------------------------------------------- filters


def _joined(tracks, truth):
    """Return the `Track` of all batches; NaN after the start in runs that are lost."""
    arrays = [np.concatenate([getattr(t, a) for t in tracks]) for a in ("mean", "P", "nis")]
    for array in arrays:
        array[truth.lost[: len(array)], 1:] = np.nan
    return Track(*arrays)


def estimate(
    scenario: Scenario, truth: Truth, case: Case, closure: str = "gaussian", corrected: bool = True
) -> Track:
    """Run a filter on every record of a case; not `corrected`: prediction only."""
    z = measure(scenario, truth, case)
    x0, P0 = scenario.prior(truth.vehicle)
    propagate, interval = propagator(closure), truth.times[1]
    forces = bodies.BODIES[truth.vehicle].forces
    R = case.R * np.eye(3) if corrected else None

    def batch(chosen):
        return continuous_discrete.run(
            propagate, x0, P0, z[chosen], interval, scenario.filter_step, R, case.H, forces,
            truth.parameters, limit=LIMIT,
        )  # fmt: skip

    # Without corrections every run is the same: one stands for all.
    chosen = batches(scenario.runs) if corrected else [[0]]
    tracks = montecarlo.parallel_map(batch, chosen)
    return _joined(tracks if corrected else tracks * scenario.runs, truth)


def cloud(scenario: Scenario, truth: Truth, case: Case) -> Track:
    """Run the bootstrap particle filter on the first runs."""
    z = measure(scenario, truth, case)
    x0, P0 = scenario.prior(truth.vehicle)
    forces, move = bodies.BODIES[truth.vehicle].forces, simulator()
    runs = min(scenario.particle_runs, scenario.runs)
    generators = montecarlo.streams(scenario.seed, f"{truth.vehicle} particles", runs)

    def one(r):
        return particles.particle_filter(
            move, x0, P0, z[r : r + 1], truth.times[1], 2 * scenario.torpedo_step,
            case.R * np.eye(3), case.H, generators[r : r + 1], scenario.particles, forces,
            truth.parameters, limit=LIMIT,
        )  # fmt: skip

    return _joined(montecarlo.parallel_map(one, range(runs), label="particles"), truth)


# ---------------------------------------------------------------- all cases


def run_case(scenario: Scenario, truth: Truth, case: Case) -> Result:
    """Run all closures and the one-stage estimator on a case."""
    tracks = {closure: estimate(scenario, truth, case, closure) for closure in moments.CLOSURES}
    scored = {name: scores.score(truth, track) for name, track in tracks.items()}
    free = estimate(scenario, truth, case, corrected=False)
    scored["prediction only"] = scores.score(truth, free)
    return Result(truth, case, tracks["gaussian"], scored)


def run_all(scenario: Scenario, strength: float = 1.0) -> dict[tuple[str, int], Result]:
    """Return {(vehicle, case number): Result}; `strength` scales the angular noise."""
    results = {}
    for vehicle in VEHICLES:
        truth = simulate(scenario, vehicle, scenario.noise(vehicle, strength))
        for case in scenario.cases:
            results[vehicle, case.number] = run_case(scenario, truth, case)
    return results


def open_loop_limit(scenario: Scenario, truth: Truth, case: Case, R: float) -> float:
    """Return the largest difference between the filter with noise `R` and prediction only.

    In units of the open-loop standard deviation: how near the limit R → ∞ is. NaN if a
    filter diverged.
    """
    far = estimate(scenario, truth, attrs.evolve(case, R=R))
    free = estimate(scenario, truth, case, corrected=False)
    sd = np.sqrt(np.diagonal(free.P, axis1=2, axis2=3))
    return float(np.abs((far.mean - free.mean) / sd).max())


# ---------------------------------------------------------------- one run between measurements


@attrs.frozen(eq=False)
class History:
    """The first run of a case, also between the measurements: what a picture draws.

    A filter jumps at a measurement: that time stands twice in `grid`, before and after.
    NaN where the filter or the vehicle has diverged.

    Attributes
    ----------
    vehicle : str
    case : Case
    times : ndarray, shape (points,)
    x : ndarray, shape (points, 6)
        The truth.
    measured_times : ndarray, shape (samples,)
    z : ndarray, shape (samples, 3)
    grid : ndarray, shape (filter points,)
    mean, sd : ndarray, shape (filter points, 6)
        Of the Gaussian closure.
    free : ndarray, shape (filter points, 6)
        Mean of prediction only.
    """

    vehicle: str
    case: Case
    times: np.ndarray
    x: np.ndarray
    measured_times: np.ndarray
    z: np.ndarray
    grid: np.ndarray
    mean: np.ndarray
    sd: np.ndarray
    free: np.ndarray


def history(scenario: Scenario, vehicle: str, case: Case) -> History:
    """Return the first run of a case between its measurements, filtered and predicted only.

    It is the same run as the first of `run_all`: the same noise, the same measurements.
    """
    few = attrs.evolve(scenario, runs=2, particle_runs=2)
    truth = simulate(few, vehicle)
    samples, interval = len(truth.times), truth.times[1]
    step = getattr(few, f"{vehicle}_step")
    parts = _parts(round(interval / step), samples)
    fine = simulate(few, vehicle, keep=interval / parts) if parts > 1 else truth
    parts = _parts(round(interval / few.filter_step), samples)
    tracks = [estimate(few, truth, case, corrected=corrected) for corrected in (True, False)]
    (mean, variance), (free, _) = (_between(few, truth, track, parts) for track in tracks)
    grid = truth.times[:-1, None] + interval * np.arange(parts + 1) / parts
    return History(
        vehicle, case, fine.times, fine.x[0], truth.times[1:], measure(few, truth, case)[0],
        np.append(grid, truth.times[-1]), mean, np.sqrt(variance), free,
    )  # fmt: skip


def _parts(steps, samples):
    """Return into how many parts of whole steps an interval is cut for a picture."""
    most = POINTS if samples <= DRAWN else 1
    return max(part for part in range(1, min(most, steps) + 1) if steps % part == 0)


def _between(scenario, truth, track, parts):
    """Return means and variances of the first run, (samples - 1) (parts + 1) + 1 of each.

    Every interval begins at the track's estimate after a measurement and ends before the
    next one; the last number is the estimate after the last measurement.
    """
    move, forces = propagator("gaussian"), bodies.BODIES[truth.vehicle].forces
    length = truth.times[1] / parts
    steps = max(1, round(length / scenario.filter_step))
    out = np.full((2, len(truth.times) - 1, parts + 1, 6), np.nan)
    for k, begin in enumerate(truth.times[:-1]):
        mean, P = track.mean[:1, k].copy(), track.P[:1, k].copy()
        for part in range(parts + 1):
            # Written so that NaN counts as diverged.
            if not ((np.abs(mean) < LIMIT).all() and (np.abs(P) < LIMIT**2).all()):
                break
            variance = np.diagonal(P[0])
            out[:, k, part] = mean[0], np.where(variance >= 0, variance, np.nan)
            times = begin + length * (part + np.arange(2 * steps + 1) / (2 * steps))
            move(mean, P, length, length / steps, forces(times), truth.parameters)
    last = np.stack([track.mean[0, -1], np.diagonal(track.P[0, -1])])
    return np.concatenate([out.reshape(2, -1, 6), last[:, None]], axis=1)
