"""Level trajectories at constant speed on the ellipsoid, and the increments felt on them.

A trajectory is a heading as a function of time, known in closed form: straight pieces and
circular arcs. Position follows by quadrature of the geodetic rates on a fine grid, so a
square is closed on the plane, not exactly on the ellipsoid.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from seanav.checks import ParameterError, choice, integer, number, read_only
from seanav.models import earth
from seanav.models.units import KNOT

SHAPES = ("square", "circle", "straight", "polygon", "laps")


@dataclass(frozen=True)
class Trajectory:
    """A level path at constant speed.

    Parameters
    ----------
    shape : str
        ``square`` (one lap, four legs), ``circle`` (one turn), ``straight``, ``polygon``
        (one lap with `sides` sides) or ``laps`` (`laps` laps of that polygon).
    duration : float
        s, a whole number.
    speed : float
        m/s.
    latitude, longitude : float
        Start, rad.
    heading : float
        Of the first leg, rad from north to the east.
    corner_radius : float
        m.
    sides, laps : int
    clockwise : bool

    Raises
    ------
    seanav.checks.ParameterError
        If a value is not usable, such as corners that do not fit on a leg.
    """

    shape: str = "square"
    duration: float = 7200.0
    speed: float = 20 * KNOT
    latitude: float = math.radians(36.0)
    longitude: float = math.radians(127.0)
    heading: float = math.pi / 2
    corner_radius: float = 300.0
    sides: int = 4
    laps: int = 1
    clockwise: bool = False
    # What was computed from the fields above. No field of __init__: a copy with another
    # heading, by `dataclasses.replace`, starts with an empty one.
    _cache: dict = field(init=False, default_factory=dict, repr=False, compare=False)

    def __post_init__(self):
        choice("trajectory", self.shape, SHAPES)
        number("duration", self.duration, at_least=60.0)
        if self.duration != int(self.duration):
            raise ParameterError("duration", self.duration, "must be a whole number of seconds")
        number("speed", self.speed, above=0.0)
        number("latitude", self.latitude, above=-1.5, below=1.5)
        number("longitude", self.longitude)
        number("heading", self.heading)
        number("corner_radius", self.corner_radius, above=0.0)
        integer("sides", self.sides, at_least=3)
        integer("laps", self.laps, at_least=1)
        if self.shape not in ("circle", "straight"):
            # Larger corners leave no straight piece between them: a circle.
            lap = self.speed * self.duration / self._laps
            largest = lap / (2 * math.pi) * (1 - 1e-9)
            if not self.corner_radius <= largest:
                allowed = f"must be at most {math.floor(largest)} m on a lap of {lap:.0f} m"
                raise ParameterError("corner_radius", self.corner_radius, allowed)

    @property
    def _sides(self):
        return 4 if self.shape == "square" else self.sides

    @property
    def _laps(self):
        return self.laps if self.shape == "laps" else 1

    @property
    def _leg(self):
        """Length of a side between the sharp corners, m: the rounded lap takes the duration."""
        n, r = self._sides, self.corner_radius
        lap = self.speed * self.duration / self._laps
        return lap / n - 2 * r * (math.pi / n - math.tan(math.pi / n))

    def course(self, t: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return heading (rad) and its rate (rad/s) at times `t` (s, any shape)."""
        t = np.asarray(t, dtype=float)
        side = 1.0 if self.clockwise else -1.0
        if self.shape == "straight":
            return np.full(t.shape, self.heading), np.zeros(t.shape)
        if self.shape == "circle":
            rate = side * 2 * math.pi / self.duration
            return self.heading + rate * t, np.full(t.shape, rate)
        n = self._sides
        lap_time = self.duration / self._laps
        turn = 2 * math.pi / n
        arc = self.corner_radius * turn / self.speed
        straight = lap_time / n - arc
        # The lap starts in a corner, in the middle of its arc, already on the first course:
        # the first half arc is sailed at the end, so that the first leg is straight.
        legs = np.floor(t / (straight + arc))
        within = t - legs * (straight + arc)
        fraction = np.clip((within - straight) / arc, 0.0, 1.0)
        rates = np.where(within >= straight, side * turn / arc, 0.0)
        return self.heading + side * turn * (legs + fraction), rates

    def states(self) -> tuple[np.ndarray, ...]:
        """Return truth at whole seconds: latitude, longitude (rad), v_n (m/s), heading (rad).

        Shapes (steps + 1,), (steps + 1,), (steps + 1, 3), (steps + 1,); read-only.
        """
        if "states" not in self._cache:
            latitude, longitude = self._position(100)
            heading = self.course(np.arange(int(self.duration) + 1.0))[0]
            v_n = np.zeros((len(heading), 3))
            v_n[:, 0], v_n[:, 1] = self.speed * np.cos(heading), self.speed * np.sin(heading)
            read_only(latitude, longitude)
            self._cache["states"] = read_only(latitude[::200], longitude[::200], v_n, heading)
        return self._cache["states"]

    def C_bn(self) -> np.ndarray:
        """Return the true attitude at whole seconds, (steps + 1, 3, 3)."""
        heading = self.states()[3]
        C = np.zeros((len(heading), 3, 3))
        C[:, 0, 0] = C[:, 1, 1] = np.cos(heading)
        C[:, 1, 0] = np.sin(heading)
        C[:, 0, 1] = -C[:, 1, 0]
        C[:, 2, 2] = 1.0
        return C

    def _position(self, rate):
        """Latitude and longitude at twice `rate`: ends and middles of the fast intervals."""
        count = 2 * rate * int(self.duration) + 1
        t = np.arange(count) / (2.0 * rate)
        heading = self.course(t)[0]
        north, east = self.speed * np.cos(heading), self.speed * np.sin(heading)
        # Fixed-point rounds of the trapezium rule: the radii depend on latitude so weakly
        # that three rounds are exact to rounding.
        latitude = np.full(count, self.latitude)
        for _ in range(3):
            latitude = self.latitude + _integral(north / earth.radii(latitude)[0], t)
        longitude = self.longitude + _integral(
            east / (earth.radii(latitude)[1] * np.cos(latitude)), t
        )
        return latitude, longitude

    def increments(self, rate: int = 100) -> tuple[np.ndarray, ...]:
        """Return errorless integrals of angular rate (rad) and specific force (m/s) in b.

        Shape (duration * rate, 3) each, read-only; Simpson's rule on each fast interval.
        """
        if rate not in self._cache:
            latitude, _ = self._position(rate)
            t = np.arange(len(latitude)) / (2.0 * rate)
            heading = self.course(t)[0]
            # The mean turn rate of an interval, so that one that holds the beginning or the
            # end of an arc is right too.
            middle = (heading[2::2] - heading[:-2:2]) * rate
            weights = np.array([1.0, 4.0, 1.0]) / 6.0 / rate
            rotation = np.zeros((len(middle), 3))
            velocity = np.zeros((len(middle), 3))
            for part, weight in enumerate(weights):
                at = slice(part, part + 2 * len(middle), 2)
                inside = latitude[at][: len(middle)], heading[at][: len(middle)]
                w_b, f_b = _felt(*inside, middle, self.speed)
                rotation += weight * w_b
                velocity += weight * f_b
            self._cache[rate] = read_only(rotation, velocity)
        return self._cache[rate]


def _integral(rate, t):
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(t)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _felt(latitude, heading, turn, speed):
    """Angular rate and specific force in body axes on a level path at height 0."""
    R_n, R_t = earth.radii(latitude)
    s, c = np.sin(latitude), np.cos(latitude)
    sh, ch = np.sin(heading), np.cos(heading)
    north, east = speed * ch, speed * sh
    oN, oD = earth.RATE * c, -earth.RATE * s
    rN, rE, rD = east / R_t, -north / R_n, -east / R_t * s / c
    wN, wE, wD = oN + rN, rE, oD + rD
    w_b = np.stack([ch * wN + sh * wE, -sh * wN + ch * wE, wD + turn], axis=1)
    cN, cE, cD = 2 * oN + rN, rE, 2 * oD + rD
    g = earth.gravity(latitude, 0.0)
    # f = dv/dt + (2 omega_ie + omega_en) × v − g, with v level.
    fN = -speed * sh * turn - cD * east
    fE = speed * ch * turn + cD * north
    fD = cN * east - cE * north - g
    return w_b, np.stack([ch * fN + sh * fE, -sh * fN + ch * fE, fD], axis=1)
