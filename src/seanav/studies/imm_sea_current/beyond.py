"""Paper 4, beyond the paper: chains, starts, three models, a changing sea, assumptions."""

import math
from collections.abc import Sequence
from dataclasses import replace

import attrs
import numpy as np

from seanav import montecarlo
from seanav.checks import ParameterError
from seanav.filters import fading
from seanav.filters.ins.score import Flight
from seanav.studies.imm_sea_current import linear, printed, run
from seanav.studies.imm_sea_current.scenario import Scenario

GRID = (0.05, 0.1, 0.3, 0.6, 1.0)  # of the true sigma, m/s, where the scenario's grid has them
CAUSES = (0.6, 0.9, 1.0)  # m/s, of these, where fading may be the cause of a lead
PLACES = (0.375, 0.5, 0.625)  # of the mission: before, at and after the middle corner of a square
STAY = (0.8, 0.9, 0.95, 0.98)


def grid(scenario: Scenario) -> tuple[float, ...]:
    """Return the points of `GRID` that the scenario has, or else all of its own."""
    return tuple(s for s in scenario.sigma_true if s in GRID) or scenario.sigma_true


def chain(p: float, models: int = 2) -> tuple:
    """Return a transition matrix whose diagonal is p, the rest shared evenly."""
    T = np.full((models, models), (1.0 - p) / (models - 1))
    np.fill_diagonal(T, p)
    return tuple(map(tuple, T.tolist()))


def with_chain(filter_: run.Filter, p: float) -> run.Filter:
    """Return an IMM with another p and even initial probabilities."""
    models = len(filter_.sigma)
    return replace(
        filter_,
        name=f"{filter_.name} p={p:g}",
        transition=chain(p, models),
        initial_probabilities=(1.0 / models,) * models,
    )


def chains(scenario: Scenario, swept: dict[str, list[Flight]]) -> dict[str, list[Flight]]:
    """Fly the IMMs of the paper with every p of `STAY`; `swept` is the sweep of the paper."""
    known, filters = dict(swept), []
    for pair in imms(scenario):
        for one in (with_chain(pair, p) for p in STAY):
            same = (one.transition, one.initial_probabilities)
            if same == (scenario.transition, scenario.initial_probabilities):
                known[one.name] = swept[pair.name]
            filters.append(one)
    found = run.sweep(scenario, filters, grid(scenario), known=known, label="transition matrix")
    return _only(found, filters)


def other_p(scenario: Scenario) -> float:
    """Return the other likely reading of the diagonal of T: 0.95, or 0.9 beside that."""
    return 0.95 if scenario.transition[0][0] != 0.95 else 0.9


def diagonals(scenario: Scenario) -> dict[str, str]:
    """Return the two readings of T in words, and what the names of their IMMs end in."""
    p = other_p(scenario)
    return {f"p = {scenario.transition[0][0]:g}": "", f"p = {p:g}": f" p={p:g}"}


def other_imms(scenario: Scenario) -> list[run.Filter]:
    """Return the IMMs of the paper with the other diagonal of T."""
    return [with_chain(one, other_p(scenario)) for one in imms(scenario)]


def filters(scenario: Scenario) -> dict[str, run.Filter]:
    """Return all filters that claims speak of, by name, but the optimal ones."""
    pairs = [f for f in run.paper_filters(scenario) if len(f.sigma) > 1]
    chained = [with_chain(f, p) for f in pairs for p in (*STAY, other_p(scenario))]
    return {f.name: f for f in (run.PURE, *run.paper_filters(scenario), *chained)}


def causes(scenario: Scenario, swept: dict[str, list[Flight]]) -> dict[str, list[Flight]]:
    """Fly IMMs of plain EKFs with the other diagonal on `cause_grid`, beside the sweep."""
    plain = [with_chain(run.EKF(*pair), other_p(scenario)) for pair in run.pairs(scenario)]
    return run.sweep(scenario, plain, cause_grid(scenario), known=swept, label="without fading")


def cause_grid(scenario: Scenario) -> tuple[float, ...]:
    """Return the points at which the causes of claims 4.9 and 4.29 are looked for."""
    return tuple(s for s in scenario.sigma_true if s in CAUSES) or scenario.sigma_true


def other_start(scenario: Scenario) -> Scenario:
    """Return the scenario whose true current starts the other way."""
    start = "stationary" if scenario.initial_current == "zero" else "zero"
    return attrs.evolve(scenario, initial_current=start)


def started(scenario: Scenario) -> dict[str, list[Flight]]:
    """Fly the filters of Tables 2 and 3 and the IMMs, with both diagonals of T, on `GRID`."""
    singles = [make for s in scenario.sigma_filter[:2] for make in _singles(scenario, s)]
    filters = [*singles, *imms(scenario), *other_imms(scenario)]
    return run.sweep(scenario, filters, grid(scenario), label="the other start")


def _singles(scenario, s):
    return run.EKF(s), run.AFEKF(scenario, s)


