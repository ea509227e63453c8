import itertools

import numpy as np
import pytest
import walks

from seanav.filters.gravity import labels, planning

START, GOAL = (0, 1), (4, 3)  # (east, north)
NOISES = [0.05, 0.001, 0.3]  # process noise


def task(seed, process_noise=0.05):
    return walks.problem(walks.field(5, 5, seed), START, GOAL, process_noise=process_noise)


def random_covariance(rng):
    root = rng.normal(size=(2, 2)) * rng.uniform(0.1, 2.0, 2)
    return root @ root.T + 1e-3 * np.eye(2)


@pytest.mark.parametrize("process_noise", NOISES)
@pytest.mark.parametrize("seed", range(8))
def test_exact_search_finds_the_best_of_all_walks(seed, process_noise):
    this = task(seed, process_noise)
    cheapest, nodes = walks.best_walk(this)
    plan = labels.plan_labels(**this, epsilon=0.0)
    assert plan.cost == pytest.approx(cheapest, rel=1e-10)
    np.testing.assert_array_equal(plan.nodes, nodes)
    assert plan.complete
    assert plan.lower_bound == plan.cost
    assert planning.plan(**this).cost >= cheapest * (1 - 1e-12)


def test_exact_search_without_process_noise_and_with_many_equal_walks():
    # Slopes of two kinds only: the order of the cells makes no difference to P.
    kinds = np.random.default_rng(2).integers(0, 2, (5, 5))
    gradient = np.stack([1.0 - kinds, 0.5 * kinds])
    tiny = walks.problem(gradient, START, GOAL, process_noise=1e-6)
    none = tiny | {"process_noise": 0.0}
    cheapest, _ = walks.best_walk(tiny)
    assert labels.plan_labels(**none, epsilon=0.0).cost == pytest.approx(cheapest, rel=1e-5)


def test_one_label_per_cell_misses_the_optimum():
    this = task(seed=6, process_noise=0.001)
    cheapest, _ = walks.best_walk(this)
    assert planning.plan(**this).cost > 1.2 * cheapest


def test_best_walk_may_enter_a_cell_twice():
    this = task(seed=5, process_noise=0.001)
    nodes = labels.plan_labels(**this, epsilon=0.0).nodes
    assert len(np.unique(nodes, axis=0)) < len(nodes)


