"""A user's own records: read from a file, checked row by row, never changed or copied."""

from seanav.records.nmea import read_nmea
from seanav.records.table import Record, opened, read_csv

__all__ = ["Record", "opened", "read_csv", "read_nmea"]
