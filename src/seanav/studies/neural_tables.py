"""The comparisons of paper 2: every course with every estimator, one factor at a time."""

from dataclasses import dataclass, replace

import numpy as np

from seanav import estimates
from seanav.filters.neural import READINGS
from seanav.studies import neural_estimator as study
from seanav.studies import neural_scores as scores


@dataclass(frozen=True, eq=False)
class Course:
    """One course: truth (steps, 2), measurements (runs, steps, 2), phases, teaching, estimates."""

    truth: np.ndarray
    z: np.ndarray
    phases: dict
    taught: list
    estimates: dict

    def squared(self, name, phase="examination"):
        """Return each run's mean squared error of an estimator in a phase, (runs,)."""
        return scores.squared(self.estimates[name], self.truth, self.phases[phase])

    def parts(self):
        """Return the examination and its phases, name -> mask; none of them twice."""
        whole = self.phases["examination"]
        smaller = {n: m for n, m in self.phases.items() if (m & whole).any() and (m != whole).any()}
        return {"examination": whole} | smaller


def courses(scenario):
    """Return every course by name, with every estimator of the main table."""
    truths = {name: study.course(scenario, name) for name in study.COURSES}
    measured = {name: study.measure(scenario, truth) for name, truth in truths.items()}
    teachers = {name: study.numerical(scenario, z) for name, z in measured.items()}
    taught = study.teach_courses(scenario, measured, teachers)
    result = {}
    for name, z in measured.items():
        teacher = teachers[name]
        estimates = {
            "teacher": teacher,
            "KF": study.numerical(scenario, z, 0.0),
            "GLS": study.numerical(scenario, z, 1.0),
            "variable w1": study.numerical(scenario, z, "variable"),
            "KF from zero": study.numerical(scenario, z, 0.0, "zero"),
            "GLS from zero": study.numerical(scenario, z, 1.0, "zero"),
        }
        tuned = study.tune(scenario, truths[name])
        estimates |= study.baselines(scenario, z, teacher, tuned)
        for variant in study.VARIANTS:
            estimates[variant] = study.examine(scenario, z, teacher, taught[name], variant)
        phases = study.phases(scenario, truths[name])
        result[name] = Course(truths[name], z, phases, taught[name], estimates)
    return result


def score_rows(done, names, phases=None):
    """Return rows (course, phase, estimator, RMSE, low, high, won, low, high)."""
    rows = []
    for course, result in done.items():
        for phase in result.phases if phases is None else phases:
            for name in names:
                error = scores.rmse(result.estimates[name], result.truth, result.phases[phase])
                won = scores.won(result.squared(name, phase), result.squared("teacher", phase))
                rows.append([course, phase, name, *three(error), *three(won)])
    return rows


def three(estimate):
    """Return value, low and high of an Estimate."""
    return [estimate.value, estimate.low, estimate.high]


def vary(scenario, done, names=study.COURSES, variant="frozen", weights="weights", **changes):
    """Return squared errors (runs,), course -> phase -> (network, teacher), one factor changed.

    The phases are those of `Course.parts`. A change that concerns the first teaching or
    its teacher teaches anew; what equals the default, or must equal it because neither
    reading of Δ stops a run, is taken from `done`.
    """
    changed = replace(scenario, **changes)
    if changed == scenario and weights == "weights":
        return {
            name: {
                phase: tuple(done[name].squared(each, phase) for each in (variant, "teacher"))
                for phase in done[name].parts()
            }
            for name in names
        }
    measured = {name: done[name].z for name in names}
    teachers = {name: study.numerical(changed, z) for name, z in measured.items()}
    later = {"interval", "reteach_epochs", "examination_input"}
    if weights == "weights" and set(changes) <= later:
        taught = {name: done[name].taught for name in names}
    else:
        taught = {}
        if weights == "weights" and set(changes) == {"reading"}:
            taught = {n: done[n].taught for n in names if _stops_nobody(changed, done[n].taught)}
        rest = {name: measured[name] for name in names if name not in taught}
        taught |= study.teach_courses(changed, rest, teachers, weights)
    result = {}
    for name in names:
        estimate = study.examine(changed, measured[name], teachers[name], taught[name], variant)
        truth = done[name].truth
        result[name] = {
            phase: tuple(scores.squared(e, truth, mask) for e in (estimate, teachers[name]))
            for phase, mask in done[name].parts().items()
        }
    return result


def _stops_nobody(scenario, taught):
    # Readings of Δ that stop no run teach alike: the cap ends every one of them.
    reading = READINGS.index(scenario.reading)
    return not any(
        each.met.any() or (each.history[:, reading] < scenario.delta).any() for each in taught
    )


