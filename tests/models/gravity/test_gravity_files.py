"""Formats, names, directions and turns of a user's own gravity grid."""

import itertools

import numpy as np
import pytest
from gravity_grids import (
    HERE,
    NAMES,
    check,
    expected_map,
    field_at,
    regional_axes,
    regional_geotiff,
    regional_netcdf,
    write_geotiff,
    write_netcdf,
)
from rasterio.transform import Affine
from rasterio.warp import transform

from seanav.models.gravity.files import from_file
from seanav.models.gravity.sources import load


@pytest.mark.parametrize("form", ["NETCDF4", "NETCDF3_CLASSIC"])
@pytest.mark.parametrize("names", NAMES)
@pytest.mark.parametrize("falling", list(itertools.product([False, True], repeat=2)))
def test_netcdf_of_any_form_name_and_direction(tmp_path, form, names, falling):
    latitude, longitude = regional_axes()
    if falling[0]:
        latitude = latitude[::-1]
    if falling[1]:
        longitude = longitude[::-1]
    values = field_at(latitude[:, None], longitude[None, :], HERE)
    path = write_netcdf(
        tmp_path / "a.nc", latitude, longitude, {"z": (values, "f8", {})}, names=names, form=form
    )
    grid = from_file(path, *HERE)
    check(grid)
    assert grid.spacing == 1000.0
    assert grid.centre == HERE
    assert grid.source == "a.nc, z"


@pytest.mark.parametrize("form", ["NETCDF4", "NETCDF3_64BIT_OFFSET"])
@pytest.mark.parametrize("first", [0.0, -180.0])
@pytest.mark.parametrize("registration", ["pixel", "gridline"])
@pytest.mark.parametrize("longitude", [128.0, 180.0, -179.8, 359.9, 0.1, -90.0])
def test_global_grid_of_either_turn(tmp_path, form, first, registration, longitude):
    # A band of the globe. Gridline registration holds the first meridian twice.
    centre = (-30.0, longitude)
    step = 1 / 30
    columns = np.arange(360 * 30 + 1) * step if registration == "gridline" else None
    if columns is None:
        columns = (np.arange(360 * 30) + 0.5) * step
    rows = centre[0] + np.arange(-20, 21) * step
    values = field_at(rows[:, None], (first + columns)[None, :], centre)
    path = write_netcdf(
        tmp_path / "a.nc", rows, first + columns, {"z": (values, "f8", {})}, form=form
    )
    check(from_file(path, *centre))


def test_regional_grid_across_the_date_line(tmp_path):
    centre = (10.0, 179.9)
    latitude, longitude = regional_axes(centre)
    turned = (longitude + 180) % 360 - 180
    assert turned.min() < -179
    values = field_at(latitude[:, None], turned[None, :], centre)
    path = write_netcdf(tmp_path / "a.nc", latitude, turned, {"z": (values, "f8", {})})
    check(from_file(path, *centre))


def test_packed_values_and_fill_values(tmp_path):
    def holes(values):
        values = np.ma.array(values, mask=False)
        values[0, :] = np.ma.masked
        return values

    packing = {"scale_factor": 0.01, "add_offset": 5.0, "_FillValue": np.int16(-32768)}
    latitude, longitude = regional_axes()
    values = holes(field_at(latitude[:, None], longitude[None, :], HERE))
    path = write_netcdf(tmp_path / "a.nc", latitude, longitude, {"z": (values, "i2", packing)})
    check(from_file(path, *HERE), tolerance_mgal=0.01)


@pytest.mark.parametrize(
    "dimensions", [("time", "lat", "lon"), ("lon", "lat"), ("lon", "t", "lat")]
)
def test_order_of_dimensions_and_single_layers(tmp_path, dimensions):
    latitude, longitude = regional_axes()
    values = field_at(latitude[:, None], longitude[None, :], HERE)
    if dimensions[0] == "lon":
        values = values.T
    shape = {"time": 1, "t": 1, "lat": len(latitude), "lon": len(longitude)}
    values = values.reshape([shape[d] for d in dimensions])
    path = write_netcdf(
        tmp_path / "a.nc", latitude, longitude, {"z": (values, "f8", {})}, dimensions=dimensions
    )
    check(from_file(path, *HERE))


