"""Paper 4: filters compared, simulated sensors, missions, sweeps."""

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial, wraps
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from seanav import montecarlo
from seanav.checks import ParameterError, integer, markov_chain, read_only
from seanav.filters import ins
from seanav.models import currents, earth, inertial
from seanav.studies.imm_sea_current.scenario import Scenario

LANES = ins.LANES  # runs per batch; fixed, so threads do not matter

KEPT = 32  # batches whose sensors are kept for the next study: 300 MB at two hours
SHARES = 4  # of the jobs: so many tasks for each batch keep all processors busy to the end


@dataclass(frozen=True)
class Filter:
    """One EKF (one sigma) or the IMM of several.

    Attributes
    ----------
    name : str
    sigma : tuple of float
        Stationary standard deviations of the current models, m/s; empty: no aiding.
    form : str
        Fading form, see `seanav.filters.fading.FORMS`.
    transition, initial_probabilities : tuple
        Of the IMM; None: those of the scenario.
    correlation_time_s : float
        Of the current model; None: that of the scenario.
    about : str
        Where H is linearised, see `seanav.filters.ins.fly`.
    """

    name: str
    sigma: tuple = ()
    form: str = "none"
    transition: tuple | None = None
    initial_probabilities: tuple | None = None
    correlation_time_s: float | None = None
    about: str = "estimate"


PURE = Filter("pure navigation")


def label(sigma: tuple[float, ...]) -> str:
    """Return sigmas as they appear in names, such as ``0.1,0.5``."""
    return ",".join(f"{value:.15g}" for value in sigma)


def optimal(sigma: float) -> Filter:
    """Return the EKF whose current model is the true one."""
    return Filter("optimal EKF", (sigma,))


def EKF(*sigma: Any) -> Filter:
    """Return the EKF (one sigma) or the IMM of EKFs (several)."""
    return Filter(("IMM-EKF " if len(sigma) > 1 else "EKF ") + label(sigma), sigma)


def AFEKF(scenario: Scenario, *sigma: Any) -> Filter:
    """Return the adaptive fading EKF (one sigma) or the IMM of such (several)."""
    name = ("IMM-AFEKF " if len(sigma) > 1 else "AFEKF ") + label(sigma)
    return Filter(name, sigma, scenario.fading_form)


def pairs(scenario: Scenario) -> list:
    """Return the sigmas of the paper's IMMs: the first of `sigma_filter` with each other one."""
    first, *others = scenario.sigma_filter
    return [(first, other) for other in others]


def paper_filters(scenario: Scenario) -> list[Filter]:
    """Return all filters of figures 3 to 6 but the optimal one, and the IMM of plain EKFs."""
    singles = [make for s in scenario.sigma_filter for make in (EKF(s), AFEKF(scenario, s))]
    both = [make for pair in pairs(scenario) for make in (AFEKF(scenario, *pair), EKF(*pair))]
    return [*singles, *both]


# ---------------------------------------------------------------- simulated sensors


@dataclass(frozen=True, eq=False)
class Sensors:
    """What one batch of runs senses; the current and the log in units of sigma.

    Attributes
    ----------
    runs : int
        The first lanes are runs, the others repeat the first one and count nowhere. The
        arrays are shared by all who ask for the batch, and read-only.
    theta, dv : ndarray (steps, 3, LANES)
    unit_current : ndarray (steps + 1, 3, LANES)
    log_noise : ndarray (steps, axes, LANES)
    errors0 : ndarray (16, LANES)
        In standard deviations.
    bias : ndarray (6, LANES)
    """

    runs: int
    theta: np.ndarray
    dv: np.ndarray
    unit_current: np.ndarray
    log_noise: np.ndarray
    errors0: np.ndarray
    bias: np.ndarray

    def __post_init__(self):
        integer("runs", self.runs, at_least=1, at_most=LANES)
        read_only(*list(vars(self).values())[1:])


def _kept(function):
    """Keep what `function` made of the first batches, and make it once for all threads.

    The last argument is the number of the batch. Of many batches those beyond `KEPT` are
    made again by each study: keeping the latest ones instead would lose every one of them
    before it is met again.
    """
    gate = threading.Lock()

    @lru_cache(maxsize=KEPT)
    def place(*_):
        return threading.Lock(), []

    @wraps(function)
    def once(*arguments):
        if arguments[-1] >= KEPT:
            return function(*arguments)
        with gate:
            own, made = place(*arguments)
        with own:
            if not made:
                made.append(function(*arguments))
            return made[0]

    return once


def sense(scenario: Scenario, batch: int) -> Sensors:
    """Simulate the sensors of runs batch · LANES … of the scenario; the last may be fewer."""
    return _sense(
        scenario.path(),
        scenario.sensor_errors,
        scenario.correlation_time_s,
        scenario.log_axes,
        scenario.initial_current,
        scenario.initial_errors,
        scenario.seed,
        min(LANES, scenario.runs - batch * LANES),
        batch,
    )


