"""What the attributes of a NetCDF variable say of its values: packing, fill values, bounds."""

from collections.abc import Callable
from typing import Any

import netCDF4
import numpy as np

from seanav.checks import ParameterError


def text(variable: Any, name: str) -> str:
    """Return an attribute as text of one line, "" if there is none; it may be of any type."""
    value = variable.getncattr(name) if name in variable.ncattrs() else ""
    if isinstance(value, bytes):  # as netCDF4 hands over a fill value that is text
        value = value.decode("utf-8", "replace")
    parts = value.split("\0") if isinstance(value, str) else map(str, np.ravel(value)[:9])
    return " ".join(" ".join(parts).split())


def _numbers(source, variable, name):
    # Text that is a number is taken for it.
    if name not in variable.ncattrs():
        return np.empty(0)
    try:
        return np.ravel(np.asarray(variable.getncattr(name))).astype(float)
    except (TypeError, ValueError):
        if name == "missing_value":  # no value of the grid can be equal to it
            return np.empty(0)
        said = text(variable, name)
        allowed = f"must have numbers as {name}; that of {variable.name} is {said!r}"
        raise ParameterError("map_source", source, allowed) from None


def _one(source, variable, name, default):
    found = _numbers(source, variable, name)
    if name not in variable.ncattrs():
        return default
    if found.size != 1 or not np.isfinite(found[0]) or (name == "scale_factor" and not found[0]):
        allowed = f"must have one number as {name}; that of {variable.name} is "
        raise ParameterError("map_source", source, allowed + repr(text(variable, name)))
    return float(found[0])


def _bounds(source, variable):
    # Lowest and highest valid value, and whether they are in physical units: by the NetCDF
    # User Guide (appendix A, valid_range) they are if they are of a wider type than packed
    # data, the type of scale_factor; otherwise they are packed as the data.
    both = _numbers(source, variable, "valid_range")
    if both.size:
        names = ("valid_range",)
        bounds = [both[0], both[-1]] if both.size == 2 else [-np.inf, np.inf]
    else:
        names = ("valid_min", "valid_max")
        found = [_numbers(source, variable, name) for name in names]
        bounds = [b[0] if b.size == 1 else e for b, e in zip(found, (-np.inf, np.inf), strict=True)]
    types = [np.asarray(variable.getncattr(n)).dtype.kind for n in names if n in variable.ncattrs()]
    packed = np.dtype(variable.dtype).kind in "iu" and "scale_factor" in variable.ncattrs()
    return *bounds, packed and "f" in types, bool(types)


def unpacking(source: str, variable: Any) -> tuple[Callable, str]:
    """Read how a variable is packed, before any of it is read.

    Parameters
    ----------
    source : str
        Path of the file, for errors.
    variable : netCDF4.Variable
        Numeric; its own masking and scaling is switched off here, because that warns of, or
        fails at, attributes that are treated here.

    Returns
    -------
    unpack : function
        Of an array as stored: float64, NaN where there is no value.
    note : str
        How bounds of valid values are understood, "" if there are none.

    Raises
    ------
    ParameterError
        If an attribute that must be a number is none.
    """
    variable.set_auto_maskandscale(False)
    scale = _one(source, variable, "scale_factor", 1.0)
    offset = _one(source, variable, "add_offset", 0.0)
    fills = [_numbers(source, variable, name) for name in ("_FillValue", "missing_value")]
    kind = np.dtype(variable.dtype)
    if "_FillValue" not in variable.ncattrs() and kind.itemsize > 1:
        fills.append(np.array([netCDF4.default_fillvals[kind.str[1:]]], dtype=float))
    low, high, physical, bounded = _bounds(source, variable)
    unsigned = text(variable, "_Unsigned").lower() == "true" and kind.kind == "i"

    def unpack(stored):
        if unsigned:
            stored = np.asarray(stored).view(stored.dtype.str.replace("i", "u"))
        packed = stored.astype(float)
        # A fill value is rounded as the data were: -999.9 is another number in single precision.
        absent = np.isin(packed, _as_stored(np.concatenate(fills), stored.dtype))
        values = packed * scale + offset
        judged = values if physical else packed
        return np.where(absent | (judged < low) | (judged > high), np.nan, values)

    units = "the unpacked unit" if physical else "the unit of the stored numbers"
    return unpack, f"its range of valid values is understood in {units}" if bounded else ""


def _as_stored(fills, kind):
    if kind.kind == "f":
        with np.errstate(over="ignore"):
            return fills.astype(kind).astype(float)
    if kind.kind == "u":  # a signed attribute of unsigned data counts on from below
        return np.concatenate([fills, fills + 2.0 ** (8 * kind.itemsize)])
    return fills
