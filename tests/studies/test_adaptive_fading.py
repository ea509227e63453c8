"""The study of paper 3: its scenario, simulation, scores and refusals."""

import itertools

import attrs
import numpy as np
import pytest
from matplotlib import pyplot as plt
from scipy import stats
from scipy.linalg import solve_discrete_lyapunov
from steady import steady_covariance

from seanav import estimates
from seanav.checks import ParameterError
from seanav.filters import adaptive
from seanav.studies.adaptive_fading import beyond, figures, run, scores
from seanav.studies.adaptive_fading.scenario import Scenario

SMALL = Scenario(runs=20, settings=6, sweep_runs=4)


@pytest.fixture(scope="module")
def outcomes():
    case = run.problem(SMALL)
    return (case, *run.compare(SMALL, case, run.draw(SMALL)))


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"runs": -1}, "runs = -1: must be an integer of at least 2"),
        ({"dt": 1.0}, "dt = 1.0: must be below 0.908 s, where Euler's rule makes diving unstable"),
        ({"dt": -0.1}, "dt = -0.1: must be a finite number above 0"),
        ({"fault_time": 100.0}, "fault_time = 100.0: must be a finite number at least 15 and at"),
        ({"fault_time": -5.0}, "fault_time = -5.0: must be a finite number"),
        ({"window": 0}, "window = 0: must be an integer of at least 1"),
        ({"alpha": 0.0}, "alpha = 0.0: must be a finite number at least 1e-12 and below 1"),
        ({"alpha": 1.0}, "alpha = 1.0: must be a finite number at least 1e-12 and below 1"),
        ({"fault": "fire"}, "fault = 'fire': must be one of 'loss'"),
        ({"trigger": "eye"}, "trigger = 'eye': must be one of 'chi2', 'trace'"),
        (
            {"measured_steering": ["r", "r"]},
            "measured_steering = ['r', 'r']: must hold every value once",
        ),
        ({"measured_steering": ["depth"]}, "measured_steering = 'depth': must be one of 'v'"),
        ({"measured_diving": []}, "measured_diving = []: must be a list of 1 to 64 values"),
        ({"Q_steering": [1e-5, 1e-5]}, "Q_steering = [1e-05, 1e-05]: must be a list of 3 values"),
        (
            {"Q_steering": [1e-5, 1e-5, 0.0]},
            "Q_steering = [1e-05, 1e-05, 0.0]: must be above 0 for v, r, psi, which are",
        ),
        (
            {"Q_steering": [0.0, 1e-5, 1e-5], "measured_steering": ["r", "psi"]},
            "Q_steering = [0.0, 1e-05, 1e-05]: must be above 0 for v, r, psi, which are measured",
        ),
        (
            {"Q_diving": [0.0, 1e-5, 1e-5, 1e-5], "measured_diving": ["w", "z"]},
            "Q_diving = [0.0, 1e-05, 1e-05, 1e-05]: must be above 0 for w, z, which are measured",
        ),
        ({"dt": 3.0, "discretisation": "exact"}, "dt = 3.0: must be a finite number above 0 and"),
        ({"Q_diving": 1e-5}, "Q_diving = 1e-05: must be a list of 4 values"),
        ({"R_diving": [1e-4, 1e-4, 1e-4, 0.0]}, "R_diving = 0.0: must be a finite number at least"),
        ({"dt": 1e-9}, "dt = 1e-09: must be at least 0.005 s: 20000 steps at most"),
        ({"dt": 0.01, "runs": 1000}, "dt = 0.01: must be at least 0.025 s"),
        ({"larger_Q": 0.5}, "larger_Q = 0.5: must be a finite number at least 1"),
    ],
)
def test_bad_input_is_one_clear_line(change, line):
    with pytest.raises(ParameterError) as error:
        Scenario(**change)
    assert line in str(error.value)
    assert "\n" not in str(error.value)


