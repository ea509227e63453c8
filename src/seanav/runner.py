"""Run notebooks strictly, publish their results as a whole, and compare them later.

Every function takes `root`, the checkout. A paper is a notebook in ``notebooks/`` called
``<number>_<name>.ipynb``; its name without suffix, the stem, names its results too.
Notebooks with other names are a user's own.
"""

import ast
import csv
import difflib
import fnmatch
import hashlib
import json
import math
import os
import re
import shutil
import time
import tomllib
from collections import Counter
from importlib.metadata import version
from pathlib import Path

import nbformat
from packaging.requirements import Requirement

from seanav.checks import ParameterError
from seanav.report import VERDICTS, json_text, significant


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


# ---------------------------------------------------------------- parameters


def defaults(book: nbformat.NotebookNode) -> dict:
    """Return name and default of every parameter: the literals of the one tagged cell."""
    cells = [c for c in book.cells if "parameters" in c.metadata.get("tags", [])]
    if len(cells) != 1:
        raise Refused(f"{len(cells)} cells are tagged 'parameters', must be exactly one")
    found = {}
    for line in ast.parse(cells[0].source).body:
        try:
            (target,) = line.targets
            found[target.id] = ast.literal_eval(line.value)
        except (AttributeError, ValueError):
            text = ast.unparse(line)
            raise Refused(f"parameters cell: {text!r} must be name = literal") from None
    return found


def _fits(value, default) -> bool:
    if isinstance(default, float):
        return isinstance(value, (int, float)) and not isinstance(value, bool)
    if isinstance(default, (list, tuple)) and default:
        return isinstance(value, (list, tuple)) and all(_fits(x, default[0]) for x in value)
    return default is None or type(value) is type(default)


def overrides(known: dict, words: list[str]) -> dict:
    """Return the parameters in `words`, each ``name=value``, checked against the defaults.

    Raises
    ------
    Refused
        If a parameter is unknown or not of the form ``name=value``.
    ParameterError
        If a value is not of its default's type; an integer is a float, a bool is not.
    """
    chosen = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals:
            raise Refused(f"parameter {word!r} must be of the form name=value")
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f" (did you mean {near[0]!r}?)" if near else ""
            raise Refused(f"unknown parameter {name!r}{hint}; there are: {', '.join(known)}")
        try:
            value = text if isinstance(known[name], str) else ast.literal_eval(text)
        except (ValueError, SyntaxError):
            value = text
        if not _fits(value, known[name]):
            kind, example = type(known[name]).__name__, known[name]
            raise ParameterError(name, value, f"must be of type {kind}, such as {example!r}")
        chosen[name] = float(value) if isinstance(known[name], float) else _lists(value)
    return chosen


def _lists(value):
    # papermill would hand a tuple over as a string.
    return [_lists(x) for x in value] if isinstance(value, (list, tuple)) else value


# ---------------------------------------------------------------- running


def run(root: Path, stem: str, quick: bool = False, words: tuple[str, ...] = ()) -> Path:
    """Execute a paper's notebook and return the folder of its results.

    Only a complete run at full scale with default parameters replaces the committed
    results; quick runs and runs with other parameters stay below ``build/``.

    Raises
    ------
    Refused
        With one line, whatever went wrong; the committed results are untouched then
        and the failed notebook is kept in ``build/failed/``.
    """
    book, started = notebook(root, stem), time.time()
    try:
        chosen = overrides(defaults(book), [*words, *(["quick=True"] if quick else [])])
    except (Refused, ParameterError) as error:
        raise Refused(f"{stem}: {error}") from None
    mode = "params" if words else "quick" if quick else "full"
    seconds = book.metadata.get("seanav", {}).get("expected_seconds", {})
    expected = seconds.get("quick" if quick else "full", "an unknown number of")
    print(f"{stem}: {mode} run, about {expected} s expected", flush=True)
    _execute(root, stem, root / "build" / mode, chosen)
    results = root / "build" / mode / stem
    if mode == "full":
        results = _publish(root, stem, started)
    print(f"{stem}: done in {time.time() - started:.0f} s, see {results.relative_to(root)}/")
    return results


