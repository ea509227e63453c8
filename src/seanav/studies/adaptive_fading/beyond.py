"""Beyond paper 3: random settings, detection curves, what adaptation costs while healthy."""

from typing import NamedTuple

import numpy as np

from seanav import estimates, montecarlo
from seanav.filters import adaptive
from seanav.studies.adaptive_fading import run, scores
from seanav.studies.adaptive_fading.scenario import FAULTS, HEALTHY_FROM, Scenario

WINDOWS = (1, 5, 10, 20, 30)


MEASURED = (("v", "r", "psi"), ("r", "psi"), ("v", "r"))


ALPHAS = tuple(np.geomspace(1e-4, 0.3, 12))


class Setting(NamedTuple):
    """One random setting of the steering plane and what came of it."""

    fault: str
    fin: str
    measured: tuple
    window: int
    degrees: bool  # angles in degrees, as the filter sees them
    Q: tuple
    R: tuple
    ratios: dict  # {(one, other): Estimate of the RMSE ratio, geometric mean of the states}


def random_setting(generator: np.random.Generator) -> tuple:
    """Draw fault, fin signal, measured states, window, units and variances at random."""
    pick = generator.integers
    return (
        FAULTS[pick(len(FAULTS))],
        ("sine", "step")[pick(2)],
        MEASURED[pick(len(MEASURED))],
        WINDOWS[pick(len(WINDOWS))],
        bool(pick(2)),
        tuple(10.0 ** generator.uniform(-7, -3, 3)),
        tuple(10.0 ** generator.uniform(-6, -2, 3)),
    )


def sweep(scenario: Scenario) -> list[Setting]:
    """Return `scenario.settings` random settings of the steering plane with their ratios.

    Each has its own noise, `scenario.sweep_runs` runs of it. Compared after the fault:
    both fading filters at the same window, SFF as printed, and the three fixed filters.
    """
    settings = [
        random_setting(generator)
        for generator in montecarlo.streams(scenario.seed, "setting", scenario.settings)
    ]
    return montecarlo.parallel_map(
        lambda job: _one(scenario, *job), list(enumerate(settings)), label="random settings"
    )


def _one(scenario, index, setting):
    fault, fin, measured, window, degrees, Q, R = setting
    turn = 180 / np.pi
    case = run.problem(
        scenario, fault=fault, fin=fin, measured=measured, Q=Q, R=R,
        units=(1.0, turn, turn) if degrees else None,
    )  # fmt: skip
    noise = run.draw(scenario, purpose=f"setting {index}", runs=scenario.sweep_runs)
    truth, z = run.simulate(case, noise)
    options = {
        "OKF": {},
        "SFF(1)": {"method": "single"},
        "SFF": {"method": "single", "window": window},
        "MFF": {"method": "multiple", "window": window},
        "larger Q": {"scale": scenario.larger_Q},
        "input bias": {"augmented": True},
    }
    squares = {}
    for name, given in options.items():
        x = run.estimate(scenario, case, z, **given).x[..., : len(case.B)]
        squares[name] = scores.squares(x - truth, case.faulty)
    pairs = [("MFF", other) for other in options if other != "MFF"]
    pairs += [
        ("SFF", "OKF"),
        ("SFF(1)", "OKF"),
        ("SFF", "input bias"),
        ("input bias", "OKF"),
    ]
    ratios = {pair: scores.ratio(squares[pair[0]], squares[pair[1]]) for pair in pairs}
    return Setting(*setting, ratios)


def shares(settings: list[Setting], one: str, other: str) -> tuple:
    """Return the share of settings that `one` wins, and counts (wins, ties, losses) by interval."""
    ratios = [setting.ratios[one, other] for setting in settings]
    wins = sum(r.value < 1 for r in ratios)
    clear = (sum(r.high < 1 for r in ratios), sum(r.low > 1 for r in ratios))
    counts = (clear[0], len(ratios) - sum(clear), clear[1])
    return estimates.share(wins, len(ratios)), counts


CRITERIA = {
    "fault": lambda s: s.fault,
    "measured": lambda s: ", ".join(s.measured).replace("psi", "ψ"),
    "units of the angles": lambda s: "degrees" if s.degrees else "radians",
    "window μ (steps)": lambda s: s.window,
    "log₁₀ of largest / smallest Q": lambda s: _bin(np.log10(max(s.Q) / min(s.Q)), 1),
    "log₁₀ of mean R / mean Q": lambda s: _bin(np.log10(s.R).mean() - np.log10(s.Q).mean(), 2),
}


