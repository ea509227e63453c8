"""Where a grid of a user lies: coordinates by CF before names, one reading or a refusal."""

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
from rasterio.transform import Affine
from rasterio.warp import transform

from seanav.models.gravity import grids
from seanav.models.gravity.files import centre, from_file

LATITUDE, LONGITUDE = regional_axes()
VALUES = field_at(LATITUDE[:, None], LONGITUDE[None, :], HERE)
ROWS, COLUMNS = np.arange(len(LATITUDE)), np.arange(len(LONGITUDE))


def write(path, *variables, values=VALUES, dimensions=("y", "x"), **attributes):
    """Write variables (name, dimensions, values, attributes), then the grid "z" in mGal."""
    with netCDF4.Dataset(path, "w") as dataset:
        for name, size in zip(dimensions, values.shape, strict=True):
            dataset.createDimension(name, size)
        grid = ("z", dimensions, values, {"units": "mGal"} | attributes)
        for name, own, what, said in (*variables, grid):
            variable = dataset.createVariable(name, np.asarray(what).dtype, own)
            variable.setncatts(said)
            variable[...] = what
    return path


def lines(y, x, y_says=None, x_says=None):
    return [(y, ("y",), LATITUDE, y_says or {}), (x, ("x",), LONGITUDE, x_says or {})]


# Coordinates by CF


@pytest.mark.parametrize(
    ("y", "x"),
    [
        ({"standard_name": "latitude"}, {"standard_name": "longitude"}),
        ({"standard_name": " Latitude "}, {"standard_name": "longitude", "units": "degrees"}),
        ({"units": "degrees_north"}, {"units": "degrees_east"}),
        ({"units": "degN"}, {"units": "degE"}),
        ({"units": " degree_N "}, {"units": "Degrees_E"}),
        ({"units": "degreesN"}, {"units": "degrees east"}),
        ({"units": "°N"}, {"units": "° E"}),
        ({"axis": "Y", "units": "degrees"}, {"axis": "X", "units": "degree"}),
        ({"axis": "y"}, {"axis": "x"}),
    ],
)
@pytest.mark.parametrize("names", [("nav_lat", "nav_lon"), ("yc", "xc"), ("b", "a")])
def test_coordinates_by_what_cf_says(tmp_path, y, x, names):
    check(from_file(write(tmp_path / "a.nc", *lines(*names, y, x)), *HERE))


@pytest.mark.parametrize("units", [("degN", "degE"), (" Degrees_North\0", "degrees"), ("deg", "")])
def test_spelling_of_degrees(tmp_path, units):
    path = write(tmp_path / "a.nc", *lines("lat", "lon", {"units": units[0]}, {"units": units[1]}))
    check(from_file(path, *HERE))


def test_cf_comes_before_names(tmp_path):
    # The names are exchanged, and further variables have the names alone.
    path = write(
        tmp_path / "a.nc",
        *lines("x", "y", {"standard_name": "latitude"}, {"units": "degrees_east"}),
        ("lat", ("y",), LATITUDE + 1, {}),
        ("longitude", ("x",), LONGITUDE - 1, {}),
    )
    check(from_file(path, *HERE))


@pytest.mark.parametrize("first", [0, 1, 0.5])
@pytest.mark.parametrize("counted_first", [True, False])
@pytest.mark.parametrize("sheets", [False, True])
@pytest.mark.parametrize("says", [{}, {"axis": True}, {"units": "1"}])
def test_axes_that_count_nodes_beside_latitude_and_longitude(
    tmp_path, first, counted_first, sheets, says
):
    y, x = (says | ({"axis": a} if "axis" in says else {}) for a in "YX")
    counts = [("y", ("y",), ROWS + first, y), ("x", ("x",), COLUMNS[::-1] + first, x)]
    places = lines("lat", "lon")
    if sheets:
        both = np.meshgrid(LATITUDE, LONGITUDE, indexing="ij")
        places = [(n, ("y", "x"), v, {}) for n, v in zip(("lat", "lon"), both, strict=True)]
    order = counts + places if counted_first else places + counts
    check(from_file(write(tmp_path / "a.nc", *order), *HERE))


