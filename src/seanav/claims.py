"""What a paper claims, the conditions under which it is tested, and the computed verdict."""

import csv
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import attrs

from seanav.estimates import Estimate, significant

VERDICTS = ("reproduced", "mixed", "undecided", "not reproduced", "cannot be tested")
OUTCOMES = ("holds", "fails", "undecided")  # of a condition that counts
CONFIRMATION = Path("paper_figures", "confirmation.csv")  # written by `make confirm`
QUOTE = 180  # characters at most: a row of the report fits a screen


def _short(claim, attribute, text):
    if not 0 < len(text) <= QUOTE:
        raise ValueError(f"claim {claim.number}: {attribute.name} has {len(text)} characters")


@attrs.frozen
class Claim:
    """A statement of a paper, declared once in ``studies/<name>/claims.py``.

    Attributes
    ----------
    number : str
        Such as ``"5.3"``.
    quote : str
        The paper's words, or the shortest part of them that makes the claim.
    section : str
        Where they stand, such as ``"section 4.2"`` or ``"abstract"``.
    reading : str
        What we take them to say, in words that can be tested.
    stated : bool
        Whether the paper states it; otherwise it only implies it.
    main : bool
        Whether it is what the paper is written for; one of its claims is.
    shown : tuple of str
        Results that show it, by their file names without suffix: ``("figure_03", "table_2")``.

    Raises
    ------
    ValueError
        If the quote or the reading is empty or too long for a row of the report.
    """

    number: str
    quote: str = attrs.field(validator=_short)
    section: str
    reading: str = attrs.field(validator=_short)
    stated: bool = True
    main: bool = False
    shown: tuple[str, ...] = ()


@attrs.frozen
class Condition:
    """One condition under which a claim is tested, with the region that it claims.

    Attributes
    ----------
    what : str
        The condition in words, such as ``"test 1, R = 2 mGal"``; no two of a claim are equal.
    estimate : Estimate or str
        The number that the claim is about; a text says why there is none, as for a setting
        that was not run.
    low, high : float
        The claimed region, ends included; fixed before the full-scale run.
    unit : str
        Of the number; empty for a ratio or a count.
    group : str
        What the condition belongs to, such as ``"test 1"``: a verdict of ``mixed`` says by
        groups where the claim holds.
    aside : str
        Why it is shown but not counted, such as ``"printed table"``; empty if it counts.
    point : bool
        Whether the value decides, not its interval: the region holds the sampling error.
    confirmed : bool
        Whether a run with another seed had the same outcome; if not, it is undecided.
    """

    what: str
    estimate: Estimate | str
    low: float = -math.inf
    high: float = math.inf
    unit: str = ""
    group: str = ""
    aside: str = ""
    point: bool = False
    confirmed: bool = True

    @property
    def counts(self) -> bool:
        """Whether it counts for the verdict."""
        return not self.aside and isinstance(self.estimate, Estimate)

    @property
    def outcome(self) -> str:
        """``holds``, ``fails`` or ``undecided``: where the whole interval lies.

        A number of a filter that diverged supports nothing: it fails. Where there is no
        number, the outcome is ``not run``.
        """
        if not isinstance(self.estimate, Estimate):
            return "not run"
        if self.estimate.diverged:
            return "fails"
        below, above = (self.estimate.low, self.estimate.high)
        if self.point:
            below = above = self.estimate.value
        if self.low <= below and above <= self.high:
            return "holds"
        return "fails" if above < self.low or self.high < below else "undecided"

    @property
    def judged(self) -> str:
        """The outcome that counts: one that changes with the seed is undecided."""
        return self.outcome if self.confirmed else "undecided"

    @property
    def margin(self) -> float:
        """How far inside its region the value lies, in parts of the nearer end; < 0: outside."""
        if isinstance(self.estimate, str) or self.estimate.diverged:
            return -math.inf
        value = self.estimate.value
        ends = ((value - self.low, self.low), (self.high - value, self.high))
        # An end at 0 has no parts: logarithms and counts are compared as they are.
        return min(gap / (abs(end) or 1.0) if math.isfinite(end) else math.inf for gap, end in ends)

    @property
    def claimed(self) -> str:
        """The region in words."""
        low = f"at least {significant(self.low)}" if math.isfinite(self.low) else ""
        high = f"at most {significant(self.high)}" if math.isfinite(self.high) else ""
        words = " and ".join(filter(None, (low, high))) or "any value"
        return f"{words} (the value alone)" if self.point else words

    @property
    def shown(self) -> str:
        """The number with interval and unit, or why there is none.

        With as many digits as tell its ends from those of the region, but no more than six.
        """
        if isinstance(self.estimate, str) or self.estimate.diverged:
            number = self.estimate if isinstance(self.estimate, str) else significant(self.estimate)
            return f"{number} {self.unit}".rstrip()
        ours = (self.estimate.value, self.estimate.low, self.estimate.high)
        near = [(x, end) for x in ours for end in (self.low, self.high) if x != end]
        digits = 3
        while digits < 6 and any(float(significant(x, digits)) == end for x, end in near):
            digits += 1
        return f"{significant(self.estimate, digits)} {self.unit}".rstrip()

    def __str__(self):
        return line(_stored(self))


