"""Paper 5's scores: what a Monte-Carlo run gave, and paired comparisons of two of them."""

from dataclasses import dataclass, replace

import numpy as np
from contourpy import contour_generator
from scipy.stats import kendalltau, spearmanr

from seanav import estimates, montecarlo
from seanav.models import gravity
from seanav.models.units import KM, MGAL
from seanav.studies.gravity_planning.scenario import Scenario

FEWEST = 30  # runs from which on five coefficients can be fitted to them
TIE = "the paths are equally good: there is no order of them"


def without_matched(statistic: estimates.Statistic, initial: np.ndarray) -> estimates.Statistic:
    """Return a score with the error that is left when the initial errors' moments are matched.

    The mean and the covariance of the initial errors over the runs are no longer random, so
    the part of a score's sampling error that is linear in them is gone: its influence is
    what a linear fit of it on e, n, e² − 1, n² − 1 and e·n leaves. With too few runs for
    the fit nothing is taken off, and the interval is too wide.

    Parameters
    ----------
    statistic : Statistic
    initial : ndarray, shape (runs, 2)
        Initial errors in units of their standard deviation; their moments match.

    References
    ----------
    P. Glasserman, *Monte Carlo Methods in Financial Engineering*, Springer, 2004, sections
    4.1 and 4.5: moment matching is asymptotically a regression on control variates.
    """
    runs, (e, n) = len(initial), initial.T
    if runs < FEWEST:
        return statistic
    controls = np.column_stack([e, n, e**2 - 1.0, n**2 - 1.0, e * n])
    fit = controls @ np.linalg.lstsq(controls, statistic.influence, rcond=None)[0]
    lost = np.sqrt((runs - 1) / (runs - 1 - controls.shape[1]))  # degrees of freedom
    return estimates.Statistic(statistic.value, lost * (statistic.influence - fit))


@dataclass(frozen=True)
class Score:
    """What a Monte-Carlo run along one path gave; RMSE is two-dimensional, in m."""

    squared: np.ndarray  # (runs, samples) squared position errors, m²
    bound: np.ndarray  # (samples,) root of the trace of the PCRB, m
    length: float  # m
    initial: np.ndarray | None = None  # (runs, 2) of unit variance, if their moments match

    @property
    def drawn(self) -> "Score":
        """The same runs with the intervals that they have if no moments are matched."""
        return replace(self, initial=None)

    @property
    def rms(self) -> estimates.Statistic:
        """RMSE at every sample, (samples,) m, with each run's contribution to its error."""
        each = estimates.rms(self.squared)
        return each if self.initial is None else without_matched(each, self.initial)

    @property
    def rmse(self) -> np.ndarray:
        """RMSE at every sample, (samples,) m."""
        return np.sqrt(self.squared.mean(axis=0))

    @property
    def sum(self) -> estimates.Statistic:
        """Sum of RMSE over the samples, m, with each run's contribution to its error."""
        return self.rms.sum()

    @property
    def total(self) -> estimates.Estimate:
        """Sum of RMSE over the samples, an `Estimate` in m."""
        return self.sum.estimate()

    @property
    def over_bound(self) -> estimates.Estimate:
        """Sum of RMSE over the sum of the root PCRB, an `Estimate`."""
        return (self.sum / self.bound.sum()).estimate()

    @property
    def lost(self) -> np.ndarray:
        """Which runs end more than 1 km and four bounds away from the truth, (runs,) bool."""
        return self.squared[:, -1] > max(KM, 4 * self.bound[-1]) ** 2

    @property
    def diverged(self) -> int:
        """Number of runs that end `lost`."""
        return int(self.lost.sum())

    def sample(self, distance_km: float) -> int:
        """Index of the sample nearest to a distance along the path."""
        return round(min(distance_km * KM / self.length, 1.0) * (len(self.bound) - 1))

    def at(self, distance_km: float) -> estimates.Estimate:
        """RMSE at a distance along the path, an `Estimate` in m."""
        return self.rms[self.sample(distance_km)].estimate()

    def band(self) -> tuple[np.ndarray, ...]:
        """Return the ends of the RMSE's 95 % interval at every sample, two arrays (samples,) m."""
        each = self.rms
        points = [each[k].estimate() for k in range(len(self.bound))]
        return np.array([p.low for p in points]), np.array([p.high for p in points])


# Comparisons, all paired through the common noise ------------------------------------------


def ratio(one: Score, other: Score) -> estimates.Estimate:
    """Return the ratio of two paths' sums of RMSE, an `Estimate`."""
    return (one.sum / other.sum).estimate_of_log()


def ratio_at(one: Score, other: Score, distance_km: float) -> estimates.Estimate:
    """Return the ratio of two paths' RMSE at the same distance sailed, an `Estimate`."""
    a, b = (score.rms[score.sample(distance_km)] for score in (one, other))
    return (a / b).estimate_of_log()


def lowest_ratio(one: Score, other: Score) -> estimates.Estimate:
    """Return the ratio of two paths' smallest RMSE, each wherever it is, an `Estimate`."""
    a, b = (score.rms[int(np.argmin(score.rmse))] for score in (one, other))
    return (a / b).estimate_of_log()


