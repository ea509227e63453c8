"""Publish a run: results, manifest, report, what make must know, the stored notebook."""

import ast
import hashlib
import json
import os
import shutil
import subprocess
import tomllib
from importlib.metadata import version
from pathlib import Path

import nbformat
from packaging.requirements import Requirement

from seanav._files import lock, place, remove, write
from seanav.report import json_text
from seanav.runner.checkout import Refused, claims_in, manifest, notebook, papers, results
from seanav.runner.summary import PICTURE, in_readme, picture, summary

READY = ".ready"  # in paper_figures/: complete, and on its way into its place
PUBLISHING = Path("build", "locks", "publish")


def publish(root: Path, stem: str, work: Path, started: float) -> Path:
    """Replace the committed results by those in `work`, with everything made from them.

    All of it is made in a hidden folder first, which one rename declares complete. What a
    death leaves behind then is finished by `mend`; before, the old results stand. Make's
    stamp goes first and comes last: without it make runs the paper again.
    """
    figures, stamp = root / "paper_figures", root / "build" / "stamps" / stem
    staging = figures / ".staging"
    with lock(root / PUBLISHING):
        _finish(figures)
        stamp.unlink(missing_ok=True)
        keep(work, root / "build" / "full", stem)
        remove(staging)
        try:
            fresh = root / "build" / "full" / stem
            shutil.copytree(fresh, staging / stem, copy_function=shutil.copyfile)
            about = json.loads(fresh.with_suffix(".json").read_text(encoding="utf-8"))
            before, made = manifest(root), about | provenance(root, stem, staging / stem)
            commit = committed(root, stem, made["regions"], before.get(stem, {}))
            entries = before | {stem: made | {"regions_commit": commit}}
            entries = {stem: entries[stem] for stem in papers(root) if stem in entries}
            write(staging / "manifest.json", json_text(entries))
            folders = dict(sorted((results(root) | {stem: staging / stem}).items()))
            everything = {name: claims_in(folder) for name, folder in folders.items()}
            write(staging / "REPORT.md", summary(root, folders, everything))
            (staging / PICTURE).write_bytes(picture(everything))
        except OSError:
            remove(staging)
            raise
        os.rename(staging, figures / READY)
        _finish(figures)
        # For make: what this run depended on. A file changed during the run is newer.
        files = [path.relative_to(root).as_posix() for path in dependencies(root, stem)]
        rules = [f"build/stamps/{stem}: {' '.join(files)}", *(f"{file}:" for file in files)]
        stamp.parent.mkdir(parents=True, exist_ok=True)
        write(stamp.with_suffix(".d"), "\n".join(rules) + "\n")
        write(stamp, "", times=(round(started * 1e9),) * 2)
    return figures / stem


def keep(work: Path, folder: Path, stem: str) -> None:
    """Move the executed notebook and its results from `work`; the results come last."""
    remove(folder / stem)
    for name in (f"{stem}.ipynb", f"{stem}.json", stem):
        place(work / name, folder / name)


def mend(root: Path) -> None:
    """Finish a publication that was cut short, so that files, manifest and report fit."""
    if (root / "paper_figures" / READY).is_dir():
        with lock(root / PUBLISHING):
            _finish(root / "paper_figures")


def _finish(figures):
    ready = figures / READY
    if ready.is_dir():
        for path in ready.iterdir():
            if path.is_dir():
                remove(figures / path.name)
            os.replace(path, figures / path.name)
        ready.rmdir()


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
            todo |= imports(path.read_text(encoding="utf-8"), within)
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


def store(root: Path, stem: str) -> list[int]:
    """Write the outputs of the last full run into the notebook, clean of the run's traces.

    Returns
    -------
    list of int
        The cells whose warnings on stderr are not stored.
    """
    path, stamp = root / "notebooks" / f"{stem}.ipynb", root / "build" / "stamps" / stem
    executed = root / "build" / "full" / path.name
    book = nbformat.read(executed, as_version=4) if executed.exists() else notebook(root, stem)
    sources = [[c.source for c in b.cells] for b in (book, notebook(root, stem))]
    if not (executed.exists() and stamp.exists()) or sources[0] != sources[1]:
        raise Refused(f"{stem}: there is no full run of the notebook as it is now")
    try:
        # The outputs are new, the code is not: make need not run it again.
        return keep_outputs(path, book, times=(stamp.stat().st_mtime_ns,) * 2)
    except OSError as error:
        raise Refused(f"{stem}: {error}") from error