def test_noise_through_the_fin_alone_is_refused_by_multiple_factors():
    # G = B: one noise for three states, so H G Q Gᵀ Hᵀ has rank one.
    B = run.problem(SMALL).B
    with pytest.raises(ParameterError, match="must not make H Q Hᵀ singular"):
        adaptive.weights(np.eye(3), np.outer(B, B), "multiple")


def test_the_exact_step_may_be_longer_than_eulers():
    assert Scenario(dt=1.0, discretisation="exact").dt == 1.0


def test_quick_keeps_at_least_a_tenth():
    full = Scenario()
    quick = full.quick()
    assert full.runs / 10 <= quick.runs < full.runs
    assert full.settings / 10 <= quick.settings < full.settings
    assert attrs.evolve(quick, runs=full.runs, settings=full.settings) == full


@pytest.mark.parametrize(
    ("fault", "effect"),
    [
        ("none", lambda u: u),
        ("loss", lambda u: 0 * u),
        ("reversal", lambda u: -u),
        ("half", lambda u: u / 2),
        ("bias", lambda u: u + 0.1),
        ("stuck", lambda u: 0 * u + 0.2),
    ],
)
def test_a_fault_changes_the_fin_from_its_moment_on(fault, effect):
    angles = run.command(SMALL)
    truth = run.with_fault(SMALL, angles, fault)
    assert len(angles) == 1000
    np.testing.assert_array_equal(truth[:500], angles[:500])
    np.testing.assert_allclose(truth[500:], effect(angles[500:]))


def test_command_is_the_sine_of_the_text():
    angles = run.command(SMALL)
    assert angles[50] == pytest.approx(0.2 * np.sin(2 * np.pi * 5 / 20))
    assert (run.command(SMALL, "step") == 0.2).all()


def test_before_the_fault_nothing_differs(outcomes):
    case, truth, results = outcomes
    other = run.problem(SMALL, fault="none")
    healthy, twins = run.compare(SMALL, other, run.draw(SMALL))
    before = case.times <= SMALL.fault_time
    np.testing.assert_array_equal(truth[:, before], healthy[:, before])
    for name, outcome in results.items():
        np.testing.assert_array_equal(outcome.errors[:, before], twins[name].errors[:, before])


def test_simulated_noise_has_the_stated_covariance():
    case = run.problem(SMALL, **run.BASE)
    noise = run.draw(SMALL)
    truth, z = run.simulate(case, noise)
    w = truth[:, 1:] - truth[:, :-1] @ case.Phi.T - case.actual[1:]
    v = z - truth @ case.H.T
    for samples, matrix in ((w, case.Q), (v, case.R)):
        flat = samples.reshape(-1, 3)
        scale = np.sqrt(np.diagonal(matrix))
        np.testing.assert_allclose(np.cov((flat / scale).T), np.eye(3), atol=0.04)


def test_healthy_errors_of_fixed_filters_are_those_of_linear_covariance(outcomes):
    # A fixed gain K makes the error a linear recursion of the TRUE noises, whatever Q the
    # filter believes in: its covariance solves a Lyapunov equation.
    case, _, results = outcomes
    for name, scale in (("OKF", 1.0), ("larger Q", SMALL.larger_Q)):
        before, _ = steady_covariance(case.Phi, case.H, scale * case.Q, case.R)
        K = before @ case.H.T @ np.linalg.inv(case.H @ before @ case.H.T + case.R)
        A = np.eye(3) - K @ case.H
        driven = A @ case.Q @ A.T + K @ case.R @ K.T
        P = solve_discrete_lyapunov(A @ case.Phi, driven)
        for state in range(3):
            error = scores.rmse(results[name].errors, case.healthy, state)
            assert abs(error.value - np.sqrt(P[state, state])) < 4 * error.se


def test_the_input_bias_is_found():
    # After the loss the fin is off by minus its command; the extra state must follow it.
    case = run.problem(SMALL)
    _, z = run.simulate(case, run.draw(SMALL))
    track = run.estimate(SMALL, case, z, augmented=True)
    off = track.x[..., 3].mean(axis=0)
    late = case.times > 55
    assert np.corrcoef(off[late], -run.command(SMALL)[late])[0, 1] > 0.97
    assert np.abs(off[case.healthy]).max() < 0.02


