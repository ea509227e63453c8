"""Paper 4: what can be said with the flights that were flown, and what cannot, and why.

A user may choose other filters and other currents than the paper, and a filter may diverge.
What a table, a figure or a claim asks for is then a sentence that says so in place of an
`Estimate`: a gap in a curve, a remark beside a claim.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from seanav.estimates import Estimate
from seanav.report import Condition, Report, significant
from seanav.studies.imm_sea_current import scores

PURE, BEST = "pure navigation", "optimal EKF"


class Flown:
    """The flights of a sweep, by the name of the filter and the true sigma (m/s).

    Attributes
    ----------
    grid : tuple of float
    results : dict of name to list of seanav.filters.ins.Flight
        As from `seanav.studies.imm_sea_current.run.sweep`.
    """

    def __init__(self, grid, results):
        self.grid, self.results = tuple(grid), results

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
        """Return the TCEP rate, equation (28)."""
        return self.score(scores.rate, *((n, sigma) for n in (name, PURE, BEST)))

    def rates(self, name: str) -> list:
        """Return the TCEP rate of one filter over the grid."""
        return [self.rate(name, sigma) for sigma in self.grid]

    def between(self, score: Callable, *pairs: Any) -> Estimate | str:
        """Return ``score(three, …)``: of each (name, sigma) with pure and optimal beside it."""
        needs = [(n, sigma) for name, sigma in pairs for n in (name, PURE, BEST)]

        def grouped(*flights):
            return score(*(flights[k : k + 3] for k in range(0, len(flights), 3)))

        return self.score(grouped, *needs)

    def versus(self, name: str, other: str, sigma: float) -> Estimate | str:
        """Return ln of the ratio of two TCEPs on the same runs."""
        return self.score(scores.tcep_log_ratio, (name, sigma), (other, sigma))


def there(found: Iterable) -> list:
    """Return what of a list of estimates and reasons is there."""
    return [x for x in found if not isinstance(x, str)]


def shown(x: Any, unit: str = "") -> str:
    """Return an estimate or number as text with its unit, or why there is none."""
    if isinstance(x, str):
        return "diverged" if x.endswith("diverged") else "not run"
    return f"{significant(x)}{unit}"


def condition(
    what: str, estimate: Estimate | str, low: float = -math.inf, high: float = math.inf
) -> Condition | str:
    """Return a `Condition`, or the reason why it cannot be tested."""
    return estimate if isinstance(estimate, str) else Condition(what, estimate, low, high)


def judge(report: Report, number: str, text: str, found: Sequence, basis: str) -> None:
    """Judge a claim by those conditions that could be tested; name the others in its basis."""
    missing = list(dict.fromkeys(x for x in found if isinstance(x, str)))
    if missing or not found:
        why = "; ".join(missing) or "nothing of what it speaks of was run"
        basis = f"{basis}. Cannot be tested with these parameters: {why}"
    report.claim(number, text, there(found), basis)


def crossing(grid: np.ndarray, curve: list[float], level: float) -> str:
    """Return in words where a curve first rises above a constant level, by interpolation."""
    where = scores.crossing(grid, curve, np.full(len(grid), level))
    if where is not None:
        return significant(where)
    return f"below {grid[0]:g}" if curve[0] > level else f"beyond {grid[-1]:g}"
