"""Paper 2 on a user's own track: speeds from fixes, every estimator, what their errors are like.

A track is cut into windows of the scenario's steps; each is one course with its own lesson.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import attrs
import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import savgol_filter

from seanav import estimates, montecarlo
from seanav.checks import ParameterError
from seanav.estimates import Estimate
from seanav.filters import kalman
from seanav.models import earth
from seanav.records import Record, opened, read_csv, read_nmea
from seanav.studies.neural_estimator import run
from seanav.studies.neural_estimator.scenario import COURSES, MOST_STEPS, STEP, Scenario

LAYOUTS = (("latitude_deg", "longitude_deg"), ("north_m", "east_m"))
BOUNDS = {
    "latitude_deg": (-90.0, 90.0),
    "longitude_deg": (-360.0, 360.0),
    "north_m": (-1e7, 1e7),
    "east_m": (-1e7, 1e7),
}
FASTEST = 10.0  # m/s: where the network's scale ends
DRAWS = 16  # of the network's random weights, for each window
BLOCK = 20  # steps: a minute, the samples of the intervals
ORDER, LAGS = 4, 10  # of the model of the errors; correlations that are shown
CANDIDATES = (1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1.0)  # q, (m/s)² per step
FLOOR = 1e-12  # (m/s)², below what fixes are rounded to
NAMES = ("measurement", "KF", "GLS", "intermediate", "coloured KF", "frozen", "re-taught", "hybrid")


@dataclass(frozen=True, eq=False)
class Track:
    """Speed vectors of a track and of its reference, (windows, steps, 2) m/s, north and east.

    Attributes
    ----------
    source, reference : str
        Where they come from, in words.
    """

    z: np.ndarray
    truth: np.ndarray
    source: str
    reference: str

    @property
    def errors(self) -> np.ndarray:
        """Measured less reference, (windows, steps, 2) m/s."""
        return self.z - self.truth


# ---------------------------------------------------------------- from fixes to speed vectors


def read(name: str, path: str, gap: float) -> Record:
    """Return the fixes of a file: NMEA 0183 if its first line is a sentence, else a table.

    Raises
    ------
    ParameterError
        As `seanav.records`, and if a gap between two fixes is longer than `gap` seconds.
    """
    if opened(name, path).lstrip()[:1] in ("$", "!"):
        record = read_nmea(name, path)
    else:
        record = read_csv(name, path, LAYOUTS, bounds=BOUNDS)
    record.check_gaps(gap)
    return record


def positions(record: Record, origin: tuple[float, float] | None = None) -> np.ndarray:
    """Return north and east of an origin (degrees; default: the first fix), (samples, 2) m."""
    if "north_m" in record.columns:
        return np.stack([record["north_m"], record["east_m"]], axis=1)
    latitude, longitude = (np.unwrap(np.radians(record[c])) for c in LAYOUTS[0])
    first = np.radians(origin) if origin else (latitude[0], longitude[0])
    R_n, R_t = earth.radii(float(first[0]))
    turns = 2 * np.pi * np.round((longitude[0] - first[1]) / (2 * np.pi))
    east = R_t * np.cos(first[0]) * (longitude - first[1] - turns)
    return np.stack([R_n * (latitude - first[0]), east], axis=1)


def speeds(time: np.ndarray, places: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Return the mean speed vector over each step between `moments`, (steps, 2) m/s.

    Positions (samples, 2) at `time` are interpolated linearly.
    """
    at = np.stack([np.interp(moments, time, component) for component in places.T], 1)
    return np.diff(at, axis=0) / np.diff(moments)[:, None]


def _fewest(scenario):
    return scenario.examination + 2 * BLOCK  # an interval needs two minutes


def _windows(scenario, v):
    """Cut speed vectors into windows of the scenario's steps, or one shorter one."""
    steps = min(max(scenario.steps, _fewest(scenario)), len(v))
    count = len(v) // steps
    return v[: count * steps].reshape(count, steps, 2)


def track(scenario: Scenario) -> Track:
    """Return the user's track, or that of a simulated ship if there is none.

    Raises
    ------
    ParameterError
        One line with the row: if a file cannot be used, the track is too short or too long, a
        speed is beyond the network's scale, or the two files have no common time.
    """
    if not scenario.track_file:
        if scenario.reference_file:
            allowed = "must be empty without track_file"
            raise ParameterError("reference_file", scenario.reference_file, allowed)
        return simulated(scenario)
    record = read("track_file", scenario.track_file, scenario.track_gap_s)
    moments = STEP * np.arange(int(record.span / STEP * (1 + 1e-12)) + 1)
    _demand_steps(scenario, record, len(moments) - 1)
    places = positions(record)
    z = speeds(record.time, places, moments)
    _demand_speeds(record, moments, z)
    if scenario.reference_file:
        truth, words = _from_file(scenario, record, moments)
    else:
        truth, words = _smoothed(scenario, record, places, moments)
    z, truth = (_windows(scenario, v) for v in (z, truth))
    return Track(z, truth, record.source, words)


