"""Whether the values of a user's grid are what they are taken for: unit, packing, fill values."""

import subprocess
import sys

import netCDF4
import numpy as np
import pytest
from gravity_grids import HERE, check, refused, regional_axes, regional_geotiff, regional_netcdf
from scipy.io import netcdf_file

from seanav.models.gravity import quality
from seanav.models.gravity.files import from_file
from seanav.models.gravity.geoid import from_geoid
from seanav.models.gravity.sources import synthetic

# Units


@pytest.mark.parametrize(
    ("unit", "per_mgal"),
    [
        ("[mGal]", 1),
        (" mGal ", 1),
        ("(mgal)", 1),
        ("MILLIGAL", 1),
        ("mGal\0", 1),
        ("m s^{-2}", 1e-5),
        ("m s-2", 1e-5),
        ("m s −2", 1e-5),
        ("m/s2", 1e-5),
        (" M/S2", 1e-5),
        ("m/sec^2", 1e-5),
        ("meter second-2", 1e-5),
        ("[um/s^2]", 10),
        ("μm·s⁻²", 10),
    ],
)
def test_spelling_of_a_unit(tmp_path, unit, per_mgal):
    path = regional_netcdf(tmp_path / "a.nc", scale=per_mgal, attributes={"units": unit})
    check(from_file(path, *HERE))
    path = regional_geotiff(
        tmp_path / "a.tif", change=lambda v: v * per_mgal, units=unit.strip("\0") or None
    )
    check(from_file(path, *HERE))


@pytest.mark.parametrize("stated", [None, "", "  "])
@pytest.mark.parametrize("scale", [1.0, 10.0, 1e-5])
def test_unit_that_nobody_states(tmp_path, stated, scale):
    # mGal, µm/s² or m/s²; a geoid in metres looks like the first.
    message = "must name the unit of z, one of 'mGal', 'm/s2', 'µGal', 'uGal': .* states none$"
    path = regional_netcdf(tmp_path / "a.nc", scale=scale, attributes={"units": stated})
    refused(path, message, parameter="map_unit")
    path = regional_geotiff(tmp_path / "a.tif", change=lambda v: v * scale, units=None)
    refused(path, "must name the unit of 1, one of ", parameter="map_unit")


def test_unit_is_said_before_values_are_read(tmp_path):
    path = regional_netcdf(tmp_path / "a.nc", attributes={"units": None})
    refused(path, "must name the unit of z", centre=(60.0, 10.0), parameter="map_unit")


@pytest.mark.parametrize("units", [7, 0.5, np.array([1, 2]), np.array([1e-5, 1.0])])
def test_unit_that_is_a_number_or_an_array(tmp_path, units):
    path = regional_netcdf(tmp_path / "a.nc", attributes={"units": units})
    refused(path, "must be in mGal or m/s² .* or map_unit must name its unit; z has the unit '")
    check(from_file(path, *HERE, unit="mGal"))


# Packing


def rewrite(path, **attributes):
    """Write the regional grid by another library, which takes any attribute, in int16 of 0.01."""
    latitude, longitude = regional_axes()
    with netCDF4.Dataset(regional_netcdf(path)) as dataset:
        values = dataset["z"][:]
    with netcdf_file(path, "w") as file:
        for name, axis in (("lat", latitude), ("lon", longitude)):
            file.createDimension(name, len(axis))
            file.createVariable(name, "f8", (name,))[:] = axis
        grid = file.createVariable("z", "i2", ("lat", "lon"))
        grid[:] = np.round(values / 0.01).astype("i2")
        for name, value in ({"units": "mGal", "scale_factor": 0.01} | attributes).items():
            setattr(grid, name.replace("_FillValue", "_FillValuX"), value)
    # The library would fail at this name.
    path.write_bytes(path.read_bytes().replace(b"_FillValuX", b"_FillValue"))
    return path


