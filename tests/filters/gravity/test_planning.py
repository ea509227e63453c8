import bounded
import numpy as np
import pytest
import walks
from hypothesis import given, settings
from hypothesis import strategies as st

from seanav.checks import ParameterError
from seanav.filters.gravity import planning

START, GOAL = (1, 4), (6, 0)  # (east, north) on a map of 5 rows and 8 columns


def task(seed=0, **changes):
    return walks.problem(walks.field(5, 8, seed), START, GOAL, **changes)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("process_noise", [0.0, 0.05, 1.0])
def test_search_is_the_textbook_a_star(seed, process_noise):
    this = task(seed, process_noise=process_noise)
    plan = planning.plan(**this)
    nodes, cost, expanded = walks.textbook_a_star(this)
    np.testing.assert_array_equal(plan.nodes, nodes)
    assert plan.cost == pytest.approx(cost, rel=1e-12)
    assert plan.expanded == expanded


def test_plan_carries_the_bound_along_its_nodes_and_the_sum_of_its_traces():
    this = task(spacing=3.0, speed=2.0)
    plan = planning.plan(**this)
    assert tuple(plan.nodes[0]) == START
    assert tuple(plan.nodes[-1]) == GOAL
    assert (np.abs(np.diff(plan.nodes, axis=0)).max(axis=1) == 1).all()
    np.testing.assert_allclose(plan.covariance, walks.walk_bound(this, plan.nodes), rtol=1e-11)
    assert plan.cost == pytest.approx(np.trace(plan.covariance[1:], axis1=1, axis2=2).sum())


def test_flat_map_gives_the_straight_line_and_its_closed_form_cost():
    flat = np.zeros((2, 4, 9))
    plan = planning.plan(flat, 10.0, (1, 2), (7, 2), 1.0, 100 * np.eye(2), 0.2, 5.0)
    np.testing.assert_array_equal(plan.nodes, [(j, 2) for j in range(1, 8)])
    per_step = 2 * 0.2 * 10.0 / 5.0
    assert plan.cost == pytest.approx(sum(200 + k * per_step for k in range(1, 7)), rel=1e-14)


def test_ties_go_to_the_smaller_cell_number():
    # On a flat map without process noise every shortest path costs the same.
    flat = np.zeros((2, 5, 5))
    plan = planning.plan(flat, 1.0, (0, 2), (4, 2), 1.0, np.eye(2), 0.0, 1.0)
    np.testing.assert_array_equal(plan.nodes, [(0, 2), (1, 1), (2, 0), (3, 1), (4, 2)])


def test_path_bends_to_the_band_that_carries_information():
    gradient = np.zeros((2, 7, 12))
    gradient[:, 5] = np.stack([np.ones(12), np.arange(12) % 2])
    this = walks.problem(gradient, (0, 2), (11, 2), noise=0.1)
    assert (planning.plan(**this).nodes[:, 1] == 5).sum() >= 5


@pytest.mark.parametrize("move", ["east", "north", "turn"])
@pytest.mark.parametrize("seed", range(3))
def test_moving_the_map_moves_the_plan(move, seed):
    this = task(seed)
    there, carry = walks.moved(this, move)
    plan, other = planning.plan(**this), planning.plan(**there)
    np.testing.assert_array_equal(other.nodes, carry(plan.nodes))
    assert other.cost == pytest.approx(plan.cost, rel=1e-12)


@pytest.mark.parametrize(
    "scale",
    [
        lambda t: t | {"gradient": t["gradient"] * 1e-8, "noise": t["noise"] * 1e-8},
        lambda t: t | {"process_noise": t["process_noise"] * 3, "speed": t["speed"] * 3},
        lambda t: t | {"spacing": t["spacing"] * 3, "speed": t["speed"] * 3},
    ],
    ids=["map and noise", "process noise and speed", "spacing and speed"],
)
def test_only_ratios_of_units_matter(scale):
    plan, other = planning.plan(**task()), planning.plan(**scale(task()))
    np.testing.assert_array_equal(other.nodes, plan.nodes)
    assert other.cost == pytest.approx(plan.cost, rel=1e-12)


def alternating(east):
    """Columns that measure east and north in turn, on a map of 3 rows."""
    gradient = np.zeros((2, 3, east))
    gradient[0, :, 0::2] = gradient[1, :, 1::2] = 1.0
    changes = {"noise": 1e-4, "P0": 1e-6 * np.eye(2), "process_noise": 0.1}
    return walks.problem(gradient, (0, 1), (east - 1, 1), **changes)


def test_heuristic_of_the_paper_is_not_admissible_but_half_of_it_is_and_is_tight():
    # Each step adds q to both axes and one measurement takes it from one of them at most,
    # so a step can cost as little as q per metre, half of what the paper's H assumes.
    this = alternating(east=7)
    cheapest, _ = walks.best_walk(this)
    heuristic = 2 * this["process_noise"] * 6
    assert cheapest < 0.51 * heuristic
    assert cheapest >= 0.5 * heuristic


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.05, 1.0), st.floats(0.01, 1.0))
def test_half_the_heuristic_never_exceeds_the_cheapest_walk(seed, process_noise, noise):
    changes = {"noise": noise, "process_noise": process_noise, "P0": 0.01 * np.eye(2)}
    this = walks.problem(walks.field(3, 4, seed), (0, 0), (3, 2), **changes)
    cheapest, _ = walks.best_walk(this)
    assert process_noise * np.hypot(3, 2) <= cheapest * (1 + 1e-12)