def test_counts_by_the_names_of_degrees_beside_degrees(tmp_path):
    path = write(
        tmp_path / "a.nc",
        ("lat", ("y",), ROWS, {}),
        ("lon", ("x",), COLUMNS, {}),
        *lines("latitude", "longitude"),
    )
    check(from_file(path, *HERE))


@pytest.mark.parametrize("names", [("y", "x"), ("lat", "lon")])
def test_axes_that_only_count_nodes_are_no_degrees(tmp_path, names):
    values = field_at(1.0 * ROWS[:60, None], 1.0 * COLUMNS[None, :], HERE)
    path = write_netcdf(
        tmp_path / "a.nc", ROWS[:60], COLUMNS, {"z": (values, "f8", {})}, names=names
    )
    refused(path, f"must have {names[0]} and {names[1]} in degrees, .* they only count the nodes$")


@pytest.mark.parametrize(
    "says", [({}, {}), ({"standard_name": "latitude"}, {"units": "degrees_north"})]
)
def test_two_latitudes_that_differ_are_refused(tmp_path, says):
    other = ("latitude", ("y",), LATITUDE + 0.2, says[1])
    path = write(tmp_path / "a.nc", *lines("lat", "lon", says[0]), other)
    refused(path, "must have one latitude; lat and latitude both are it, and differ$")
    other = ("latitude", ("y",), LATITUDE, says[1])
    check(from_file(write(tmp_path / "b.nc", *lines("lat", "lon", says[0]), other), *HERE))


def test_latitude_in_degrees_east(tmp_path):
    says = {"standard_name": "latitude", "units": "degrees_east"}
    path = write(tmp_path / "a.nc", *lines("lat", "lon", says))
    refused(path, "must have lat and lon in degrees; lat is in 'degrees_east'$")


@pytest.mark.parametrize("units", [7, 1.5, np.array([1, 2])])
def test_units_of_an_axis_that_are_numbers(tmp_path, units):
    path = write(tmp_path / "a.nc", *lines("lat", "lon", {"units": units}))
    refused(path, "must be a grid: no variable lies on ")


def test_bounds_of_cells_are_no_grid(tmp_path):
    # Cell bounds lie on the axes in files whose vertices have a name of their own, or none.
    path = write(
        tmp_path / "a.nc",
        *lines("lat", "lon", {"bounds": "edges"}),
        ("edges", ("y", "x"), 0 * VALUES, {}),
    )
    check(from_file(path, *HERE))


# Two-dimensional coordinates


def sheets(turn=0.0):
    latitude, longitude = np.meshgrid(LATITUDE, LONGITUDE, indexing="ij")
    north, east = latitude - HERE[0], longitude - HERE[1]
    return latitude + turn * east, longitude - turn * north


@pytest.mark.parametrize("kind", ["f8", "f4"])
@pytest.mark.parametrize("transposed", [False, True])
def test_separable_two_dimensional_coordinates(tmp_path, kind, transposed):
    latitude, longitude, values = *sheets(), VALUES
    if transposed:
        latitude, longitude, values = latitude.T, longitude.T, values.T
    path = write(
        tmp_path / "a.nc",
        ("nav_lat", ("y", "x"), latitude.astype(kind), {"units": "degrees_north"}),
        ("nav_lon", ("y", "x"), longitude.astype(kind), {"units": "degrees_east"}),
        values=values,
        coordinates="nav_lon nav_lat",
    )
    check(from_file(path, *HERE), tolerance_mgal=0.01)  # what single precision leaves


def test_bent_two_dimensional_coordinates(tmp_path):
    latitude, longitude = sheets(turn=0.01)
    both = [("lat", ("y", "x"), latitude, {}), ("lon", ("y", "x"), longitude, {})]
    path = write(tmp_path / "a.nc", *both)
    refused(path, "two-dimensional lat and lon are bent against each other$")