@_kept
def _sense_inertial(path, errors, seed, runs, batch):
    steps = int(path.duration)
    theta, dv = np.empty((steps, 3, LANES)), np.empty((steps, 3, LANES))
    bias = np.empty((6, LANES))
    scale = np.repeat([errors.accelerometer_bias, errors.gyro_bias], 3)
    noises = montecarlo.streams(seed, "inertial noise", runs, first=batch * LANES)
    biases = montecarlo.streams(seed, "bias", runs, first=batch * LANES)
    for lane, (noise, draw) in enumerate(zip(noises, biases, strict=True)):
        bias[:, lane] = scale * draw.standard_normal(6)
        theta[..., lane], dv[..., lane] = inertial.sensor_increments(
            path, errors, noise, bias[:, lane]
        )
    for array in (theta, dv, bias):
        array[..., runs:] = array[..., :1]  # idle lanes repeat the first run
    return theta, dv, bias


@_kept
def _sense(path, errors, correlation_time, axes, start, initial, seed, runs, batch):
    theta, dv, bias = _sense_inertial(path, errors, seed, runs, batch)
    steps = int(path.duration)
    noise, log_noise = np.empty((steps, 3, LANES)), np.empty((steps, axes, LANES))
    unit0, errors0 = np.zeros((3, LANES)), np.zeros((16, LANES))
    kinds = [
        montecarlo.streams(seed, kind, runs, first=batch * LANES)
        for kind in ("current", "log noise", "initial errors")
    ]
    for lane, (flow, log, first) in enumerate(zip(*kinds, strict=True)):
        draw = flow.standard_normal(3)
        if start == "stationary":
            unit0[:, lane] = draw
        noise[..., lane] = flow.standard_normal((steps, 3))
        log_noise[..., lane] = log.standard_normal((steps, 3))[:, :axes]
        if initial == "drawn":
            errors0[:7, lane] = first.standard_normal(7)
    for array in (noise, log_noise, errors0, unit0):
        array[..., runs:] = array[..., :1]
    unit = currents.gauss_markov(noise, unit0, 1.0, correlation_time)
    return Sensors(runs, theta, dv, unit, log_noise, errors0, bias)


@lru_cache(maxsize=4)
def _truth(path):
    latitude, longitude, v_n, heading = path.states()
    R_n, R_t = earth.radii(latitude)
    columns = [latitude, longitude, v_n[:, 0], v_n[:, 1], np.cos(heading / 2)]
    columns += [np.zeros_like(latitude)] * 2
    columns += [np.sin(heading / 2), R_n, R_t * np.cos(latitude)]
    (truth,) = read_only(np.ascontiguousarray(np.stack(columns, axis=1)))
    return truth


# ---------------------------------------------------------------- missions