@pytest.mark.parametrize("name", ["scale_factor", "add_offset", "_FillValue", "valid_min"])
def test_attribute_that_is_text(tmp_path, name):
    path = rewrite(tmp_path / "a.nc", **{name: "much"})
    refused(path, f"must have numbers as {name}; that of z is 'much'$")
    number = {"scale_factor": "0.01", "add_offset": " 0 ", "_FillValue": "-32768"}
    path = rewrite(tmp_path / "b.nc", **{name: number.get(name, "-32000")})
    check(from_file(path, *HERE), tolerance_mgal=0.02)


@pytest.mark.parametrize("name", ["scale_factor", "add_offset"])
@pytest.mark.parametrize("value", [[0.01, 0.02], np.nan, np.inf])
def test_packing_that_is_not_one_number(tmp_path, name, value):
    path = rewrite(tmp_path / "a.nc", **{name: value})
    refused(path, f"must have one number as {name}; that of z is ")


@pytest.mark.parametrize("value", [1e20, -99999, "none", "", np.nan, [1e20, -999999.0]])
def test_missing_value_that_no_value_can_have(tmp_path, value, recwarn):
    check(from_file(rewrite(tmp_path / "a.nc", missing_value=value), *HERE), tolerance_mgal=0.02)
    assert not recwarn.list


@pytest.mark.parametrize("fills", [{"missing_value": -32000}, {"missing_value": [7777, -32000]}])
@pytest.mark.parametrize("kind", ["f4", "i2"])
def test_missing_values_beside_the_window(tmp_path, fills, kind):
    def punch(values):
        values = np.round(values)
        values[0] = -32000
        return values

    path = regional_netcdf(tmp_path / "a.nc", change=punch)
    with netCDF4.Dataset(path, "a") as dataset:
        dataset.renameVariable("z", "old")
        grid = dataset.createVariable("z", kind, ("lat", "lon"))
        grid.setncatts({"units": "mGal"} | fills)
        grid[:] = dataset["old"][:]
    check(from_file(path, *HERE, variable="z"), tolerance_mgal=0.7)


def test_what_was_never_written_is_absent_though_no_attribute_says_so(tmp_path):
    # NetCDF's own fill value of the type, which a file need not state.
    def punch(values):
        values = values.copy()
        values[48, 56] = netCDF4.default_fillvals["f8"]
        return values

    path = regional_netcdf(tmp_path / "a.nc", change=punch)
    refused(path, "must have a value at every node of the window; z lacks 1$")


def test_fill_value_in_single_precision(tmp_path):
    # -999.9 is another number there, and stays undeclared if it is compared in double.
    def punch(values):
        values[40, 40] = -999.9
        return values

    path = regional_netcdf(tmp_path / "a.nc", change=punch)
    with netCDF4.Dataset(path, "a") as dataset:
        dataset.renameVariable("z", "old")
        grid = dataset.createVariable("z", "f4", ("lat", "lon"))
        grid.setncatts({"units": "mGal", "missing_value": -999.9})
        grid[:] = dataset["old"][:]
    refused(path, "must have a value at every node of the window; z lacks 1$", variable="z")


@pytest.mark.parametrize(
    "bounds", [{"valid_min": -99.0, "valid_max": 99.0}, {"valid_range": [-99.0, 99.0]}]
)
def test_valid_range_in_physical_units_of_packed_data(tmp_path, bounds):
    check(from_file(rewrite(tmp_path / "a.nc", **bounds), *HERE), tolerance_mgal=0.02)
    narrow = {name: np.asarray(value) / 9 for name, value in bounds.items()}
    path = rewrite(tmp_path / "b.nc", **narrow)
    refused(path, r"z lacks \d+; its range of valid values is understood in the unpacked unit$")


def test_valid_range_of_the_stored_numbers(tmp_path):
    low, high = np.int16(-9900), np.int16(9900)
    path = rewrite(tmp_path / "a.nc", valid_min=low, valid_max=high)
    check(from_file(path, *HERE), tolerance_mgal=0.02)
    path = rewrite(tmp_path / "b.nc", valid_min=np.int16(-99), valid_max=np.int16(99))
    refused(path, r"z lacks \d+; its range .* is understood in the unit of the stored numbers$")