def test_ratio_is_the_ratio_of_rmse_and_no_unit_changes_its_mean(outcomes):
    case, _, results = outcomes
    a, b = (scores.squares(results[n].errors, case.faulty) for n in ("MFF(20)", "OKF"))
    one = scores.ratio(a, b, 1)
    plain = [
        np.sqrt((results[n].errors[:, case.faulty, 1] ** 2).mean()) for n in ("MFF(20)", "OKF")
    ]
    assert one.value == pytest.approx(plain[0] / plain[1], rel=1e-12)
    scale = np.array([1.0, 3.0, 57.3]) ** 2
    assert scores.ratio(a * scale, b * scale).value == pytest.approx(scores.ratio(a, b).value)


def test_ratio_interval_covers_the_truth_as_often_as_it_says():
    rng = np.random.default_rng(4)
    hits = 0
    for _ in range(400):
        common = rng.chisquare(5, (60, 1))
        a = common * rng.uniform(0.5, 1.5, (60, 2))
        b = 4 * common * rng.uniform(0.5, 1.5, (60, 2))
        e = scores.ratio(a, b)
        hits += e.low <= 0.5 <= e.high
    assert 0.95 - 4 * np.sqrt(0.0475 / 400) < hits / 400


def test_systematic_share_is_zero_for_noise_and_one_for_a_common_error():
    rng = np.random.default_rng(5)
    samples = np.ones(200, bool)
    noise = rng.normal(size=(100, 200, 1))
    share = scores.systematic_share(noise, samples, 0)
    assert abs(share.value) < 4 * share.se + 1e-3
    common = np.sin(np.arange(200) / 9)[None, :, None] + 1e-3 * noise
    assert scores.systematic_share(common, samples, 0).value == pytest.approx(1, abs=1e-4)
    half = np.ones((1, 200, 1)) + noise
    assert scores.systematic_share(half, samples, 0).value == pytest.approx(0.5, abs=0.02)


def test_growth_of_a_ramp_is_the_ratio_of_its_last_two_fifths():
    case = run.problem(SMALL)
    ramp = np.tile(case.times[:, None], (5, 1, 3)).reshape(5, -1, 3)
    expected = np.sqrt((100**3 - 80**3) / (80**3 - 60**3))
    assert scores.growth(ramp, case, SMALL, 2).value == pytest.approx(expected, rel=2e-3)


def test_exceedance_of_a_healthy_filter_is_alpha():
    case = run.problem(SMALL, fault="none")
    _, results = run.compare(SMALL, case, run.draw(SMALL), ["OKF"])
    limit = stats.chi2.isf(0.05, 3)
    rate = scores.exceedance(results["OKF"].before, case.faulty, limit)
    assert abs(rate.value - 0.05) < 4 * rate.se


def test_units_change_nothing_for_the_optimal_filter():
    assert run.filters(SMALL)["OKF"] == {}
    for e in beyond.unit_change(SMALL, "OKF", [180 / np.pi, 1e-3]):
        assert e.value == pytest.approx(1, rel=1e-6)


def test_operations_count_those_of_a_scalar_filter():
    # n = m = 1 by hand: Phi x, Phi P, ·Phi; H x, P H, ·H; L; white, square; K twice; K Δ;
    # 1 − K H, ·P, ·A, K R K as one product each.
    assert scores.operations(1, 1) == 3 + 3 + 1 + 2 + 2 + 1 + 4
    assert scores.operations(3, 3) < scores.operations(3, 3, "single")
    assert scores.operations(3, 3, "multiple", 5) < scores.operations(3, 3, "multiple", 6)


def test_first_alarm_counts_from_the_fault():
    beta = np.array([[0, 0, 9, 0], [9, 0, 0, 9], [0, 0, 0, 0]], float)
    np.testing.assert_array_equal(beyond.first_alarm(beta, 5, 0.1), [3 * 0.1, 0.1, np.nan])


