"""Point-mass filter against the Kalman filter, dense Bayes in numpy, and calibration."""

import re

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import convolve1d

from seanav.checks import ParameterError
from seanav.filters.gravity import matching
from seanav.filters.gravity.point_mass import point_mass

MGAL = 1e-5
SPACING = 1000.0
R = (2 * MGAL) ** 2
P0 = np.array([[1.0e6, 0.25e6], [0.25e6, 0.7e6]])
Q = np.diag([60.0**2, 30.0**2])
NONE = np.zeros((2, 2))


def plane(nodes=41):
    i, j = np.mgrid[:nodes, :nodes]
    return (2.1 * j - 1.3 * i) * MGAL


def waves(nodes=41):
    """Return a map that a plane cannot stand for over ±1 km."""
    i, j = np.mgrid[:nodes, :nodes]
    return 9 * MGAL * (np.sin(j / 1.4 + i / 3.1) + np.cos(i / 1.1 - j / 2.7))


def simulate(runs, steps=8, *, P0=P0, Q=Q, seed=1):
    """Return truth, initial_error, drift, noise; the track bends, so both axes are seen."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0, 1, steps)
    truth = 1e3 * np.stack([12 + 15 * s, 14 + 11 * s**2], axis=1)
    initial = rng.multivariate_normal([0, 0], P0, runs)
    drift = rng.multivariate_normal([0, 0], Q, (runs, steps))
    return truth, initial, drift, np.sqrt(R) * rng.standard_normal((runs, steps))


def dense(grid, truth, initial, drift, noise, Q, cell, span):
    """One run of Bayes' rule with logarithms, no cell ever dropped, map read by scipy."""
    nodes = [np.arange(n) * SPACING for n in grid.shape]
    h = RegularGridInterpolator(nodes, grid)
    half = np.ceil(span * np.sqrt(np.diag(P0)) / cell)
    east, north = (np.arange(-n, n + 1) * cell for n in half)
    north, east = np.meshgrid(north, east, indexing="ij")
    displacement = np.stack([east, north], axis=-1)
    log_weight = -0.5 * np.einsum("ija,ab,ijb->ij", displacement, np.linalg.inv(P0), displacement)
    errors, P, ins = [], [], initial
    for k in range(len(truth)):
        if k:
            ins = ins + drift[k]
            weight = np.exp(log_weight)
            for axis, q in ((1, Q[0, 0]), (0, Q[1, 1])):
                a = q / (2 * cell**2)
                weight = convolve1d(weight, [a, 1 - 2 * a, a], axis=axis, mode="constant")
            position = np.clip(truth[k] + ins + displacement, 0, nodes[0][-1])
            measured = h(truth[k][::-1]) + noise[k]
            with np.errstate(divide="ignore"):
                log_weight = np.log(weight) - (measured - h(position[..., ::-1])) ** 2 / (2 * R)
            log_weight -= log_weight.max()
        weight = np.exp(log_weight) / np.exp(log_weight).sum()
        mean = np.einsum("ij,ija->a", weight, displacement)
        spread = displacement - mean
        covariance = np.einsum("ij,ija,ijb->ab", weight, spread, spread)
        errors.append(ins + mean)
        P.append(covariance[[0, 0, 1], [0, 1, 1]])
    return np.array(errors), np.array(P)


@pytest.mark.parametrize("Q", [NONE, Q], ids=["no drift", "drift"])
def test_every_step_equals_dense_bayes(Q):
    inputs = truth, initial, drift, noise = simulate(4, Q=Q)
    errors, P = point_mass(waves(), SPACING, *inputs, R, P0, Q, cell=125.0, span_sigmas=4.0)
    for r in range(4):
        expected = dense(waves(), truth, initial[r], drift[r], noise[r], Q, 125.0, 4.0)
        np.testing.assert_allclose(errors[r], expected[0], rtol=0, atol=1e-4)
        np.testing.assert_allclose(P[r], expected[1], rtol=1e-6, atol=1e-2)


@pytest.mark.parametrize("shift", [(-11e3, -13e3), (12.5e3, 14.5e3)], ids=["low", "high"])
def test_the_map_is_clamped_at_its_border(shift):
    inputs = truth, initial, drift, noise = simulate(3)
    truth += shift
    errors, P = point_mass(waves(), SPACING, *inputs, R, P0, Q, cell=125.0, span_sigmas=4.0)
    for r in range(3):
        expected = dense(waves(), truth, initial[r], drift[r], noise[r], Q, 125.0, 4.0)
        np.testing.assert_allclose(errors[r], expected[0], rtol=0, atol=1e-4)
        np.testing.assert_allclose(P[r], expected[1], rtol=1e-6, atol=1e-2)