def fly(
    scenario: Scenario, sensors: Sensors, filter_: Filter, sigma_true: ArrayLike, *, stride: int = 0
) -> ins.Flight:
    """Fly one batch with one filter.

    Parameters
    ----------
    sigma_true : float or (steps,)
        True standard deviation of the current, m/s. A sequence changes during the
        mission: the current then is sigma_true times the unit process.
    sensors : Sensors
        As many lanes are flown for the result as they have runs.
    stride : int
        Record errors and NEES every so many seconds; 0: not at all.
    """
    path = scenario.path()
    truth, C_bn = _truth(path), path.C_bn()[1:]
    v_n = path.states()[2][1:]
    steps = len(v_n)
    sigma = np.broadcast_to(np.asarray(sigma_true, dtype=float), (steps,))
    current = sensors.unit_current[1:] * sigma[:, None, None]
    relative = v_n[:, :, None] - current
    axes = sensors.log_noise.shape[1]
    z = np.einsum("kia,kir->kar", C_bn[:, :, :axes], relative)
    z = z + scenario.log_noise * sensors.log_noise

    std = scenario.initial_std()
    x0 = np.zeros((ins.NOMINAL, LANES))
    x0[:8] = _start(path)[:, None]
    e0 = np.zeros((ins.N, LANES))
    e0[:13] = std[:, None] * sensors.errors0[:13]
    x0 = ins.shift(x0, e0)

    models = filter_.sigma or (1.0,)
    a, q = currents.decay(1.0, filter_.correlation_time_s or scenario.correlation_time_s)
    P0 = [ins.pack_diagonal(np.r_[std**2, [s**2] * 3]) for s in models]
    errors = scenario.sensor_errors
    T, mu0 = _chain(scenario, filter_, len(models))
    rest = None
    if stride:
        bias = np.broadcast_to(sensors.bias, (steps // stride, 6, LANES))
        rest = np.concatenate([bias, current[stride - 1 :: stride]], axis=1)
    flight = ins.fly(
        sensors.theta,
        sensors.dv,
        z,
        truth[1:],
        x0,
        np.array(P0),
        height=0.0,
        R=scenario.log_noise**2,
        noise=[(a, q * s**2) for s in models],
        forms=[filter_.form] * len(models),
        velocity_noise=errors.accelerometer_noise**2,
        attitude_noise=errors.gyro_noise**2,
        transition=T,
        mu0=mu0,
        window=scenario.fading_window,
        cap=scenario.fading_cap,
        aided=bool(filter_.sigma),
        about=filter_.about,
        stride=stride,
        true_rest=rest,
    )
    return flight.runs(sensors.runs)


def _chain(scenario, filter_, models):
    # One model needs no chain; several take the scenario's unless they bring their own.
    if models == 1:
        return ((1.0,),), (1.0,)
    own = scenario if filter_.transition is None else filter_
    T, mu0 = markov_chain(own.transition, own.initial_probabilities)
    if len(mu0) != models:
        allowed = f"must fit the {models} models of {filter_.name}"
        raise ParameterError("initial_probabilities", mu0, allowed)
    return T, mu0


def _start(path):
    latitude, longitude, v_n, heading = (states[0] for states in path.states())
    half = 0.5 * heading
    return np.array([latitude, longitude, v_n[0], v_n[1], np.cos(half), 0.0, 0.0, np.sin(half)])


def fly_all(
    scenario: Scenario,
    jobs: list,
    *,
    stride: int = 0,
    series: bool = True,
    first: int = 0,
    threads: int | None = None,
    label: str | None = None,
) -> Sequence:
    """Fly jobs over all runs of the scenario, each run with the same noise in every job.

    Parameters
    ----------
    jobs : list of (Filter, sigma_true)
    stride : int
        As in `fly`.
    series : bool
        False: of the records only their means are kept, so that memory does not fill.
    first : int
        Batches of `LANES` runs that are left out, because they were flown before.

    Returns
    -------
    list of seanav.filters.ins.Flight
        One per job, without covariances: those of all runs would fill the memory.
    """
    scenario.path().increments()  # prepared once, before the threads share it
    batches = -(-scenario.runs // LANES)
    # Few batches: their sensors are kept, and shares of the jobs are tasks of their own. Many:
    # a task is all that is to be done with one batch, which is sensed for it and forgotten.
    count = min(SHARES if batches <= KEPT else 1, len(jobs))
    shares = [range(len(jobs))[k::count] for k in range(count)]
    tasks = [(share, batch) for share in shares for batch in range(first, batches)]
    one = partial(_share, scenario, jobs, stride, series)
    done = montecarlo.parallel_map(one, tasks, threads=threads, label=label)
    found = [[] for _ in jobs]
    for (share, _), flights in zip(tasks, done, strict=True):
        for job, flight in zip(share, flights, strict=True):
            found[job].append(flight)
    return [ins.Flight.join(flights) for flights in found]


def _share(scenario, jobs, stride, series, task):
    share, batch = task
    sensors = sense(scenario, batch)
    flights = [fly(scenario, sensors, *jobs[k], stride=stride) for k in share]
    # Copies: a view would keep what it is cut from.
    flights = [flight._replace(P=flight.P[:, :0].copy()) for flight in flights]
    return flights if series else [flight.without_series() for flight in flights]


def sweep(
    scenario: Scenario,
    filters: Sequence | None = None,
    sigma_true: tuple[float, ...] | None = None,
    *,
    known: dict[str, list[ins.Flight]] | None = None,
    **options: Any,
) -> dict[str, list[ins.Flight]]:
    """Fly filters on a grid of true sigmas, with the optimal EKF and pure navigation.

    Parameters
    ----------
    filters : list of Filter
        Default: those of the paper.
    sigma_true : sequence of float
        Default: the grid of the scenario.
    known : dict
        Results of an earlier sweep of this scenario over its own grid; what it holds is
        not flown again.
    options
        Of `fly_all`.

    Returns
    -------
    dict
        {filter name: [Flight for each true sigma]}; pure navigation does not depend on
        it and is flown once.
    """
    filters = paper_filters(scenario) if filters is None else list(filters)
    grid = scenario.sigma_true if sigma_true is None else tuple(sigma_true)
    if known is not None:
        at = [scenario.sigma_true.index(sigma) for sigma in grid]
        results = {name: [missions[k] for k in at] for name, missions in known.items()}
        jobs = [(one, sigma) for sigma in grid for one in filters if one.name not in known]
    else:
        results, jobs = {}, [(PURE, grid[0])]
        for sigma in grid:
            jobs += [(optimal(sigma), sigma), *((one, sigma) for one in filters)]
    flights = fly_all(scenario, jobs, series=False, **options)
    for (filter_, _), mission in zip(jobs, flights, strict=True):
        results.setdefault(filter_.name, []).append(mission)
    if known is None:
        results[PURE.name] *= len(grid)
    return results
