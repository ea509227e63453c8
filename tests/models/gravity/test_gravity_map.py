import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from seanav.checks import ParameterError
from seanav.models import gravity
from seanav.models.gravity.map import GravityMap, _bilinear

# Unequal sides, so that a swap of north and east cannot pass.
NORTH, EAST, SPACING = 5, 8, 500.0


def surface(function):
    north, east = np.meshgrid(np.arange(NORTH), np.arange(EAST), indexing="ij")
    return GravityMap(function(east * SPACING, north * SPACING), SPACING)


def points_inside(count=200):
    generator = np.random.default_rng(5)
    return generator.uniform(0, [(EAST - 1) * SPACING, (NORTH - 1) * SPACING], (count, 2))


def test_interpolation_agrees_with_scipy():
    grid = np.random.default_rng(1).normal(size=(NORTH, EAST))
    points = points_inside()
    reference = RegularGridInterpolator(
        (np.arange(NORTH) * SPACING, np.arange(EAST) * SPACING), grid
    )(points[:, ::-1])
    np.testing.assert_allclose(gravity.interpolate(grid, SPACING, points), reference, atol=1e-14)


def test_interpolation_is_exact_where_the_surface_is_bilinear():
    def h(east, north):
        return 3 - 2e-3 * east + 5e-4 * north + 1e-6 * east * north

    points = points_inside()
    values = gravity.interpolate(surface(h).anomaly, SPACING, points)
    np.testing.assert_allclose(values, h(*points.T), rtol=0, atol=1e-13)


def test_interpolation_returns_the_nodes_themselves():
    grid = np.random.default_rng(2).normal(size=(NORTH, EAST))
    north, east = np.meshgrid(np.arange(NORTH) * SPACING, np.arange(EAST) * SPACING, indexing="ij")
    points = np.stack([east, north], axis=-1)
    np.testing.assert_array_equal(gravity.interpolate(grid, SPACING, points), grid)


def test_point_off_the_map_gets_the_value_of_the_border():
    grid = np.random.default_rng(3).normal(size=(NORTH, EAST))
    assert _bilinear(grid, SPACING, -1e9, 700.0) == _bilinear(grid, SPACING, 0.0, 700.0)
    assert _bilinear(grid, SPACING, 1e9, 1e9) == grid[-1, -1]
    assert _bilinear(grid, SPACING, 1e9, -1.0) == grid[0, -1]
    assert _bilinear(grid, SPACING, 0.0, np.inf) == grid[-1, 0]


def test_a_point_that_is_not_a_number_has_no_value():
    grid = np.zeros((NORTH, EAST))
    assert np.isnan(_bilinear(grid, SPACING, np.nan, 0.0))
    assert np.isnan(_bilinear(grid, SPACING, 0.0, np.nan))
    # uncompiled too, where an index made of it would be an error instead of a stray read
    assert np.isnan(_bilinear.py_func(grid, SPACING, np.nan, 0.0))


def test_gradient_is_exact_on_a_quadratic_surface_including_its_border():
    slope = gravity.gradient(
        surface(lambda e, n: 7 + 2e-3 * e - 3e-3 * n + 4e-7 * e**2 - 6e-7 * e * n + 1e-7 * n**2)
    )
    north, east = np.meshgrid(np.arange(NORTH) * SPACING, np.arange(EAST) * SPACING, indexing="ij")
    np.testing.assert_allclose(slope[0], 2e-3 + 8e-7 * east - 6e-7 * north, atol=1e-14)
    np.testing.assert_allclose(slope[1], -3e-3 - 6e-7 * east + 2e-7 * north, atol=1e-14)


def test_interpolated_gradient_is_east_then_north_for_any_shape_of_points():
    slope = gravity.gradient(surface(lambda e, n: 2e-3 * e - 3e-3 * n))
    points = points_inside(12).reshape(3, 4, 2)
    expected = np.broadcast_to([2e-3, -3e-3], (3, 4, 2))
    np.testing.assert_allclose(gravity.interpolate(slope, SPACING, points), expected, rtol=1e-12)


def test_map_keeps_its_units_and_size():
    plane = surface(lambda e, n: 1e-5 * (e + n))
    assert plane.extent == ((EAST - 1) * SPACING, (NORTH - 1) * SPACING)
    np.testing.assert_allclose(plane.anomaly_mgal[1, 2], 1500.0)
    assert plane.anomaly.flags["C_CONTIGUOUS"]
    assert plane.anomaly.dtype == np.float64


def test_transposed_grid_is_laid_out_again():
    grid = np.arange(12.0).reshape(3, 4)
    assert GravityMap(grid.T).anomaly.flags["C_CONTIGUOUS"]


def test_map_refuses_what_is_not_a_grid():
    with pytest.raises(ParameterError, match="3 × 3"):
        GravityMap(np.zeros((2, 5)))
    with pytest.raises(ParameterError, match="finite everywhere"):
        GravityMap(np.full((4, 4), np.nan))
    with pytest.raises(ParameterError, match="spacing = 0"):
        GravityMap(np.zeros((4, 4)), 0.0)


@pytest.mark.parametrize("centre", [(18.8, 128.0), (-42.0, 179.9), (60.0, -179.95)])
def test_local_coordinates_return(centre):
    generator = np.random.default_rng(4)
    east, north = generator.uniform(-60e3, 60e3, (2, 50))
    latitude, longitude = gravity.local_to_geodetic(east, north, centre)
    for turn in (-360.0, 0.0, 360.0):
        back = gravity.geodetic_to_local(latitude, longitude + turn, centre)
        np.testing.assert_allclose(back, (east, north), rtol=0, atol=1e-7)


@pytest.mark.parametrize("latitude_deg", [0.0, 18.8, 45.0, 70.0])
def test_local_coordinates_against_the_exact_ellipsoid(latitude_deg):
    # WGS 84, exact radii of curvature. The paper's radii drop terms of order f² = 1.1e-5.
    a, f = 6378137.0, 1 / 298.257223563
    e2 = f * (2 - f)
    w = np.sqrt(1 - e2 * np.sin(np.radians(latitude_deg)) ** 2)
    meridian, prime_vertical = a * (1 - e2) / w**3, a / w
    step = 0.45
    east, north = gravity.geodetic_to_local(latitude_deg + step, step, (latitude_deg, 0.0))
    exact_east = np.radians(step) * prime_vertical * np.cos(np.radians(latitude_deg))
    exact_north = np.radians(step) * meridian
    assert abs(east / exact_east - 1) < 3e-5
    assert abs(north / exact_north - 1) < 3e-5
    # ... and it is the meridian that shortens towards the equator
    assert (north < np.radians(step) * a) == (latitude_deg < 54)
