"""Paper 4: sea-current-relative navigation with an IMM of adaptive fading EKFs.

Cha, Hwang and Park, *The Journal of Navigation*, 2022. The scenario, the simulated
sensors, the missions. Scores and comparisons are in `seanav.studies.imm_scores`, the
linear-covariance counterpart in `seanav.studies.imm_linear`.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from seanav import checks, montecarlo
from seanav.filters import fading, ins
from seanav.models import currents, earth, inertial
from seanav.models.trajectories import KNOT, Trajectory

LANES = ins.LANES  # runs per batch; fixed, so threads do not matter
SHARES = 4  # of the jobs: so many tasks for each batch keep all processors busy to the end
G0 = 9.80665  # m/s² in one g


@dataclass(frozen=True)
class Scenario:
    """Everything that can be chosen, checked at once; units are in the names.

    Raises
    ------
    seanav.checks.ParameterError
        One line that names the parameter, its value and what is allowed.
    """

    runs: int = 100
    seed: int = 4
    duration_s: float = 7200.0
    speed_kn: float = 20.0
    latitude_deg: float = 36.0
    longitude_deg: float = 127.0
    trajectory: str = "square"
    corner_radius: float = 300.0
    sides: int = 4
    laps: int = 1
    accelerometer_bias_mg: float = 0.05
    accelerometer_noise_mg: float = 0.01  # mg/√Hz
    gyro_bias_deg_h: float = 0.02
    gyro_noise_deg_sqrt_h: float = 0.005  # °/√h
    log_noise: float = 0.01
    log_axes: int = 1
    correlation_time_s: float = 7200.0
    sigma_true: tuple = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
    sigma_filter: tuple = (0.1, 0.5, 1.0)
    initial_current: str = "zero"
    initial_errors: str = "none"
    initial_position_m: float = 1.0
    initial_velocity: float = 1e-3
    initial_tilt_rad: float = 1e-6
    initial_heading_rad: float = 1e-6
    fading_form: str = "sigma"
    fading_window: int = 20
    fading_cap: float = 10.0
    transition: tuple = ((0.9, 0.1), (0.1, 0.9))
    initial_probabilities: tuple = (0.5, 0.5)

    def __post_init__(self):
        integer, number, choice = checks.integer, checks.number, checks.choice
        integer("runs", self.runs, at_least=2)
        integer("seed", self.seed, at_least=0)
        for name in (
            "accelerometer_bias_mg",
            "accelerometer_noise_mg",
            "gyro_bias_deg_h",
            "gyro_noise_deg_sqrt_h",
            "log_noise",
            "correlation_time_s",
            "speed_kn",
            "initial_position_m",
            "initial_velocity",
            "initial_tilt_rad",
            "initial_heading_rad",
        ):
            number(name, getattr(self, name), above=0.0)
        number("latitude_deg", self.latitude_deg, at_least=-80, at_most=80)
        number("longitude_deg", self.longitude_deg, at_least=-180, at_most=360)
        choice("log_axes", self.log_axes, (1, 3))
        for name in ("sigma_true", "sigma_filter"):
            values = _sequence(name, getattr(self, name))
            values = tuple(number(name, value, above=0.0) for value in values)
            object.__setattr__(self, name, values)
        choice("initial_current", self.initial_current, ("zero", "stationary"))
        choice("initial_errors", self.initial_errors, ("none", "drawn"))
        choice("fading_form", self.fading_form, fading.FORMS)
        integer("fading_window", self.fading_window, at_least=2)
        number("fading_cap", self.fading_cap, at_least=1.0)
        T, mu = check_chain(self.transition, self.initial_probabilities)
        object.__setattr__(self, "transition", T)
        object.__setattr__(self, "initial_probabilities", mu)
        self.path()  # checks duration, trajectory and corner_radius

    def quick(self):
        """Return the scenario with a tenth of the runs."""
        return replace(self, runs=max(2, self.runs // 10))

    def path(self):
        """Return the trajectory, prepared once."""
        return _path(
            self.trajectory,
            self.duration_s,
            self.speed_kn,
            self.latitude_deg,
            self.longitude_deg,
            self.corner_radius,
            self.sides,
            self.laps,
        )

    @property
    def sensor_errors(self):
        """Table 1 in SI units."""
        return inertial.SensorErrors(
            self.accelerometer_bias_mg * 1e-3 * G0,
            math.radians(self.gyro_bias_deg_h) / 3600,
            self.accelerometer_noise_mg * 1e-3 * G0,
            math.radians(self.gyro_noise_deg_sqrt_h) / 60,
        )

    def initial_std(self):
        """Return standard deviations at the start of the 13 states before the current."""
        errors, path = self.sensor_errors, self.path()
        R_n, R_t = earth.radii(path.latitude)
        metres = [R_n, R_t * math.cos(path.latitude)]
        position = [self.initial_position_m / scale for scale in metres]
        tilt = [self.initial_tilt_rad] * 2 + [self.initial_heading_rad]
        biases = [errors.accelerometer_bias] * 3 + [errors.gyro_bias] * 3
        return np.array([*position, *[self.initial_velocity] * 2, *tilt, *biases])


def _sequence(name, value):
    if isinstance(value, (str, bytes)) or not hasattr(value, "__iter__"):
        raise checks.ParameterError(name, value, "must be a list of standard deviations in m/s")
    values = tuple(value)
    if not values:
        raise checks.ParameterError(name, value, "must hold at least one value")
    return values


def check_chain(transition, initial):
    """Return a Markov chain as tuples of floats, or raise `ParameterError`."""
    try:
        T = np.array(transition, dtype=float)
    except (TypeError, ValueError):
        T = np.empty(0)
    stochastic = T.ndim == 2 and T.shape[0] == T.shape[1] and np.isfinite(T).all()
    if not stochastic or (T < 0).any() or not np.allclose(T.sum(axis=1), 1, rtol=0, atol=1e-9):
        allowed = "must be a square matrix of probabilities whose rows sum to one"
        raise checks.ParameterError("transition", transition, allowed)
    try:
        mu = np.array(initial, dtype=float)
    except (TypeError, ValueError):
        mu = np.empty(0)
    distribution = mu.shape == T.shape[:1] and np.isfinite(mu).all() and (mu >= 0).all()
    if not distribution or abs(mu.sum() - 1) > 1e-9:
        allowed = f"must be {len(T)} probabilities that sum to one"
        raise checks.ParameterError("initial_probabilities", initial, allowed)
    return tuple(map(tuple, T.tolist())), tuple(mu.tolist())


@lru_cache(maxsize=4)
def _path(shape, duration, speed_kn, latitude_deg, longitude_deg, corner_radius, sides, laps):
    return Trajectory(
        shape=shape,
        duration=duration,
        speed=speed_kn * KNOT,
        latitude=math.radians(latitude_deg),
        longitude=math.radians(longitude_deg),
        corner_radius=corner_radius,
        sides=sides,
        laps=laps,
    )


# ---------------------------------------------------------------- filters compared


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


def label(sigma):
    """Return sigmas as they appear in names, such as ``0.1,0.5``."""
    return ",".join(f"{value:.15g}" for value in sigma)


def optimal(sigma):
    """Return the EKF whose current model is the true one."""
    return Filter("optimal EKF", (sigma,))


def EKF(*sigma):
    """Return the EKF (one sigma) or the IMM of EKFs (several)."""
    return Filter(("IMM-EKF " if len(sigma) > 1 else "EKF ") + label(sigma), sigma)


def AFEKF(scenario, *sigma):
    """Return the adaptive fading EKF (one sigma) or the IMM of such (several)."""
    name = ("IMM-AFEKF " if len(sigma) > 1 else "AFEKF ") + label(sigma)
    return Filter(name, sigma, scenario.fading_form)


def paper_filters(scenario):
    """Return all filters of figures 3 to 6 but the optimal one, and the IMM of plain EKFs."""
    first, *others = scenario.sigma_filter
    singles = [make for s in scenario.sigma_filter for make in (EKF(s), AFEKF(scenario, s))]
    pairs = [make for s in others for make in (AFEKF(scenario, first, s), EKF(first, s))]
    return [*singles, *pairs]


# ---------------------------------------------------------------- simulated sensors


@dataclass(frozen=True)
class Sensors:
    """What one batch of runs senses; the current and the log in units of sigma.

    Shapes: theta, dv (steps, 3, LANES); unit_current (steps + 1, 3, LANES);
    log_noise (steps, axes, LANES); errors0 (16, LANES) in standard deviations;
    bias (6, LANES).
    """

    theta: np.ndarray
    dv: np.ndarray
    unit_current: np.ndarray
    log_noise: np.ndarray
    errors0: np.ndarray
    bias: np.ndarray


def sense(scenario, batch):
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


def _generators(seed, purpose, runs, batch):
    """Return the generators of the runs of one batch."""
    first = batch * LANES
    return montecarlo.streams(seed, purpose, first + runs)[first:]


# Bounded stores: one study after another meets the same runs.
@lru_cache(maxsize=16)
def _sense_inertial(path, errors, seed, runs, batch):
    steps = int(path.duration)
    theta, dv = np.empty((steps, 3, LANES)), np.empty((steps, 3, LANES))
    bias = np.empty((6, LANES))
    scale = np.repeat([errors.accelerometer_bias, errors.gyro_bias], 3)
    noises = _generators(seed, "inertial noise", runs, batch)
    biases = _generators(seed, "bias", runs, batch)
    for lane, (noise, draw) in enumerate(zip(noises, biases, strict=True)):
        bias[:, lane] = scale * draw.standard_normal(6)
        theta[..., lane], dv[..., lane] = inertial.sensor_increments(
            path, errors, noise, bias[:, lane]
        )
    for array in (theta, dv, bias):
        array[..., runs:] = array[..., :1]  # idle lanes repeat the first run
    return theta, dv, bias


@lru_cache(maxsize=16)
def _sense(path, errors, correlation_time, axes, start, initial, seed, runs, batch):
    theta, dv, bias = _sense_inertial(path, errors, seed, runs, batch)
    steps = int(path.duration)
    noise, log_noise = np.empty((steps, 3, LANES)), np.empty((steps, axes, LANES))
    unit0, errors0 = np.zeros((3, LANES)), np.zeros((16, LANES))
    kinds = [
        _generators(seed, kind, runs, batch) for kind in ("current", "log noise", "initial errors")
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
    return Sensors(theta, dv, unit, log_noise, errors0, bias)


@lru_cache(maxsize=4)
def _truth(path):
    latitude, longitude, v_n, heading = path.states()
    R_n, R_t = np.vectorize(earth.radii)(latitude)
    columns = [latitude, longitude, v_n[:, 0], v_n[:, 1], np.cos(heading / 2)]
    columns += [np.zeros_like(latitude)] * 2
    columns += [np.sin(heading / 2), R_n, R_t * np.cos(latitude)]
    return np.ascontiguousarray(np.stack(columns, axis=1))


# ---------------------------------------------------------------- missions


@dataclass(frozen=True)
class Mission:
    """One batch flown by one filter: see `seanav.filters.ins.fly`; idle lanes removed.

    Shapes: means (9 + models, runs), series (records, 17 + models, runs),
    P (models, 136, runs), packed, at the end.
    """

    means: np.ndarray
    series: np.ndarray
    P: np.ndarray


def fly(scenario, sensors, filter_, sigma_true, *, runs=LANES, stride=0):
    """Fly one batch with one filter.

    Parameters
    ----------
    sigma_true : float or (steps,)
        True standard deviation of the current, m/s. A sequence changes during the
        mission: the current then is sigma_true times the unit process.
    runs : int
        Lanes that are real runs.
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
    # One model needs no chain; several take the scenario's unless they bring their own.
    T, mu0 = ((1.0,),), (1.0,)
    if len(models) > 1:
        own = filter_.transition is not None
        T = filter_.transition if own else scenario.transition
        mu0 = filter_.initial_probabilities if own else scenario.initial_probabilities
        T, mu0 = check_chain(T, mu0)
        if len(mu0) != len(models):
            allowed = f"must fit the {len(models)} models of {filter_.name}"
            raise checks.ParameterError("initial_probabilities", mu0, allowed)
    rest = None
    if stride:
        bias = np.broadcast_to(sensors.bias, (steps // stride, 6, LANES))
        rest = np.concatenate([bias, current[stride - 1 :: stride]], axis=1)
    means, series, P = ins.fly(
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
    return Mission(means[:, :runs], series[..., :runs], P[..., :runs])


def _start(path):
    latitude, longitude, v_n, heading = (states[0] for states in path.states())
    half = 0.5 * heading
    return np.array([latitude, longitude, v_n[0], v_n[1], np.cos(half), 0.0, 0.0, np.sin(half)])


def fly_all(scenario, jobs, *, stride=0, threads=None, client=None, label=None):
    """Fly jobs over all runs of the scenario, each run with the same noise in every job.

    Parameters
    ----------
    jobs : list of (Filter, sigma_true)
    stride : int
        As in `fly`.

    Returns
    -------
    list of Mission, one per job, runs last.
    """
    scenario.path().increments()  # prepared once, before the threads share it
    batches = range(-(-scenario.runs // LANES))
    # The first share of the jobs over all batches first: each batch is sensed only once.
    shares = [range(len(jobs))[k::SHARES] for k in range(min(SHARES, len(jobs)))]
    tasks = [(share, batch) for share in shares for batch in batches]

    def one(task):
        share, batch = task
        sensors = sense(scenario, batch)
        runs = min(LANES, scenario.runs - batch * LANES)
        return [fly(scenario, sensors, *jobs[k], runs=runs, stride=stride) for k in share]

    done = montecarlo.parallel_map(one, tasks, threads=threads, client=client, label=label)
    found = {}
    for (share, _), missions in zip(tasks, done, strict=True):
        for job, mission in zip(share, missions, strict=True):
            found.setdefault(job, []).append(mission)
    return [
        Mission(
            *(
                np.concatenate([getattr(batch, name) for batch in found[job]], axis=-1)
                for name in ("means", "series", "P")
            )
        )
        for job in range(len(jobs))
    ]


def sweep(scenario, filters=None, sigma_true=None, *, known=None, **options):
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
        {filter name: [Mission for each true sigma]}; pure navigation does not depend on
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
    for (filter_, _), mission in zip(jobs, fly_all(scenario, jobs, **options), strict=True):
        results.setdefault(filter_.name, []).append(mission)
    if known is None:
        results[PURE.name] *= len(grid)
    return results
