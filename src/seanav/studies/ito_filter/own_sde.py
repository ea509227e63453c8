"""Paper 1 on a user's own system: a file says the equation, the notebook's path does the rest."""

import math
import tomllib
from functools import cache
from pathlib import Path

import attrs
import numpy as np

from seanav import checks, montecarlo
from seanav.checks import ParameterError
from seanav.estimates import significant
from seanav.filters import moments
from seanav.filters.moments import Track, continuous_discrete, equations, sde
from seanav.records import opened
from seanav.studies.ito_filter import run, scores
from seanav.studies.ito_filter.scenario import STEPS, Scenario

MOST_BYTES = 2**16
MOST_STATES = 8  # the Gaussian closure of more takes minutes
MOST_NUMBERS = 50_000_000  # runs times steps times noises: what is drawn fits in a GB
LIMIT = 1e12  # in the user's units: what is larger has diverged
TABLES = ("drift", "diffusion", "mean", "variance")  # each with an entry for every state
NUMBERS = ("interval", "step", "duration")
KEYS = ("states", *TABLES, "measurement", *NUMBERS, "parameters", "units")
BUILT_IN = """\
# The roll of a ship in waves: a restoring moment that softens, a damping that grows.
states = ["roll", "rate"]
step = 0.05        # s, of the simulation and of the filters
interval = 1.0     # s, between measurements
duration = 60.0    # s

[drift]
roll = "rate"
rate = "-w**2*(roll - k*roll**3) - d*rate - e*rate**3"

[diffusion]
roll = "0"
rate = "s"

[parameters]
w = 0.6
k = 0.5
d = 0.02
e = 0.6
s = 0.04

[mean]
roll = 0.15
rate = 0.0

[variance]
roll = 0.01
rate = 0.004

[measurement]
h = ["rate"]
variance = [1e-4]

[units]
roll = "rad"
rate = "rad/s"
"""


@attrs.frozen(eq=False)
class Own:
    """A user's system, checked.

    Attributes
    ----------
    source : str
        The file's name, or what stands in its place.
    model : System
    parameters, mean : ndarray
    P0 : ndarray (n, n)
    h : tuple of str
        Measured formulas.
    R : ndarray (k, k)
    interval, step, duration : float
    units : tuple of str
    """

    source: str
    model: moments.System
    parameters: np.ndarray
    mean: np.ndarray
    P0: np.ndarray
    h: tuple
    R: np.ndarray
    interval: float
    step: float
    duration: float
    units: tuple

    @property
    def names(self) -> tuple:
        """Names of the states."""
        return tuple(x.name for x in self.model.states)

    @property
    def measured(self) -> moments.Predictor | np.ndarray:
        """H (k, n) if plain states are measured, else the compiled expansion of h."""
        if set(self.h) <= set(self.names):
            return np.array([[float(x == h) for x in self.names] for h in self.h])
        return moments.Predictor(equations.measurement(self.model, list(self.h)))


# ---------------------------------------------------------------- the file


def read(scenario: Scenario) -> Own:
    """Return the system of the file `sde_file`, or the built-in one.

    Raises
    ------
    ParameterError
        One line that names the key: if it is no TOML, a key is missing, unknown or of another
        kind, a formula is not allowed, dimensions do not fit, or the work would be too much.
    """
    path = scenario.sde_file
    source = Path(path).name if path else "built in"
    text = opened("sde_file", path, MOST_BYTES) if path else BUILT_IN
    try:
        content = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # also of an integer of thousands of digits
        raise _refused(source, f"must be TOML: {' '.join(str(error).split())}") from None
    try:
        return _understood(scenario, source, content)
    except ParameterError as error:
        if error.name == "sde_file":
            raise
        raise _refused(source, str(error)) from None


def _refused(source, allowed):
    return ParameterError("sde_file", source, allowed)


