"""Slopes, windows and updates of the matching filters, and their whole run, against references."""

import filterpy.kalman
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matching_references import (
    MGAL,
    P0,
    SLOPE,
    SPACING,
    Q,
    R,
    block_by_slices,
    hills,
    packed,
    plane,
    riccati,
    simulate,
    unpacked,
)
from scipy.interpolate import RegularGridInterpolator
from scipy.stats import chi2

from seanav.filters.gravity import matching

# --- the slope of the map ---------------------------------------------------------------


def test_summed_area_is_the_sum_below_and_left():
    values = np.random.default_rng(0).standard_normal((4, 6))
    table = matching._summed_area(values)
    expected = [[values[:i, :j].sum() for j in range(7)] for i in range(5)]
    np.testing.assert_allclose(table, expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("size", range(1, 8))
def test_block_slope_is_exact_on_a_plane_wherever_the_block_fits(size):
    grid = plane(17)
    for i in range(size, 17 - size):
        for j in range(size, 17 - size):
            slope = matching.block_gradient(grid, SPACING, i, j, size)
            np.testing.assert_allclose(slope, SLOPE, rtol=1e-11)


@pytest.mark.parametrize("size", [1, 2, 5])
def test_block_slope_is_the_difference_of_the_block_sums(size):
    grid = MGAL * np.random.default_rng(3).standard_normal((15, 18))
    for i, j in [(size, size), (7, 9), (14 - size, 17 - size)]:
        slope = matching.block_gradient(grid, SPACING, i, j, size)
        np.testing.assert_allclose(slope, block_by_slices(grid, i, j, size), rtol=1e-11)


def test_point_slope_is_the_derivative_of_the_bilinear_map():
    grid = hills(20)
    h = RegularGridInterpolator((np.arange(20) * SPACING,) * 2, grid)
    points = np.random.default_rng(4).uniform(0.01, 0.99, (50, 2)) * SPACING
    points += np.random.default_rng(5).integers(0, 19, (50, 2)) * SPACING
    for east, north in points:
        numerical = [
            (h((north, east + 1)) - h((north, east - 1))) / 2,
            (h((north + 1, east)) - h((north - 1, east))) / 2,
        ]
        slope = matching._point_gradient(grid, SPACING, east, north)
        np.testing.assert_allclose(slope, numerical, rtol=1e-8, atol=1e-16)


def test_point_slope_has_no_component_across_a_clamped_border():
    grid = plane(11)
    for east, north in [(-5.0, 4e3), (10e3 + 5.0, 4e3)]:
        slope = matching._point_gradient(grid, SPACING, east, north)
        np.testing.assert_allclose(slope, [0, SLOPE[1]], rtol=1e-11)
    for east, north in [(4e3, -5.0), (4e3, 10e3 + 5.0)]:
        slope = matching._point_gradient(grid, SPACING, east, north)
        np.testing.assert_allclose(slope, [SLOPE[0], 0], rtol=1e-11)


def test_window_is_the_largest_standard_deviation_in_nodes_whatever_its_direction():
    for angle in np.linspace(0, np.pi, 13):
        axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        ee, en, nn = packed(axes @ np.diag([2.7e3**2, 0.4e3**2]) @ axes.T)
        assert matching._window(ee, en, nn, SPACING, 1.0, 15) == 3
        assert matching._window(ee, en, nn, SPACING, 3.0, 15) == 8
        assert matching._window(ee, en, nn, SPACING, 3.0, 5) == 5
        assert matching._window(ee, en, nn, SPACING, 0.1, 15) == 1


# --- the covariance update ---------------------------------------------------------------

# 10 m to 3 km, up to 10 mGal/km, 0.1 mGal and worse: S/R up to 2e5, which is what the
# tolerances below stand for.
positive = st.floats(1e2, 1e7)
slopes = st.floats(-1e-7, 1e-7)
variances = st.floats(1e-12, 1e-6)
# The first call compiles, which is no reason to fail.
patient = settings(deadline=None)


@patient
@given(positive, positive, st.floats(-0.999, 0.999), slopes, slopes, variances)
def test_update_is_the_information_form_and_never_adds_uncertainty(ee, nn, rho, he, hn, R):
    P = np.array([[ee, rho * np.sqrt(ee * nn)], [rho * np.sqrt(ee * nn), nn]])
    H = np.array([he, hn])
    *new, S, ke, kn = matching._update(ee, P[0, 1], nn, he, hn, R)
    after = unpacked(np.array(new))
    scale = np.sqrt(np.diag(P))
    assert min(np.linalg.eigvalsh(after / np.outer(scale, scale))) > 0
    assert min(np.linalg.eigvalsh((P - after) / np.outer(scale, scale))) > -1e-12
    np.testing.assert_allclose(S, H @ P @ H + R, rtol=1e-12)
    np.testing.assert_allclose([ke, kn], P @ H / S, rtol=1e-9, atol=1e-12 * max(abs(P @ H / S)))
    # Joseph form, in the units of the standard deviations
    rest = np.eye(2) - np.outer(P @ H / S, H)
    joseph = rest @ P @ rest.T + R * np.outer(P @ H, P @ H) / S**2
    np.testing.assert_allclose(
        after / np.outer(scale, scale), joseph / np.outer(scale, scale), atol=1e-11
    )


@patient
@given(positive, slopes, slopes, slopes, slopes, variances, variances)
def test_two_independent_updates_commute(variance, he1, hn1, he2, hn2, R1, R2):
    def both(first, second):
        P = (variance, 0.0, variance)
        for H_and_R in (first, second):
            P = matching._update(*P, *H_and_R)[:3]
        return np.array(P) / variance

    a, b = (he1, hn1, R1), (he2, hn2, R2)
    np.testing.assert_allclose(both(a, b), both(b, a), rtol=1e-9, atol=1e-12)


# --- the whole filter ---------------------------------------------------------------------


@pytest.mark.parametrize("gradient", ["block", "point"])
def test_covariance_on_a_plane_is_the_riccati_recursion(gradient):
    tracks = matching.sitan(plane(), SPACING, *simulate(3), R, P0, Q, gradient=gradient)
    expected = packed(riccati(np.tile(SLOPE, (25, 1)), R))
    np.testing.assert_allclose(tracks.P, np.broadcast_to(expected, (3, 25, 3)), rtol=1e-9)


def test_covariance_on_a_plane_holds_along_the_border_and_beyond_it():
    inputs = simulate(50, start=(0, 0), end=(60e3, 300.0))
    tracks = matching.sitan(plane(), SPACING, *inputs, R, P0, Q, window_sigmas=4.0)
    north = inputs[0][:, 1] + tracks.errors[..., 1]
    assert north.min() < -SPACING
    expected = packed(riccati(np.tile(SLOPE, (25, 1)), R))
    np.testing.assert_allclose(tracks.P, np.broadcast_to(expected, (50, 25, 3)), rtol=1e-9)


@pytest.mark.parametrize("gradient", ["block", "point"])
def test_mean_square_error_on_a_plane_is_the_bound(gradient):
    runs = 4000
    errors = matching.sitan(plane(), SPACING, *simulate(runs), R, P0, Q, gradient=gradient).errors
    bound = riccati(np.tile(SLOPE, (25, 1)), R)
    assert SLOPE @ bound[-1] @ SLOPE < 0.25 * SLOPE @ P0 @ SLOPE  # the measurements do tell
    ratio = np.einsum("rka,kab,rkb->k", errors, np.linalg.inv(bound), errors)
    low, high = chi2.ppf([0.0005, 0.9995], 2 * runs)
    assert (low < ratio).all()
    assert (ratio < high).all()


def consistent(tracks):
    """Two-sided test of NEES at the end and of the sum of NIS at 99.9 %."""
    runs, steps = tracks.nis.shape
    last = tracks.errors[:, -1]
    nees = np.einsum("ra,rab,rb->", last, np.linalg.inv(unpacked(tracks.P[:, -1])), last)
    bounds = [chi2.ppf([0.0005, 0.9995], n * runs) for n in (2, steps - 1)]
    sums = nees, np.nansum(tracks.nis)
    return [bool(low < s < high) for s, (low, high) in zip(sums, bounds, strict=True)]


def test_consistency_on_a_plane_and_its_loss_when_mistuned():
    inputs = simulate(2000)
    assert consistent(matching.sitan(plane(), SPACING, *inputs, R, P0, Q)) == [True, True]
    for wrong in (0.7, 1.4):
        assert consistent(matching.sitan(plane(), SPACING, *inputs, wrong * R, P0, Q))[1] is False
        mistuned = matching.sitan(plane(), SPACING, *inputs, R, wrong * P0, wrong * Q)
        assert consistent(mistuned)[0] is False


def filterpy_run(grid, slope_at, truth, initial, drift, noise):
    """Return errors, P and NIS of one run with filterpy's extended filter, state = position."""
    h = RegularGridInterpolator(
        (np.arange(grid.shape[0]) * SPACING, np.arange(grid.shape[1]) * SPACING), grid
    )
    ekf = filterpy.kalman.ExtendedKalmanFilter(2, 1)
    ekf.x, ekf.P, ekf.Q, ekf.R = truth[0] + initial, P0.copy(), Q, np.array([[R]])
    errors, P, nis = [initial], [P0], [np.nan]
    for k in range(1, len(truth)):
        ekf.predict(u=0)
        # the INS carries its indicated position along with the true motion and its drift
        ekf.x = ekf.x + truth[k] - truth[k - 1] + drift[k]
        ekf.update(
            np.array([h(truth[k][::-1])[0] + noise[k]]),
            lambda x: slope_at(x, ekf.P)[None],
            lambda x: h(x[::-1]),
        )
        errors.append(ekf.x - truth[k])
        P.append(ekf.P)
        nis.append(ekf.y[0] ** 2 / ekf.S[0, 0])
    return np.array(errors), packed(np.array(P)), np.array(nis)


def point_slope(grid):
    def slope(position, _):
        i, j = (int(x // SPACING) for x in position[::-1])
        t, s = position[::-1] / SPACING - (i, j)
        cell = grid[i : i + 2, j : j + 2]
        east, north = np.diff(cell, axis=1)[:, 0], np.diff(cell, axis=0)[0]
        return np.array([east @ [1 - t, t], north @ [1 - s, s]]) / SPACING

    return slope


def block_slope(grid, sigmas):
    def slope(position, P):
        i, j = (round(x / SPACING) for x in position[::-1])
        size = max(1, round(sigmas * np.sqrt(np.linalg.eigvalsh(P)[-1]) / SPACING))
        return block_by_slices(grid, i, j, size)

    return slope


@pytest.mark.parametrize("grid", [plane(), hills()], ids=["plane", "hills"])
@pytest.mark.parametrize("gradient", ["point", "block"])
def test_every_step_equals_filterpy(grid, gradient):
    inputs = truth, initial, drift, noise = simulate(5)
    tracks = matching.sitan(grid, SPACING, *inputs, R, P0, Q, gradient=gradient, window_sigmas=2.5)
    slope_at = point_slope(grid) if gradient == "point" else block_slope(grid, 2.5)
    for r in range(5):
        expected = filterpy_run(grid, slope_at, truth, initial[r], drift[r], noise[r])
        np.testing.assert_allclose(tracks.errors[r], expected[0], rtol=1e-8, atol=1e-5)
        np.testing.assert_allclose(tracks.P[r], expected[1], rtol=1e-8, atol=1e-3)
        np.testing.assert_allclose(tracks.nis[r], expected[2], rtol=1e-7, atol=1e-10)


def test_the_window_is_that_of_the_predicted_covariance():
    inputs = truth, initial, drift, _ = simulate(10, steps=2)
    Q = np.diag([3.1e6, 4.9e6])
    tracks = matching.sitan(hills(), SPACING, *inputs, R, P0, Q)
    i, j = np.rint((truth[1] + initial + drift[:, 1]).T[::-1] / SPACING).astype(int)
    for r in range(10):
        # about 1.1 km before and 2.4 km after the prediction
        H = block_by_slices(hills(), i[r], j[r], 2)
        expected = np.linalg.inv(np.linalg.inv(P0 + Q) + np.outer(H, H) / R)
        np.testing.assert_allclose(tracks.P[r, 1], packed(expected), rtol=1e-8)


def test_the_window_follows_the_covariance_on_hills():
    inputs = simulate(20)
    small, large = (
        matching.sitan(hills(), SPACING, *inputs, R, P0, Q, window_sigmas=s) for s in (1.0, 6.0)
    )
    limited = matching.sitan(
        hills(), SPACING, *inputs, R, P0, Q, window_sigmas=6.0, largest_window=1
    )
    assert not np.allclose(small.errors, large.errors, atol=1.0)
    assert not np.allclose(limited.errors, large.errors, atol=1.0)
