"""The six-velocity body: conservation laws of the free body, and its equations by hand."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from seanav.filters import moments
from seanav.models import bodies


def drift(body, quadratic=None):
    """Return f(x, tau) of a body as a plain function, from the symbols."""
    f, G, names = bodies.equations(quadratic_drag=quadratic is not None)
    model = moments.system(bodies.STATES, f, G, bodies.INPUTS, names)
    modules = [{"SignedSquare": lambda x: x * abs(x)}, "numpy"]
    symbols = [*model.states, *model.inputs, *model.parameters]
    call = sp.lambdify(symbols, list(model.drift), modules)
    numbers = [*body.parameters(), *(() if quadratic is None else quadratic)]
    return lambda x, tau=(0,) * 6: np.array(call(*x, *tau, *numbers), dtype=float)


def free(body):
    return bodies.Body(body.name, body.mass, body.inertia, (0,) * 6, (0,) * 6, (0,) * 6, (0,) * 6)


START = np.array([1.1, -0.4, 0.3, 0.5, -0.7, 0.9])


@pytest.mark.parametrize("name", bodies.BODIES)
def test_free_body_keeps_kirchhoff_invariants(name):
    body = free(bodies.BODIES[name])
    f = drift(body)
    M, J = np.diag(body.mass), np.diag(body.inertia)
    path = solve_ivp(lambda t, x: f(x), (0, 10), START, rtol=1e-11, atol=1e-12).y
    momentum, spin = M @ path[:3], J @ path[3:]
    energy = (path[:3] * momentum).sum(axis=0) + (path[3:] * spin).sum(axis=0)
    for invariant in (energy, (momentum**2).sum(axis=0), (momentum * spin).sum(axis=0)):
        np.testing.assert_allclose(invariant, invariant[0], rtol=1e-8)
    assert np.ptp(path, axis=1).min() > 0.1 or name == "torpedo"


def test_surge_and_roll_are_the_printed_equations():
    body = bodies.TORPEDO
    u, v, w, p, q, r = START
    tau = np.arange(1.0, 7.0)
    m1, m2, m3 = body.mass
    j1, j2, j3 = body.inertia
    rate = drift(body)(START, tau)
    surge = (m2 * v * r - m3 * w * q - 5 * u - 3 * u**3 + tau[0]) / m1
    roll = ((j2 - j3) * q * r + (m2 - m3) * v * w - p - p**3 + tau[3]) / j1
    assert rate[0] == pytest.approx(surge, rel=1e-12)
    assert rate[3] == pytest.approx(roll, rel=1e-12)


def test_axes_are_cyclic():
    # Renaming the axes 1 → 2 → 3 → 1 of body and state renames the rates.
    def turned(values):
        return tuple(np.roll(np.reshape(values, (-1, 3)), 1, axis=1).ravel())

    t = bodies.Body("", (30, 60, 75), (2, 5, 9), *np.arange(24.0).reshape(4, 6).tolist())
    other = bodies.Body("", *(turned(getattr(t, a)) for a in list(t.__dataclass_fields__)[1:]))
    tau = np.arange(6.0)
    expected = turned(drift(t)(START, tau))
    np.testing.assert_allclose(drift(other)(turned(START), turned(tau)), expected, rtol=1e-12)


def test_quadratic_drag_opposes_motion_on_both_sides():
    b = np.arange(1.0, 7.0)
    body = free(bodies.TORPEDO)
    with_drag, without = drift(body, b), drift(body)
    inertia = np.array([*body.mass, *body.inertia])
    for x in (START, -START):
        expected = -b * x * np.abs(x) / inertia
        np.testing.assert_allclose(with_drag(x) - without(x), expected, rtol=1e-12)


def test_forces_are_modulated_by_half():
    forces = bodies.SPHERE.forces(np.array([0.0, np.pi / 0.6]))
    np.testing.assert_allclose(forces[0], bodies.SPHERE.inputs)
    np.testing.assert_allclose(forces[1], 1.5 * np.array(bodies.SPHERE.inputs))


def test_recalled_sphere_is_a_sphere():
    # Added mass of a sphere is half the displaced water; 0.64 m across.
    volume = np.pi / 6 * 0.64**3
    assert bodies.SPHERE.mass[0] - 126.55 == pytest.approx(0.5 * 1025 * volume, rel=0.01)


def test_drag_slows_the_simulated_body_as_the_solution_of_its_equation():
    # Surge alone: u' = -(a u + c u³)/m has u²/(a + c u²) ∝ exp(-2 a t / m).
    f, G, names = bodies.equations()
    model = moments.system(bodies.STATES, f, G, bodies.INPUTS, names)
    parameters, step = bodies.TORPEDO.parameters(np.zeros(6)), 1e-3
    start = np.array([[1.5, 0, 0, 0, 0, 0]])
    noise = np.zeros((1, 4000, 6))
    end = moments.Simulator(model)(start, noise, step, None, parameters)[0, -1]
    shrink = 1.5**2 / (5 + 3 * 1.5**2) * np.exp(-2 * 5 * 4.0 / 31.41)
    assert end[0] == pytest.approx(np.sqrt(5 * shrink / (1 - 3 * shrink)), rel=2e-4)
    assert np.array_equal(end[1:], np.zeros(5))


def test_the_torpedo_rolls_fastest():
    assert bodies.TORPEDO.fastest() == pytest.approx(0.2474 / 1.0)
    assert bodies.SPHERE.fastest() == pytest.approx(5.29 / 13.7935)
