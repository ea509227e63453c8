"""Small grids in files, written for the tests of the reader, and what it must make of them."""

import netCDF4
import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine

from seanav.checks import ParameterError
from seanav.models import gravity
from seanav.models.gravity.files import from_file

HERE = (18.8, 128.0)
UNIT = {"units": "mGal"}
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
            # None takes the unit that every other grid states
            attributes = {k: v for k, v in (UNIT | attributes).items() if v is not None}
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
    units = options.pop("units", "mGal")
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
        if scale:  # of the last band
            ones = [1.0] * (len(bands) - 1)
            dataset.scales, dataset.offsets = [*ones, scale[0]], [*(0 * x for x in ones), scale[1]]
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


def refused(path, message, centre=HERE, parameter="map_source", **options):
    with pytest.raises(ParameterError, match=message) as error:
        from_file(path, *centre, **options)
    text = str(error.value)
    assert text.startswith(f"{parameter} = ")
    assert "\n" not in text
    return text
