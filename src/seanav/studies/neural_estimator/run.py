"""Paper 2: courses, the four stages of the cycle, every course with every estimator."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import attrs
import numpy as np

from seanav import montecarlo
from seanav.checks import choice
from seanav.filters import blended, neural
from seanav.filters.neural import READINGS
from seanav.studies.neural_estimator.scenario import COURSES, STEP, VARIANTS, Scenario

BATCH = 32  # runs per unit of parallel work; fixed, so that results do not depend on threads
RECENT = 5  # measurements in the hybrid's test
CHI2_99 = 9.21  # 99 % point, two degrees of freedom


def ramp(time: np.ndarray, begin: float, end: float) -> np.ndarray:
    """Return 0 before `begin`, 1 after `end`, linear between (s)."""
    return np.clip((time - begin) / (end - begin), 0.0, 1.0)


def course(scenario: Scenario, name: str) -> np.ndarray:
    """Return the true speed vector of a course, north and east, shape (steps, 2) m/s."""
    choice("course", name, COURSES)
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


def turning(scenario: Scenario, rate_deg_s: float) -> np.ndarray:
    """Return a course that is steady until the examination and then turns for ever."""
    time = STEP * (np.arange(scenario.steps) - scenario.examination)
    turn = rate_deg_s * np.maximum(time, 0.0)
    return _vector(np.full_like(time, scenario.speed), scenario.heading_deg + turn)


def _vector(speed, heading_deg):
    heading = np.deg2rad(heading_deg)
    return np.stack([speed * np.cos(heading), speed * np.sin(heading)], axis=-1)


def measure(scenario: Scenario, truth: np.ndarray, purpose: str = "noise") -> np.ndarray:
    """Return measured speed vectors, (runs, steps, 2) m/s; run r has the same noise everywhere."""
    shape = (scenario.steps, 2)
    return truth + scenario.noise * montecarlo.normals(scenario.seed, purpose, scenario.runs, shape)


def phases(scenario: Scenario, truth: np.ndarray) -> dict[str, np.ndarray]:
    """Return the steps of each phase as masks (steps,), by name.

    The examination is cut where the truth first and last changes in it. A phase without a
    step is left out, such as "initial" where the start is all there is of stage 1.
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
    parts = {"steady": exam}
    if moving.size:
        first, last = moving[[0, -1]]
        parts = {
            "before turn": exam & (step < first),
            "turn": (step >= first) & (step <= last),
            "after turn": step > last,
        }
    return {name: mask for name, mask in (masks | parts).items() if mask.any()}


