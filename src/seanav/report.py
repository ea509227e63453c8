"""What a paper's notebook hands over: figures, tables, claims, deviations, provenance."""

import csv
import io
import json
import math
import os
import re
import secrets
import shutil
import warnings
import weakref
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import attrs
import numpy as np
import PIL.Image
from IPython.display import Image
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from seanav._files import lock, place, write
from seanav._pictures import palette_png, rounded
from seanav.estimates import Estimate
from seanav.scenario import ORIGINS

SHOWN_DPI = 100  # of the picture in the notebook; the saved one has twice as many
VERDICTS = ("reproduced", "partly", "not reproduced", "cannot be tested")

# ---------------------------------------------------------------- numbers as text


def significant(x: float | Estimate, digits: int = 3) -> str:
    """Return `x` rounded to `digits` significant digits; an estimate with its interval.

    Integers are printed in full. The one helper for every printed number: what it
    prints is the same on every machine.
    """
    if isinstance(x, Estimate) and x.diverged:
        return "diverges"
    if isinstance(x, Estimate):
        value, low, high = (significant(float(y), digits) for y in (x.value, x.low, x.high))
        return value if x.low == x.high else f"{value} [{low}, {high}]"
    if isinstance(x, Integral):
        return str(int(x))
    x = float(x)
    if not math.isfinite(x):
        return str(x)
    if x == 0.0:
        return "0"
    scientific = f"{x:.{digits - 1}e}"
    exponent = int(scientific.partition("e")[2])
    if -4 <= exponent < 6:
        return f"{float(scientific):.{max(digits - 1 - exponent, 0)}f}"
    return scientific


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


