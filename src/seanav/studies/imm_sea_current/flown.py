"""Paper 4: what can be said with the flights that were flown, and what cannot, and why.

A user may choose other filters and other currents than the paper, and a filter may diverge.
What a table, a figure or a claim asks for is then a sentence that says so in place of an
`Estimate`: a gap in a curve, a condition that is not counted.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from seanav.claims import Condition
from seanav.estimates import Estimate, significant
from seanav.report import Report
from seanav.studies.imm_sea_current import scores

PURE, BEST = "pure navigation", "optimal EKF"
LOST = Estimate(*(math.inf,) * 4, 0)  # the number of a filter that diverged


class Flown:
    """The flights of a sweep, by the name of the filter and the true sigma (m/s).

    Attributes
    ----------
    grid : tuple of float
    results : dict of name to list of seanav.filters.ins.Flight
        As from `seanav.studies.imm_sea_current.run.sweep`.
    exact : mapping of true sigma to (float, float)
        TCEPs (m) of pure navigation and the optimal EKF where they are known exactly; see
        `seanav.studies.imm_sea_current.linear.ends`.
    """

    def __init__(self, grid: Sequence[float], results: dict, exact: Mapping | None = None):
        self.grid, self.results, self.exact = tuple(grid), results, dict(exact or {})

    def score(self, score: Callable, *needs: Any) -> Any:
        """Return ``score(flight, …)`` of the needed (name, sigma), or why there is none."""
        flights = []
        for name, sigma in needs:
            if name not in self.results or sigma not in self.grid:
                return f"{name} at {sigma:g} m/s was not run"
            flights.append(self.results[name][self.grid.index(sigma)])
            if scores.diverged(flights[-1]):
                return f"{name} at {sigma:g} m/s diverged"
        return score(*flights)

    def curve(self, score: Callable, name: str) -> list:
        """Return the score of one filter over the grid."""
        return [self.score(score, (name, sigma)) for sigma in self.grid]

    def rate(self, name: str, sigma: float) -> Estimate | str:
        """Return the TCEP rate, equation (28), from the runs alone."""
        return self.score(scores.rate, *((n, sigma) for n in (name, PURE, BEST)))

    def rates(self, name: str) -> list:
        """Return the TCEP rate of one filter over the grid."""
        return [self.rate(name, sigma) for sigma in self.grid]

    def sharp_rate(self, name: str, sigma: float) -> Estimate | str:
        """Return the TCEP rate with the exact TCEPs of `exact` as controls."""
        return self.between(lambda one: scores.rate(*one), (name, sigma))

    def between(self, score: Callable, *pairs: Any) -> Estimate | str:
        """Return ``score(four, …)``: of each (name, sigma) the arguments of `scores.rate`."""
        needs = [(n, sigma) for name, sigma in pairs for n in (name, PURE, BEST)]

        def grouped(*flights):
            three = (flights[k : k + 3] for k in range(0, len(flights), 3))
            exact = (self.exact.get(sigma) for _, sigma in pairs)
            return score(*((*one, known) for one, known in zip(three, exact, strict=True)))

        return self.score(grouped, *needs)

    def least(self, name: str) -> float | None:
        """Return the true sigma at which the rate of a filter is least; None: no rate."""
        rates = {s: self.sharp_rate(name, s) for s in self.grid}
        found = {s: rate.value for s, rate in rates.items() if not isinstance(rate, str)}
        return min(found, key=found.__getitem__) if found else None

    def versus(self, name: str, other: str, sigma: float) -> Estimate | str:
        """Return ln of the ratio of two TCEPs on the same runs."""
        return self.score(scores.tcep_log_ratio, (name, sigma), (other, sigma))

    def cell_ratio(self, column: int, name: str, other: str, sigma: float) -> Estimate | str:
        """Return ln of the ratio of one column of Tables 2 and 3 on the same runs."""
        score = partial(_one_of, scores.log_ratios, column)
        return self.score(score, (name, sigma), (other, sigma))


def _one_of(score, k, *flights):
    return score(*flights)[k]


def there(found: Iterable) -> list:
    """Return what of a list of estimates and reasons is there."""
    return [x for x in found if not isinstance(x, str)]


def shown(x: Any, unit: str = "") -> str:
    """Return an estimate or number as text with its unit, or why there is none."""
    if isinstance(x, str):
        return "diverged" if x.endswith("diverged") else "not run"
    return f"{significant(x)}{unit}"


def condition(
    what: str,
    estimate: Estimate | str,
    low: float = -math.inf,
    high: float = math.inf,
    **more: Any,
) -> Condition:
    """Return a `Condition`; a filter that diverged has a number, and it fails."""
    lost = isinstance(estimate, str) and estimate.endswith("diverged")
    return Condition(what, LOST if lost else estimate, low, high, **more)


def judge(report: Report, number: str, found: Sequence[Condition], basis: str) -> None:
    """Judge a claim; if there is no condition, nothing of what it speaks of was run."""
    nothing = Condition("what it speaks of", "nothing of what it speaks of was run")
    report.claim(number, found or [nothing], basis)


def crossing(grid: np.ndarray, curve: list[float], level: float) -> str:
    """Return in words where a curve first rises above a constant level, by interpolation."""
    where = scores.crossing(grid, curve, np.full(len(grid), level))
    if where is not None:
        return significant(where)
    return f"below {grid[0]:g}" if curve[0] > level else f"beyond {grid[-1]:g}"