def squared(estimate: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return each run's mean squared error per component over a phase, (runs,) (m/s)²."""
    return ((estimate - truth)[:, mask] ** 2).mean(axis=(1, 2))


def numerical(
    scenario: Scenario, z: np.ndarray, w1: float | str | None = None, start: str = "measured"
) -> np.ndarray:
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
    choice("start", start, ("measured", "zero"))
    w1 = scenario.w1 if w1 is None else w1
    P0, x0 = (scenario.R, z[:, 0]) if start == "measured" else (scenario.q, np.zeros_like(z[:, 0]))
    K, P = blended.gains(scenario.q, scenario.R, P0, z.shape[1])
    if isinstance(w1, str):
        choice("w1", w1, ("variable",))
        weight = blended.manoeuvre_weight(z, K, P, scenario.R, scenario.q, x0)
        return blended.estimate(z, K, weight, x0, scenario.innovation)
    return blended.estimate(z, K, w1, x0, scenario.innovation)


def baselines(
    scenario: Scenario, z: np.ndarray, teacher: np.ndarray, tuned_q: float
) -> dict[str, np.ndarray]:
    """Return what costs nothing: name -> estimates (runs, steps, 2) m/s."""
    lesson = slice(scenario.settle, scenario.examination)
    constant = np.broadcast_to(teacher[:, lesson].mean(axis=1, keepdims=True), z.shape)
    total = np.cumsum(z, axis=1)
    total[:, 20:] -= np.cumsum(z, axis=1)[:, :-20]
    average = total / np.minimum(np.arange(z.shape[1]) + 1, 20)[:, None]
    tuned = numerical(attrs.evolve(scenario, q=tuned_q), z, 0.0)
    return {
        "unfiltered": z,
        "constant": constant,
        "20-point average": average,
        "tuned KF": tuned,
    }


def tune(
    scenario: Scenario,
    truth: np.ndarray,
    candidates: tuple[float, ...] = (1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1),
) -> float:
    """Return the q whose Kalman filter has the least error in the examination, own noise."""
    z = measure(scenario, truth, "tuning noise")
    first = scenario.examination
    errors = [
        ((numerical(attrs.evolve(scenario, q=q), z, 0.0) - truth)[:, first:] ** 2).mean()
        for q in candidates
    ]
    return candidates[int(np.argmin(errors))]


def _innermost(v):
    return np.ascontiguousarray(np.moveaxis(v, 0, -1))  # (runs, steps, 2) -> (steps, 2, runs)


def batches(runs: int) -> list:
    """Return the runs as slices of fixed size."""
    return [slice(begin, min(begin + BATCH, runs)) for begin in range(0, runs, BATCH)]


def first_teaching(
    scenario: Scenario, z: np.ndarray, teacher: np.ndarray, weights: str = "weights"
) -> list[neural.Teaching]:
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


def teach_courses(
    scenario: Scenario, measured: dict, teachers: dict[str, np.ndarray], weights: str = "weights"
) -> dict:
    """Return the first teaching by course; courses with the same lesson share one."""
    taught, seen = {}, {}
    lesson = slice(scenario.settle, scenario.examination)
    for name, z in measured.items():
        key = z[:, lesson].tobytes() + teachers[name][:, lesson].tobytes()
        if key not in seen:
            seen[key] = first_teaching(scenario, z, teachers[name], weights)
        taught[name] = seen[key]
    return taught


def examine(
    scenario: Scenario,
    z: np.ndarray,
    teacher: np.ndarray,
    taught: Sequence,
    variant: str = "frozen",
) -> np.ndarray:
    """Return the estimates (runs, steps, 2) m/s; before the examination the teacher's.

    Every variant uses measurements up to its own step only. ``re-taught``: every
    `interval` steps the last `pairs` pairs are taught again, starting from the weights
    at hand. ``self-taught``: the teacher's answers are exchanged for the network's own.
    ``hybrid``: while the mean of the last 5 measurements agrees with the mean of the
    lesson (99 % point of chi-squared), estimate and next lesson are the network's own;
    otherwise both are the numerical filter's.
    """
    choice("variant", variant, VARIANTS)
    if scenario.learner == "MLPRegressor" and variant == "frozen":
        return scikit_learn(scenario, z, teacher)[0]

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


def scikit_learn(
    scenario: Scenario, z: np.ndarray, teacher: np.ndarray, unit: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the frozen estimates of scikit-learn's MLPRegressor, and its iterations (runs,).

    Same hidden layer and lesson; linear outputs, quasi-Newton teaching. The pairs are scaled as
    those of the network, or with a `unit` (m/s) measured in it from the lesson's mean. Needs
    scikit-learn, which is not among the package's own requirements.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPRegressor

    lesson, first = slice(scenario.settle, scenario.examination), scenario.examination
    asked = z if scenario.examination_input == "measurement" else teacher
    result, iterations = np.array(teacher), np.empty(len(z))
    with warnings.catch_warnings():
        # The cap on its iterations is a stop like any other.
        warnings.simplefilter("ignore", ConvergenceWarning)
        for run in range(len(z)):
            middle = teacher[run, lesson].mean(axis=0)
            network = MLPRegressor(
                hidden_layer_sizes=(scenario.hidden,), activation="logistic", solver="lbfgs",
                alpha=0.0, max_iter=scenario.max_epochs, random_state=run,
            ).fit(*(_scaled(x[run, lesson], middle, unit) for x in (z, teacher)))  # fmt: skip
            iterations[run] = network.n_iter_
            answers = network.predict(_scaled(asked[run, first:], middle, unit))
            own = neural.unscale(answers) if unit is None else middle + unit * answers
            result[run, first:] = own
    return result, iterations


def _scaled(x, middle, unit):
    return neural.scale(x) if unit is None else (x - middle) / unit


@dataclass(frozen=True, eq=False)
class Course:
    """One course: truth (steps, 2), measurements (runs, steps, 2), phases, teaching, estimates."""

    truth: np.ndarray
    z: np.ndarray
    phases: dict
    taught: list
    estimates: dict

    def squared(self, name: str, phase: str = "examination") -> np.ndarray:
        """Return each run's mean squared error of an estimator in a phase, (runs,)."""
        return squared(self.estimates[name], self.truth, self.phases[phase])

    def parts(self) -> dict[str, np.ndarray]:
        """Return the examination and its phases, name -> mask; none of them twice."""
        whole = self.phases["examination"]
        smaller = {n: m for n, m in self.phases.items() if (m & whole).any() and (m != whole).any()}
        return {"examination": whole} | smaller


def courses(scenario: Scenario) -> dict[str, Course]:
    """Return every course by name, with every estimator of the main table."""
    truths = {name: course(scenario, name) for name in COURSES}
    measured = {name: measure(scenario, truth) for name, truth in truths.items()}
    teachers = {name: numerical(scenario, z) for name, z in measured.items()}
    taught = teach_courses(scenario, measured, teachers)
    result = {}
    for name, z in measured.items():
        teacher = teachers[name]
        estimates = {
            "teacher": teacher,
            "KF": numerical(scenario, z, 0.0),
            "GLS": numerical(scenario, z, 1.0),
            "variable w1": numerical(scenario, z, "variable"),
            "KF from zero": numerical(scenario, z, 0.0, "zero"),
            "GLS from zero": numerical(scenario, z, 1.0, "zero"),
            "teacher from zero": numerical(scenario, z, start="zero"),
        }
        tuned = tune(scenario, truths[name])
        estimates |= baselines(scenario, z, teacher, tuned)
        for variant in VARIANTS:
            estimates[variant] = examine(scenario, z, teacher, taught[name], variant)
        parts = phases(scenario, truths[name])
        result[name] = Course(truths[name], z, parts, taught[name], estimates)
    return result


def vary(
    scenario: Scenario,
    done: dict[str, Course],
    names: tuple[str, ...] = COURSES,
    variant: str = "frozen",
    weights: str = "weights",
    **changes: Any,
) -> dict:
    """Return squared errors (runs,), course -> phase -> (network, teacher), one factor changed.

    The phases are those of `Course.parts`. A change that concerns the first teaching or
    its teacher teaches anew; what equals the default, or must equal it because neither
    reading of Δ stops a run, is taken from `done`.
    """
    changed = attrs.evolve(scenario, **changes)
    if changed == scenario and weights == "weights":
        return {
            name: {
                phase: tuple(done[name].squared(each, phase) for each in (variant, "teacher"))
                for phase in done[name].parts()
            }
            for name in names
        }
    measured = {name: done[name].z for name in names}
    teachers = {name: numerical(changed, z) for name, z in measured.items()}
    later = {"interval", "reteach_epochs", "examination_input"}
    if weights == "weights" and set(changes) <= later:
        taught = {name: done[name].taught for name in names}
    else:
        taught = {}
        if weights == "weights" and set(changes) == {"reading"}:
            taught = {n: done[n].taught for n in names if _stops_nobody(changed, done[n].taught)}
        rest = {name: measured[name] for name in names if name not in taught}
        taught |= teach_courses(changed, rest, teachers, weights)
    result = {}
    for name in names:
        estimate = examine(changed, measured[name], teachers[name], taught[name], variant)
        truth = done[name].truth
        result[name] = {
            phase: tuple(squared(e, truth, mask) for e in (estimate, teachers[name]))
            for phase, mask in done[name].parts().items()
        }
    return result


def _stops_nobody(scenario, taught):
    # Readings of Δ that stop no run teach alike: the cap ends every one of them.
    reading = READINGS.index(scenario.reading)
    return not any(
        each.met.any() or (each.history[:, reading] < scenario.delta).any() for each in taught
    )
