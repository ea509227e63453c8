"""Paper 2: long tables kept whole, shown as pivots that fit a screen."""

from collections.abc import Callable, Sequence

from seanav.estimates import significant
from seanav.report import print_table

# A phase beside the name of its course, in few letters.
PHASES = {"before turn": "before", "turn": "turning", "after turn": "after", "examination": ""}


def pivot(
    rows: list,
    down: Sequence[int],
    across: int,
    value: int,
    write: Callable[[float], str] = significant,
) -> list[list[str]]:
    """Return a table of texts: the headings, then a line for each entry of the columns `down`.

    Parameters
    ----------
    rows : list of sequence
        A long table.
    down : sequence of int
        Columns whose entries together name a line of the new table.
    across : int
        Column whose entries are its headings.
    value : int
        Column of the numbers; where there is none, the place stays empty.
    write : callable
        Number -> text.
    """
    found: dict[str, dict[str, str]] = {}
    headings: dict[str, None] = {}
    for row in rows:
        line = ", ".join(filter(None, (_name(row[k]) for k in down)))
        headings[_name(row[across])] = None
        found.setdefault(line, {})[_name(row[across])] = write(row[value])
    lines = [[line, *(cells.get(h, "") for h in headings)] for line, cells in found.items()]
    return [["", *headings], *lines]


def _name(x):
    return PHASES.get(x, x) if isinstance(x, str) else f"{x:g}"


def per_cent(share: float) -> str:
    """Return a share in per cent."""
    return significant(100 * share)


def show(table: list[list[str]], title: str) -> None:
    """Print a table of texts under its `title`, and an empty line after it."""
    print_table([title, *table[0][1:]], table[1:])
    print()


def widest(rows: list, value: int) -> str:
    """Return the largest half-width of the intervals beside column `value`, in per cent of it."""
    shares = [(row[value + 2] - row[value + 1]) / 2 / row[value] for row in rows if row[value]]
    return f"{significant(100 * max(shares, default=0.0), 2)} %"


def factors(rows: list, title: str) -> None:
    """Print `scores.factor_rows` of the whole examination: the error by level and course.

    The last column is the share of runs won on the steady course.
    """
    whole = [row for row in rows if row[2] == "examination"]
    errors = pivot(whole, (0,), 1, 3)
    steady = {_name(row[0]): per_cent(row[6]) for row in whole if row[1] == "steady"}
    errors[0].append("won, steady")
    for line in errors[1:]:
        line.append(steady.get(line[0], ""))
    show(errors, title)
    print(f"RMSE in m/s, its 95 % interval at most ±{widest(whole, 3)}; runs won in per cent")
    most = max(whole, key=lambda row: row[6] if row[1] != "steady" else -1.0)
    if most[6] > 0 and most[1] != "steady":
        print(f"most runs won elsewhere: {per_cent(most[6])} % ({most[1]}, {_name(most[0])})")
    else:
        print("no run was won on the other courses")
