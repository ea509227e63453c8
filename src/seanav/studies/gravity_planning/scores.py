"""Paper 5's scores: what a Monte-Carlo run gave, and paired comparisons of two of them."""

from dataclasses import dataclass

import numpy as np
from contourpy import contour_generator
from scipy.stats import kendalltau, spearmanr

from seanav import estimates, montecarlo
from seanav.models import gravity
from seanav.models.units import KM, MGAL
from seanav.studies.gravity_planning.scenario import Scenario


@dataclass(frozen=True)
class Score:
    """What a Monte-Carlo run along one path gave; RMSE is two-dimensional, in m."""

    squared: np.ndarray  # (runs, samples) squared position errors, m²
    bound: np.ndarray  # (samples,) root of the trace of the PCRB, m
    length: float  # m

    @property
    def rmse(self) -> np.ndarray:
        """RMSE at every sample, (samples,) m."""
        return np.sqrt(self.squared.mean(axis=0))

    @property
    def influence(self) -> np.ndarray:
        """Each run's contribution to the error of the sum of RMSE, (runs,) m."""
        # Delta method: d sqrt(m) = dm / (2 sqrt(m)) at each sample, summed over the samples.
        rmse = self.rmse
        return ((self.squared - rmse**2) / (2 * rmse)).sum(axis=1)

    @property
    def total(self) -> estimates.Estimate:
        """Sum of RMSE over the samples, an `Estimate` in m."""
        return estimates.from_influence(self.rmse.sum(), self.influence)

    @property
    def over_bound(self) -> estimates.Estimate:
        """Sum of RMSE over the sum of the root PCRB, an `Estimate`."""
        scale = self.bound.sum()
        return estimates.from_influence(self.rmse.sum() / scale, self.influence / scale)

    @property
    def diverged(self) -> int:
        """Number of runs that end more than 1 km and four bounds away from the truth."""
        return int((self.squared[:, -1] > max(KM, 4 * self.bound[-1]) ** 2).sum())

    def sample(self, distance_km: float) -> int:
        """Index of the sample nearest to a distance along the path."""
        return round(min(distance_km * KM / self.length, 1.0) * (len(self.bound) - 1))

    def at(self, distance_km: float) -> estimates.Estimate:
        """RMSE at a distance along the path, an `Estimate` in m."""
        return estimates.root_mean_square(self.squared[:, self.sample(distance_km)])

    def band(self) -> tuple[np.ndarray, ...]:
        """Return the ends of the RMSE's 95 % interval at every sample, two arrays (samples,) m."""
        points = [estimates.root_mean_square(column) for column in self.squared.T]
        return np.array([p.low for p in points]), np.array([p.high for p in points])


# Comparisons, all paired through the common noise ------------------------------------------


def log_ratio(one: Score, other: Score) -> estimates.Estimate:
    """Return the log of the ratio of two sums of RMSE, an `Estimate`."""
    a, b = one.total.value, other.total.value
    return estimates.from_influence(np.log(a / b), one.influence / a - other.influence / b)


def exp(log: estimates.Estimate) -> estimates.Estimate:
    """Return the exponential of an `Estimate`, its interval's ends with it."""
    value, low, high = np.exp([log.value, log.low, log.high])
    return estimates.Estimate(value, low, high, value * log.se, log.count)


def ratio(one: Score, other: Score) -> estimates.Estimate:
    """Return the ratio of two paths' sums of RMSE, an `Estimate`."""
    return exp(log_ratio(one, other))


def ratio_at(one: Score, other: Score, distance_km: float) -> estimates.Estimate:
    """Return the ratio of two paths' RMSE at the same distance sailed, an `Estimate`."""
    a = one.squared[:, one.sample(distance_km)]
    b = other.squared[:, other.sample(distance_km)]
    half_log = 0.5 * np.log(a.mean() / b.mean())
    return exp(estimates.from_influence(half_log, 0.5 * (a / a.mean() - b / b.mean())))


def growth(scores: dict[str, list[Score]], reading: str) -> estimates.Estimate:
    """Return how the planned path's gain over the direct one grows from least to most noise.

    Parameters
    ----------
    reading : {"absolute", "relative"}
        Difference of the sums (m), or log of their ratio.
    """
    planned, direct = scores["Planned"], scores["Direct"]
    if reading == "relative":
        gains = [log_ratio(b, a) for a, b in zip(planned, direct, strict=True)]
        parts = [
            b.influence / b.total.value - a.influence / a.total.value
            for a, b in zip(planned, direct, strict=True)
        ]
        return estimates.from_influence(gains[-1].value - gains[0].value, parts[-1] - parts[0])
    sums = [b.total.value - a.total.value for a, b in zip(planned, direct, strict=True)]
    parts = [b.influence - a.influence for a, b in zip(planned, direct, strict=True)]
    return estimates.from_influence(sums[-1] - sums[0], parts[-1] - parts[0])


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


def rank_stability(scores: dict[str, list[Score]], weights: np.ndarray) -> estimates.Estimate:
    """Return Kendall's tau between the paths' order at the least and at the most noise."""
    ends = []
    for level in (0, -1):
        squared = [row[level].squared for row in scores.values()]
        replicates = [np.sqrt(weights @ one / len(one)).sum(axis=1) for one in squared]
        totals = [row[level].total.value for row in scores.values()]
        ends.append((np.array(totals), np.array(replicates).T))
    tau = kendalltau(ends[0][0], ends[1][0]).statistic
    each = [kendalltau(a, b).statistic for a, b in zip(ends[0][1], ends[1][1], strict=True)]
    return percentile_estimate(tau, np.array(each), weights.shape[1])


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


def rank_correlation(a: np.ndarray, b: np.ndarray) -> estimates.Estimate:
    """Return Spearman's rank correlation with its interval (Bonett and Wright 2000)."""
    rho, count = spearmanr(a, b).statistic, len(a)
    half = 1.959964 * np.sqrt((1 + rho**2 / 2) / (count - 3))
    low, high = np.tanh(np.arctanh(rho) + half * np.array([-1.0, 1.0]))
    return estimates.Estimate(rho, low, high, (high - low) / (2 * 1.959964), count)
