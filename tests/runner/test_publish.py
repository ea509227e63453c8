"""What a run leaves behind: stored notebooks, stamps, dependencies."""

import shutil

import nbformat
import pytest
from tiny import FINISH, REPORT, STUDY, cell, save, tree

from seanav import runner
from seanav.runner import Refused


def test_stored_notebook_is_clean_and_a_second_run_changes_no_byte(finished):
    path = finished / "notebooks" / "9_tiny.ipynb"
    runner.store(finished, "9_tiny")
    text = path.read_text(encoding="utf-8")
    book = nbformat.reads(text, as_version=4)
    assert [c.execution_count for c in book.cells[1:]] == [1, 2, 3, 4]
    assert book.cells[3].outputs[0].text.startswith("mean ")
    assert set(book.metadata) == {"kernelspec", "language_info", "seanav"}
    assert book.metadata.language_info == {"name": "python"}
    for trace in ("papermill", "batches:", "iopub", "SEANAV", str(finished), "wall"):
        assert trace not in text.replace('label=\\"batches', "")
    results = tree(finished / "paper_figures")
    runner.run(finished, "9_tiny")
    runner.store(finished, "9_tiny")
    assert path.read_text(encoding="utf-8") == text
    assert tree(finished / "paper_figures") == results


def test_storing_does_not_make_the_run_look_old(finished):
    runner.store(finished, "9_tiny")
    stamp = finished / "build" / "stamps" / "9_tiny"
    notebook = finished / "notebooks" / "9_tiny.ipynb"
    assert notebook.stat().st_mtime_ns <= stamp.stat().st_mtime_ns


def test_only_the_notebook_that_ran_is_stored(finished):
    save(finished, cell(STUDY), cell(REPORT + "\n# changed"), cell(FINISH))
    with pytest.raises(Refused, match="no full run of the notebook as it is now"):
        runner.store(finished, "9_tiny")


def test_stamp_is_from_the_start_of_the_run_and_knows_the_imports(finished):
    stamp = finished / "build" / "stamps" / "9_tiny"
    table = finished / "paper_figures" / "9_tiny" / "table_1.csv"
    assert stamp.stat().st_mtime < table.stat().st_mtime
    rule, *empty = stamp.with_suffix(".d").read_text(encoding="utf-8").splitlines()
    names = "__init__ _files _pictures checks claims cluster estimates montecarlo report scenario"
    expected = [*(f"{name}.py" for name in names.split()), "seanav.mplstyle"]
    assert rule.split()[1:] == [f"src/seanav/{name}" for name in expected]
    assert empty == [f"src/seanav/{name}:" for name in expected]


def test_dependencies_follow_every_form_of_import(root):
    package = root / "src" / "seanav"
    shutil.rmtree(package)
    sources = {
        "__init__.py": "",
        "runner.py": "",
        "studies/__init__.py": "",
        "studies/a.py": "from seanav.models import gravity as g\nfrom . import c",
        "studies/b.py": "from seanav import estimates, runner",
        "studies/c.py": "def late():\n    from ..filters.deep import kalman",
        "models/__init__.py": "",
        "models/gravity.py": "import numpy\nimport seanav.studies.a",  # a circle ends
        "models/table.csv": "1,2",
        "filters/__init__.py": "",
        "filters/deep/__init__.py": "from .kalman import update",
        "filters/deep/kalman.py": "",
        "filters/unused.py": "",
    }
    for name, source in sources.items():
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).write_text(source, encoding="utf-8")
    save(root, cell("%time 1\n!true\nfrom seanav.studies import a"))
    found = {p.relative_to(package).as_posix() for p in runner.dependencies(root, "9_tiny")}
    assert found == sources.keys() - {"runner.py", "studies/b.py", "filters/unused.py"}
