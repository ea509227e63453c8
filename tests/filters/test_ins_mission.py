"""Compiled missions against the plain-numpy reference, and what they refuse."""

import numpy as np
import pytest

from seanav.checks import ParameterError
from seanav.filters import ins
from seanav.filters.ins import reference

LANES, STEPS = ins.LANES, 12
SPREAD = np.r_[[1e-6] * 2, [0.3] * 2, [1e-4] * 3, [5e-4] * 3, [1e-7] * 3, [0.5] * 3]
TWO = {"transition": [[0.8, 0.2], [0.3, 0.7]], "mu0": [0.6, 0.4]}
ONE = {"transition": [[1.0]], "mu0": [1.0]}
THREE = {
    "transition": [[0.8, 0.15, 0.05], [0.3, 0.6, 0.1], [0.1, 0.2, 0.7]],
    "mu0": [0.5, 0.3, 0.2],
}


def _problem(axes=1, models=2, seed=6):
    """Arguments of `ins.fly`: every run has its own start, increments and log."""
    random = np.random.default_rng(seed)
    heading, level = 1.287, 1e-3
    q = np.array([np.cos(heading / 2), level, -level, np.sin(heading / 2)])
    truth = np.zeros((STEPS, 10))
    truth[:, :8] = [0.65, 2.2, 5.0, -6.0, *q / np.linalg.norm(q)]
    truth[:, 8:] = [6.3e6, 5.1e6]
    x0 = np.zeros((ins.NOMINAL, LANES))
    x0[:8], x0[14:] = truth[0, :8, None], 0.5 * random.standard_normal((3, LANES))
    state = reference.from_nominal(x0[:, 0], 0.0)
    through_water = (state.C_bn.T @ state.v_n)[:axes, None]
    A = random.standard_normal((LANES, 16, 40))
    full = A @ A.transpose(0, 2, 1) / 40 * np.outer(SPREAD, SPREAD)
    x0 = ins.shift(x0, 0.3 * SPREAD[:, None] * random.standard_normal((16, LANES)))
    i, j = np.triu_indices(16)
    packed = full[:, i, j].T
    theta = 1e-3 * random.standard_normal((STEPS, 3, LANES))
    dv = np.array([[0.1], [0.2], [-9.8]]) + 0.05 * random.standard_normal((STEPS, 3, LANES))
    rest = 0.3 * SPREAD[7:, None] * random.standard_normal((STEPS, 9, LANES))
    noise = [(0.999, 1e-3), (0.99, 0.05), (0.9995, 0.01)][:models]
    return {
        "theta": theta,
        "dv": dv,
        "z": through_water + 0.5 * random.standard_normal((STEPS, axes, LANES)),
        "truth": truth,
        "x0": x0,
        "P0": np.stack([(1 + k) * packed for k in range(models)]),
        "height": 12.0,
        "R": 0.04,
        "noise": noise,
        "forms": ["sigma"] * models,
        "velocity_noise": 1e-4,
        "attitude_noise": 1e-10,
        "window": 5,
        "cap": 3.0,
        "true_rest": rest,
        **{1: ONE, 2: TWO, 3: THREE}[models],
    }


def _of_run(problem, r):
    """The same as arguments of the reference, for run r."""
    one = {k: v[..., r] for k, v in problem.items() if k in ("theta", "dv", "z", "x0", "true_rest")}
    P0 = np.array([ins.unpack(P)[:, :, r] for P in problem["P0"]])
    return {**problem, **one, "P0": P0}


def _agree(flight, expected, r):
    scale = np.abs(expected.series.errors).max(axis=0)
    gap = flight.series.errors[..., r] - expected.series.errors
    assert np.abs(gap / scale).max() < 1e-8
    for name in ("nees", "mode_probability"):
        ours, theirs = getattr(flight.series, name)[..., r], getattr(expected.series, name)
        assert ours == pytest.approx(theirs, rel=1e-6, abs=1e-12), name
    for name, ours, theirs in zip(
        ins.MeanSquares._fields, flight.mean_squares, expected.mean_squares, strict=True
    ):
        assert ours[r] == pytest.approx(theirs, rel=1e-7), name
    for name in ("nis", "beta", "squared_nis", "nees", "mode_probability"):
        ours, theirs = getattr(flight, name)[..., r], getattr(expected, name)
        assert ours == pytest.approx(theirs, rel=1e-6), name
    for ours, theirs in zip(flight.P, expected.P, strict=True):
        spread = np.sqrt(np.diag(theirs)) + (np.diag(theirs) == 0)
        gap = (ins.unpack(ours)[:, :, r] - theirs) / np.outer(spread, spread)
        assert np.abs(gap).max() < 1e-7


