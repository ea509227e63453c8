"""Paper 5: what can be chosen. Wang and Cai, preprint (2023)."""

import dataclasses

import attrs
import numpy as np

from seanav import checks
from seanav.checks import ParameterError
from seanav.models import paths
from seanav.models.gravity import GravityMap, files
from seanav.models.gravity.quality import MAP_UNITS
from seanav.models.gravity.sources import load
from seanav.models.units import KM
from seanav.scenario import Choice, File, Integer, List, Number, Parameters, Text, parameter, tenth
from seanav.studies.gravity_planning import own_path

SAMPLES = 4_000_000  # runs times samples, at most: what is stored of them fits in a few GB

_CENTRE = ("map_latitude_deg", "map_longitude_deg")
_NODE = List(Integer(0), 2)
_FAN = List(Number(at_least=-1e4, at_most=1e4))


_NOISE = Number(at_least=1e-6, at_most=1e4)


def _noises(name, value):
    # The claims speak of the least and the most noise: the first and the last.
    return tuple(sorted(List(_NOISE, distinct=True)(name, value)))


def _own_path(name, value):
    corners = List(List(Number(), 2), at_least=0, at_most=1000)(name, value)
    if len(corners) == 1:
        raise ParameterError(name, value, "must be empty, or two or more [east, north] in km")
    return corners