def test_unsigned_bytes_in_a_signed_type(tmp_path):
    path = rewrite(tmp_path / "a.nc", _Unsigned="true", scale_factor=1.0)
    with netcdf_file(path, "r", mmap=False) as file:
        stored = file.variables["z"][:].copy()
    with netcdf_file(path, "a", mmap=False) as file:
        file.variables["z"][:] = (stored.astype(int) + 40000).astype("u2").view("i2")
        file.variables["z"].scale_factor = 0.01
        file.variables["z"].add_offset = -400.0
    check(from_file(path, *HERE), tolerance_mgal=0.02)


# Nothing on stderr


def test_tags_that_nobody_knows_are_no_warning(tmp_path):
    # One entry of the file's directory gets a number that no library knows.
    path = regional_geotiff(tmp_path / "a.tif")
    content = bytearray(path.read_bytes())
    start = int.from_bytes(content[4:8], "little")
    count = int.from_bytes(content[start : start + 2], "little")
    at = [start + 2 + 12 * k for k in range(count)]
    (last,) = (p for p in at if int.from_bytes(content[p : p + 2], "little") == 339)
    content[last : last + 2] = (341).to_bytes(2, "little")  # SampleFormat to SMinSampleValue
    known = bytes(content)
    content[last : last + 2] = (65000).to_bytes(2, "little")
    (tmp_path / "b.tif").write_bytes(content)
    (tmp_path / "c.tif").write_bytes(known)
    code = f"""
import sys
from seanav.checks import ParameterError
from seanav.models.gravity.files import from_file
for path in sys.argv[1:]:
    try:
        from_file(path, *{HERE})
    except ParameterError as error:
        print(error)
"""
    files = [path, tmp_path / "b.tif", tmp_path / "c.tif"]
    done = subprocess.run(
        [sys.executable, "-c", code, *files], capture_output=True, encoding="utf-8", check=True
    )
    assert done.stderr == ""


# Fill values that are not declared


def punched(*places, fill):
    def change(values):
        for row, column in places:
            values[row, column] = fill
        return values

    return change


@pytest.mark.parametrize("fill", [0.0, -999.0, 999.9, 9999.0, -99.0, 1e20, -32768.0])
@pytest.mark.parametrize("place", [(40, 50), (20, 30), (22, 70), (75, 25)])
def test_undeclared_fill_value_is_refused_with_its_place(tmp_path, fill, place):
    latitude, longitude = regional_axes()
    row, column = place
    where = rf"{latitude[row]:.4f}° N, {longitude[column]:.4f}° E"
    change = punched(place, fill=fill)
    clean = regional_netcdf(tmp_path / "clean.nc")
    check(from_file(clean, *HERE))
    with netCDF4.Dataset(clean) as dataset:
        assert abs(dataset["z"][row, column]) > 10  # or 0 would be no fault
    path = regional_netcdf(tmp_path / "a.nc", change=change)
    text = refused(path, "must have no node far outside its neighbours' spread; ")
    assert f"z is {fill:.6g} mGal at {where}" in text


def test_two_undeclared_fill_values_and_a_geotiff(tmp_path):
    change = punched((40, 50), (60, 40), fill=-999.0)
    path = regional_netcdf(tmp_path / "a.nc", change=change)
    refused(path, r"z is -999 mGal at .* \(one of 2 such nodes\)")
    path = regional_geotiff(tmp_path / "a.tif", change=punched((40, 50), fill=-999.0))
    refused(path, r"1 is -999 mGal at ")


def test_area_of_an_undeclared_fill_value(tmp_path):
    def change(values):
        values[30:60, 30:60] = -999.0
        return values

    path = regional_netcdf(tmp_path / "a.nc", change=change)
    refused(path, r"(far outside its neighbours|within ±800).*-999 ")


