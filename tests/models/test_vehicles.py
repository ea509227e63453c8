"""The linear planes of paper 3 against eigenvalues, numerical integration and differences."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from seanav.checks import ParameterError
from seanav.models import vehicles

PLANES = [vehicles.steering(), vehicles.diving()]


def modes(plane):
    return np.sort_complex(np.linalg.eigvals(plane.A))


def test_steering_modes_solve_the_characteristic_equation_of_the_table():
    # v and r alone: det(D − λ M) = 0 written out by hand.
    a, b, c, d = -66.6, 2.2 - 30.48 * 1.54, -4.47, -6.87
    m11, m12, m22 = 30.48 + 35.5, -1.93, 3.45 + 4.88
    quadratic = [m11 * m22 - m12**2, -(a * m22 + d * m11 - (b + c) * m12), a * d - b * c]
    expected = np.sort(np.append(np.roots(quadratic), 0.0))
    np.testing.assert_allclose(modes(PLANES[0]).real, expected, atol=1e-12)
    assert (modes(PLANES[0]).imag == 0).all()


def test_diving_modes_are_the_published_ones():
    expected = np.sort_complex([0, -0.412, -0.788 + 1.055j, -0.788 - 1.055j])
    np.testing.assert_allclose(modes(PLANES[1]), expected, atol=6e-4)


def test_the_printed_sign_of_the_heave_row_gives_other_modes():
    plane = vehicles.as_printed("diving")
    expected = np.sort_complex([1, -1.454, -0.101 + 0.694j, -0.101 - 0.694j])
    np.testing.assert_allclose(modes(plane), expected, atol=6e-4)


@pytest.mark.parametrize("name", ["steering", "diving"])
def test_the_printed_matrices_diverge(name):
    Phi, _B = vehicles.as_printed(name).discretise(0.1)
    assert np.abs(np.linalg.eigvals(Phi)).max() > 1.09
    mended, _ = getattr(vehicles, name)().discretise(0.1)
    assert np.abs(np.linalg.eigvals(mended)).max() <= 1 + 1e-12


def test_the_printed_steering_differs_where_the_sheet_says():
    c = {name: row.value for name, row in vehicles.COEFFICIENTS.items()}
    mass = np.array([[c["m"] - c["Y_vdot"], -c["Y_r"], 0], [-1.93, 8.33, 0], [0, 0, 1]])
    damping = np.array([[-66.6, 2.2 - 30.48 * 1.54, 0], [-4.47, -6.87, 0], [0, 0, 1]])
    expected = np.linalg.inv(mass) @ damping
    np.testing.assert_allclose(vehicles.as_printed("steering").A, expected, rtol=1e-12, atol=1e-15)


def test_another_published_M_w_makes_diving_unstable():
    assert modes(vehicles.diving(M_w=30.7)).real.max() > 0.2


@pytest.mark.parametrize("plane", PLANES, ids=lambda p: p.name)
def test_exact_discretisation_integrates_the_motion(plane):
    x0, fin, dt = np.linspace(0.1, 0.4, len(plane.B)), 0.2, 0.7
    Phi, B = plane.discretise(dt, "exact")
    path = solve_ivp(lambda t, x: plane.A @ x + plane.B * fin, (0, dt), x0, rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(Phi @ x0 + B * fin, path.y[:, -1], rtol=1e-8)


@pytest.mark.parametrize("plane", PLANES, ids=lambda p: p.name)
def test_euler_is_the_first_order_of_the_exact_step(plane):
    def gap(dt):
        exact, euler = plane.discretise(dt, "exact"), plane.discretise(dt)
        return max(np.abs(a - b).max() for a, b in zip(exact, euler, strict=True))

    assert gap(1e-3) < 3e-6
    assert gap(1e-3) / gap(5e-4) == pytest.approx(4.0, rel=0.01)


@pytest.mark.parametrize(("plane", "limit"), list(zip(PLANES, (1.14, 0.908), strict=True)))
def test_euler_decays_below_its_limit_and_grows_above(plane, limit):
    assert plane.euler_limit() == pytest.approx(limit, abs=3e-3)

    def largest(dt):
        sizes = np.abs(np.linalg.eigvals(plane.discretise(dt)[0]))
        return np.delete(sizes, np.argmin(np.abs(sizes - 1))).max()  # the integrator aside

    assert largest(0.99 * plane.euler_limit()) < 1 < largest(1.01 * plane.euler_limit())


def test_a_rudder_to_starboard_turns_to_port_in_the_steady_state():
    # Against the closed form of the steady turn: A[:2,:2] (v, r) = −B δ.
    plane = PLANES[0]
    Phi, B = plane.discretise(0.1)
    offsets = np.repeat([B * 0.2], 600, axis=0)
    x = vehicles.simulate(Phi, offsets, np.zeros((1, 600, 3)), np.zeros((1, 3)))
    steady = np.linalg.solve(plane.A[:2, :2], -plane.B[:2] * 0.2)
    np.testing.assert_allclose(x[0, -1, :2], steady, rtol=1e-5)
    assert steady[1] < 0
    assert steady[0] > 0


def test_simulate_is_the_recursion_run_by_run():
    rng = np.random.default_rng(1)
    Phi, offsets = rng.normal(size=(4, 4)), rng.normal(size=(5, 4))
    noise, x0 = rng.normal(size=(3, 5, 4)), rng.normal(size=(3, 4))
    out = vehicles.simulate(Phi, offsets, noise, x0)
    for run in range(3):
        x = x0[run]
        for k in range(5):
            x = Phi @ x + offsets[k] + noise[run, k]
            np.testing.assert_allclose(out[run, k], x, rtol=1e-12)


def test_every_coefficient_has_an_origin():
    for name, row in vehicles.COEFFICIENTS.items():
        assert row.origin in ("public source", "derived"), name
        assert row.unit, name


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: vehicles.steering(Y_w=1.0), "coefficient = 'Y_w': must be one of"),
        (lambda: vehicles.steering(m=np.nan), "m = nan: must be a finite number"),
        (lambda: vehicles.steering(m=-35.5, Y_rdot=0.0), "must give a mass matrix"),
        (lambda: PLANES[0].discretise(0.0), "dt = 0.0: must be a finite number above 0"),
        (lambda: PLANES[0].discretise(0.1, "tustin"), "discretisation = 'tustin': must be one of"),
        (lambda: vehicles.as_printed("roll"), "plane = 'roll': must be one of"),
    ],
)
def test_bad_input_is_one_clear_line(call, line):
    with pytest.raises(ParameterError) as error:
        call()
    assert line in str(error.value)
    assert "\n" not in str(error.value)