def test_chance_alarms_come_after_one_over_alpha_samples():
    scenario = attrs.evolve(SMALL, runs=100)
    curve = beyond.detection(scenario, alphas=(0.1,))["none"]
    assert curve.false_alarms[0] == pytest.approx(0.1, abs=0.01)
    assert curve.delay[0] == pytest.approx(10 * 0.1, rel=0.4)  # mean of 100 geometric numbers
    assert curve.missed[0] == 0


def test_moving_sum_is_a_sum():
    beta = np.arange(12.0).reshape(2, 6)
    assert beyond.moving_sum(beta, 3)[1, 2] == 8 + 9 + 10


def test_sweep_is_the_same_for_any_number_of_threads(monkeypatch):
    rows = []
    for threads in ("1", "2"):
        monkeypatch.setenv("SEANAV_THREADS", threads)
        rows.append(beyond.sweep(SMALL))
    assert rows[0] == rows[1]
    share, counts = beyond.shares(rows[0], "MFF", "SFF")
    assert sum(counts) == SMALL.settings
    assert share.count == SMALL.settings


def test_consistency_bounds_hold_for_chi_square_numbers():
    low, high = estimates.consistency_bounds(3, 100)
    means = np.random.default_rng(6).chisquare(3, (4000, 100)).mean(axis=1)
    assert ((low < means) & (means < high)).mean() == pytest.approx(0.95, abs=0.015)


def test_common_random_numbers_do_not_depend_on_the_number_of_runs():
    few = run.draw(SMALL, runs=3)
    many = run.draw(SMALL, runs=5)
    np.testing.assert_array_equal(few.process, many.process[:3])
    assert isinstance(estimates.exact(1.0), estimates.Estimate)


# Inside the adaptation, and the other trigger -----------------------------------------------


def test_rule_24_is_met_as_often_as_a_chi_square_number_exceeds_its_mean():
    # One measurement: Δ² > S is β > 1 exactly; in health that is P(χ²₁ > 1) = 0.317.
    case = run.problem(SMALL, measured=("psi",), fault="none")
    rows = beyond.triggers(SMALL, {"one": (case, run.draw(SMALL))})
    rates = {(row[1], row[2]): row[3] for row in rows}
    _, z = run.simulate(case, run.draw(SMALL))
    for name, options in run.filters(SMALL).items():
        if "method" in options:
            track = run.estimate(SMALL, case, z, **options, trigger="trace")
            share = (track.before[:, case.healthy] > 1.0).mean()
            assert rates["trace", name].value == pytest.approx(share, abs=1e-3)
            adapted = (track.factors > 1).any(axis=2)
            assert not adapted[track.before < 1 - 1e-9].any()
    never = attrs.evolve(SMALL, alpha=1e-12)
    quiet = beyond.triggers(never, {"one": (case, run.draw(never))})
    assert {row[3].value for row in quiet if row[1] == "chi2"} == {0.0}


def test_right_side_of_24_is_the_innovations_mean_square_in_health():
    case = run.problem(SMALL, fault="none")
    _, z = run.simulate(case, run.draw(SMALL))
    track = run.estimate(attrs.evolve(SMALL, alpha=1e-12), case, z, method="single")
    told = beyond.predicted(case, track)[:, case.healthy]
    seen = (track.innovation[:, case.healthy] ** 2).sum(axis=2)
    assert told.mean() == pytest.approx(seen.mean(), rel=0.03)
    # The sum of three squares that the steady covariance gives, by an independent solver.
    P, _ = steady_covariance(case.Phi, case.H, case.Q, case.R)
    assert told[0, -1] == pytest.approx(np.trace(case.H @ P @ case.H.T + case.R), rel=1e-6)


def test_rougher_noise_has_the_larger_covariance_after_the_fault_only():
    case, noise = run.problem(SMALL, fault="none"), run.draw(SMALL)
    truth, _ = run.simulate(case, run.rougher(case, noise, SMALL, 100.0))
    w = truth[:, 1:] - truth[:, :-1] @ case.Phi.T - case.actual[1:]
    late = case.times[1:] > SMALL.fault_time + 1e-9
    for samples, factor in ((w[:, ~late], 1.0), (w[:, late], 100.0)):
        variance = (samples**2).mean(axis=(0, 1)) / np.diagonal(case.Q)
        np.testing.assert_allclose(variance, factor, rtol=0.05)


