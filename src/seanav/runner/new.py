"""Lay out a new paper: a small one that runs and is judged, to be replaced part by part."""

import re
from importlib import resources
from pathlib import Path

import nbformat
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from seanav._files import write
from seanav.runner.checkout import Refused, papers

ROOM = "src/seanav/studies/{name}/"
FILES = {
    "init": ROOM + "__init__.py",
    "scenario": ROOM + "scenario.py",
    "claims": ROOM + "claims.py",
    "run": ROOM + "run.py",
    "figures": ROOM + "figures.py",
    "test": "tests/studies/test_{name}.py",
    "notebook": "notebooks/{stem}.ipynb",  # last: with it the paper is there
}
KERNEL = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}


def new(root: Path, stem: str) -> list[Path]:
    """Write notebook, study and tests of a paper that is not there yet; return the files.

    Parameters
    ----------
    stem : str
        Number and name, such as ``6_wave_filter``.

    Raises
    ------
    Refused
        If `stem` is no such name, `root` is no checkout, or its number, its name or one of the
        files is taken.
    """
    fits = re.fullmatch(r"([1-9][0-9]*)_([a-z][a-z0-9_]*)", stem)
    if not fits:
        raise Refused(f"{stem!r} must be a number and a name in small letters, like 6_wave_filter")
    if not (root / "notebooks").is_dir():
        raise Refused(f"{root} is no checkout: a new paper belongs beside its notebooks")
    number, name = fits.groups()
    if taken := [paper for paper in papers(root) if paper.partition("_")[0] == number]:
        raise Refused(f"{stem}: paper {number} is {taken[0]}")
    paths = {kind: root / path.format(name=name, stem=stem) for kind, path in FILES.items()}
    if there := [path for path in paths.values() if path.exists()]:
        raise Refused(f"{stem}: {there[0].relative_to(root)} is there already")
    for kind, path in paths.items():
        text = resources.files(__package__).joinpath("blank", f"{kind}.txt").read_text("utf-8")
        for word, value in (("NUMBER", number), ("NAME", name), ("STEM", stem)):
            text = text.replace(f"@{word}@", value)
        path.parent.mkdir(parents=True, exist_ok=True)
        write(path, _notebook(text) if kind == "notebook" else text)
    return list(paths.values())


def _notebook(text):
    cells = []
    for number, part in enumerate(re.split(r"^# %% ", text, flags=re.M)[1:]):
        kind, _, source = part.partition("\n")
        make = new_markdown_cell if kind == "markdown" else new_code_cell
        tags = {"tags": kind.split()[1:]} if " " in kind else {}
        cells.append(make(source.strip(), id=f"cell-{number:03d}", metadata=tags))
    seconds = {"seanav": {"expected_seconds": {"full": 10, "quick": 10}}}
    book = new_notebook(cells=cells, metadata=KERNEL | seconds)
    return nbformat.writes(book) + "\n"