def _print_table(columns, rows):
    def shown(x):
        return significant(x) if isinstance(x, Real) and not isinstance(x, bool) else _cell(x)

    lines = [list(map(str, columns)), *([shown(x) for x in row] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        print("  ".join(x.ljust(width) for x, width in zip(line, widths, strict=True)).rstrip())


# ---------------------------------------------------------------- claims


@dataclass(frozen=True)
class Condition:
    """One condition under which a claim is tested, with the region that it claims.

    Attributes
    ----------
    what : str
        The condition in words, such as ``"test 1, R = 2 mGal"``.
    estimate : Estimate
        The number that the claim is about.
    low, high : float
        The claimed region, ends included; fixed before the full-scale run.
    """

    what: str
    estimate: Estimate
    low: float = -math.inf
    high: float = math.inf

    @property
    def outcome(self) -> str:
        """``holds``, ``fails`` or ``straddles``: where the whole interval lies.

        A number of a filter that diverged supports nothing: it fails.
        """
        if self.estimate.diverged:
            return "fails"
        if self.low <= self.estimate.low and self.estimate.high <= self.high:
            return "holds"
        if self.estimate.high < self.low or self.high < self.estimate.low:
            return "fails"
        return "straddles"

    def __str__(self):
        low = f"at least {significant(self.low)}" if math.isfinite(self.low) else ""
        high = f"at most {significant(self.high)}" if math.isfinite(self.high) else ""
        region = " and ".join(filter(None, (low, high))) or "any value"
        return f"{self.what}: {significant(self.estimate)}, claimed {region}, {self.outcome}"


def verdict(conditions: Iterable[Condition]) -> str:
    """Return the verdict on a claim; it is never typed, only computed.

    ``reproduced`` if it holds under every condition, ``not reproduced`` if it fails
    under every one, ``partly`` otherwise, ``cannot be tested`` without a condition.
    """
    outcomes = {condition.outcome for condition in conditions}
    if not outcomes:
        return "cannot be tested"
    if len(outcomes) > 1:
        return "partly"
    return {"holds": "reproduced", "fails": "not reproduced"}.get(outcomes.pop(), "partly")


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
    paper_se = ours.se if paper_runs_se is None else paper_runs_se
    se = math.hypot(ours.se, paper_se) / abs(ours.value)
    return abs(math.log(ours.value / printed)) <= 2.0 * se


# ---------------------------------------------------------------- the report


class Report:
    """The results of one notebook run, written to one folder and shown in the notebook.

    Parameters
    ----------
    stem : str
        Name of the notebook and of its folder of results.
    scenario : seanav.scenario.Parameters
        The validated parameters of the run; they go into the manifest.
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

    def __init__(self, stem: str, *, scenario: Any, seed: int, quick: bool = False):
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
        self._claims = {}
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
        png, drawn = self._new("figure", number, ".png"), io.BytesIO()
        rounded(fig)
        dates = dict.fromkeys(("Creator", "Producer", "CreationDate"))
        with warnings.catch_warnings():
            # Says only that a busy machine took over a second to place a legend.
            warnings.filterwarnings("ignore", "Creating legend with loc")
            fig.savefig(drawn, format="png", dpi=2 * SHOWN_DPI)
            fig.savefig(png.with_suffix(".pdf"), metadata=dates)
        width = round(96 * fig.get_figwidth())
        plt.close(fig)
        with PIL.Image.open(drawn) as picture:
            whole = picture.convert("RGB")
        png.write_bytes(palette_png(whole, 2 * SHOWN_DPI))
        print(f"Figure {number}. {caption}")
        small = palette_png(whole.reduce(2), SHOWN_DPI)
        return Image(small, format="png", width=width, alt=caption)

    def table(self, number: int | str, columns: list[str], rows: list, caption: str) -> None:
        """Save a table as CSV and print it, numbers rounded by `significant`."""
        rows = [list(row) for row in rows]
        write(self._new("table", number, ".csv"), _csv(columns, rows))
        print(f"Table {number}. {caption}")
        _print_table(columns, rows)

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
        _print_table(("name", "value", "unit", "origin"), table)

    def deviation(
        self,
        table: str,
        row: str,
        column: str,
        printed: float,
        ours: Estimate,
        paper_runs_se: float | None = None,
    ) -> bool:
        """Note a number that the paper prints beside ours; return whether they `agree`."""
        agree = agrees(printed, ours, paper_runs_se)
        numbers = [printed, ours.value, ours.low, ours.high, agree]
        self._deviations.append([table, row, column, *map(_cell, numbers)])
        return agree

    def claim(self, number: str, text: str, conditions: list[Condition], basis: str) -> None:
        """Judge one claim of the paper and print the verdict on one line.

        Parameters
        ----------
        number : str
            Number of the claim, such as ``"5.3"``.
        text : str
            The claim.
        conditions : list of Condition
            Where it is tested; the first one gives the value that is shown. None if
            the paper gives no testable statement.
        basis : str
            How the numbers are computed; the outcome of each condition is added.
        """
        number = str(number)
        if number in self._claims:
            raise ValueError(f"claim {number} is judged twice")
        conditions = list(conditions)
        first = conditions[0].estimate if conditions else None
        self._claims[number] = {
            "claim": text,
            "verdict": verdict(conditions),
            "value": None if first is None or first.diverged else first.value,
            "interval": [first.low, first.high] if first and first.low < first.high else None,
            "basis": ". ".join([basis.rstrip(". "), *map(str, conditions)]) + ".",
        } | ({"quick": True} if self._quick else {})
        shown = f" ({significant(first)})" if first else ""
        print(f"{number} {verdict(conditions)}: {text}{shown}")

    def finish(self, expected_claims: Iterable[str]) -> None:
        """Write claims, deviations and parameters; the results are complete from here on.

        Raises
        ------
        ValueError
            If a claim of `expected_claims` was not judged, or one beyond them was, or
            the origins of the parameters are missing.
        """
        expected = [str(number) for number in expected_claims]
        if set(expected) != set(self._claims):
            odd = ", ".join(sorted(set(expected) ^ set(self._claims)))
            raise ValueError(f"claims expected and claims judged differ: {odd}")
        if self._origins is None:
            raise ValueError("the origins of the parameters are missing")
        deviations = ["table", "row", "column", "printed", "ours", "low", "high", "agrees"]
        write(self._folder / "deviations.csv", _csv(deviations, self._deviations))
        origins = ["name", "value", "unit", "origin"]
        write(self._folder / "parameters.csv", _csv(origins, self._origins))
        claims = {number: self._claims[number] for number in expected}
        values = {number: claim["value"] for number, claim in claims.items()}
        self._about["headline"] = {n: significant(x) for n, x in values.items() if x is not None}
        write(self._folder / "claims.json", json_text(claims))
        with lock(self._results.with_name(f".{self._results.name}.lock")):
            # Beside the folder, not in it: the runner moves this part into the manifest.
            write(self._results.with_suffix(".json"), json_text(self._about))
            place(self._folder, self._results)
        self._folder = self._results
        Report._style.close()
        counts = [sum(c["verdict"] == v for c in claims.values()) for v in VERDICTS]
        print("; ".join(f"{n} {v}" for n, v in zip(counts, VERDICTS, strict=True)))
