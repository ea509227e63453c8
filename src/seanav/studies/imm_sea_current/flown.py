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
from seanav.estimates import DIVERGED, Estimate, significant
from seanav.studies.imm_sea_current import scores

PURE, BEST = "pure navigation", "optimal EKF"


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
    beside : Flown, optional
        Other flights of the same scenario: what was flown with more runs is shared with them.
    longer : Longer
        The flights with more runs, where these leave a condition open; see `tested`.
    """

    def __init__(
        self,
        grid: Sequence[float],
        results: dict,
        exact: Mapping | None = None,
        beside: "Flown | None" = None,
    ):
        self.grid, self.results, self.exact = tuple(grid), results, dict(exact or {})
        self.longer: Longer = Longer(self, {} if beside is None else beside.longer.flights)

    def flight(self, name: str, sigma: float) -> Any:
        """Return a flight, None if there is none."""
        if name not in self.results or sigma not in self.grid:
            return None
        return self.results[name][self.grid.index(sigma)]

    def score(self, score: Callable, *needs: Any) -> Any:
        """Return ``score(flight, …)`` of the needed (name, sigma), or why there is none."""
        flights = [self.flight(*need) for need in needs]
        for flight, (name, sigma) in zip(flights, needs, strict=True):
            if flight is None:
                return f"{name} at {sigma:g} m/s was not run"
            if scores.diverged(flight):
                return f"{name} at {sigma:g} m/s diverged"
        return score(*flights)

    def tested(
        self,
        what: str,
        number: Callable,
        low: float = -math.inf,
        high: float = math.inf,
        **more: Any,
    ) -> Condition:
        """Return the condition on ``number(flown)``; if it is open, that with more runs.

        What `longer` lacks for it is noted there, and this condition returned until then.
        """
        found = condition(what, number(self), low, high, **more)
        if found.outcome == "undecided":
            sharper = number(self.longer)
            if isinstance(sharper, Estimate):
                return condition(what, sharper, low, high, **more)
        return found

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

    def least_difference(self, name: str, other: str) -> Estimate | str:
        """Return the least rate of one filter less that of another, each where it is least."""
        places = {one: self.least(one) for one in (name, other)}
        for one, sigma in places.items():
            if sigma is None:
                why = "diverged" if one in self.results else "was not run"
                return f"{one} {why}"
        return self.between(scores.rate_difference, *places.items())

    def sharpest_rate(self, name: str, sigma: float) -> Estimate | str:
        """Return the TCEP rate with the most runs that were flown, exact TCEPs as controls."""
        longer = self.longer.sharp_rate(name, sigma)
        return longer if isinstance(longer, Estimate) else self.sharp_rate(name, sigma)

    def versus(self, name: str, other: str, sigma: float) -> Estimate | str:
        """Return the ratio of two TCEPs on the same runs."""
        return self.score(scores.tcep_ratio, (name, sigma), (other, sigma))

    def cell_ratio(self, column: int, name: str, other: str, sigma: float) -> Estimate | str:
        """Return the ratio of one column of Tables 2 and 3 on the same runs."""
        score = partial(scores.ratio, column=column)
        return self.score(score, (name, sigma), (other, sigma))


class Longer(Flown):
    """The same filters on the same grid with more runs, flown only where they are asked for.

    Attributes
    ----------
    asked : dict
        The (name, sigma) that were asked for and are still to be flown.
    flights : dict of (name, sigma) to seanav.filters.ins.Flight
        Those that were.
    """

    def __init__(self, flown: Flown, flights: dict):
        self.grid, self.exact, self.results = flown.grid, flown.exact, flown.results
        self.asked: dict[tuple[str, float], None] = {}
        self.flights, self._fewer = flights, flown

    def flight(self, name: str, sigma: float) -> Any:
        """Return a flight; note it in `asked` if it was flown with fewer runs only."""
        if name == PURE:
            sigma = self.grid[0]  # it does not hang on the current
        found = self.flights.get((name, sigma))
        if found is None and super().flight(name, sigma) is not None:
            self.asked[name, sigma] = None
        return found

    def least(self, name: str) -> float | None:
        """Return as `Flown.least`; None as long as a point of the grid is still to be flown."""
        rates = {s: self.sharp_rate(name, s) for s in self.grid}
        fewer = {s: self._fewer.sharp_rate(name, s) for s in self.grid}
        lacking = any(isinstance(rates[s], str) > isinstance(fewer[s], str) for s in self.grid)
        return None if lacking else super().least(name)

    def fly(self, fly: Callable) -> None:
        """Get what was asked for from ``fly(list of (name, sigma))``."""
        asked, self.asked = list(self.asked), {}
        # In place: the flights of other `Flown` beside this one are the same dict.
        self.flights.update(zip(asked, fly(asked) if asked else (), strict=True))


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
    return Condition(what, DIVERGED if lost else estimate, low, high, **more)


def crossing(grid: np.ndarray, curve: list[float], level: float) -> str:
    """Return in words where a curve first rises above a constant level, by interpolation."""
    where = scores.crossing(grid, curve, np.full(len(grid), level))
    if where is not None:
        return significant(where)
    return f"below {grid[0]:g}" if curve[0] > level else f"beyond {grid[-1]:g}"