def test_optimal_filter_under_rougher_noise_errs_as_linear_covariance_says():
    case, factor = run.problem(SMALL, fault="none"), 100.0
    rows = dict(beyond.changed_noise(SMALL, factor))
    P = []
    for scale in (1.0, factor):  # what the filter believes; the truth has the factor
        before, _ = steady_covariance(case.Phi, case.H, scale * case.Q, case.R)
        K = before @ case.H.T @ np.linalg.inv(case.H @ before @ case.H.T + case.R)
        A = np.eye(3) - K @ case.H
        driven = A @ (factor * case.Q) @ A.T + K @ case.R @ K.T
        P.append(np.diagonal(solve_discrete_lyapunov(A @ case.Phi, driven)))
    expected = np.exp(0.5 * np.log(P[0] / P[1]).mean())
    assert rows["OKF"].value == pytest.approx(expected, rel=0.03)


def outcome(P):
    return run.Outcome(*(None,) * 5, P)


def test_larger_covariance_finds_the_direction_in_which_it_is_smaller():
    P = np.tile(np.diag([4.0, 1e-6]), (5, 8, 1, 1))
    samples = np.arange(8) >= 2
    trace, least = scores.larger_covariance(outcome(2 * P), outcome(P), samples)
    assert trace.value == pytest.approx(2.0)
    assert least.value == pytest.approx(1.0)
    smaller = 2 * P
    smaller[3, 5, 1, 1] = 0.5e-6  # nothing in the trace, half of its own variance
    trace, least = scores.larger_covariance(outcome(smaller), outcome(P), samples)
    assert trace.value == pytest.approx(2.0, rel=1e-6)
    assert least.value == pytest.approx(-0.5)


def test_gain_follows_from_the_covariance_after_the_update():
    case, random = run.problem(SMALL), np.random.default_rng(3)
    outcomes, traces = [], []
    for _ in range(2):
        A = random.standard_normal((4, 8, 3, 3))
        before = A @ A.swapaxes(-1, -2) * 1e-4
        S = case.H @ before @ case.H.T + case.R
        K = before @ case.H.T @ np.linalg.inv(S)
        outcomes.append(outcome(before - K @ case.H @ before))
        traces.append(np.trace(case.H @ K, axis1=-2, axis2=-1))
    found = scores.larger_gain(*outcomes, case, np.arange(8) >= 2)
    assert found.value == pytest.approx((traces[0] / traces[1])[:, 2:].mean())


def test_decay_compares_the_last_fifth_with_that_after_the_fault():
    case = run.problem(SMALL)
    factors = np.ones((4, len(case.times), 3))
    factors[:, (case.times > 50) & (case.times <= 70)] = 9.0
    factors[:, case.times > 80] = 3.0
    assert scores.decay(factors, case, SMALL).value == pytest.approx(0.25)
    assert "was not run" in scores.decay(np.ones_like(factors), case, SMALL)
    late = attrs.evolve(SMALL, fault_time=70.0)
    assert "was not run" in scores.decay(factors, run.problem(late), late)


def test_innovation_based_adaptation_costs_its_window_and_two_products():
    # Scalar by hand: Δ² for each of the window, then K C K.
    plain = scores.operations(1, 1)
    assert scores.operations(1, 1, "innovation", 7) == plain + 7 + 2
    three = [scores.operations(3, 3, "innovation", w) for w in (1, 20)]
    assert three[1] - three[0] == 19 * 6


# What the pictures show ---------------------------------------------------------------------


