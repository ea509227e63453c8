"""Symmetries of the matching filters, and inputs that they refuse."""

import numpy as np
import pytest
from matching_references import (
    P0,
    SLOPE,
    SPACING,
    Q,
    R,
    block_by_slices,
    hills,
    packed,
    plane,
    simulate,
)

from seanav.checks import ParameterError
from seanav.filters.gravity import matching

# --- symmetries ---------------------------------------------------------------------------

both_gradients = pytest.mark.parametrize("gradient", ["block", "point"])


@both_gradients
def test_the_level_of_the_map_changes_nothing_even_as_absolute_gravity(gradient):
    inputs = simulate(40)
    a, b = (
        matching.sitan(hills() + level, SPACING, *inputs, R, P0, Q, gradient=gradient)
        for level in (0.0, 9.8)
    )
    np.testing.assert_allclose(b.errors, a.errors, rtol=0, atol=1e-5)
    np.testing.assert_allclose(b.P, a.P, rtol=1e-8, atol=1e-3)


@both_gradients
def test_the_units_of_gravity_cancel(gradient):
    truth, initial, drift, noise = simulate(40)
    a = matching.sitan(hills(), SPACING, truth, initial, drift, noise, R, P0, Q, gradient=gradient)
    for c in (4.0, -1.0):  # exact in binary: to the last bit
        b = matching.sitan(
            c * hills(),
            SPACING,
            truth,
            initial,
            drift,
            c * noise,
            c * c * R,
            P0,
            Q,
            gradient=gradient,
        )
        np.testing.assert_array_equal(b.errors, a.errors)
        np.testing.assert_array_equal(b.P, a.P)
        np.testing.assert_array_equal(b.nis, a.nis)


@both_gradients
def test_the_mirrored_map_gives_mirrored_errors(gradient):
    inputs = truth, initial, drift, noise = simulate(40)
    a = matching.sitan(hills(), SPACING, *inputs, R, P0, Q, gradient=gradient)
    flip, sign = np.array([[-1, 1], [1, -1]]), np.array([1, -1, 1])
    for axis in (0, 1):  # east, north
        there = truth.copy()
        there[:, axis] = 60e3 - truth[:, axis]
        b = matching.sitan(
            np.flip(hills(), 1 - axis), SPACING, there, initial * flip[axis], drift * flip[axis],
            noise, R, P0 * [[1, -1], [-1, 1]], Q * [[1, -1], [-1, 1]], gradient=gradient,
        )  # fmt: skip
        np.testing.assert_allclose(b.errors, a.errors * flip[axis], rtol=0, atol=1e-5)
        np.testing.assert_allclose(b.P, a.P * sign, rtol=1e-8, atol=1e-3)


@both_gradients
def test_exchanging_east_and_north_exchanges_the_errors(gradient):
    truth, initial, drift, noise = simulate(40)
    a = matching.sitan(hills(), SPACING, truth, initial, drift, noise, R, P0, Q, gradient=gradient)
    b = matching.sitan(
        hills().T, SPACING, truth[:, ::-1], initial[:, ::-1], drift[..., ::-1], noise,
        R, P0[::-1, ::-1], Q[::-1, ::-1], gradient=gradient,
    )  # fmt: skip
    np.testing.assert_allclose(b.errors, a.errors[..., ::-1], rtol=0, atol=1e-5)
    np.testing.assert_allclose(b.P, a.P[..., ::-1], rtol=1e-8, atol=1e-3)


@both_gradients
def test_a_run_is_the_same_to_the_last_bit_in_any_batch(gradient):
    truth, *batch = simulate(30)
    whole = matching.sitan(hills(), SPACING, truth, *batch, R, P0, Q, gradient=gradient)
    for rows in (slice(7, 8), slice(3, 20), slice(None, None, -1)):
        part = matching.sitan(
            hills(), SPACING, truth, *(x[rows] for x in batch), R, P0, Q, gradient=gradient
        )
        for a, b in zip(whole, part, strict=True):
            np.testing.assert_array_equal(a[rows], b)


def test_sample_zero_is_the_start_before_any_measurement():
    inputs = truth, initial, drift, noise = simulate(10)
    tracks = matching.sitan(hills(), SPACING, *inputs, R, P0, Q)
    np.testing.assert_array_equal(tracks.errors[:, 0], initial)
    np.testing.assert_array_equal(tracks.P[:, 0], np.tile(packed(P0), (10, 1)))
    assert np.isnan(tracks.nis[:, 0]).all()
    assert np.isfinite(tracks.nis[:, 1:]).all()
    drift[:, 0] += 1e6
    noise[:, 0] += 1.0
    again = matching.sitan(hills(), SPACING, truth, initial, drift, noise, R, P0, Q)
    np.testing.assert_array_equal(again.errors, tracks.errors)


