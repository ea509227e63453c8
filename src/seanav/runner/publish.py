"""Publish a run: results, manifest, report, what make must know, the stored notebook."""

import ast
import csv
import hashlib
import json
import os
import shutil
import tomllib
from collections import Counter
from importlib.metadata import version
from pathlib import Path

import nbformat
from packaging.requirements import Requirement

from seanav.report import VERDICTS, json_text, significant
from seanav.runner.checkout import Refused, claims, manifest, notebook, papers


def publish(root: Path, stem: str, started: float) -> Path:
    """Replace the committed results by the fresh ones, then everything made from them."""
    full, final, old = root / "build/full", root / "paper_figures" / stem, root / "build/old" / stem
    shutil.rmtree(old, ignore_errors=True)
    old.parent.mkdir(parents=True, exist_ok=True)
    final.parent.mkdir(exist_ok=True)
    if final.exists():
        final.rename(old)
    (full / stem).rename(final)
    entry = json.loads((full / f"{stem}.json").read_text()) | provenance(root, stem)
    entries = manifest(root) | {stem: entry}
    entries = {stem: entries[stem] for stem in papers(root) if stem in entries}
    _write(root / "paper_figures" / "manifest.json", json_text(entries))
    _write(root / "paper_figures" / "REPORT.md", summary(root))
    # For make: what this run depended on. A file changed during the run is newer.
    stamp = root / "build" / "stamps" / stem
    stamp.parent.mkdir(parents=True, exist_ok=True)
    files = [path.relative_to(root).as_posix() for path in dependencies(root, stem)]
    rules = [f"build/stamps/{stem}: {' '.join(files)}", *(f"{file}:" for file in files)]
    stamp.with_suffix(".d").write_text("\n".join(rules) + "\n")
    stamp.touch()
    os.utime(stamp, (started, started))
    return final


def _write(path, text):
    aside = path.with_suffix(".new")
    aside.write_text(text)
    aside.replace(path)


def dependencies(root: Path, stem: str) -> list[Path]:
    """Return the package's files that a notebook imports, directly or not, by reading them."""
    from IPython.core.inputtransformer2 import TransformerManager  # knows % and ! lines

    cells = [c.source for c in notebook(root, stem).cells if c.cell_type == "code"]
    python = "\n".join(map(TransformerManager().transform_cell, cells))
    found, todo = {}, imports(python)
    while todo:
        name = todo.pop()
        base = root / "src" / name.replace(".", "/")
        module, package = base.with_suffix(".py"), base / "__init__.py"
        path = module if module.is_file() else package
        if name not in found and path.is_file():
            found[name] = path
            within = name if path == package else name.rpartition(".")[0]
            todo |= imports(path.read_text(), within)
    # Data files, such as the plot style, belong to the modules beside them.
    data = {p for path in found.values() for p in path.parent.iterdir() if p.is_file()}
    return sorted({*found.values(), *(p for p in data if p.suffix not in (".py", ".pyc"))})


def imports(source: str, package: str = "") -> set[str]:
    """Return the dotted names that Python `source` of `package` may import, parents included."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1]
            base = ".".join([*(above if node.level else []), *filter(None, [node.module])])
            names |= {f"{base}.{alias.name}" for alias in node.names}
    parts = [name.split(".") for name in names]
    return {".".join(part[: k + 1]) for part in parts for k in range(len(part))}


def store(root: Path, stem: str) -> None:
    """Write the outputs of the last full run into the notebook, clean of the run's traces."""
    path = root / "notebooks" / f"{stem}.ipynb"
    executed = root / "build" / "full" / path.name
    book = nbformat.read(executed, as_version=4) if executed.exists() else notebook(root, stem)
    sources = [[c.source for c in b.cells] for b in (book, notebook(root, stem))]
    if not executed.exists() or sources[0] != sources[1]:
        raise Refused(f"{stem}: there is no full run of the notebook as it is now")
    book.metadata = nbformat.from_dict(
        {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
            "seanav": book.metadata.get("seanav", {}),
        }
    )
    for cell in book.cells:
        kept = {key: cell.metadata[key] for key in ("tags", "jupyter") if cell.metadata.get(key)}
        cell.metadata = nbformat.from_dict(kept)
    text = nbformat.writes(book) + "\n"
    if text != path.read_text():
        times = (root / "build" / "stamps" / stem).stat()
        _write(path, text)
        # The outputs are new, the code is not: make need not run it again.
        os.utime(path, (times.st_atime, times.st_mtime))


# ---------------------------------------------------------------- provenance and report


def _sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def provenance(root: Path, stem: str) -> dict:
    """Return what a manifest entry must say about the files, the packages and the lock."""
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    names = [Requirement(line).name for line in project["dependencies"]]
    files = sorted((root / "paper_figures" / stem).iterdir())
    return {
        "packages": {name: version(name) for name in names},
        "lock": _sha256(root / "requirements.lock"),
        "files": {path.name: _sha256(path) for path in files},
    }


def summary(root: Path) -> str:
    """Return REPORT.md: all claims of all papers, with the number of each verdict."""
    everything = claims(root)
    counts = Counter(c["verdict"] for paper in everything.values() for c in paper.values())
    lines = ["# Claims of the papers", "", "Generated by `make figures`; intervals are 95 %.", ""]
    lines += ["| verdict | claims |", "|---|---|", *(f"| {v} | {counts[v]} |" for v in VERDICTS)]
    for stem, paper in everything.items():
        with (root / "paper_figures" / stem / "deviations.csv").open() as file:
            agree = [row["agrees"] == "true" for row in csv.DictReader(file)]
        lines += ["", f"## {stem}", ""]
        lines += [f"Printed numbers that ours agree with: {sum(agree)} of {len(agree)}.", ""]
        lines += ["| | claim | verdict | value | interval | basis |", "|---|---|---|---|---|---|"]
        for number, c in paper.items():
            value = "" if c["value"] is None else significant(c["value"])
            ends = ", ".join(map(significant, c["interval"] or []))
            cells = [number, c["claim"], c["verdict"], value, ends and f"[{ends}]", c["basis"]]
            lines.append("| " + " | ".join(x.replace("|", r"\|") for x in cells) + " |")
    return "\n".join(lines) + "\n"
