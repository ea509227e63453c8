"""The comparison with the committed results, the command line, and nbval."""

import json
import os
import re
import shutil
import subprocess
import sys

import pytest
from nbformat.v4 import new_output
from tiny import CHECKOUT, cell, save, tree

from seanav import runner
from seanav.__main__ import main
from seanav.runner import Refused
from seanav.runner.summary import BEGIN, END


@pytest.fixture
def fresh(finished):
    """Fresh results of the same paper, beside the committed ones."""
    folder = finished / "build" / "nbval"
    shutil.copytree(finished / "paper_figures" / "9_tiny", folder / "9_tiny")
    shutil.copy(finished / "build" / "full" / "9_tiny.json", folder)
    return folder


def edit(path, old, new):
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def append(path, text):
    path.write_text(path.read_text(encoding="utf-8") + text, encoding="utf-8")


def test_equal_results_pass(finished, fresh, capsys):
    assert runner.check(finished, fresh) == []
    assert "9_tiny/figure_01.png: identical" in capsys.readouterr().out


def test_numbers_are_compared_within_the_tolerance(finished, fresh, capsys):
    table = fresh / "9_tiny" / "table_1.csv"
    value = table.read_text(encoding="utf-8").split(",")[-1].strip()
    edit(table, value, repr(float(value) * (1 + 1e-7)))
    assert runner.check(finished, fresh) == []
    assert "9_tiny/table_1.csv: other bytes" in capsys.readouterr().out
    (line,) = runner.check(finished, fresh, rtol=1e-9)
    assert line.startswith(f"9_tiny/table_1.csv: row/1/mean: {value} was ")


DAMAGE = {
    "number in a table": lambda new, root: edit(new / "9_tiny/table_1.csv", "\n2,", "\n2.1,"),
    "word in a claim": lambda new, root: edit(new / "9_tiny/claims.json", "Monte", "Other"),
    "verdict": lambda new, root: edit(new / "9_tiny/claims.json", '"reproduced"', '"mixed"'),
    "end of an interval": lambda new, root: edit(
        new / "9_tiny/claims.json", '"interval": [\n        ', '"interval": [\n 9'
    ),
    "row more": lambda new, root: edit(new / "9_tiny/table_1.csv", "\n2,", "\n1,1\n2,"),
    "row at the end": lambda new, root: append(new / "9_tiny/table_1.csv", "3,3\n"),
    "row less": lambda new, root: append(root / "paper_figures/9_tiny/table_1.csv", "3,3\n"),
    "renamed column": lambda new, root: edit(new / "9_tiny/table_1.csv", "mean", "median"),
    "missing figure": lambda new, root: (new / "9_tiny/figure_01.pdf").unlink(),
    "figure more": lambda new, root: (new / "9_tiny/figure_02.png").write_text(
        "", encoding="utf-8"
    ),
    "incomplete run": lambda new, root: (new / "9_tiny/claims.json").unlink(),
    "no run": lambda new, root: shutil.rmtree(new),
    "quick run": lambda new, root: edit(new / "9_tiny.json", "false", "true"),
    "other seed": lambda new, root: edit(new / "9_tiny.json", '"seed": 1', '"seed": 2'),
    "edited table": lambda new, root: edit(
        root / "paper_figures/9_tiny/table_1.csv", "\n2,", "\n2.0,"
    ),
    "edited report": lambda new, root: edit(root / "paper_figures/REPORT.md", "1 of 1", "2 of 1"),
    "no picture of the claims": lambda new, root: (root / "paper_figures/claims.png").unlink(),
    "other findings": lambda new, root: edit(new / "9_tiny/findings.json", "is 2.", "is 3."),
    "region moved since": lambda new, root: edit(
        root / "notebooks/9_tiny.ipynb", "low=0.0", "low=-1.0"
    ),
    "readme counts others": lambda new, root: (root / "README.md").write_text(
        f"{BEGIN}\n| 9 tiny | 2 |\n{END}\n", encoding="utf-8"
    ),
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
        exceptions.write_text("[[exception]]\n" + "\n".join(lines), encoding="utf-8")
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
    listed, *lines = capsys.readouterr().out.splitlines()
    assert listed == "9_tiny"
    assert lines[0] == "9.1 reproduced: 1 of 1 hold, 0 fail, 0 undecided"
    assert lines[1].strip() == "“the mean | is positive” (section 2)"
    assert lines[3].strip().startswith("decisive: tiny: 2.")
    main(["--root", str(finished), "claims", "--verdict", "mixed", "undecided"])
    assert not capsys.readouterr().out.strip()


def test_a_parameters_cell_is_written_as_declared(finished):
    before = runner.notebook(finished, "9_tiny")
    assert not runner.declare(finished, "9_tiny", runner.parameters_cell(before).source)
    assert runner.declare(finished, "9_tiny", "runs = 7\nquick = False")
    after = runner.notebook(finished, "9_tiny")
    assert runner.defaults(after) == {"runs": 7, "quick": False}
    changed = [a != b for a, b in zip(before.cells, after.cells, strict=True)]
    assert changed.count(True) == 1


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
