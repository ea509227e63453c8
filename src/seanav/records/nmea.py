"""Fixes of a receiver's log: NMEA 0183 sentences GGA and RMC, read by pynmea2."""

import datetime
from pathlib import Path

import numpy as np
import pynmea2

from seanav.checks import ParameterError
from seanav.records.table import Record, opened

HALF_A_DAY = 43_200.0  # s


def read_nmea(name: str, path: str, *, least: int = 2) -> Record:
    """Read the fixes in a log of NMEA 0183 sentences.

    GGA and RMC of one time are one fix; sentences of other kinds, and fixes that the receiver
    itself calls invalid, are left out. What stands before the ``$`` of a line is left out, and
    so is a last line that was cut off.

    Parameters
    ----------
    name, path : str
        Parameter and value, for the errors.
    least : int
        Fewest fixes.

    Returns
    -------
    Record
        Columns ``latitude_deg`` and ``longitude_deg``; `start` if there is an RMC with a date.

    Raises
    ------
    ParameterError
        One line: if it is no such log, or, with its row, a sentence is damaged, a position is
        not on Earth or a time lies before an earlier one.

    References
    ----------
    NMEA 0183, sentences GGA and RMC.
    """
    source, lines = Path(path).name, opened(name, path).splitlines()
    fixes, day, last, date = [], 0, None, None

    def refused(row, allowed):
        return ParameterError(name, source, f"row {row}: {allowed}")

    for row, line in enumerate(lines, 1):
        sentence = line[line.find("$") :].strip() if "$" in line else ""
        if not sentence:
            if line.strip() and not line.lstrip().startswith("!"):
                raise refused(row, f"must be an NMEA sentence, is {line.strip()[:40]!r}")
            continue
        if row == len(lines) and "*" not in sentence:
            break
        fix = _fix(sentence, row, refused)
        if fix is None:
            continue
        moment, *place, stated = fix
        if last is not None and moment < last - HALF_A_DAY:
            day += 1  # GGA says the time of day only
        elif last is not None and moment < last:
            raise refused(row, f"time {moment:g} s of the day: lies before {last:g} s")
        date = date or (stated and stated - datetime.timedelta(days=day))
        if moment != last:
            fixes.append((day * 2 * HALF_A_DAY + moment, *place, row))
        last = moment
    if len(fixes) < least:
        allowed = f"must hold at least {least} valid fixes (GGA or RMC), has {len(fixes)}"
        raise ParameterError(name, source, allowed)
    time, latitude, longitude, rows = np.array(fixes).T
    begin = datetime.datetime.combine(date, datetime.time(), datetime.UTC) if date else None
    start = (begin + datetime.timedelta(seconds=time[0])).isoformat() if begin else ""
    columns = {"latitude_deg": latitude, "longitude_deg": longitude}
    return Record(name, source, time - time[0], columns, rows.astype(int), start=start)


def _fix(sentence, row, refused):
    """Return (seconds of the day, latitude, longitude, date or None), or None if it is no fix."""
    try:
        found = pynmea2.parse(sentence, check="*" in sentence)
    except pynmea2.ChecksumError:
        raise refused(row, "its checksum is wrong: the sentence is damaged") from None
    except pynmea2.ParseError:  # a kind that is not known, or no sentence
        if sentence[1:2].isalpha() and "," in sentence:
            return None
        raise refused(row, f"must be an NMEA sentence, is {sentence[:40]!r}") from None
    kind = getattr(found, "sentence_type", "")
    if kind not in ("GGA", "RMC"):
        return None
    try:
        valid = int(found.gps_qual or 0) > 0 if kind == "GGA" else found.status == "A"
        if not valid:
            return None
        clock, latitude, longitude = found.timestamp, found.latitude, found.longitude
        stated = found.datestamp if kind == "RMC" else None
        moment = clock.hour * 3600 + clock.minute * 60 + clock.second + clock.microsecond / 1e6
        if found.lat_dir not in ("N", "S") or found.lon_dir not in ("E", "W"):
            raise ValueError
    except (ValueError, TypeError, AttributeError, IndexError):
        raise refused(row, f"{kind} must hold time, position and its quality") from None
    if not (abs(latitude) <= 90 and abs(longitude) <= 180):
        raise refused(row, f"position {latitude:g}, {longitude:g}: must be on Earth")
    return moment, latitude, longitude, stated if isinstance(stated, datetime.date) else None