CASES = [
    *({"models": models, "forms": ["sigma"] * models} for models in (1, 2, 3)),
    *({"forms": [form, "none"]} for form in ("none", "block")),
    # These blow up: with the cap at 3 the corrections leave the second order of phi.
    *({"forms": [form, "none"], "cap": 1.2} for form in ("literal", "literal-gain")),
    {"forms": ["variance", "sigma"]},
    {"axes": 3, "forms": ["variance", "literal-gain"], "cap": 1.2},
    # Below its cap the factor shows that residuals and variances are those of all axes.
    {"axes": 3, "forms": ["variance", "sigma"], "cap": 50.0},
    {"axes": 2, "models": 1, "forms": ["none"]},
    *({"about": about} for about in ("relative velocity", "truth")),
]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_mission_is_the_reference(case):
    case = dict(case)
    problem = _problem(case.pop("axes", 1), case.pop("models", 2)) | case
    flight = ins.fly(**problem, stride=1)
    assert flight.mean_squares.north.shape == (LANES,)
    fading = set(problem["forms"]) != {"none"}
    assert fading == (flight.beta.min() > 1.01)  # else nothing is tested
    assert fading == (flight.beta.max() > 1.0)
    if len(problem["mu0"]) > 1:
        # The modes move, so that their order matters.
        assert np.ptp(flight.series.mode_probability, axis=0).min() > 0.01
    for r in range(0, LANES, 5):
        _agree(flight, reference.fly(**_of_run(problem, r)), r)


def test_no_record_changes_nothing_else_and_a_rare_one_is_one_of_many():
    problem = _problem()
    every, none = ins.fly(**problem, stride=1), ins.fly(**problem)
    rare = ins.fly(**problem | {"true_rest": problem["true_rest"][4::5]}, stride=5)
    assert none.series.errors.shape == (0, 16, LANES)
    assert not none.nees.any()
    for one in (none, rare):
        assert np.array_equal(one.P, every.P)
        assert np.array_equal(one.mean_squares, every.mean_squares)
    for ours, theirs in zip(rare.series, every.series, strict=True):
        assert np.array_equal(ours, theirs[4::5])
    assert rare.nees == pytest.approx(every.series.nees[4::5].mean(axis=0))


def test_pure_inertial_navigation_listens_to_nothing():
    problem = _problem(models=1) | {"aided": False, "stride": 1}
    flight, deaf = ins.fly(**problem), ins.fly(**problem | {"z": 0 * problem["z"]})
    assert np.array_equal(flight.series.errors, deaf.series.errors)
    assert np.array_equal(flight.P, problem["P0"])
    assert not flight.nis.any()
    decayed = problem["x0"][14:] * 0.999 ** (1 + np.arange(STEPS))[:, None, None]
    assert flight.series.errors[:, 13:] == pytest.approx(decayed)


def test_a_flight_is_cut_and_joined_by_runs():
    flight = ins.fly(**_problem() | {"true_rest": None}, stride=3)
    both = ins.Flight.join([flight.runs(5), flight])
    assert both.series.north.shape == (4, 5 + LANES)
    assert np.array_equal(both.series.east[:, 5:], flight.series.errors[:, 1])
    assert np.array_equal(both.mode_probability[:, :5], flight.mode_probability[:, :5])
    assert np.array_equal(both.P[..., 5:], flight.P)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"theta": np.zeros((3, 3, LANES))}, "dv = (12, 3, 16): must have the shape (3, 3, 16)"),
        ({"z": np.zeros((STEPS, 4, LANES))}, "axes of z = 4: must be an integer of at least 1"),
        ({"truth": np.zeros((STEPS, 8))}, "truth = (12, 8): must have the shape (12, 10)"),
        ({"x0": np.full((17, LANES), np.nan)}, "x0 = nan: must be finite everywhere"),
        ({"P0": -np.ones((2, 136, LANES))}, "P0 = -1.0: must not be negative on the diagonal"),
        ({"forms": ["sigma"]}, "forms = ['sigma']: must be a list of 2 fading forms"),
        ({"forms": ["sigma", "power"]}, "forms = 'power': must be one of 'none', 'literal'"),
        ({"about": "north"}, "about = 'north': must be one of 'estimate'"),
        ({"R": 0.0}, "R = 0.0: must be a finite number above 0"),
        ({"mu0": [0.5, 0.6]}, "sum of mu0 = 1.1: must be 1"),
        ({"transition": [[1, 0], [0.5, 0.6]]}, "sum of transition = 1.1: must be 1 in every row"),
        ({"stride": 1, "true_rest": np.zeros((3, 9, LANES))}, "true_rest = (3, 9, 16): must have"),
        ({"window": 0}, "window = 0: must be an integer of at least 1"),
        ({"aided": 2}, "aided = 2: must be one of True, False"),
    ],
)
def test_what_cannot_be_flown_is_one_clear_line(change, line):
    with pytest.raises(ParameterError) as caught:
        ins.fly(**_problem() | change)
    assert line in str(caught.value)
