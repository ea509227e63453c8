"""Moment equations: symbols against each other, numbers against independent references."""

import itertools

import numpy as np
import pytest
import sympy as sp
from scipy import linalg, stats
from scipy.integrate import quad

from seanav.checks import ParameterError
from seanav.filters import moments
from seanav.filters.moments import generated
from seanav.models import bodies

DRIFT, DIFFUSION, NAMES = bodies.equations()
BODY = moments.system(bodies.STATES, DRIFT, DIFFUSION, bodies.INPUTS, NAMES)


def linear_drag_body():
    """Return the body with quadratic drift only: no cubic drag."""
    drift = BODY.drift.xreplace({x: sp.Integer(0) for x in BODY.parameters if x.name[0] == "c"})
    return moments.system(bodies.STATES, drift, DIFFUSION, bodies.INPUTS, NAMES)


VAN_DER_POL = moments.system("x y", ["y", "mu*(1 - x**2)*y - x"], [["0"], ["s"]], parameters="mu s")


def zero(expression):
    return sp.expand(expression) == 0


# ---------------------------------------------------------------- symbols


def test_isserlis_pairs_up_as_the_textbook_says():
    P = BODY.covariance
    expected = P[0, 1] * P[2, 3] + P[0, 2] * P[1, 3] + P[0, 3] * P[1, 2]
    assert zero(moments.isserlis((0, 1, 2, 3), P) - expected)
    assert moments.isserlis((0, 0, 0, 0), P) == 3 * P[0, 0] ** 2
    assert moments.isserlis((1, 2, 3), P) == 0
    assert [len(moments.pairings(tuple(range(k)))) for k in (2, 4, 6, 8)] == [1, 3, 15, 105]


def test_operator_on_the_exponential_gives_the_characteristic_equation():
    s, K = moments.characteristic(BODY)
    s = sp.Matrix(s)
    expected = s.dot(BODY.drift) + (s.T * BODY.spread * s)[0] / 2
    assert zero(K - expected)


@pytest.mark.parametrize("model", [VAN_DER_POL, BODY], ids=["van der Pol", "body"])
def test_derivatives_of_the_characteristic_function_are_the_moment_equations(model):
    s, K = moments.characteristic(model)
    exact = moments.exact(model)
    wave = sp.exp(sum(a * b for a, b in zip(s, model.states, strict=True)))
    at_zero = dict.fromkeys(s, 0)
    for i, si in enumerate(s):
        slope = sp.diff(K * wave, si).subs(at_zero)
        assert zero(moments.expectation(model, slope) - exact.mean_rate[i])
    m = model.mean
    for i, j in itertools.combinations_with_replacement(range(len(s)), 2):
        bend = sp.diff(K * wave, s[i], s[j]).subs(at_zero)
        rate = moments.expectation(model, bend)
        rate -= m[i] * exact.mean_rate[j] + m[j] * exact.mean_rate[i]
        assert zero(rate - exact.covariance_rate[i, j])


@pytest.mark.parametrize(
    "model",
    [VAN_DER_POL, moments.system("x y", ["y", "x*y - x"], [["x"], ["1 + y"]])],
    ids=["van der Pol", "G depends on the state"],
)
def test_forward_operator_is_the_adjoint_of_the_backward_one(model):
    x = model.states
    bump = sp.exp(-(x[0] ** 2) - x[1] ** 2)
    phi, p = x[0] ** 2 * x[1] + x[1] ** 2, (1 + x[0] * x[1] + x[0]) * bump
    left = sp.expand(moments.backward(model, phi) * p / bump)
    right = sp.expand(sp.expand(moments.forward(model, p)) / bump * phi)

    def integral(polynomial):
        # ∫ x^k e^{-x²} = Γ((k+1)/2) for even k, axis by axis.
        total = 0
        for powers, c in sp.Poly(polynomial, *x).terms():
            if all(k % 2 == 0 for k in powers):
                total += c * sp.Mul(*(sp.gamma(sp.Rational(k + 1, 2)) for k in powers))
        return sp.expand(total)

    assert integral(left) != 0
    assert zero(integral(left) - integral(sp.simplify(right)))