def _demand_steps(scenario, record, steps):
    least = _fewest(scenario)
    if steps < least:
        allowed = f"must last at least {STEP * least:g} s (settle + pairs + {2 * BLOCK} steps)"
        raise ParameterError("track_file", record.source, f"{allowed}, lasts {record.span:g} s")
    if steps > MOST_STEPS:
        allowed = f"must last at most {STEP * MOST_STEPS:g} s, lasts {record.span:g} s"
        raise ParameterError("track_file", record.source, allowed)


def _demand_speeds(record, moments, v):
    beyond = np.flatnonzero((np.abs(v) >= FASTEST).any(axis=1))
    if beyond.size:
        k = int(beyond[0])
        sample = int(np.searchsorted(record.time, moments[k + 1]))
        how = f"{np.hypot(*v[k]):.3g} m/s from the fixes: each component must be below {FASTEST:g}"
        raise record.refuse(
            min(sample, len(record) - 1), f"{how} m/s; another unit, or an outlier?"
        )


def _smoothed(scenario, record, places, moments):
    window = 2 * int(scenario.reference_window_s / STEP / 2) + 1
    even = np.stack([np.interp(moments, record.time, x) for x in places.T], axis=1)
    window = min(window, len(even) - (len(even) + 1) % 2)
    smooth = savgol_filter(even, window, 2, axis=0)
    words = f"the track itself, smoothed over {STEP * window:g} s"
    return np.diff(smooth, axis=0) / STEP, words


def _from_file(scenario, record, moments):
    other = read("reference_file", scenario.reference_file, scenario.track_gap_s)
    if bool(record.start) != bool(other.start):
        allowed = "must have times like track_file's, both with a date or both without"
        raise ParameterError("reference_file", other.source, allowed)
    shift = 0.0
    if record.start:
        first, second = (np.datetime64(r.start[:26].split("+")[0]) for r in (record, other))
        shift = float((second - first) / np.timedelta64(1, "us")) / 1e6
    if shift > 0 or shift + other.span < moments[-1]:
        allowed = f"must cover the time of track_file, {moments[-1]:g} s from {record.start or '0'}"
        raise ParameterError("reference_file", other.source, allowed)
    truth = speeds(other.time + shift, positions(other), moments)
    _demand_speeds(other, moments - shift, truth)
    return truth, other.source


def simulated(scenario: Scenario) -> Track:
    """Return a track whose truth is known: the paper's courses, fixes every step.

    Each fix has white errors of such a size that the speeds from them have those of the
    scenario's `noise`: sqrt(2) standard deviations of a fix over a step.
    """
    steps = max(scenario.steps, _fewest(scenario))
    mine = attrs.evolve(scenario, steps=steps, runs=2)
    truth = np.stack([run.course(mine, name) for name in COURSES])
    shape = (steps + 1, 2)
    fix = scenario.noise * STEP / np.sqrt(2)
    errors = fix * montecarlo.normals(scenario.seed, "own track", len(truth), shape)
    words = "the simulated truth"
    return Track(truth + np.diff(errors, axis=1) / STEP, truth, "built in, simulated", words)


# ---------------------------------------------------------------- what the errors are like


def covariances(errors: np.ndarray, lags: int = LAGS) -> np.ndarray:
    """Return the autocovariance of errors (windows, steps, 2) at lags 0 … `lags`, pooled."""
    errors = errors - errors.mean(axis=1, keepdims=True)
    count = errors.shape[1]
    found = [
        (errors[:, k:] * errors[:, : count - k]).sum() for k in range(min(lags, count - 1) + 1)
    ]
    found[0] += errors.size * FLOOR  # a record without errors has a law, too
    return np.array(found) / errors.size


def correlation(errors: np.ndarray, lag: int = 1) -> Estimate:
    """Return the correlation of errors a `lag` apart, minutes of the windows as samples."""
    centred = errors - errors.mean(axis=1, keepdims=True)
    product = np.zeros_like(centred)
    product[:, lag:] = centred[:, lag:] * centred[:, :-lag]
    above, below = (_blocks(x) for x in (product, centred**2))
    ratio = above.mean() / below.mean()
    return estimates.from_influence(ratio, (above - ratio * below) / below.mean())


def _blocks(x):
    """Return means over minutes, (windows * minutes,), of (windows, steps, 2)."""
    count = x.shape[1] // BLOCK
    return x[:, : count * BLOCK].reshape(len(x), count, -1).mean(axis=2).ravel()


def autoregression(covariance: np.ndarray, order: int = ORDER) -> tuple[np.ndarray, float]:
    """Return the coefficients and noise variance of the Yule-Walker equations.

    Parameters
    ----------
    covariance : (lags + 1,) ndarray
        At lags 0, 1, …, at least `order` of them.
    """
    order = min(order, len(covariance) - 1)
    a = solve_toeplitz(covariance[:order], covariance[1 : order + 1])
    return a, float(covariance[0] - a @ covariance[1 : order + 1])


