"""Paper 4 on a measured or tidal current: its filters, and one that believes in a tide."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path

import attrs
import numpy as np

from seanav import estimates, montecarlo
from seanav.checks import read_only
from seanav.estimates import Estimate
from seanav.filters import ins, linear_covariance
from seanav.models import currents, tides
from seanav.studies.imm_sea_current import linear, own_current, run, scores
from seanav.studies.imm_sea_current.scenario import Scenario

GRID = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0)  # m/s, of the fixed filters
TIMES = (1800.0, 7200.0, 28800.0, 115200.0)  # s, of the Markov models
TIDES = (0.2, 0.5)  # m/s, of the oscillator
RESTS = (0.05, 0.1, 0.2)  # m/s, of the Markov part beside it
SLOW = 0.5  # m/s, of a single EKF that forgets slowly
STRIDE = 240  # s between recorded mode probabilities
M2 = tides.S08010[0].speed
FEWEST = 8  # missions, of which a quarter has a mean with an interval


# ---------------------------------------------------------------- the current


@dataclass(frozen=True, eq=False)
class Sea:
    """True currents of the missions.

    Attributes
    ----------
    name : str
        Where they come from.
    current : ndarray (2, steps + 1, missions)
        North and east, m/s.
    """

    name: str
    current: np.ndarray

    def __post_init__(self):
        read_only(self.current)

    @property
    def strength(self) -> np.ndarray:
        """Root mean square speed of each mission over √2, (missions,) m/s: sigma of one axis."""
        return np.sqrt((self.current**2).mean(axis=(0, 1)))


def sea(scenario: Scenario) -> Sea:
    """Return the user's record, or the tidal or the paper's current of the scenario's seed.

    Raises
    ------
    seanav.checks.ParameterError
        See `own_current.read`.
    """
    if scenario.current_file:
        current = own_current.missions(scenario, own_current.read(scenario))[1]
        return Sea(Path(scenario.current_file).name, current)
    if scenario.current == "markov":
        sigma = scenario.sigma_true[len(scenario.sigma_true) // 2]
        time = scenario.correlation_time_s
        name = f"the paper's Markov model, {sigma:g} m/s"
        return Sea(name, _markov(scenario, (sigma, sigma), (time, time)))
    steps = np.arange(int(scenario.duration_s) + 1.0)
    draws = montecarlo.streams(scenario.seed, "tidal phases", scenario.current_missions)
    phases = [one.uniform(0, 2 * math.pi, len(tides.S08010)) for one in draws]
    tide = tides.stream(tides.S08010, steps, np.transpose(phases))
    rest = _markov(scenario, tides.REST_STD, tides.REST_TIME)
    return Sea("tidal stream with the constituents of station s08010", tide + rest)


def _markov(scenario, sigma, times):
    steps, runs = int(scenario.duration_s), scenario.current_missions
    noise = montecarlo.normals(scenario.seed, "tidal rest", runs, (steps + 1, 2))
    found = np.empty((2, steps + 1, runs))
    for k in (0, 1):
        one = noise[:, :, k].T
        found[k] = sigma[k] * currents.gauss_markov(one[1:], one[0], 1.0, times[k])
    return found


# ---------------------------------------------------------------- flights


def filters(scenario: Scenario) -> list[run.Filter]:
    """Return the paper's filters, EKFs with every sigma of `GRID`, and some that forget slowly."""
    fixed = [run.EKF(s) for s in GRID if s not in scenario.sigma_filter]
    slow = [slower(run.EKF(*sigma)) for sigma in ((SLOW,), *run.pairs(scenario))]
    return [run.PURE, *run.paper_filters(scenario), *fixed, *slow]


def slower(filter_: run.Filter) -> run.Filter:
    """Return a filter whose current model has the longest T_c of `TIMES`."""
    name = f"{filter_.name} T_c={TIMES[-1] / 3600:g}h"
    return replace(filter_, name=name, correlation_time_s=TIMES[-1])