def keep_outputs(
    path: Path, book: nbformat.NotebookNode, times: tuple[int, int] | None = None
) -> list[int]:
    """Write an executed notebook to `path`, clean of the run's traces; `store` says the rest."""
    book.metadata = nbformat.from_dict(
        {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
            "seanav": book.metadata.get("seanav", {}),
        }
    )
    warned = [number for number, _ in stderr(book)]
    for cell in book.cells:
        kept = {key: cell.metadata[key] for key in ("tags", "jupyter") if cell.metadata.get(key)}
        cell.metadata = nbformat.from_dict(kept)
        if cell.cell_type == "code":
            cell.outputs = [output for output in cell.outputs if output.get("name") != "stderr"]
    text = nbformat.writes(book) + "\n"
    if text != path.read_text(encoding="utf-8"):
        write(path, text, times=times)
    return warned


def readme(root: Path) -> bool:
    """Write the README's table of claims as the results have it; return whether it was another."""
    everything = {stem: claims_in(folder) for stem, folder in results(root).items()}
    text, wanted = in_readme(root, everything)
    if text != wanted:
        write(root / "README.md", wanted)
    return text != wanted


def stderr(book: nbformat.NotebookNode) -> list[tuple[int, str]]:
    """Return the number of each cell that wrote to stderr, with the last line of it."""
    return [
        (cell.execution_count, output.text.strip().splitlines()[-1])
        for cell in book.cells
        for output in cell.get("outputs", [])
        if output.get("name") == "stderr" and output.text.strip()
    ]


# ---------------------------------------------------------------- provenance


def _sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def provenance(root: Path, stem: str, folder: Path) -> dict:
    """Return what a manifest entry must say about files, packages, the lock, and regions."""
    text = (root / "pyproject.toml").read_text(encoding="utf-8")
    names = [Requirement(line).name for line in tomllib.loads(text)["project"]["dependencies"]]
    return {
        "packages": {name: version(name) for name in names},
        "lock": _sha256(root / "requirements.lock"),
        "files": {path.name: _sha256(path) for path in sorted(folder.iterdir())},
        "regions": hashlib.sha256("\n".join(_states_regions(root, stem)).encode()).hexdigest(),
    }


def _room(stem):
    return Path("src", "seanav", "studies", stem.partition("_")[2])


def _code(book):
    return [cell["source"] for cell in book["cells"] if cell["cell_type"] == "code"]


def _states_regions(root, stem):
    """Return the texts that state what a paper's claims are held against."""
    room = sorted((root / _room(stem)).glob("*.py"))
    return [*_code(notebook(root, stem)), *(path.read_text(encoding="utf-8") for path in room)]


def committed(root: Path, stem: str, regions: str, before: dict) -> str | None:
    """Return the commit that held the regions of a run before it began, or None.

    Kept while they stay as they are: `before` is the older entry of the manifest.
    """
    if before.get("regions") == regions and before.get("regions_commit"):
        return before["regions_commit"]

    def git(*arguments):
        command = ["git", "-C", str(root), *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    try:
        stored = json.loads(git("show", f"HEAD:./notebooks/{stem}.ipynb"))
        git("diff", "--quiet", "HEAD", "--", str(_room(stem)))
        return git("rev-parse", "HEAD").strip() if _same_code(root, stem, stored) else None
    except (OSError, subprocess.CalledProcessError, ValueError):
        return None  # no git, or not committed


def _same_code(root, stem, stored):
    # A file holds the lines of a cell one by one.
    return ["".join(source) for source in _code(stored)] == _code(notebook(root, stem))
