"""Units, choices and faults of a user's own gravity grid: read right, or refused in one line."""

import os
import subprocess
import sys

import netCDF4
import numpy as np
import pytest
from gravity_grids import (
    HERE,
    check,
    field_at,
    refused,
    regional_axes,
    regional_geotiff,
    regional_netcdf,
    write_geotiff,
    write_netcdf,
)
from rasterio.errors import NotGeoreferencedWarning
from rasterio.transform import Affine

from seanav.models.gravity.files import from_file

# Units


@pytest.mark.parametrize(
    ("unit", "per_mgal"),
    [
        ("mGal", 1),
        ("mgal", 1),
        ("milligals", 1),
        ("m/s2", 1e-5),
        ("m s-2", 1e-5),
        ("m s**-2", 1e-5),
        ("m/s^2", 1e-5),
        ("m/s²", 1e-5),
        ("um/s2", 10),
        ("µm s-2", 10),
        ("Gal", 1e-3),
        ("uGal", 1e3),
        ("cm/s^2", 1e-3),
    ],
)
def test_unit_of_a_netcdf_variable(tmp_path, unit, per_mgal):
    path = regional_netcdf(tmp_path / "a.nc", scale=per_mgal, attributes={"units": unit})
    check(from_file(path, *HERE))


def test_unit_of_a_geotiff_band(tmp_path):
    path = regional_geotiff(tmp_path / "a.tif", change=lambda v: v * 1e-5, units="m/s^2")
    check(from_file(path, *HERE))


@pytest.mark.parametrize("stated", [None, "", "10-5 m/s2", 7])
@pytest.mark.parametrize(
    ("unit", "per_mgal"), [("mGal", 1), ("m/s2", 1e-5), ("µGal", 1e3), ("uGal", 1e3)]
)
def test_unit_that_the_file_does_not_state_can_be_said(tmp_path, stated, unit, per_mgal):
    attributes = {"units": stated}
    path = regional_netcdf(tmp_path / "a.nc", scale=per_mgal, attributes=attributes)
    check(from_file(path, *HERE, unit=unit))


def test_unit_that_is_said_must_be_the_one_that_is_stated(tmp_path):
    path = regional_netcdf(tmp_path / "a.nc", attributes={"units": "milligal"})
    check(from_file(path, *HERE, unit="mGal"))
    message = "map_unit = 'm/s2': must be 'file': z has the unit 'milligal'$"
    refused(path, message, parameter="map_unit", unit="m/s2")
    message = "must be one of 'file', 'mGal', 'm/s2', 'µGal', 'uGal'$"
    refused(path, message, parameter="map_unit", unit="m")


@pytest.mark.parametrize(
    ("scale", "attributes", "message"),
    [
        (1.0, {"units": "m"}, "must be in mGal or m/s² .* z has the unit 'm'$"),
        (1.0, {"units": "nT"}, "has the unit 'nT'$"),
        (1e-5, {"units": "mGal"}, "spread over at least 0.1"),
        (
            100.0,
            {},
            "within ±800 .* largest at 19.2222° N, 127.4667° E$",
        ),
        (1.0, {"units": "m/s2"}, r"within ±800"),
    ],
)
def test_wrong_unit(tmp_path, scale, attributes, message):
    path = regional_netcdf(tmp_path / "a.nc", scale=scale, attributes=attributes)
    refused(path, message)


def test_absolute_gravity_is_no_anomaly(tmp_path):
    refused(regional_netcdf(tmp_path / "a.nc", change=lambda v: v + 978000), "within ±800")


# What cannot be used


def test_missing_file_and_folder(tmp_path):
    refused(tmp_path / "no.nc", "the path of an existing file$")
    refused(tmp_path, "the path of an existing file$")
    refused(7, "the path of an existing file$")
    refused("a\0b", "the path of an existing file$")


@pytest.mark.parametrize("content", [b"", b"lat,lon,mgal\n1,2,3\n", b"\x89PNG\r\n\x1a\n"])
def test_file_that_is_not_a_grid(tmp_path, content):
    (tmp_path / "a.nc").write_bytes(content)
    refused(tmp_path / "a.nc", "must be a NetCDF or GeoTIFF grid$")


@pytest.mark.parametrize("form", ["NETCDF4", "NETCDF3_CLASSIC"])
def test_netcdf_cut_short(tmp_path, form):
    path = regional_netcdf(tmp_path / "a.nc", form=form)
    path.write_bytes(path.read_bytes()[:60])
    refused(path, "must be readable: ")


def test_geotiff_cut_short(tmp_path):
    path = regional_geotiff(tmp_path / "a.tif")
    path.write_bytes(path.read_bytes()[:3000])
    refused(path, "must be readable: ")


