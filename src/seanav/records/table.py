"""A table of numbers with a time for each row, from a file of comma-separated values."""

import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from seanav.checks import ParameterError, read_only

MOST_BYTES = 200 * 2**20
MOST_ROWS = 5_000_000
LONGEST = 1e10  # s: seconds since 1970 fit, their milliseconds and 20170406121000 do not
SHOWN = 60  # characters of a cell in an error

# Words at the end of a column's name, and what turns its numbers into the unit in brackets.
_UNITS = {
    "kn": ("m_s", "multiply by 0.514444"),
    "kt": ("m_s", "multiply by 0.514444"),
    "kts": ("m_s", "multiply by 0.514444"),
    "knots": ("m_s", "multiply by 0.514444"),
    "cm_s": ("m_s", "divide by 100"),
    "km_h": ("m_s", "divide by 3.6"),
    "rad": ("deg", "multiply by 57.29578"),
    "rad_s": ("deg_s", "multiply by 57.29578"),
}


@dataclass(frozen=True, eq=False)
class Record:
    """Columns of a user's file, sample by sample, and where in the file each sample stands.

    Attributes
    ----------
    name : str
        The parameter that named the file.
    source : str
        The file's name without its folders: results hold no place of a machine.
    time : ndarray (samples,)
        Seconds from the first sample, strictly increasing; numbers 0, 1, … without times.
    columns : dict of str to ndarray (samples,)
    rows : ndarray (samples,)
        Lines of the file, counted from one.
    start : str
        Time of the first sample, ISO 8601 in UTC; empty if the file holds seconds or no time.
    """

    name: str
    source: str
    time: np.ndarray
    columns: Mapping[str, np.ndarray]
    rows: np.ndarray
    start: str = field(default="", kw_only=True)

    def __post_init__(self):
        read_only(self.time, self.rows, *self.columns.values())

    def __getitem__(self, column: str) -> np.ndarray:
        """Return one column."""
        return self.columns[column]

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.time)

    @property
    def span(self) -> float:
        """Seconds from the first sample to the last."""
        return float(self.time[-1])

    def refuse(self, sample: int, allowed: str) -> ParameterError:
        """Return the error that names the row of a sample, to be raised."""
        return _refused(self.name, self.source, int(self.rows[sample]), allowed)

    def check_gaps(self, limit: float) -> None:
        """Refuse the first gap of more than `limit` seconds.

        Raises
        ------
        ParameterError
            One line with the row after the gap and the gap's length.
        """
        gaps = np.diff(self.time)
        late = np.flatnonzero(gaps > limit * (1 + 1e-9))
        if late.size:
            k = int(late[0])
            gap = f"{gaps[k]:g} s after row {self.rows[k]}; gaps may be {limit:g} s long"
            raise self.refuse(k + 1, gap)


def opened(name: str, path: str, most_bytes: int = MOST_BYTES) -> str:
    """Return the text of a user's file, UTF-8 with or without byte order mark.

    Raises
    ------
    ParameterError
        If there is no such file, or it is too large, empty, unreadable or no text.
    """
    place = Path(path)
    try:
        if not place.is_file():
            found = "is a folder" if place.is_dir() else "there is none"
            raise ParameterError(name, path, f"must be the path of an existing file; {found}")
        if place.stat().st_size > most_bytes:
            raise ParameterError(name, path, f"must be a file of at most {most_bytes >> 20} MB")
        text = place.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise ParameterError(name, path, f"must be readable: {error.strerror}") from error
    except UnicodeDecodeError as error:
        allowed = f"must be text in UTF-8; byte {error.start} of it is not"
        raise ParameterError(name, path, allowed) from None
    if "\0" in text:
        raise ParameterError(name, path, "must be text; it holds zero bytes")
    if not text.strip():
        raise ParameterError(name, path, "must not be empty")
    return text


