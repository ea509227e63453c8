"""The strict runner, on tiny notebooks in a checkout of their own."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

from seanav import runner
from seanav.__main__ import main
from seanav.checks import ParameterError
from seanav.runner import Refused

CHECKOUT = Path(__file__).resolve().parents[1]
PARAMETERS = "runs = 20  # text\nnoise_mgal = 2.0\nname = 'real'\nradii = (1.0, 2.0)\nquick = False"
STUDY = """
import attrs
from matplotlib import pyplot as plt
from seanav import checks, estimates, montecarlo
from seanav.report import Condition, Report

@attrs.frozen
class Scenario:
    runs: int
    def __attrs_post_init__(self):
        checks.integer("runs", self.runs, at_least=2)

report = Report("9_tiny", scenario=Scenario(runs // 10 if quick else runs), seed=1, quick=quick)
"""
REPORT = """
batches = montecarlo.parallel_map(abs, range(5), label="batches")
rmse = estimates.mean(noise_mgal + montecarlo.normals(1, "noise", runs, ())[:])
fig, ax = plt.subplots()
ax.plot(batches)
print(f"mean {rmse.value:.3f}")
report.figure(1, fig, "A line")
"""
FINISH = """
report.table(1, ["noise", "mean"], [[noise_mgal, rmse.value]], "Means")
report.parameters([("runs", runs, "", "text")])
report.deviation("1", "noise 2", "mean", 2.0, rmse)
report.claim("9.1", "the mean | is positive", [Condition("tiny", rmse, low=0.0)], "Monte Carlo")
report.finish(["9.1"])
"""


def cell(source, *tags):
    return new_code_cell(source.strip(), metadata={"tags": list(tags)} if tags else {})


def save(root, *cells, parameters=PARAMETERS, stem="9_tiny"):
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    seconds = {"seanav": {"expected_seconds": {"full": 4, "quick": 2}}}
    book = new_notebook(
        cells=[new_markdown_cell("# Tiny"), cell(parameters, "parameters"), *cells],
        metadata=kernel | seconds,
    )
    path = root / "notebooks" / f"{stem}.ipynb"
    path.parent.mkdir(exist_ok=True)
    nbformat.write(book, path)
    return path


@pytest.fixture
def root(tmp_path, monkeypatch):
    """An empty checkout; what the runner sets for its kernel is undone afterwards."""
    for name in ("SEANAV_RESULTS", "SEANAV_PROGRESS"):
        monkeypatch.setenv(name, "")
    return empty_checkout(tmp_path / "empty")


def empty_checkout(root):
    without = shutil.ignore_patterns("__pycache__")
    shutil.copytree(CHECKOUT / "src", root / "src", ignore=without)
    for name in ("pyproject.toml", "requirements.lock", "Makefile"):
        shutil.copy(CHECKOUT / name, root)
    return root


def tree(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture(scope="module")
def full_run(tmp_path_factory):
    """A checkout whose one paper has run at full scale, once for all tests."""
    root = empty_checkout(tmp_path_factory.mktemp("full") / "checkout")
    save(root, cell(STUDY), cell(REPORT), cell(FINISH))
    with pytest.MonkeyPatch.context() as patch:
        for name in ("SEANAV_RESULTS", "SEANAV_PROGRESS"):
            patch.setenv(name, "")
        runner.run(root, "9_tiny")
    return root


@pytest.fixture
def finished(full_run, root):
    """A copy of that checkout, time stamps included."""
    shutil.copytree(full_run, root, dirs_exist_ok=True)
    return root


# ---------------------------------------------------------------- papers and parameters


def test_papers_are_the_notebooks(root):
    assert runner.papers(root) == []
    for stem in ("5_b", "4_a", "15_c"):
        save(root, stem=stem)
    assert runner.papers(root) == ["15_c", "4_a", "5_b"]
    assert runner.papers(root, "5") == runner.papers(root, "5_b") == ["5_b"]
    with pytest.raises(Refused, match=r"^no paper '6'; there are: 15_c, 4_a, 5_b$"):
        runner.papers(root, "6")


def test_defaults_are_the_literals_of_the_tagged_cell(root):
    save(root)
    known = runner.defaults(runner.notebook(root, "9_tiny"))
    assert known == {
        "runs": 20,
        "noise_mgal": 2.0,
        "name": "real",
        "radii": (1.0, 2.0),
        "quick": False,
    }


@pytest.mark.parametrize("line", ["runs = 10 * 2", "runs = other", "import os", "a = b = 1"])
def test_parameters_must_be_literals(root, line):
    save(root, parameters=line)
    with pytest.raises(Refused, match=r"^9_tiny: parameters cell: '.*' must be name = literal$"):
        runner.run(root, "9_tiny")


@pytest.mark.parametrize("count", [0, 2])
def test_exactly_one_parameters_cell(root, count):
    path = save(root)
    book = nbformat.read(path, as_version=4)
    book.cells = [book.cells[0], *[cell(PARAMETERS, "parameters") for _ in range(count)]]
    nbformat.write(book, path)
    with pytest.raises(Refused, match=f"^9_tiny: {count} cells are tagged 'parameters'"):
        runner.run(root, "9_tiny")


KNOWN = {"runs": 20, "noise": 2.0, "name": "real", "radii": (1.0, 2.0), "quick": False, "x": None}


@pytest.mark.parametrize(
    ("word", "value"),
    [
        ("runs=-1", -1),
        ("noise=3", 3.0),
        ("noise=1e-3", 1e-3),
        ("name=a=b.nc", "a=b.nc"),
        ("name=12", "12"),
        ("radii=[1, 2.5]", [1, 2.5]),
        ("radii=(3,)", [3]),
        ("x=[(1, 2), 3]", [[1, 2], 3]),
        ("quick=True", True),
        ("x=text", "text"),
        ("x=7", 7),
    ],
)
def test_parameters_of_the_right_type_pass(word, value):
    (found,) = runner.overrides(KNOWN, [word]).values()
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("runs=abc", "runs = 'abc': must be of type int, such as 20"),
        ("runs=2.0", "runs = 2.0: must be of type int, such as 20"),
        ("runs=True", "runs = True: must be of type int, such as 20"),
        ("runs=", "runs = '': must be of type int, such as 20"),
        ("noise=True", "noise = True: must be of type float, such as 2.0"),
        ("noise=[1.0]", "noise = [1.0]: must be of type float, such as 2.0"),
        ("quick=1", "quick = 1: must be of type bool, such as False"),
        ("radii=1.0", "radii = 1.0: must be of type tuple, such as (1.0, 2.0)"),
        ("radii=[1.0, 'a']", "radii = [1.0, 'a']: must be of type tuple, such as (1.0, 2.0)"),
    ],
)
def test_parameters_of_the_wrong_type_are_named(word, message):
    with pytest.raises(ParameterError) as caught:
        runner.overrides(KNOWN, [word])
    assert str(caught.value) == message


def test_unknown_parameters_are_named():
    with pytest.raises(Refused, match=r"^unknown parameter 'run' \(did you mean 'runs'\?\); there"):
        runner.overrides(KNOWN, ["run=5"])
    with pytest.raises(Refused, match=r"'runs' must be of the form name=value"):
        runner.overrides(KNOWN, ["runs"])


# ---------------------------------------------------------------- runs


def test_full_run_publishes_everything(finished):
    figures = finished / "paper_figures"
    names = {path.name for path in (figures / "9_tiny").iterdir()}
    assert names == {
        "claims.json",
        "deviations.csv",
        "figure_01.pdf",
        "figure_01.png",
        "parameters.csv",
        "table_1.csv",
    }
    entry = json.loads((figures / "manifest.json").read_text())["9_tiny"]
    assert set(entry["files"]) == names
    assert entry["parameters"] == {"runs": 20}
    assert entry["seed"] == 1
    assert entry["packages"]["numpy"].startswith("2.")
    report = (figures / "REPORT.md").read_text()
    assert "| reproduced | 1 |" in report
    assert "Printed numbers that ours agree with: 1 of 1." in report
    assert r"| 9.1 | the mean \| is positive | reproduced | " in report
    assert not (finished / "build" / "failed").exists()


def test_manifest_keeps_other_papers_and_drops_lost_ones(finished):
    path = finished / "paper_figures" / "manifest.json"
    entry = json.loads(path.read_text())["9_tiny"]
    path.write_text(json.dumps({"8_other": entry, "7_gone": entry}))
    save(finished, stem="8_other")
    shutil.move(finished / "paper_figures" / "9_tiny", finished / "build" / "full")
    runner._publish(finished, "9_tiny", started=0)
    assert list(json.loads(path.read_text())) == ["8_other", "9_tiny"]


def test_quick_and_other_parameters_stay_below_build(finished, capsys):
    before = tree(finished / "paper_figures")
    quick = runner.run(finished, "9_tiny", quick=True)
    params = runner.run(finished, "9_tiny", words=("noise_mgal=3", "runs=30"))
    assert quick == finished / "build/quick/9_tiny"
    assert params == finished / "build/params/9_tiny"
    assert json.loads((quick / "claims.json").read_text())["9.1"]["quick"] is True
    assert "quick" not in json.loads((params / "claims.json").read_text())["9.1"]
    assert (params / "table_1.csv").read_text().startswith("noise,mean\n3,")
    assert tree(finished / "paper_figures") == before
    assert "9_tiny: quick run, about 2 s expected" in capsys.readouterr().out


FAILURES = {
    "bad parameter": ([STUDY], "9_tiny: runs = 1: must be an integer of at least 2", ("runs=1",)),
    "error": (["1 / 0"], "9_tiny: cell 2: ZeroDivisionError: division by zero", ()),
    "tolerated error": (["1 / 0 # tagged"], "9_tiny: cell 2: ZeroDivisionError", ()),
    "stderr": (
        ["import warnings\nwarnings.warn('odd')"],
        "9_tiny: cell 2 wrote to stderr",
        (),
    ),
    "path": (
        ["import os\nprint(os.getcwd())"],
        "9_tiny: cell 2 prints a path of this machine",
        (),
    ),
    "unfinished": (["1"], "9_tiny: the notebook did not call report.finish()", ()),
    "exit": (["raise SystemExit(0)"], "9_tiny: cell 2: SystemExit: 0", ()),
    "dead kernel": (["import os\nos._exit(3)"], "9_tiny: DeadKernelError: ", ()),
}


@pytest.mark.parametrize("name", FAILURES)
def test_failed_run_leaves_the_results_alone(root, name, capsys):
    sources, message, words = FAILURES[name]
    figures = root / "paper_figures" / "9_tiny"
    figures.mkdir(parents=True)
    (figures / "claims.json").write_text("{}")
    before = tree(root / "paper_figures")
    tags = ["raises-exception"] if name == "tolerated error" else []
    save(root, *(cell(source, *tags) for source in sources))
    assert main(["--root", str(root), "run", *(["--param", *words] if words else [])]) == 1
    error = capsys.readouterr().err
    assert error.startswith(message)
    assert error.count("\n") == 1
    assert tree(root / "paper_figures") == before
    assert (root / "build" / "failed" / "9_tiny.ipynb").is_file()
    assert not (root / "build" / "stamps").exists()


def test_interrupted_run_leaves_the_results_alone(finished, monkeypatch, capsys):
    before = tree(finished / "paper_figures")

    def interrupt(*_, **__):
        (finished / "build" / "full" / "9_tiny").mkdir()  # begun, not complete
        raise KeyboardInterrupt

    monkeypatch.setattr("papermill.execute_notebook", interrupt)
    assert main(["--root", str(finished), "run"]) == 1
    assert capsys.readouterr().err == "interrupted\n"
    assert tree(finished / "paper_figures") == before
    with pytest.raises(Refused, match="no full run"):
        runner.store(finished, "9_tiny")


@pytest.mark.parametrize("word", ["run=5", "runs=abc"])
def test_bad_command_line_runs_nothing(root, word, capsys):
    save(root, cell("open('ran', 'w')"))
    assert main(["--root", str(root), "run", "--param", word]) == 1
    error = capsys.readouterr().err
    assert error.startswith("9_tiny: ")
    assert error.count("\n") == 1
    assert not (root / "build").exists()


# ---------------------------------------------------------------- stored outputs and stamps


def test_stored_notebook_is_clean_and_a_second_run_changes_no_byte(finished):
    path = finished / "notebooks" / "9_tiny.ipynb"
    runner.store(finished, "9_tiny")
    text = path.read_text()
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
    assert path.read_text() == text
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
    rule, *empty = stamp.with_suffix(".d").read_text().splitlines()
    names = "__init__ checks estimates montecarlo report scenario"
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
        (package / name).write_text(source)
    save(root, cell("%time 1\n!true\nfrom seanav.studies import a"))
    found = {p.relative_to(package).as_posix() for p in runner.dependencies(root, "9_tiny")}
    assert found == sources.keys() - {"runner.py", "studies/b.py", "filters/unused.py"}


# ---------------------------------------------------------------- comparing


@pytest.fixture
def fresh(finished):
    """Fresh results of the same paper, beside the committed ones."""
    folder = finished / "build" / "nbval"
    shutil.copytree(finished / "paper_figures" / "9_tiny", folder / "9_tiny")
    shutil.copy(finished / "build" / "full" / "9_tiny.json", folder)
    return folder


def edit(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def append(path, text):
    path.write_text(path.read_text() + text)


def test_equal_results_pass(finished, fresh, capsys):
    assert runner.check(finished, fresh) == []
    assert "9_tiny/figure_01.png: identical" in capsys.readouterr().out


def test_numbers_are_compared_within_the_tolerance(finished, fresh, capsys):
    table = fresh / "9_tiny" / "table_1.csv"
    value = table.read_text().split(",")[-1].strip()
    edit(table, value, repr(float(value) * (1 + 1e-7)))
    assert runner.check(finished, fresh) == []
    assert "9_tiny/table_1.csv: other bytes" in capsys.readouterr().out
    (line,) = runner.check(finished, fresh, rtol=1e-9)
    assert line.startswith(f"9_tiny/table_1.csv: row/1/mean: {value} was ")


DAMAGE = {
    "number in a table": lambda new, root: edit(new / "9_tiny/table_1.csv", "\n2,", "\n2.1,"),
    "word in a claim": lambda new, root: edit(new / "9_tiny/claims.json", "Monte", "Other"),
    "verdict": lambda new, root: edit(new / "9_tiny/claims.json", '"reproduced"', '"partly"'),
    "end of an interval": lambda new, root: edit(new / "9_tiny/claims.json", "[\n      ", "[\n 9"),
    "row more": lambda new, root: edit(new / "9_tiny/table_1.csv", "\n2,", "\n1,1\n2,"),
    "row at the end": lambda new, root: append(new / "9_tiny/table_1.csv", "3,3\n"),
    "row less": lambda new, root: append(root / "paper_figures/9_tiny/table_1.csv", "3,3\n"),
    "renamed column": lambda new, root: edit(new / "9_tiny/table_1.csv", "mean", "median"),
    "missing figure": lambda new, root: (new / "9_tiny/figure_01.pdf").unlink(),
    "figure more": lambda new, root: (new / "9_tiny/figure_02.png").write_text(""),
    "incomplete run": lambda new, root: (new / "9_tiny/claims.json").unlink(),
    "no run": lambda new, root: shutil.rmtree(new),
    "quick run": lambda new, root: edit(new / "9_tiny.json", "false", "true"),
    "other seed": lambda new, root: edit(new / "9_tiny.json", '"seed": 1', '"seed": 2'),
    "edited table": lambda new, root: edit(
        root / "paper_figures/9_tiny/table_1.csv", "\n2,", "\n2.0,"
    ),
    "edited report": lambda new, root: edit(root / "paper_figures/REPORT.md", "1 of 1", "2 of 1"),
    "other lock": lambda new, root: edit(root / "requirements.lock", "numpy", "Numpy"),
    "cut manifest": lambda new, root: edit(root / "paper_figures/manifest.json", '"lock"', '"l"'),
    "other numpy": lambda new, root: edit(
        root / "paper_figures/manifest.json", '"numpy": "2', '"numpy": "1'
    ),
    "no manifest": lambda new, root: (root / "paper_figures/manifest.json").unlink(),
    "stray paper": lambda new, root: (root / "paper_figures/3_stray").mkdir(),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_damage_is_seen(finished, fresh, name, capsys):
    assert runner.check(finished, fresh) == []
    DAMAGE[name](fresh, finished)
    assert main(["--root", str(finished), "check"]) == 1
    assert capsys.readouterr().err.strip()


def test_exceptions_need_a_reason_and_hold_where_they_match(finished, fresh):
    table = fresh / "9_tiny" / "table_1.csv"
    edit(table, "\n2,", "\n2.001,")
    exceptions = finished / "tests" / "tolerances.toml"
    exceptions.parent.mkdir()

    def wrong(match, **also):
        lines = [f"match = {json.dumps(match)}"]
        lines += [f"{key} = {json.dumps(value)}" for key, value in also.items()]
        exceptions.write_text("[[exception]]\n" + "\n".join(lines))
        return runner.check(finished, fresh)

    there = "9_tiny/table_1.csv: row/*/noise"
    assert wrong(there, rtol=1e-2, reason="a test") == []
    assert wrong(there, atol=1e-2, reason="a test") == []
    assert len(wrong(there, rtol=1e-4, reason="a test")) == 1
    assert len(wrong("9_tiny/table_2.csv: *", rtol=1e-2, reason="a test")) == 1
    with pytest.raises(Refused, match="reason"):
        wrong(there, rtol=1e-2)


def test_nothing_to_check_without_a_paper(root):
    assert main(["--root", str(root), "check"]) == 0


# ---------------------------------------------------------------- command line and nbval


def test_list_and_claims(finished, capsys):
    main(["--root", str(finished), "list"])
    main(["--root", str(finished), "claims", "--paper", "9"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[-2] == "9_tiny"
    assert lines[-1].startswith("9.1 reproduced: the mean | is positive (")


def test_nbval_is_strict_and_takes_what_is_stored(finished):
    runner.store(finished, "9_tiny")
    # Another number, output of another kind, more output, an error.
    sources = ["print('mean 2.35')", "2.34", "print('mean 2.34'); 5", "1 / 0"]
    cells = [cell(source) for source in sources]
    for stored in cells:
        stored.execution_count = 1
        stored.outputs = [new_output("stream", name="stdout", text="mean 2.34\n")]
    save(finished, *cells, stem="8_wrong")
    # As ``make test`` does it, in one process.
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--nbval"]
    config = ["-c", str(CHECKOUT / "pyproject.toml"), "--rootdir", str(finished)]
    done = subprocess.run(
        [*command, *config, str(finished / "notebooks")],
        env=os.environ | {"SEANAV_RESULTS": str(finished / "nbval")},
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    assert "4 failed, 5 passed" in done.stdout  # the parameters, and all that was stored
    assert len(re.findall(r"^FAILED .*/8_wrong\.ipynb", done.stdout, re.M)) == 4
    fresh = tree(finished / "nbval" / "9_tiny")
    assert fresh == tree(finished / "paper_figures" / "9_tiny")
