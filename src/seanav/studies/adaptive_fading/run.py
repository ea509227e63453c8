"""Paper 3: truth, measurements and filters of both planes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seanav import montecarlo
from seanav.filters import adaptive, kalman
from seanav.models import vehicles
from seanav.studies.adaptive_fading.scenario import HEALTHY_FROM, PLANES, SETTLING, Scenario

# The second setting of the steering plane: noises that differ from state to state.
BASE = {"Q": (1e-5, 1e-5, 1e-7), "R": (0.05**2, 0.02**2, 0.02**2)}


class Problem(NamedTuple):
    """One plane under one setting: what the filters believe, and what is true."""

    plane: str
    states: tuple
    units: tuple
    times: np.ndarray  # (steps,) s, of the estimates
    Phi: np.ndarray  # (n, n)
    B: np.ndarray  # (n,) effect of the fin angle over one step, per radian
    H: np.ndarray  # (m, n)
    Q: np.ndarray  # (n, n)
    R: np.ndarray  # (m, m)
    P0: np.ndarray  # (n, n)
    believed: np.ndarray  # (steps, n) what the commanded fin adds
    actual: np.ndarray  # (steps, n) what the fin adds in truth
    healthy: np.ndarray  # (steps,) bool, samples of the healthy score
    faulty: np.ndarray  # (steps,) bool, samples of the score after the fault


def command(scenario: Scenario, fin: str | None = None) -> np.ndarray:
    """Return the fin angle that is held during each step, (steps,) rad."""
    t = np.arange(round(scenario.duration / scenario.dt)) * scenario.dt
    if (fin or scenario.fin) == "step":
        return np.full(len(t), scenario.fin_rad)
    return scenario.fin_rad * np.sin(2 * np.pi * t / scenario.fin_period)


def with_fault(scenario: Scenario, angles: np.ndarray, fault: str) -> np.ndarray:
    """Return the angle that the fin really has; from the fault on it is another one."""
    t = np.arange(len(angles)) * scenario.dt
    broken = {
        "none": angles,
        "loss": 0.0 * angles,
        "reversal": -angles,
        "half": 0.5 * angles,
        "bias": angles + scenario.bias_rad,
        "stuck": np.full_like(angles, scenario.stuck_rad),
    }[fault]
    return np.where(t >= scenario.fault_time - 1e-9, broken, angles)


def problem(
    scenario: Scenario,
    plane: str = "steering",
    *,
    fault: str | None = None,
    fin: str | None = None,
    measured: Sequence[str] | None = None,
    Q: Sequence[float] | None = None,
    R: Sequence[float] | None = None,
    units: ArrayLike | None = None,
) -> Problem:
    """Return the `Problem` of a plane; what is not given is the scenario's.

    Parameters
    ----------
    fault : {"none", "loss", "reversal", "half", "bias", "stuck"}
    fin : {"sine", "step"}
    measured : sequence of str
        Names of the measured states.
    Q, R : sequence of float
        Variances for each state; R of the measured ones is used.
    units : sequence of float
        Each state is multiplied by this number everywhere, Q, R and P0 with it.
    """
    model = PLANES[plane]
    scale = np.ones(len(model.states)) if units is None else np.asarray(units, float)
    Phi, B = model.discretise(scenario.dt, scenario.discretisation)
    Phi, B = Phi * scale[:, None] / scale, B * scale
    angles = command(scenario, fin)
    actual = with_fault(scenario, angles, fault or scenario.fault)
    given = [getattr(scenario, f"Q_{plane}") if Q is None else Q]
    given += [getattr(scenario, f"R_{plane}") if R is None else R]
    process, measurement = (np.diag(variances) * scale**2 for variances in given)
    H = scenario.measurement(plane, measured)
    times = np.arange(1, len(angles) + 1) * scenario.dt
    return Problem(
        plane, model.states, model.units, times, Phi, B, H, process, H @ measurement @ H.T,
        np.eye(len(B)) * scenario.initial_variance * scale**2,
        np.outer(angles, B), np.outer(actual, B),
        (times > HEALTHY_FROM) & (times <= scenario.fault_time),
        times > scenario.fault_time + SETTLING,
    )  # fmt: skip


class Noise(NamedTuple):
    """Common random numbers of all filters, faults and noise levels; unit variance."""

    process: np.ndarray  # (runs, steps, n)
    measurement: np.ndarray  # (runs, steps, n), one for each state, measured or not


def draw(
    scenario: Scenario, plane: str = "steering", purpose: str = "", runs: int | None = None
) -> Noise:
    """Draw the random numbers of a plane, one stream per run and purpose."""
    n = len(PLANES[plane].states)
    shape = (round(scenario.duration / scenario.dt), n)
    return Noise(
        *(
            montecarlo.normals(
                scenario.seed, f"{plane} {kind} {purpose}".strip(), runs or scenario.runs, shape
            )
            for kind in ("process", "measurement")
        )
    )


def rougher(case: Problem, noise: Noise, scenario: Scenario, factor: float) -> Noise:
    """Return the noise of a vehicle whose true Q is `factor` times larger from the fault on."""
    after = case.times > scenario.fault_time + 1e-9
    grown = np.where(after[:, None], np.sqrt(factor), 1.0)
    return noise._replace(process=noise.process * grown)


def simulate(case: Problem, noise: Noise) -> tuple[np.ndarray, ...]:
    """Return truth (runs, steps, n) and measurements (runs, steps, m) of a `Problem`."""
    process = noise.process * np.sqrt(np.diagonal(case.Q))
    start = np.zeros((len(process), len(case.B)))
    truth = vehicles.simulate(case.Phi, case.actual, process, start)
    z = truth @ case.H.T + noise.measurement @ case.H.T * np.sqrt(np.diagonal(case.R))
    return truth, z


def filters(scenario: Scenario) -> dict:
    """Return the compared filters: {name: options}, the fading ones at μ = 1 and the window."""
    names = {"OKF": {}}
    for method, short in (("single", "SFF"), ("multiple", "MFF")):
        for window in (1, scenario.window):
            names[f"{short}({window})"] = {"method": method, "window": window}
    return names | {"larger Q": {"scale": scenario.larger_Q}, "input bias": {"augmented": True}}


class Outcome(NamedTuple):
    """What one filter did in a batch of runs."""

    errors: np.ndarray  # (runs, steps, n)
    before: np.ndarray  # (runs, steps) β before adaptation
    after: np.ndarray  # (runs, steps) β after adaptation, the same for a fixed filter
    nees: np.ndarray  # (runs, steps)
    factors: np.ndarray | None  # (runs, steps, n)
    P: np.ndarray  # (runs, steps, n, n) the filter's own covariance of the errors


def with_input_bias(scenario: Scenario, case: Problem) -> tuple[np.ndarray, ...]:
    """Return the model (Phi, offsets, H, Q, P0) with one more state, a fin angle that is off.

    The bias is a random walk with `bias_walk_rad` per step, known to start near zero.
    """
    n, walk = len(case.B), scenario.bias_walk_rad**2
    Phi, Q, P0 = np.eye(n + 1), np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
    Phi[:n, :n], Phi[:n, n] = case.Phi, case.B
    Q[:n, :n], Q[n, n] = case.Q, walk
    P0[:n, :n], P0[n, n] = case.P0, walk
    offsets = np.hstack([case.believed, np.zeros((len(case.believed), 1))])
    return Phi, offsets, np.hstack([case.H, np.zeros((len(case.H), 1))]), Q, P0


def estimate(
    scenario: Scenario,
    case: Problem,
    z: np.ndarray,
    *,
    method: str | None = None,
    window: int = 1,
    scale: float = 1.0,
    augmented: bool = False,
    alpha: float | None = None,
    floor: float = 1.0,
    trigger: str | None = None,
) -> adaptive.AdaptiveTrack | kalman.Track:
    """Run one filter of `filters` on measurements (runs, steps, m)."""
    Phi, offsets, H, Q, P0 = case.Phi, case.believed, case.H, case.Q * scale, case.P0
    if augmented:
        Phi, offsets, H, Q, P0 = with_input_bias(scenario, case)
    x0 = np.zeros((len(z), len(Phi)))
    if method is None:
        return kalman.run(Phi, offsets, H, Q, case.R, x0, P0, z)
    return adaptive.run(
        Phi, offsets, H, Q, case.R, x0, P0, z, method=method, window=window,
        trigger=trigger or scenario.trigger, alpha=alpha or scenario.alpha, floor=floor,
    )  # fmt: skip


def compare(
    scenario: Scenario, case: Problem, noise: Noise, names: list[str] | None = None
) -> tuple:
    """Return the truth and the `Outcome` of every filter, or of those in `names`."""
    truth, z = simulate(case, noise)
    n = len(case.B)
    options = filters(scenario)

    def one(name):
        track = estimate(scenario, case, z, **options[name])
        errors = track.x[..., :n] - truth
        P = track.P[..., :n, :n]
        before, factors = getattr(track, "before", track.nis), getattr(track, "factors", None)
        return Outcome(errors, before, track.nis, kalman.nees(errors, P), factors, P)

    names = list(names or options)
    return truth, dict(zip(names, montecarlo.parallel_map(one, names), strict=True))