# Projected coordinates

UTM = {"crs_wkt": "", "grid_mapping_name": "transverse_mercator"}
UTM_PARAMETERS = {
    "latitude_of_projection_origin": 0.0,
    "longitude_of_central_meridian": 129.0,
    "scale_factor_at_central_meridian": 0.9996,
    "false_easting": 500000.0,
    "false_northing": 0.0,
    "semi_major_axis": 6378137.0,
    "inverse_flattening": 298.257223563,
}


def projected(path, names, y_says, x_says, mapping=None, scale=1.0, also=()):
    # UTM zone 52, whose central meridian is 129° E; HERE is 1° west of it.
    (east,), (north,) = transform("EPSG:4326", "EPSG:32652", [HERE[1]], [HERE[0]])
    y, x = (c + 2000.0 * np.arange(-40, 41) for c in (north, east))
    all_y, all_x = np.meshgrid(y, x, indexing="ij")
    longitude, latitude = transform("EPSG:32652", "EPSG:4326", all_x.ravel(), all_y.ravel())
    values = field_at(*(np.reshape(a, all_y.shape) for a in (latitude, longitude)), HERE)
    axes = [(names[0], ("y",), y / scale, y_says), (names[1], ("x",), x / scale, x_says)]
    if mapping is None:
        return write(path, *axes, *also, values=values)
    system = ("crs", (), np.int32(0), mapping)
    return write(path, system, *axes, *also, values=values, grid_mapping="crs")


@pytest.mark.parametrize("mapping", ["wkt", "code", "cf"])
@pytest.mark.parametrize(("unit", "scale"), [("m", 1.0), ("km", 1e3)])
@pytest.mark.parametrize("names", [("northing", "easting"), ("y", "x"), ("yc", "xc")])
def test_northing_and_easting(tmp_path, mapping, unit, scale, names):
    from rasterio.crs import CRS

    said = {
        "wkt": {"crs_wkt": CRS.from_epsg(32652).to_wkt()},
        "code": {"epsg_code": "EPSG:32652"},
        "cf": {"grid_mapping_name": "transverse_mercator"} | UTM_PARAMETERS,
    }[mapping]
    y = {"units": unit, "standard_name": "projection_y_coordinate"}
    x = {"units": unit, "standard_name": "projection_x_coordinate"}
    check(from_file(projected(tmp_path / "a.nc", names, y, x, said, scale), *HERE))


@pytest.mark.parametrize("mapping", [None, {"grid_mapping_name": "space_oblique"}, {}])
@pytest.mark.parametrize(
    ("names", "says"),
    [
        (("northing", "easting"), {}),
        (("Northing", "Easting"), {"units": "m"}),
        (("y", "x"), {"units": "km"}),
    ],
)
def test_northing_and_easting_of_no_system(tmp_path, mapping, names, says):
    path = projected(tmp_path / "a.nc", names, says, says, mapping)
    message = f"must state the reference system of {names[0]} and {names[1]}, by a grid_mapping"
    refused(path, message)


def test_counts_are_no_metres(tmp_path):
    mapping = {"epsg_code": "32652"}
    counts = [("y", ("y",), ROWS, {}), ("x", ("x",), COLUMNS, {})]
    system = ("crs", (), np.int32(0), mapping)
    path = write(tmp_path / "a.nc", system, *counts, grid_mapping="crs")
    refused(path, "must have y and x in metres; they only count the nodes$")


# Turns of the longitude, and places that occur twice


@pytest.mark.parametrize("turn", [-540.0, -360.0, 0.0, 180.0])
@pytest.mark.parametrize("longitude", [-179.9, 128.0, 359.9])
def test_longitude_of_any_turn(tmp_path, turn, longitude):
    # A third of a globe from -540 … -180, -360 … 0, 0 … 360 or 180 … 540 on.
    place = (18.8, longitude)
    start = turn + (longitude - 1.0 - turn) % 360.0
    axis = start + np.arange(0, 2.0, 1 / 60)
    assert turn <= axis[0] < turn + 360
    latitude, _ = regional_axes(place)
    values = field_at(latitude[:, None], axis[None, :], place)
    path = write_netcdf(tmp_path / "a.nc", latitude, axis, {"z": (values, "f8", {})})
    check(from_file(path, *place))