def _bin(number, width):
    """Return the ends of the bin of a number."""
    low = width * int(np.floor(number / width))
    return low, low + width


def binned_shares(settings: list[Setting], one: str, other: str) -> dict[str, list]:
    """Return the share of settings that `one` wins against `other`, in bins.

    Returns
    -------
    dict
        Criterion -> list of (bin, `Estimate` with Wilson's interval); a bin that no random
        setting fell into is not there. Means of R and Q are geometric.
    """
    tables = {}
    for criterion, of in CRITERIA.items():
        rows = []
        for place in sorted({of(setting) for setting in settings}):
            label = "{} to {}".format(*place) if isinstance(place, tuple) else str(place)
            chosen = [setting for setting in settings if of(setting) == place]
            rows.append((label, shares(chosen, one, other)[0]))
        tables[criterion] = rows
    return tables


class Detection(NamedTuple):
    """Delay against false alarms for one kind of fault, at each α."""

    alphas: np.ndarray  # (k,)
    false_alarms: np.ndarray  # (k,) share of healthy samples above the threshold
    delay: np.ndarray  # (k,) s, mean time to the first alarm, missed ones counted as the end
    missed: np.ndarray  # (k,) share of runs without an alarm to the end


def first_alarm(beta: np.ndarray, limit: float, dt: float) -> np.ndarray:
    """Return each run's time from the start of `beta` (runs, steps) to its first alarm, s.

    The first sample counts `dt`. Without an alarm the result is NaN.
    """
    alarm = beta > limit
    first = (alarm.argmax(axis=1) + 1) * dt
    return np.where(alarm.any(axis=1), first, np.nan)


def moving_sum(beta: np.ndarray, length: int) -> np.ndarray:
    """Return the sum of the latest `length` values along time, (runs, steps − length + 1)."""
    return np.lib.stride_tricks.sliding_window_view(beta, length, axis=1).sum(axis=-1)


def detection(
    scenario: Scenario, plane: str = "steering", alphas: tuple[float, ...] = ALPHAS
) -> dict[str, Detection]:
    """Return {fault: Detection} for the optimal filter's β, and for no fault at all."""
    noise = run.draw(scenario, plane)

    def one(fault):
        case = run.problem(scenario, plane, fault=fault)
        _, z = run.simulate(case, noise)
        beta = run.estimate(scenario, case, z).nis
        after = beta[:, case.times > scenario.fault_time]
        rows = []
        for alpha in alphas:
            limit = adaptive.threshold(alpha, len(case.H))
            first = first_alarm(after, limit, scenario.dt)
            missed = np.isnan(first)
            longest = after.shape[1] * scenario.dt
            delay = np.where(missed, longest, first).mean()
            rows.append(((beta[:, case.healthy] > limit).mean(), delay, missed.mean()))
        return Detection(np.array(alphas), *np.array(rows).T)

    faults = (*FAULTS, "none")
    return dict(zip(faults, montecarlo.parallel_map(one, faults), strict=True))


def healthy_cost(
    scenario: Scenario, plane: str = "steering", alphas: tuple[float, ...] = ALPHAS
) -> dict[str, list[estimates.Estimate]]:
    """Return {filter: [ratio of its healthy RMSE to the optimal filter's, for each α]}."""
    case = run.problem(scenario, plane, fault="none")
    truth, z = run.simulate(case, run.draw(scenario, plane))
    samples = case.times > HEALTHY_FROM
    optimal = scores.squares(run.estimate(scenario, case, z).x - truth, samples)
    fading = {n: o for n, o in run.filters(scenario).items() if "method" in o}

    def one(job):
        name, alpha = job
        x = run.estimate(scenario, case, z, **fading[name], alpha=alpha).x
        return scores.ratio(scores.squares(x - truth, samples), optimal)

    jobs = [(name, alpha) for name in fading for alpha in alphas]
    ratios = iter(montecarlo.parallel_map(one, jobs))
    return {name: [next(ratios) for _ in alphas] for name in fading}


