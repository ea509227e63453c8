"""Paper 4: the conditions of its claims, with regions from the paper's words (see `claims`).

What concerns the printed tables is in `tables`.

Two things that the paper does not settle run through them: whether the true current starts
from zero or from its stationary law (two `Sea`), and the diagonal p of the transition matrix
(`chains`: what it is called, and what the name of an IMM with it ends in).
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from operator import methodcaller
from typing import Any

import attrs
import numpy as np

from seanav import estimates
from seanav.claims import Condition
from seanav.estimates import Estimate
from seanav.filters import ins
from seanav.studies.imm_sea_current import beyond, linear, printed, run, scores
from seanav.studies.imm_sea_current.flown import Flown, condition
from seanav.studies.imm_sea_current.scenario import Scenario

SMALL, LARGE = printed.SIGMA[2], printed.SIGMA[3]  # m/s, the ends of the paper's domain
RATE = 90.0  # %, which the paper asks of the IMM
MUCH = 10.0  # times σ_f: our reading of "≫"
PERCENT: dict[str, Any] = {"unit": "%"}
POINTS: dict[str, Any] = {"unit": "points"}
UNKNOWN = "the linear model knows the forward axis alone: with three it was not run"


@attrs.frozen
class Sea:
    """A scenario and what was flown in it; `start` says how its true current begins."""

    scenario: Scenario
    flown: Flown

    @property
    def start(self) -> str:
        """Such as ``"zero start"``."""
        return f"{self.scenario.initial_current} start"

    def exact(self, number: Callable, *arguments: float) -> Estimate | str:
        """Return ``number(scenario, …)``, exact, or why there is none."""
        if self.scenario.log_axes > 1:
            return UNKNOWN
        return estimates.exact(number(self.scenario, *arguments))

    def fly_longer(self) -> None:
        """Fly with more runs what the conditions that are still open ask for."""
        more = self.scenario.longer()
        filters = beyond.filters(more)

        whole = self.scenario.runs // run.LANES  # batches that need not be flown again

        def fly(points):
            jobs = [(filters.get(name) or run.optimal(sigma), sigma) for name, sigma in points]
            rest = run.fly_all(more, jobs, first=whole, label="more runs")
            fewer = (self.flown.flight(*point).runs(whole * run.LANES) for point in points)
            return [
                ins.Flight.join([known.unrecorded(), flight])
                for known, flight in zip(fewer, rest, strict=True)
            ]

        if more.runs > self.scenario.runs:
            self.flown.longer.fly(fly)


def longer(test: Callable, *seas: Any) -> list[Condition]:
    """Return the conditions ``test(*seas)``; those that are open are tested with more runs.

    Parameters
    ----------
    test : callable
        One of the functions below.
    seas : Sea or sequence of Sea
        Its arguments; what else it takes is bound with `functools.partial`.
    """
    test(*seas)
    for sea in seas:
        for one in (sea,) if isinstance(sea, Sea) else sea:
            one.fly_longer()
    return test(*seas)


def _ratio(scenario, one, other, sigma, at=None):
    first, second = (one, sigma), (other, sigma if at is None else at)
    return linear.tcep(scenario, *first) / linear.tcep(scenario, *second)


def deteriorates(seas: Sequence[Sea]) -> list[Condition]:
    """4.2: the optimal TCEP rises along the grid; the exact one decides."""
    found = []
    for sea in seas:
        for low, high in pairwise(sea.scenario.sigma_true):
            what = f"TCEP at {high:g} over that at {low:g} m/s, exact, {sea.start}"
            found.append(
                condition(what, sea.exact(_ratio, high, low, high, low), 1.0, group=sea.start)
            )
    return found


def suboptimal(seas: Sequence[Sea]) -> list[Condition]:
    """4.3: a wrong σ_f costs TCEP; at σ_f = σ_T both filters are one and the same."""
    found = []
    for sea in seas:
        for s in sea.scenario.sigma_filter:
            for sigma in sea.scenario.sigma_true:
                if sigma != s:
                    what = f"TCEP of EKF {s:g} over the optimal, {sigma:g} m/s, exact, {sea.start}"
                    number = sea.exact(_ratio, s, sigma, sigma)
                    found.append(condition(what, number, 1.0, group=sea.start))
    return found


def lopsided(seas: Sequence[Sea]) -> list[Condition]:
    """4.4: too small a σ_f costs more points than too large a one; the exact answer decides."""

    def gap(scenario, small, large):
        lost = (100 - linear.rate(scenario, *pair) for pair in ((small, large), (large, small)))
        return next(lost) - next(lost)

    found = []
    for sea in seas:
        for small, large in ((0.1, 1.0), (0.1, 0.5), (0.5, 1.0)):
            what = f"points lost by {small:g} in {large:g} beyond {large:g} in {small:g} m/s"
            number = sea.exact(gap, small, large)
            more = POINTS | {"group": f"{small:g} and {large:g} m/s"}
            found.append(condition(f"{what}, exact, {sea.start}", number, 0.0, **more))
            if sea is seas[0]:
                pair = (f"EKF {large:g}", small), (f"EKF {small:g}", large)
                ours = sea.flown.between(scores.rate_difference, *pair)
                why = "the exact answer decides"
                found.append(condition(f"{what}, flown", ours, 0.0, **POINTS, aside=why))
    return found


def worse_than_pure(seas: Sequence[Sea]) -> list[Condition]:
    """4.5: the rate is negative, in two readings of where; the exact answer decides."""
    found = []
    for sea in seas:
        filters = sea.scenario.sigma_filter
        literal = [(s, x) for s in filters for x in sea.scenario.sigma_true if x > s]
        much = [(s, MUCH * s) for s in filters]
        readings = {"“>”": literal, f"“≫”, {MUCH:g} times": much}
        for reading, cases in readings.items():
            for s, sigma in cases:
                what = f"{reading}: rate of EKF {s:g} at {sigma:g} m/s, exact, {sea.start}"
                number = sea.exact(linear.rate, s, sigma)
                more = PERCENT | {"group": f"reading {reading}"}
                found.append(condition(what, number, high=0.0, **more))
    return found


def fading(seas: Sequence[Sea], sigma: float, low: float, high: float) -> list[Condition]:
    """4.6 and 4.7: what fading does to the TCEP at one end of the domain."""
    found = []
    for sea in seas:
        for s in (0.1, 0.5):
            what = f"TCEP of AFEKF {s:g} over EKF {s:g} at {sigma:g} m/s, {sea.start}"
            number = methodcaller("versus", f"AFEKF {s:g}", f"EKF {s:g}", sigma)
            found.append(sea.flown.tested(what, number, low, high, group=sea.start))
    return found


def fading_below(sea: Sea) -> list[Condition]:
    """4.22: fading helps at every σ_T > σ_f."""
    found = []
    for s in sea.scenario.sigma_filter:
        for sigma in (x for x in sea.flown.grid if x > s):
            faded, plain = (f"{kind} {run.label((s,))}" for kind in ("AFEKF", "EKF"))
            what = f"TCEP of AFEKF {s:g} over EKF {s:g} at {sigma:g} m/s"
            number = methodcaller("versus", faded, plain, sigma)
            found.append(sea.flown.tested(what, number, high=1.0, group=f"σ_f = {s:g} m/s"))
    return found


def imm_rates(
    seas: Sequence[Sea], names: Sequence[str], chains: Mapping[str, str], low: float, high: float
) -> list[Condition]:
    """4.8 and 4.27: where the rates of the IMMs lie."""
    found = []
    for sea in seas:
        for p, end in chains.items():
            for name in names:
                for sigma in sea.flown.grid:
                    number = methodcaller("sharp_rate", name + end, sigma)
                    what = f"rate of {name}, {p}, at {sigma:g} m/s, {sea.start}"
                    more = PERCENT | {"group": f"{name}, {p}, {sea.start}"}
                    found.append(sea.flown.tested(what, number, low, high, **more))
    return found


def narrow_pair(sea: Sea, causes: Sea, chains: Mapping[str, str]) -> list[Condition]:
    """4.9: (0.1, 0.5) beats (0.1, 1.0) between them, and plain EKFs show less of it.

    `causes` holds all four IMMs, of fading and of plain EKFs, with both diagonals.
    """
    flown, found = sea.flown, []
    for p, end in chains.items():
        pairs = [f"IMM-{kind} {s}{end}" for kind in ("AFEKF", "EKF") for s in ("0.1,0.5", "0.1,1")]
        for sigma in (x for x in flown.grid if 0.1 < x < 1.0):
            number = _points(scores.rate_difference, pairs[:2], sigma)
            what = f"lead of (0.1, 0.5) over (0.1, 1) at {sigma:g} m/s, {p}"
            found.append(flown.tested(what, number, 0.0, **POINTS, group=f"lead, {p}"))
        for sigma in (0.6, 0.9):
            number = _points(scores.advantage_difference, pairs, sigma)
            what = f"of that lead due to fading at {sigma:g} m/s, {p}"
            found.append(causes.flown.tested(what, number, 0.0, **POINTS, group=f"cause, {p}"))
    return found


def _points(score, names, sigma):
    return methodcaller("between", score, *((name, sigma) for name in names))


# ---------------------------------------------------------------- the IMM


def modes(sea: Sea, names: Sequence[str], chains: Mapping[str, str]) -> list[Condition]:
    """4.12: μ₁ falls along the grid; the pair that is wider apart tells its models better."""
    flown, found = sea.flown, []
    for p, end in chains.items():
        for name in names:
            for low, high in pairwise(flown.grid):
                ends = (name + end, high), (name + end, low)
                fall = methodcaller("score", scores.mode_difference, *ends)
                what = f"change of μ₁ of {name}, {p}, from {low:g} to {high:g} m/s"
                found.append(flown.tested(what, fall, high=0.0, group="μ₁ falls"))
        for sigma, sign in {flown.grid[0]: 1, flown.grid[-1]: -1}.items():
            contrast = partial(scores.mode_contrast_difference, sign=sign)
            pair = [(f"IMM-AFEKF {s}{end}", sigma) for s in ("0.1,1", "0.1,0.5")]
            what = f"lead of the better model, (0.1, 1) beyond (0.1, 0.5), at {sigma:g} m/s, {p}"
            group = f"wider gap at {sigma:g} m/s"
            number = methodcaller("score", contrast, *pair)
            found.append(flown.tested(what, number, 0.0, group=group))
    return found


def prominent(seas: Sequence[Sea]) -> list[Condition]:
    """4.14: each AFEKF has a rate below 90 % at the end that is far from its σ_f."""
    found = []
    for sea in seas:
        for s, sigma in ((0.1, LARGE), (0.5, SMALL), (1.0, SMALL)):
            number = methodcaller("sharp_rate", f"AFEKF {s:g}", sigma)
            what = f"rate of AFEKF {s:g} at {sigma:g} m/s, {sea.start}"
            more = PERCENT | {"group": f"AFEKF {s:g}"}
            found.append(sea.flown.tested(what, number, high=RATE, **more))
    return found


def robust(sea: Sea, names: Sequence[str], chains: Mapping[str, str]) -> list[Condition]:
    """4.23: the least rate of an IMM exceeds that of each single filter."""
    singles = [
        f"{k} {run.label((s,))}" for s in sea.scenario.sigma_filter for k in ("EKF", "AFEKF")
    ]
    found = []
    for p, end in chains.items():
        for name in names:
            for single in singles:
                what = f"least rate of {name}, {p}, beyond that of {single}"
                found.append(_least(sea.flown, what, name + end, single, f"{name}, {p}"))
    return found


def _least(flown, what, name, other, group):
    number = methodcaller("least_difference", name, other)
    return flown.tested(what, number, 0.0, **POINTS, group=group)


def fading_is_robust(sea: Sea) -> list[Condition]:
    """4.34: of one σ_f, fading raises the least rate."""
    found = []
    for s in map(run.label, zip(sea.scenario.sigma_filter)):
        what = f"least rate of AFEKF {s} beyond that of EKF {s}"
        found.append(_least(sea.flown, what, f"AFEKF {s}", f"EKF {s}", f"σ_f = {s} m/s"))
    return found


def at_home(sea: Sea) -> list[Condition]:
    """4.35: the rate of an AFEKF at a sea as strong as it assumes."""
    found = []
    for s in (x for x in sea.scenario.sigma_filter if x in sea.flown.grid):
        number = methodcaller("sharp_rate", f"AFEKF {run.label((s,))}", s)
        what = f"rate of AFEKF {s:g} at {s:g} m/s"
        found.append(sea.flown.tested(what, number, RATE, **PERCENT, group=f"σ_f = {s:g} m/s"))
    return found


def better_chain(sea: Sea, names: Sequence[str], others: Sequence[float]) -> list[Condition]:
    """4.30: another diagonal of T raises the least rate."""
    found = []
    for name in names:
        for p in others:
            what = f"least rate of {name} with p = {p:g} beyond that with the paper's T"
            group = f"{name}, p = {p:g}"
            found.append(_least(sea.flown, what, f"{name} p={p:g}", name, group))
    return found


def compensates(sea: Sea, chains: Mapping[str, str]) -> list[Condition]:
    """4.26: the IMM beats the worse of its two sub-filters flown alone."""
    flown, found = sea.flown, []
    for pair in run.pairs(sea.scenario):
        alone = [f"AFEKF {run.label((s,))}" for s in pair]
        for p, end in chains.items():
            name = f"IMM-AFEKF {run.label(pair)}"
            for sigma in flown.grid:
                tceps = [(flown.score(scores.tcep, (one, sigma)), one) for one in alone]
                known = [(t.value, one) for t, one in tceps if not isinstance(t, str)]
                worse = max(known)[1] if len(known) == len(tceps) else alone[0]
                number = methodcaller("versus", name + end, worse, sigma)
                what = f"TCEP of {name}, {p}, over its worse half at {sigma:g} m/s"
                found.append(flown.tested(what, number, high=1.0, group=f"{name}, {p}"))
    return found


def fading_in_imm(sea: Sea, causes: Sea, chains: Mapping[str, str]) -> list[Condition]:
    """4.29: beyond both σ_f of (0.1, 0.5) fading raises the rate of the IMM."""
    found = []
    for p, end in chains.items():
        flown = (causes if end else sea).flown
        for sigma in (x for x in flown.grid if x > 0.5):
            pair = [f"IMM-{kind} 0.1,0.5{end}" for kind in ("AFEKF", "EKF")]
            number = _points(scores.rate_difference, pair, sigma)
            what = f"points gained by fading in (0.1, 0.5) at {sigma:g} m/s, {p}"
            found.append(flown.tested(what, number, 0.0, **POINTS, group=p))
    return found


def wrong_time(seas: Sequence[Sea], factors: Sequence[float], at: float) -> list[Condition]:
    """4.15: the TCEP with a wrong σ_f over that with a T_c wrong by the same factor."""

    def excess(scenario, factor):
        by_sigma, by_time = losses(scenario, factor, at)
        return by_sigma / by_time

    return [
        condition(
            f"TCEP, σ_f wrong over T_c wrong, factor {factor:g}, {sea.start}",
            sea.exact(excess, factor),
            1.0,
            group=sea.start,
        )
        for sea in seas
        for factor in factors
        if factor != 1.0
    ]


def losses(scenario: Scenario, factor: float, at: float) -> tuple[float, float]:
    """Return TCEP / optimal of EKFs whose σ_f, or whose T_c, is wrong by a factor.

    `at` is the true sigma, m/s; at factor 1 both are the optimal filter.
    """
    if factor == 1.0:
        return 1.0, 1.0
    right = scenario.correlation_time_s
    by_time = linear.wrong_time(scenario, at, right * factor, at, right)
    best = linear.tcep(scenario, at, at)
    return _ratio(scenario, at * factor, at, at), by_time / best


def appendix_growth(
    P: Mapping[float, np.ndarray], elements: Mapping[str, tuple], when: str, updates: Sequence[int]
) -> list[Condition]:
    """4.32 and 4.33: elements of P before or after an update, σ = 1 against 0.1 m/s."""
    large, small, found = P[1.0], P[0.1], []
    for k in updates:
        for name, (i, j) in elements.items():
            pair = large[k - 1, i, j], small[k - 1, i, j]
            started = pair[1] != 0.0
            number = estimates.exact(pair[0] / pair[1]) if started else "both are 0 at the start"
            what = f"{name} {when} update {k}: σ 1 over 0.1 m/s"
            found.append(condition(what, number, 1.0, group=name))
    return found
