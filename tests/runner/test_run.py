"""Papers, parameters, and runs of tiny notebooks."""

import json

import nbformat
import pytest
from tiny import PARAMETERS, STUDY, cell, save, tree

from seanav import runner
from seanav.__main__ import main
from seanav.checks import ParameterError
from seanav.runner import Refused


def test_papers_are_the_notebooks(root):
    assert runner.papers(root) == []
    for stem in ("5_b", "4_a", "15_c"):
        save(root, stem=stem)
    assert runner.papers(root) == ["15_c", "4_a", "5_b"]
    assert runner.papers(root, "5") == runner.papers(root, "5_b") == ["5_b"]
    with pytest.raises(Refused, match=r"^no paper '6'; there are: 15_c, 4_a, 5_b$"):
        runner.papers(root, "6")


def test_a_lesson_is_no_paper(root):
    for stem in ("0_begin", "10_last", "1_first"):
        save(root, stem=stem)
    assert runner.lessons(root) == ["0_begin"]
    assert runner.papers(root) == ["10_last", "1_first"]
    with pytest.raises(Refused, match=r"^no paper '0'"):
        runner.papers(root, "0")


def lesson(root, *sources):
    path = save(root, *map(cell, sources), stem="0_begin")
    book = nbformat.read(path, as_version=4)
    book.cells = [c for c in book.cells if not c.metadata.get("tags")]
    book.metadata = nbformat.from_dict({"kernelspec": book.metadata.kernelspec, "seanav": {}})
    nbformat.write(book, path)
    return path


def test_a_lesson_is_run_and_keeps_its_outputs_and_no_other_trace(root):
    path = lesson(root, "import os\nprint('no terminal:', not os.environ['SEANAV_PROGRESS'])")
    assert main(["--root", str(root), "lessons"]) == 0
    text = path.read_text(encoding="utf-8")
    book = nbformat.reads(text, as_version=4)
    assert book.cells[1].outputs[0].text == "no terminal: True\n"
    assert book.cells[1].execution_count == 1
    assert book.cells[1].metadata == {}
    assert set(book.metadata) == {"kernelspec", "language_info", "seanav"}
    assert not (root / "paper_figures").exists()
    assert runner.teach(root, "0_begin") == []
    assert path.read_text(encoding="utf-8") == text


def test_a_lesson_that_fails_is_left_as_it_was(root, capsys):
    path = lesson(root, "print(1)", "1 / 0")
    before = path.read_bytes()
    assert main(["--root", str(root), "lessons"]) == 1
    assert "0_begin: cell 2: ZeroDivisionError: division by zero" in capsys.readouterr().err
    assert path.read_bytes() == before
    assert (root / "build" / "failed" / "0_begin.ipynb").is_file()


def test_defaults_are_the_literals_of_the_tagged_cell(root):
    save(root)
    known = runner.defaults(runner.notebook(root, "9_tiny"))
    assert known == {
        "runs": 20,
        "seed": 1,
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
        "findings.json",
        "parameters.csv",
        "table_1.csv",
    }
    entry = json.loads((figures / "manifest.json").read_text(encoding="utf-8"))["9_tiny"]
    assert set(entry["files"]) == names
    assert entry["parameters"] == {"runs": 20}
    assert entry["seed"] == 1
    assert entry["packages"]["numpy"].startswith("2.")
    report = (figures / "REPORT.md").read_text(encoding="utf-8")
    assert "Of 1 claims: 1 reproduced, 0 mixed" in report
    assert "that agree within two standard errors of both: 1 of 1." in report
    row = (
        r"| 9.1 | “the mean \| is positive” | the mean is at least 0 | **reproduced**: 1 of 1 hold"
    )
    assert row in report
    assert not (finished / "build" / "failed").exists()


def test_manifest_keeps_other_papers_and_drops_lost_ones(finished):
    path = finished / "paper_figures" / "manifest.json"
    entry = json.loads(path.read_text(encoding="utf-8"))["9_tiny"]
    path.write_text(json.dumps({"8_other": entry, "7_gone": entry}), encoding="utf-8")
    save(finished, stem="8_other")
    assert main(["--root", str(finished), "run", "--paper", "9"]) == 0
    assert list(json.loads(path.read_text(encoding="utf-8"))) == ["8_other", "9_tiny"]


def test_quick_and_other_parameters_stay_below_build(finished, capsys):
    before = tree(finished / "paper_figures")
    quick = runner.run(finished, "9_tiny", quick=True)
    params = runner.run(finished, "9_tiny", words=("noise_mgal=3", "runs=30"))
    assert quick == finished / "build/quick/9_tiny"
    assert params == finished / "build/params/9_tiny"
    assert json.loads((quick / "claims.json").read_text(encoding="utf-8"))["9.1"]["quick"] is True
    assert "quick" not in json.loads((params / "claims.json").read_text(encoding="utf-8"))["9.1"]
    assert (params / "table_1.csv").read_text(encoding="utf-8").startswith("noise,mean\n3,")
    assert tree(finished / "paper_figures") == before
    assert "9_tiny: quick run, about 2 s expected" in capsys.readouterr().out


FAILURES = {
    "bad parameter": ([STUDY], "9_tiny: runs = 1: must be an integer of at least 2", ("runs=1",)),
    "error": (["1 / 0"], "9_tiny: cell 2: ZeroDivisionError: division by zero", ()),
    "tolerated error": (["1 / 0 # tagged"], "9_tiny: cell 2: ZeroDivisionError", ()),
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
    (figures / "claims.json").write_text("{}", encoding="utf-8")
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


@pytest.mark.parametrize("word", ["run=5", "runs=abc"])
def test_bad_command_line_runs_nothing(root, word, capsys):
    save(root, cell("open('ran', 'w')"))
    assert main(["--root", str(root), "run", "--param", word]) == 1
    error = capsys.readouterr().err
    assert error.startswith("9_tiny: ")
    assert error.count("\n") == 1
    assert not (root / "build").exists()
