"""What a checkout holds: papers, their notebooks, their committed results.

A paper is a notebook in ``notebooks/`` called ``<number>_<name>.ipynb``; its name without
suffix, the stem, names its results too. Notebooks with other names are a user's own. Every
function takes `root`, the checkout.
"""

import json
import re
from pathlib import Path

import nbformat


class Refused(Exception):
    """A run, a store or a comparison that did not succeed; the message is one line."""


def papers(root: Path, pick: str | None = None) -> list[str]:
    """Return the stems of all papers, or of the one whose number or stem is `pick`."""
    stems = sorted(path.stem for path in (root / "notebooks").glob("*.ipynb"))
    stems = [stem for stem in stems if re.fullmatch("[0-9]+_[A-Za-z0-9_]+", stem)]
    chosen = [stem for stem in stems if pick in (None, stem, stem.partition("_")[0])]
    if pick and not chosen:
        raise Refused(f"no paper {pick!r}; there are: {', '.join(stems) or 'none yet'}")
    return chosen


def notebook(root: Path, stem: str) -> nbformat.NotebookNode:
    """Return the notebook of a paper."""
    return nbformat.read(root / "notebooks" / f"{stem}.ipynb", as_version=4)


def manifest(root: Path) -> dict:
    """Return the manifest of the committed results, an entry per paper."""
    path = root / "paper_figures" / "manifest.json"
    return json.loads(path.read_text()) if path.exists() else {}


def claims(root: Path) -> dict[str, dict]:
    """Return the committed claims of every paper, by stem."""
    paths = {stem: root / "paper_figures" / stem / "claims.json" for stem in papers(root)}
    return {stem: json.loads(p.read_text()) for stem, p in paths.items() if p.exists()}
