"""The label planner in use: symmetries, what it is given, what it may take."""

import bounded
import numpy as np
import pytest
import walks

from seanav.checks import ParameterError
from seanav.filters.gravity import labels, planning

START, GOAL = (0, 1), (4, 3)  # (east, north)
NOISES = [0.05, 0.001, 0.3]  # process noise


def task(seed, process_noise=0.05):
    return walks.problem(walks.field(5, 5, seed), START, GOAL, process_noise=process_noise)


# Use ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("move", ["east", "north", "turn"])
def test_moving_the_map_moves_the_plan(move):
    this = walks.problem(walks.field(5, 8, 2), (1, 4), (6, 0), process_noise=0.01)
    there, carry = walks.moved(this, move)
    plan, other = (labels.plan_labels(**t, epsilon=0.0) for t in (this, there))
    np.testing.assert_array_equal(other.nodes, carry(plan.nodes))
    assert other.cost == pytest.approx(plan.cost, rel=1e-12)


def test_units_of_the_map_do_not_matter():
    this = task(6, 0.001)
    scaled = this | {"gradient": 1e-8 * this["gradient"], "noise": 1e-8 * this["noise"]}
    plan, other = (labels.plan_labels(**t, epsilon=0.0) for t in (this, scaled))
    np.testing.assert_array_equal(other.nodes, plan.nodes)
    assert other.cost == pytest.approx(plan.cost, rel=1e-12)


def test_same_problem_gives_the_same_bits_with_or_without_a_table():
    this = walks.problem(walks.field(9, 12, 1), (0, 0), (11, 8))
    plan = labels.plan_labels(**this, epsilon=0.1)
    table = labels.gain_table(this["gradient"])
    again = labels.plan_labels(**this, epsilon=0.1, table=table)
    for one, other in zip(vars(plan).values(), vars(again).values(), strict=True):
        np.testing.assert_array_equal(one, other)


def test_incumbent_prunes_and_comes_back_when_nothing_is_cheaper():
    this = task(6, 0.001)
    optimum = labels.plan_labels(**this, epsilon=0.0)
    again = labels.plan_labels(**this, epsilon=0.0, incumbent=optimum)
    np.testing.assert_array_equal(again.nodes, optimum.nodes)
    assert again.cost == pytest.approx(optimum.cost, rel=1e-14)
    assert again.complete
    assert again.labels < optimum.labels


def test_cost_of_the_incumbent_is_computed_for_this_problem():
    this = task(6, 0.001)
    easier = planning.plan(**this | {"noise": 0.01})
    assert easier.cost < labels.plan_labels(**this, epsilon=0.0).cost
    plan = labels.plan_labels(**this, epsilon=0.0, incumbent=easier)
    assert plan.cost == labels.plan_labels(**this, epsilon=0.0).cost


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("epsilon", -0.1),
        ("epsilon", np.nan),
        ("max_expansions", 0),
        ("max_expansions", 1.5),
        ("max_expansions", 2**70),
        ("max_comparisons", 0),
    ],
)
def test_unusable_option_is_named(name, value):
    with pytest.raises(ParameterError, match=f"^{name} = .*: must be a"):
        labels.plan_labels(**task(0), **{"epsilon": 0.3} | {name: value})


@pytest.mark.parametrize("change", [{"start": (4, 3), "goal": (0, 1)}, {"goal": (3, 3)}])
def test_incumbent_must_lead_from_start_to_goal(change):
    other = planning.plan(**task(0) | change)
    with pytest.raises(ParameterError, match=r"^incumbent = .* from start to goal$"):
        labels.plan_labels(**task(0), epsilon=0.3, incumbent=other)


WALKS = [
    [START, GOAL],
    [START, START, GOAL],
    [START, (2, 1), (2, 3), GOAL],
    [START, (-1, 2), (0, 3), (1, 3), (2, 3), (3, 3), GOAL],  # off the map and back
    [START, (1, 2), (2, 3), (3, 4), (4, 5), (5, 4), GOAL],  # and over its far edges
    [START, (1.0, 1.5), (2, 2), (3, 3), GOAL],
    [START],
    [],
    "walk",
]


@pytest.mark.parametrize("other", ["walk", 3, planning.Plan([[1], [2, 3]], *[None] * 4)])
def test_incumbent_must_be_a_plan(other):
    with pytest.raises(ParameterError, match=r"^incumbent = .* over adjacent nodes"):
        labels.plan_labels(**task(0), epsilon=0.3, incumbent=other)


def test_nodes_of_the_incumbent_may_be_unsigned():
    plan = planning.plan(**task(0))
    same = planning.Plan(plan.nodes.astype(np.uint8), *[None] * 4)
    one, other = (labels.plan_labels(**task(0), epsilon=0.3, incumbent=p) for p in (plan, same))
    np.testing.assert_array_equal(one.nodes, other.nodes)


