"""Break one sign, number or comparison at a time, and see whether a test notices.

    python tests/soak/mutants.py COUNT [SEED]

Draws COUNT mutants of the filters, models, scores and estimates, runs for each the tests that
import its module, in copies of the checkout on all processors, and appends a line each to
``build/mutants.csv``; what stands there is not run again. `make mutants` runs this.
"""

import ast
import copy
import csv
import json
import os
import random
import re
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from queue import Queue

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "src" / "seanav"
RESULTS = ROOT / "build" / "mutants.csv"
PATIENCE = 600  # s; a mutant that hangs has been noticed
SLOW = ("test_notebooks", "test_any_value", "test_cluster", "test_notebook_maps", "test_explore")
SLOW += ("test_entries",)  # asked last, and about one module only
SWAPS = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult, ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.And: ast.Or, ast.Or: ast.And,
}  # fmt: skip
NAMES = {"sin": "cos", "cos": "sin", "min": "max", "max": "min", "minimum": "maximum"}
NAMES |= {"maximum": "minimum", "mean": "sum", "any": "all", "all": "any", "floor": "ceil"}


def targets():
    """Return the files whose mutants are drawn."""
    found = [PACKAGE / "estimates.py"]
    for pattern in ("filters/**/*.py", "models/**/*.py", "studies/*/*scores*.py"):
        found += sorted(PACKAGE.glob(pattern))
    return found


def breakable(tree):
    """Return the nodes of functions that may be broken: no texts, errors, types or docstrings."""
    found = []

    def visit(node, inside):
        if isinstance(node, ast.Raise | ast.Import | ast.ImportFrom | ast.JoinedStr):
            return
        if inside and _breaks(node):
            found.append(node)
        for name, part in ast.iter_fields(node):
            if name in ("annotation", "returns", "decorator_list", "args") and isinstance(
                node, ast.FunctionDef | ast.arg | ast.AnnAssign
            ):
                continue
            for child in part if isinstance(part, list) else [part]:
                if isinstance(child, ast.AST):
                    visit(child, inside or isinstance(node, ast.FunctionDef))

    visit(tree, False)
    return found


def _breaks(node):
    if isinstance(node, ast.BinOp | ast.AugAssign):
        return type(node.op) in SWAPS
    if isinstance(node, ast.BoolOp):
        return True
    if isinstance(node, ast.Compare):
        return type(node.ops[0]) in SWAPS
    if isinstance(node, ast.UnaryOp):
        return isinstance(node.op, ast.USub) and not isinstance(node.operand, ast.Constant)
    if isinstance(node, ast.Attribute | ast.Name):
        return getattr(node, "attr", getattr(node, "id", "")) in NAMES
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def broken(source, number):
    """Return `source` with its breakable node `number` broken, the line, and what was done."""
    tree = copy.deepcopy(ast.parse(source))
    node = breakable(tree)[number]
    before = ast.unparse(node)
    if isinstance(node, ast.BinOp | ast.AugAssign | ast.BoolOp):
        node.op = SWAPS[type(node.op)]()
    elif isinstance(node, ast.Compare):
        node.ops[0] = SWAPS[type(node.ops[0])]()
    elif isinstance(node, ast.UnaryOp):
        node.op = ast.UAdd()
    elif isinstance(node, ast.Attribute):
        node.attr = NAMES[node.attr]
    elif isinstance(node, ast.Name):
        node.id = NAMES[node.id]
    else:
        node.value = node.value + 1 if isinstance(node.value, int) else 2 * node.value or 1.0
    return ast.unparse(tree), node.lineno, f"{before}  ->  {ast.unparse(node)}"


