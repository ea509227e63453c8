"""Judge all claims again with a seed that was never run before."""

import csv
import io
from pathlib import Path

from seanav._files import write
from seanav.claims import CONFIRMATION, confirmation
from seanav.runner.checkout import Refused, claims_in, notebook, papers, results
from seanav.runner.run import defaults, run

COLUMNS = ("paper", "claim", "condition", "seed", "outcome", "again")


def confirm(root: Path, seed: int, stems: list[str]) -> list[dict[str, str]]:
    """Run papers at full scale with another seed and note the outcome of every condition.

    The results stay in ``build/params/``; ``paper_figures/confirmation.csv`` is written whole.
    A condition whose outcome changes counts as undecided in the next `make figures`.

    Parameters
    ----------
    root : Path
    seed : int
        Of all papers; nobody may have looked at a run with it before.
    stems : list of str
        Papers to confirm; the rows of the others stay.

    Returns
    -------
    list of dict
        The rows whose outcome changed.

    Raises
    ------
    Refused
        If a paper has no results, or its own results have this seed, or a run fails.
    """
    path, committed = root / CONFIRMATION, results(root)
    for stem in stems:
        if stem not in committed:
            raise Refused(f"{stem}: no committed results: make figures")
        if defaults(notebook(root, stem)).get("seed") == seed:
            raise Refused(f"seed = {seed}: the committed results of {stem} have it, take another")
    kept = [row for row in confirmation(root) if row["paper"] not in stems]
    for stem in stems:
        again = run(root, stem, words=(f"seed={seed}",))
        kept += compare(stem, seed, claims_in(committed[stem]), claims_in(again))
    kept.sort(key=lambda row: papers(root).index(row["paper"]))
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(kept)
    write(path, text.getvalue())
    return [row for row in kept if row["outcome"] != row["again"]]


def compare(stem: str, seed: int, claims: dict, again: dict) -> list[dict[str, str]]:
    """Return a row for every condition that counts: its outcome, and that with the seed.

    A condition that the other run does not have, such as one that names the best of several
    paths, was not met ``again``.
    """
    rows = []
    for number, claim in claims.items():
        others = {c["what"]: c["outcome"] for c in again[number]["conditions"] if not c["aside"]}
        for c in claim["conditions"]:
            if not c["aside"]:
                found = others.get(c["what"], "another condition")
                values = (stem, number, c["what"], str(seed), c["outcome"], found)
                rows.append(dict(zip(COLUMNS, values, strict=True)))
    return rows