def test_an_outlier_that_is_unlikely_everywhere_leaves_a_proper_posterior():
    inputs = truth, initial, drift, noise = simulate(1)
    noise[0, 1] = 100 * np.sqrt(R)
    errors, P = point_mass(waves(), SPACING, *inputs, R, P0, Q, cell=125.0, span_sigmas=4.0)
    expected = dense(waves(), truth, initial[0], drift[0], noise[0], Q, 125.0, 4.0)
    np.testing.assert_allclose(errors[0], expected[0], rtol=0, atol=1e-3)
    np.testing.assert_allclose(P[0], expected[1], rtol=1e-5, atol=1e-1)


def test_an_outlier_cannot_empty_the_grid_once_cells_were_dropped():
    inputs = simulate(20)
    inputs[3][:, 5] = 1000 * np.sqrt(R)
    errors, _ = point_mass(waves(), SPACING, *inputs, R, P0, Q, cell=125.0)
    assert np.isfinite(errors).all()
    assert (abs(errors) < 9e3).all()  # within the grid around the INS


@pytest.mark.parametrize("Q", [NONE, Q], ids=["no drift", "drift"])
def test_on_a_plane_it_is_the_kalman_filter(Q):
    inputs = simulate(20, Q=Q)
    exact = matching.sitan(plane(), SPACING, *inputs, R, P0, Q, gradient="point")
    errors, P = point_mass(plane(), SPACING, *inputs, R, P0, Q, cell=100.0, span_sigmas=6.0)
    # What is left: three points are not a Gaussian, and weights below 1e-12.
    tolerance = 1e-3 if Q.any() else 1e-6
    np.testing.assert_allclose(errors, exact.errors, rtol=0, atol=1e3 * tolerance)
    np.testing.assert_allclose(P, exact.P, rtol=tolerance, atol=1e6 * tolerance)


def test_refining_the_cells_converges_faster_than_second_order():
    inputs = simulate(20, Q=NONE)
    exact = matching.sitan(plane(), SPACING, *inputs, R, P0, NONE, gradient="point")
    gaps = []
    for cell in (2000.0, 1000.0, 500.0):
        errors, _ = point_mass(plane(), SPACING, *inputs, R, P0, NONE, cell=cell, span_sigmas=6.0)
        gaps.append(abs(errors - exact.errors).max())
    assert gaps[0] > 100.0
    assert gaps[1] < gaps[0] / 4
    assert gaps[2] < gaps[1] / 4


def test_refining_the_cells_converges_on_a_map_that_is_not_a_plane():
    inputs = simulate(20)
    runs = [
        point_mass(waves(), SPACING, *inputs, R, P0, Q, cell=cell)[0] for cell in (300, 150, 75)
    ]
    assert abs(runs[0] - runs[1]).max() > abs(runs[1] - runs[2]).max()
    assert abs(runs[1] - runs[2]).max() < 5.0


def test_without_information_the_covariance_grows_by_exactly_q():
    inputs = simulate(1, steps=15)
    _, P = point_mass(np.zeros((41, 41)), SPACING, *inputs, R, P0, Q, cell=80.0, span_sigmas=7.0)
    k = np.arange(15)[:, None]
    expected = P0[[0, 0, 1], [0, 1, 1]] + k * Q[[0, 0, 1], [0, 1, 1]]
    np.testing.assert_allclose(P[0], expected, rtol=1e-6, atol=1e-3)


def test_the_three_point_convolution_has_q_up_to_a_whole_cell():
    wide = np.diag([80.0**2, 80.0**2])
    inputs = simulate(1, steps=15, Q=wide)
    _, P = point_mass(np.zeros((41, 41)), SPACING, *inputs, R, P0, wide, cell=80.0, span_sigmas=7.0)
    np.testing.assert_allclose(P[0, :, 0], 1e6 + np.arange(15) * 80.0**2, rtol=1e-6)


def calibration(assumed_R):
    """z-score of the NEES at the end, whose mean is 2 for any posterior, Gaussian or not.

    That holds when the truth is drawn around what the INS indicates, as Bayes' rule takes it,
    and not for one fixed truth: so the INS track is the same here, and each run has its truth.
    """
    ins, initial, drift, noise = simulate(2000)
    drift[:, 0] = 0
    truths = ins - initial[:, None] - drift.cumsum(axis=1)
    nees = []
    for run in zip(truths, initial[:, None], drift[:, None], noise[:, None], strict=True):
        errors, P = point_mass(waves(), SPACING, *run, assumed_R, P0, Q, cell=150.0)
        (east, north), (ee, en, nn) = errors[0, -1], P[0, -1]
        squared = nn * east**2 - 2 * en * east * north + ee * north**2
        nees.append(squared / (ee * nn - en**2))
    return (np.mean(nees) - 2) / (np.std(nees) / np.sqrt(len(nees)))


