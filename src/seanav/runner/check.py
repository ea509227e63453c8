"""Compare the results of a run with the committed ones."""

import csv
import fnmatch
import json
import math
import tomllib
from pathlib import Path

from seanav.runner.checkout import Refused, claims_in, manifest, papers, results
from seanav.runner.publish import mend, provenance
from seanav.runner.summary import PICTURE, in_readme, summary


def check(root: Path, fresh: Path, rtol: float = 1e-6) -> list[str]:
    """Compare the results of full runs in `fresh` with the committed ones.

    Parameters
    ----------
    root, fresh : Path
        The checkout; the folder with one folder of results per paper.
    rtol : float
        Relative tolerance of each number. Exceptions, each with its reason, are in
        ``tests/tolerances.toml``.

    Returns
    -------
    list of str
        What differs, one line each; empty if all is well.
    """
    path = root / "tests" / "tolerances.toml"
    exceptions = (
        tomllib.loads(path.read_text(encoding="utf-8"))["exception"] if path.exists() else []
    )
    if not all(exception.get("reason") for exception in exceptions):
        raise Refused(f"{path.name}: every exception needs a reason")
    mend(root)
    wrong = []
    for stem in papers(root):
        committed, entry = root / "paper_figures" / stem, manifest(root).get(stem)
        if entry is None or not committed.is_dir():
            wrong.append(f"{stem}: no committed results: make figures")
            continue
        if not (fresh / stem / "claims.json").is_file():
            wrong.append(f"{stem}: no complete results in {fresh.name}")
            continue
        now = provenance(root, stem, committed)
        changed = [key for key in now if now[key] != entry.get(key)]
        wrong += [f"{stem}: {key} are not those of the manifest" for key in changed]
        about = json.loads((fresh / f"{stem}.json").read_text(encoding="utf-8"))
        old, new = _flat({key: entry.get(key) for key in about}), _flat(about)
        wrong += _differences(f"{stem}/manifest", old, new, rtol, exceptions)
        names = {p.name for p in [*committed.iterdir(), *(fresh / stem).iterdir()]}
        for name in sorted(names):
            pair = committed / name, fresh / stem / name
            missing = [p.parent.parent.name for p in pair if not p.exists()]
            if missing:
                wrong.append(f"{stem}/{name}: missing in {missing[0]}")
                continue
            same = pair[0].read_bytes() == pair[1].read_bytes()
            print(f"{stem}/{name}: {'identical' if same else 'other bytes'}")
            old, new = map(_numbers, pair)
            wrong += _differences(f"{stem}/{name}", old, new, rtol, exceptions)
    strays = {p.name for p in (root / "paper_figures").glob("[!.]*/")} - set(papers(root))
    wrong += [f"paper_figures/{name}: no such paper" for name in sorted(strays)]
    return wrong + _made_from_claims(root)


def _made_from_claims(root):
    folders = results(root)
    if not folders:
        return []
    everything = {stem: claims_in(folder) for stem, folder in folders.items()}
    report, wrong = root / "paper_figures" / "REPORT.md", []
    text = report.read_text(encoding="utf-8") if report.exists() else None
    if text != summary(root, folders, everything) or not report.with_name(PICTURE).exists():
        wrong.append("REPORT.md is not that of the claims: make figures")
    text, wanted = in_readme(root, everything)
    return wrong + (["README.md counts other claims: make notebooks"] if text != wanted else [])


def _numbers(path):
    if path.suffix == ".json":
        return _flat(json.loads(path.read_text(encoding="utf-8")))
    if path.suffix == ".csv":
        with path.open(encoding="utf-8") as file:
            header, *rows = csv.reader(file)
        cells = [dict(zip(header, row, strict=True)) for row in rows]
        return _flat({"columns": header, "row": cells})
    return {}  # pictures: their numbers are in the notebook and in the tables


def _flat(x, key=""):
    if isinstance(x, (dict, list)):
        items = x.items() if isinstance(x, dict) else enumerate(x, 1)
        return {k: v for name, item in items for k, v in _flat(item, f"{key}/{name}").items()}
    return {key.strip("/"): x}


def _differences(name, old, new, rtol, exceptions):
    wrong = []
    for key in sorted(old.keys() | new.keys()):
        where, was, now = f"{name}: {key}", old.get(key, "missing"), new.get(key, "missing")
        allowed = {"rtol": rtol, "atol": 0.0}
        for exception in exceptions:
            if fnmatch.fnmatch(where, exception["match"]):
                allowed |= exception
        if not _close(was, now, allowed):
            wrong.append(f"{where}: {was} was {now} here")
    return wrong


def _close(a, b, allowed):
    try:
        return math.isclose(float(a), float(b), rel_tol=allowed["rtol"], abs_tol=allowed["atol"])
    except (TypeError, ValueError):
        return a == b
