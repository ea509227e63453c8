"""Paper 1: filtering an underwater vehicle as an Itô process.

Nonlinear filtering of an autonomous underwater vehicle, *Transactions of the Institute of
Measurement and Control* (2021). The scenario, the simulated truth, the filters, their
scores. What goes beyond the paper is in `seanav.studies.ito_beyond`.
"""

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy import stats

from seanav import checks, estimates, montecarlo
from seanav.filters import continuous_discrete, generated, moments
from seanav.models import bodies
from seanav.report import Condition, significant

LIMIT = 1e6  # m/s and rad/s; whatever is faster has diverged
SHORTEST, LONGEST = 1e-4, 1e5  # s, of a step and of a mission
STEPS = 100_000  # of one run, at most
MEMORY = 4.0  # GiB that the tracks of a study may take
BATCH = 50  # runs per unit of parallel work; fixed, so that results do not depend on threads
COMPONENTS = bodies.STATES
UNITS = ("m/s",) * 3 + ("rad/s",) * 3
VEHICLES = ("torpedo", "sphere")
_MOVED = (("torpedo",), ("sphere",), VEHICLES)  # by torpedo_step, sphere_step, map_step


@dataclass(frozen=True)
class Case:
    """One measurement set: which components, with what noise variance."""

    number: int
    measured: tuple
    R: float
    words: str

    @property
    def H(self):
        """Measurement matrix, (3, 6)."""
        return np.eye(6)[list(self.measured)]