@pytest.mark.parametrize("longitude", [180.0, -179.9, 179.8])
@pytest.mark.parametrize("first_x", [-20.2e6, 19.9e6, -20037508.342789244])
def test_mercator_across_the_antimeridian(tmp_path, longitude, first_x):
    # From the west of it, from the east, and the whole band from -180° to 180°.
    radius, step, place = 6378137.0, 2000.0, (10.0, longitude)
    columns = 200 if abs(first_x) != 20037508.342789244 else 20037
    if columns == 20037:
        step = 2 * 20037508.342789244 / columns
    y0 = np.log(np.tan(np.pi / 4 + np.radians(place[0]) / 2)) * radius + 110e3
    x = first_x + (np.arange(columns) + 0.5) * step
    y = y0 - (np.arange(111) + 0.5) * step
    latitude = np.degrees(2 * np.arctan(np.exp(y / radius)) - np.pi / 2)
    values = field_at(latitude[:, None], np.degrees(x / radius)[None, :], place)
    matrix = Affine(step, 0, first_x, 0, -step, y0)
    check(from_file(write_geotiff(tmp_path / "a.tif", values, matrix, crs="EPSG:3857"), *place))


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("apart", [False, True])
def test_place_that_occurs_twice(tmp_path, axis, apart):
    # Once more with other values, beside the first or at the end; with the same it does no harm.
    lines = [LATITUDE, LONGITUDE]
    k = 45
    index = np.insert(np.arange(len(lines[axis])), len(lines[axis]) if apart else k, k)
    lines[axis] = lines[axis][index]
    values = np.take(VALUES, index, axis)
    path = write_netcdf(tmp_path / "a.nc", *lines, {"z": (values, "f8", {})})
    check(from_file(path, *HERE))
    other = np.moveaxis(values.copy(), axis, 0)
    other[-1 if apart else k] += 3.0
    values = np.moveaxis(other, 0, axis)
    path = write_netcdf(tmp_path / "b.nc", *lines, {"z": (values, "f8", {})})
    name = ("latitude", "longitude")[axis]
    refused(path, rf"must have each {name} once; {lines[axis][k]:g} occurs twice, with different")


def test_every_latitude_twice_with_different_values(tmp_path):
    values = np.concatenate([VALUES, VALUES + 5])
    latitude = np.concatenate([LATITUDE, LATITUDE])
    path = write_netcdf(tmp_path / "a.nc", latitude, LONGITUDE, {"z": (values, "f8", {})})
    refused(path, "must have each latitude once; ")


# What is covered, and the middle


@pytest.mark.parametrize("form", ["netcdf", "geotiff", "metres"])
def test_coverage_is_told_in_degrees_with_the_middle(tmp_path, form):
    path = {
        "netcdf": lambda: regional_netcdf(tmp_path / "a"),
        "geotiff": lambda: regional_geotiff(tmp_path / "a", turn=360.0),
        "metres": lambda: projected(
            tmp_path / "a", ("y", "x"), {"units": "m"}, {"units": "m"}, {"epsg_code": "32652"}
        ),
    }[form]()
    message = "must cover 29.55…30.45° N, 139.48…140.52° E without a gap; it spans "
    text = refused(path, message, centre=(30.0, 140.0))
    south, north, west, east = (
        float(a)
        for part in text.split("it spans ")[1].split("° ")[:2]
        for a in part.removeprefix("N, ").split("…")
    )
    assert south < 18.4 < 19.2 < north < 20
    assert 126 < west < 127.5 < 128.5 < east < 130
    words = text.split("its middle is ")[1].replace("map_latitude_deg = ", "").split(", ")
    middle = float(words[0]), float(words[1].removeprefix("map_longitude_deg = "))
    assert middle == pytest.approx(HERE, abs=0.05)
    assert centre(path, 30.0, 140.0) == pytest.approx(middle, abs=1e-3)
    assert centre(path, *HERE) == HERE
    from_file(path, *middle)