# --- bad input ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("anomaly", np.zeros((2, 9)), r"anomaly = \(2, 9\): must have at least 3 × 3 nodes"),
        ("anomaly", np.zeros(9), r"anomaly = \(9,\): must have the shape \(north, east\)"),
        ("anomaly", np.full((9, 9), np.nan), "anomaly = nan: must be finite everywhere"),
        ("spacing", 0.0, "spacing = 0.0: must be a finite number above 0"),
        ("truth", np.zeros((25, 3)), r"truth = \(25, 3\): must have the shape \(25, 2\)"),
        ("truth", np.zeros((24, 2)), r"noise = \(4, 25\): must have the shape \(4, 24\)"),
        ("initial_error", np.zeros((3, 2)), r"initial_error = \(3, 2\): .* \(4, 2\)"),
        ("drift", np.zeros((4, 25)), r"drift = \(4, 25\): must have the shape \(4, 25, 2\)"),
        ("noise", np.zeros((0, 25)), r"noise = \(0, 25\): must have the shape \(runs, 25\)"),
        ("R", 0.0, "R = 0.0: must be a finite number above 0"),
        ("R", -1.0, "R = -1.0: must be a finite number above 0"),
        ("R", np.inf, "R = inf: must be a finite number above 0"),
        ("P0", np.zeros((2, 2)), "P0 = .*: must be symmetric and positive definite"),
        ("P0", [[1.0, 0.5], [0.4, 1.0]], "P0 = .*: must be symmetric and positive definite"),
        ("P0", -np.eye(2), "P0 = .*: must be symmetric and positive definite"),
        ("Q", [[1.0, 2.0], [2.0, 1.0]], "Q = .*: must be symmetric and positive semidefinite"),
        ("Q", -np.eye(2), "Q = .*: must be symmetric and positive semidefinite"),
        ("gradient", "plane", "gradient = 'plane': must be one of 'block', 'point'"),
        ("window_sigmas", -1.0, "window_sigmas = -1.0: must be a finite number at least 0"),
        ("largest_window", 0, "largest_window = 0: must be an integer of at least 1"),
    ],
)
def test_bad_input_is_one_line_naming_the_parameter(name, value, message):
    given = dict(zip(["truth", "initial_error", "drift", "noise"], simulate(4), strict=True))
    given |= {"anomaly": hills(), "spacing": SPACING, "R": R, "P0": P0, "Q": Q, name: value}
    with pytest.raises(ParameterError, match=message):
        matching.sitan(**given)


def test_no_index_is_made_of_what_is_no_number():
    # Uncompiled, where such an index would be an error instead of a stray read.
    grid = hills(9)
    assert matching._point_gradient.py_func(grid, SPACING, np.nan, np.nan) == (0.0, 0.0)
    table = matching._summed_area(grid)
    slope = matching._nearest_block.py_func(table, SPACING, np.nan, np.nan, 3)
    np.testing.assert_allclose(slope, block_by_slices(grid, 1, 1, 1), rtol=1e-11)
    assert matching._window.py_func(np.nan, 0.0, 1.0, SPACING, 1.0, 15) == 15


@pytest.mark.parametrize("gradient", ["block", "point"])
@pytest.mark.parametrize("name", ["truth", "initial_error", "drift", "noise", "anomaly"])
def test_inputs_of_extreme_size_are_refused_or_survived(name, gradient):
    given = dict(zip(["truth", "initial_error", "drift", "noise"], simulate(4), strict=True))
    given |= {"anomaly": hills(), "spacing": SPACING, "R": R, "P0": P0, "Q": Q}
    given[name] = 1.6e308 * np.sign(given[name])
    try:
        answer = matching.sitan(**given, gradient=gradient).errors
    except ParameterError as error:
        answer = str(error)
    if isinstance(answer, str):
        assert "must leave errors and covariances that are finite" in answer
    else:
        assert np.isfinite(answer).all()


def test_no_process_noise_is_allowed():
    tracks = matching.sitan(plane(), SPACING, *simulate(2, Q=0 * Q), R, P0, np.zeros((2, 2)))
    information = np.linalg.inv(P0) + 24 * np.outer(SLOPE, SLOPE) / R
    np.testing.assert_allclose(tracks.P[:, -1], [packed(np.linalg.inv(information))] * 2, rtol=1e-9)