@pytest.mark.parametrize("upward", [False, True])
@pytest.mark.parametrize("turn", [0.0, -360.0, 360.0])
def test_geographic_geotiff(tmp_path, upward, turn):
    check(from_file(regional_geotiff(tmp_path / "a.tif", upward=upward, turn=turn), *HERE))


def test_geotiff_of_the_globe_across_its_edge(tmp_path):
    centre, step = (-30.0, 180.0), 1 / 30
    longitude = -180 + (np.arange(360 * 30) + 0.5) * step
    latitude = -29.0 - (np.arange(60) + 0.5) * step
    values = field_at(latitude[:, None], longitude[None, :], centre)
    path = write_geotiff(tmp_path / "a.tif", values, Affine(step, 0, -180, 0, -step, -29.0))
    check(from_file(path, *centre))


def test_projected_geotiff_mercator(tmp_path):
    # Spherical Mercator in closed form, so that the reader's projection has a reference.
    radius, step = 6378137.0, 2000.0
    x0 = np.radians(HERE[1]) * radius - 120e3
    y0 = np.log(np.tan(np.pi / 4 + np.radians(HERE[0]) / 2)) * radius + 110e3
    x = x0 + (np.arange(121) + 0.5) * step
    y = y0 - (np.arange(111) + 0.5) * step
    latitude = np.degrees(2 * np.arctan(np.exp(y / radius)) - np.pi / 2)
    values = field_at(latitude[:, None], np.degrees(x / radius)[None, :], HERE)
    path = write_geotiff(
        tmp_path / "a.tif", values, Affine(step, 0, x0, 0, -step, y0), crs="EPSG:3857"
    )
    check(from_file(path, *HERE))


def test_projected_geotiff_whose_grid_is_turned_against_north(tmp_path):
    # UTM zone 51 at 128° E lies 5° from its central meridian: its grid north is 1.6° off.
    step, x0, y0 = 2000.0, 920e3, 2210e3
    x, y = np.meshgrid(x0 + (np.arange(130) + 0.5) * step, y0 - (np.arange(130) + 0.5) * step)
    longitude, latitude = transform("EPSG:32651", "EPSG:4326", x.ravel(), y.ravel())
    values = field_at(np.reshape(latitude, x.shape), np.reshape(longitude, x.shape), HERE)
    path = write_geotiff(
        tmp_path / "a.tif", values, Affine(step, 0, x0, 0, -step, y0), crs="EPSG:32651"
    )
    check(from_file(path, *HERE))


def test_geotiff_with_scale_offset_and_nodata(tmp_path):
    def pack(values):
        packed = np.round((values - 5) / 0.01)
        packed[:, 0] = -32768
        return packed

    path = regional_geotiff(
        tmp_path / "a.tif", change=pack, dtype="int16", nodata=-32768, scale=(0.01, 5.0)
    )
    check(from_file(path, *HERE), tolerance_mgal=0.01)


def test_load_reads_a_file_on_another_grid(tmp_path):
    grid = load(
        str(regional_netcdf(tmp_path / "a.nc")),
        latitude_deg=HERE[0],
        longitude_deg=HERE[1],
        size=41,
        spacing=2000.0,
    )
    assert grid.spacing == 2000.0
    np.testing.assert_allclose(grid.anomaly_mgal, expected_map(41, 2000.0), rtol=0, atol=0.01)


def test_each_band_of_a_geotiff_has_its_own_scale(tmp_path):
    stored = regional_geotiff(
        tmp_path / "two.tif",
        change=lambda values: np.stack([np.zeros_like(values), (values - 7.0) / 0.25]),
        scale=(0.25, 7.0),
    )
    check(from_file(stored, *HERE, variable="2"))