def agreement(
    what: str,
    printed: float,
    ours: Estimate,
    paper_runs_se: float | None = None,
    *,
    unit: str = "",
    group: str = "",
    aside: str = "",
) -> Condition:
    """Return the condition that a printed number and ours `agree` within sampling error.

    Parameters
    ----------
    what : str
    printed, ours, paper_runs_se : float, Estimate, float
        As for `agrees`.
    unit, group, aside : str
        As for `Condition`.
    """
    far = math.exp(2.0 * _log_se(ours, paper_runs_se)) if not ours.diverged else 1.0
    low, high = sorted((printed / far, printed * far))
    return Condition(what, ours, low, high, unit, group, aside, point=True)


def agrees(printed: float, ours: Estimate, paper_runs_se: float | None = None) -> bool:
    """Return whether our number agrees with the printed one within sampling error.

    ``|ln(ours/printed)| <= 2 sqrt(SE² + SE_paper²)`` with standard errors of ln(ours).

    Parameters
    ----------
    printed, ours : float, Estimate
        The paper's number and ours; if their signs differ they do not agree.
    paper_runs_se : float, optional
        Our standard error at the paper's number of runs, in the unit of the number;
        default: ours is computed at that number already.
    """
    if printed == ours.value:
        return True
    if ours.diverged or printed * ours.value <= 0:
        return False
    return abs(math.log(ours.value / printed)) <= 2.0 * _log_se(ours, paper_runs_se)


def _log_se(ours, paper_runs_se):
    paper_se = ours.se if paper_runs_se is None else paper_runs_se
    return math.hypot(ours.se, paper_se) / abs(ours.value) if ours.value else 0.0


def verdict(outcomes: Iterable[str]) -> str:
    """Return the verdict on a claim from its outcomes; it is never typed, only computed.

    ``reproduced`` if it holds under every condition; ``not reproduced`` if it fails under at
    least one and holds under none; ``mixed`` if it holds under some and fails under others;
    ``undecided`` if nothing fails but an interval reaches over the end of its region: the
    test lacks power; ``cannot be tested`` without a condition.
    """
    found = set(outcomes)
    if not found:
        return "cannot be tested"
    if "fails" in found:
        return "mixed" if "holds" in found else "not reproduced"
    return "undecided" if "undecided" in found else "reproduced"


