"""Run a notebook strictly: checked parameters, no error, complete results."""

import ast
import difflib
import os
import re
import secrets
import shutil
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import nbformat

from seanav import _process, cluster
from seanav._files import Busy, lock, place, remove
from seanav.checks import ParameterError
from seanav.runner.checkout import Refused, notebook, parameters_cell
from seanav.runner.publish import keep, keep_outputs, mend, publish, stderr

# ---------------------------------------------------------------- parameters


def defaults(book: nbformat.NotebookNode) -> dict:
    """Return name and default of every parameter: the literals of the one tagged cell."""
    found = {}
    try:
        lines = ast.parse(parameters_cell(book).source).body
    except SyntaxError as error:
        raise Refused(f"parameters cell: {error.msg} in line {error.lineno}") from None
    for line in lines:
        try:
            (target,) = line.targets
            found[target.id] = ast.literal_eval(line.value)
        except (AttributeError, ValueError):
            text = ast.unparse(line)
            raise Refused(f"parameters cell: {text!r} must be name = literal") from None
    return found


def _fits(value: Any, default: Any) -> bool:
    if isinstance(default, float):
        # An integer may be too large for a float.
        real = isinstance(value, (int, float)) and not isinstance(value, bool)
        return real and abs(value) <= sys.float_info.max
    if isinstance(default, (list, tuple)) and default:
        return isinstance(value, (list, tuple)) and all(_fits(x, default[0]) for x in value)
    return default is None or type(value) is type(default)