def read_csv(
    name: str,
    path: str,
    layouts: Sequence[Sequence[str]],
    *,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    time: bool = True,
    least: int = 2,
) -> Record:
    """Read a table of numbers from a user's file.

    Parameters
    ----------
    name, path : str
        Parameter and value, for the errors.
    layouts : sequence of sequences of str
        Sets of columns with their units in the name; the first one that the header has all
        of is read. Other columns are left alone.
    bounds : mapping of column to (least, largest), optional
        A number beyond them is most likely in another unit.
    time : bool
        Whether there must be a column ``time``: ISO 8601, with a time zone or in UTC, or
        seconds. Its values must increase from row to row.
    least : int
        Fewest rows.

    Raises
    ------
    ParameterError
        One line: what the file must hold and, for a value, its row.
    """
    text = opened(name, path)
    source = Path(path).name
    header, body = _cells(name, source, text)
    columns = _layout(name, source, header, layouts, ["time"] if time else [])
    if len(body) < least:
        allowed = f"must have at least {least} rows below its header, has {len(body)}"
        raise ParameterError(name, source, allowed)
    rows = np.arange(len(body)) + 2  # the header is line 1
    numbers = {c: _numbers(name, source, rows, c, body[c], (bounds or {}).get(c)) for c in columns}
    seconds, start = np.arange(len(body), dtype=float), ""
    if time:
        seconds, start = _times(name, source, rows, body["time"])
    return Record(name, source, seconds, numbers, rows, start=start)


def _refused(name, source, row, allowed):
    return ParameterError(name, source, f"row {row}: {allowed}")


def _cells(name, source, text):
    # pandas takes over what is hard in the format: quotes, and what belongs to which column.
    lines = text.replace("\r\n", "\n").replace("\r", "\n").rstrip("\n\t ,;")
    if not lines:
        raise ParameterError(name, source, "must not be empty")
    first = lines.split("\n", 1)[0]
    if not first.strip():
        raise _refused(name, source, 1, "must hold the names of the columns, is empty")
    if re.search(r"[;\t]", first) and "," not in first:
        raise ParameterError(name, source, "must be separated by commas, is by ';' or tabs")
    try:
        cells = pd.read_csv(
            io.StringIO(lines), header=None, dtype=str, na_filter=False, skip_blank_lines=False
        )
    except (ValueError, csv.Error) as error:  # pandas' own errors are ValueErrors
        raise ParameterError(name, source, _of_pandas(error)) from None
    header = [cell.strip() for cell in cells.iloc[0]]
    twice = sorted({column for column in header if column and header.count(column) > 1})
    if twice:
        raise ParameterError(
            name, source, f"must name each column once; twice: {_quoted(twice[0])}"
        )
    if len(cells) != lines.count("\n") + 1:
        raise ParameterError(name, source, "must have a line for each row; a quoted cell has two")
    if len(cells) > MOST_ROWS:
        raise ParameterError(name, source, f"must have at most {MOST_ROWS} rows")
    return header, cells.iloc[1:].set_axis(header, axis=1)


def _of_pandas(error):
    found = re.search(r"Expected (\d+) fields in line (\d+), saw (\d+)", str(error))
    if found:
        wanted, row, seen = found.groups()
        return f"row {row}: must have {wanted} values as the header has, has {seen}"
    if found := re.search(r"EOF inside string starting at row (\d+)", str(error)):
        return f"row {int(found[1]) + 1}: a quotation mark is not closed"
    return "must be a table of comma-separated values: " + " ".join(str(error).split())


def _layout(name, source, header, layouts, also):
    for layout in layouts:
        if set(also) | set(layout) <= set(header):
            return list(layout)
    wanted = " or ".join(", ".join([*also, *layout]) for layout in layouts)
    for column in header:
        unit = max((u for u in _UNITS if column.endswith(f"_{u}")), key=len, default="")
        better = f"{column.removesuffix(f'_{unit}')}_{_UNITS[unit][0]}" if unit else ""
        if any(better in layout for layout in layouts):
            allowed = f"column {_quoted(column)} must be {better}: {_UNITS[unit][1]}"
            raise ParameterError(name, source, allowed)
    there = ", ".join(map(_quoted, header[:12]))
    there += ", …" if len(header) > 12 else ""
    raise ParameterError(name, source, f"must have the columns {wanted}; has {there}")


