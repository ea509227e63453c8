"""What no other test sees: the shape of the repository and of its notebooks."""

import ast
import hashlib
import importlib
import importlib.util
import inspect
import json
import os
import re
import runpy
import shutil
import subprocess
from collections import Counter
from pathlib import Path

import nbformat
import pytest

from seanav import runner
from seanav.claims import VERDICTS, counted, outcomes_of

ROOT = Path(__file__).resolve().parents[1]
REPORT = Path("paper_figures", "REPORT.md")
PACKAGE = ROOT / "src" / "seanav"
SOURCES = sorted(PACKAGE.rglob("*.py"))
NOTEBOOKS = [ROOT / "notebooks" / f"{stem}.ipynb" for stem in runner.papers(ROOT)]
LESSONS = [ROOT / "notebooks" / f"{stem}.ipynb" for stem in runner.lessons(ROOT)]

# ---------------------------------------------------------------- layers


def modules():
    for path in SOURCES:
        yield path, path.relative_to(PACKAGE).with_suffix("").parts[0]


def test_no_study_is_known_to_the_machinery():
    for path, layer in modules():
        if layer not in ("models", "filters", "studies", "exercises"):
            assert not re.search(
                r"gravity|fading|current|neural|ito", path.read_text(encoding="utf-8")
            ), path


def test_no_file_has_over_400_lines():
    files = [*SOURCES, *(ROOT / "book").glob("*.py"), *(ROOT / "benchmarks").glob("*.py")]
    for path in files:
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 400, path


def test_kernels_are_only_where_the_cache_key_looks():
    for path, layer in modules():
        kernels = {
            ast.unparse(decorator)
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.FunctionDef)
            for decorator in node.decorator_list
            if re.search(r"\b(kernel|n?jit|vectorize)\b", ast.unparse(decorator))
        }
        assert not kernels or layer in ("models", "filters"), path
        assert kernels <= {"kernel"}, f"{path}: compiled past seanav._compile"


def bare(source):
    """Return the lines of `source` that read or write text in the user's own encoding."""
    found = []
    for node in (n for n in ast.walk(ast.parse(source)) if isinstance(n, ast.Call)):
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        told = any(word.arg == "encoding" for word in node.keywords)
        texts = [a.value for a in node.args if isinstance(a, ast.Constant)]
        text_file = isinstance(node.func, ast.Name) or (texts[:1] == ["w"] and len(node.args) == 1)
        opens = name == "open" and text_file
        binary = any(isinstance(text, str) and "b" in text for text in texts[-1:])
        reads = name == "read_text" and not texts
        writes = name == "write_text" and len(node.args) < 2
        if not told and (reads or writes or (opens and not binary)):
            found.append(node.lineno)
    return found


def test_all_text_is_read_and_written_as_utf_8():
    files = [*SOURCES, *(ROOT / "tests").rglob("*.py"), *(ROOT / "benchmarks").glob("*.py")]
    for path in [*files, *(ROOT / "book").glob("*.py")]:
        assert not bare(path.read_text(encoding="utf-8")), path


@pytest.mark.parametrize(
    "source", ["p.read_text()", "p.write_text(x)", "open(p)", "open(p, 'w')", "p.open('w')"]
)
def test_an_own_encoding_is_seen(source):
    assert bare(source) == [1]
    assert bare(source.replace(")", ", encoding='utf-8')").replace("(, ", "(")) == []


# ---------------------------------------------------------------- committed text

PLACES = re.compile(
    r"(?<![\w.:/])/(home|root|Users|tmp|work|mnt|opt|private/var)/\w"
    r"|[A-Za-z]:\\\\?Users|file:/{3}|localhost:\d|--(extra-)?index-url|/simple/"
)