def growth(scores: dict[str, list[Score]], reading: str) -> estimates.Estimate:
    """Return how the planned path's gain over the direct one grows from least to most noise.

    Parameters
    ----------
    reading : {"absolute", "relative"}
        Difference of the sums (km), or log of their ratio.
    """
    ends = [(scores["Planned"][k].sum, scores["Direct"][k].sum) for k in (0, -1)]
    if reading == "relative":
        least, most = ((direct / planned).log() for planned, direct in ends)
    else:
        least, most = ((direct - planned) / KM for planned, direct in ends)
    return (most - least).estimate()


def best_other(scores: dict[str, list[Score]], level: int) -> str:
    """Return the name of the path with the smallest sum of RMSE, the planned one left out."""
    others = [name for name in scores if name != "Planned"]
    return min(others, key=lambda name: scores[name][level].total.value)


def resamples(scenario: Scenario, count: int = 400) -> np.ndarray:
    """Return bootstrap weights of the runs, (count, runs), each row with mean one."""
    stream = montecarlo.streams(scenario.seed, "bootstrap", 1)[0]
    runs = scenario.runs
    return stream.multinomial(runs, np.full(runs, 1 / runs), count) / 1.0


def percentile_estimate(value: float, replicates: np.ndarray, count: int) -> estimates.Estimate:
    """Return an `Estimate` with the bootstrap percentile interval, stretched to its value."""
    low, high = np.percentile(replicates, (2.5, 97.5))
    return estimates.Estimate(
        float(value), min(low, value), max(high, value), float(np.std(replicates)), count
    )


def rank_stability(scores: dict[str, list[Score]], weights: np.ndarray) -> estimates.Estimate | str:
    """Return Kendall's tau between the paths' order at the least and at the most noise.

    Or why there is none: where the map says nothing, the plan is the direct path, and both tie.
    """
    ends = []
    for level in (0, -1):
        squared = [row[level].squared for row in scores.values()]
        replicates = [np.sqrt(weights @ one / len(one)).sum(axis=1) for one in squared]
        totals = [row[level].total.value for row in scores.values()]
        ends.append((np.array(totals), np.array(replicates).T))
    tau = kendalltau(ends[0][0], ends[1][0]).statistic
    if np.isnan(tau):
        return TIE
    each = [kendalltau(a, b).statistic for a, b in zip(ends[0][1], ends[1][1], strict=True)]
    known = [one for one in each if not np.isnan(one)]  # a resample may tie, too
    return percentile_estimate(tau, np.array(known), weights.shape[1])


def minimum_km(one: Score, weights: np.ndarray) -> estimates.Estimate:
    """Return the distance (km) at which the RMSE of a path is smallest, an `Estimate`."""
    along = np.linspace(0.0, one.length / KM, len(one.bound))
    replicates = along[np.argmin(weights @ one.squared, axis=1)]
    return percentile_estimate(along[np.argmin(one.rmse)], replicates, weights.shape[1])


def contour_density(
    chart: gravity.GravityMap, levels: int = 16, block: int = 10
) -> tuple[np.ndarray, ...]:
    """Return contour length and mean gradient per block of cells, two flat arrays.

    Drawn contours are measured line by line, so that "denser contours" is the paper's
    picture and not the gradient by another name. Lengths in m, gradients in s⁻².
    """
    field = chart.anomaly / MGAL
    cells = (np.array(field.shape) - 1) // block
    lengths = np.zeros(cells)
    lines = contour_generator(z=field)
    for level in np.linspace(field.min(), field.max(), levels + 2)[1:-1]:
        for line in map(np.asarray, lines.lines(level)):
            middle = 0.5 * (line[1:] + line[:-1])
            steps = np.hypot(*np.diff(line, axis=0).T)
            east, north = (middle // block).astype(int).T
            inside = (east < cells[1]) & (north < cells[0])
            np.add.at(lengths, (north[inside], east[inside]), steps[inside])
    steepness = np.hypot(*gravity.gradient(chart))[: cells[0] * block, : cells[1] * block]
    blocks = steepness.reshape(cells[0], block, cells[1], block).mean(axis=(1, 3))
    return lengths.ravel() * chart.spacing, blocks.ravel()


def rank_agreement(a: np.ndarray, b: np.ndarray) -> estimates.Estimate | str:
    """Return Kendall's tau between two orders of the same paths, exact; or that they tie."""
    tau = kendalltau(a, b).statistic
    return TIE if np.isnan(tau) else estimates.exact(tau)


def rank_correlation(a: np.ndarray, b: np.ndarray) -> estimates.Estimate:
    """Return Spearman's rank correlation with its interval (Bonett and Wright 2000)."""
    rho, count = spearmanr(a, b).statistic, len(a)
    half = 1.959964 * np.sqrt((1 + rho**2 / 2) / (count - 3))
    low, high = np.tanh(np.arctanh(rho) + half * np.array([-1.0, 1.0]))
    return estimates.Estimate(rho, low, high, (high - low) / (2 * 1.959964), count)
