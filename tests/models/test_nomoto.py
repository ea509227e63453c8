"""Nomoto's model of a turning ship against its closed form."""

import numpy as np
import pytest

from seanav.checks import ParameterError
from seanav.models.nomoto import Ship, zigzag


def test_a_held_rudder_has_the_exponential_answer():
    dt, steps = 0.5, 60
    # So weak a rudder does not reach the angle of heading: it stays on one side.
    command, rate = zigzag(Ship(1e-3, 3.0), np.full(steps, 0.3), dt, np.zeros(steps), fine=2000)
    assert (command > 0).all()
    t = dt * np.arange(steps)
    assert np.allclose(rate, 1e-3 * 0.3 * (1 - np.exp(-t / 3.0)), rtol=1e-3, atol=1e-12)


def test_a_step_is_that_of_the_discrete_model():
    ship, dt = Ship(K=0.2, T=3.0), 0.5
    a = np.exp(-dt / ship.T)
    command, rate = zigzag(ship, np.full(400, 0.35), dt, np.zeros(400), fine=2000)
    expected = a * rate[:-1] + ship.K * (1 - a) * command[:-1]
    assert np.allclose(rate[1:], expected, atol=1e-4 * np.abs(rate).max())
    assert {-0.35, 0.35} == set(np.round(command, 12))  # and it went to both sides


def test_the_rudder_is_turned_when_the_heading_has_reached_its_angle():
    dt, angle = 0.5, 0.35
    command, rate = zigzag(Ship(0.2, 3.0), np.full(300, angle), dt, np.zeros(300))
    heading = np.cumsum(np.r_[0.0, rate[1:] + rate[:-1]]) * dt / 2
    turned = np.flatnonzero(np.diff(command)) + 1
    assert turned.size > 3
    for k in turned:
        assert abs(heading[k]) >= angle * 0.97
        assert np.sign(heading[k]) == -np.sign(command[k])


def test_cubic_damping_and_a_slow_rudder_have_their_limits():
    ship = Ship(K=1e-2, T=2.0, cubic=4e4, rudder_rate=0.01)
    _, rate = zigzag(ship, np.full(900, 0.5), 0.5, np.zeros(900), fine=50)
    r = rate[-1]  # too slow to reach its angle of heading in that time
    heading = rate.sum() * 0.5
    assert heading < 0.5 or abs(r) < 0.01
    steady = np.roots([ship.cubic, 0.0, 1.0, -ship.K * 0.5])
    (limit,) = steady[np.abs(steady.imag) < 1e-12].real
    late = rate[150:200]  # the rudder has been over for long
    assert late.max() == pytest.approx(limit, rel=0.01)
    # The rudder needs fifty seconds to go over: the ship answers like one that follows it.
    slow, fast = (
        rate[20],
        zigzag(ship._replace(rudder_rate=9.0), np.full(30, 0.5), 0.5, np.zeros(30))[1][20],
    )
    assert slow < 0.4 * fast


def test_pushes_are_added_to_the_rate():
    quiet = zigzag(Ship(0.2, 3.0), np.full(5, 0.3), 0.5, np.zeros(5))[1]
    pushed = zigzag(Ship(0.2, 3.0), np.full(5, 0.3), 0.5, [0, 0.01, 0, 0, 0])[1]
    assert np.allclose(pushed[:2], quiet[:2])
    assert pushed[2] - quiet[2] == pytest.approx(0.01)


@pytest.mark.parametrize(
    "bad", [{"dt": 0.0}, {"angles": [np.nan]}, {"pushes": [0.0, 1.0]}, {"fine": 0}]
)
def test_bad_arguments_are_one_line(bad):
    arguments = {"ship": Ship(0.2, 3.0), "angles": [0.3], "dt": 0.5, "pushes": [0.0]} | bad
    with pytest.raises(ParameterError):
        zigzag(**arguments)