def _understood(scenario, source, content):
    _demand_keys("the file", content, KEYS, KEYS[:-2])
    names = content["states"]
    if not isinstance(names, list) or not all(isinstance(x, str) for x in names):
        raise ParameterError("states", names, "must be a list of names")
    if len(set(names)) < len(names):
        raise ParameterError("states", names, "must be different names")
    checks.integer("number of states", len(names), at_least=1, at_most=MOST_STATES)
    tables = {key: _table(key, content[key], names) for key in TABLES}
    given = content.get("parameters", {})
    if not isinstance(given, dict):
        raise ParameterError("parameters", given, "must be a table of numbers")
    parameters = [checks.number(f"parameters.{k}", x) for k, x in given.items()]
    for key in ("drift", "diffusion"):
        for state, entry in tables[key].items():
            _demand_formula(f"{key}.{state}", entry, key == "diffusion")
    model = sde.system(
        names, list(tables["drift"].values()), list(tables["diffusion"].values()), "", list(given)
    )
    mean = [checks.number(f"mean.{k}", x) for k, x in tables["mean"].items()]
    variance = [
        checks.number(f"variance.{k}", x, at_least=0) for k, x in tables["variance"].items()
    ]
    h, R = _measurement(model, content["measurement"])
    times = {key: checks.number(key, content[key], above=0) for key in NUMBERS}
    _demand_work(scenario, model, **times)
    units = content.get("units", {})
    if not isinstance(units, dict) or not all(isinstance(x, str) for x in units.values()):
        raise ParameterError("units", units, "must be a table of texts")
    for state, unit in units.items():
        if "$" in unit or not unit.isprintable():  # Matplotlib would set a formula
            raise ParameterError(f"units.{state}", unit, "must be plain text of one line without $")
    _demand_keys("units", units, names, ())
    return Own(
        source, model, np.array(parameters), np.array(mean), np.diag(variance), h, R, **times,
        units=tuple(units.get(x, "") for x in names),
    )  # fmt: skip


def _demand_keys(where, content, known, needed):
    unknown = sorted(set(content) - set(known))
    if unknown:
        raise ParameterError(where, unknown[0], f"must hold {', '.join(known)} only")
    missing = [key for key in needed if key not in content]
    if missing:
        raise ParameterError(where, sorted(content), f"must hold {missing[0]!r}, too")


def _table(key, content, names):
    if not isinstance(content, dict):
        raise ParameterError(key, content, "must be a table with an entry for each state")
    _demand_keys(key, content, names, names)
    return {name: content[name] for name in names}


def _demand_formula(name, entry, lists):
    entries = entry if lists and isinstance(entry, list) else [entry]
    for one in entries:
        real = isinstance(one, (int, float)) and not isinstance(one, bool)
        if not isinstance(one, str) and not (real and math.isfinite(one)):
            raise ParameterError(name, one, "must be a formula as text, or a number")


def _measurement(model, content):
    if not isinstance(content, dict):
        raise ParameterError("measurement", content, "must be a table with h and variance")
    _demand_keys("measurement", content, ("h", "variance"), ("h", "variance"))
    h, variance = content["h"], content["variance"]
    texts = isinstance(h, list) and h and all(isinstance(x, str) for x in h)
    if not texts:
        raise ParameterError("measurement.h", h, "must be a list of formulas as texts")
    if not isinstance(variance, list) or len(variance) != len(h):
        allowed = f"must be a list of {len(h)} numbers, one for each entry of h"
        raise ParameterError("measurement.variance", variance, allowed)
    noise = [checks.number("measurement.variance", x, above=0) for x in variance]
    equations.measurement(model, list(h))
    return tuple(x.strip() for x in h), np.diag(noise)


def _demand_work(scenario, model, interval, step, duration):
    steps = checks.parts("step", step, "duration", duration, at_most=STEPS)
    checks.parts("step", step, "interval", interval, at_most=STEPS)
    checks.parts("interval", interval, "duration", duration, at_most=STEPS)
    most = MOST_NUMBERS // (scenario.runs * model.diffusion.shape[1])
    if steps > most:
        allowed = f"must be at most {most} steps of {step:g} with {scenario.runs} runs"
        raise ParameterError("duration", duration, allowed)


# ---------------------------------------------------------------- the path of the notebook


@cache
def _propagator(model, closure):
    return moments.Propagator(moments.close(model, closure))


def observed(own: Own, orders: int = 6) -> list[int] | str:
    """Return the ranks of `seanav.filters.moments.sde.observability` at the start, or why not."""
    values = [*own.mean.tolist(), *own.parameters.tolist()]
    point = dict(zip([*own.names, *(x.name for x in own.model.parameters)], values, strict=True))
    try:
        return sde.observability(own.model, list(own.h), point, orders)
    except ParameterError as error:
        return f"not asked: {error.name} {error.allowed}"