def window_effect(
    scenario: Scenario, windows: tuple[int, ...] = (1, 2, 5, 10, 20, 30, 50)
) -> dict[tuple[str, str], list[estimates.Estimate]]:
    """Return {(method, noise): [ratio to the OKF after the fault, for each window]}."""
    noise = run.draw(scenario)
    result = {}
    settings: dict[str, dict] = {"iso": {}, "base": run.BASE}
    for label, given in settings.items():
        case = run.problem(scenario, **given)
        truth, z = run.simulate(case, noise)
        optimal = scores.squares(run.estimate(scenario, case, z).x - truth, case.faulty)
        for method in ("single", "multiple"):
            jobs: list[dict] = [{"method": method, "window": window} for window in windows]
            result[method, label] = [
                scores.ratio(
                    scores.squares(
                        run.estimate(scenario, case, z, **job).x - truth, case.faulty
                    ),
                    optimal,
                )
                for job in jobs
            ]  # fmt: skip
    return result


def unit_change(scenario: Scenario, name: str, factors: list[float]) -> list[estimates.Estimate]:
    """Return the ratio of a fading filter's RMSE with ψ in other units to that in radians.

    `factors` multiply ψ; 180/π makes it degrees. Geometric mean over the states.
    """
    noise = run.draw(scenario)
    options = run.filters(scenario)[name]
    squares = []
    for factor in (1.0, *factors):
        units = np.array([1.0, 1.0, factor])
        case = run.problem(scenario, units=units)
        truth, z = run.simulate(case, noise)
        errors = (run.estimate(scenario, case, z, **options).x - truth) / units
        squares.append(scores.squares(errors, case.faulty))
    return [scores.ratio(one, squares[0]) for one in squares[1:]]


def triggers(scenario: Scenario, cases: dict[str, tuple[run.Problem, run.Noise]]) -> list:
    """Return what the rules (41) and (24) do to each fading filter, and how often while healthy.

    Returns
    -------
    list of (setting, rule, filter, share of healthy samples adapted, ratios of the RMSE to the
    optimal filter's while healthy and after the fault), the last three `Estimate`
    """
    fading = {n: o for n, o in run.filters(scenario).items() if "method" in o}
    jobs = [(name, rule, f) for name in cases for rule in ("chi2", "trace") for f in fading]

    def one(job):
        name, rule, chosen = job
        case, noise = cases[name]
        truth, z = run.simulate(case, noise)
        track = run.estimate(scenario, case, z, **fading[chosen], trigger=rule)
        optimal = run.estimate(scenario, case, z).x - truth
        met = track.before > adaptive.threshold(scenario.alpha, len(case.H))
        if rule == "trace":
            met = (track.innovation**2).sum(axis=2) > predicted(case, track)
        rate = estimates.mean(met[:, case.healthy].mean(axis=1))
        ratios = [
            scores.ratio(scores.squares(track.x - truth, s), scores.squares(optimal, s))
            for s in (case.healthy, case.faulty)
        ]
        return name, rule, chosen, rate, *ratios

    return montecarlo.parallel_map(one, jobs, label="triggers")


def predicted(case: run.Problem, track: adaptive.AdaptiveTrack) -> np.ndarray:
    """Return tr(H P⁻ Hᵀ + R) with Q as it is, (runs, steps): the right side of (24)."""
    first = np.broadcast_to(case.P0, track.P[:, :1].shape)
    before = np.concatenate([first, track.P[:, :-1]], axis=1)
    S = case.H @ (case.Phi @ before @ case.Phi.T + case.Q) @ case.H.T + case.R
    return np.trace(S, axis1=-2, axis2=-1)


def changed_noise(scenario: Scenario, factor: float = 100.0) -> list:
    """Return what a true Q that grows `factor` times at the fault's time does, without a fault.

    Returns
    -------
    list of (filter, `Estimate`)
        RMSE of the optimal filter over that of one with the new Q, then of the fading
        filters over the optimal one's; geometric mean of the states.
    """
    case = run.problem(scenario, fault="none")
    truth, z = run.simulate(case, run.rougher(case, run.draw(scenario), scenario, factor))

    def squares(**options):
        errors = run.estimate(scenario, case, z, **options).x - truth
        return scores.squares(errors, case.faulty)

    optimal = squares()
    rows = [("OKF", scores.ratio(optimal, squares(scale=factor)))]
    fading = {n: o for n, o in run.filters(scenario).items() if "method" in o}
    return rows + [(n, scores.ratio(squares(**o), optimal)) for n, o in fading.items()]