def _execute(root, stem, folder, chosen):
    import papermill  # slow to import, and only needed here

    folder.mkdir(parents=True, exist_ok=True)
    executed, failed = folder / f"{stem}.ipynb", root / "build" / "failed" / f"{stem}.ipynb"
    for old in (executed, failed, folder / f"{stem}.json"):
        old.unlink(missing_ok=True)
    shutil.rmtree(folder / stem, ignore_errors=True)
    # The kernel inherits where to write and on which terminal to show progress.
    terminal = os.ttyname(2) if os.isatty(2) else ""
    os.environ.update(SEANAV_RESULTS=str(folder), SEANAV_PROGRESS=terminal)
    try:
        book = papermill.execute_notebook(
            root / "notebooks" / f"{stem}.ipynb",
            executed,
            parameters=chosen,
            kernel_name="python3",
            progress_bar=bool(terminal),
            # Without this every run warns that a kernel on this machine is not encrypted.
            extra_arguments=["--log-level=ERROR"],
            cwd=root,
        )
        _demand_complete(root, book, folder / stem)
    except Exception as error:
        failed.parent.mkdir(parents=True, exist_ok=True)
        if executed.exists():
            executed.replace(failed)
        name, text = type(error).__name__, str(error)
        if isinstance(error, papermill.PapermillExecutionError):
            name, text = f"cell {error.exec_count}: {error.ename}", error.evalue
        line = (text.strip().splitlines() or [""])[0]
        if name.endswith((": ParameterError", "Refused")):
            raise Refused(f"{stem}: {line}") from None
        raise Refused(f"{stem}: {name}: {line} (see build/failed/{stem}.ipynb)") from error


def _demand_complete(root, book, results):
    for cell in book.cells:
        if cell.cell_type != "code" or not cell.source.strip():
            continue
        where = f"cell {cell.execution_count}"
        for output in cell.outputs:
            if output.output_type == "error":
                raise Refused(f"{where}: {output.ename}: {output.evalue}")
            if output.get("name") == "stderr":
                raise Refused(f"{where} wrote to stderr: {output.text.strip().splitlines()[-1]}")
            if str(root) in json.dumps(output):
                raise Refused(f"{where} prints a path of this machine")
    if not (results / "claims.json").is_file():
        raise Refused("the notebook did not call report.finish()")


def _publish(root, stem, started):
    """Replace the committed results by the fresh ones, then everything made from them."""
    full, final, old = root / "build/full", root / "paper_figures" / stem, root / "build/old" / stem
    shutil.rmtree(old, ignore_errors=True)
    old.parent.mkdir(parents=True, exist_ok=True)
    final.parent.mkdir(exist_ok=True)
    if final.exists():
        final.rename(old)
    (full / stem).rename(final)
    entry = json.loads((full / f"{stem}.json").read_text()) | _provenance(root, stem)
    entries = _manifest(root) | {stem: entry}
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


def _manifest(root):
    path = root / "paper_figures" / "manifest.json"
    return json.loads(path.read_text()) if path.exists() else {}


def _sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _provenance(root, stem):
    """Return what a manifest entry must say about the files, the packages and the lock."""
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    names = [Requirement(line).name for line in project["dependencies"]]
    files = sorted((root / "paper_figures" / stem).iterdir())
    return {
        "packages": {name: version(name) for name in names},
        "lock": _sha256(root / "requirements.lock"),
        "files": {path.name: _sha256(path) for path in files},
    }


def claims(root: Path) -> dict[str, dict]:
    """Return the committed claims of every paper, by stem."""
    paths = {stem: root / "paper_figures" / stem / "claims.json" for stem in papers(root)}
    return {stem: json.loads(p.read_text()) for stem, p in paths.items() if p.exists()}


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


# ---------------------------------------------------------------- comparing


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
    exceptions = tomllib.loads(path.read_text())["exception"] if path.exists() else []
    if not all(exception.get("reason") for exception in exceptions):
        raise Refused(f"{path.name}: every exception needs a reason")
    wrong = []
    for stem in papers(root):
        committed, entry = root / "paper_figures" / stem, _manifest(root).get(stem)
        if entry is None or not committed.is_dir():
            wrong.append(f"{stem}: no committed results: make figures")
            continue
        if not (fresh / stem / "claims.json").is_file():
            wrong.append(f"{stem}: no complete results in {fresh.name}")
            continue
        now = _provenance(root, stem)
        changed = [key for key in now if now[key] != entry.get(key)]
        wrong += [f"{stem}: {key} are not those of the manifest" for key in changed]
        about = json.loads((fresh / f"{stem}.json").read_text())
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
    strays = {p.name for p in (root / "paper_figures").glob("*/")} - set(papers(root))
    wrong += [f"paper_figures/{name}: no such paper" for name in sorted(strays)]
    report = root / "paper_figures" / "REPORT.md"
    if claims(root) and (not report.exists() or report.read_text() != summary(root)):
        wrong.append("REPORT.md is not that of the claims: make figures")
    return wrong


def _numbers(path):
    if path.suffix == ".json":
        return _flat(json.loads(path.read_text()))
    if path.suffix == ".csv":
        with path.open() as file:
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
