"""Paper 4: a user's record of the sea current, cut into missions."""

import numpy as np

from seanav.checks import ParameterError
from seanav.records import Record, read_csv
from seanav.studies.imm_sea_current.scenario import Scenario

NAME = "current_file"
LAYOUTS = (("north_m_s", "east_m_s"), ("speed_m_s", "direction_deg"))
FASTEST = 10.0  # m/s; the strongest tidal races reach about eight
BOUNDS = {
    "north_m_s": (-FASTEST, FASTEST),
    "east_m_s": (-FASTEST, FASTEST),
    "speed_m_s": (0.0, FASTEST),
    "direction_deg": (-180.0, 360.0),
}
FEWEST = 2  # missions: one has no interval


def read(scenario: Scenario) -> Record:
    """Read the record that `current_file` names.

    Raises
    ------
    seanav.checks.ParameterError
        One line: a column, number or time that cannot be used, a gap longer than
        `current_gap_s`, or a record shorter than two missions.
    """
    record = read_csv(NAME, scenario.current_file, LAYOUTS, bounds=BOUNDS)
    record.check_gaps(scenario.current_gap_s)
    if record.span < FEWEST * scenario.duration_s:
        allowed = f"must last {FEWEST} missions of duration_s = {scenario.duration_s:g} at least, "
        raise ParameterError(NAME, record.source, allowed + f"lasts {record.span:g} s")
    return record


def velocities(record: Record, mean: str = "kept") -> np.ndarray:
    """Return the current at the record's samples, north and east, (2, samples) m/s.

    A direction is that towards which the water flows. `mean` ``removed`` takes away the mean
    over time, not over the samples, which may be unevenly spaced.
    """
    if "north_m_s" in record.columns:
        found = np.array([record["north_m_s"], record["east_m_s"]])
    else:
        bearing = np.radians(record["direction_deg"])
        found = record["speed_m_s"] * np.array([np.cos(bearing), np.sin(bearing)])
    if mean == "removed":
        found -= np.trapezoid(found, record.time)[:, None] / record.span
    return found


def missions(scenario: Scenario, record: Record) -> tuple[np.ndarray, np.ndarray]:
    """Cut the record into missions that follow each other; of too many some, evenly spread.

    Returns
    -------
    starts : ndarray (missions,)
        Seconds from the first row.
    current : ndarray (2, steps + 1, missions)
        North and east, m/s, at each second by linear interpolation.
    """
    duration = int(scenario.duration_s)
    count = int(record.span // duration)
    chosen = np.linspace(0, count - 1, min(count, scenario.current_missions)).round()
    starts = chosen * duration
    time = starts + np.arange(duration + 1)[:, None]
    flow = velocities(record, scenario.current_mean)
    return starts, np.array([np.interp(time, record.time, part) for part in flow])
