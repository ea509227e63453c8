"""Tidal currents as sums of constituents, and the oscillator that a filter may believe in.

References
----------
M. G. G. Foreman, *Manual for Tidal Currents Analysis and Prediction*, Pacific Marine Science
Report 78-6, Institute of Ocean Sciences, 1978: constituents, their ellipses and speeds.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from seanav.checks import array, number

HOUR = 3600.0


@dataclass(frozen=True)
class Constituent:
    """One tidal constituent of a current: an ellipse that is run through at a fixed speed.

    Attributes
    ----------
    name : str
    amplitude : float
        Semi-major axis, m/s.
    degrees_per_hour : float
    bearing_deg : float
        Direction towards which the water flows at phase 0, clockwise from north.
    minor : float
        Semi-minor axis, m/s; 0 is a line, positive turns clockwise as seen from above.
    """

    name: str
    amplitude: float
    degrees_per_hour: float
    bearing_deg: float
    minor: float = 0.0

    def __post_init__(self):
        number("amplitude", self.amplitude, at_least=0)
        number("degrees_per_hour", self.degrees_per_hour, above=0)
        number("bearing_deg", self.bearing_deg)
        number("minor", self.minor, at_least=-self.amplitude, at_most=self.amplitude)

    @property
    def speed(self) -> float:
        """Angular speed, rad/s."""
        return math.radians(self.degrees_per_hour) / HOUR


# Least-squares fit of the measured surface current at NOAA station s08010, off San Francisco:
# amplitudes of the north component (m/s) and speeds (degrees per hour) of the seven largest; the
# major axis bears 353°. The rest of the record is Markov noise: standard deviations north and
# east (m/s), and the times (s) in which its autocorrelation falls to 1/e.
AXIS = 353.0
_NORTH = (
    ("M2", 0.623, 28.9841042),
    ("K1", 0.198, 15.0410686),
    ("S2", 0.138, 30.0),
    ("N2", 0.123, 28.4397295),
    ("O1", 0.095, 13.9430356),
    ("P1", 0.080, 14.9589314),
    ("K2", 0.047, 30.0821373),
)
S08010 = tuple(
    Constituent(name, north / math.cos(math.radians(AXIS)), speed, AXIS)
    for name, north, speed in _NORTH
)
REST_STD = (0.138, 0.077)
REST_TIME = (1.3 * HOUR, 1.0 * HOUR)


def stream(constituents: Sequence[Constituent], time: ArrayLike, phases: ArrayLike) -> np.ndarray:
    """Return the tidal current, north and east, (2, times, runs) m/s.

    Parameters
    ----------
    constituents : sequence of Constituent
    time : (times,)
        s.
    phases : (constituents, runs)
        Phase of each at time 0, rad.

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit or a number is not finite.
    """
    time = array("time", time, ("times",), {})
    phases = array("phases", phases, (len(constituents), "runs"), {})
    found = np.zeros((2, len(time), phases.shape[1]))
    for one, phase in zip(constituents, phases, strict=True):
        angle, bearing = one.speed * time[:, None] + phase, math.radians(one.bearing_deg)
        along, across = one.amplitude * np.cos(angle), one.minor * np.sin(angle)
        found[0] += along * math.cos(bearing) - across * math.sin(bearing)
        found[1] += along * math.sin(bearing) + across * math.cos(bearing)
    return found


def oscillator(speed: float, dt: float) -> np.ndarray:
    """Return the transition (2, 2) over `dt` s of an undamped oscillator of `speed` rad/s.

    The first state is the current, the second the same a quarter of a period later. Of an
    unknown phase both have the variance amplitude²/2 at all times, and no covariance at one
    time: the stationary start. The autocovariance is that variance times cos(speed · lag).

    Raises
    ------
    seanav.checks.ParameterError
        If a number is not finite, or the speed is below 0.
    """
    angle = number("speed", speed, at_least=0) * number("dt", dt)
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s], [-s, c]])