def factor_rows(varied):
    """Return rows (level, course, phase, RMSE, low, high, won against its teacher, low, high)."""
    rows = []
    for level, by_course in varied.items():
        for course, by_phase in by_course.items():
            for phase, (network, teacher) in by_phase.items():
                error, won = estimates.root_mean_square(network), scores.won(network, teacher)
                rows.append([level, course, phase, *three(error), *three(won)])
    return rows


def weight_sweep(scenario, done, purpose=None):
    """Return course -> phase -> w1 -> squared errors (runs,) of the numerical filter.

    The phases are every step from 1 on ("all"), "initial" and those of `Course.parts`.
    """
    result = {}
    for name, course in done.items():
        z = course.z if purpose is None else study.measure(scenario, course.truth, purpose)
        estimates = {w1: study.numerical(scenario, z, w1) for w1 in scenario.weights}
        masks = {"all": np.arange(scenario.steps) >= 1, "initial": course.phases["initial"]}
        result[name] = {
            phase: {w1: scores.squared(x, course.truth, mask) for w1, x in estimates.items()}
            for phase, mask in (masks | course.parts()).items()
        }
    return result


def turn_sweep(scenario, taught):
    """Return name -> list over turn rates of squared errors (runs,) in the examination."""
    result = {"teacher": [], "frozen": []}
    for rate in scenario.turn_rates_deg_s:
        truth = study.turning(scenario, rate)
        z = study.measure(scenario, truth)
        teacher = study.numerical(scenario, z)
        exam = np.arange(scenario.steps) >= scenario.examination
        for name, errors in result.items():
            estimate = teacher
            if name != "teacher":
                estimate = study.examine(scenario, z, teacher, taught, name)
            errors.append(scores.squared(estimate, truth, exam))
    return result


def histories(taught):
    """Return the teaching errors of all runs, (epochs, 3, runs), NaN after a batch stopped."""
    longest = max(len(teaching.history) for teaching in taught)
    parts = []
    for teaching in taught:
        missing = ((0, longest - len(teaching.history)), (0, 0), (0, 0))
        parts.append(np.pad(teaching.history, missing, constant_values=np.nan))
    return np.concatenate(parts, axis=2)


def uncapped(scenario, course):
    """Return the teaching errors of a `Course` as if Δ stopped nobody, (epochs, 3, runs)."""
    if any(teaching.met.any() for teaching in course.taught):
        endless = replace(scenario, delta=1e-12)
        teacher = course.estimates["teacher"]
        return histories(study.first_teaching(endless, course.z, teacher))
    return histories(course.taught)


def stops(history, delta):
    """Return per reading the share of runs below Δ in time and their median epoch, or None."""
    rows = []
    for errors in np.moveaxis(history, 1, 0):
        below = errors < delta
        met = below.any(axis=0)
        epoch = float(np.median(below.argmax(axis=0)[met]) + 1) if met.any() else None
        rows.append((estimates.share(int(met.sum()), met.size), epoch))
    return rows


def slope(network, centre, step=0.5):
    """Return d output / d input of each run's network at `centre` (2, runs), (2, 2, runs)."""
    result = np.empty((2, 2, centre.shape[1]))
    for k in range(2):
        shift = np.zeros_like(centre)
        shift[k] = step
        answers = network(np.stack([centre + shift, centre - shift]))
        result[:, k] = (answers[0] - answers[1]) / (2 * step)
    return result


def origins(scenario):
    """Return the parameters with unit and origin, rows for `Report.parameters`."""
    text, assumed = "text", "assumed"
    rows = {
        "speed": ("m/s", assumed, "a merchant ship"),
        "heading_deg": ("deg", assumed, "neither component is zero"),
        "steps": ("", assumed, "ten minutes; 3 s a step: text"),
        "settle": ("steps", text, "stage 1"),
        "pairs": ("steps", text, "stage 2"),
        "noise": ("m/s", assumed, "per component"),
        "q": ("(m/s)²", assumed, "per step and component"),
        "w1": ("", assumed, "the paper gives no value"),
        "innovation": ("", "derived", "the text: w2 = 0 is GLS"),
        "hidden": ("", text, "20 to 200, 100 chosen"),
        "rate": ("", assumed, ""),
        "spread": ("", assumed, "random: text"),
        "delta": ("scaled", text, "stage 3"),
        "reading": ("", assumed, "the text: a difference"),
        "max_epochs": ("", assumed, "the paper has no cap"),
        "examination_input": ("", assumed, "the text is ambiguous"),
        "interval": ("steps", assumed, "cyclic: text"),
        "reteach_epochs": ("", assumed, ""),
        "learner": ("", text, ""),
        "runs": ("", assumed, "the paper tells of none"),
        "seed": ("", assumed, "the first one tried"),
    }
    return [
        (name, getattr(scenario, name), unit, origin, *([note] if note else []))
        for name, (unit, origin, note) in rows.items()
    ]
