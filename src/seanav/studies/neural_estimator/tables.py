"""Paper 2: long tables kept whole, shown as pivots that fit a screen."""

import io
import textwrap
from collections.abc import Sequence
from contextlib import redirect_stdout

from seanav.estimates import significant
from seanav.report import Report

WIDEST = 10  # of a heading, in letters, before it goes on in the next line


def keep(report: Report, number: int | str, columns: Sequence, rows: list, caption: str) -> None:
    """Save a long table as `Report.table` does, and print its caption only: a pivot follows."""
    with redirect_stdout(io.StringIO()):
        report.table(number, list(columns), rows, caption)
    print(f"Table {number}. {caption}")


def pivot(rows: list, down: Sequence[int], across: Sequence[int], value: int) -> list[list[str]]:
    """Return a table of texts: headings, then a line for each entry of the columns `down`.

    Parameters
    ----------
    rows : list of sequence
        A long table.
    down, across : sequence of int
        Columns whose entries name a line, and a heading, of the new table.
    value : int
        Column of the numbers, rounded by `seanav.estimates.significant`; what is missing
        stays empty.
    """
    found: dict[str, dict[str, str]] = {}
    headings: dict[str, None] = {}
    for row in rows:
        line, heading = (_name(row, columns) for columns in (down, across))
        headings[heading] = None
        found.setdefault(line, {})[heading] = significant(row[value])
    lines = [[line, *(cells.get(h, "") for h in headings)] for line, cells in found.items()]
    return [["", *headings], *lines]


def _name(row, columns):
    return " ".join(
        x if isinstance(x := row[k], str) else f"{x:g}" for k in columns if row[k] != ""
    )


def show(table: list[list[str]], title: str) -> None:
    """Print a table of texts under its `title`; long headings take several lines."""
    headings = [textwrap.wrap(heading, WIDEST) for heading in table[0][1:]]
    height = max(map(len, headings), default=0)
    tops = [[""] * (height - len(h)) + h for h in headings]
    lines = [[title if k == height - 1 else "", *(t[k] for t in tops)] for k in range(height)]
    lines += table[1:]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        print("  ".join(x.ljust(width) for x, width in zip(line, widths, strict=True)).rstrip())


def widest(rows: list, value: int) -> str:
    """Return the largest half-width of the intervals beside column `value`, in per cent of it."""
    shares = [(row[value + 2] - row[value + 1]) / 2 / row[value] for row in rows if row[value]]
    return f"{significant(100 * max(shares, default=0.0), 2)} %"


def factors(rows: list, cases: Sequence[tuple[str, str]], title: str) -> None:
    """Print `scores.factor_rows` as pivots: error by level and phase, and the share won.

    Only phases of `cases`, which tell of no step twice; of the shares only the phases where
    any run was won.
    """
    told = [
        [row[0], row[1], "" if row[2] == "examination" else row[2], *row[3:]]
        for row in rows
        if (row[1], row[2]) in cases
    ]
    show(pivot(told, (0,), (1, 2), 3), title)
    print("RMSE in m/s; its 95 % interval is at most ±" + widest(told, 3))
    won = {(row[1], row[2]) for row in told if row[6]}
    per_cent = [[*row[:6], 100 * row[6]] for row in told if (row[1], row[2]) in won]
    if per_cent:
        show(pivot(per_cent, (0,), (1, 2), 6), "won, %")
    if len(won) < len({(row[1], row[2]) for row in told}):
        print("no run was won elsewhere" if won else "no run was won anywhere")