def test_outlier_in_the_unit_of_the_file(tmp_path):
    path = regional_netcdf(
        tmp_path / "a.nc",
        scale=1e-5,
        attributes={"units": "m/s2"},
        change=punched((40, 50), fill=0.0),
    )
    refused(path, "z is 0 mGal at ")


@pytest.mark.parametrize("place", [(18.8, 128.0), (24.0, 143.0), (30.5, 140.2), (34.5, 136.0)])
def test_real_map_has_no_outlier_until_one_is_put_there(place):
    # A plain, two trenches and a coast, with seamounts.
    values = from_geoid(*place).anomaly_mgal
    assert not quality.outliers(values)[0].any()
    assert not quality.outliers(values[::3, ::3])[0].any()
    row, column = np.unravel_index(np.argmax(np.abs(values)), values.shape)
    values[row, column] = 0.0
    found, _ = quality.outliers(values)
    assert found[row, column]
    assert np.count_nonzero(found) == 1


@pytest.mark.parametrize("length", [1e3, 2e3, 5e3, 14e3])
def test_random_field_has_no_outlier(length):
    assert not quality.outliers(synthetic(2, length).anomaly_mgal)[0].any()


def test_white_noise_has_no_outlier():
    assert not quality.outliers(np.random.default_rng(0).normal(0, 20, (301, 301)))[0].any()


@pytest.mark.parametrize("depth", [1.0, 1.5, 2.0, 4.0])
@pytest.mark.parametrize("shift", [0.0, 0.3, 0.5])
def test_seamount_has_no_outlier(depth, shift):
    # The field of a point mass as deep as one to four steps of the grid, in closed form.
    y, x = np.mgrid[-20:21, -20:21] - shift
    values = 250 * (1 + (x**2 + y**2) / depth**2) ** -1.5
    assert not quality.outliers(values)[0].any()


def test_a_quiet_patch_of_a_rough_map_is_held_against_the_map():
    # Its nodes are still to a hundredth of what is usual: a knoll of 8 mGal there is none here.
    values = np.random.default_rng(2).normal(0, 20, (60, 60))
    values[20:35, 20:35] *= 0.01
    quiet = values[20:35, 20:35].copy()
    quiet[7, 7] = values[27, 27] = 8.0
    assert not quality.outliers(values)[0].any()
    assert np.argwhere(quality.outliers(quiet)[0]).tolist() == [[7, 7]]  # alone, it is one


def test_misfit_is_the_distance_from_the_neighbours_least_squares_surface():
    # Against lstsq, for an inner node and one in a corner.
    values = np.random.default_rng(1).normal(0, 10, (7, 9))
    _, misfit = quality.outliers(values)
    for (row, column), (top, left) in {(3, 4): (1, 2), (0, 8): (0, 4)}.items():
        y, x = (a.ravel() for a in np.mgrid[top : top + 5, left : left + 5])
        others = (y != row) | (x != column)
        terms = np.stack([y**0, y, x, y * x, y * y, x * x], axis=1)
        fit = np.linalg.lstsq(terms[others], values[y, x][others])[0]
        expected = values[row, column] - terms[~others][0] @ fit
        assert misfit[row, column] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("sides", "place"), [((5, 5), 12), ((5, 5), 0), ((5, 4), 7), ((2, 5), 4)])
def test_a_surface_through_the_neighbours_has_the_variance_of_its_prediction(sides, place):
    residuals, weights, variance, free = quality._fit(sides, place)
    rng = np.random.default_rng(1)
    noise = rng.standard_normal((20_000, sides[0] * sides[1]))
    others = np.delete(noise, place, axis=1)
    missed = noise[:, place] - others @ weights
    assert missed.var() == pytest.approx(variance, rel=0.05)
    assert (((others @ residuals) ** 2).sum(axis=1) / free).mean() == pytest.approx(1.0, rel=0.05)
    y, x = np.mgrid[: sides[0], : sides[1]]
    plane = (2.0 + 0.3 * y - 0.7 * x).ravel()
    assert np.delete(plane, place) @ weights == pytest.approx(plane[place])