@dataclass(frozen=True)
class Scenario:
    """Everything that can be chosen, checked at once; SI.

    Raises
    ------
    seanav.checks.ParameterError
        One line that names the parameter, its value and what is allowed.
    """

    torpedo_start: tuple = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    torpedo_variance: tuple = (0.05, 0.02, 0.02, 0.02, 0.02, 0.02)
    torpedo_noise: tuple = (0.1, 0.1, 0.1, 0.2, 0.2, 0.2)
    sphere_start: tuple = (0.3, 0.1, -0.05, 0.05, -0.05, 0.15)
    sphere_variance: tuple = (0.02,) * 6
    sphere_noise: tuple = (0.03, 0.03, 0.03, 0.12, 0.12, 0.12)
    strong_noise: float = 3.0
    small_R: float = 1e-4
    large_R: float = 1.0
    interval: float = 0.5
    mission: float = 40.0
    torpedo_step: float = 0.01
    sphere_step: float = 0.02
    filter_step: float = 0.05
    runs: int = 150
    particles: int = 500
    particle_runs: int = 12
    map_noise: tuple = (0.5, 1.0, 2.0, 4.0)
    map_interval: tuple = (0.25, 0.5, 1.0, 2.0)
    map_step: float = 0.01
    map_R: float = 0.01
    seed: int = 2021

    def __post_init__(self):
        integer, number = checks.integer, checks.number
        for vehicle in VEHICLES:
            self._numbers(f"{vehicle}_start", 6, -1e3, 1e3)
            self._numbers(f"{vehicle}_variance", 6, 1e-12, 1e4)
            self._numbers(f"{vehicle}_noise", 6, 1e-6, 1e3)
        number("strong_noise", self.strong_noise, at_least=1e-3, at_most=1e3)
        for name in ("small_R", "large_R", "map_R"):
            number(name, getattr(self, name), at_least=1e-12, at_most=1e12)
        self._numbers("map_noise", None, 1e-3, 1e3)
        self._numbers("map_interval", None, 1e-3, LONGEST / 2)
        number("interval", self.interval, at_least=1e-3, at_most=LONGEST / 2)
        number("mission", self.mission, at_least=2 * self.interval, at_most=LONGEST)
        for name in ("torpedo_step", "sphere_step", "filter_step", "map_step"):
            number(name, getattr(self, name), at_least=SHORTEST)
        for name, moved in zip(("torpedo_step", "sphere_step", "map_step"), _MOVED, strict=True):
            # A longer step of Euler's scheme does not follow the drag of the fastest axis.
            most = 0.5 * min(bodies.BODIES[vehicle].fastest() for vehicle in moved)
            if getattr(self, name) > most:
                allowed = f"must be at most half the time constant of the fastest axis, {most:.3g}"
                raise checks.ParameterError(name, getattr(self, name), allowed)
        self._times()
        integer("seed", self.seed, at_least=0)
        integer("runs", self.runs, at_least=2)
        integer("particle_runs", self.particle_runs, at_least=2)
        if self.particle_runs > self.runs:
            allowed = f"must be an integer of at least 2 and at most runs = {self.runs}"
            raise checks.ParameterError("particle_runs", self.particle_runs, allowed)
        integer("particles", self.particles, at_least=2)
        self._memory()

    def _times(self):
        """Refuse a step that does not divide a time it is used with, or is far too short."""
        divides = checks.parts
        divides("interval", self.interval, "mission", self.mission, at_most=STEPS)
        for name in ("torpedo_step", "sphere_step", "filter_step"):
            step = getattr(self, name)
            count = divides(name, step, "interval", self.interval, at_most=STEPS)
            divides(name, step, "mission", self.mission, at_most=STEPS)
            if name == "torpedo_step" and count % 2:
                allowed = "twice it, the step of the particle filter, must divide interval = "
                raise checks.ParameterError(name, step, f"{allowed}{self.interval:g} evenly")
        finest = min(self.map_interval)
        for length in self.map_interval:
            if abs(length / finest - round(length / finest)) > 1e-9 * length / finest:
                allowed = f"must be a multiple of the shortest one, {finest:g}"
                raise checks.ParameterError("map_interval", length, allowed)
        for name in ("map_step", "filter_step"):
            divides(name, getattr(self, name), "map_interval", finest, at_most=STEPS)
        if self.map_mission / min(self.map_step, self.filter_step) > STEPS:
            allowed = f"need {self.map_mission:g} s, the least that each divides, and with this "
            allowed += f"map_step and filter_step more than {STEPS} steps"
            raise checks.ParameterError("map_interval", self.map_interval, allowed)

    def _memory(self):
        """Refuse numbers of runs, samples and particles that fill the memory."""
        number = 6 + 36 + 1  # mean, covariance, NIS
        # Of every case at both strengths of the noise a track is kept; beside them there
        # are the tracks and the truth of the case, or of the row of the map, in work.
        kept = 12 * number + 4 * number + 4 * 6
        map_samples = self.map_mission / min(self.map_interval) + 1
        samples = kept * (self.mission / self.interval + 1) + (3 * number + 6) * map_samples
        most = int(MEMORY * 2**30 / (8 * samples))
        if self.runs > most:
            allowed = f"must be at most {most} to keep all samples of this mission, interval and "
            allowed += f"map_interval in {MEMORY:g} GiB"
            raise checks.ParameterError("runs", self.runs, allowed)
        most = int(MEMORY / 4 * 2**30 / (8 * 6 * self.interval / (2 * self.torpedo_step)))
        if self.particles > most:
            allowed = f"must be at most {most} to keep the noise of this interval and torpedo_step "
            allowed += f"in {MEMORY / 4:g} GiB"
            raise checks.ParameterError("particles", self.particles, allowed)

    def _numbers(self, name, count, low, high):
        value = getattr(self, name)
        usable = hasattr(value, "__iter__") and not isinstance(value, (str, bytes, dict, set))
        entries = tuple(value) if usable else ()
        if not (len(entries) == count if count else 1 <= len(entries) <= 20):
            raise checks.ParameterError(name, value, f"must be {count or '1 to 20'} numbers")
        entries = tuple(checks.number(name, e, at_least=low, at_most=high) for e in entries)
        if count is None and len(set(entries)) < len(entries):
            raise checks.ParameterError(name, value, "must hold every number once")
        object.__setattr__(self, name, entries)

    @property
    def map_mission(self):
        """Length of the map's runs: half the mission, or the next that each interval divides."""
        finest = min(self.map_interval)
        common = math.lcm(*(round(length / finest) for length in self.map_interval)) * finest
        least = max(self.mission / 2, 2 * max(self.map_interval))
        return common * math.ceil(least / common - 1e-9)

    def quick(self):
        """Return the scenario with a tenth of the runs."""
        return replace(
            self,
            runs=max(2, self.runs // 10),
            particle_runs=max(2, self.particle_runs // 10),
        )

    @property
    def cases(self):
        """The three cases of the paper."""
        return (
            Case(1, (0, 1, 2), self.small_R, "linear velocities, small R"),
            Case(2, (0, 1, 2), self.large_R, "linear velocities, large R"),
            Case(3, (3, 4, 5), self.large_R, "angular velocities, large R"),
        )

    def prior(self, vehicle):
        """Return x0 (6,) and P0 (6, 6)."""
        start = np.array(getattr(self, f"{vehicle}_start"))
        return start, np.diag(getattr(self, f"{vehicle}_variance"))

    def noise(self, vehicle, strength=1.0):
        """Return the diffusion of a vehicle, the angular part times `strength`."""
        return np.array(getattr(self, f"{vehicle}_noise")) * np.repeat([1.0, strength], 3)


# ---------------------------------------------------------------- symbols, compiled once


@cache
def body():
    """Return the six-state equation in symbols, of both vehicles."""
    drift, diffusion, names = bodies.equations()
    return moments.system(bodies.STATES, drift, diffusion, bodies.INPUTS, names)


@cache
def propagator(closure):
    """Return the compiled moment equations of a closure."""
    return generated.Propagator(moments.close(body(), closure))


@cache
def simulator():
    """Return the compiled equation itself."""
    return generated.Simulator(body())


# ---------------------------------------------------------------- truth and filters


@dataclass(frozen=True, eq=False)
class Truth:
    """Simulated vehicles.

    Attributes
    ----------
    vehicle : str
    parameters : ndarray, shape (24,)
        Of the body, diffusion included: the filters know it.
    times : ndarray, shape (samples,)
    x : ndarray, shape (runs, samples, 6)
    """

    vehicle: str
    parameters: np.ndarray
    times: np.ndarray
    x: np.ndarray


def simulate(scenario, vehicle, noise=None, keep=None, mission=None, step=None) -> Truth:
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
        If the step does not divide `keep`, or `keep` the mission; if the vehicle explodes,
        which is the fault of the step.
    """
    craft = bodies.BODIES[vehicle]
    noise = scenario.noise(vehicle) if noise is None else noise
    name = step or f"{vehicle}_step"
    step = getattr(scenario, name)
    mission = scenario.mission if mission is None else mission
    keep = scenario.interval if keep is None else keep
    steps = checks.parts(name, step, "mission", mission, at_most=STEPS)
    every = checks.parts(name, step, "keep", keep, at_most=STEPS)
    checks.parts("keep", keep, "mission", mission, at_most=STEPS)
    parameters = craft.parameters(noise)
    forces = craft.forces(np.arange(steps + 1) * step)
    x0, P0 = scenario.prior(vehicle)
    first = montecarlo.normals(scenario.seed, f"{vehicle} start", scenario.runs, (6,))
    starts = x0 + first @ np.sqrt(P0)
    generators = montecarlo.streams(scenario.seed, f"{vehicle} process", scenario.runs)
    move = simulator()

    def batch(chosen):
        normal = np.array([generators[r].standard_normal((steps, 6)) for r in chosen])
        return move(starts[chosen], normal, step, forces, parameters, every)

    tracks = montecarlo.parallel_map(batch, batches(scenario.runs), label=f"{vehicle}, truth")
    x = np.concatenate(tracks)
    if not (np.abs(x) < LIMIT).all():
        given = ", ".join(f"{vehicle}_{part}" for part in ("start", "variance", "noise"))
        allowed = f"is too long for {given} times strong_noise or map_noise: the {vehicle} diverges"
        raise checks.ParameterError(name, step, allowed)
    return Truth(vehicle, parameters, np.arange(x.shape[1]) * keep, x)


def batches(runs):
    """Return run numbers in lists of fixed size."""
    return [list(range(k, min(k + BATCH, runs))) for k in range(0, runs, BATCH)]


def measure(scenario, truth, case) -> np.ndarray:
    """Return the measurements of a case, (runs, samples - 1, 3)."""
    runs, samples = truth.x.shape[:2]
    shape = (samples - 1, 3)
    purpose = f"{truth.vehicle} measurement"
    noise = montecarlo.normals(scenario.seed, purpose, runs, shape)
    return truth.x[:, 1:] @ case.H.T + np.sqrt(case.R) * noise


def estimate(scenario, truth, case, closure="gaussian", corrected=True):
    """Run a filter on every record of a case; a `continuous_discrete.Track`."""
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
    joined = [np.concatenate([getattr(t, a) for t in tracks]) for a in ("mean", "P", "nis")]
    if not corrected:
        joined = [np.repeat(a, scenario.runs, axis=0) for a in joined]
    return continuous_discrete.Track(*joined)


def particles(scenario, truth, case):
    """Run the bootstrap particle filter on the first runs; a `continuous_discrete.Track`."""
    z = measure(scenario, truth, case)
    x0, P0 = scenario.prior(truth.vehicle)
    forces, move = bodies.BODIES[truth.vehicle].forces, simulator()
    generators = montecarlo.streams(
        scenario.seed, f"{truth.vehicle} particles", scenario.particle_runs
    )

    def one(r):
        return continuous_discrete.particle_filter(
            move, x0, P0, z[r : r + 1], truth.times[1], 2 * scenario.torpedo_step,
            case.R * np.eye(3), case.H, generators[r : r + 1], scenario.particles, forces,
            truth.parameters, limit=LIMIT,
        )  # fmt: skip

    tracks = montecarlo.parallel_map(one, range(scenario.particle_runs), label="particles")
    joined = [np.concatenate([getattr(t, a) for t in tracks]) for a in ("mean", "P", "nis")]
    return continuous_discrete.Track(*joined)


# ---------------------------------------------------------------- scores


@dataclass(frozen=True, eq=False)
class Score:
    """Errors of one filter, a number per run; the start is not counted.

    A run in which the filter diverged has NaN; what needs it is None then, see `shown`.

    Attributes
    ----------
    squared : ndarray, shape (runs, 6)
        Mean squared error over time.
    variance : ndarray, shape (runs, 6)
        What the filter says of it: mean of the diagonal of P.
    nees : ndarray, shape (runs,)
        Mean over time of eᵀ P⁻¹ e; 6 if the covariance is right.
    nees_by_time : ndarray, shape (samples,)
        Mean over runs.
    """

    squared: np.ndarray
    variance: np.ndarray
    nees: np.ndarray
    nees_by_time: np.ndarray

    @property
    def lost(self):
        """Number of runs in which the filter diverged."""
        return int((~np.isfinite(self.squared).all(axis=1)).sum())

    def rmse(self, component):
        """Return the RMSE of a component, an `Estimate`, or None."""
        return unless_diverged(estimates.root_mean_square, self.squared[:, component])

    def own_sd_ratio(self, component):
        """Return the filter's own standard deviation over its RMSE, an `Estimate`, or None."""
        return root_ratio(self.variance[:, component], self.squared[:, component])

    def mean_nees(self):
        """Return the mean NEES, an `Estimate`, or None."""
        return unless_diverged(estimates.mean, self.nees)


def unless_diverged(function, *samples):
    """Return ``function(*samples)``, or None if a run has diverged: a sample is not finite."""
    return function(*samples) if all(np.isfinite(part).all() for part in samples) else None


def shown(estimate, digits=3):
    """Return an `Estimate` or a float as text; None or NaN, of a filter that diverged, says so."""
    return "diverged" if _diverged(estimate) else significant(estimate, digits)


def entry(estimate, attribute="value"):
    """Return what a table holds of an `Estimate` or a float; None and NaN as `shown`."""
    return "diverged" if _diverged(estimate) else float(getattr(estimate, attribute, estimate))


def _diverged(estimate):
    return estimate is None or (isinstance(estimate, float) and not np.isfinite(estimate))


def condition(what, estimate, low=-np.inf, high=np.inf, lost=None):
    """Return a condition of a claim on an `Estimate` or an exact number.

    None or NaN, where a filter diverged, fails. If the claim is about one of two filters
    that are compared, hand in how many runs that one has `lost`: none, and it holds.
    """
    if not _diverged(estimate):
        estimate = estimates.exact(estimate) if isinstance(estimate, float) else estimate
        return Condition(what, estimate, low, high)
    if lost is None:
        return Condition(f"{what}: filters that diverged", estimates.exact(1), high=0)
    return Condition(f"{what}: one diverged; runs lost by ours", estimates.exact(lost), high=0)


def score(truth, track, consistency=True) -> Score:
    """Return the errors (estimate minus truth) of a filter, of as many runs as it has.

    `consistency` False leaves the NEES out (NaN): the sample covariance of a particle
    filter that has collapsed cannot be inverted.
    """
    runs = len(track.mean)
    error = (track.mean - truth.x[:runs])[:, 1:]
    P = track.P[:, 1:]
    nees = np.full(error.shape[:2], np.nan)
    if consistency:
        whitened = np.linalg.solve(P, error[..., None])[..., 0]
        nees = (error * whitened).sum(axis=-1)
        nees[nees < 0] = np.nan  # a P that is no covariance any more
    variance = np.diagonal(P, axis1=2, axis2=3).mean(axis=1)
    return Score((error**2).mean(axis=1), variance, nees.mean(axis=1), nees.mean(axis=0))


def nees_band(runs, states=6):
    """Return the 95 % interval of the mean NEES of independent consistent runs at one time."""
    return stats.chi2.ppf([0.025, 0.975], states * runs) / runs


def root_ratio(a, b):
    """Return √(mean a / mean b) of per-run scores (runs,), paired, as an `Estimate`, or None."""
    return unless_diverged(_root_ratio, a, b)


def _root_ratio(a, b):
    value = float(np.sqrt(a.mean() / b.mean()))
    return estimates.from_influence(value, 0.5 * value * (a / a.mean() - b / b.mean()))


def total(one, open_loop):
    """Return each run's squared error, components weighed by the open-loop error, (runs,)."""
    return (one.squared / open_loop.squared.mean(axis=0)).mean(axis=1)


@dataclass(frozen=True, eq=False)
class Result:
    """One case of one vehicle: truth, filtered track, and scores by filter name."""

    truth: Truth
    case: Case
    track: continuous_discrete.Track
    scores: dict

    def over_open_loop(self, component, name="gaussian"):
        """Return RMSE of a filter over that of prediction only, an `Estimate`, or None."""
        return root_ratio(
            self.scores[name].squared[:, component],
            self.scores["prediction only"].squared[:, component],
        )

    def gain(self, name="gaussian", other="ekf"):
        """Return the total error of a filter over another's, paired, an `Estimate`, or None."""
        open_loop = self.scores["prediction only"]
        return root_ratio(total(self.scores[name], open_loop), total(self.scores[other], open_loop))


def run_case(scenario, truth, case) -> Result:
    """Run all closures and the one-stage estimator on a case."""
    tracks = {closure: estimate(scenario, truth, case, closure) for closure in moments.CLOSURES}
    scores = {name: score(truth, track) for name, track in tracks.items()}
    scores["prediction only"] = score(truth, estimate(scenario, truth, case, corrected=False))
    return Result(truth, case, tracks["gaussian"], scores)


def run_all(scenario, strength=1.0) -> dict:
    """Return {(vehicle, case number): Result}; `strength` scales the angular noise."""
    results = {}
    for vehicle in VEHICLES:
        truth = simulate(scenario, vehicle, scenario.noise(vehicle, strength))
        for case in scenario.cases:
            results[vehicle, case.number] = run_case(scenario, truth, case)
    return results


def open_loop_limit(scenario, truth, case, R):
    """Return the largest difference between the filter with noise `R` and prediction only.

    In units of the open-loop standard deviation: how near the limit R → ∞ is. NaN if a
    filter diverged.
    """
    far = estimate(scenario, truth, replace(case, R=R))
    free = estimate(scenario, truth, case, corrected=False)
    sd = np.sqrt(np.diagonal(free.P, axis1=2, axis2=3))
    return float(np.abs((far.mean - free.mean) / sd).max())


# ---------------------------------------------------------------- provenance


def origins(scenario) -> list:
    """Return where every parameter comes from: rows of `report.parameters`."""
    rows = []

    def add(name, value, unit, origin, note):
        shown = " ".join(f"{v:g}" for v in value) if hasattr(value, "__iter__") else value
        rows.append((name, shown, unit, origin, note))

    torpedo, sphere = bodies.TORPEDO, bodies.SPHERE
    tables = "REMUS tables of Prestero (2001) as found in public code"
    add("torpedo mass", torpedo.mass, "kg", "public source", tables)
    add("torpedo inertia", torpedo.inertia, "kg m²", "public source", tables)
    add("torpedo linear drag", torpedo.linear, "N s/m, N m s", "assumed", "66.6, 6.87 as paper 3")
    add("torpedo cubic drag", torpedo.cubic, "N s³/m³, N m s³", "assumed", "no public value")
    memory = "ODIN sphere from memory of the literature, found nowhere public"
    add("sphere mass", sphere.mass, "kg", "recalled", memory + "; ½ρV of 0.64 m is 70.3 kg")
    add("sphere inertia", sphere.inertia, "kg m²", "recalled", memory + "; 0.4 m r² is 5.18")
    add("sphere linear drag", sphere.linear, "N s/m, N m s", "recalled", memory)
    add("sphere cubic drag", sphere.cubic, "N s³/m³, N m s³", "recalled", memory)
    for craft in (torpedo, sphere):
        add(f"{craft.name} tau0", craft.inputs, "N, N m", "assumed", "times 1 + 0.5 sin 0.3 t")
    ours = "ours; the text gives none"
    notes = {
        "small_R": "case 1; chosen to show what the text says of it",
        "large_R": "cases 2 and 3; chosen likewise",
        "strong_noise": "factor on the angular noise",
        "filter_step": "Runge–Kutta; ours",
        **dict.fromkeys(("runs", "particles", "particle_runs", "seed"), ours),
        **dict.fromkeys(("map_noise", "map_interval", "map_R"), ours),
        "map_step": "ours; of both vehicles, divides every map_interval",
    }
    speed, turn = "m/s", "rad/s"
    units = {
        "start": f"{speed}, {turn}",
        "variance": f"({speed})², ({turn})²",
        "noise": f"{speed}, {turn} per √s",
    }
    units = {f"{vehicle}_{part}": unit for vehicle in VEHICLES for part, unit in units.items()}
    units |= {"small_R": f"({speed})²", "map_R": f"({speed})²", "large_R": units["sphere_variance"]}
    units |= dict.fromkeys(("interval", "mission", "map_interval", "map_step", "filter_step"), "s")
    units |= {f"{vehicle}_step": "s" for vehicle in VEHICLES}
    for name in Scenario.__dataclass_fields__:
        note = notes.get(name, "lost in the text")
        add(name, getattr(scenario, name), units.get(name, ""), "assumed", note)
    return rows
