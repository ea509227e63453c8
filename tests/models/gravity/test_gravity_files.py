import itertools
import os
import subprocess
import sys

import netCDF4
import numpy as np
import pytest
import rasterio
from rasterio.errors import NotGeoreferencedWarning
from rasterio.transform import Affine
from rasterio.warp import transform

from seanav.checks import ParameterError
from seanav.models import gravity
from seanav.models.gravity.files import from_file
from seanav.models.gravity.sources import load

HERE = (18.8, 128.0)
NAMES = [("lat", "lon"), ("latitude", "longitude"), ("y", "x")]


def field(east, north):
    # mGal; no symmetry between the axes or their directions
    wave = 40 * np.sin(2 * np.pi * east / 70e3 + 0.3) * np.cos(2 * np.pi * north / 90e3)
    return wave + 1e-4 * east - 2e-4 * north


def field_at(latitude, longitude, centre):
    return field(*gravity.geodetic_to_local(latitude, longitude, centre))


def expected_map(size=101, spacing=1000.0):
    offset = (np.arange(size) - (size - 1) / 2) * spacing
    north, east = np.meshgrid(offset, offset, indexing="ij")
    return field(east, north)


def check(grid, tolerance_mgal=0.002):
    np.testing.assert_allclose(grid.anomaly_mgal, expected_map(), rtol=0, atol=tolerance_mgal)


def regional_axes(centre=HERE, reach=0.8, step=1 / 60):
    offset = np.arange(-reach, reach + step / 2, step) + step / 3  # no node on the centre
    return centre[0] + offset, centre[1] + 1.2 * offset


def write_netcdf(
    path,
    latitude,
    longitude,
    variables,
    *,
    names=("lat", "lon"),
    form="NETCDF4",
    dimensions=None,
    axis_units=None,
):
    """Write each of `variables`: name -> (values, dtype, attributes)."""
    with netCDF4.Dataset(path, "w", format=form) as dataset:
        for name, values in zip(names, (latitude, longitude), strict=True):
            dataset.createDimension(name, len(values))
            axis = dataset.createVariable(name, "f8", (name,))
            axis[:] = values
            if axis_units:
                axis.units = axis_units
        if dimensions:
            for name in set(dimensions) - set(names):
                dataset.createDimension(name, 1)
        for name, (values, dtype, attributes) in variables.items():
            attributes = dict(attributes)
            fill = attributes.pop("_FillValue", None)
            variable = dataset.createVariable(name, dtype, dimensions or names, fill_value=fill)
            variable.setncatts(attributes)
            variable[:] = values
    return path


def regional_netcdf(path, *, scale=1.0, attributes=None, name="z", change=None, **options):
    latitude, longitude = regional_axes()
    values = scale * field_at(latitude[:, None], longitude[None, :], HERE)
    if change:
        values = change(values)
    return write_netcdf(
        path, latitude, longitude, {name: (values, "f8", attributes or {})}, **options
    )


def write_geotiff(path, values, matrix, crs="EPSG:4326", dtype="float64", **options):
    bands = values if values.ndim == 3 else values[None]
    units = options.pop("units", None)
    scale = options.pop("scale", None)
    descriptions = options.pop("descriptions", None)
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        height=bands.shape[1],
        width=bands.shape[2],
        count=len(bands),
        dtype=dtype,
        crs=crs,
        transform=matrix,
        **options,
    ) as dataset:
        dataset.write(bands.astype(dtype))
        if units:
            dataset.units = [units] * len(bands)
        if scale:
            dataset.scales, dataset.offsets = [scale[0]], [scale[1]]
        if descriptions:
            dataset.descriptions = descriptions
    return path


def regional_geotiff(path, *, change=None, upward=False, turn=0.0, **options):
    step, rows, columns = 1 / 60, 97, 113
    south, west = HERE[0] - 0.8, HERE[1] - 0.93
    latitude = south + (np.arange(rows) + 0.5) * step
    longitude = west + (np.arange(columns) + 0.5) * step
    values = field_at(latitude[:, None], longitude[None, :], HERE)
    matrix = Affine(step, 0, west + turn, 0, step, south)
    if not upward:  # the first row in the north, as files usually have it
        values = values[::-1]
        matrix = Affine(step, 0, west + turn, 0, -step, south + rows * step)
    if change:
        values = change(values)
    return write_geotiff(path, values, matrix, **options)


# Formats, names, directions and turns of the longitude


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
    attributes = {} if stated is None else {"units": stated}
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
        (1e-5, {}, r"must be an anomaly in mGal.*spread over at least 0.1.*unit not stated"),
        (1e-5, {"units": "mGal"}, "spread over at least 0.1"),
        (100.0, {}, r"within ±1000"),
        (1.0, {"units": "m/s2"}, r"within ±1000"),
    ],
)
def test_wrong_unit(tmp_path, scale, attributes, message):
    path = regional_netcdf(tmp_path / "a.nc", scale=scale, attributes=attributes)
    refused(path, message)


def test_absolute_gravity_is_no_anomaly(tmp_path):
    refused(regional_netcdf(tmp_path / "a.nc", change=lambda v: v + 978000), "within ±1000")


# What cannot be used


def refused(path, message, centre=HERE, parameter="map_source", **options):
    with pytest.raises(ParameterError, match=message) as error:
        from_file(path, *centre, **options)
    text = str(error.value)
    assert text.startswith(f"{parameter} = ")
    assert "\n" not in text
    return text


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
    refused(path, "must be a grid with one-dimensional lat and lon")


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
    refused(path, "must be a grid with one-dimensional lat and lon")


def test_netcdf_with_axes_and_nothing_on_them(tmp_path):
    path = write_netcdf(tmp_path / "a.nc", *regional_axes(), {})
    refused(path, "no variable lies on lat and lon$")


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
    refused(path, "must have y and x in degrees$")


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


def test_description_that_is_a_number_comes_before_the_number(tmp_path):
    path = regional_geotiff(
        tmp_path / "a.tif", change=lambda v: np.stack([v, 0 * v]), descriptions=("2", "1")
    )
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
        refused(path, "must cover .* without a gap; it spans ", centre=centre)


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
    refused(regional_geotiff(tmp_path / "a.tif", crs=None), "must have a geographic or projected")
    path = write_geotiff(tmp_path / "b.tif", np.ones((5, 5)), Affine(1, 0.1, 0, 0.1, -1, 0))
    refused(path, "and rows that run along its x axis$")


def test_picture_without_any_georeference(tmp_path):
    with pytest.warns(NotGeoreferencedWarning):
        path = write_geotiff(tmp_path / "a.tif", np.ones((5, 5)), None, crs=None)
    refused(path, "must have a geographic or projected")


def test_geotiff_in_coordinates_of_no_place_on_earth(tmp_path):
    local = 'LOCAL_CS["tank",UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]'
    refused(regional_geotiff(tmp_path / "a.tif", crs=local), "must have a geographic or projected")


def test_place_that_is_none(tmp_path):
    path = regional_netcdf(tmp_path / "a.nc")
    refused(path, "at least -80 and at most 80", (85.0, 0.0), "map_latitude_deg")
    refused(path, "at least -180 and at most 360", (0.0, 400.0), "map_longitude_deg")
