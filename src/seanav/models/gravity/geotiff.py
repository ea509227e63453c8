"""Gravity grids in GeoTIFF files."""

import contextlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import rasterio
from rasterio.transform import Affine

from seanav.checks import ParameterError
from seanav.models.gravity.grids import Grid, select


def _band(source, variable, dataset):
    # Number and name of a band: its description if it is the only one of that text, else its
    # number. A number always serves, unless it is also the description of another band.
    texts = [(text or "").strip() for text in dataset.descriptions]
    numbers = [str(band) for band in range(1, dataset.count + 1)]
    names = [
        text if text and texts.count(text) == 1 and text not in numbers else number
        for text, number in zip(texts, numbers, strict=True)
    ]
    wanted = str(variable).strip() if isinstance(variable, str) else str(variable)
    if wanted in numbers:
        index = numbers.index(wanted)
        others = [n for n, t in zip(numbers, texts, strict=True) if t == wanted and n != wanted]
        if others:
            allowed = (
                f"must be unambiguous: band {others[0]} of {source} is described as {wanted!r}"
            )
            raise ParameterError("map_variable", variable, allowed)
        return index + 1, names[index]
    label = select(source, wanted if isinstance(variable, str) else variable, names)
    return names.index(label) + 1, label


def _check_place(source, dataset):
    if not dataset.crs or dataset.transform == Affine.identity():
        lacks = "reference system" if not dataset.crs else "place: its pixels are only counted"
        raise ParameterError("map_source", source, f"must be georeferenced; it states no {lacks}")
    if not (dataset.crs.is_geographic or dataset.crs.is_projected):
        needs = "a geographic or projected reference system"
        raise ParameterError("map_source", source, f"must have {needs}; it has a local one")
    if dataset.transform.b != 0 or dataset.transform.d != 0:
        needs = "rows that run along the x axis of its reference system"
        raise ParameterError("map_source", source, f"must have {needs}")
    if min(dataset.shape) < 2:
        raise ParameterError("map_source", source, "must have two rows and columns or more")


@contextlib.contextmanager
def open_geotiff(source: str, variable: Any) -> Iterator[Grid]:
    """Open a GeoTIFF as a `Grid`.

    Parameters
    ----------
    source : str
        Path of the file.
    variable : str, int or None
        Number of the band, from 1, or its description; None or "": the only one.

    Raises
    ------
    ParameterError
        If it lies nowhere, is turned against its axes, or the band is not one of its bands.
    """
    with rasterio.open(source) as dataset:
        _check_place(source, dataset)
        band, label = _band(source, variable, dataset)
        scale, offset = dataset.scales[band - 1], dataset.offsets[band - 1]
        matrix = dataset.transform

        def read(rows, columns):
            part = ((rows.start, rows.stop), (columns.start, columns.stop))
            block = dataset.read(band, window=part, masked=True).astype(float)
            return np.ma.filled(block * scale + offset, np.nan)

        yield Grid(
            source,
            label,
            (dataset.units[band - 1] or "").strip(),
            matrix.f + matrix.e * (np.arange(dataset.height) + 0.5),
            matrix.c + matrix.a * (np.arange(dataset.width) + 0.5),
            read,
            dataset.crs,
        )