@cache
def imported():
    """Return {test file: what it imports}."""
    found = {}
    for test in sorted((ROOT / "tests").rglob("test_*.py")):
        known = found[test] = set()
        for node in ast.walk(ast.parse(test.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                known |= {node.module, *(f"{node.module}.{a.name}" for a in node.names)}
            elif isinstance(node, ast.Import):
                known |= {alias.name for alias in node.names}
    return found


def tests_of(path):
    """Return the test files that import the module at `path` or its room, the nearest first."""
    name = ".".join(("seanav", *path.relative_to(PACKAGE).with_suffix("").parts))
    name = name.removesuffix(".__init__")
    room = name.rpartition(".")[0]
    rooms = [name] + ([room] if room.count(".") > 1 else [])
    near = []
    for test, known in imported().items():
        if test.stem not in SLOW and known.intersection(rooms):
            alike = path.stem in test.stem or test.stem.removeprefix("test_") in path.stem
            near.append((not alike, name not in known, test.relative_to(ROOT)))
    return [test for *_, test in sorted(near)]


def copied(folder):
    """Return a copy of the checkout in `folder`."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name in ("src", "tests", "notebooks", "paper_figures", "book", "benchmarks"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    # Without conftest.py at the top, which puts long tests first.
    for name in ("pyproject.toml", "requirements.lock", "Makefile", "README.md"):
        shutil.copy(ROOT / name, folder)
    return folder


def noticed(checkout, path):
    """Return which test notices that the module at `path` is broken, or nothing."""
    shutil.rmtree(checkout / "build" / "numba", ignore_errors=True)
    name = ".".join(path.relative_to(PACKAGE).with_suffix("").parts)
    pytest = ["-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *map(str, tests_of(path))]
    damaged = ["tests/test_entries.py", name]  # are bad arguments still refused?
    environment = os.environ | {"PYTHONPATH": str(checkout / "src"), "SEANAV_THREADS": "1"}
    environment |= {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
    for words in (pytest, damaged):
        try:
            done = subprocess.run(
                [sys.executable, *words], cwd=checkout, env=environment, timeout=PATIENCE,
                capture_output=True, encoding="utf-8",
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return "time"
        if words is pytest and done.returncode:
            first = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.M)
            return first.group(1) if first else f"status {done.returncode}"
    return "" if done.stdout.strip() == json.dumps({name: []}) else "tests/test_entries.py"


def main(count, seed=1):
    """Run `count` mutants; print the score."""
    pool = []
    for path in targets():
        nodes = breakable(ast.parse(path.read_text(encoding="utf-8")))
        pool += [(path, number) for number in range(len(nodes))]
    chosen = random.Random(seed).sample(pool, count)
    RESULTS.parent.mkdir(exist_ok=True)
    known = {}
    if RESULTS.exists():
        with RESULTS.open(encoding="utf-8", newline="") as file:
            known = {(row[0], row[1]): row for row in csv.reader(file)}
    places = Queue()
    for k in range(os.cpu_count() or 1):
        places.put(copied(ROOT / "build" / "mutants" / str(k)))

    def one(chosen):
        path, number = chosen
        name = path.relative_to(PACKAGE).as_posix()
        if row := known.get((name, str(number))):
            return row
        source = path.read_text(encoding="utf-8")
        text, line, what = broken(source, number)
        checkout, begun = places.get(), time.time()
        target = checkout / path.relative_to(ROOT)
        target.write_text(text, encoding="utf-8")
        killer = noticed(checkout, path)
        target.write_text(source, encoding="utf-8")
        places.put(checkout)
        row = [name, str(number), str(line), what, killer, f"{time.time() - begun:.0f}"]
        with RESULTS.open("a", encoding="utf-8", newline="") as file:
            csv.writer(file).writerow(row)
        return row

    with ThreadPoolExecutor(os.cpu_count()) as workers:
        rows = list(workers.map(one, chosen))
    survivors = [row for row in rows if not row[4]]
    for name, _, line, what, *_ in sorted(survivors):
        print(f"{name}:{line}: {what}")
    print(f"{len(rows) - len(survivors)} of {len(rows)} mutants were noticed")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
