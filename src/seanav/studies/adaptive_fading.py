"""Paper 3: Kalman filters with fading factors under actuator faults of an AUV.

Hajiyev, Vural and Hajiyeva. The scenario, the Monte-Carlo runs of both planes and their
scores. The random sweep and the detection curves are in
`seanav.studies.adaptive_sweep`.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from seanav import checks, montecarlo
from seanav.filters import adaptive, kalman
from seanav.models import vehicles

FAULTS = ("loss", "reversal", "half", "bias", "stuck")
HEALTHY_FROM = 5.0  # s, when the start is forgotten
SETTLING = 2.0  # s after the fault that no score counts

# The second setting of the steering plane: noises that differ from state to state.
BASE = {"Q": (1e-5, 1e-5, 1e-7), "R": (0.05**2, 0.02**2, 0.02**2)}


@dataclass(frozen=True)
class Scenario:
    """Everything that can be chosen, checked at once; units are in the names.

    Raises
    ------
    seanav.checks.ParameterError
        One line that names the parameter, its value and what is allowed.
    """

    runs: int = 100
    seed: int = 3
    dt: float = 0.1
    duration: float = 100.0
    fault_time: float = 50.0
    fault: str = "loss"
    discretisation: str = "euler"
    fin: str = "sine"
    fin_rad: float = 0.2
    fin_period: float = 20.0
    bias_rad: float = 0.1
    stuck_rad: float = 0.2
    Q_steering: tuple = (1e-5, 1e-5, 1e-5)
    R_steering: tuple = (1e-4, 1e-4, 1e-4)
    Q_diving: tuple = (1e-5, 1e-5, 1e-5, 1e-5)
    R_diving: tuple = (1e-4, 1e-4, 1e-4, 1e-4)
    measured_steering: tuple = ("v", "r", "psi")
    measured_diving: tuple = ("w", "q", "theta", "z")
    initial_variance: float = 1e-2
    alpha: float = 0.05
    window: int = 20
    trigger: str = "chi2"
    larger_Q: float = 100.0
    bias_walk_rad: float = 0.01
    settings: int = 300
    sweep_runs: int = 20

    def __post_init__(self):
        integer, number, choice = checks.integer, checks.number, checks.choice
        integer("runs", self.runs, at_least=2)
        integer("seed", self.seed, at_least=0)
        number("dt", self.dt, above=0)
        choice("discretisation", self.discretisation, ("euler", "exact"))
        number("duration", self.duration, at_least=40, at_most=1e4)
        first, last = HEALTHY_FROM + 10, self.duration - SETTLING - 10
        number("fault_time", self.fault_time, at_least=first, at_most=last)
        choice("fault", self.fault, FAULTS)
        choice("fin", self.fin, ("sine", "step"))
        for name in ("fin_rad", "bias_rad", "stuck_rad"):
            number(name, getattr(self, name), at_least=-0.6, at_most=0.6)
        number("fin_period", self.fin_period, above=0)
        number("initial_variance", self.initial_variance, above=0)
        number("alpha", self.alpha, above=0, below=1)
        integer("window", self.window, at_least=1)
        choice("trigger", self.trigger, ("chi2", "trace"))
        number("larger_Q", self.larger_Q, at_least=1)
        number("bias_walk_rad", self.bias_walk_rad, above=0)
        integer("settings", self.settings, at_least=4)
        integer("sweep_runs", self.sweep_runs, at_least=2)
        for plane in PLANES:
            self._check_plane(plane)

    def _check_plane(self, plane):
        n, limit = len(PLANES[plane].states), PLANES[plane].euler_limit()
        if self.discretisation == "euler" and self.dt >= limit:
            allowed = f"must be below {limit:.3f} s, where Euler's rule makes {plane} unstable"
            raise checks.ParameterError("dt", self.dt, allowed)
        for letter in "QR":
            name = f"{letter}_{plane}"
            values = _sequence(name, getattr(self, name), f"{n} variances")
            if len(values) != n:
                raise checks.ParameterError(name, values, f"must be a list of {n} variances")
            values = tuple(checks.number(name, value, at_least=0) for value in values)
            if letter == "R" and min(values) == 0:
                raise checks.ParameterError(name, values, "must be above 0 in every place")
            object.__setattr__(self, name, values)
        name = f"measured_{plane}"
        measured = _sequence(name, getattr(self, name), "names of states")
        object.__setattr__(self, name, measured)
        if not measured:
            raise checks.ParameterError(name, measured, "must name at least one state")
        for state in measured:
            checks.choice(name, state, PLANES[plane].states)
        if len(set(measured)) < len(measured):
            allowed = "must name each state once, or H has not full row rank"
            raise checks.ParameterError(name, measured, allowed)
        case = problem(self, plane)
        adaptive.weights(case.H, case.Q, "multiple")  # refuses a singular H G Q Gᵀ Hᵀ

    def quick(self):
        """Return the scenario with a tenth of the runs and settings, twenty at least."""
        return replace(
            self,
            runs=min(self.runs, max(20, self.runs // 10)),
            settings=max(4, self.settings // 10),
        )


def _sequence(name, value, meaning):
    if isinstance(value, (str, bytes)) or not hasattr(value, "__iter__"):
        raise checks.ParameterError(name, value, f"must be a list of {meaning}")
    return tuple(value)


PLANES = {"steering": vehicles.steering(), "diving": vehicles.diving()}


# The problem ---------------------------------------------------------------------------


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


def command(scenario, fin=None):
    """Return the fin angle that is held during each step, (steps,) rad."""
    t = np.arange(round(scenario.duration / scenario.dt)) * scenario.dt
    if (fin or scenario.fin) == "step":
        return np.full(len(t), scenario.fin_rad)
    return scenario.fin_rad * np.sin(2 * np.pi * t / scenario.fin_period)


def with_fault(scenario, angles, fault):
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


def problem(scenario, plane="steering", *, fault=None, fin=None, measured=None, Q=None, R=None,
            units=None):  # fmt: skip
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
    Q = np.diag(getattr(scenario, f"Q_{plane}") if Q is None else Q) * scale**2
    R = np.diag(getattr(scenario, f"R_{plane}") if R is None else R) * scale**2
    H = np.eye(len(B))[
        [model.states.index(s) for s in measured or getattr(scenario, f"measured_{plane}")]
    ]
    times = np.arange(1, len(angles) + 1) * scenario.dt
    return Problem(
        plane, model.states, model.units, times, Phi, B, H, Q, H @ R @ H.T,
        np.eye(len(B)) * scenario.initial_variance * scale**2,
        np.outer(angles, B), np.outer(actual, B),
        (times > HEALTHY_FROM) & (times <= scenario.fault_time),
        times > scenario.fault_time + SETTLING,
    )  # fmt: skip


class Noise(NamedTuple):
    """Common random numbers of all filters, faults and noise levels; unit variance."""

    process: np.ndarray  # (runs, steps, n)
    measurement: np.ndarray  # (runs, steps, n), one for each state, measured or not


def draw(scenario, plane="steering", purpose="", runs=None):
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


def simulate(case, noise):
    """Return truth (runs, steps, n) and measurements (runs, steps, m) of a `Problem`."""
    process = noise.process * np.sqrt(np.diagonal(case.Q))
    start = np.zeros((len(process), len(case.B)))
    truth = vehicles.simulate(case.Phi, case.actual, process, start)
    z = truth @ case.H.T + noise.measurement @ case.H.T * np.sqrt(np.diagonal(case.R))
    return truth, z


# The filters -----------------------------------------------------------------------------


def filters(scenario):
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


def with_input_bias(scenario, case):
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


def estimate(scenario, case, z, *, method=None, window=1, scale=1.0, augmented=False, alpha=None,
             floor=1.0):  # fmt: skip
    """Run one filter of `filters` on measurements (runs, steps, m)."""
    Phi, offsets, H, Q, P0 = case.Phi, case.believed, case.H, case.Q * scale, case.P0
    if augmented:
        Phi, offsets, H, Q, P0 = with_input_bias(scenario, case)
    x0 = np.zeros((len(z), len(Phi)))
    if method is None:
        return kalman.run(Phi, offsets, H, Q, case.R, x0, P0, z)
    options = {"trigger": scenario.trigger, "alpha": alpha or scenario.alpha, "floor": floor}
    return adaptive.run(
        Phi, offsets, H, Q, case.R, x0, P0, z, method=method, window=window, **options
    )


def run(scenario, case, noise, names=None):
    """Return the truth and the `Outcome` of every filter, or of those in `names`."""
    truth, z = simulate(case, noise)
    n = len(case.B)
    options = filters(scenario)

    def one(name):
        track = estimate(scenario, case, z, **options[name])
        errors = track.x[..., :n] - truth
        nees = kalman.nees(errors, track.P[..., :n, :n])
        before = getattr(track, "before", track.nis)
        return Outcome(errors, before, track.nis, nees, getattr(track, "factors", None))

    names = list(names or options)
    return truth, dict(zip(names, montecarlo.parallel_map(one, names), strict=True))


# Scores ----------------------------------------------------------------------------------


def squares(errors, samples):
    """Return each run's mean squared error over the chosen samples, (runs, n)."""
    return (errors[:, samples] ** 2).mean(axis=1)