def _numbers(name, source, rows, column, cells, bound):
    found = pd.to_numeric(cells.str.strip(), errors="coerce").to_numpy(dtype=float, copy=True)
    wrong = np.flatnonzero(~np.isfinite(found))
    if wrong.size:
        cell = cells.iloc[wrong[0]].strip()
        raise _refused(name, source, rows[wrong[0]], f"{column} = {_quoted(cell)}: {_why(cell)}")
    low, high = bound or (-math.inf, math.inf)
    beyond = np.flatnonzero((found < low) | (found > high))
    if beyond.size:
        value = f"{column} = {found[beyond[0]]:g}"
        allowed = f"{value}: must be from {low:g} to {high:g}; another unit?"
        raise _refused(name, source, rows[beyond[0]], allowed)
    return found


def _quoted(cell):
    return repr(cell if len(cell) <= SHOWN else f"{cell[: SHOWN - 1]}…")


def _why(cell):
    if not cell or cell.lower() in ("nan", "na", "n/a", "null", "none", "-", "--"):
        return "there is no value; leave the row out, or fill the gap by a rule of your own"
    if re.search(r"[°'′\"″]|\d[NSEWnsew]$|^[NSEWnsew]", cell):
        return "must be a number; degrees and minutes must be decimal degrees, south and west < 0"
    if re.fullmatch(r"[-+]?\d+,\d+", cell):
        return "must be a number with a decimal point"
    return "must be a finite number"


def _times(name, source, rows, cells):
    cells = cells.str.strip()

    def refused(row, allowed):
        return _refused(name, source, rows[row], f"time = {_quoted(cells.iloc[row])}: {allowed}")

    empty = np.flatnonzero(cells.str.lower().isin(("", "nan", "nat")))
    if empty.size:
        raise refused(empty[0], "there is no time")
    found = pd.to_numeric(cells, errors="coerce").to_numpy(dtype=float)
    seconds, start = found, ""
    if cells.str.fullmatch(r"(19|20)\d\d(0[1-9]|1[0-2])([0-2]\d|3[01])").all():
        raise refused(0, "is it a date? It must be seconds, or ISO 8601 such as 2017-04-06")
    if not np.isfinite(found).all():
        if np.isfinite(found).any():  # the first row that is unlike row 2
            row = int(np.argmin(np.isfinite(found) == np.isfinite(found[0])))
            raise refused(row, "must be like the first one, seconds or ISO 8601")
        seconds, start = _from_iso(refused, cells)
    back = np.flatnonzero(np.diff(seconds) <= 0)
    if back.size:
        k = int(back[0]) + 1
        how = "the same time as" if seconds[k] == seconds[k - 1] else "a time before"
        raise refused(k, f"{how} row {rows[k - 1]}")
    far = np.flatnonzero(np.maximum(np.abs(seconds), np.abs(seconds - seconds[0])) > LONGEST)
    if far.size:
        raise refused(far[0], "must be in seconds")
    return seconds - seconds[0], start


def _from_iso(refused, cells):
    zoned = cells.str.contains(r"(?:Z|z|[+-]\d\d:?\d\d)$", regex=True).to_numpy()
    if zoned.any() and not zoned.all():
        row = int(np.argmin(zoned == zoned[0]))
        raise refused(row, "must have a time zone in all rows or in none")
    # ISO 8601 alone: 03/04/2017 is March to one reader and April to another.
    found = pd.to_datetime(cells, format="ISO8601", utc=True, errors="coerce")
    wrong = np.flatnonzero(
        found.isna().to_numpy() | ~cells.str.match(r"\d{4}-\d\d-\d\d").to_numpy()
    )
    if wrong.size:
        raise refused(wrong[0], "must be seconds or ISO 8601, such as 2017-04-06T12:10:00Z")
    since = (found - found.iloc[0]).dt.total_seconds().to_numpy()
    return since, found.iloc[0].isoformat()
