"""Gravity grids in NetCDF files."""

import contextlib
from collections.abc import Iterator

import netCDF4

from seanav.checks import ParameterError
from seanav.models.gravity import coordinates
from seanav.models.gravity.grids import Grid, select
from seanav.models.gravity.packing import text, unpacking


@contextlib.contextmanager
def open_netcdf(source: str, variable: str | None) -> Iterator[Grid]:
    """Open a variable of a NetCDF file, version 3 or 4, as a `Grid`.

    Parameters
    ----------
    source : str
        Path of the file.
    variable : str or None
        Name of the variable; None or "": the only one that is a grid.

    Raises
    ------
    ParameterError
        If it holds no such grid, or its axes or attributes cannot be understood.
    """
    with netCDF4.Dataset(source) as dataset:
        names = coordinates.candidates(dataset)
        if not names:
            allowed = (
                "must be a grid: no variable lies on a latitude and a longitude, by their "
                "standard_name, units, axis or names (lat and lon, y and x)"
            )
            raise ParameterError("map_source", source, allowed)
        values = dataset[select(source, variable, names)]
        (y, x), (rows, columns), crs = coordinates.axes(source, dataset, values)
        unpack, note = unpacking(source, values)
        order = values.dimensions

        def read(part_of_rows, part_of_columns):
            parts = {rows: part_of_rows, columns: part_of_columns}
            block = unpack(values[tuple(parts.get(d, 0) for d in order)])
            return block.T if order.index(rows) > order.index(columns) else block

        yield Grid(source, values.name, text(values, "units"), y, x, read, crs, note)