def fly(
    scenario: Scenario, sea: Sea, which: Sequence | None = None, stride: int = STRIDE
) -> dict[str, ins.Flight]:
    """Fly filters through all missions, each mission with the same sensor noise in all of them.

    Parameters
    ----------
    which : sequence of run.Filter, optional
        Default: `filters`.

    Returns
    -------
    dict of name to seanav.filters.ins.Flight
    """
    scenario = attrs.evolve(scenario, runs=sea.current.shape[2])
    which = filters(scenario) if which is None else list(which)
    scenario.path().increments()
    batches = range(-(-scenario.runs // run.LANES))
    tasks = [(one, batch) for one in which for batch in batches]
    one = partial(_fly, scenario, sea, min(stride, int(scenario.duration_s)))
    done = montecarlo.parallel_map(one, tasks, label="own current")
    found: dict[str, list] = {}
    for (filter_, _), flight in zip(tasks, done, strict=True):
        found.setdefault(filter_.name, []).append(flight)
    return {name: ins.Flight.join(flights) for name, flights in found.items()}


def _fly(scenario, sea, stride, task):
    filter_, batch = task
    flight = run.fly(scenario, sensors(scenario, sea, batch), filter_, 1.0, stride=stride)
    return flight._replace(P=flight.P[:, :0])


def sensors(scenario: Scenario, sea: Sea, batch: int) -> run.Sensors:
    """Return a batch of the scenario's sensors in the water of its missions."""
    own = run.sense(scenario, batch)
    part = sea.current[:, :, batch * run.LANES : batch * run.LANES + own.runs]
    unit = np.zeros_like(own.unit_current)
    unit[:, :2, : own.runs] = part.transpose(1, 0, 2)
    unit[:, :, own.runs :] = unit[:, :, :1]
    return replace(own, unit_current=unit)


def best(flown: Mapping) -> str:
    """Return the name of the fixed filter with the smallest TCEP and the paper's T_c."""
    names = (n for n in flown if n.startswith("EKF ") and "T_c" not in n)
    fixed = {n: flown[n] for n in names if not scores.diverged(flown[n])}
    return min(fixed, key=lambda name: scores.tcep(fixed[name]).value)


def quarters(sea: Sea, flight: ins.Flight) -> Estimate | str:
    """Return the first mode probability of the weakest quarter of missions less the strongest's.

    The quarters are by `Sea.strength`; the samples are missions.
    """
    runs = len(sea.strength)
    if runs < FEWEST:
        return f"fewer than {FEWEST} missions"
    order, count = np.argsort(sea.strength, kind="stable"), runs // 4
    mode = flight.mode_probability[0]
    value, influence = 0.0, np.zeros(runs)
    for sign, part in ((1, order[:count]), (-1, order[-count:])):
        value += sign * mode[part].mean()
        influence[part] = sign * (mode[part] - mode[part].mean()) * runs / count
    return estimates.from_influence(value, influence)


# ---------------------------------------------------------------- exact, one filter


@dataclass(frozen=True)
class Belief:
    """What a single filter believes of the current, on either axis.

    Attributes
    ----------
    sigma, time : float
        Of the Markov part: m/s, s.
    tide : float
        Standard deviation of an oscillator beside it, m/s; 0: none, the paper's model.
    speed : float
        Of the oscillator, rad/s.
    """

    sigma: float
    time: float
    tide: float = 0.0
    speed: float = M2

    @property
    def name(self) -> str:
        """Name in tables."""
        words = f"Markov {self.sigma:g} m/s, {self.time:g} s"
        return words + (f" + tide {self.tide:g} m/s" if self.tide else "")


@lru_cache(maxsize=8)
def _dynamics(path, time, speed):
    # The 18 states of `linear.model`, and two oscillators behind them if there is a speed.
    own, looked = linear.model(path, time)
    if not speed:
        return own, looked
    Phi, H = np.zeros((len(own), 22, 22)), np.zeros((len(own), 22))
    Phi[:, :18, :18], H[:, :18] = own, looked
    for first, axis in ((18, 15), (20, 16)):
        Phi[:, first : first + 2, first : first + 2] = tides.oscillator(speed, 1.0)
        H[:, first] = looked[:, axis]
    return read_only(Phi, H)


def gains(scenario: Scenario, belief: Belief) -> tuple[np.ndarray, np.ndarray]:
    """Return gains (steps, n) and covariances (steps + 1, n, n); n is 18, with a tide 22."""
    Phi, H = _dynamics(scenario.path(), belief.time, belief.speed if belief.tide else 0.0)
    variance = currents.decay(1.0, belief.time)[1] * belief.sigma**2
    Q, P0 = np.zeros(H.shape[1]), np.zeros((H.shape[1],) * 2)
    Q[:18] = linear.process_noise(scenario, variance)
    P0[:18, :18] = linear.believed_start(scenario, belief.sigma)
    P0[range(18, len(Q)), range(18, len(Q))] = belief.tide**2
    return linear_covariance.design(Phi, Q, H, scenario.log_noise**2, P0)


def mean_squares(scenario: Scenario, sea: Sea, belief: Belief) -> np.ndarray:
    """Return squared position errors, north and east, mean over time, (2, missions) m².

    Exact for the linearised filter in the given currents, mean over sensor noise: the part
    of the sensors is a covariance, that of the current a linear response to it.
    """
    Phi, H = _dynamics(scenario.path(), belief.time, belief.speed if belief.tide else 0.0)
    K = gains(scenario, belief)[0]
    n = H.shape[1]
    Q, M0 = np.zeros(n), np.zeros((n, n))
    Q[:18] = linear.process_noise(scenario, 0.0)
    M0[:18, :18] = linear.true_start(scenario, 0.0)
    M = linear_covariance.achieve(Phi, Q, H, scenario.log_noise**2, M0, K)
    # The log sees the water's motion along the ship, which no state of the filter holds.
    seen = -H[:, 15, None] * sea.current[0, 1:] - H[:, 16, None] * sea.current[1, 1:]
    out = linear_covariance.respond(Phi, H, K, seen, 2)
    scale = linear.metres(scenario)[1:, :, None] ** 2
    sensors_part = np.einsum("kii->ki", M)[1:, :2, None]
    return ((sensors_part + out**2) * scale).mean(axis=0)


def tcep(scenario: Scenario, sea: Sea, belief: Belief) -> float:
    """Return the exact TCEP (m) of a single filter in the currents of all missions."""
    return float(scores.TCEP * np.sqrt(mean_squares(scenario, sea, belief).mean(axis=1)).sum())


def beliefs() -> list[Belief]:
    """Return the single filters that are compared: the paper's model, and with a tide."""
    markov = [Belief(s, t) for t in TIMES for s in GRID[:-1]]
    tide = [Belief(s, t, a) for a in TIDES for t in TIMES[:2] for s in RESTS]
    return markov + tide


def exact(scenario: Scenario, sea: Sea) -> dict[Belief, float]:
    """Return the exact TCEP (m) of every belief; nothing for a log of three axes."""
    if scenario.log_axes > 1:
        return {}
    scenario.path().increments()
    every = beliefs()
    found = montecarlo.parallel_map(partial(tcep, scenario, sea), every, label="exact")
    return dict(zip(every, found, strict=True))