def git(folder, *arguments):
    """Return what git prints in `folder`, whatever the user's settings and the owner are."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    clean |= {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull}
    clean |= {
        f"GIT_{who}_{what}": "x" for who in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")
    }
    command = ["git", "-c", "safe.directory=*", *arguments]
    done = subprocess.run(command, cwd=folder, env=clean, check=True, stdout=subprocess.PIPE)
    return done.stdout.decode()


def committed(root):
    """Return the files of a checkout that git tracks: of an archive none, of a user none."""
    if not (root / ".git").exists():
        return []
    listed = git(root, "ls-files", "-z").split("\0")
    return [root / name for name in listed if name and (root / name).is_file()]


def test_no_place_of_a_machine_is_committed():
    for path in committed(ROOT):
        if path == Path(__file__).resolve() or path.suffix in (".png", ".pdf"):
            continue
        found = PLACES.search(path.read_text(encoding="utf-8"))
        assert found is None, f"{path}: {found.group()}"


def test_only_what_is_committed_is_read(tmp_path):
    git(tmp_path, "init", "-q")
    (tmp_path / "größe.md").write_text("text", encoding="utf-8")
    git(tmp_path, "add", "größe.md")
    (tmp_path / "own grid.nc").write_bytes(b"\x89HDF\xff")
    archive = tmp_path / "archive"
    archive.mkdir()
    (archive / "note.md").write_text("text", encoding="utf-8")
    assert committed(tmp_path) == [tmp_path / "größe.md"]
    assert committed(archive) == []  # though it lies in a repository


def test_a_clone_holds_the_same_bytes_whatever_git_does_to_lines(tmp_path):
    kept, clone = tmp_path / "kept", tmp_path / "clone"
    shutil.copytree(ROOT / "paper_figures", kept / "paper_figures")
    for name in (".gitattributes", "requirements.lock", "Makefile"):
        shutil.copy(ROOT / name, kept)
    git(kept, "init", "-q")
    git(kept, "add", "--all")
    git(kept, "commit", "-q", "--message", "all")
    git(tmp_path, "clone", "-q", "-c", "core.autocrlf=true", "kept", "clone")
    wrong = [
        f"{stem}/{name}"
        for stem, entry in json.loads(
            (ROOT / "paper_figures/manifest.json").read_text(encoding="utf-8")
        ).items()
        for name, digest in entry["files"].items()
        if hashlib.sha256((clone / "paper_figures" / stem / name).read_bytes()).hexdigest()
        != digest
    ]
    assert wrong == []
    for name in ("requirements.lock", "Makefile", "paper_figures/REPORT.md"):
        assert (clone / name).read_bytes() == (ROOT / name).read_bytes()


@pytest.mark.parametrize(
    "text", ["at /home/me/x", '"/root/x"', r"C:\Users\me", "file:" + "///srv/x", "=/tmp/x"]
)
def test_places_are_seen(text):
    assert PLACES.search(text)


def test_no_test_is_skipped_or_expected_to_fail():
    word = re.compile(r"pytest\.(mark\.)?(skip|xfail|importorskip)|unittest\.skip|collect_ignore")
    # A browser is the only thing that a machine may lack.
    allowed = {"test_pages.py": ['pytest.skip("there is no Chromium here']}
    for path in [*(ROOT / "tests").rglob("*.py"), ROOT / "conftest.py"]:
        if path != Path(__file__).resolve():
            text = path.read_text(encoding="utf-8")
            for excepted in allowed.get(path.name, []):
                assert text.count(excepted) == 1
                text = text.replace(excepted, "")
            assert not word.search(text), path


def test_all_files_name_the_same_version():
    found = {
        name: re.search(pattern, (ROOT / name).read_text(encoding="utf-8"), re.M).group(1)
        for name, pattern in {
            "pyproject.toml": r'^version = "(.+)"$',
            "src/seanav/__init__.py": r'^__version__ = "(.+)"$',
            "CITATION.cff": r"^version: (.+)$",
            "codemeta.json": r'"version": "(.+)"',
            "CHANGELOG.md": r"^## ([0-9.]+)",
        }.items()
    }
    assert len(set(found.values())) == 1, found


# ---------------------------------------------------------------- notebooks


def faults(book, lesson=False):
    """Return what is wrong with the form of a stored notebook; a lesson is never run quickly."""
    found = []
    cells = [cell for cell in book.cells if cell.cell_type == "code" and cell.source.strip()]
    tags = [tag for cell in book.cells for tag in cell.metadata.get("tags", [])]
    if tags.count("parameters") != 1:
        found.append("not exactly one parameters cell")
    if set(tags) - {"parameters", "solution", "hide-output"}:
        found.append(f"tags {set(tags)}")
    if re.search(r"NBVAL|PYTEST_VALIDATE", "".join(cell.source for cell in book.cells)):
        found.append("a comment for nbval")
    if book.metadata.get("kernelspec", {}).get("name") != "python3":
        found.append("kernel")
    if set(book.metadata) != {"kernelspec", "language_info", "seanav"}:
        found.append("metadata: make notebooks")
    seconds = book.metadata.get("seanav", {}).get("expected_seconds", {})
    if set(seconds) != ({"full"} if lesson else {"full", "quick"}):
        found.append("no expected time")
    if [cell.execution_count for cell in cells] != list(range(1, len(cells) + 1)):
        found.append("not executed from top to bottom")
    for cell in cells:
        if len(cell.source.splitlines()) > 40:
            found.append(f"cell {cell.execution_count} has more than 40 lines")
        if any(o.output_type == "error" or o.get("name") == "stderr" for o in cell.outputs):
            found.append(f"cell {cell.execution_count} failed or warned")
        hidden = cell.metadata.get("jupyter", {}).get("source_hidden", False)
        if hidden != ("solution" in cell.metadata.get("tags", [])):
            found.append(f"cell {cell.execution_count}: solutions are folded, and nothing else")
    return found


def test_stored_notebooks_are_in_form():
    for path in [*NOTEBOOKS, *LESSONS]:
        book = nbformat.read(path, as_version=4)
        assert faults(book, lesson=path in LESSONS) == [], path.name


# One order of parts for all chapters. A heading may say more than its word.
PARTS = ("learn", "notation", "explore", "take away", "exercises", "references")


@pytest.mark.parametrize("path", [*LESSONS, *NOTEBOOKS], ids=lambda path: path.stem)
def test_every_chapter_has_the_same_parts_in_the_same_order(path):
    cells = nbformat.read(path, as_version=4).cells
    lines = [x for c in cells if c.cell_type == "markdown" for x in c.source.splitlines()]
    headings = [line.lower() for line in lines if line.startswith("## ")]
    places = [next((k for k, h in enumerate(headings) if part in h), None) for part in PARTS]
    assert None not in places, dict(zip(PARTS, places, strict=True))
    assert places == sorted(places), dict(zip(PARTS, places, strict=True))
    pictures = [
        k
        for k, cell in enumerate(cells)
        if any("image/png" in output.get("data", {}) for output in cell.get("outputs", []))
    ]
    assert pictures[0] < 10, "no picture within the first ten cells"
    assert path.stat().st_size <= 3e6, "hosting services show no larger notebooks"


@pytest.mark.parametrize("path", [*LESSONS, *NOTEBOOKS], ids=lambda path: path.stem)
def test_no_printed_line_wraps(path):
    for cell in nbformat.read(path, as_version=4).cells:
        for output in cell.get("outputs", []):
            for line in output.get("text", "").splitlines():
                # A caption, a quotation and a finding are sentences: they may wrap.
                if re.search(r"\S {2,}\S", line.strip()):
                    assert len(line) <= 100, f"cell {cell.execution_count}: {line}"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_parameters_are_those_that_the_study_declares(path):
    study = importlib.import_module(f"seanav.studies.{path.stem.partition('_')[2]}.scenario")
    book = nbformat.read(path, as_version=4)
    assert runner.parameters_cell(book).source == study.Scenario.cell()  # python -m seanav cells
    sources = [cell.source for cell in book.cells if cell.cell_type == "code"]
    assert sum("scenario = Scenario.read(globals())" in source for source in sources) == 1


def good_notebook():
    cells = [
        nbformat.v4.new_code_cell(source, execution_count=k) for k, source in enumerate("ab", 1)
    ]
    cells[0].metadata["tags"] = ["parameters"]
    metadata = {
        "kernelspec": {"name": "python3", "display_name": "Python 3"},
        "language_info": {"name": "python"},
        "seanav": {"expected_seconds": {"full": 9, "quick": 1}},
    }
    return nbformat.v4.new_notebook(cells=cells, metadata=metadata)


BREAKAGES = {
    "no parameters": lambda book: book.cells[0].metadata.clear(),
    "two parameters cells": lambda book: book.cells[1].metadata.update(tags=["parameters"]),
    "skip tag": lambda book: book.cells[1].metadata.update(tags=["nbval-skip"]),
    "tolerated error": lambda book: book.cells[1].metadata.update(tags=["raises-exception"]),
    "ignore comment": lambda book: book.cells[1].update(source="# NBVAL_IGNORE_OUTPUT\n1"),
    "long cell": lambda book: book.cells[1].update(source="1\n" * 41),
    "not executed": lambda book: book.cells[1].update(execution_count=None),
    "out of order": lambda book: book.cells[1].update(execution_count=7),
    "kernel": lambda book: book.metadata.kernelspec.update(name="mine"),
    "traces": lambda book: book.metadata.update(papermill={}),
    "no time": lambda book: book.metadata.seanav.clear(),
    "warning": lambda book: book.cells[1].outputs.append(
        nbformat.v4.new_output("stream", name="stderr", text="odd")
    ),
    "open solution": lambda book: book.cells[1].metadata.update(tags=["solution"]),
    "hidden cell": lambda book: book.cells[1].metadata.update(jupyter={"source_hidden": True}),
}


def test_good_form_passes():
    assert faults(good_notebook()) == []


@pytest.mark.parametrize("name", BREAKAGES)
def test_bad_form_is_seen(name):
    book = good_notebook()
    BREAKAGES[name](book)
    assert faults(book)


def test_every_committed_notebook_is_a_paper_or_a_lesson():
    found = {p for p in committed(ROOT) if p.parent == ROOT / "notebooks"}
    assert found <= {*NOTEBOOKS, *LESSONS}


def test_every_paper_has_one_stem():
    for path in NOTEBOOKS:
        number, _, name = path.stem.partition("_")
        assert number.isdecimal()
        room = PACKAGE / "studies" / name
        assert (room / "scenario.py").is_file() or room.with_suffix(".py").is_file()
        assert (ROOT / "paper_figures" / path.stem / "claims.json").is_file()


# ---------------------------------------------------------------- book and make


@pytest.mark.parametrize("path", sorted((ROOT / "benchmarks").glob("*.py")), ids=lambda p: p.stem)
def test_benchmarks_find_what_they_time(path, monkeypatch):
    monkeypatch.syspath_prepend(str(path.parent))
    tree, found = ast.parse(path.read_text(encoding="utf-8")), runpy.run_path(str(path))
    modules = {n: v for n, v in found.items() if inspect.ismodule(v)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            assert node.value.id not in modules or hasattr(modules[node.value.id], node.attr)


def test_make_help_lists_every_target():
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    phony = re.search(r"^\.PHONY: (.*)$", text, re.M).group(1).split()
    listed = re.findall(r"^([a-z.-]+):.*## ", text, re.M)
    assert set(phony) - {"FORCE"} == set(listed)


def test_report_readme_and_notebooks_count_the_same_claims():
    everything = runner.claims(ROOT)
    assert list(everything) == runner.papers(ROOT)
    readme, report = ((ROOT / n).read_text("utf-8") for n in ("README.md", REPORT))
    for stem, claims in everything.items():
        counts = Counter(claim["verdict"] for claim in claims.values())
        (line,) = [x for x in readme.splitlines() if f"](notebooks/{stem}.ipynb)" in x]
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        assert [int(cell) for cell in cells[1:-1]] == [counts[verdict] for verdict in VERDICTS]
        *_, last = runner.notebook(ROOT, stem).cells
        said = "; ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS)
        assert said in last.outputs[0].text
        for number, claim in claims.items():
            found = counted(outcomes_of(claim))
            assert f"**{claim['verdict']}**" in report
            rows = [x for x in report.splitlines() if x.startswith(f"| {number} | “")]
            assert len(rows) == 1 + claim["main"]
            assert all(found in row for row in rows) or not claim["decisive"]


def test_a_mixed_claim_says_by_groups_where_it_holds():
    for stem, claims in runner.claims(ROOT).items():
        for number, claim in claims.items():
            if claim["verdict"] == "mixed":
                counted_ = [c for c in claim["conditions"] if not c["aside"]]
                groups = {c["group"] for c in counted_}
                assert len(groups) > 1, (stem, number)
                assert all(groups), (stem, number)


def test_conditions_of_a_claim_are_facts_of_their_own():
    for stem, claims in runner.claims(ROOT).items():
        for number, claim in claims.items():
            sampled = [c for c in claim["conditions"] if c["interval"] and not c["aside"]]
            # Shares of none and of all are equal without being the same fact.
            sampled = [c for c in sampled if c["value"] not in (0, 1)]
            facts = [(c["value"], *c["interval"], *c["region"]) for c in sampled]
            assert len(set(facts)) == len(facts), (stem, number)
