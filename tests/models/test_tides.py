"""Tidal streams: closed forms of the ellipse, of the oscillator and of its covariance."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from seanav.checks import ParameterError
from seanav.models import tides


def test_the_oscillator_is_the_matrix_exponential_of_its_equation():
    speed, dt = 1.4e-4, 3000.0
    F = np.array([[0.0, speed], [-speed, 0.0]])
    np.testing.assert_allclose(tides.oscillator(speed, dt), expm(F * dt), atol=1e-14)


def test_its_covariance_is_stationary_and_its_autocovariance_a_cosine():
    step = tides.oscillator(tides.S08010[0].speed, 60.0)
    P0 = 0.3**2 * np.eye(2)
    Phi = np.linalg.matrix_power(step, 50)
    np.testing.assert_allclose(Phi @ P0 @ Phi.T, P0, atol=1e-14)
    lag = 0.3**2 * math.cos(tides.S08010[0].speed * 3000.0)
    assert (Phi @ P0)[0, 0] == pytest.approx(lag, rel=1e-12)


def test_a_constituent_follows_the_oscillator():
    one = tides.Constituent("M2", 0.6, 28.9841042, 0.0)
    flow = tides.stream([one], [0.0, 900.0, 1800.0], [[0.4]])[0, :, 0]
    x = 0.6 * np.array([math.cos(0.4), -math.sin(0.4)])
    for value in flow:
        assert value == pytest.approx(x[0], abs=1e-12)
        x = tides.oscillator(one.speed, 900.0) @ x


def test_an_ellipse_has_its_axes_its_bearing_and_its_sense():
    one = tides.Constituent("x", 0.5, 30.0, 90.0, 0.2)
    flow = tides.stream([one], np.array([0.0, 3.0, 6.0]) * 3600, [[0.0]])[:, :, 0]
    # First to the east; a quarter of a period later, clockwise from there, to the south.
    np.testing.assert_allclose(flow, [[0.0, -0.2, 0.0], [0.5, 0.0, -0.5]], atol=1e-12)


def test_the_built_in_stream_has_the_variance_of_its_constituents():
    phases = np.random.default_rng(1).uniform(0, 2 * math.pi, (len(tides.S08010), 20_000))
    north = tides.stream(tides.S08010, [0.0], phases)[0]
    wanted = sum(amplitude**2 for _, amplitude, _ in tides._NORTH) / 2
    assert north.var() == pytest.approx(wanted, rel=0.03)


@pytest.mark.parametrize(
    "wrong",
    [
        {"amplitude": -1.0},
        {"degrees_per_hour": 0.0},
        {"bearing_deg": math.nan},
        {"minor": 2.0},
    ],
)
def test_refused(wrong):
    good = {"name": "x", "amplitude": 1.0, "degrees_per_hour": 30.0, "bearing_deg": 0.0}
    with pytest.raises(ParameterError):
        tides.Constituent(**(good | wrong))
