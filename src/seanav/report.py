"""What a paper's notebook hands over: figures, tables, claims, deviations, provenance."""

import csv
import io
import json
import os
import re
import secrets
import shutil
import textwrap
import weakref
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from itertools import zip_longest
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import attrs
import numpy as np
from IPython.display import Image
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from seanav._files import lock, place, write
from seanav._pictures import SHOWN_DPI, palette_png, save, shown
from seanav.claims import (
    VERDICTS,
    Claim,
    Condition,
    agrees,
    by_groups,
    changed,
    counted,
    judged,
    told,
)
from seanav.estimates import Estimate, significant
from seanav.scenario import ORIGINS, Parameters

# Where a user's choice of filters and settings leaves nothing of what a claim speaks of.
NOTHING = Condition("what it speaks of", "nothing of what it speaks of was run")
PAGE, VALUE = 95, 24  # columns: of a page that does not wrap, of a value of a parameter

# ---------------------------------------------------------------- numbers as text


def _stored(x):
    """Return `x` as stored in result files: ten digits, plain Python types."""
    if isinstance(x, dict):
        return {str(key): _stored(item) for key, item in x.items()}
    if isinstance(x, (list, tuple, np.ndarray)):
        return [_stored(item) for item in x]
    if isinstance(x, (bool, np.bool_)):
        return bool(x)
    if isinstance(x, Integral):
        return int(x)
    if isinstance(x, Real):
        return float(f"{x:.10g}")
    return x if x is None else str(x)


def _cell(x: Any) -> str:
    if isinstance(x, (bool, np.bool_)):
        return "true" if x else "false"
    if isinstance(x, Real) and not isinstance(x, Integral):
        return f"{x:.10g}"
    return "" if x is None else str(x)


def _csv(columns: Sequence, rows: list) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        if len(row) != len(columns):
            raise ValueError(f"row {row!r} does not fit the columns {list(columns)!r}")
        writer.writerow([_cell(x) for x in row])
    return text.getvalue()


