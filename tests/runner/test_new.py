"""A paper that is not there yet is laid out, and passes the tests of all papers."""

import shutil
import subprocess
import sysconfig
import venv
from pathlib import Path

import pytest
from tiny import CHECKOUT, tree

from seanav import runner
from seanav.runner import Refused

PARTS = ("src", "tests", "notebooks", "paper_figures", "book", "benchmarks")


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of this checkout with an environment that imports the copy."""
    root = tmp_path_factory.mktemp("new") / "checkout"
    root.mkdir()
    without = shutil.ignore_patterns("__pycache__")
    for name in PARTS:
        shutil.copytree(CHECKOUT / name, root / name, ignore=without)
    for path in CHECKOUT.iterdir():
        if path.is_file():
            shutil.copy(path, root)
    venv.create(root / ".venv", with_pip=False)
    packages = Path(sysconfig.get_path("purelib", vars={"base": str(root / ".venv")}))
    places = f"{root / 'src'}\n{sysconfig.get_path('purelib')}\n"
    (packages / "places.pth").write_text(places, encoding="utf-8")
    return root


def python(root, *words, **environment):
    command = [root / ".venv/bin/python", "-m", *words]
    done = subprocess.run(
        command, cwd=root, env=environment or None, capture_output=True, encoding="utf-8"
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    return done.stdout


def test_an_empty_paper_passes_what_all_papers_pass(checkout):
    printed = python(checkout, "seanav", "new", "6_wave_filter")
    assert "notebooks/6_wave_filter.ipynb" in printed.splitlines()
    for words in (("check",), ("format", "--check")):
        python(checkout, "ruff", *words, "src", "tests/studies", "notebooks")
    python(checkout, "seanav", "run", "--paper", "6")
    python(checkout, "seanav", "store", "--paper", "6")
    tests = ("tests/test_repository.py", "tests/studies/test_wave_filter.py")
    python(checkout, "pytest", "-q", "-p", "no:cacheprovider", *tests)
    strict = ("--nbval", "notebooks/6_wave_filter.ipynb")
    results = {"SEANAV_RESULTS": str(checkout / "build/nbval"), "PATH": "/usr/bin:/bin"}
    assert " passed" in python(checkout, "pytest", "-p", "no:cacheprovider", *strict, **results)
    again = checkout / "build/nbval/6_wave_filter/table_1.csv"
    kept = checkout / "paper_figures/6_wave_filter/table_1.csv"
    assert again.read_bytes() == kept.read_bytes()
    assert "6.1" in python(checkout, "seanav", "claims", "--paper", "6")
    assert "](notebooks/6_wave_filter.ipynb)" in (checkout / "README.md").read_text("utf-8")


@pytest.mark.parametrize(
    "stem", ["wave", "6", "6_", "6_Wave", "0_lesson", "06_x", "6_x-y", "6_x/y", "6_../x", ""]
)
def test_other_names_are_refused(stem, root):
    with pytest.raises(Refused, match=r"must be a number and a name in small letters[^\n]*$"):
        runner.new(root, stem)


def test_where_there_are_no_notebooks_nothing_is_written(root):
    before = tree(root)
    with pytest.raises(Refused, match=r"is no checkout: [^\n]*$"):
        runner.new(root, "6_wave_filter")
    assert tree(root) == before


def test_what_is_there_stays(root):
    (root / "notebooks").mkdir()
    made = runner.new(root, "6_wave_filter")
    texts = {path: path.read_bytes() for path in made}
    with pytest.raises(Refused, match=r"^6_other: paper 6 is 6_wave_filter$"):
        runner.new(root, "6_other")
    with pytest.raises(Refused, match=r"__init__\.py is there already$"):
        runner.new(root, "7_wave_filter")
    assert {path: path.read_bytes() for path in made} == texts
