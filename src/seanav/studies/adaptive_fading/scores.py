"""Paper 3: errors, ratios, exceedance, growth, with their intervals; operations counted."""

import numpy as np

from seanav import estimates
from seanav.estimates import ROUNDING, rms
from seanav.studies.adaptive_fading.run import Outcome, Problem
from seanav.studies.adaptive_fading.scenario import Scenario


def squares(errors: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Return each run's mean squared error over the chosen samples, (runs, n)."""
    return (errors[:, samples] ** 2).mean(axis=1)


def rmse(errors: np.ndarray, samples: np.ndarray, state: int) -> estimates.Estimate:
    """Return the RMSE of a state over runs and samples."""
    return estimates.root_mean_square(squares(errors, samples)[:, state])


def ratio(one: np.ndarray, other: np.ndarray, state: int | None = None) -> estimates.Estimate:
    """Return the ratio of two RMSEs, paired through the common noise.

    Parameters
    ----------
    one, other : ndarray (runs, n)
        Results of `squares`.
    state : int or None
        One state, or the geometric mean over all: the only mean that no unit changes.
    """
    logs = (rms(one) / rms(other)).log()
    chosen = logs.mean() if state is None else logs[state]
    return estimates.exponential(chosen.estimate())


def exceedance(beta: np.ndarray, samples: np.ndarray, limit: float) -> estimates.Estimate:
    """Return the share of samples at which β exceeds `limit`; an interval over runs."""
    return estimates.mean((beta[:, samples] > limit).mean(axis=1))


def mean_nees(nees: np.ndarray, samples: np.ndarray) -> estimates.Estimate:
    """Return the mean NEES over runs and samples."""
    return estimates.mean(nees[:, samples].mean(axis=1))


def growth(errors: np.ndarray, case: Problem, scenario: Scenario, state: int) -> estimates.Estimate:
    """Return the RMSE of the last 20 % of the run over that of the 20 % before it.

    Both are one period of the default fin signal, so a steady error gives 1.
    """
    length = 0.2 * scenario.duration
    late = case.times > scenario.duration - length
    early = (case.times > scenario.duration - 2 * length) & ~late
    return ratio(squares(errors, late), squares(errors, early), state)


def systematic_share(errors: np.ndarray, samples: np.ndarray, state: int) -> estimates.Estimate:
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
    return estimates.from_influence(bias / total, influence)


def table_rows(case: Problem, outcomes: dict[str, Outcome]) -> list:
    """Return rows (filter, state, unit, healthy RMSE and interval, faulty RMSE and interval)."""
    rows = []
    for name, outcome in outcomes.items():
        for i, (state, unit) in enumerate(zip(case.states, case.units, strict=True)):
            healthy = rmse(outcome.errors, case.healthy, i)
            faulty = rmse(outcome.errors, case.faulty, i)
            parts = [x for e in (healthy, faulty) for x in (e.value, e.low, e.high)]
            rows.append((name, state, unit, *parts))
    return rows


def larger_covariance(one: Outcome, other: Outcome, samples: np.ndarray) -> tuple:
    """Return how a filter's own covariance compares with another's.

    Returns
    -------
    trace : Estimate
        Mean over the samples of tr P over that of the other.
    least : Estimate
        Smallest eigenvalue of the difference over all runs and samples, in parts of the
        other's scale, an exact number: not below 0 if P is nowhere smaller in any direction.
    """
    P, reference = one.P[:, samples], other.P[:, samples]
    traces = np.trace(reference, axis1=-2, axis2=-1)
    ratio = (np.trace(P, axis1=-2, axis2=-1) / traces).mean(axis=1)
    # A correlation's scale: eigenvalues of differing units cannot be compared.
    spread = np.sqrt(np.diagonal(reference, axis1=-2, axis2=-1))
    scaled = (P - reference) / (spread[..., :, None] * spread[..., None, :])
    return estimates.mean(ratio), estimates.exact(np.linalg.eigvalsh(scaled).min(), ROUNDING)


def larger_gain(
    one: Outcome, other: Outcome, case: Problem, samples: np.ndarray
) -> estimates.Estimate:
    """Return the mean over the samples of tr H K over that of the other filter.

    K = P⁺ Hᵀ R⁻¹, with the covariance after the update; H K has no unit.
    """
    taken = case.H.T @ np.linalg.solve(case.R, case.H)
    gains = [np.einsum("...ij,ji", P[:, samples], taken) for P in (one.P, other.P)]
    return estimates.mean((gains[0] / gains[1]).mean(axis=1))


def decay(factors: np.ndarray, case: Problem, scenario: Scenario) -> estimates.Estimate | str:
    """Return the excess of the fading factors over one late after the fault over that early.

    Mean over the states and over the last fifth of the run, and over the fifth that follows
    the fault. The two must not overlap.
    """
    length = 0.2 * scenario.duration
    if scenario.fault_time + 2 * length > scenario.duration + 1e-9:
        return "two fifths of the run after the fault: so late a fault was not run"
    times = case.times
    early = (times > scenario.fault_time) & (times <= scenario.fault_time + length)
    late = times > scenario.duration - length
    excess = factors.mean(axis=2) - 1.0
    first, last = (estimates.average(excess[:, s].mean(axis=1)) for s in (early, late))
    if first.value == 0.0:
        return "an adaptation after the fault was not run: no test said fault"
    return (last / first).estimate()


def operations(n: int, m: int, method: str | None = None, window: int = 1) -> int:
    """Return the multiplications of one filter step with full matrices, runs apart.

    Counted from the equations as a program would do them; no timing enters, so the number
    is the same everywhere. Times are in the benchmark. Method "innovation" is the adaptation
    of the paper's introduction (IAE): Q is K C Kᵀ, with C the mean of ΔΔᵀ over the window.
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
    sample = window * m * (m + 1) // 2
    if method == "innovation":
        return plain + sample + n * m * m + n * n * m
    again = 2 * (n * n * m + m * (m + 1) // 2 * n) + factor + statistic
    factors = m if method == "single" else n * m * m
    return plain + again + sample + factors + n * (n + 1)