def test_netcdf_without_axes(tmp_path):
    latitude, longitude = regional_axes()
    values = np.zeros((len(latitude), len(longitude)))
    path = write_netcdf(
        tmp_path / "a.nc", latitude, longitude, {"z": (values, "f8", {})}, names=("row", "col")
    )
    refused(path, "must be a grid: no variable lies on a latitude and a longitude, by their ")


@pytest.mark.parametrize("count", [0, 1])
def test_netcdf_of_one_row(tmp_path, count):
    latitude, longitude = regional_axes()
    values = {"z": (np.zeros((count, len(longitude))), "f8", {})}
    path = write_netcdf(tmp_path / "a.nc", latitude[:count], longitude, values)
    refused(path, "must have two values or more on lat and lon$")


def test_netcdf_whose_axis_is_text(tmp_path):
    path = tmp_path / "a.nc"
    with netCDF4.Dataset(path, "w") as dataset:
        for name in ("lat", "lon"):
            dataset.createDimension(name, 3)
            dataset.createVariable(name, str, (name,))[:] = np.array(["a", "b", "c"], object)
        dataset.createVariable("z", "f8", ("lat", "lon"))[:] = 0
    refused(path, "must be a grid: no variable lies on ")


def test_netcdf_with_axes_and_nothing_on_them(tmp_path):
    path = write_netcdf(tmp_path / "a.nc", *regional_axes(), {})
    refused(path, "must be a grid: no variable lies on ")


def test_netcdf_with_many_layers_is_not_one_grid(tmp_path):
    path = regional_netcdf(tmp_path / "a.nc")
    with netCDF4.Dataset(path, "a") as dataset:
        dataset.createDimension("time", 2)
        dataset.renameVariable("z", "once")
        layers = dataset.createVariable("layers", "f8", ("time", "lat", "lon"))
        layers[:] = 0.0
    check(from_file(path, *HERE))  # the single layer is the only candidate
    refused(path, "must be one of 'once'", parameter="map_variable", variable="layers")


@pytest.mark.parametrize("axis_units", ["m", "km"])
def test_netcdf_in_metres(tmp_path, axis_units):
    path = regional_netcdf(tmp_path / "a.nc", names=("y", "x"), axis_units=axis_units)
    refused(path, "must state the reference system of y and x, by a grid_mapping ")


def test_netcdf_whose_axes_cannot_be_degrees(tmp_path):
    latitude, longitude = regional_axes()
    values = np.zeros((len(latitude), len(longitude)))
    variables = {"z": (values, "f8", {})}
    path = write_netcdf(tmp_path / "a.nc", latitude * 1000, longitude, variables, names=("y", "x"))
    refused(path, "must have y and x in degrees$")


def test_several_variables_must_be_chosen_from(tmp_path):
    latitude, longitude = regional_axes()
    values = field_at(latitude[:, None], longitude[None, :], HERE)
    path = write_netcdf(
        tmp_path / "a.nc",
        latitude,
        longitude,
        {"error": (0 * values, "f4", {}), "faa": (values, "f8", {"units": "mGal"})},
    )
    message = "must name one of 'error', 'faa': .* holds several grids$"
    refused(path, message, parameter="map_variable")
    refused(path, message, parameter="map_variable", variable="")
    message = "must be one of 'error', 'faa', in "
    refused(path, message, parameter="map_variable", variable="z")
    check(from_file(path, *HERE, variable="faa"))


def test_several_bands_must_be_chosen_from(tmp_path):
    path = regional_geotiff(
        tmp_path / "a.tif",
        change=lambda v: np.stack([0 * v, v]),
        descriptions=(None, "faa"),
    )
    refused(path, "must name one of '1', 'faa': ", parameter="map_variable")
    for variable in ("faa", "2", 2):
        check(from_file(path, *HERE, variable=variable))
    for variable in ("3", "0", "02", 2.0, True):
        message = "must be one of '1', 'faa', in "
        refused(path, message, parameter="map_variable", variable=variable)


def test_description_of_two_bands_names_neither(tmp_path):
    path = regional_geotiff(
        tmp_path / "a.tif", change=lambda v: np.stack([0 * v, v]), descriptions=("z", "z")
    )
    message = "must be one of '1', '2', in "
    refused(path, message, parameter="map_variable", variable="z")
    check(from_file(path, *HERE, variable="2"))


def test_description_that_is_the_number_of_another_band_is_ambiguous(tmp_path):
    path = regional_geotiff(
        tmp_path / "a.tif",
        change=lambda v: np.stack([0 * v, v, 0 * v]),
        descriptions=("3", "2", "9"),
    )
    message = "must be unambiguous: band 1 of .* is described as '3'$"
    refused(path, message, parameter="map_variable", variable="3")
    # Such a description is no name that could be offered: band 1 is called by its number.
    refused(path, "must name one of '1', '2', '9': ", parameter="map_variable")
    check(from_file(path, *HERE, variable="2"))