def test_no_closed_cell_is_reached_more_cheaply_while_the_heuristic_is_consistent():
    for seed in range(5):  # a step's trace stays above the process noise of the step here
        assert planning.plan(**task(seed, process_noise=0.05)).reopenings == 0


def test_closed_cell_reached_more_cheaply_is_counted_and_stays_closed():
    # Steps cheaper than the heuristic's: informative cells among poor ones, tiny P0.
    strength = np.exp(2 * np.random.default_rng(19).normal(size=(6, 9)))
    changes = {"process_noise": 1.0, "noise": 0.05, "P0": 1e-3 * np.eye(2)}
    this = walks.problem(walks.field(6, 9, 19) * strength, (0, 1), (8, 3), **changes)
    plan = planning.plan(**this)
    assert plan.reopenings == 1
    np.testing.assert_array_equal(plan.nodes, walks.textbook_a_star(this)[0])


# Numbers whose squares or products are none, or that leave the bound a variance of nothing.
EXTREME = [
    "process_noise=1e100, P0=1e60 * np.eye(2)",
    "process_noise=1e154",
    "process_noise=1e300",
    "P0=1e160 * np.eye(2)",
    "P0=1e-170 * np.eye(2), process_noise=0.0",
    "speed=1e-300",
    "spacing=1e300, speed=1e-300",
    "noise=1e-10, process_noise=0.0",
    "noise=1e-170",
    "noise=1e170",
    "gradient=1e170 * walks.field(5, 8, 0)",
]


@pytest.mark.parametrize("changes", EXTREME)
def test_search_ends_with_a_positive_cost_or_one_line(changes):
    # In its own process: where costs overflow, the way back to the start was a circle.
    code = f"""
import numpy as np, walks
from seanav.checks import ParameterError
from seanav.filters.gravity import planning
this = walks.problem(walks.field(5, 8, 0), {START}, {GOAL}) | dict({changes})
try:
    plan = planning.plan(**this)
except ParameterError as error:
    print(error)
else:
    assert 0 < plan.cost < np.inf
    assert np.linalg.eigvalsh(plan.covariance).min() > 0
    print("planned")
"""
    told = bounded.run(code).splitlines()
    assert len(told) == 1
    assert told[0] == "planned" or ": must " in told[0]


def test_a_bound_that_rounding_decides_is_refused_with_what_decides_it():
    this = task(noise=1e-10, process_noise=0.0)
    allowed = "must leave every covariance finite and positive definite in double precision"
    with pytest.raises(ParameterError, match=allowed) as caught:
        planning.plan(**this)
    assert str(caught.value).startswith("noise, P0, process_noise, speed = (1e-10, [[2.0, 0.6], ")


BAD = {
    "start": [(-1, 0), (8, 0), (0, 5), (1.5, 2), (1, 2, 3), "ab", None, ((1, 2), 3), (2**70, 0)],
    "goal": [(8, 4), (0, -1), START],
    "noise": [0.0, -2.0, np.inf, "2"],
    "spacing": [0.0],
    "speed": [0.0, -5.0],
    "process_noise": [-1e-4],
    "P0": [np.zeros((2, 2)), np.full((2, 2), np.nan), np.eye(3), "unit", [[1, 2], [2, 1]]],
    "gradient": [
        np.zeros((5, 8)),
        np.zeros((3, 5, 8)),
        np.zeros((2, 0, 8)),
        np.zeros((2, 5, 8), complex),
        np.full((2, 5, 8), np.nan),
    ],
}


@pytest.mark.parametrize(("name", "value"), [(n, v) for n, values in BAD.items() for v in values])
def test_unusable_parameter_is_named_in_one_line(name, value):
    with pytest.raises(ParameterError, match=f"^{name} = .*: must ") as caught:
        planning.plan(**task() | {name: value})
    assert "\n" not in str(caught.value)
    if name == "start":
        assert "[0 … 7, 0 … 4]" in str(caught.value)


@pytest.mark.parametrize("change", [np.asfortranarray, lambda map_: map_[:, ::-1, ::-1]])
def test_layout_of_the_map_in_memory_does_not_matter(change):
    this = task()
    there = this | {"gradient": change(this["gradient"])}
    same = this | {"gradient": there["gradient"].copy(order="C")}
    for one, other in zip(*(vars(planning.plan(**t)).values() for t in (there, same)), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("kind", [np.float32, np.int64])
def test_map_of_another_type_is_the_map_of_its_values(kind):
    gradient = np.round(4 * walks.field(5, 8, 0)).astype(kind)
    plan = planning.plan(**task() | {"gradient": gradient})
    same = planning.plan(**task() | {"gradient": gradient.astype(float)})
    np.testing.assert_array_equal(plan.nodes, same.nodes)
    assert plan.cost == same.cost