def rmse(errors, samples, state):
    """Return the RMSE of a state over runs and samples."""
    return montecarlo.root_mean_square(squares(errors, samples)[:, state])


def ratio(one, other, states=None):
    """Return the ratio of two RMSEs, paired through the common noise.

    Parameters
    ----------
    one, other : ndarray (runs, n)
        Results of `squares`.
    states : int or None
        One state, or the geometric mean over all: the only mean that no unit changes.
    """
    chosen = slice(None) if states is None else slice(states, states + 1)
    a, b = one[:, chosen], other[:, chosen]
    log = 0.5 * np.log(a.mean(axis=0) / b.mean(axis=0)).mean()
    influence = 0.5 * (a / a.mean(axis=0) - b / b.mean(axis=0)).mean(axis=1)
    log = montecarlo.from_influence(log, influence)
    value, low, high = np.exp([log.value, log.low, log.high])
    return montecarlo.Estimate(value, low, high, value * log.se, log.count)


def exceedance(beta, samples, limit):
    """Return the share of samples at which β exceeds `limit`; an interval over runs."""
    return montecarlo.mean((beta[:, samples] > limit).mean(axis=1))


def mean_nees(nees, samples):
    """Return the mean NEES over runs and samples."""
    return montecarlo.mean(nees[:, samples].mean(axis=1))


