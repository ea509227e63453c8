"""Whatever a parameter is set to: the study runs to its end, or one line says no at once.

The values come from the declarations: bounds and what lies beside them, other types, huge
and tiny numbers, empty, long, unsorted and repeated lists. A hundred cases a paper here;
`make soak` tries as many as SEANAV_CASES says, with other numbers each time.
"""

import math
import os
import random
import warnings
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from bounded import limit
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

from seanav.checks import ParameterError
from seanav.scenario import Choice, Integer, List, Number, Text
from seanav.studies.adaptive_fading import run as fading_run
from seanav.studies.adaptive_fading import scenario as fading
from seanav.studies.gravity_planning import run as gravity_run
from seanav.studies.gravity_planning import scenario as gravity
from seanav.studies.imm_sea_current import run as imm_run
from seanav.studies.imm_sea_current import scenario as imm
from seanav.studies.imm_sea_current import scores as imm_scores
from seanav.studies.ito_filter import run as ito_run
from seanav.studies.ito_filter import scenario as ito
from seanav.studies.neural_estimator import run as neural_run
from seanav.studies.neural_estimator import scenario as neural

SOAK = "SEANAV_CASES" in os.environ
CASES = int(os.environ.get("SEANAV_CASES", "100"))
PART = 250  # cases of one test: parts that several processes can share out evenly
SECONDS = 120  # that a case may take on a busy machine; on a quiet one it takes a fraction of one

# ---------------------------------------------------------------- values

ODD = [None, True, False, "", "x", "nan", b"x", 1j, math.nan, math.inf, -math.inf, -1, 0, 1, 0.5]
ODD += [
    -0.0,
    5e-324,
    1e308,
    -1e308,
    10**400,
    10**5000,
    2**63,
    [],
    {},
    [[]],
    [1],
    [1.0, 1.0],
    [math.nan],
]
ODD += [["x"], [None], [[1.0, 2.0]], np.float64(0.5), np.int64(3), np.array([1.0, 2.0])]


def allowed(kind, default):
    """Return a strategy for values that `kind` allows, edges first."""
    if isinstance(kind, Integer):
        most = kind.at_most if kind.at_most is not None else kind.at_least + 10**6
        return st.sampled_from([kind.at_least, most]) | st.integers(kind.at_least, most)
    if isinstance(kind, Number):
        low, high = max(kind.above, kind.at_least), min(kind.below, kind.at_most)
        edges = [x for x in (low, high, np.nextafter(low, math.inf), np.nextafter(high, -math.inf))]
        usual = [default * factor for factor in (0.1, 0.5, 0.99, 1.01, 2.0, 10.0)]
        ends = [e for e in edges if math.isfinite(e)]
        return (
            st.sampled_from([float(x) for x in ends + usual])
            | st.floats(0.0, 1.0).map(lambda share: default * 10 ** (6 * share - 3))
            | st.floats(max(low, -1e9), min(high, 1e9))
        )
    if isinstance(kind, Choice):
        return st.sampled_from(kind.options)
    if isinstance(kind, List):
        least, most = (
            (kind.at_least, min(kind.at_most, 6)) if kind.count is None else (kind.count,) * 2
        )
        entries = default if len(default) else (1.0,)
        return st.lists(
            st.sampled_from(entries).flatmap(lambda x: allowed(kind.of, x)),
            min_size=least,
            max_size=most,
        )
    if isinstance(kind, Text):
        return st.text(max_size=8)
    return st.just(default)


class Study(NamedTuple):
    """A small study: parameters that keep it small, sizes that are tried, what is run."""

    scenario: type
    small: dict
    sizes: dict
    run: Callable


def neural_study(scenario):
    for course in neural_run.courses(scenario).values():
        for name, x in course.estimates.items():
            assert np.isfinite(x).all(), name


def fading_study(scenario):
    for plane in fading.PLANES:
        case = fading_run.problem(scenario, plane)
        _, outcomes = fading_run.compare(scenario, case, fading_run.draw(scenario, plane))
        for name, outcome in outcomes.items():
            assert np.isfinite(outcome.errors).all(), name


def imm_study(scenario):
    for name, flights in imm_run.sweep(scenario, threads=1).items():
        for flight in flights:
            finite = np.isfinite(imm_scores.squares(flight)).all()
            assert finite or imm_scores.diverged(flight), name


def ito_study(scenario):
    for case, result in ito_run.run_all(scenario).items():
        for name, score in result.scores.items():
            for component in range(6):
                found = score.rmse(component)  # NaN, as a number, would have raised
                assert found.diverged or np.isfinite(found.value), (case, name)


def gravity_study(scenario):
    chart = scenario.map()
    own = scenario.user_path(chart)
    level = scenario.planning_noise_mgal
    plan = gravity_run.plan(scenario, chart, scenario.start_1, level)
    ends = (scenario.start_1, scenario.goal)
    sailed, _ = gravity_run.fan(chart, *ends, scenario.fan_1_km, scenario.samples)
    sailed["Planned"] = gravity_run.plan_path(plan, chart, scenario.samples)
    sailed |= {} if own is None else {"Own": own}
    noise = gravity_run.draw(scenario)
    for name, row in gravity_run.run_all(scenario, chart, noise, sailed, (level,)).items():
        assert np.isfinite(row[0].squared).all(), name


def few(*values):
    return st.sampled_from(values)


