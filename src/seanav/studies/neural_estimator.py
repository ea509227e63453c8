"""Paper 2: the neural state estimator and its teacher.

Stateczny (2000). The scenario, the courses, the four stages of the cycle. Scores and
comparisons are in `seanav.studies.neural_scores`.
"""

import warnings
from dataclasses import dataclass, replace

import numpy as np

from seanav import checks, montecarlo
from seanav.filters import neural

BATCH = 32  # runs per unit of parallel work; fixed, so that results do not depend on threads
STEP = 3.0  # s, twenty steps a minute
COURSES = ("steady", "one turn", "two turns", "turn while teaching", "zigzag")
VARIANTS = ("frozen", "re-taught", "self-taught", "hybrid")
INPUTS = ("measurement", "estimate")
RECENT = 5  # measurements in the hybrid's test
CHI2_99 = 9.21  # 99 % point, two degrees of freedom


@dataclass(frozen=True)
class Scenario:
    """Everything that can be chosen, checked at once; speeds in m/s.

    Raises
    ------
    seanav.checks.ParameterError
        One line that names the parameter, its value and what is allowed.
    """

    speed: float = 6.0
    heading_deg: float = 30.0
    steps: int = 200
    settle: int = 20
    pairs: int = 20
    noise: float = 0.3
    q: float = 0.005
    w1: float = 0.3
    innovation: str = "blended"
    hidden: int = 100
    rate: float = 0.1
    spread: float = 0.5
    delta: float = 0.001
    reading: str = "max"
    max_epochs: int = 500
    examination_input: str = "measurement"
    interval: int = 5
    reteach_epochs: int = 30
    learner: str = "delta rule"
    hidden_sizes: tuple = (20, 50, 100, 200)
    weights: tuple = (0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
    intervals: tuple = (5, 10, 20)
    turn_rates_deg_s: tuple = (0.0, 0.003, 0.006, 0.01, 0.02, 0.05, 0.1, 0.2)
    runs: int = 320
    seed: int = 2

    def __post_init__(self):
        integer, number, choice = checks.integer, checks.number, checks.choice
        number("speed", self.speed, above=0, below=10)
        number("heading_deg", self.heading_deg)
        integer("settle", self.settle, at_least=1)
        integer("pairs", self.pairs, at_least=1)
        integer("steps", self.steps, at_least=1)
        if self.steps <= self.examination:
            allowed = f"must exceed settle + pairs = {self.examination}: no examination is left"
            raise checks.ParameterError("steps", self.steps, allowed)
        number("noise", self.noise, above=0)
        number("q", self.q, above=0)
        number("w1", self.w1, at_least=0, at_most=1)
        choice("innovation", self.innovation, ("blended", "printed"))
        integer("hidden", self.hidden, at_least=1)
        number("rate", self.rate, above=0)
        number("spread", self.spread, above=0)
        number("delta", self.delta, above=0)
        choice("reading", self.reading, neural.READINGS)
        integer("max_epochs", self.max_epochs, at_least=1)
        choice("examination_input", self.examination_input, INPUTS)
        integer("interval", self.interval, at_least=1)
        integer("reteach_epochs", self.reteach_epochs, at_least=1)
        choice("learner", self.learner, ("delta rule", "MLPRegressor"))
        self._list("hidden_sizes", lambda name, value: integer(name, value, at_least=1))
        self._list("weights", lambda name, value: number(name, value, at_least=0, at_most=1))
        self._list("intervals", lambda name, value: integer(name, value, at_least=1))
        self._list("turn_rates_deg_s", lambda name, value: number(name, value, at_least=0))
        integer("runs", self.runs, at_least=2)
        integer("seed", self.seed, at_least=0)

    def _list(self, name, check):
        value = getattr(self, name)
        if not isinstance(value, (list, tuple)) or not value:
            raise checks.ParameterError(name, value, "must be a list of at least one number")
        object.__setattr__(self, name, tuple(check(name, item) for item in value))

    def quick(self):
        """Return the scenario with a tenth of the runs."""
        return replace(self, runs=max(2, self.runs // 10))

    @property
    def R(self):
        """Measurement variance per component, (m/s)²."""
        return self.noise**2

    @property
    def examination(self):
        """First step of the examination."""
        return self.settle + self.pairs


# ---------------------------------------------------------------- truth and measurements


def ramp(time, begin, end):
    """Return 0 before `begin`, 1 after `end`, linear between (s)."""
    return np.clip((time - begin) / (end - begin), 0.0, 1.0)


def course(scenario, name):
    """Return the true speed vector of a course, north and east, shape (steps, 2) m/s."""
    checks.choice("course", name, COURSES)
    time = STEP * np.arange(scenario.steps)
    turn, speed = np.zeros_like(time), np.full_like(time, scenario.speed)
    if name == "one turn":
        turn = 60.0 * ramp(time, 180, 300)
    elif name == "two turns":
        turn = 90.0 * (ramp(time, 180, 300) + ramp(time, 360, 480))
        speed -= 1.5 * (ramp(time, 180, 240) - ramp(time, 420, 480))
    elif name == "turn while teaching":
        begin, end = STEP * scenario.settle, STEP * scenario.examination
        turn = 20.0 * ramp(time, begin, end - STEP)
    elif name == "zigzag":
        turn = 35.0 * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * time / 180.0))
    return _vector(speed, scenario.heading_deg + turn)


def turning(scenario, rate_deg_s):
    """Return a course that is steady until the examination and then turns for ever."""
    time = STEP * (np.arange(scenario.steps) - scenario.examination)
    turn = rate_deg_s * np.maximum(time, 0.0)
    return _vector(np.full_like(time, scenario.speed), scenario.heading_deg + turn)


def _vector(speed, heading_deg):
    heading = np.deg2rad(heading_deg)
    return np.stack([speed * np.cos(heading), speed * np.sin(heading)], axis=-1)


def measure(scenario, truth, purpose="noise"):
    """Return measured speed vectors, (runs, steps, 2) m/s; run r has the same noise everywhere."""
    shape = (scenario.steps, 2)
    return truth + scenario.noise * montecarlo.normals(scenario.seed, purpose, scenario.runs, shape)


def phases(scenario, truth):
    """Return the steps of each phase as masks (steps,), by name.

    The examination is cut where the truth first and last changes in it.
    """
    step = np.arange(scenario.steps)
    exam = step >= scenario.examination
    masks = {
        "initial": (step >= 1) & (step < scenario.settle),
        "collecting": (step >= scenario.settle) & ~exam,
        "examination": exam,
    }
    changes = np.append(False, np.abs(np.diff(truth, axis=0)).max(axis=1) > 1e-9)
    moving = np.flatnonzero(changes & exam)
    if moving.size == 0:
        return masks | {"steady": exam}
    parts = {
        "before turn": exam & (step < moving[0]),
        "turn": (step >= moving[0]) & (step <= moving[-1]),
        "after turn": step > moving[-1],
    }
    return masks | {name: mask for name, mask in parts.items() if mask.any()}


# ---------------------------------------------------------------- stages 1 and 2


def numerical(scenario, z, w1=None, start="measured"):
    """Return the estimates of the numerical filter, (runs, steps, 2) m/s.

    Parameters
    ----------
    z : ndarray, shape (runs, steps, 2)
        Measurements, m/s.
    w1 : float or "variable", optional
        Default: the scenario's.
    start : {"measured", "zero"}
        x0 = z0 with P0 = R, or x0 = 0 with P0 = q, far too small.
    """
    checks.choice("start", start, ("measured", "zero"))
    w1 = scenario.w1 if w1 is None else w1
    P0, x0 = (scenario.R, z[:, 0]) if start == "measured" else (scenario.q, np.zeros_like(z[:, 0]))
    K, P = neural.gains(scenario.q, scenario.R, P0, z.shape[1])
    if isinstance(w1, str):
        checks.choice("w1", w1, ("variable",))
        w1 = neural.manoeuvre_weight(z, K, P, scenario.R, scenario.q, x0)
    return neural.estimate(z, K, w1, x0, scenario.innovation)


def baselines(scenario, z, teacher, tuned_q):
    """Return what costs nothing: name -> estimates (runs, steps, 2) m/s."""
    lesson = slice(scenario.settle, scenario.examination)
    constant = np.broadcast_to(teacher[:, lesson].mean(axis=1, keepdims=True), z.shape)
    total = np.cumsum(z, axis=1)
    total[:, 20:] -= np.cumsum(z, axis=1)[:, :-20]
    average = total / np.minimum(np.arange(z.shape[1]) + 1, 20)[:, None]
    tuned = numerical(replace(scenario, q=tuned_q), z, 0.0)
    return {
        "unfiltered": z,
        "constant": constant,
        "20-point average": average,
        "tuned KF": tuned,
    }


def tune(scenario, truth, candidates=(1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1)):
    """Return the q whose Kalman filter has the least error in the examination, own noise."""
    z = measure(scenario, truth, "tuning noise")
    first = scenario.examination
    errors = [
        ((numerical(replace(scenario, q=q), z, 0.0) - truth)[:, first:] ** 2).mean()
        for q in candidates
    ]
    return candidates[int(np.argmin(errors))]


# ---------------------------------------------------------------- stage 3: teaching


def _innermost(v):
    return np.ascontiguousarray(np.moveaxis(v, 0, -1))  # (runs, steps, 2) -> (steps, 2, runs)


def batches(runs):
    """Return the runs as slices of fixed size."""
    return [slice(begin, min(begin + BATCH, runs)) for begin in range(0, runs, BATCH)]


def first_teaching(scenario, z, teacher, weights="weights"):
    """Return the `neural.Teaching` of each batch after stage 3; random weights by run.

    Parameters
    ----------
    z, teacher : ndarray, shape (runs, steps, 2)
        Measurements and the numerical filter's estimates, m/s.
    weights : str
        Purpose of the random stream: another name is another draw.
    """
    generators = montecarlo.streams(scenario.seed, weights, len(z))
    lesson = slice(scenario.settle, scenario.examination)

    def one(part):
        return neural.teach(
            neural.random_network(generators[part], scenario.hidden, scenario.spread),
            _innermost(z[part, lesson]),
            _innermost(teacher[part, lesson]),
            rate=scenario.rate,
            delta=scenario.delta,
            reading=scenario.reading,
            max_epochs=scenario.max_epochs,
        )

    return montecarlo.parallel_map(one, batches(len(z)), label=f"teaching, H = {scenario.hidden}")


def teach_courses(scenario, measured, teachers, weights="weights"):
    """Return the first teaching by course; courses with the same lesson share one."""
    taught, seen = {}, {}
    lesson = slice(scenario.settle, scenario.examination)
    for name, z in measured.items():
        key = z[:, lesson].tobytes() + teachers[name][:, lesson].tobytes()
        if key not in seen:
            seen[key] = first_teaching(scenario, z, teachers[name], weights)
        taught[name] = seen[key]
    return taught


# ---------------------------------------------------------------- stage 4: examination


def examine(scenario, z, teacher, taught, variant="frozen"):
    """Return the estimates (runs, steps, 2) m/s; before the examination the teacher's.

    Every variant uses measurements up to its own step only. ``re-taught``: every
    `interval` steps the last `pairs` pairs are taught again, starting from the weights
    at hand. ``self-taught``: the teacher's answers are exchanged for the network's own.
    ``hybrid``: while the mean of the last 5 measurements agrees with the mean of the
    lesson (99 % point of chi-squared), estimate and next lesson are the network's own;
    otherwise both are the numerical filter's.
    """
    checks.choice("variant", variant, VARIANTS)
    if scenario.learner == "MLPRegressor" and variant == "frozen":
        return scikit_learn(scenario, z, teacher)

    def one(item):
        part, teaching = item
        return _examine(scenario, z[part], teacher[part], teaching.network, variant)

    work = list(zip(batches(len(z)), taught, strict=True))
    return np.concatenate(montecarlo.parallel_map(one, work, label=f"examination, {variant}"))


def _examine(scenario, z, teacher, network, variant):
    measured, taught = _innermost(z), _innermost(teacher)
    asked = measured if scenario.examination_input == "measurement" else taught
    first, pairs = scenario.examination, scenario.pairs
    result, lesson = taught.copy(), taught.copy()
    if variant == "frozen":
        result[first:] = network(asked[first:])
        return np.moveaxis(result, -1, 0)
    reference = measured[first - pairs : first].mean(axis=0)
    recent = min(RECENT, first)
    variance = scenario.R * (1 / recent + 1 / pairs)
    for i in range(first, len(z[0])):
        answer = network(asked[i : i + 1])[0]
        own = np.full(z.shape[0], variant == "self-taught")
        result[i] = answer
        if variant == "hybrid":
            shift = measured[i - recent + 1 : i + 1].mean(axis=0) - reference
            own = (shift**2).sum(axis=0) < CHI2_99 * variance
            result[i] = np.where(own, answer, taught[i])
        lesson[i] = np.where(own, answer, taught[i])
        if (i - first + 1) % scenario.interval == 0:
            window = slice(i - pairs + 1, i + 1)
            network = neural.teach(
                network,
                measured[window],
                lesson[window],
                rate=scenario.rate,
                delta=scenario.delta,
                reading=scenario.reading,
                max_epochs=scenario.reteach_epochs,
            ).network
            reference = measured[window].mean(axis=0)
    return np.moveaxis(result, -1, 0)


def scikit_learn(scenario, z, teacher):
    """Return the frozen estimates of scikit-learn's MLPRegressor, an independent network.

    Same hidden layer and lesson; linear outputs, quasi-Newton teaching. Needs
    scikit-learn, which is not among the package's own requirements.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPRegressor

    lesson, first = slice(scenario.settle, scenario.examination), scenario.examination
    asked = z if scenario.examination_input == "measurement" else teacher
    result = np.array(teacher)
    with warnings.catch_warnings():
        # The cap on its iterations is a stop like any other.
        warnings.simplefilter("ignore", ConvergenceWarning)
        for run in range(len(z)):
            network = MLPRegressor(
                hidden_layer_sizes=(scenario.hidden,),
                activation="logistic",
                solver="lbfgs",
                alpha=0.0,
                max_iter=scenario.max_epochs,
                random_state=run,
            ).fit(neural.scale(z[run, lesson]), neural.scale(teacher[run, lesson]))
            answers = network.predict(neural.scale(asked[run, first:]))
            result[run, first:] = neural.unscale(answers)
    return result