def simulate(scenario: Scenario, own: Own) -> run.Truth:
    """Return simulated runs; NaN after the start in a run that diverged."""
    every = checks.parts("step", own.step, "interval", own.interval, at_most=STEPS)
    steps = checks.parts("step", own.step, "duration", own.duration, at_most=STEPS)
    n, noises = own.model.diffusion.shape
    first = montecarlo.normals(scenario.seed, "own start", scenario.runs, (n,))
    starts = own.mean + first @ np.sqrt(own.P0)
    generators = montecarlo.streams(scenario.seed, "own process", scenario.runs)
    move = moments.Simulator(own.model)

    def batch(chosen):
        normal = np.array([generators[r].standard_normal((steps, noises)) for r in chosen])
        return move(starts[chosen], normal, own.step, None, own.parameters, every)

    x = np.concatenate(montecarlo.parallel_map(batch, run.batches(scenario.runs), label="own"))
    x[~(np.abs(x) < LIMIT).all(axis=(1, 2)), 1:] = np.nan
    return run.Truth("own", own.parameters, np.arange(x.shape[1]) * own.interval, x)


def measure(scenario: Scenario, own: Own, truth: run.Truth) -> np.ndarray:
    """Return the measurements, (runs, samples - 1, k); 0 in runs that are lost."""
    x, H = truth.x[:, 1:], own.measured
    if isinstance(H, np.ndarray):
        z = x @ H.T
    else:
        flat = np.where(np.isfinite(x), x, 0.0).reshape(-1, x.shape[2])
        certain = np.zeros((len(flat), x.shape[2], x.shape[2]))
        z = H(flat, certain, None, own.parameters)[0].reshape(*x.shape[:2], -1)
    runs, *shape = z.shape
    noise = montecarlo.normals(scenario.seed, "own measurement", runs, tuple(shape))
    z = z + noise @ np.sqrt(own.R)
    z[truth.lost] = 0.0  # a filter takes no NaN
    for j, formula in enumerate(own.h):
        if not np.isfinite(z[..., j]).all():
            allowed = f"measurement.h: {formula!r} must be finite in every state that is simulated"
            raise _refused(own.source, allowed)
    return z


def estimate(own: Own, truth: run.Truth, z: np.ndarray, closure: str, corrected: bool) -> Track:
    """Run a filter on all records; not `corrected`: prediction only."""
    track = continuous_discrete.run(
        _propagator(own.model, closure), own.mean, own.P0, z, own.interval, own.step,
        own.R if corrected else None, own.measured, None, own.parameters, LIMIT,
    )  # fmt: skip
    assert track is not None
    for array in (track.mean, track.P, track.nis):
        array[truth.lost, 1:] = np.nan
    return track


def study(scenario: Scenario, own: Own) -> tuple[run.Truth, dict[str, Track]]:
    """Return the truth and the tracks of all closures and of prediction only."""
    truth = simulate(scenario, own)
    z = measure(scenario, own, truth)
    tracks = {closure: estimate(own, truth, z, closure, True) for closure in moments.CLOSURES}
    tracks["prediction only"] = estimate(own, truth, z, "gaussian", False)
    return truth, tracks


def rows(own: Own, truth: run.Truth, tracks: dict[str, Track]) -> list[tuple]:
    """Return rows (filter, state, unit, RMSE, low, high, own sd over RMSE, mean NEES)."""
    listed = []
    for name, track in tracks.items():
        with np.errstate(invalid="ignore"):  # of a filter that diverged
            certain = bool((np.linalg.det(track.P[:, 1:]) != 0).all())  # P = 0 has no NEES
        score = scores.score(truth, track, consistency=certain)
        nees = score.mean_nees() if certain else "no NEES"
        for i, (state, unit) in enumerate(zip(own.names, own.units, strict=True)):
            rmse, ratio = score.rmse(i), score.own_sd_ratio(i)
            ends = ("diverged",) * 3 if rmse.diverged else (rmse.value, rmse.low, rmse.high)
            more = (x if isinstance(x, str) else scores.shown(x) for x in (ratio, nees))
            listed.append((name, state, unit, *ends, *more))
    return listed


def told(own: Own, truth: run.Truth, listed: list[tuple]) -> list[str]:
    """Say for each state how good the closures are, and what measuring is worth."""
    if truth.lost.any():
        many = f"{truth.lost.sum()} of {len(truth.x)}"
        return [f"the system itself left all bounds in {many} runs: no filter has an RMSE"]
    lines = []
    for state, unit in zip(own.names, own.units, strict=True):
        found = {row[0]: row[3] for row in listed if row[1] == state and row[3] != "diverged"}
        free = found.pop("prediction only", None)
        if not found:
            lines.append(f"{state}: every filter diverged")
            continue
        ends = [significant(pick(found.values())) for pick in (min, max)]
        said = f"{state}: RMSE {' to '.join(dict.fromkeys(ends))} {unit}".rstrip()
        if free:
            said += f", {significant(min(found.values()) / free)} of prediction only"
        lines.append(said)
    return lines