def test_the_posterior_is_calibrated_and_not_when_mistuned():
    assert abs(calibration(R)) < 3.3
    assert calibration(0.6 * R) > 3.3
    assert calibration(1.6 * R) < -3.3


def test_no_kalman_filter_beats_the_posterior_mean_on_waves():
    inputs = simulate(500)
    reference, _ = point_mass(waves(), SPACING, *inputs, R, P0, Q, cell=150.0)
    for gradient in ("block", "point"):
        errors = matching.sitan(waves(), SPACING, *inputs, R, P0, Q, gradient=gradient).errors
        gain = (errors[:, -1] ** 2 - reference[:, -1] ** 2).sum(axis=1)
        assert gain.mean() > 3.3 * gain.std() / np.sqrt(500)


def test_mirror_units_and_level_change_nothing():
    truth, initial, drift, noise = simulate(10)
    errors, P = point_mass(waves(), SPACING, truth, initial, drift, noise, R, P0, Q)
    again = point_mass(
        -4 * waves() + 100 * MGAL, SPACING, truth, initial, drift, -4 * noise, 16 * R, P0, Q
    )
    np.testing.assert_allclose(again[0], errors, rtol=0, atol=1e-5)
    np.testing.assert_allclose(again[1], P, rtol=1e-8, atol=1e-3)
    east = np.array([-1, 1])
    there = truth * east + [40e3, 0]
    mirrored = P0 * np.outer(east, east)
    again = point_mass(
        waves()[:, ::-1], SPACING, there, initial * east, drift * east, noise, R, mirrored, Q
    )
    np.testing.assert_allclose(again[0], errors * east, rtol=0, atol=1e-5)
    np.testing.assert_allclose(again[1], P * [1, -1, 1], rtol=1e-8, atol=1e-3)


def test_a_run_is_the_same_to_the_last_bit_in_any_batch():
    truth, *batch = simulate(12)
    whole = point_mass(waves(), SPACING, truth, *batch, R, P0, Q)
    for rows in (slice(7, 8), slice(3, 9), slice(None, None, -1)):
        part = point_mass(waves(), SPACING, truth, *(x[rows] for x in batch), R, P0, Q)
        for a, b in zip(whole, part, strict=True):
            np.testing.assert_array_equal(a[rows], b)


@pytest.mark.parametrize(
    "name", ["truth", "initial_error", "drift", "noise", "anomaly", "R", "cell"]
)
def test_inputs_of_extreme_size_are_refused_or_survived(name):
    given = dict(zip(["truth", "initial_error", "drift", "noise"], simulate(4), strict=True))
    given |= {"anomaly": waves(), "spacing": SPACING, "R": R, "P0": P0, "Q": Q, "cell": 300.0}
    given[name] = 1.6e308 * np.sign(given[name])
    try:
        answer = point_mass(**given)
    except ParameterError as error:
        answer = str(error)
    if isinstance(answer, str):
        assert re.search("must leave errors|must be a finite number", answer)
    else:
        assert all(np.isfinite(part).all() for part in answer)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("Q", np.diag([1.0, 101.0**2]), "Q = .*: must be diagonal and at most cell² = 10000"),
        ("Q", [[1.0, 0.5], [0.5, 1.0]], "Q = .*: must be diagonal"),
        ("R", 0.0, "R = 0.0: must be a finite number above 0"),
        ("cell", 0.0, "cell = 0.0: must be a finite number above 0"),
        ("cell", 0.1, "cell = 0.1: must be wider: above 4,000,000 cells"),
        ("span_sigmas", -1.0, "span_sigmas = -1.0: must be a finite number above 0"),
        ("noise", np.zeros((4, 7)), r"noise = \(4, 7\): must have the shape \(4, 8\)"),
    ],
)
def test_bad_input_is_one_line_naming_the_parameter(name, value, message):
    given = dict(zip(["truth", "initial_error", "drift", "noise"], simulate(4), strict=True))
    given |= {"anomaly": waves(), "spacing": SPACING, "R": R, "P0": P0, "Q": Q, name: value}
    with pytest.raises(ParameterError, match=message):
        point_mass(**given)