def test_plan_carries_the_bound_along_its_nodes_and_the_sum_of_its_traces():
    this = walks.problem(walks.field(12, 17, 0), (15, 2), (1, 9), spacing=3.0, speed=2.0)
    plan = labels.plan_labels(**this, epsilon=0.05)
    assert plan.labels > 2048  # the label store has grown
    assert tuple(plan.nodes[0]) == (15, 2)
    assert tuple(plan.nodes[-1]) == (1, 9)
    assert (np.abs(np.diff(plan.nodes, axis=0)).max(axis=1) == 1).all()
    np.testing.assert_allclose(plan.covariance, walks.walk_bound(this, plan.nodes), rtol=1e-10)
    assert plan.cost == pytest.approx(walks.walk_cost(this, plan.nodes), rel=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_tolerance_costs_at_most_what_a_star_costs_and_never_beats_the_optimum(seed):
    this = task(seed, 0.001)
    optimum = labels.plan_labels(**this, epsilon=0.0)
    for epsilon in (0.01, 0.3, 3.0):
        plan = labels.plan_labels(**this, epsilon=epsilon)
        assert optimum.cost * (1 - 1e-12) <= plan.cost <= planning.plan(**this).cost * (1 + 1e-12)
        assert plan.lower_bound <= optimum.cost
        assert plan.labels <= optimum.labels


@pytest.mark.parametrize("epsilon", [0.0, 0.2])
@pytest.mark.parametrize("seed", range(4))
def test_search_is_the_textbook_label_search(seed, epsilon):
    this = walks.problem(walks.field(4, 6, seed), (0, 3), (5, 0), process_noise=0.01)
    assert_textbook_search(this, epsilon)


def assert_textbook_search(this, epsilon, limit=1_000_000):
    """Compare with the search from plain lists, label for label; both know the straight walk."""
    table = labels.gain_table(this["gradient"])
    known = planning.Plan(walks.straight(this), None, None, None, None)
    plan = labels.plan_labels(**this, epsilon=epsilon, incumbent=known, max_expansions=limit)
    nodes, cost, lowest, expanded, made = walks.textbook_labels(
        this, epsilon, lambda node, P: remaining(this, table, node, P), limit
    )
    np.testing.assert_array_equal(plan.nodes, nodes)
    assert plan.cost == pytest.approx(cost, rel=1e-12)
    assert (plan.expanded, plan.labels) == (expanded, made)
    if epsilon == 0.0:
        assert plan.lower_bound == pytest.approx(lowest, rel=1e-12)
        assert plan.complete == (lowest == cost)


@pytest.mark.parametrize("limit", [1, 7, 30, 100])
@pytest.mark.parametrize("seed", range(4))
def test_search_that_is_cut_off_certifies_the_lowest_open_label(seed, limit):
    this = walks.problem(walks.field(4, 6, seed), (0, 3), (5, 0), process_noise=0.01)
    assert_textbook_search(this, 0.0, limit)


@pytest.mark.parametrize(("kinds", "seed"), [(1, 0), (2, 0), (2, 1), (2, 2)])
def test_ties_go_to_the_older_label_and_equal_covariances_are_equal(kinds, seed):
    # Slopes of one or two kinds: many walks cost the same, or end in the same P up to rounding.
    kind = np.random.default_rng(seed).integers(0, kinds, (5, 8))
    gradient = np.stack([1.0 - 0.7 * kind, 0.5 * kind + 0.25])
    assert_textbook_search(walks.problem(gradient, (0, 2), (7, 1), process_noise=0.0), 0.0)


def test_covariances_are_compared_by_the_eigenvalues_of_their_difference():
    rng = np.random.default_rng(7)
    answers = []
    for _ in range(300):
        one, other = random_covariance(rng), random_covariance(rng)
        factor = rng.uniform(0.5, 3.0)
        answers.append(np.linalg.eigvalsh(factor * other - one).min() >= 0)
        numbers = (P[[0, 0, 1], [0, 1, 1]] for P in (one, other))
        assert labels._below(*numbers, factor) == answers[-1]
    assert 0.1 < np.mean(answers) < 0.9


def test_larger_tolerance_keeps_fewer_labels():
    this = walks.problem(walks.field(9, 12, 1), (0, 0), (11, 8))
    counts = [labels.plan_labels(**this, epsilon=e).labels for e in (2.0, 0.3, 0.05)]
    assert counts[0] < counts[1] < counts[2]


@pytest.mark.parametrize("seed", [1, 3, 6])
def test_truncated_search_certifies_a_bound_that_rises_to_the_optimum(seed):
    this = task(seed, 0.001)
    optimum = labels.plan_labels(**this, epsilon=0.0)
    limits = range(1, optimum.expanded + 1)
    plans = [labels.plan_labels(**this, epsilon=0.0, max_expansions=n) for n in limits]
    bounds = np.array([plan.lower_bound for plan in plans])
    assert (bounds <= optimum.cost).all()
    assert (np.diff(bounds) >= -1e-12).all()
    assert bounds[0] < 0.99 * optimum.cost
    assert bounds[-1] == optimum.cost
    assert not plans[0].complete
    assert plans[-1].complete
    assert all(plan.cost >= optimum.cost for plan in plans)


# The bound of the remaining cost ------------------------------------------------------------


def test_gain_table_is_the_best_of_all_walks_of_each_length():
    gradient = walks.field(3, 4, 0)
    this = walks.problem(gradient, (0, 0), (3, 2))
    table = labels.gain_table(gradient)
    assert table.shape == (3, 4, 3, 8)
    for i, j, m in itertools.product(range(3), range(4), range(8)):
        e = np.cos(np.pi / 8 * m), np.sin(np.pi / 8 * m)
        ends = [(0.0, (j, i))]
        for k in range(3):
            ends = [
                (gain + (e @ gradient[:, other[1], other[0]]) ** 2, other)
                for gain, node in ends
                for other in walks.neighbours(this, node)
            ]
            exact = max(gain for gain, _ in ends)
            assert exact <= table[i, j, k, m] <= exact * (1 + 3e-7)


def remaining(this, table, node, P):
    steps = max(abs(node[0] - this["goal"][0]), abs(node[1] - this["goal"][1]))
    gains = table[node[1], node[0]]
    return labels._remaining(P[0, 0], P[0, 1], P[1, 1], gains, steps, this["noise"] ** 2)


def test_remaining_cost_is_the_formula_at_each_step_with_the_best_pair():
    rng = np.random.default_rng(0)
    this = task(0)
    table = labels.gain_table(this["gradient"])
    for node in ((0, 0), (2, 1), (4, 2)):
        P = random_covariance(rng)
        J, expected = np.linalg.inv(P), 0.0
        for k in range(max(GOAL[0] - node[0], GOAL[1] - node[1])):
            pairs = []
            for m in range(4):
                angles = np.pi / 8 * np.array([m, m + 4])
                e = np.stack([np.cos(angles), np.sin(angles)])
                S = table[node[1], node[0], k, [m, m + 4]].astype(float) / this["noise"] ** 2
                pairs.append((1 / ((e * (J @ e)).sum(axis=0) + S)).sum())
            expected += max(pairs)
        assert remaining(this, table, node, P) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_remaining_cost_is_never_above_the_best_walk(seed):
    this = task(seed) | {"P0": random_covariance(np.random.default_rng(seed))}
    cheapest, _ = walks.best_walk(this)
    bound = remaining(this, labels.gain_table(this["gradient"]), START, this["P0"])
    assert 0 < bound <= cheapest


def test_remaining_cost_is_tight_when_the_slopes_have_one_direction():
    # Every walk learns the same, only about east, and P has its axes there: an equality.
    gradient = np.zeros((2, 3, 5))
    gradient[0] = 1.0
    this = walks.problem(gradient, (0, 1), (4, 1), P0=np.diag([3.0, 0.5]), process_noise=0.0)
    expected = sum(1 / (1 / 3.0 + k / 0.8**2) + 0.5 for k in range(1, 5))
    bound = remaining(this, labels.gain_table(gradient), (0, 1), this["P0"])
    assert bound == pytest.approx(expected, rel=1e-6)
    assert bound < expected
    assert labels.plan_labels(**this, epsilon=0.0).cost == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("process_noise", [0.0, 0.05])
def test_remaining_cost_falls_by_no_more_than_a_step_costs(process_noise):
    rng = np.random.default_rng(4)
    for seed in range(20):
        this = task(seed, process_noise)
        table = labels.gain_table(this["gradient"])
        node = tuple(map(int, rng.integers(0, 5, 2)))
        P = random_covariance(rng)
        for other in walks.neighbours(this, node):
            after = walks.walk_bound(this | {"P0": P}, [node, other])[1]
            there = remaining(this, table, other, after)
            assert remaining(this, table, node, P) <= (np.trace(after) + there) * (1 + 1e-6)