def test_middle_of_a_grid_across_the_date_line(tmp_path):
    place = (10.0, 179.9)
    latitude, longitude = regional_axes(place)
    turned = (longitude + 180) % 360 - 180
    values = field_at(latitude[:, None], turned[None, :], place)
    path = write_netcdf(tmp_path / "a.nc", latitude, turned, {"z": (values, "f8", {})})
    text = refused(path, r"it spans 9.21…10.81° N, 178.9\d…180.8\d° E; its middle is ")
    assert centre(path, *HERE) == pytest.approx((10.0, 179.9), abs=0.02)
    assert text.endswith("map_latitude_deg = 10.0056, map_longitude_deg = 179.907")


def test_grid_that_is_too_small_has_no_middle_to_offer(tmp_path):
    values = {"z": (VALUES[:9, :9], "f8", {})}
    path = write_netcdf(tmp_path / "a.nc", LATITUDE[:9], LONGITUDE[:9], values)
    refused(path, "it is too small for the map$")
    assert centre(path, *HERE) == HERE


@pytest.mark.parametrize(
    ("axis", "ends"),
    [
        (np.arange(170.0, 191.0), (170.0, 190.0)),
        (np.r_[170.0:180.0, -180.0:-169.0], (170.0, 190.0)),
        (np.arange(-20.0, 21.0), (340.0, 380.0)),
        (np.arange(30.0, 10.0, -1.0), (11.0, 30.0)),
        (np.array([359.0, 0.0, 1.0, 2.0]), (359.0, 362.0)),
        (np.arange(0.0, 360.0, 2.0), (0.0, 358.0)),  # all the way round
    ],
)
def test_an_axis_around_the_earth_begins_after_its_widest_gap(axis, ends):
    assert grids._ends(axis, 360.0) == pytest.approx(ends)
    assert grids._ends(axis, np.inf) == (axis.min(), axis.max())


def test_near_counts_by_the_nearest_turn():
    x = np.array([-190.0, -10.0, 0.0, 170.0, 349.0, 351.0, 725.0])
    found = grids.near(x, 350.0, 360.0)
    assert np.all(np.abs(found) <= 180.0)
    assert np.allclose((x - 350.0 - found) % 360.0 % 360.0, 0.0)
    assert found.tolist() == [180.0 - 360.0, 0.0, 10.0, -180.0, -1.0, 1.0, 15.0]
    assert grids.near(x, 350.0, np.inf).tolist() == (x - 350.0).tolist()


@pytest.mark.parametrize("margin", [0, 1, 2, 50])
@pytest.mark.parametrize(
    ("low", "high"), [(0.0, 9.0), (2.5, 5.5), (3.0, 5.0), (0.2, 0.4), (8.0, 9.0)]
)
def test_what_covers_an_interval_is_the_least_that_does_and_its_margin(low, high, margin):
    axis = np.arange(10.0)[::-1]  # it may fall
    indices, starts = grids.covering(axis, low, high, margin)
    first, last = max(int(np.floor(low)) - margin, 0), min(int(np.ceil(high)) + margin, 9)
    assert axis[indices].tolist() == list(map(float, range(first, last + 1)))
    assert starts.tolist() == list(range(last - first + 1))


@pytest.mark.parametrize("gap", range(3, 7))
def test_a_gap_anywhere_inside_an_interval_is_none(gap):
    axis = np.delete(np.arange(10.0), gap)
    assert grids.covering(axis, 2.0, 7.0, 0) is None
    assert grids.covering(axis, gap + 1.0, 9.0, 0) is not None
    assert grids.covering(axis, -0.5, 2.0, 0) is None