def test_gaussian_closure_is_the_truncated_one_exactly_when_the_drift_is_quadratic():
    quadratic = linear_drag_body()
    gauss, second = (moments.close(quadratic, c) for c in ("gaussian", "second order"))
    assert (gauss.mean_rate - second.mean_rate).applyfunc(sp.expand).is_zero_matrix
    assert (gauss.covariance_rate - second.covariance_rate).applyfunc(sp.expand).is_zero_matrix
    gauss, second = (moments.close(BODY, c) for c in ("gaussian", "second order"))
    assert (gauss.mean_rate - second.mean_rate).applyfunc(sp.expand).is_zero_matrix
    difference = (gauss.covariance_rate - second.covariance_rate).applyfunc(sp.expand)
    P, symbol = BODY.covariance, {x.name: x for x in BODY.parameters}
    assert zero(difference[0, 0] + 6 * symbol["c1"] * P[0, 0] ** 2 / symbol["m1"])


def energy_terms(model, closed):
    mass = sp.diag(*(x for x in model.parameters if x.name in bodies.MASSES))
    m, symbol = sp.Matrix(model.mean), {x.name: x for x in model.parameters}
    power = 0  # ⟨x²⟩ and ⟨x⁴⟩ of a Gaussian from the textbook, not from the code under test
    for i, (mi, cubic) in enumerate(zip(m, cubic_of(model), strict=True)):
        s = model.covariance[i, i]
        power += symbol[f"a{i + 1}"] * (mi**2 + s) + cubic * (mi**4 + 6 * mi**2 * s + 3 * s**2)
    rate = (m.T * mass * closed.mean_rate)[0] + (mass * closed.covariance_rate).trace() / 2
    balance = m.dot(sp.Matrix(model.inputs)) - power + (mass * model.spread).trace() / 2
    return sp.expand(rate - balance), mass, m


def cubic_of(model):
    present = model.drift.free_symbols
    return [c if c in present else 0 for c in model.parameters if c.name[0] == "c"]


@pytest.mark.parametrize("model", [BODY, linear_drag_body()], ids=["cubic", "linear"])
def test_gaussian_closure_balances_energy(model):
    defect, _, _ = energy_terms(model, moments.close(model, "gaussian"))
    assert defect == 0


def test_ekf_lacks_exactly_the_energy_of_the_missing_term():
    model = linear_drag_body()
    defect, mass, m = energy_terms(model, moments.close(model, "ekf"))
    n, P = 6, model.covariance
    bend = sp.Matrix(
        [
            sum(P[i, j] * sp.hessian(f, model.states)[i, j] for i in range(n) for j in range(n)) / 2
            for f in model.drift
        ]
    )
    assert defect != 0
    assert zero(defect + (m.T * mass * bend)[0])


# ---------------------------------------------------------------- numbers


def random_point(n, seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n))
    return rng.normal(size=n), 0.1 * root @ root.T + 0.02 * np.eye(n), rng