def json_text(content: dict) -> str:
    """Return `content` as the JSON text of a result file, numbers with ten digits."""
    return json.dumps(_stored(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def print_table(columns: Sequence, rows: Iterable) -> None:
    """Print a table in columns as wide as needed; numbers with three significant digits."""

    def shown(x):
        return significant(x) if isinstance(x, Real) and not isinstance(x, bool) else _cell(x)

    lines = [list(map(str, columns)), *([shown(x) for x in row] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        _print_line(line, widths)


def _print_line(line, widths):
    print("  ".join(x.ljust(width) for x, width in zip(line, widths, strict=True)).rstrip())


def _print_sentence(text):
    indent = " " * (len(text) - len(text.lstrip()) + 2)
    print(textwrap.fill(text, PAGE, subsequent_indent=indent, break_long_words=False))


def _print_folded(columns, rows):
    """Print a table whose values and last column are folded, so that a page holds it."""
    name, unit = (max(len(_cell(row[k])) for row in [columns, *rows]) for k in (0, 2))
    widths = (name, VALUE, unit, max(VALUE, PAGE - name - VALUE - unit - 6))
    for row in [columns, *rows]:
        told = [significant(x) if isinstance(x, float) else _cell(x) for x in row]
        folded = [textwrap.wrap(x, width) or [""] for x, width in zip(told, widths, strict=True)]
        for line in zip_longest(*folded, fillvalue=""):
            _print_line(line, widths)


# ---------------------------------------------------------------- the report


class Report:
    """The results of one notebook run, written to one folder and shown in the notebook.

    Parameters
    ----------
    stem : str
        Name of the notebook and of its folder of results.
    scenario : seanav.scenario.Parameters
        The validated parameters of the run; they go into the manifest.
    claims : sequence of seanav.claims.Claim
        The claims of the paper, all of which must be judged.
    seed : int
        Seed of the run.
    quick : bool
        Whether this is the reduced run; its claims are marked.

    Notes
    -----
    The runner says where to write; a notebook run by hand writes below ``build/``.
    Everything is written aside; `finish` puts it in place of an older folder of the same
    name, so that two kernels never mix their results. From here to `finish` pyplot draws
    in this project's style, whatever a user's own settings are.
    """

    _style = ExitStack()  # of the last report only

    def __init__(
        self,
        stem: str,
        *,
        scenario: Any,
        claims: Sequence[Claim],
        seed: int,
        quick: bool = False,
    ):
        checkout = Path(__file__).resolve().parents[2]
        by_hand = (
            checkout if (checkout / "pyproject.toml").is_file() else Path()
        ) / "build/by_hand"
        self._results = Path(os.environ.get("SEANAV_RESULTS") or by_hand).resolve() / stem
        self._folder = self._results.with_name(f".{stem}-{secrets.token_hex(4)}")
        self._folder.mkdir(parents=True)
        # What was not finished goes with the kernel, or with a report that replaces it.
        weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        self._about = {
            "seed": seed,
            "quick": quick,
            "parameters": attrs.asdict(scenario),
        }
        self._quick = quick
        self._declared = {claim.number: claim for claim in claims}
        self._claims = {}
        own = isinstance(scenario, Parameters) and scenario == type(scenario)()
        self._changed = changed(checkout, stem) if own else set()
        self._findings: dict[str, str] = {}
        self._deviations = []
        self._origins: list | None = None
        Report._style.close()
        Report._style.enter_context(plt.style.context("seanav.seanav", after_reset=True))

    def _new(self, name, number, suffix):
        label = f"{number:02d}" if isinstance(number, int) and name == "figure" else str(number)
        if not re.fullmatch(r"\w+", label):
            raise ValueError(f"{number!r} is not a number or short name for a {name}")
        path = self._folder / f"{name}_{label}{suffix}"
        if path.exists():
            raise ValueError(f"{name} {number} is there already")
        return path

    def figure(self, number: int | str, fig: Figure, caption: str) -> Image:
        """Save `fig` as PNG and PDF, close it and return a smaller picture of it.

        A `number` that is a short name, such as ``"B1"``, goes beyond the paper. The
        notebook holds the smaller picture: hosting services show no large notebooks.
        """
        png = self._new("figure", number, ".png")
        dates = dict.fromkeys(("Creator", "Producer", "CreationDate"))
        whole, small = shown(fig, caption)
        save(fig, png.with_suffix(".pdf"), metadata=dates)
        plt.close(fig)
        png.write_bytes(palette_png(whole, 2 * SHOWN_DPI))
        print(f"Figure {number}. {caption}")
        return small

    def table(
        self,
        number: int | str,
        columns: list[str],
        rows: list,
        caption: str,
        *,
        shown: bool = True,
    ) -> None:
        """Save a table as CSV and print it, numbers rounded by `significant`.

        A long one that is not `shown` has its caption printed, and a shorter form follows.
        """
        rows = [list(row) for row in rows]
        write(self._new("table", number, ".csv"), _csv(columns, rows))
        print(f"Table {number}. {caption}")
        if shown:
            print_table(columns, rows)

    def parameters(self, rows: list[tuple]) -> None:
        """Save and print where each parameter comes from.

        Parameters
        ----------
        rows : list of (name, value, unit, origin) or (name, value, unit, origin, note)
            `origin`: text, public source, recalled, assumed or derived.
        """
        table = []
        for name, value, unit, origin, *note in rows:
            if origin.partition(":")[0] not in ORIGINS:
                raise ValueError(f"{name}: origin {origin!r} is none of {', '.join(ORIGINS)}")
            table.append([name, value, unit, ": ".join([origin, *note])])
        self._origins = table
        _print_folded(("name", "value", "unit", "origin"), table)

    def deviation(
        self,
        table: str,
        row: str,
        column: str,
        printed: float,
        ours: Estimate,
        paper_runs_se: float | None = None,
        why: str = "",
    ) -> bool:
        """Note a number that the paper prints beside ours; return whether they `agree`.

        `why` says what a difference, if there is one, comes from.
        """
        agree = agrees(printed, ours, paper_runs_se)
        numbers = [printed, ours.value, ours.low, ours.high, agree]
        self._deviations.append([table, row, column, *map(_cell, numbers), "" if agree else why])
        return agree

    def claim(self, number: str, conditions: Iterable[Condition], basis: str) -> None:
        """Judge one claim of the paper; print its words, our reading and the verdict.

        Parameters
        ----------
        number : str
            Number of a declared claim, such as ``"5.3"``.
        conditions : iterable of Condition
            Where it is tested; each is a fact of its own. None if nothing of what the claim
            speaks of was run; then that is said.
        basis : str
            How the numbers are computed.

        Raises
        ------
        ValueError
            If the claim is not declared, was judged already, or two conditions are the same.
        """
        if number not in self._declared or number in self._claims:
            raise ValueError(f"claim {number} is not declared, or is judged twice")
        found = [
            attrs.evolve(c, confirmed=False) if (number, c.what) in self._changed else c
            for c in conditions
        ] or [NOTHING]
        names = [condition.what for condition in found]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"claim {number}: there are two conditions {twice[0]!r}")
        claim = judged(self._declared[number], found, basis)
        self._claims[number] = claim | ({"quick": True} if self._quick else {})
        groups = by_groups(found) if len(by_groups(found)) > 1 else {}
        by_name = [f"    {name}: {counted(group)}" for name, group in groups.items()]
        for line in [*told(number, claim), *by_name]:
            _print_sentence(line)

    def findings(
        self, *, words: str, holds: str, fails: str, undecided: str, depends: str, beyond: str
    ) -> None:
        """Say shortly what the results mean; numbers in the sentences come from the results.

        Parameters
        ----------
        words : str
            The terms that the claims and conditions use, each explained.
        holds, fails, undecided : str
            What of the paper's claims holds, what fails, what stays open.
        depends : str
            What the verdicts hang on: readings and values that the paper does not give.
        beyond : str
            What we found beyond the paper.
        """
        self._findings = {
            "Words": words,
            "What holds": holds,
            "What fails": fails,
            "What is open": undecided,
            "What it hangs on": depends,
            "Beyond the paper": beyond,
        }
        for title, text in self._findings.items():
            _print_sentence(f"{title}. {text}")

    def finish(self) -> None:
        """Write claims, deviations and parameters; the results are complete from here on.

        Raises
        ------
        ValueError
            If a declared claim was not judged, is said to be shown in a result that is not
            there, or the findings or the origins of the parameters are missing.
        """
        if missing := [number for number in self._declared if number not in self._claims]:
            raise ValueError(f"claims that were not judged: {', '.join(missing)}")
        for number, claim in self._declared.items():
            for name in claim.shown:
                if not any(self._folder.glob(f"{name}.*")):
                    raise ValueError(f"claim {number} is shown in {name}, which is not there")
        if self._origins is None or not self._findings:
            what = "origins of the parameters" if self._origins is None else "findings"
            raise ValueError(f"the {what} are missing")
        deviations = ["table", "row", "column", "printed", "ours", "low", "high", "agrees", "why"]
        write(self._folder / "deviations.csv", _csv(deviations, self._deviations))
        origins = ["name", "value", "unit", "origin"]
        write(self._folder / "parameters.csv", _csv(origins, self._origins))
        claims = {number: self._claims[number] for number in self._declared}
        worst = {number: claim["decisive"] for number, claim in claims.items()}
        self._about["headline"] = {n: c["shown"] for n, c in worst.items() if c is not None}
        write(self._folder / "claims.json", json_text(claims))
        write(self._folder / "findings.json", json_text(self._findings))
        with lock(self._results.with_name(f".{self._results.name}.lock")):
            # Beside the folder, not in it: the runner moves this part into the manifest.
            write(self._results.with_suffix(".json"), json_text(self._about))
            place(self._folder, self._results)
        self._folder = self._results
        Report._style.close()
        counts = Counter(claim["verdict"] for claim in claims.values())
        print("; ".join(f"{counts[v]} {v}" for v in VERDICTS))
