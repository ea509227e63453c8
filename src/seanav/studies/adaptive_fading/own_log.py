"""Paper 3 on a user's own log: a model, its test on healthy data, what would make it honest."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from seanav import estimates, montecarlo
from seanav.checks import ParameterError
from seanav.estimates import Estimate, significant
from seanav.filters import adaptive, kalman
from seanav.models import nomoto
from seanav.records import Record, read_csv
from seanav.studies.adaptive_fading.scenario import PLANES, Scenario

LAYOUTS = {
    "nomoto": (("rudder_deg", "yaw_rate_deg_s"),),
    "remus": (("rudder_deg", "sway_m_s", "yaw_rate_deg_s", "heading_deg"),),
}
BOUNDS = {
    "rudder_deg": (-90.0, 90.0),
    "yaw_rate_deg_s": (-60.0, 60.0),
    "sway_m_s": (-20.0, 20.0),
    "heading_deg": (-720.0, 720.0),
}
JITTER = 0.05  # of a step, allowed
FEWEST_FIRST, FEWEST_REST = 50, 200  # samples that a model is made of, and tested on
BLOCKS = 20  # of the rest: alarms in a row tell the same, blocks are taken for independent
SMALLEST = 1e-3  # share of the residuals' variance that Q and R have at least
SHIP = nomoto.Ship(K=0.2, T=3.0, cubic=60.0, rudder_rate=np.radians(6.0))
STEP, SAMPLES = 0.5, 1600  # s; of the built-in log
GYRO, WAVES = np.radians(0.05), np.radians(0.04)  # rad/s: its noise per sample, its pushes


@dataclass(frozen=True, eq=False)
class Log:
    """Command (samples,) rad and measurements (samples, m) in SI units, `dt` seconds apart."""

    source: str
    dt: float
    rudder: np.ndarray
    z: np.ndarray
    record: Record | None = None


@dataclass(frozen=True, eq=False)
class Model:
    """x(k+1) = Phi x(k) + B δ(k) + c + noise of covariance Q, all states measured with R.

    `found` holds what was identified, by name; empty for a model that was given.
    """

    states: tuple
    Phi: np.ndarray
    B: np.ndarray
    c: np.ndarray
    Q: np.ndarray
    R: np.ndarray
    found: dict[str, Estimate]


# ---------------------------------------------------------------- the log


def log(scenario: Scenario) -> Log:
    """Return the user's log, or that of a simulated ship if there is none.

    Raises
    ------
    ParameterError
        One line, with the row where there is one: if the file cannot be used, its steps are not
        even, it is too short, or its first part says nothing of the rudder's effect.
    """
    if not scenario.log_file:
        return simulated(scenario)
    record = read_csv("log_file", scenario.log_file, LAYOUTS[scenario.log_model], bounds=BOUNDS)
    steps = np.diff(record.time)
    dt = float(np.median(steps))
    uneven = np.flatnonzero(np.abs(steps - dt) > JITTER * dt)
    if uneven.size:
        k = int(uneven[0])
        allowed = (
            f"{steps[k]:g} s after row {record.rows[k]}: steps must be even, most are {dt:g} s"
        )
        raise record.refuse(k + 1, allowed)
    rudder = np.radians(record["rudder_deg"])
    columns = LAYOUTS[scenario.log_model][0][1:]
    z = np.stack([record[c] if c == "sway_m_s" else np.radians(record[c]) for c in columns], axis=1)
    if "heading_deg" in columns:
        z[:, -1] = np.unwrap(z[:, -1])
        z[:, -1] -= z[0, -1]
    own = Log(record.source, dt, rudder, z, record)
    first = split(scenario, own)
    if first < FEWEST_FIRST or len(z) - first < FEWEST_REST:
        allowed = (
            f"must have at least {FEWEST_FIRST} samples in its first part (log_share) and "
            f"{FEWEST_REST} in the rest, has {first} and {len(z) - first}"
        )
        raise ParameterError("log_file", record.source, allowed)
    if scenario.log_model == "nomoto":
        _demand_motion(own, first)
        identify(own, first)  # refuses what has no model
    elif scenario.discretisation == "euler" and dt >= PLANES["steering"].euler_limit():
        limit = PLANES["steering"].euler_limit()
        allowed = f"must have steps below {limit:.3f} s for Euler's rule, has {dt:g} s"
        raise ParameterError("log_file", record.source, allowed)
    return own


def split(scenario: Scenario, own: Log) -> int:
    """Return the number of samples in the first part."""
    return int(scenario.log_share * len(own.z))


def _demand_motion(own, first):
    for what, x, least in (
        ("rudder_deg", own.rudder, np.radians(0.5)),
        ("yaw_rate_deg_s", own.z[:, 0], 1e-9),
    ):
        if np.ptp(x[: first - 1]) < least:
            allowed = f"{what} must move in the first {first} rows: it says nothing of K and T"
            raise ParameterError("log_file", own.source, allowed)


def simulated(scenario: Scenario) -> Log:
    """Return the log of a ship whose damping is cubic: gentle zigzags first, then hard ones."""
    pushes, noise = montecarlo.normals(scenario.seed, "own log", 2, (SAMPLES,))
    angles = np.where(np.arange(SAMPLES) < scenario.log_share * SAMPLES, 5.0, 20.0)
    rudder, rate = nomoto.zigzag(SHIP, np.radians(angles), STEP, WAVES * pushes)
    return Log("built in, simulated", STEP, rudder, (rate + GYRO * noise)[:, None])


# ---------------------------------------------------------------- the model


def identify(own: Log, first: int) -> Model:
    """Fit r(k+1) = a r(k) + b δ(k) + c to the first samples by least squares.

    K = b / (1 − a) and T = −dt / ln a have intervals by the delta method. Of the residuals'
    variance, Q and R get what their correlation with the next one says: it is −a R.

    Raises
    ------
    ParameterError
        If a does not lie between 0 and 1.
    """
    rate, rudder = own.z[:first, 0], own.rudder[: first - 1]
    X = np.stack([rate[:-1], rudder, np.ones(first - 1)], axis=1)
    (a, b, c), *_ = np.linalg.lstsq(X, rate[1:], rcond=None)
    if not 0 < a < 1:
        allowed = f"its first {first} samples give a = {a:.3g} (Nomoto's exp(-dt / T)), not 0 to 1"
        raise ParameterError("log_file", own.source, allowed)
    residual = rate[1:] - X @ [a, b, c]
    freedom = len(residual) - 3
    C = residual @ residual / freedom * np.linalg.inv(X.T @ X)
    t = float(norm.ppf(0.975))

    def number(value, gradient):
        se = float(np.sqrt(np.array(gradient) @ C @ gradient))
        return Estimate(float(value), float(value - t * se), float(value + t * se), se, freedom)

    found = {
        "a": number(a, [1.0, 0.0, 0.0]),
        "K (1/s)": number(b / (1 - a), [b / (1 - a) ** 2, 1 / (1 - a), 0.0]),
        "T (s)": number(-own.dt / np.log(a), [own.dt / (a * np.log(a) ** 2), 0.0, 0.0]),
        "c (rad/s)": number(c, [0.0, 0.0, 1.0]),
    }
    variance = float(residual @ residual / freedom)
    R = max(-float(residual[1:] @ residual[:-1]) / freedom / a, SMALLEST * variance)
    Q = max(variance - (1 + a**2) * R, SMALLEST * variance)
    one = np.ones((1, 1))
    return Model(("r",), a * one, b * one[0], c * one[0], Q * one, R * one, found)


def model(scenario: Scenario, own: Log) -> Model:
    """Return the identified Nomoto model, or the paper's vehicle with the scenario's noises."""
    if scenario.log_model == "nomoto" or not scenario.log_file:
        return identify(own, split(scenario, own))
    plane = PLANES["steering"]
    Phi, B = plane.discretise(own.dt, scenario.discretisation)
    Q, R = np.diag(scenario.Q_steering), np.diag(scenario.R_steering)
    return Model(plane.states, Phi, B, np.zeros(len(B)), Q, R, {})


# ---------------------------------------------------------------- the test on the rest


def filtered(scenario: Scenario, own: Log, by: Model, **changes: Any) -> Any:
    """Run the optimal filter on the rest of the log, or a fading one if a `method` is given.

    `Q` and `R` in `changes` are factors of the model's; the rest goes to
    `seanav.filters.adaptive.run`. Index 0 of the track is the second sample of the rest.
    """
    first = split(scenario, own)
    z, rudder = own.z[first:], own.rudder[first:-1]
    offsets = rudder[:, None] * by.B + by.c
    Q, R = changes.pop("Q", 1.0) * by.Q, changes.pop("R", 1.0) * by.R
    H = np.eye(len(by.B))
    given = (by.Phi, offsets, H, Q, R, z[None, 0], R, z[None, 1:])
    return adaptive.run(*given, **changes) if changes else kalman.run(*given)


def blocks(x: np.ndarray) -> np.ndarray:
    """Return the means of `BLOCKS` stretches of a series (steps,)."""
    return np.array([part.mean() for part in np.array_split(x, BLOCKS)])


def alarms(scenario: Scenario, statistic: np.ndarray, states: int) -> Estimate:
    """Return the share of steps whose β exceeds the threshold, stretches as samples."""
    limit = adaptive.threshold(scenario.alpha, states)
    return estimates.mean(blocks((statistic > limit).astype(float)))


def honest(scenario: Scenario, own: Log, by: Model, which: str) -> float | None:
    """Return the factor of Q or R that makes the alarm rate `alpha`; None: none does."""

    def excess(power):
        nis = filtered(scenario, own, by, **{which: 10.0**power}).nis[0]
        limit = adaptive.threshold(scenario.alpha, len(by.B))
        return float((nis > limit).mean()) - scenario.alpha

    low, high = -6.0, 8.0
    if excess(low) * excess(high) >= 0:
        return None
    return float(10.0 ** brentq(excess, low, high, xtol=1e-3))


def rows(scenario: Scenario, own: Log, by: Model) -> list[tuple]:
    """Return rows (filter, alarm rate, low, high, prediction error over the OKF's, low, high).

    The prediction error is that of the next measurement, summed over the measured states in
    units of R.
    """
    options = {"method": "single", "trigger": scenario.trigger, "alpha": scenario.alpha}
    tracks = {"OKF": filtered(scenario, own, by)}
    for window in dict.fromkeys((1, scenario.window)):
        tracks[f"SFF({window})"] = filtered(scenario, own, by, **options, window=window)
        many = options | {"method": "multiple"}
        tracks[f"MFF({window})"] = filtered(scenario, own, by, **many, window=window)
    for which in ("Q", "R"):
        if factor := honest(scenario, own, by, which):
            track = filtered(scenario, own, by, **{which: factor})
            tracks[f"OKF, {which} x {significant(factor)}"] = track
    scale = np.diagonal(by.R)
    errors = {n: blocks((t.innovation[0] ** 2 / scale).sum(axis=1)) for n, t in tracks.items()}
    listed = []
    for name, track in tracks.items():
        rate = alarms(scenario, getattr(track, "before", track.nis)[0], len(by.B))
        ratio = estimates.ratio(errors[name], errors["OKF"])
        numbers = (rate.value, max(rate.low, 0.0), min(rate.high, 1.0))
        listed.append((name, *numbers, ratio.value, ratio.low, ratio.high))
    return listed
