"""Paper 1: what can be chosen, and whose numbers the vehicles are.

Nonlinear filtering of an autonomous underwater vehicle, *Transactions of the Institute of
Measurement and Control* (2021). Its Table 1 is lost: no default is the paper's.
"""

import math

import attrs
import numpy as np

from seanav import checks
from seanav.checks import ParameterError
from seanav.models import bodies
from seanav.scenario import File, Integer, List, Number, Parameters, parameter, tenth

SHORTEST, LONGEST = 1e-4, 1e5  # s, of a step and of a mission
STEPS = 100_000  # of one run, at most
MEMORY = 4.0  # GiB that the tracks of a study may take
COMPONENTS = bodies.STATES
UNITS = ("m/s",) * 3 + ("rad/s",) * 3
VEHICLES = ("torpedo", "sphere")
MOVED = {"torpedo_step": ("torpedo",), "sphere_step": ("sphere",), "map_step": VEHICLES}

_STEP = Number(at_least=SHORTEST)
_VARIANCE = Number(at_least=1e-12, at_most=1e12)
_INTERVAL = Number(at_least=1e-3, at_most=LONGEST / 2)
_FACTOR = Number(at_least=1e-3, at_most=1e3)
_START = List(Number(at_least=-1e3, at_most=1e3), 6)
_VARIANCES = List(Number(at_least=1e-12, at_most=1e4), 6)
_NOISES = List(Number(at_least=1e-6, at_most=1e3), 6)
_PER_ROOT = "m/s, rad/s per √s"
_SQUARED = "(m/s)², (rad/s)²"


@attrs.frozen
class Case:
    """One measurement set: which components, with what noise variance."""

    number: int
    measured: tuple
    R: float
    words: str

    @property
    def H(self) -> np.ndarray:
        """Measurement matrix, (3, 6)."""
        return np.eye(6)[list(self.measured)]