def growth(errors, case, scenario, state):
    """Return the RMSE of the last 20 % of the run over that of the 20 % before it.

    Both are one period of the default fin signal, so a steady error gives 1.
    """
    length = 0.2 * scenario.duration
    late = case.times > scenario.duration - length
    early = (case.times > scenario.duration - 2 * length) & ~late
    return ratio(squares(errors, late), squares(errors, early), state)


def systematic_share(errors, samples, state):
    """Return the share of the mean squared error that is the same in all runs.

    The mean over runs, squared, less what chance alone gives it; 0 for an estimate that
    is right on average at every moment.
    """
    e = errors[:, samples, state]
    runs = len(e)
    mean = e.mean(axis=0)
    total = (e**2).mean()
    # Unbiased: mean² exceeds the squared bias by variance / runs on average.
    bias = (mean**2 - e.var(axis=0, ddof=1) / runs).mean()
    influence = (2 * mean * (e - mean)).mean(axis=1) / total
    influence -= bias / total**2 * ((e**2).mean(axis=1) - total)
    return montecarlo.from_influence(bias / total, influence)


def table_rows(case, outcomes):
    """Return rows (filter, state, unit, healthy RMSE and interval, faulty RMSE and interval)."""
    rows = []
    for name, outcome in outcomes.items():
        for i, (state, unit) in enumerate(zip(case.states, case.units, strict=True)):
            healthy = rmse(outcome.errors, case.healthy, i)
            faulty = rmse(outcome.errors, case.faulty, i)
            parts = [x for e in (healthy, faulty) for x in (e.value, e.low, e.high)]
            rows.append((name, state, unit, *parts))
    return rows


def operations(n, m, method=None, window=1):
    """Return the multiplications of one filter step with full matrices, runs apart.

    Counted from the equations as a program would do them; no timing enters, so the number
    is the same everywhere. Times are in the benchmark.
    """
    propagate = n * n + n * n * n + n * n * (n + 1) // 2
    innovate = m * n + n * n * m + m * (m + 1) // 2 * n
    factor = m * (m + 1) * (m + 2) // 6
    statistic = m * (m + 1) // 2 + m
    gain = n * m * (m + 1)
    joseph = n * n * m + n**3 + n * (n + 1) // 2 * (n + m * m)
    plain = propagate + innovate + factor + statistic + gain + n * m + joseph
    if method is None:
        return plain
    # The innovation's covariance twice more, its factor and statistic once more.
    again = 2 * (n * n * m + m * (m + 1) // 2 * n) + factor + statistic
    sample = window * m * (m + 1) // 2
    factors = m if method == "single" else n * m * m
    return plain + again + sample + factors + n * (n + 1)


def origins(scenario):
    """Return rows (name, value, unit, origin, note) of all parameters and coefficients."""
    assumed = ("assumed", "the paper gives no number")
    notes = {
        "runs": ("", *assumed), "seed": ("", *assumed), "dt": ("s", *assumed),
        "duration": ("s", *assumed), "fault_time": ("s", *assumed), "fault": ("", *assumed),
        "discretisation": ("", "text", "(7) and (13)"), "fin": ("", *assumed),
        "fin_rad": ("rad", *assumed), "fin_period": ("s", *assumed), "bias_rad": ("rad", *assumed),
        "stuck_rad": ("rad", *assumed), "Q_steering": ("SI²", *assumed),
        "R_steering": ("SI²", *assumed), "Q_diving": ("SI²", *assumed),
        "R_diving": ("SI²", *assumed), "measured_steering": ("", *assumed),
        "measured_diving": ("", *assumed), "initial_variance": ("SI²", *assumed),
        "alpha": ("", *assumed), "window": ("steps", *assumed),
        "trigger": ("", "text", "(39)–(41); (24) is the other one"),
        "larger_Q": ("", "assumed", "our baseline"),
        "bias_walk_rad": ("rad/step", "assumed", "our baseline"),
        "settings": ("", "assumed", "our sweep"), "sweep_runs": ("", "assumed", "our sweep"),
    }  # fmt: skip
    rows = []
    for name, (unit, origin, *note) in notes.items():
        value = getattr(scenario, name)
        value = " ".join(map(str, value)) if isinstance(value, tuple) else value
        rows.append((name, value, unit, origin, *note))
    rows += [(name, *row) for name, row in vehicles.COEFFICIENTS.items()]
    return rows