def gauss_hermite(model, mean, P, values):
    """Return ⟨f⟩ and d P/dt by 5 nodes per axis, exact here up to degree 9."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(5)
    n = len(mean)
    grid = np.array(list(itertools.product(nodes, repeat=n)))
    weight = np.prod(list(itertools.product(weights / weights.sum(), repeat=n)), axis=1)
    x = mean + grid @ np.linalg.cholesky(P).T
    others = (*model.inputs, *model.parameters)
    f = sp.lambdify((*model.states, *others), list(model.drift), "numpy")
    spread = sp.lambdify((*model.states, *others), model.spread.tolist(), "numpy")
    columns = [*x.T, *(values[s.name] for s in others)]
    rates = np.array([np.broadcast_to(entry, len(x)) for entry in f(*columns)])
    noise = np.array([[np.broadcast_to(e, len(x)) for e in row] for row in spread(*columns)])
    cross = (rates * weight) @ (x - mean)
    return rates @ weight, cross + cross.T + noise @ weight


@pytest.mark.parametrize("seed", range(3))
def test_gaussian_closure_agrees_with_gauss_hermite(seed):
    mean, P, rng = random_point(6, seed)
    parameters, inputs = rng.uniform(0.5, 2.0, 24), rng.normal(size=6)
    values = {s.name: v for s, v in zip(BODY.parameters, parameters, strict=True)}
    values |= {s.name: v for s, v in zip(BODY.inputs, inputs, strict=True)}
    rates = generated.Propagator(moments.close(BODY, "gaussian")).rates(mean, P, inputs, parameters)
    expected = gauss_hermite(BODY, mean, P, values)
    scale = np.abs(expected[1]).max()
    np.testing.assert_allclose(rates[0], expected[0], rtol=0, atol=1e-12 * scale)
    np.testing.assert_allclose(rates[1], expected[1], rtol=0, atol=1e-12 * scale)


def test_state_dependent_diffusion_and_high_degree_agree_with_gauss_hermite():
    model = moments.system("x y", ["y**3*x - x**5", "-y + x*y**2"], [["1 + x*y"], ["x**2"]])
    mean, P, _ = random_point(2, 7)
    rates = generated.Propagator(moments.close(model, "gaussian")).rates(mean, P)
    expected = gauss_hermite(model, mean, P, {})
    np.testing.assert_allclose(rates[0], expected[0], rtol=1e-12)
    np.testing.assert_allclose(rates[1], expected[1], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("m", [-1.3, 0.0, 0.4])
def test_quadratic_drag_in_closed_form_agrees_with_quadrature(m):
    model = moments.system("x y", ["-k*x*Abs(x) + y", "-y"], [1, 1], parameters="k")
    P = np.array([[0.5, 0.2], [0.2, 0.3]])
    rates = generated.Propagator(moments.close(model, "gaussian")).rates([m, 0.2], P, (), [2.0])
    density = stats.norm(m, np.sqrt(P[0, 0])).pdf

    def mean(g):
        return sum(quad(lambda x: g(x) * density(x), *ends)[0] for ends in ((-9, 0), (0, 9)))

    drag, slope = mean(lambda x: x * abs(x)), mean(lambda x: 2 * abs(x))
    assert rates[0][0] == pytest.approx(-2 * drag + 0.2, rel=1e-9)
    assert rates[1][0, 0] == pytest.approx(2 * (-2 * slope * P[0, 0] + P[0, 1]) + 1, rel=1e-9)
    assert rates[1][0, 1] == pytest.approx(-2 * slope * P[0, 1] + P[1, 1] - P[0, 1], rel=1e-9)


def van_loan(A, Q, dt):
    n = len(A)
    block = np.block([[-A, Q], [np.zeros((n, n)), A.T]])
    whole = linalg.expm(block * dt)
    Phi = whole[n:, n:].T
    return Phi, Phi @ whole[:n, n:]


@pytest.mark.parametrize("closure", moments.CLOSURES)
def test_linear_case_agrees_with_van_loan(closure):
    rng = np.random.default_rng(3)
    A, G = rng.normal(size=(3, 3)), rng.normal(size=(3, 2))
    x = sp.Matrix(sp.symbols("x y z", real=True))
    model = moments.system("x y z", list(sp.Matrix(A) * x), sp.Matrix(G).tolist())
    Phi, Q = van_loan(A, G @ G.T, 0.5)
    mean, P, _ = random_point(3, 4)
    expected = Phi @ mean, Phi @ P @ Phi.T + Q
    mean, P = mean[None].copy(), P[None].copy()
    generated.Propagator(moments.close(model, closure))(mean, P, 0.5, 0.001)
    np.testing.assert_allclose(mean[0], expected[0], rtol=1e-10)
    np.testing.assert_allclose(P[0], expected[1], rtol=1e-10)


@pytest.mark.parametrize("closure", ["gaussian", "second order"])
def test_geometric_brownian_motion_is_exact(closure):
    model = moments.system("x", ["a*x"], ["b*x"], parameters="a b")
    a, b, t = 0.3, 0.5, 1.2
    mean, P = np.array([[2.0]]), np.array([[[0.1]]])
    generated.Propagator(moments.close(model, closure))(mean, P, t, 0.002, None, [a, b])
    second = (4.0 + 0.1) * np.exp((2 * a + b**2) * t)
    assert mean[0, 0] == pytest.approx(2.0 * np.exp(a * t), rel=1e-10)
    assert P[0, 0, 0] == pytest.approx(second - 4.0 * np.exp(2 * a * t), rel=1e-9)


def test_inputs_are_taken_at_ends_and_middles_of_the_steps():
    # x' = -x + sin 3t has (sin 3t - 3 cos 3t)/10 + c exp(-t); fourth order in the step.
    model = moments.system("x", ["-x + tau"], [0], inputs="tau")
    exact = (np.sin(3.0) - 3 * np.cos(3.0)) / 10 + 1.3 * np.exp(-1.0)
    errors = []
    for steps in (20, 40):
        mean, P = np.array([[1.0]]), np.array([[[0.1]]])
        inputs = np.sin(3 * np.linspace(0, 1, 2 * steps + 1))[:, None]
        generated.Propagator(moments.close(model, "ekf"))(mean, P, 1.0, 1 / steps, inputs)
        errors.append(abs(mean[0, 0] - exact))
    assert errors[0] < 1e-5
    assert errors[0] / errors[1] == pytest.approx(16, rel=0.1)
    inputs, noise = np.sin(3 * np.linspace(0, 1, 10_001))[:, None], np.zeros((1, 10_000, 1))
    end = generated.Simulator(model)(np.ones((1, 1)), noise, 1e-4, inputs, (), 10_000)[0, -1, 0]
    assert end == pytest.approx(exact, abs=2e-4)


def test_ekf_jacobian_agrees_with_central_differences():
    rng = np.random.default_rng(5)
    propagate = generated.Propagator(moments.close(BODY, "ekf"))
    parameters, inputs = rng.uniform(0.5, 2.0, 24), rng.normal(size=6)
    parameters[18:] = 0.0
    mean, step = rng.normal(size=6), 1e-5
    P = np.eye(6)
    A = np.empty((6, 6))
    for j in range(6):
        ends = [propagate.rates(mean + s * step * P[j], P, inputs, parameters)[0] for s in (1, -1)]
        A[:, j] = (ends[0] - ends[1]) / (2 * step)
    rate = propagate.rates(mean, P, inputs, parameters)[1]
    np.testing.assert_allclose(rate, A + A.T, rtol=1e-8, atol=1e-8)


def test_a_run_does_not_depend_on_the_others_in_its_batch():
    propagate = generated.Propagator(moments.close(BODY, "gaussian"))
    rng = np.random.default_rng(6)
    start = rng.normal(size=(19, 6)) * 0.2
    forces = bodies.TORPEDO.forces(np.linspace(0, 0.5, 21))

    def end(chosen):
        mean, P = start[chosen].copy(), np.tile(np.eye(6) * 0.02, (len(start[chosen]), 1, 1))
        propagate(mean, P, 0.5, 0.05, forces, bodies.TORPEDO.parameters())
        return mean, P

    whole = end(slice(None))
    assert len(np.unique(whole[0][:, 0])) == 19
    for chosen in (slice(0, 3), slice(7, 9), slice(18, 19), slice(5, 16)):
        for one, all_ in zip(end(chosen), whole, strict=True):
            assert np.array_equal(one, all_[chosen])


def test_second_order_measurement_agrees_with_monte_carlo_free_moments():
    model = moments.system("x y", ["-x", "-y"], [1, 1])
    predictor = generated.Predictor(moments.measurement(model, ["x*y", "x**2 + y"]))
    mean, P, _ = random_point(2, 8)
    predicted, H, spread = predictor(mean[None], P[None])
    nodes, weights = np.polynomial.hermite_e.hermegauss(5)
    grid = np.array(list(itertools.product(nodes, repeat=2)))
    weight = np.prod(list(itertools.product(weights / weights.sum(), repeat=2)), axis=1)
    x, y = (mean + grid @ np.linalg.cholesky(P).T).T
    h = np.array([x * y, x**2 + y])
    offset = h - (h @ weight)[:, None]
    np.testing.assert_allclose(predicted[0], h @ weight, rtol=1e-12)
    whole = H[0] @ P @ H[0].T + spread[0]
    np.testing.assert_allclose(whole, (offset * weight) @ offset.T, rtol=1e-11)


def test_expectation_of_what_is_no_polynomial_is_refused():
    x, y = VAN_DER_POL.states
    for expression in (sp.sin(x), 1 / x, sp.sqrt(x) * y):
        with pytest.raises(ParameterError, match=r"expression = .*must be a polynomial"):
            moments.expectation(VAN_DER_POL, expression)


def test_expectation_of_a_high_power_is_the_textbooks():
    # ⟨x⁴y²⟩ of independent standard normals shifted by m: products of raw moments.
    x, y = VAN_DER_POL.states
    P, (a, b) = VAN_DER_POL.covariance, VAN_DER_POL.mean
    value = moments.expectation(VAN_DER_POL, x**4 * y**2, moments.gaussian_moment)
    at = {P[0, 0]: 1, P[1, 1]: 1, P[0, 1]: 0}
    assert zero(value.subs(at) - (a**4 + 6 * a**2 + 3) * (b**2 + 1))


def test_six_state_body_with_quadratic_drag_closes_in_closed_form():
    # Against the cubic-drag equations plus the scalar closed form on each axis.
    drift, diffusion, names = bodies.equations(quadratic_drag=True)
    model = moments.system(bodies.STATES, drift, diffusion, bodies.INPUTS, names)
    with_, without = (moments.close(m, "gaussian") for m in (model, BODY))
    rng = np.random.default_rng(10)
    mean, P, _ = random_point(6, 10)
    numbers = [*bodies.TORPEDO.parameters(), *rng.uniform(1.0, 30.0, 6)]
    values = dict(zip(model.parameters, numbers, strict=True))
    values |= dict.fromkeys(model.inputs, 0.0) | dict(zip(model.mean, mean, strict=True))
    values |= {model.covariance[i, j]: P[i, j] for i in range(6) for j in range(6)}
    inertia, drag = np.array(numbers[:6]), np.array(numbers[24:])
    sd = np.sqrt(np.diag(P))

    def average(g, i):
        density = stats.norm(mean[i], sd[i]).pdf
        ends = (mean[i] - 12 * sd[i], 0.0, mean[i] + 12 * sd[i])
        return sum(quad(lambda x: g(x) * density(x), *ends[k : k + 2])[0] for k in (0, 1))

    extra = np.array([average(lambda x: x * abs(x), i) for i in range(6)])
    slope = np.array([average(lambda x: 2 * abs(x), i) for i in range(6)])
    gap = np.array((with_.mean_rate - without.mean_rate).subs(values), dtype=float)[:, 0]
    np.testing.assert_allclose(gap, -drag / inertia * extra, rtol=1e-7)
    gap = np.array((with_.covariance_rate - without.covariance_rate).subs(values), dtype=float)
    A = np.diag(-drag / inertia * slope)
    np.testing.assert_allclose(gap, A @ P + P @ A.T, rtol=1e-7, atol=1e-9)


def test_unknown_closure_and_open_moments_are_refused():
    with pytest.raises(ParameterError, match=r"closure = 'ukf': must be one of 'ekf'"):
        moments.close(BODY, "ukf")
    with pytest.raises(ParameterError, match=r"closure = 'exact': must not leave mu_x_x"):
        generated.Propagator(moments.exact(VAN_DER_POL))


def test_wrong_shapes_are_refused():
    propagate = generated.Propagator(moments.close(VAN_DER_POL, "gaussian"))
    mean, P = np.zeros((2, 2)), np.tile(np.eye(2), (2, 1, 1))
    with pytest.raises(ParameterError, match=r"parameters \(mu, s\) = \(1,\): must have the shape"):
        propagate(mean, P, 1.0, 0.1, None, [1.0])
    with pytest.raises(ParameterError, match=r"mean = .*shape \(2, 2\) \(runs, 2\)"):
        propagate(np.zeros((2, 3)), P, 1.0, 0.1, None, [1.0, 1.0])
    with pytest.raises(ParameterError, match="step = 0: must be a finite number above 0"):
        propagate(mean, P, 1.0, 0, None, [1.0, 1.0])


def test_own_three_state_equation_as_text_or_sympy():
    x, y, z = sp.symbols("x y z")
    text = moments.system("x y z", ["10*(y - x)", "x*(28 - z) - y", "x*y - 8*z/3"], [1, 1, 1])
    symbols = moments.system(
        [x, y, z], [10 * (y - x), x * (28 - z) - y, x * y - sp.Rational(8, 3) * z], sp.eye(3)
    )
    assert text == symbols
    mean, P, _ = random_point(3, 9)
    rates = generated.Propagator(moments.close(text, "gaussian")).rates(mean, P)
    np.testing.assert_allclose(rates[0][2], mean[0] * mean[1] + P[0, 1] - 8 / 3 * mean[2])