def test_bins_hold_every_random_setting_once_and_share_its_wins():
    swept = beyond.sweep(attrs.evolve(SMALL, settings=24, sweep_runs=2))
    whole, _ = beyond.shares(swept, "MFF", "OKF")
    for criterion, rows in beyond.binned_shares(swept, "MFF", "OKF").items():
        assert sum(share.count for _, share in rows) == len(swept), criterion
        won = sum(share.value * share.count for _, share in rows)
        assert won == pytest.approx(whole.value * len(swept)), criterion
    one = swept[0]._replace(Q=(1e-6, 3e-5, 2e-4), R=(1e-4, 1e-4, 1e-4))
    (row,) = beyond.binned_shares([one], "MFF", "OKF")["log₁₀ of largest / smallest Q"]
    assert row[0] == "2 to 3"  # 200 lies between a hundred and a thousand


def test_figures_of_different_filters_have_the_same_axes(outcomes):
    case, truth, results = outcomes
    ends = []
    for name in ("OKF", "SFF(1)", "MFF(20)"):
        fig = figures.estimates(case, truth, results, name, SMALL.fault_time)
        ends.append([(ax.get_xlim(), ax.get_ylim()) for ax in fig.axes])
        labels = [line.get_label() for line in fig.axes[0].lines[:-1]]
        assert labels == list(dict.fromkeys(["true", "OKF", name]))
        plt.close(fig)
    assert ends[0] == ends[1] == ends[2]


def test_the_drawn_axes_are_right_handed():
    # Seen from before, starboard and above: x to the right, y to the left, z down; a triad
    # that is mirrored would have one of them on the other side.
    flat, near = figures._seen(np.eye(3))
    assert flat[0, 0] > 0 > flat[1, 0]
    assert flat[2, 0] == pytest.approx(0, abs=1e-12)
    assert flat[2, 1] < 0
    assert near[0] > 0
    assert near[1] > 0
    assert near[2] < 0  # the eye is above, down points away from it
    out = np.cross([*flat[0], near[0]], [*flat[1], near[1]])
    np.testing.assert_allclose(out, [*flat[2], near[2]], atol=1e-12)


@pytest.mark.parametrize(("n", "m"), [(3, 3), (4, 2), (5, 1)])
def test_multiplications_are_those_of_the_loops(n, m):
    N, M = range(n), range(m)

    def loops(*ranges):
        return sum(1 for _ in itertools.product(*ranges))

    upper_n, upper_m = (
        [(i, j) for i in N for j in N if j >= i],
        [(i, j) for i in M for j in M if j >= i],
    )
    factor = sum(1 for i in M for j in range(i + 1) for _ in range(j + 1))  # roots, divisions too
    statistic = len(upper_m) + m  # a triangle solved, and squares
    plain = loops(N, N) + loops(N, N, N) + loops(upper_n, N)  # Φx, ΦP, half of (ΦP)Φᵀ
    plain += loops(M, N) + loops(N, N, M) + loops(upper_m, N)  # Hx, PHᵀ, half of H(PHᵀ)
    plain += factor + statistic
    plain += loops(N, upper_m) * 2 + loops(N, M)  # two triangles for each row of K; K times Δ
    plain += loops(N, N, M) + loops(N, N, N)  # KH, (I − KH)P
    plain += loops(upper_n, N) + loops(upper_n, M, M)  # Joseph's two products
    assert scores.operations(n, m) == plain
    sample = 5 * len(upper_m)
    assert scores.operations(n, m, "innovation", 5) == (
        plain + sample + loops(N, M, M) + loops(N, N, M)  # KC, (KC)Kᵀ
    )
    again = 2 * (loops(N, N, M) + loops(upper_m, N)) + factor + statistic + sample
    inflated = n * (n + 1)
    assert scores.operations(n, m, "single", 5) == plain + again + m + inflated
    assert scores.operations(n, m, "multiple", 5) == plain + again + loops(N, M, M) + inflated


def test_mean_nees_is_over_all_runs_and_the_chosen_samples():
    nees, chosen = np.arange(12.0).reshape(3, 4), np.array([True, False, True, False])
    one = scores.mean_nees(nees, chosen)
    assert one.value == nees[:, ::2].mean()
    assert one.count == 3