def coloured(z: np.ndarray, q: float, covariance: np.ndarray) -> np.ndarray:
    """Return the Kalman filter's estimate, (runs, steps, 2) m/s, with errors that are coloured.

    The state of each component holds the speed, a random walk of variance `q` per step, and
    the last errors of the measurement, an autoregression (`autoregression`).
    """
    a, variance = autoregression(covariance)
    n = len(a) + 1
    Phi, Q, P0 = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    Phi[0, 0], Phi[1, 1:], Q[0, 0], Q[1, 1] = 1.0, a, q, variance
    Phi[range(2, n), range(1, n - 1)] = 1.0
    lags = np.abs(np.subtract.outer(range(n - 1), range(n - 1)))
    P0[0, 0], P0[1:, 1:] = 100.0, covariance[lags]
    H = np.zeros((1, n))
    H[0, :2] = 1.0
    components = np.moveaxis(z, 2, 1).reshape(-1, z.shape[1], 1)
    start = np.zeros((len(components), n))
    offsets = np.zeros((z.shape[1], n))
    R = np.array([[1e-6 * covariance[0]]])  # the errors are states; what is left is rounding
    x = kalman.run(Phi, offsets, H, Q, R, start, P0, components).x[..., 0]
    return np.moveaxis(x.reshape(len(z), 2, -1), 1, 2)


# ---------------------------------------------------------------- every estimator on the track


def tuned(estimator: Any, own: Track, first: int) -> float:
    """Return the q of `CANDIDATES` with which an estimator of q is best in hindsight."""
    losses = [((estimator(q) - own.truth)[:, first:] ** 2).mean() for q in CANDIDATES]
    return CANDIDATES[int(np.argmin(losses))]


def scenario_of(scenario: Scenario, own: Track) -> Scenario:
    """Return the scenario with the track's own noise, windows and number of runs."""
    windows, steps = own.z.shape[:2]
    noise = float(np.clip(np.sqrt((own.errors**2).mean()), 1e-6, 10.0))
    return attrs.evolve(scenario, steps=steps, noise=noise, runs=max(2, windows * DRAWS))


def estimate(scenario: Scenario, own: Track) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Return the estimates of `NAMES`, (windows * draws, steps, 2) m/s, and the q of each filter.

    Every filter has the noise of this track and, in hindsight, the q that suits it best; the
    networks are taught by the intermediate filter so tuned, with `DRAWS` draws of their weights.
    """
    mine, first = scenario_of(scenario, own), scenario.examination

    def filtered(q, w1):
        return run.numerical(attrs.evolve(mine, q=q), own.z, w1)

    kinds = {"KF": 0.0, "GLS": 1.0, "intermediate": scenario.w1}
    q = {name: tuned(lambda q, w=w: filtered(q, w), own, first) for name, w in kinds.items()}
    covariance = covariances(own.errors)
    q["coloured KF"] = tuned(lambda q: coloured(own.z, q, covariance), own, first)
    found = {"measurement": own.z}
    found |= {name: filtered(q[name], w1) for name, w1 in kinds.items()}
    found["coloured KF"] = coloured(own.z, q["coloured KF"], covariance)
    found = {name: np.repeat(x, DRAWS, axis=0) for name, x in found.items()}
    z, teacher = found["measurement"], found["intermediate"]
    taught = run.first_teaching(mine, z, teacher, "own weights")
    for variant in ("frozen", "re-taught", "hybrid"):
        found[variant] = run.examine(mine, z, teacher, taught, variant)
    return {name: found[name] for name in NAMES}, q


def squares(scenario: Scenario, own: Track, x: np.ndarray) -> np.ndarray:
    """Return squared errors of the examinations, a mean over components, draws and each minute."""
    shape = (len(own.z), DRAWS, *own.z.shape[1:])
    squared = ((x.reshape(shape) - own.truth[:, None]) ** 2).mean(axis=1)
    return _blocks(squared[:, scenario.examination :])


def rows(scenario: Scenario, own: Track, found: dict[str, np.ndarray]) -> list[tuple]:
    """Return rows (estimator, RMSE, low, high, over the KF's, low, high), minutes as samples."""
    scored = {name: squares(scenario, own, x) for name, x in found.items()}
    listed = []
    for name, one in scored.items():
        rmse, ratio = estimates.root_mean_square(one), estimates.ratio(one, scored["KF"])
        listed.append((name, rmse.value, rmse.low, rmse.high, ratio.value, ratio.low, ratio.high))
    return listed


def about(own: Track, rows_of: list[tuple]) -> str:
    """Say how the networks compare with the Kalman filter on this track."""
    words = []
    for name, *_, ratio, low, high in rows_of:
        if name in ("frozen", "re-taught", "hybrid", "coloured KF"):
            how = (
                "better than" if high < 1 else "worse than" if low > 1 else "not clearly apart from"
            )
            words.append(f"{name} {how} the KF ({estimates.significant(ratio)} times its RMSE)")
    return f"{Path(own.source).name}: " + "; ".join(words) + "."