def told(number: str, claim: dict) -> list[str]:
    """Return a stored claim in lines: verdict with counts, quote, reading, what decided."""
    counts = f"{counted(outcomes_of(claim))}" if claim["decisive"] else claim["basis"]
    how = "" if claim["stated"] else ", only implied"
    lines = [
        f"{number} {claim['verdict']}: {counts}",
        f"    “{claim['quote']}” ({claim['section']}{how})",
        f"    read as: {claim['reading']}",
    ]
    return [*lines, f"    decisive: {line(claim['decisive'])}"] if claim["decisive"] else lines


def line(condition: dict) -> str:
    """Return a stored condition in one line: its name, number, region and outcome."""
    told = f"{condition['what']}: {condition['shown']}, claimed {condition['claimed']}, "
    told += condition["outcome"] if condition["confirmed"] else "undecided: changes with the seed"
    return f"{told} (not counted: {condition['aside']})" if condition["aside"] else told


def outcomes_of(claim: dict) -> list[str]:
    """Return the outcomes that count of a stored claim."""
    return [name for name in OUTCOMES for _ in range(claim[name])]


def changed(root: Path, stem: str) -> set[tuple[str, str]]:
    """Return (claim, condition) of a paper whose outcome another seed changed, from its file."""
    rows = [row for row in confirmation(root) if row["paper"] == stem]
    return {(row["claim"], row["condition"]) for row in rows if row["outcome"] != row["again"]}


def confirmation(root: Path) -> list[dict[str, str]]:
    """Return the rows of a checkout's confirmation, one per condition; none without the file."""
    path = root / CONFIRMATION
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def counted(outcomes: Sequence[str]) -> str:
    """Return in words how many of the outcomes hold, fail and are undecided."""
    count = Counter(outcomes)
    return (
        f"{count['holds']} of {len(outcomes)} hold, {count['fails']} fail, "
        f"{count['undecided']} undecided"
    )


def decisive(conditions: Iterable[Condition]) -> Condition | None:
    """Return the condition that decides: the worst of those that count, None without one.

    A claim of "all" stands or falls with it: one that fails before one that is undecided
    before one that holds, and of those the one with the smallest `Condition.margin`.
    """
    rank = {"fails": 0, "undecided": 1, "holds": 2}
    found = [condition for condition in conditions if condition.counts]
    return min(found, key=lambda c: (rank[c.judged], c.margin), default=None)


def by_groups(conditions: Iterable[Condition]) -> dict[str, list[str]]:
    """Return the outcomes that count, by group, in the order in which the groups come."""
    groups: dict[str, list[str]] = {}
    for condition in conditions:
        if condition.counts:
            groups.setdefault(condition.group, []).append(condition.judged)
    return groups


def judged(claim: Claim, conditions: Sequence[Condition], basis: str) -> dict:
    """Return a claim with its verdict as stored in ``claims.json``."""
    outcomes = [c.judged for c in conditions if c.counts]
    worst = decisive(conditions)
    return {
        "quote": claim.quote,
        "section": claim.section,
        "reading": claim.reading,
        "stated": claim.stated,
        "main": claim.main,
        "verdict": verdict(outcomes),
        **{outcome: outcomes.count(outcome) for outcome in OUTCOMES},
        "decisive": None if worst is None else _stored(worst),
        "basis": basis,
        "shown": list(claim.shown),
        "conditions": [_stored(condition) for condition in conditions],
    }


def _stored(condition):
    number = condition.estimate if isinstance(condition.estimate, Estimate) else None
    finite = number is not None and not number.diverged
    ends = [x if math.isfinite(x) else None for x in (condition.low, condition.high)]
    return {
        "what": condition.what,
        "group": condition.group,
        "value": number.value if finite else None,
        "interval": [number.low, number.high] if finite and number.low < number.high else None,
        "unit": condition.unit,
        "region": ends,
        "outcome": condition.outcome,
        "shown": condition.shown,
        "claimed": condition.claimed,
        "aside": condition.aside if number is not None else condition.estimate,
        "confirmed": condition.confirmed,
    }