@attrs.frozen(kw_only=True)
class Scenario(Parameters):
    """Everything that can be chosen, checked at once; SI.

    Raises
    ------
    seanav.checks.ParameterError
        One line that names the parameter, its value and what is allowed.
    """

    torpedo_start: tuple = parameter(
        (1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        _START,
        unit="m/s, rad/s",
        origin="assumed",
        note="u, v, w, p, q, r",
    )
    torpedo_variance: tuple = parameter(
        (0.05, 0.02, 0.02, 0.02, 0.02, 0.02),
        _VARIANCES,
        unit=_SQUARED,
        origin="assumed",
        note="of the start",
    )
    torpedo_noise: tuple = parameter(
        (0.1, 0.1, 0.1, 0.2, 0.2, 0.2), _NOISES, unit=_PER_ROOT, origin="assumed", note="diffusion"
    )
    sphere_start: tuple = parameter(
        (0.3, 0.1, -0.05, 0.05, -0.05, 0.15), _START, unit="m/s, rad/s", origin="assumed"
    )
    sphere_variance: tuple = parameter((0.02,) * 6, _VARIANCES, unit=_SQUARED, origin="assumed")
    sphere_noise: tuple = parameter(
        (0.03, 0.03, 0.03, 0.12, 0.12, 0.12), _NOISES, unit=_PER_ROOT, origin="assumed"
    )
    strong_noise: float = parameter(
        3.0, _FACTOR, origin="assumed", note="factor on the angular noise in the comparison"
    )
    small_R: float = parameter(
        1e-4,
        _VARIANCE,
        unit="(m/s)²",
        origin="assumed",
        note="case 1, chosen to show what the text says of it",
    )
    large_R: float = parameter(
        1.0, _VARIANCE, unit=_SQUARED, origin="assumed", note="cases 2 and 3, chosen likewise"
    )
    interval: float = parameter(
        0.5, _INTERVAL, unit="s", origin="assumed", note="between measurements"
    )
    mission: float = parameter(40.0, Number(above=0, at_most=LONGEST), unit="s", origin="assumed")
    torpedo_step: float = parameter(
        0.01, _STEP, unit="s", origin="assumed", note="Euler–Maruyama, twice it for particles"
    )
    sphere_step: float = parameter(0.02, _STEP, unit="s", origin="assumed", note="Euler–Maruyama")
    filter_step: float = parameter(
        0.05, _STEP, unit="s", origin="ours", note="Runge–Kutta of mean and covariance"
    )
    runs: int = parameter(
        150, Integer(2), origin="ours", note="missions of each vehicle", quick=tenth(2)
    )
    particles: int = parameter(500, Integer(2), origin="ours", note="of each particle filter")
    particle_runs: int = parameter(
        12, Integer(2), origin="ours", note="the first of the runs, at most all", quick=tenth(2)
    )
    map_noise: tuple = parameter(
        (0.5, 1.0, 2.0, 4.0),
        List(_FACTOR, at_most=20, distinct=True),
        origin="ours",
        note="factors on all noise",
    )
    map_interval: tuple = parameter(
        (0.25, 0.5, 1.0, 2.0),
        List(_INTERVAL, at_most=20, distinct=True),
        unit="s",
        origin="ours",
        note="multiples of the shortest",
    )
    map_step: float = parameter(
        0.01, _STEP, unit="s", origin="ours", note="Euler–Maruyama, divides every map_interval"
    )
    map_R: float = parameter(
        0.01, _VARIANCE, unit="(m/s)²", origin="ours", note="of the linear velocities"
    )
    sde_file: str = parameter(
        "", File(), origin="ours", note="a system of your own, see Your own data; empty: none"
    )
    seed: int = parameter(2021, Integer(0), origin="assumed")

    def __attrs_post_init__(self):
        Number(at_least=2 * self.interval)("mission", self.mission)
        for name, moved in MOVED.items():
            # A longer step of Euler's scheme does not follow the drag of the fastest axis.
            most = 0.5 * min(bodies.BODIES[vehicle].fastest() for vehicle in moved)
            if getattr(self, name) > most:
                allowed = f"must be at most half the time constant of the fastest axis, {most:.3g}"
                raise ParameterError(name, getattr(self, name), allowed)
        self._check_cases()
        self._check_map()
        self._check_memory()

    def _check_cases(self):
        """Refuse a step that does not divide the interval or the mission, or is far too short."""
        checks.parts("interval", self.interval, "mission", self.mission, at_most=STEPS)
        for name in ("torpedo_step", "sphere_step", "filter_step"):
            step = getattr(self, name)
            count = checks.parts(name, step, "interval", self.interval, at_most=STEPS)
            checks.parts(name, step, "mission", self.mission, at_most=STEPS)
            if name == "torpedo_step" and count % 2:
                allowed = "twice it, the step of the particle filter, must divide interval = "
                raise ParameterError(name, step, f"{allowed}{self.interval:g} evenly")

    def _check_map(self):
        """Refuse intervals and steps of the map that do not fit into one another."""
        finest = min(self.map_interval)
        for length in self.map_interval:
            if abs(length / finest - round(length / finest)) > 1e-9 * length / finest:
                allowed = f"must be a multiple of the shortest one, {finest:g}"
                raise ParameterError("map_interval", length, allowed)
        for name in ("map_step", "filter_step"):
            checks.parts(name, getattr(self, name), "map_interval", finest, at_most=STEPS)
        if self.map_mission / min(self.map_step, self.filter_step) > STEPS:
            allowed = f"need {self.map_mission:g} s, the least that each divides, and with this "
            allowed += f"map_step and filter_step more than {STEPS} steps"
            raise ParameterError("map_interval", list(self.map_interval), allowed)

    def _check_memory(self):
        """Refuse numbers of runs, samples and particles that fill the memory."""
        number = 6 + 36 + 1  # mean, covariance, NIS
        # Of every case at both strengths of the noise a track is kept; beside them there
        # are the tracks and the truth of the case, or of the row of the map, in work.
        kept = 12 * number + 4 * number + 4 * 6
        map_samples = self.map_mission / min(self.map_interval) + 1
        samples = kept * (self.mission / self.interval + 1) + (3 * number + 6) * map_samples
        most = int(MEMORY * 2**30 / (8 * samples))
        if self.runs > most:
            allowed = f"must be at most {most} to keep all samples of this mission, interval and "
            allowed += f"map_interval in {MEMORY:g} GiB"
            raise ParameterError("runs", self.runs, allowed)
        most = int(MEMORY / 4 * 2**30 / (8 * 6 * self.interval / (2 * self.torpedo_step)))
        if self.particles > most:
            allowed = f"must be at most {most} to keep the noise of this interval and torpedo_step "
            allowed += f"in {MEMORY / 4:g} GiB"
            raise ParameterError("particles", self.particles, allowed)

    @property
    def map_mission(self) -> float:
        """Length of the map's runs: half the mission, or the next that each interval divides."""
        finest = min(self.map_interval)
        common = math.lcm(*(round(length / finest) for length in self.map_interval)) * finest
        least = max(self.mission / 2, 2 * max(self.map_interval))
        return common * math.ceil(least / common - 1e-9)

    @property
    def cases(self) -> tuple[Case, ...]:
        """The three cases of the paper."""
        return (
            Case(1, (0, 1, 2), self.small_R, "linear velocities, small R"),
            Case(2, (0, 1, 2), self.large_R, "linear velocities, large R"),
            Case(3, (3, 4, 5), self.large_R, "angular velocities, large R"),
        )

    def prior(self, vehicle: str) -> tuple[np.ndarray, np.ndarray]:
        """Return x0 (6,) and P0 (6, 6)."""
        start = np.array(getattr(self, f"{vehicle}_start"))
        return start, np.diag(getattr(self, f"{vehicle}_variance"))

    def noise(self, vehicle: str, strength: float = 1.0) -> np.ndarray:
        """Return the diffusion (6,) of a vehicle, the angular part times `strength`."""
        return np.array(getattr(self, f"{vehicle}_noise")) * np.repeat([1.0, strength], 3)


def body_origins() -> list[tuple]:
    """Return rows (name, value, unit, origin, note) of the numbers in `seanav.models.bodies`."""
    remus = ("public source", "REMUS tables of Prestero (2001) as found in public code")
    odin = "ODIN sphere from memory of the literature, found nowhere public"
    drags = ("N s/m, N m s", "N s³/m³, N m s³")
    torpedo, sphere = bodies.TORPEDO, bodies.SPHERE
    rows = [
        ("torpedo mass", torpedo.mass, "kg", *remus),
        ("torpedo inertia", torpedo.inertia, "kg m²", *remus),
        ("torpedo linear drag", torpedo.linear, drags[0], "assumed", "66.6, 6.87 as paper 3"),
        ("torpedo cubic drag", torpedo.cubic, drags[1], "assumed", "no public value"),
        (
            "sphere mass",
            sphere.mass,
            "kg",
            "recalled",
            f"{odin}; half the water that a ball of 0.64 m displaces is 70.3 kg",
        ),
        (
            "sphere inertia",
            sphere.inertia,
            "kg m²",
            "recalled",
            f"{odin}; 0.4 m r² of the dry mass is 5.17",
        ),
        ("sphere linear drag", sphere.linear, drags[0], "recalled", odin),
        ("sphere cubic drag", sphere.cubic, drags[1], "recalled", odin),
        *(
            (f"{craft.name} tau0", craft.inputs, "N, N m", "assumed", "times 1 + 0.5 sin 0.3 t")
            for craft in (torpedo, sphere)
        ),
    ]
    return [(name, " ".join(f"{v:g}" for v in value), *rest) for name, value, *rest in rows]