STUDIES = {
    "1": Study(
        ito.Scenario,
        {"runs": 2, "particle_runs": 2, "particles": 8, "mission": 2.0, "map_interval": [0.5]},
        {
            "runs": few(2, 3), "particle_runs": few(2, 3), "particles": few(2, 9),
            "mission": few(1.0, 1.5, 3.0, 0.9), "interval": few(0.1, 0.25, 0.5, 1.0, 0.3),
            "map_interval": few([0.1], [0.5, 0.25], [1.0, 0.3], [0.5, 0.5]),
            "torpedo_step": few(0.005, 0.01, 0.02, 0.05, 0.03), "sphere_step": few(0.01, 0.05, 1.0),
            "filter_step": few(0.01, 0.05, 0.1, 0.5, 0.03), "map_step": few(0.01, 0.02, 0.05, 0.7),
        },
        ito_study,
    ),
    "2": Study(
        neural.Scenario,
        {"runs": 2, "steps": 70, "hidden": 5, "max_epochs": 10, "reteach_epochs": 2},
        {
            "runs": few(2, 3), "steps": st.integers(1, 90), "settle": st.integers(1, 80),
            "pairs": st.integers(2, 80), "hidden": few(1, 2, 9), "max_epochs": few(1, 2, 30),
            "reteach_epochs": few(1, 4), "interval": st.integers(1, 100),
            "hidden_sizes": few([1], [3, 2], [4, 4], []),
        },
        neural_study,
    ),
    "3": Study(
        fading.Scenario,
        {"runs": 2, "settings": 4, "sweep_runs": 2, "duration": 60.0, "fault_time": 30.0},
        {
            "runs": few(2, 3), "settings": few(4, 5), "sweep_runs": few(2, 3),
            "dt": st.floats(0.02, 4.0), "duration": st.floats(30, 120),
            "fault_time": st.floats(0, 120),
        },
        fading_study,
    ),
    "4": Study(
        imm.Scenario,
        {"runs": 2, "duration_s": 300.0, "corner_radius": 100.0, "sigma_true": [0.1, 0.9]},
        {
            "runs": few(2, 3), "duration_s": few(60.0, 61.0, 300.0, 601.0, 59.0, 100.5),
            "sigma_true": few([0.5], [1.0, 0.05], [0.1, 0.1], [0.001], [10.0], []),
            "sigma_filter": few([0.5], [1.0, 0.05], [0.1, 0.1], [0.001, 10.0], [0.3, 0.2, 0.1], []),
            "transition": few([[1, 0], [0, 1]], [[0.5, 0.5], [0.5, 0.5]], [[0, 1], [1, 0]], [[1]]),
        },
        imm_study,
    ),
    "5": Study(
        gravity.Scenario,
        {"runs": 3, "samples": 12, "fan_1_km": [11.0], "pairs": 2, "label_pairs": 2},
        {
            "runs": few(3, 4), "samples": few(10, 11, 30), "pairs": few(2, 3),
            "label_pairs": few(2, 3), "map_source": few("geoid", "synthetic", "none.nc", "tests"),
            "map_variable": few("", "2", "x"), "start_1": st.lists(st.integers(0, 101), min_size=2),
            "goal": st.lists(st.integers(0, 101), min_size=2, max_size=2),
            "user_path_km": few([], [[1, 2]], [[1, 2], [1, 2]], [[1, 2], [90, 80.5], [1, 2]]),
            "fan_1_km": few([0.0], [5.5, 5.5], [500.0], [-99.0, 99.0], [1e300], []),
        },
        gravity_study,
    ),
}  # fmt: skip

# ---------------------------------------------------------------- the test


def chosen(study):
    """Return a strategy for {name: value} of one to three parameters."""
    declared = study.scenario.declared()

    def one(name):
        default, about = declared[name]
        usual = study.sizes.get(name, allowed(about.kind, default))
        return st.tuples(st.just(name), usual | usual | usual | st.sampled_from(ODD))

    names = st.lists(st.sampled_from(sorted(declared)), min_size=1, max_size=3, unique=True)
    return names.flatmap(lambda drawn: st.tuples(*map(one, drawn))).map(dict)


def outcome(study, changes):
    """Return "refused" or "run"; anything else that happens is an error."""
    try:
        with limit(SECONDS), warnings.catch_warnings():
            warnings.simplefilter("error")
            study.run(study.scenario(**study.small | changes))
        return "run"
    except ParameterError as error:
        said = error
    assert said.name in study.scenario.declared(), said
    assert "\n" not in str(said)
    assert len(str(said)) < 400, said
    return "refused"


def parts(cases):
    """Return how many cases each test of a paper takes, `cases` together."""
    return [min(PART, cases - first) for first in range(0, cases, PART)]


@pytest.mark.parametrize("part", range(len(parts(CASES))))
@pytest.mark.parametrize("paper", STUDIES)
def test_any_value_runs_or_is_refused_in_one_line(paper, part):
    study, counts, cases = STUDIES[paper], {"run": 0, "refused": 0}, parts(CASES)[part]
    study.run(study.scenario(**study.small))  # derives and compiles what the time limit is not for
    own = random.SystemRandom().getrandbits(64) if SOAK else 0  # each part with other numbers

    @settings(
        max_examples=cases,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
    @seed(own)
    @given(chosen(study))
    def case(changes):
        counts[outcome(study, changes)] += 1

    print(f"paper {paper}, part {part}: seed {own}")
    case()
    print(f"paper {paper}, part {part}: {counts}")
    assert min(counts.values()) > cases // 10, counts


def test_parts_are_all_cases():
    assert [parts(n) for n in (100, 250, 700)] == [[100], [250], [250, 250, 200]]
