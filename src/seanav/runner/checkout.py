"""What a checkout holds: papers, their notebooks, their committed results.

A paper is a notebook in ``notebooks/`` called ``<number>_<name>.ipynb``; its name without
suffix, the stem, names its results too. One with the number 0 is a lesson: it has no claims
and leaves no results. Notebooks with other names are a user's own. Every function takes
`root`, the checkout.
"""

import json
import re
from collections.abc import Iterable
from pathlib import Path

import nbformat

from seanav._files import write


class Refused(Exception):
    """A run, a store or a comparison that did not succeed; the message is one line."""


def papers(root: Path, picks: str | Iterable[str] | None = None) -> list[str]:
    """Return the stems of all papers, or of those whose number or stem is in `picks`."""
    stems = [stem for stem in _numbered(root) if stem not in lessons(root)]
    picks = [picks] if isinstance(picks, str) else picks
    if not picks:
        return stems
    chosen = set()
    for pick in picks:
        found = {stem for stem in stems if pick in (stem, stem.partition("_")[0])}
        if not found:
            raise Refused(f"no paper {pick!r}; there are: {', '.join(stems) or 'none yet'}")
        chosen |= found
    return sorted(chosen)


def lessons(root: Path) -> list[str]:
    """Return the stems of all lessons."""
    return [stem for stem in _numbered(root) if stem.startswith("0_")]


def _numbered(root):
    stems = sorted(path.stem for path in (root / "notebooks").glob("*.ipynb"))
    return [stem for stem in stems if re.fullmatch("[0-9]+_[A-Za-z0-9_]+", stem)]


def notebook(root: Path, stem: str) -> nbformat.NotebookNode:
    """Return the notebook of a paper."""
    return nbformat.read(root / "notebooks" / f"{stem}.ipynb", as_version=4)


def parameters_cell(book: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """Return the one cell that is tagged ``parameters``, or raise `Refused`."""
    cells = [cell for cell in book.cells if "parameters" in cell.metadata.get("tags", [])]
    if len(cells) != 1:
        raise Refused(f"{len(cells)} cells are tagged 'parameters', must be exactly one")
    return cells[0]


def declare(root: Path, stem: str, source: str) -> bool:
    """Make `source` the parameters cell of a paper's notebook; return whether it was another."""
    book = notebook(root, stem)
    cell = parameters_cell(book)
    other = cell.source != source
    if other:
        cell.source = source
        write(root / "notebooks" / f"{stem}.ipynb", nbformat.writes(book) + "\n")
    return other


def manifest(root: Path) -> dict:
    """Return the manifest of the committed results, an entry per paper."""
    path = root / "paper_figures" / "manifest.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def results(root: Path) -> dict[str, Path]:
    """Return the folder of committed results of every paper that has them, by stem."""
    folders = {stem: root / "paper_figures" / stem for stem in papers(root)}
    whole = ("claims.json", "findings.json")
    return {k: path for k, path in folders.items() if all((path / n).exists() for n in whole)}


def claims(root: Path) -> dict[str, dict]:
    """Return the committed claims of every paper, by stem."""
    return {stem: claims_in(folder) for stem, folder in results(root).items()}


def claims_in(folder: Path) -> dict[str, dict]:
    """Return the claims in a folder of results, by number."""
    return json.loads((folder / "claims.json").read_text(encoding="utf-8"))


def findings_in(folder: Path) -> dict[str, str]:
    """Return the findings in a folder of results, one sentence each by its title."""
    return json.loads((folder / "findings.json").read_text(encoding="utf-8"))