def three(scenario: Scenario, swept: dict[str, list[Flight]]) -> dict[str, list[Flight]]:
    """Fly IMMs of all models, with fading and without, beside those of two."""
    if len(scenario.sigma_filter) < 2:
        return swept
    both = (run.AFEKF(scenario, *scenario.sigma_filter), run.EKF(*scenario.sigma_filter))
    p = scenario.transition[0][0]
    filters = [replace(with_chain(f, p), name=f.name) for f in both]
    filters = [f for f in filters if f.name not in swept]  # of two models: a pair of the paper
    pairs = [f for f in run.paper_filters(scenario) if len(f.sigma) == 2]
    found = run.sweep(scenario, filters, grid(scenario), known=swept, label="three models")
    return _only(found, [*filters, *pairs])


def imms(scenario: Scenario) -> Sequence:
    """Return the IMMs of the paper."""
    return [run.AFEKF(scenario, *pair) for pair in run.pairs(scenario)]


def _only(found, filters):
    names = [run.PURE.name, "optimal EKF", *(f.name for f in filters)]
    return {name: found[name] for name in names}


def changing(
    scenario: Scenario,
    low: float = 0.1,
    high: float = 0.8,
    at: float = 0.5,
    stride: int = 60,
) -> dict[str, Flight]:
    """Fly a mission whose current is multiplied by high/low (m/s) at once.

    The whole vector of the current jumps, as when a vehicle crosses a front; its noise grows
    by the same factor. `at` is the share of the mission that is then over.

    Returns
    -------
    dict of name to Flight with series
    """
    steps = int(scenario.duration_s)
    sigma = np.where(np.arange(steps) < int(at * steps), low, high)
    filters = [run.EKF(0.1), run.AFEKF(scenario, 0.1), run.EKF(0.5)]
    filters += [run.AFEKF(scenario, 0.1, 0.5), run.EKF(0.1, 0.5)]
    missions = run.fly_all(scenario, [(f, sigma) for f in filters], stride=stride)
    return {f.name: mission for f, mission in zip(filters, missions, strict=True)}


def forms(
    scenario: Scenario, sigma_filter: float = 0.1, sigmas: tuple[float, ...] = (0.05, 1.0)
) -> dict[str, list[Flight]]:
    """Fly one adaptive filter in every fading form; {form: [Flight per true sigma]}."""
    made = {form: run.Filter(form, (sigma_filter,), form) for form in fading.FORMS}
    jobs = [(one, sigma) for one in made.values() for sigma in sigmas]
    missions = iter(run.fly_all(scenario, jobs, label="fading forms"))
    return {form: [next(missions) for _ in sigmas] for form in made}


def linearised(scenario: Scenario, about: str) -> dict[tuple[float, ...], Flight]:
    """Fly the EKFs of Tables 2 and 3 with H at the `about` of `seanav.filters.ins.fly`.

    Returns
    -------
    dict
        {(sigma_true, sigma_filter): Flight}; with the forward axis of the log alone, the
        only one that the linear model knows.
    """
    scenario = attrs.evolve(scenario, log_axes=1)
    cases = [(sigma, one) for sigma in printed.SIGMA.values() for one in (0.1, 0.5)]
    jobs = [(replace(run.EKF(one), about=about), sigma) for sigma, one in cases]
    missions = run.fly_all(scenario, jobs, label=f"H at the {about}")
    return dict(zip(cases, missions, strict=True))


def assumptions(scenario: Scenario) -> list:
    """Return the table rows (what, RMS of ln(ours / printed)) of the EKF cells, linear.

    Each row changes one assumed value of the scenario; NaN where the rest of the scenario
    does not allow it, such as a corner that is too large for the lap.
    """
    start = {"initial_position_m": 10.0, "initial_velocity": 1e-2}
    tilt = {"initial_tilt_rad": 1e-5, "initial_heading_rad": 1e-4}
    variants = [
        ("as assumed", {}),
        ("current starts from its stationary law", {"initial_current": "stationary"}),
        ("circle", {"trajectory": "circle"}),
        ("straight", {"trajectory": "straight"}),
        ("corner radius 100 m", {"corner_radius": 100.0}),
        ("corner radius 1000 m", {"corner_radius": 1000.0}),
        ("initial position and velocity 10 times worse", start),
        ("initial tilt 10, heading 100 times worse", tilt),
        ("the same, drawn", {**tilt, **start, "initial_errors": "drawn"}),
        ("correlation time 1 h", {"correlation_time_s": 3600.0}),
        ("correlation time 4 h", {"correlation_time_s": 14400.0}),
    ]

    def one(variant):
        name, change = variant
        try:
            changed = attrs.evolve(scenario, **change)
        except ParameterError:
            return name, math.nan
        return name, table_distance(changed)

    return montecarlo.parallel_map(one, variants, label="assumptions")


def table_distance(scenario: Scenario) -> float:
    """Return the RMS of ln(ours / printed) of the 16 EKF cells by linear covariance."""
    logs = []
    for table, sigma in printed.SIGMA.items():
        for one in (0.1, 0.5):
            ours = linear.scores(scenario, one, sigma)[:4]
            logs.append(np.log(ours / printed.CELLS[table][f"EKF {one:g}"]))
    return float(np.sqrt(np.mean(np.square(logs))))
