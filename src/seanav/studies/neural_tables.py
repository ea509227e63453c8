"""The comparisons of paper 2: every course with every estimator, one factor at a time."""

from dataclasses import dataclass, replace

import numpy as np

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
    """Return course -> (network, teacher), squared errors (runs,), one factor changed.

    A change that concerns the first teaching or its teacher teaches anew; what equals
    the default is taken from `done`.
    """
    changed = replace(scenario, **changes)
    if changed == scenario and weights == "weights":
        return {name: tuple(map(done[name].squared, (variant, "teacher"))) for name in names}
    measured = {name: done[name].z for name in names}
    teachers = {name: study.numerical(changed, z) for name, z in measured.items()}
    later = {"interval", "reteach_epochs", "examination_input"}
    if weights == "weights" and set(changes) <= later:
        taught = {name: done[name].taught for name in names}
    else:
        taught = study.teach_courses(changed, measured, teachers, weights)
    result = {}
    for name in names:
        estimate = study.examine(changed, measured[name], teachers[name], taught[name], variant)
        mask = done[name].phases["examination"]
        truth = done[name].truth
        result[name] = tuple(scores.squared(e, truth, mask) for e in (estimate, teachers[name]))
    return result


def factor_rows(varied):
    """Return rows (level, course, RMSE, low, high, won against its teacher, low, high)."""
    rows = []
    for level, by_course in varied.items():
        for course, (network, teacher) in by_course.items():
            error = scores.montecarlo.root_mean_square(network)
            rows.append([level, course, *three(error), *three(scores.won(network, teacher))])
    return rows


def weight_sweep(scenario, done, purpose=None):
    """Return course -> w1 -> squared errors (runs,) of the numerical filter from step 1 on."""
    result = {}
    for name, course in done.items():
        z = course.z if purpose is None else study.measure(scenario, course.truth, purpose)
        mask = np.arange(scenario.steps) >= 1
        result[name] = {
            w1: scores.squared(study.numerical(scenario, z, w1), course.truth, mask)
            for w1 in scenario.weights
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


def stops(history, delta):
    """Return per reading the share of runs below Δ in time and their median epoch, or None."""
    rows = []
    for errors in np.moveaxis(history, 1, 0):
        below = errors < delta
        met = below.any(axis=0)
        epoch = float(np.median(below.argmax(axis=0)[met]) + 1) if met.any() else None
        rows.append((scores.montecarlo.share(int(met.sum()), met.size), epoch))
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