@pytest.mark.parametrize("name", ["PROJ_LIB", "PROJ_DATA", "GDAL_DATA"])
def test_data_of_another_installation_are_not_used(tmp_path, name):
    step, x0, y0 = 2000.0, 920e3, 2210e3
    grids = {
        "degrees": regional_geotiff(tmp_path / "a.tif"),
        "metres": write_geotiff(
            tmp_path / "b.tif",
            np.random.default_rng(0).uniform(-40, 40, (130, 130)),
            Affine(step, 0, x0, 0, -step, y0),
            crs="EPSG:32651",
        ),
    }
    code = f"""
import os, sys
from seanav.models.gravity.files import from_file
print(*(repr(from_file(path, *{HERE}).anomaly_mgal.sum()) for path in sys.argv[1:]))
assert os.environ["{name}"] == "/nowhere"
"""
    done = subprocess.run(
        [sys.executable, "-c", code, *grids.values()],
        env=dict(os.environ) | {name: "/nowhere"},
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert done.stderr == ""
    here = (repr(from_file(path, *HERE).anomaly_mgal.sum()) for path in grids.values())
    assert done.stdout.split("\n")[0] == " ".join(here)


@pytest.mark.parametrize("write", [regional_netcdf, regional_geotiff])
def test_window_that_is_not_covered(tmp_path, write):
    path = write(tmp_path / "a")
    for centre in [(19.5, 128.0), (18.0, 128.0), (18.8, 129.0), (18.8, 127.0), (-18.8, 308.0)]:
        refused(
            path,
            r"it spans 18\.\d\d…19\.\d\d° N, 12\d\.\d\d…12\d\.\d\d° E; its middle is ",
            centre=centre,
        )


def test_gap_between_the_ends_of_a_grid(tmp_path):
    # 1…359° E in steps of a degree's 30th leaves two degrees at the meridian of Greenwich.
    centre = (0.0, 0.0)
    longitude = np.arange(1.0, 359.0, 1 / 30)
    latitude = np.arange(-1, 1, 1 / 30)
    values = field_at(latitude[:, None], longitude[None, :], centre)
    path = write_netcdf(tmp_path / "a.nc", latitude, longitude, {"z": (values, "f8", {})})
    refused(path, "without a gap", centre=centre)


def hole_at(latitude_deg, longitude_deg):
    def punch(values):
        latitude, longitude = regional_axes()
        i = np.abs(latitude - latitude_deg).argmin()
        j = np.abs(longitude - longitude_deg).argmin()
        values = values.copy()
        values[i, j] = np.nan
        return values

    return punch


def test_hole_in_the_window(tmp_path):
    for k, (latitude, longitude) in enumerate([(18.8, 128.0), (19.24, 128.0), (18.8, 127.54)]):
        path = regional_netcdf(tmp_path / f"{k}.nc", change=hole_at(latitude, longitude))
        refused(path, "must have a value at every node of the window; z lacks 1$")


def test_hole_in_the_window_of_a_geotiff(tmp_path):
    def punch(values):
        values = values.copy()
        values[48, 56] = -9999.0
        return values

    path = regional_geotiff(tmp_path / "a.tif", change=punch, nodata=-9999.0)
    refused(path, "must have a value at every node of the window; 1 lacks 1$")


def test_hole_beside_the_window_does_no_harm(tmp_path):
    # The window ends at 19.2517° N; the second row beyond it is not needed.
    path = regional_netcdf(tmp_path / "a.nc", change=hole_at(19.29, 128.0))
    check(from_file(path, *HERE))


def test_geotiff_without_a_place(tmp_path):
    refused(regional_geotiff(tmp_path / "a.tif", crs=None), "it states no reference system$")
    path = write_geotiff(tmp_path / "b.tif", np.ones((5, 5)), Affine(1, 0.1, 0, 0.1, -1, 0))
    refused(path, "must have rows that run along the x axis of its ")


def test_picture_without_any_georeference(tmp_path):
    with pytest.warns(NotGeoreferencedWarning):
        path = write_geotiff(tmp_path / "a.tif", np.ones((5, 5)), None, crs=None)
    refused(path, "it states no reference system$")
    with pytest.warns(NotGeoreferencedWarning):
        path = write_geotiff(tmp_path / "b.tif", np.ones((5, 5)), None)
    refused(path, "it states no place: its pixels are only counted$")


def test_geotiff_in_coordinates_of_no_place_on_earth(tmp_path):
    local = 'LOCAL_CS["tank",UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]'
    refused(regional_geotiff(tmp_path / "a.tif", crs=local), "must have a geographic or projected")


def test_place_that_is_none(tmp_path):
    path = regional_netcdf(tmp_path / "a.nc")
    refused(path, "at least -80 and at most 80", (85.0, 0.0), "map_latitude_deg")
    refused(path, "at least -180 and at most 360", (0.0, 400.0), "map_longitude_deg")
