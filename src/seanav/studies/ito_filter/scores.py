"""Paper 1: errors, own variances and their ratios, with their intervals."""

from typing import Any

import attrs
import numpy as np

from seanav import estimates
from seanav.claims import Condition
from seanav.estimates import DIVERGED, Estimate, rms, significant
from seanav.filters.moments.continuous_discrete import Track
from seanav.studies.ito_filter.scenario import Case


@attrs.frozen(eq=False)
class Score:
    """Errors of one filter, a number per run; the start is not counted.

    A run in which the filter diverged has NaN.

    Attributes
    ----------
    squared : ndarray, shape (runs, 6)
        Mean squared error over time.
    variance : ndarray, shape (runs, 6)
        What the filter says of it: mean of the diagonal of P.
    nees : ndarray, shape (runs,)
        Mean over time of eᵀ P⁻¹ e; 6 if the covariance is right.
    nees_by_time : ndarray, shape (samples,)
        Mean over runs.
    """

    squared: np.ndarray
    variance: np.ndarray
    nees: np.ndarray
    nees_by_time: np.ndarray

    @property
    def lost(self) -> int:
        """Number of runs in which the filter diverged."""
        return int((~np.isfinite(self.squared).all(axis=1)).sum())

    def rmse(self, component: int) -> Estimate:
        """Return the RMSE of a component."""
        return estimates.root_mean_square(self.squared[:, component])

    def own_sd_ratio(self, component: int) -> Estimate:
        """Return the filter's own standard deviation over its RMSE."""
        return root_ratio(self.variance[:, component], self.squared[:, component])

    def mean_nees(self) -> Estimate:
        """Return the mean NEES over runs and time."""
        return estimates.mean(self.nees)


def score(truth: Any, track: Track, consistency: bool = True) -> Score:
    """Return the errors (estimate minus truth) of a filter, of as many runs as it has.

    `consistency` False leaves the NEES out (NaN): the sample covariance of a particle
    filter that has collapsed cannot be inverted.
    """
    runs = len(track.mean)
    error = (track.mean - truth.x[:runs])[:, 1:]
    P = track.P[:, 1:]
    nees = np.full(error.shape[:2], np.nan)
    if consistency:
        whitened = np.linalg.solve(P, error[..., None])[..., 0]
        nees = (error * whitened).sum(axis=-1)
        nees[nees < 0] = np.nan  # a P that is no covariance any more
    variance = np.diagonal(P, axis1=2, axis2=3).mean(axis=1)
    return Score((error**2).mean(axis=1), variance, nees.mean(axis=1), nees.mean(axis=0))


def root_ratio(a: np.ndarray, b: np.ndarray) -> Estimate:
    """Return √(mean a / mean b) of per-run scores (runs,), paired."""
    return (rms(a) / rms(b)).estimate()


def total(one: Score, open_loop: Score) -> np.ndarray:
    """Return each run's squared error, components weighed by the open-loop error, (runs,)."""
    return (one.squared / open_loop.squared.mean(axis=0)).mean(axis=1)


@attrs.frozen(eq=False)
class Result:
    """One case of one vehicle: truth, filtered track, and scores by filter name."""

    truth: Any  # a `seanav.studies.ito_filter.run.Truth`
    case: Case
    track: Track
    scores: dict

    def against_open_loop(self, name: str = "gaussian") -> Estimate:
        """Return the total error of a filter over that of prediction only, paired."""
        return self.gain(name, "prediction only")

    def over_open_loop(self, component: int, name: str = "gaussian") -> Estimate:
        """Return the RMSE of a filter over that of prediction only."""
        free = self.scores["prediction only"]
        return root_ratio(self.scores[name].squared[:, component], free.squared[:, component])

    def gain(self, name: str = "gaussian", other: str = "ekf") -> Estimate:
        """Return the total error of a filter over another's, paired."""
        free = self.scores["prediction only"]
        return root_ratio(total(self.scores[name], free), total(self.scores[other], free))


# ---------------------------------------------------------------- what did not come to an end


def _diverged(number):
    return number.diverged if isinstance(number, Estimate) else not np.isfinite(number)


def shown(number: Estimate | float, digits: int = 3) -> str:
    """Return a number as text; that of a filter that diverged says so."""
    return "diverged" if _diverged(number) else significant(number, digits)


def entry(number: Estimate | float, end: str = "value") -> float | str:
    """Return what a table holds of a number: of an estimate its `end`, else as `shown`."""
    found: Any = getattr(number, end) if isinstance(number, Estimate) else number
    return "diverged" if _diverged(number) else float(found)


def condition(
    what: str,
    number: Estimate | float,
    low: float = -np.inf,
    high: float = np.inf,
    lost: int | None = None,
    group: str = "",
    aside: str = "",
) -> Condition:
    """Return a condition of a claim on an `Estimate` or an exact number.

    Where a filter diverged it fails. If the claim is about one of two filters that are
    compared, hand in how many runs that one has `lost`: none, and it holds. Where the
    vehicle itself diverged, no filter is to blame: say so by `aside`, and it does not count.
    """
    if not _diverged(number):
        number = number if isinstance(number, Estimate) else estimates.exact(number)
        return Condition(what, number, low, high, group=group)
    if lost is None or aside:
        return Condition(what, DIVERGED, low, high, group=group, aside=aside)
    what = f"{what}: one diverged; runs lost by ours"
    return Condition(what, estimates.exact(lost), high=0, group=group)
