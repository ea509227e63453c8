"""Paper 5: path planning for gravity-aided inertial navigation with the PCRB.

Wang and Cai, preprint (2023). The scenario, the paths that are compared, the Monte-Carlo
runs along them. Their scores are in `seanav.studies.gravity_scores`, random start and goal
pairs in `seanav.studies.gravity_pairs`.
"""

from dataclasses import dataclass, replace

import numpy as np

from seanav import checks, estimates, montecarlo
from seanav.filters import labels, matching, pcrb, planning, point_mass
from seanav.models import gravity, gravity_sources
from seanav.studies.gravity_scores import Score

MGAL = gravity.MGAL
KM = 1e3  # m

BATCH = 250  # runs per unit of parallel work; fixed, so that results do not depend on threads


@dataclass(frozen=True)
class Scenario:
    """Everything that can be chosen, checked at once; units are in the names.

    Nodes are (east, north) counts of the map spacing from the lower left corner.

    Raises
    ------
    seanav.checks.ParameterError
        One line that names the parameter, its value and what is allowed.
    """

    map_source: str = "geoid"
    map_latitude_deg: float = 18.8
    map_longitude_deg: float = 128.0
    map_variable: str = ""
    start_1: tuple = (58, 73)
    start_2: tuple = (30, 58)
    goal: tuple = (65, 9)
    fan_1_km: tuple = (22.0, 16.5, 11.0, 5.5, -5.5, -11.0, -16.5)
    fan_2_km: tuple = (27.5, 22.0, 16.5, 11.0, 5.5, -5.5, -11.0, -16.5, -22.0, -27.5)
    user_path_km: tuple = ()
    noise_mgal: tuple = (1.0, 2.0, 3.0, 4.0)
    planning_noise_mgal: float = 2.0
    initial_std_km: float = 1.0
    process_noise: float = 0.01
    speed: float = 5.0
    samples: int = 100
    runs: int = 1000
    window_sigmas: float = 1.0
    epsilon: float = 0.3
    bound_expansions: int = 30_000
    pairs: int = 60
    label_pairs: int = 14
    seed: int = 5

    def __post_init__(self):
        integer, number = checks.integer, checks.number
        number("map_latitude_deg", self.map_latitude_deg, at_least=-90, at_most=90)
        number("map_longitude_deg", self.map_longitude_deg, at_least=-180, at_most=360)
        for name in ("start_1", "start_2", "goal"):
            self._set(name, _node(name, getattr(self, name)))
        for name in ("start_1", "start_2"):
            if getattr(self, name) == self.goal:
                raise checks.ParameterError(name, self.goal, "must differ from goal")
        for name in ("fan_1_km", "fan_2_km"):
            values = _sequence(name, getattr(self, name), "amplitudes in km")
            self._set(name, tuple(number(name, value) for value in values))
        noises = _sequence("noise_mgal", self.noise_mgal, "standard deviations in mGal")
        if not noises:
            raise checks.ParameterError("noise_mgal", noises, "must hold at least one value")
        self._set("noise_mgal", tuple(number("noise_mgal", value, above=0) for value in noises))
        checks.choice("planning_noise_mgal", self.planning_noise_mgal, self.noise_mgal)
        number("initial_std_km", self.initial_std_km, above=0)
        number("process_noise", self.process_noise, at_least=0)
        number("speed", self.speed, above=0)
        integer("samples", self.samples, at_least=10)
        integer("runs", self.runs, at_least=2)
        number("window_sigmas", self.window_sigmas, above=0)
        number("epsilon", self.epsilon, at_least=0)
        integer("bound_expansions", self.bound_expansions, at_least=1)
        integer("pairs", self.pairs, at_least=2)
        integer("label_pairs", self.label_pairs, at_least=2, at_most=self.pairs)
        integer("seed", self.seed, at_least=0)

    def _set(self, name, value):
        object.__setattr__(self, name, value)

    def quick(self):
        """Return the scenario with a tenth of the runs and pairs."""
        return replace(
            self,
            runs=max(2, self.runs // 10),
            pairs=max(2, self.pairs // 10),
            label_pairs=max(2, self.label_pairs // 7),
            bound_expansions=max(1, self.bound_expansions // 10),
        )

    @property
    def P0(self):
        """Initial position covariance, (2, 2) m²."""
        return np.eye(2) * (self.initial_std_km * KM) ** 2

    @property
    def Q_rate(self):
        """Growth of the INS position variance per axis, m²/s."""
        return self.process_noise**2

    def map(self):
        """Load the map and check that the nodes and the user's path lie on it."""
        chart = gravity_sources.load(
            self.map_source,
            latitude_deg=self.map_latitude_deg,
            longitude_deg=self.map_longitude_deg,
            variable=self.map_variable or None,
            seed=self.seed,
        )
        north, east = chart.anomaly.shape
        for name in ("start_1", "start_2", "goal"):
            node = getattr(self, name)
            if not (0 <= node[0] < east and 0 <= node[1] < north):
                allowed = f"must lie on the map, [0 … {east - 1}, 0 … {north - 1}]"
                raise checks.ParameterError(name, list(node), allowed)
        return chart

    def user_path(self, chart):
        """Return the user's own path, (samples, 2) m, or None."""
        if len(self.user_path_km) == 0:
            return None
        name, value = "user_path_km", self.user_path_km
        try:
            corners = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            corners = np.empty(0)
        usable = corners.ndim == 2 and corners.shape[1] == 2 and len(corners) >= 2
        if not usable or not np.isfinite(corners).all():
            raise checks.ParameterError(name, value, "must be two or more [east, north] in km")
        if not on_map(corners * KM, chart):
            extent = [side / KM for side in chart.extent]
            allowed = f"must stay on the map, 0 … {extent[0]:g} by 0 … {extent[1]:g} km"
            raise checks.ParameterError(name, value, allowed)
        return resample(corners * KM, self.samples)


def _sequence(name, value, meaning):
    if isinstance(value, (str, bytes)) or not hasattr(value, "__iter__"):
        raise checks.ParameterError(name, value, f"must be a list of {meaning}")
    return tuple(value)


def _node(name, value):
    node = _sequence(name, value, "two whole numbers, east and north")
    if len(node) != 2:
        raise checks.ParameterError(name, value, "must be two whole numbers, east and north")
    return tuple(checks.integer(name, part, at_least=0) for part in node)


# Paths ---------------------------------------------------------------------------------


def length(points):
    """Return the length of a polyline (k, 2), in the unit of its points."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def resample(points, count):
    """Return `count` points (count, 2) at equal distances along a polyline (k, 2)."""
    along = np.concatenate([[0.0], np.hypot(*np.diff(points, axis=0).T).cumsum()])
    even = np.linspace(0.0, along[-1], count)
    return np.column_stack([np.interp(even, along, points[:, axis]) for axis in (0, 1)])


def bow(start, goal, amplitude, count):
    """Return a half-sine bow between two points, (count, 2), equidistant samples.

    A positive amplitude (m) bows to the left of the map, as the paper numbers its
    curves; on a path due east or west it bows to the north.
    """
    start, goal = np.asarray(start, float), np.asarray(goal, float)
    along = goal - start
    side = np.array([-along[1], along[0]]) / np.hypot(*along)
    if side[0] > 0 or (side[0] == 0 and side[1] < 0):
        side = -side
    share = np.linspace(0.0, 1.0, 2001)[:, None]
    return resample(start + share * along + amplitude * np.sin(np.pi * share) * side, count)


def displaced(points, amplitude):
    """Return a path (k, 2) moved sideways by a half-sine bow of `amplitude` m, equidistant."""
    return resample(
        points
        + bow(points[0], points[-1], amplitude, len(points))
        - bow(points[0], points[-1], 0.0, len(points)),
        len(points),
    )


def nearest(paths, count):
    """Return the names of the `count` bows nearest to the planned path, nearest first."""

    def gap(name):
        steps = paths["Planned"][:, None] - paths[name][None]
        return np.hypot(steps[..., 0], steps[..., 1]).min(axis=1).mean()

    bows = [name for name in paths if name not in ("Planned", "Direct")]
    return sorted(bows, key=gap)[:count]


def on_map(points, chart):
    """Tell whether every point (k, 2) in m lies on the map."""
    return bool((points >= 0).all() and (points <= np.asarray(chart.extent)).all())


def fan(chart, start, goal, amplitudes_km, samples):
    """Return the direct path and the bows that stay on the map, and how many did not.

    Parameters
    ----------
    start, goal : (2,) array_like
        Nodes (east, north).
    amplitudes_km : sequence of float
        Left to right; they are named L3, L4, … as in the paper.

    Returns
    -------
    dict of str to (samples, 2) ndarray in m, int
    """
    ends = np.asarray(start) * chart.spacing, np.asarray(goal) * chart.spacing
    paths = {"Direct": bow(*ends, 0.0, samples)}
    for number, amplitude in enumerate(amplitudes_km, start=3):
        curve = bow(*ends, amplitude * KM, samples)
        if on_map(curve, chart):
            paths[f"L{number}"] = curve
    return paths, len(amplitudes_km) + 1 - len(paths)


# Planning --------------------------------------------------------------------------------


def problem(scenario, chart, start, noise_mgal, goal=None):
    """Return the keyword arguments that both planners take."""
    return {
        "gradient": gravity.gradient(chart),
        "spacing": chart.spacing,
        "start": start,
        "goal": scenario.goal if goal is None else goal,
        "noise": noise_mgal * MGAL,
        "P0": scenario.P0,
        "process_noise": scenario.Q_rate,
        "speed": scenario.speed,
    }


def plan(scenario, chart, start, noise_mgal, goal=None):
    """Plan with the paper's A* for one noise level; see `seanav.filters.planning.plan`."""
    return planning.plan(**problem(scenario, chart, start, noise_mgal, goal))


def plan_labels(scenario, chart, start, noise_mgal, goal=None, **options):
    """Plan with the multi-label search; see `seanav.filters.labels.plan_labels`."""
    return labels.plan_labels(**problem(scenario, chart, start, noise_mgal, goal), **options)


def plan_path(result, chart, samples):
    """Return the planned nodes as `samples` equidistant points in m."""
    return resample(result.nodes * chart.spacing, samples)


# Monte Carlo --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Noise:
    """Common random numbers of all paths, noise levels and filters; unit variance."""

    initial: np.ndarray  # (runs, 2)
    drift: np.ndarray  # (runs, samples, 2)
    measurement: np.ndarray  # (runs, samples)


def draw(scenario):
    """Draw the random numbers of a scenario, one stream per run and purpose."""
    seed, runs, samples = scenario.seed, scenario.runs, scenario.samples
    return Noise(
        montecarlo.normals(seed, "initial error", runs, (2,)),
        montecarlo.normals(seed, "drift", runs, (samples, 2)),
        montecarlo.normals(seed, "measurement", runs, (samples,)),
    )


def Q_step(scenario, points):
    """Return the process noise between two samples of a path, (2, 2) m²."""
    seconds = length(points) / (len(points) - 1) / scenario.speed
    return np.eye(2) * scenario.Q_rate * seconds


def bound(scenario, chart, points, noise_mgal):
    """Return the PCRB along a path (samples, 2), linearised at the truth: (samples, 2, 2) m²."""
    slopes = gravity.interpolate(gravity.gradient(chart), chart.spacing, points)
    return pcrb.pcrb(slopes, noise_mgal * MGAL, scenario.P0, Q_step(scenario, points))


def expected_bound(scenario, chart, points, noise_mgal, nodes=7):
    """Return the PCRB with the information averaged over the prior: (samples, 2, 2) m².

    The expectation is over the truth, which lies around the planned path as the INS error
    does, by Gauss-Hermite quadrature with `nodes` points per axis.
    """
    offsets, weights = np.polynomial.hermite_e.hermegauss(nodes)
    shifts = np.stack(np.meshgrid(offsets, offsets), axis=-1).reshape(-1, 2)
    truths = points + scenario.initial_std_km * KM * shifts[:, None]
    slopes = gravity.interpolate(gravity.gradient(chart), chart.spacing, truths)
    # The mean of w·HHᵀ with weights that sum to one is the plain mean of scaled gradients.
    share = np.outer(weights, weights).ravel() / weights.sum() ** 2
    slopes *= np.sqrt(share * len(share))[:, None, None]
    Q = Q_step(scenario, points)
    return pcrb.expected_pcrb(slopes, noise_mgal * MGAL, scenario.P0, Q)


def root_trace(P):
    """Return the root of the trace of covariances (…, 2, 2): the two-dimensional RMSE."""
    return np.sqrt(np.trace(P, axis1=-2, axis2=-1))


def filter_inputs(scenario, chart, noise, points, noise_mgal, assumed_mgal=None):
    """Return the positional arguments that every matching filter takes."""
    Q = Q_step(scenario, points)
    return (
        chart.anomaly,
        chart.spacing,
        points,
        noise.initial * scenario.initial_std_km * KM,
        noise.drift * np.sqrt(Q[0, 0]),
        noise.measurement * noise_mgal * MGAL,
        ((assumed_mgal or noise_mgal) * MGAL) ** 2,
        scenario.P0,
        Q,
    )


def run(scenario, chart, noise, points, noise_mgal, *, method="sitan", assumed_mgal=None):
    """Run one filter along one path on every row of `noise`.

    Parameters
    ----------
    points : (samples, 2) ndarray
        True positions, m.
    method : {"sitan", "ekf", "point mass"}
    assumed_mgal : float, optional
        The noise the filter believes in; the true one by default.

    Returns
    -------
    Score
    """
    inputs = filter_inputs(scenario, chart, noise, points, noise_mgal, assumed_mgal)
    if method == "point mass":
        errors = point_mass.point_mass(*inputs)[0]
    else:
        slope = {"sitan": "block", "ekf": "point"}[method]
        options = {"gradient": slope, "window_sigmas": scenario.window_sigmas}
        errors = matching.sitan(*inputs, **options).errors
    limit = root_trace(bound(scenario, chart, points, noise_mgal))
    return Score((errors**2).sum(axis=2), limit, length(points))


def run_all(scenario, chart, noise, paths, noises_mgal, **options):
    """Run every path at every noise level in parallel: {name: [Score, …]}."""
    batches = [
        Noise(*(part[begin : begin + BATCH] for part in vars(noise).values()))
        for begin in range(0, len(noise.initial), BATCH)
    ]
    jobs = [(name, level, rows) for name in paths for level in noises_mgal for rows in batches]
    parts = montecarlo.parallel_map(
        lambda job: run(scenario, chart, job[2], paths[job[0]], job[1], **options),
        jobs,
        label="Monte Carlo",
    )
    whole = [
        replace(group[0], squared=np.concatenate([part.squared for part in group]))
        for group in (parts[i : i + len(batches)] for i in range(0, len(parts), len(batches)))
    ]
    count = len(noises_mgal)
    return {name: whole[i * count : (i + 1) * count] for i, name in enumerate(paths)}


def plane_check(scenario, noise):
    """Return the error over the bound on a plane map at the end of a path, an `Estimate`.

    On a plane SITAN's fit is exact, so it is the Kalman filter of a linear Gaussian problem.
    The error is measured in the metric of the PCRB, half of the normalised squared error
    (NEES / 2): one if the bound is reached along both axes, the one that the plane shows and
    the one that it does not.
    """
    nodes = np.arange(121.0) * KM
    plane = 1e-8 * nodes[None, :] + 2e-8 * nodes[:, None]
    chart = gravity.GravityMap(plane, KM, "plane", "analytic")
    points = resample(np.array([[40e3, 40e3], [80e3, 60e3]]), scenario.samples)
    inputs = filter_inputs(scenario, chart, noise, points, scenario.planning_noise_mgal)
    last = matching.sitan(*inputs).errors[:, -1]
    P = bound(scenario, chart, points, scenario.planning_noise_mgal)[-1]
    return estimates.mean(np.einsum("ri,ij,rj->r", last, np.linalg.inv(P), last) / 2)