@attrs.frozen(kw_only=True)
class Scenario(Parameters):
    """Everything that can be chosen, checked at once; units are in the names.

    Nodes are (east, north) counts of the map spacing from the lower left corner. The map of an
    own grid lies around the grid's middle if the centre is left at its default and the grid
    does not reach there.

    Raises
    ------
    seanav.checks.ParameterError
        One line that names the parameter, its value and what is allowed.
    """

    map_source: str = parameter(
        "geoid",
        File(),
        origin="assumed",
        note='"geoid" (JPGEO2024), "synthetic" or the path of your own grid',
    )
    # An own grid that does not cover the map around the default centre is taken around its own
    # middle, see map_centre; a centre that was chosen is taken as it is, or refused.
    map_latitude_deg: float = parameter(
        18.8,
        Number(at_least=-80, at_most=80),
        unit="deg",
        origin="assumed",
        note="centre of the map, whose range is like the paper's",
    )
    map_longitude_deg: float = parameter(
        128.0,
        Number(at_least=-180, at_most=360),
        unit="deg",
        origin="assumed",
        note="as the latitude",
    )
    map_variable: str = parameter(
        "", Text(), origin="ours", note="variable or band of your own grid, empty: the only one"
    )
    map_unit: str = parameter(
        "file", Choice(MAP_UNITS), origin="ours", note="unit of your own grid if it states none"
    )
    start_1: tuple = parameter(
        (58, 73), _NODE, unit="km", origin="text", note="east and north, section 4.1"
    )
    start_2: tuple = parameter((30, 58), _NODE, unit="km", origin="text", note="section 4.1")
    goal: tuple = parameter((65, 9), _NODE, unit="km", origin="text", note="section 4.1")
    fan_1_km: tuple = parameter(
        (22.0, 16.5, 11.0, 5.5, -5.5, -11.0, -16.5),
        _FAN,
        unit="km",
        origin="assumed",
        note="amplitudes of L3, L4, …, west positive, as many as the text has",
    )
    fan_2_km: tuple = parameter(
        (27.5, 22.0, 16.5, 11.0, 5.5, -5.5, -11.0, -16.5, -22.0, -27.5),
        _FAN,
        unit="km",
        origin="derived",
        note="5.5 km apart as the text says",
    )
    user_path_km: tuple = parameter(
        (),
        _own_path,
        unit="km",
        origin="ours",
        note="your own path, [[east, north], …], sailed with those of test 1",
    )
    path_file: str = parameter(
        "",
        File(),
        origin="ours",
        note="the same from a table (CSV) or GPX file, see Your own data; empty: none",
    )
    noise_mgal: tuple = parameter(
        (1.0, 2.0, 3.0, 4.0),
        _noises,
        unit="mGal",
        origin="text",
        note="Tables 2 and 3, read as standard deviation",
    )
    planning_noise_mgal: float = parameter(
        2.0,
        _NOISE,
        unit="mGal",
        origin="text",
        note="4 mGal² of Table 1, one of noise_mgal",
    )
    initial_std_km: float = parameter(
        1.0,
        Number(at_least=1e-3, at_most=20),
        unit="km",
        origin="text",
        note="per axis, Table 1",
    )
    process_noise: float = parameter(
        0.01,
        Number(at_least=0, at_most=10),
        unit="m/√s",
        origin="text",
        note="per axis, Table 1, read literally",
    )
    speed: float = parameter(
        5.0, Number(at_least=0.1, at_most=100), unit="m/s", origin="text", note="Table 1"
    )
    samples: int = parameter(
        100,
        Integer(10, 10_000),
        origin="text",
        note="per path, equidistant, the start included, section 4.1",
    )
    # Three initial errors are the fewest whose covariance can be matched.
    runs: int = parameter(1000, Integer(3, 100_000), origin="text", note="Table 1", quick=tenth(3))
    window_sigmas: float = parameter(
        1.0,
        Number(above=0, at_most=100),
        origin="assumed",
        note="half width of SITAN's window, in standard deviations",
    )
    epsilon: float = parameter(
        0.3,
        Number(at_least=0, at_most=1e6),
        origin="ours",
        note="tolerance of the multi-label planner",
    )
    bound_expansions: int = parameter(
        30_000,
        Integer(1, 10**9),
        origin="ours",
        note="of the search for a certified bound",
        quick=tenth(1),
    )
    pairs: int = parameter(
        60,
        Integer(2, 10_000),
        origin="ours",
        note="random start and goal pairs per map",
        quick=tenth(2),
    )
    label_pairs: int = parameter(
        14,
        Integer(2),
        origin="ours",
        note="of them also planned with labels and sailed",
        quick=tenth(2),
    )
    seed: int = parameter(5, Integer(0), origin="assumed", note="the first one tried")

    def __attrs_post_init__(self):
        for name in ("start_1", "start_2"):
            if getattr(self, name) == self.goal:
                raise ParameterError(name, list(self.goal), "must differ from goal")
        if self.path_file and self.user_path_km:
            raise ParameterError("path_file", self.path_file, "must be empty beside user_path_km")
        checks.choice("planning_noise_mgal", self.planning_noise_mgal, self.noise_mgal)
        Integer(2, self.pairs)("label_pairs", self.label_pairs)
        if self.runs * self.samples > SAMPLES:
            allowed = f"must be at most {SAMPLES // self.samples} for {self.samples} samples"
            raise ParameterError("runs", self.runs, allowed)

    @property
    def P0(self) -> np.ndarray:
        """Initial position covariance, (2, 2) m²."""
        return np.eye(2) * (self.initial_std_km * KM) ** 2

    @property
    def Q_rate(self) -> float:
        """Growth of the INS position variance per axis, m²/s."""
        return self.process_noise**2

    def origins(self) -> list[tuple]:
        """Return the rows of `Parameters.origins`, with the centre that is used."""
        rows = {row[0]: row for row in super().origins()}
        if self.map_centre != self._stated_centre:
            for name, degrees in zip(_CENTRE, self.map_centre, strict=True):
                note = "the middle of your own grid, which does not reach the default centre"
                rows[name] = (name, degrees, "deg", "derived", note)
        return list(rows.values())

    @property
    def _stated_centre(self):
        return self.map_latitude_deg, self.map_longitude_deg

    @property
    def map_centre(self) -> tuple[float, float]:
        """Latitude and longitude of the middle of the map, degrees.

        As the parameters say; but the middle of an own grid if they are left at their defaults
        and the grid does not cover the map around these.

        Raises
        ------
        seanav.checks.ParameterError
            If that needs a look into a file that cannot be read as a grid.
        """
        stated = self._stated_centre
        default = tuple(self.declared()[name][0] for name in _CENTRE)
        if self.map_source in ("geoid", "synthetic") or stated != default:
            return stated
        latitude, longitude = stated
        variable = self.map_variable or None
        return files.centre(self.map_source, latitude, longitude, variable=variable)

    def map(self) -> GravityMap:
        """Load the map and check that the starts and the goal lie on it.

        Raises
        ------
        seanav.checks.ParameterError
            As `seanav.models.gravity.sources.load`, and if a node is off the map.
        """
        latitude, longitude = self.map_centre
        chart = load(
            self.map_source,
            latitude_deg=latitude,
            longitude_deg=longitude,
            variable=self.map_variable or None,
            unit=self.map_unit,
            seed=self.seed,
        )
        if (latitude, longitude) != self._stated_centre:
            # Printed with the map: the user did not ask for this place.
            text = (
                f"{chart.source}, around its middle, {latitude:g}° N {longitude:g}° E, because "
                f"it does not reach the default centre"
            )
            chart = dataclasses.replace(chart, source=text)
        north, east = chart.anomaly.shape
        for name in ("start_1", "start_2", "goal"):
            node = getattr(self, name)
            if not (node[0] < east and node[1] < north):
                allowed = f"must lie on the map, [0 … {east - 1}, 0 … {north - 1}]"
                raise ParameterError(name, list(node), allowed)
        return chart

    def user_path(self, chart: GravityMap) -> np.ndarray | None:
        """Return the user's own path, (samples, 2) m, or None.

        Raises
        ------
        seanav.checks.ParameterError
            If it has no length or leaves the map, or its file cannot be used.
        """
        if self.path_file:
            corners = own_path.read("path_file", self.path_file, chart)
            return paths.resample(corners, self.samples)
        if not self.user_path_km:
            return None
        name, corners = "user_path_km", np.array(self.user_path_km) * KM
        if not paths.inside(corners, chart.extent):
            extent = [side / KM for side in chart.extent]
            allowed = f"must stay on the map, 0 … {extent[0]:g} by 0 … {extent[1]:g} km"
            raise ParameterError(name, self.user_path_km, allowed)
        if paths.length(corners) == 0:
            raise ParameterError(name, self.user_path_km, "must lead from one place to another")
        return paths.resample(corners, self.samples)
