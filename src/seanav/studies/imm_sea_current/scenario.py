"""Paper 4: what can be chosen. Cha, Hwang and Park, *The Journal of Navigation*, 2022."""

import math
from functools import lru_cache
from typing import Any, Self

import attrs
import numpy as np

from seanav.checks import ParameterError, markov_chain
from seanav.filters import fading
from seanav.models import earth, inertial, units
from seanav.models.trajectories import SHAPES, Trajectory
from seanav.scenario import Choice, File, Integer, List, Number, Parameters, parameter, tenth

# Bounds on work and memory. Six hours of 100 Hz noise take 0.3 GB a processor; the records
# of all studies in one notebook stay below 1 GB.
MOST_RUNS = 10_000
MOST_SECONDS = MOST_RUNS * 7200  # of all runs together
LONGEST = 21_600  # s

# Sharper or shorter turns cannot be followed by increments of one second: at these bounds an
# errorless system stays, over the paper's two hours, within 1 % of the smallest position
# error in Tables 2 and 3, and at 0.5 rad/s it no longer does (both are tested).
TURN_RATE = 0.2  # rad/s
TURN_TIME = 1.0  # s

# Far beyond any sensor, and well inside what double precision tells apart.
_SENSOR = Number(at_least=1e-6, at_most=100)
_SIGMA = Number(at_least=1e-3, at_most=10)
_TRUE = List(_SIGMA, at_most=32, distinct=True)
_FILTER = List(_SIGMA, at_most=6, distinct=True)
_START: dict[str, Any] = {
    "origin": "derived",
    "note": "near-perfect start, chosen by looking at Tables 2 and 3",
}


def _ascending(kind):
    return lambda name, value: tuple(sorted(kind(name, value)))