@pytest.mark.parametrize("nodes", WALKS)
def test_incumbent_must_be_a_walk(nodes):
    jumps = planning.Plan(np.array(nodes), None, None, None, None)
    with pytest.raises(ParameterError, match=r"^incumbent = .* over adjacent nodes"):
        labels.plan_labels(**task(0), epsilon=0.3, incumbent=jumps)


TABLES = [
    lambda table: table[:-1],
    lambda table: np.repeat(table, 2, axis=-1)[..., ::2],
    lambda table: np.ma.array(table, mask=table < np.median(table)),
    lambda table: -table,
    lambda table: table.astype(float),
    lambda table: np.asfortranarray(table),
    lambda table: table * np.float32(np.nan),
    lambda table: table.tolist(),
    lambda _: "table",
]


@pytest.mark.parametrize("change", TABLES)
def test_table_must_fit_the_map(change):
    table = change(labels.gain_table(task(0)["gradient"]))
    with pytest.raises(ParameterError, match=r"^table = .*: must be gain_table\(gradient\)$"):
        labels.plan_labels(**task(0), epsilon=0.3, table=table)


def test_a_table_that_may_not_be_written_or_is_a_subclass_serves_too():
    table = labels.gain_table(task(0)["gradient"])
    expected = labels.plan_labels(**task(0), epsilon=0.3, table=table)
    table.flags.writeable = False
    for same in (table, table.view(np.recarray)):
        assert labels.plan_labels(**task(0), epsilon=0.3, table=same).cost == expected.cost


# Bounds of the work --------------------------------------------------------------------------


def test_search_stops_at_its_limit_of_comparisons_and_says_so():
    # Exact on so many cells, it would not end in a life; its bound holds all the same.
    this = walks.problem(walks.field(60, 80, 0), (2, 3), (77, 55))
    plan = labels.plan_labels(**this, epsilon=0.0, max_comparisons=200_000)
    assert plan.stopped_by == "comparisons"
    assert not plan.complete
    assert 200_000 <= plan.comparisons <= 200_000 + 16 * plan.labels
    assert 0 < plan.lower_bound < plan.cost


def test_search_stops_at_its_limit_of_labels_and_says_so(monkeypatch):
    this = task(6, 0.001)
    optimum = labels.plan_labels(**this, epsilon=0.0)
    assert (optimum.stopped_by, optimum.complete) == ("", True)
    monkeypatch.setattr(labels, "MOST_LABELS", 40)
    plan = labels.plan_labels(**this, epsilon=0.0)
    assert plan.stopped_by == "labels"
    assert 32 < plan.labels <= 40
    assert plan.lower_bound <= optimum.cost <= plan.cost


def test_search_stops_at_its_limit_of_expansions_and_says_so():
    assert labels.plan_labels(**task(6), epsilon=0.0, max_expansions=3).stopped_by == "expansions"


def test_default_limits_keep_a_search_to_a_minute_and_its_store_below_half_a_gigabyte():
    code = """
import walks
from seanav.filters.gravity import labels
this = walks.problem(walks.field(101, 101, 0), (2, 3), (97, 95), process_noise=1e-3)
plan = labels.plan_labels(**this, epsilon=0.0)
print(plan.stopped_by, plan.labels <= labels.MOST_LABELS)
"""
    assert bounded.run(code, seconds=150).split() in (["labels", "True"], ["comparisons", "True"])


def test_table_that_would_take_more_memory_than_it_may_is_refused():
    with pytest.raises(ParameterError, match=r"^gradient = \(2, 340, 300\): must have fewer cells"):
        labels.gain_table(np.broadcast_to(0.0, (2, 340, 300)))


@pytest.mark.parametrize(
    "change",
    [{"noise": 1e-10}, {"P0": 1e-170 * np.eye(2)}, {"P0": 1e160 * np.eye(2)}],
)
def test_covariance_that_rounding_decides_is_refused(change):
    this = task(0, 0.0) | change
    known = planning.Plan(walks.straight(this), None, None, None, None)
    with pytest.raises(
        ParameterError, match=r"must leave .* positive definite in double precision"
    ):
        labels.plan_labels(**this, epsilon=0.0, incumbent=known)


@pytest.mark.parametrize("gradient", [np.ones((2, 3)), np.full((2, 3, 3), np.nan), "map", []])
def test_gain_table_needs_two_slopes_at_each_node(gradient):
    with pytest.raises(ParameterError, match=r"^gradient = .*: must "):
        labels.gain_table(gradient)


def test_problem_is_checked_as_by_the_single_label_planner():
    with pytest.raises(ParameterError, match=r"^goal = .*: must differ from the start$"):
        labels.plan_labels(**task(0) | {"goal": START}, epsilon=0.3)