def overrides(known: dict, words: list[str]) -> dict:
    """Return the parameters in `words`, each ``name=value``, checked against the defaults.

    Raises
    ------
    Refused
        If a parameter is unknown, given twice, or not of the form ``name=value``.
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
        if name in chosen:
            raise Refused(f"parameter {name!r} is given twice")
        value = _literal(text, known[name])
        if not _fits(value, known[name]):
            kind, example = type(known[name]).__name__, known[name]
            raise ParameterError(name, value, f"must be of type {kind}, such as {example!r}")
        chosen[name] = float(value) if isinstance(known[name], float) else _lists(value)
    return chosen


def _literal(text, default):
    if isinstance(default, str):
        return text
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        if isinstance(default, (list, tuple)) and default and isinstance(default[0], str):
            # A shell takes the quotes away: [v,r] stands for ['v', 'r'].
            return [word.strip(" '\"") for word in text.strip(" []()").split(",")]
        return text


def _lists(value):
    # papermill would hand a tuple over as a string.
    return [_lists(x) for x in value] if isinstance(value, (list, tuple)) else value


# ---------------------------------------------------------------- running

# Free space that a run demands: the results of a paper and its notebook, three times over.
ROOM = 100 * 2**20


def parameters(root: Path, stem: str, quick: bool, words: tuple[str, ...]) -> dict:
    """Return what a run sets in the parameters cell, or raise `Refused`, with one line."""
    try:
        known = defaults(notebook(root, stem))
        return overrides(known, [*words, *(["quick=True"] if quick else [])])
    except (Refused, ParameterError) as error:
        raise Refused(f"{stem}: {error}") from None


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
    started = time.time()
    chosen = parameters(root, stem, quick, words)
    try:
        cluster.check()
    except ParameterError as error:
        raise Refused(str(error)) from None
    mode = "params" if words else "quick" if quick else "full"
    expected = _expected(root, stem, "quick" if quick else "full")
    try:
        with _workplace(root, stem, mode) as work:
            print(f"{stem}: {mode} run, {expected}", flush=True)
            warned = _execute(root, stem, work, chosen, portable=mode != "params")
            if mode == "full":
                results = publish(root, stem, work, started)
            else:
                results = root / "build" / mode / stem
                keep(work, results.parent, stem)
    except OSError as error:
        raise Refused(f"{stem}: {error}") from error
    if warned:
        print(f"{stem}: cell {warned[-1][0]} wrote to stderr: {warned[-1][1]}", file=sys.stderr)
    print(f"{stem}: done in {time.time() - started:.0f} s, see {results.relative_to(root)}/")
    return results


def teach(root: Path, stem: str) -> list[int]:
    """Execute a lesson and write its outputs into its notebook, as `store` does for a paper.

    Raises
    ------
    Refused
        With one line, whatever went wrong; the notebook is untouched then.
    """
    try:
        with _workplace(root, stem, "lesson") as work:
            print(f"{stem}: lesson, {_expected(root, stem, 'full')}", flush=True)
            _execute(root, stem, work, {}, portable=True, complete=False)
            book = nbformat.read(work / f"{stem}.ipynb", as_version=4)
            return keep_outputs(root / "notebooks" / f"{stem}.ipynb", book)
    except OSError as error:
        raise Refused(f"{stem}: {error}") from error


def _expected(root, stem, scale):
    seconds = notebook(root, stem).metadata.get("seanav", {}).get("expected_seconds", {})
    return f"about {seconds.get(scale, 'an unknown number of')} s expected"


@contextmanager
def _workplace(root, stem, mode):
    """Yield a folder of this run's own, where nobody else runs the paper in this `mode`."""
    build = root / "build"
    for folder in [build, *([root / "paper_figures"] if mode == "full" else [])]:
        folder.mkdir(exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            free = shutil.disk_usage(folder).free
        if free < ROOM:
            needs = f"{free // 2**20} MB are free, a run needs {ROOM // 2**20}"
            raise Refused(f"{stem}: {folder.name}/: {needs}")
    (build / "home").mkdir(exist_ok=True)  # or IPython warns
    mend(root)
    try:
        with lock(build / "locks" / f"{mode}-{stem}", wait=False):
            runs = build / "running" / mode / stem
            remove(runs)  # what a killed run left
            work = runs / secrets.token_hex(4)
            work.mkdir(parents=True)
            try:
                yield work
            finally:
                remove(runs)
    except Busy as error:
        raise Refused(f"{stem}: another {mode} run of it is under way: {error}") from None


def _execute(root, stem, work, chosen, portable, complete=True):
    import papermill  # slow to import, and only needed here

    executed, failed = work / f"{stem}.ipynb", root / "build" / "failed" / f"{stem}.ipynb"
    remove(failed)
    terminal = os.ttyname(2) if os.isatty(2) else ""
    environment = _process.environment(root, dict(os.environ))
    # Where to write, and on which terminal to show progress.
    environment |= {"SEANAV_RESULTS": str(work), "SEANAV_PROGRESS": terminal}
    try:
        book = papermill.execute_notebook(
            _literally(root / "notebooks" / f"{stem}.ipynb"),
            _literally(executed),
            parameters=chosen,
            kernel_name="python3",
            kernel_manager_class=_kernel(environment, work),
            progress_bar=bool(terminal),
            # Or it tells that it is not encrypted, and that it was interrupted at its end.
            extra_arguments=["--log-level=CRITICAL"],
            cwd=root,
        )
        _demand_whole(root, book, portable)
        if complete and not (work / stem / "claims.json").is_file():
            raise Refused("the notebook did not call report.finish()")
    except Exception as error:
        if executed.exists():
            place(executed, failed)
        name, text = type(error).__name__, str(error)
        if isinstance(error, papermill.PapermillExecutionError):
            name, text = f"cell {error.exec_count}: {error.ename}", error.evalue
        line = (text.strip().splitlines() or [""])[0]
        if name.endswith((": ParameterError", "Refused")):
            raise Refused(f"{stem}: {line}") from None
        raise Refused(f"{stem}: {name}: {line} (see build/failed/{stem}.ipynb)") from error
    finally:
        _process.kernels.clear()
    return stderr(book)


def _literally(path):
    # papermill takes a path for a format string.
    return str(path).replace("{", "{{").replace("}", "}}")


def _kernel(environment, work):
    """Return a manager whose kernel is this interpreter, with this `environment`."""
    from ipykernel.kernelspec import get_kernel_dict
    from jupyter_client import AsyncKernelManager
    from jupyter_client.kernelspec import KernelSpec

    class Kernel(AsyncKernelManager):
        # A user's own kernel may be called python3, too.
        kernel_spec = KernelSpec(**get_kernel_dict())

        async def start_kernel(self, **options):
            self.connection_file = str(work / "kernel.json")
            await super().start_kernel(**options | {"env": environment})

        async def _async_launch_kernel(self, command, **options):
            with _process.starting_kernel():
                await super()._async_launch_kernel(command, **options)
                _process.kernels.add(self.provisioner.pid)

        _launch_kernel = _async_launch_kernel

    return Kernel


def _demand_whole(root, book, portable):
    # The folder's name as a whole; a checkout may lie in / or in /src.
    place = re.compile(rf"(?<![\w./-]){re.escape(str(root))}(?![\w.-])")
    for cell in book.cells:
        for output in cell.get("outputs", []):
            where = f"cell {cell.execution_count}"
            if output.output_type == "error":
                raise Refused(f"{where}: {output.ename}: {output.evalue}")
            if portable and root.name and any(map(place.search, _texts(output))):
                raise Refused(f"{where} prints a path of this machine")


def _texts(output):
    data = output.get("data", {})
    return [output.get("text", ""), *(data[kind] for kind in data if kind.startswith("text/"))]