@attrs.frozen(kw_only=True)
class Scenario(Parameters):
    """Everything that can be chosen, checked at once; units are in the names.

    Raises
    ------
    seanav.checks.ParameterError
        One line that names the parameter, its value and what is allowed.
    """

    runs: int = parameter(
        100, Integer(2, MOST_RUNS), origin="text", note="missions per point", quick=tenth(2)
    )
    more_runs: int = parameter(
        4,
        Integer(1, 100),
        origin="assumed",
        note="times as many where these leave a claim open",
        quick=tenth(1),
    )
    seed: int = parameter(4, Integer(0), origin="assumed", note="of all random numbers")
    duration_s: float = parameter(
        7200.0, Number(at_least=60, at_most=LONGEST), unit="s", origin="text"
    )
    speed_kn: float = parameter(20.0, Number(at_least=0.1, at_most=60), unit="kn", origin="text")
    latitude_deg: float = parameter(
        36.0, Number(at_least=-80, at_most=80), unit="deg", origin="text"
    )
    longitude_deg: float = parameter(
        127.0, Number(at_least=-180, at_most=360), unit="deg", origin="text"
    )
    trajectory: str = parameter(
        "square",
        Choice(SHAPES),
        origin="derived",
        note="one lap; by Tables 2 and 3",
    )
    corner_radius: float = parameter(
        300.0,
        Number(above=0),
        unit="m",
        origin="derived",
        note="as the trajectory; of little effect",
    )
    sides: int = parameter(4, Integer(3, 100), origin="assumed", note="of a polygon or of laps")
    laps: int = parameter(1, Integer(1, 100), origin="assumed", note='of "laps"')
    accelerometer_bias_mg: float = parameter(
        0.05,
        _SENSOR,
        unit="mg",
        origin="text",
        note="Table 1; 1 sigma per run and axis: assumed",
    )
    accelerometer_noise_mg: float = parameter(
        0.01, _SENSOR, unit="mg/√Hz", origin="text", note="Table 1"
    )
    gyro_bias_deg_h: float = parameter(
        0.02,
        _SENSOR,
        unit="deg/h",
        origin="text",
        note="Table 1; 1 sigma per run and axis: assumed",
    )
    gyro_noise_deg_sqrt_h: float = parameter(
        0.005, _SENSOR, unit="deg/√h", origin="text", note="Table 1"
    )
    log_noise: float = parameter(
        0.01, Number(at_least=1e-4, at_most=10), unit="m/s", origin="text", note="Table 1"
    )
    log_axes: int = parameter(1, Choice((1, 3)), origin="text", note="forward axis, or all of b")
    correlation_time_s: float = parameter(
        7200.0,
        Number(at_least=1, at_most=1e7),
        unit="s",
        origin="text",
        note="of the filters; of the truth: assumed",
    )
    sigma_true: tuple = parameter(
        (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0),
        _ascending(_TRUE),
        unit="m/s",
        origin="assumed",
        note="ends: text",
    )
    sigma_filter: tuple = parameter(
        (0.1, 0.5, 1.0),
        _ascending(_FILTER),
        unit="m/s",
        origin="text",
    )
    initial_current: str = parameter(
        "zero",
        Choice(("zero", "stationary")),
        origin="derived",
        note="by one ratio of Table 3",
    )
    initial_errors: str = parameter(
        "none", Choice(("none", "drawn")), origin="derived", note="drawn: from the next four"
    )
    initial_position_m: float = parameter(
        1.0, Number(at_least=1e-3, at_most=1e4), unit="m", **_START
    )
    initial_velocity: float = parameter(
        1e-3, Number(at_least=1e-6, at_most=10), unit="m/s", **_START
    )
    initial_tilt_rad: float = parameter(
        1e-6, Number(at_least=1e-9, at_most=0.1), unit="rad", **_START
    )
    initial_heading_rad: float = parameter(
        1e-6, Number(at_least=1e-9, at_most=0.5), unit="rad", **_START
    )
    fading_form: str = parameter(
        "sigma",
        Choice(tuple(fading.FORMS)),
        origin="derived",
        note="by Tables 2, 3",
    )
    fading_window: int = parameter(20, Integer(2, 1000), origin="text", note="residuals, M")
    fading_cap: float = parameter(
        10.0,
        Number(at_least=1.0, at_most=1e6),
        origin="assumed",
        note="largest factor; bounds the start",
    )
    transition: tuple = parameter(
        ((0.9, 0.1), (0.1, 0.9)),
        List(List(Number(at_least=0, at_most=1), 2), 2),
        origin="assumed",
        note="damaged in our copy: likely 0.9, or 0.95",
    )
    initial_probabilities: tuple = parameter(
        (0.5, 0.5), List(Number(at_least=0, at_most=1), 2), origin="text"
    )
    current_file: str = parameter(
        "", File(), origin="ours", note="own record of the current (section 10); empty: none"
    )
    current_mean: str = parameter("kept", Choice(("kept", "removed")), origin="ours")
    current_gap_s: float = parameter(
        10_800.0, Number(above=0, at_most=1e6), unit="s", origin="ours", note="longest gap of it"
    )
    current_missions: int = parameter(
        32,
        Integer(2, 256),
        origin="ours",
        note="at most, in section 10",
        quick=lambda missions: min(missions, 16),
    )
    current: str = parameter(
        "tidal", Choice(("tidal", "markov")), origin="ours", note="section 10 without a file"
    )

    def __attrs_post_init__(self):
        markov_chain(self.transition, self.initial_probabilities)
        if self.duration_s != int(self.duration_s):
            raise ParameterError("duration_s", self.duration_s, "must be whole seconds")
        if self.runs * self.duration_s > MOST_SECONDS:
            most = int(MOST_SECONDS // self.duration_s)
            allowed = f"must be at most {most} with duration_s = {self.duration_s:g}"
            raise ParameterError("runs", self.runs, allowed)
        if self.trajectory not in ("circle", "straight"):
            self._check_turns()
        self.path()  # checks what is left: corners that are too large for the lap

    def _check_turns(self):
        """Refuse turns that increments of one second cannot follow."""
        sides = 4 if self.trajectory == "square" else self.sides
        laps = self.laps if self.trajectory == "laps" else 1
        lap = max(2 * math.pi / TURN_RATE, sides * TURN_TIME)
        if self.duration_s < laps * lap:
            name = "laps" if laps > 1 else "sides"
            allowed = f"must leave at least {math.ceil(lap)} s for a lap"
            raise ParameterError(name, getattr(self, name), allowed)
        least = self.speed_kn * units.KNOT * max(1 / TURN_RATE, sides * TURN_TIME / (2 * math.pi))
        if self.corner_radius < least:
            allowed = f"must be at least {math.ceil(least)} m at {self.speed_kn:g} kn"
            allowed += f" and {sides} sides: increments of one second follow no sharper turn"
            raise ParameterError("corner_radius", self.corner_radius, allowed)

    def longer(self) -> Self:
        """Return the scenario with `more_runs` times as many runs, as far as they are allowed."""
        most = min(MOST_RUNS, int(MOST_SECONDS // self.duration_s))
        return attrs.evolve(self, runs=min(self.more_runs * self.runs, most))

    def path(self) -> Trajectory:
        """Return the trajectory, prepared once."""
        return _path(
            self.trajectory,
            self.duration_s,
            self.speed_kn,
            self.latitude_deg,
            self.longitude_deg,
            self.corner_radius,
            self.sides,
            self.laps,
        )

    @property
    def sensor_errors(self) -> inertial.SensorErrors:
        """Table 1 in SI units."""
        return inertial.SensorErrors(
            self.accelerometer_bias_mg * 1e-3 * units.G0,
            math.radians(self.gyro_bias_deg_h) / 3600,
            self.accelerometer_noise_mg * 1e-3 * units.G0,
            math.radians(self.gyro_noise_deg_sqrt_h) / 60,
        )

    def initial_std(self) -> np.ndarray:
        """Return standard deviations at the start of the 13 states before the current."""
        errors, path = self.sensor_errors, self.path()
        R_n, R_t = earth.radii(path.latitude)
        metres = [R_n, R_t * math.cos(path.latitude)]
        position = [self.initial_position_m / scale for scale in metres]
        tilt = [self.initial_tilt_rad] * 2 + [self.initial_heading_rad]
        biases = [errors.accelerometer_bias] * 3 + [errors.gyro_bias] * 3
        return np.array([*position, *[self.initial_velocity] * 2, *tilt, *biases])


@lru_cache(maxsize=4)
def _path(shape, duration, speed_kn, latitude_deg, longitude_deg, corner_radius, sides, laps):
    return Trajectory(
        shape=shape,
        duration=duration,
        speed=speed_kn * units.KNOT,
        latitude=math.radians(latitude_deg),
        longitude=math.radians(longitude_deg),
        corner_radius=corner_radius,
        sides=sides,
        laps=laps,
    )
