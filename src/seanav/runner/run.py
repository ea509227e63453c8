"""Run a notebook strictly: checked parameters, no error, complete results."""

import ast
import difflib
import json
import os
import shutil
import time
from pathlib import Path

import nbformat

from seanav.checks import ParameterError
from seanav.runner.checkout import Refused, notebook
from seanav.runner.publish import publish

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
        results = publish(root, stem, started)
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
