"""Paper 4: its Tables 2 and 3 beside ours, and the conditions of the claims about them."""

import math
from collections.abc import Mapping, Sequence

from seanav.claims import Condition, agreement
from seanav.estimates import Estimate
from seanav.studies.imm_sea_current import printed, scores
from seanav.studies.imm_sea_current.conditions import LARGE, SMALL, Sea
from seanav.studies.imm_sea_current.flown import condition

IMM = "IMM-AFEKF 0.1,0.5"
BEST_OF = {SMALL: "EKF 0.1", LARGE: "AFEKF 0.5"}  # as Tables 2 and 3 say
LITTLE = 0.1  # above a ratio of 1: our reading of "insignificant"


def paper_se(ours: Estimate, runs: int) -> float:
    """Return our standard error at the paper's number of runs."""
    return ours.se * math.sqrt(runs / printed.RUNS)


def rows(table: int, chains: Mapping[str, str]) -> list[tuple[str, str, str, tuple]]:
    """Return (name in print, our name, kind of filter, cells) of a table; an IMM per chain."""
    found = []
    for name, cells in printed.CELLS[table].items():
        for p, end in chains.items() if name.startswith("IMM") else [("EKF and AFEKF", "")]:
            found.append((name, name + end, f"IMM, {p}" if end or "IMM" in name else p, cells))
    return found


def cells(table: int, seas: Sequence[Sea], chains: Mapping[str, str]) -> list[Condition]:
    """4.10 and 4.11: every cell agrees with the printed one within sampling error."""
    found, sigma = [], printed.SIGMA[table]
    for sea in seas:
        for _, name, kind, paper in rows(table, chains):
            ours = sea.flown.score(scores.cells, (name, sigma))
            ours = [ours] * len(paper) if isinstance(ours, str) else ours
            for column, unit, number, own in zip(
                scores.COLUMNS, scores.UNITS, paper, ours, strict=True
            ):
                what = f"{name}, {column}, {sea.start}"
                more = {"unit": unit, "group": f"{kind}, {sea.start}"}
                found.append(_agreement(what, number, own, sea, more))
    return found


def ratios(seas: Sequence[Sea], chains: Mapping[str, str]) -> list[Condition]:
    """4.28: position errors relative to EKF 0.1, ours on the same runs."""
    found = []
    for table, sigma in printed.SIGMA.items():
        paper = printed.CELLS[table]
        for sea in seas:
            for name, own, _, numbers in rows(table, chains):
                if name != "EKF 0.1":
                    ours = sea.flown.cell_ratio(0, own, "EKF 0.1", sigma)
                    what = f"Table {table}: {own} over EKF 0.1, {sea.start}"
                    more = {"group": f"{name}, Table {table}"}
                    number = numbers[0] / paper["EKF 0.1"][0]
                    found.append(_agreement(what, number, ours, sea, more))
    return found


def _agreement(what, number, ours, sea, more):
    if isinstance(ours, str):
        return condition(what, ours, **more)
    return agreement(what, number, ours, paper_se(ours, sea.scenario.runs), **more)


def discrepancy(seas: Sequence[Sea], chains: Mapping[str, str]) -> list[Condition]:
    """4.24: the IMM of the tables is at most 10 % worse than the filter that is best there."""
    found = []
    for (sigma, best), sea in [(one, sea) for one in BEST_OF.items() for sea in seas]:
        for p, end in chains.items():
            for j, column in enumerate(scores.COLUMNS):
                ours = sea.flown.cell_ratio(j, f"{IMM}{end}", best, sigma)
                what = f"{column} at {sigma:g} m/s over that of {best}, {p}, {sea.start}"
                group = f"{column.partition('_')[0]} at {sigma:g} m/s"
                found.append(condition(what, ours, high=1.0 + LITTLE, group=group))
    return found


def best_and_worst(seas: Sequence[Sea]) -> list[Condition]:
    """4.25: best in one table is worst in the other; each pair of filters counts once."""
    names = ("EKF 0.1", "AFEKF 0.1", "EKF 0.5", "AFEKF 0.5")
    sides = {
        (2, "best", "EKF 0.1"): names[1:],
        (2, "worst", "AFEKF 0.5"): names[1:3],
        (3, "worst", "EKF 0.1"): names[1:],
        (3, "best", "AFEKF 0.5"): names[1:3],
    }
    found = []
    for sea in seas:
        for (table, place, name), others in sides.items():
            for other in others:
                ours = sea.flown.cell_ratio(0, name, other, printed.SIGMA[table])
                region = {"high": 1.0} if place == "best" else {"low": 1.0}
                what = f"Table {table}: position error, {name} over {other}, {sea.start}"
                group = f"{name} {place} in Table {table}"
                found.append(condition(what, ours, **region, group=group))
    return found
