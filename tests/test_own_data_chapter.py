"""The book's chapter on own data: what it names is there, and its examples run as they stand."""

import re
from contextlib import chdir
from importlib import import_module
from pathlib import Path

import pytest

from seanav import runner
from seanav.checks import ParameterError
from seanav.scenario import File

ROOT = Path(__file__).resolve().parents[1]
CHAPTER = (ROOT / "book" / "own_data.md").read_text(encoding="utf-8")
STEMS = {stem[0]: stem for stem in runner.papers(ROOT)}
FILES = {
    paper: [
        name for name, (_, about) in scenario.declared().items() if isinstance(about.kind, File)
    ]
    for paper, stem in STEMS.items()
    for scenario in [import_module(f"seanav.studies.{stem[2:]}.scenario").Scenario]
}
OWN = [paper for paper, names in FILES.items() if names]  # those that take a record

EXAMPLE = re.compile(r"```\{code-block\} (\w+)\n:caption: (\S+\.\w+)\n(.*?)```", re.DOTALL)
CELL = re.compile(r":caption: the parameters cell of paper (\d)\n(.*?)```", re.DOTALL)
COMMAND = re.compile(r'make figures PAPER=(\d)(?: QUICK=1)? PARAMS="([^"]*)"')
EXAMPLES = {name: text for _, name, text in EXAMPLE.findall(CHAPTER)}
COMMANDS = sorted(set(COMMAND.findall(CHAPTER)))
CELLS = CELL.findall(CHAPTER)


def defaults(paper):
    return runner.defaults(runner.notebook(ROOT, STEMS[paper]))


def section(paper):
    """Return the text of a paper's section."""
    return re.search(rf"\n## Paper {paper}: .*?(?=\n## )", CHAPTER, re.DOTALL)[0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Write the examples into a folder and run those that write others."""
    place = tmp_path_factory.mktemp("examples")
    for name, text in EXAMPLES.items():
        (place / name).write_text(text, encoding="utf-8")
    with chdir(place):
        for name, text in EXAMPLES.items():
            if name.endswith(".py"):
                exec(compile(text, name, "exec"), {"__name__": "example"})
    return place


def first_cells(paper, changes):
    """Run the cells that check the parameters and read the files."""
    book = runner.notebook(ROOT, STEMS[paper])
    cells = [cell.source for cell in book.cells if cell.cell_type == "code"]
    names = {"__name__": "notebook"} | defaults(paper) | changes
    exec(cells[1], names)
    return names


@pytest.mark.parametrize("paper", OWN)
def test_every_file_that_a_paper_takes_has_its_section_a_command_and_a_cell(paper):
    for name in FILES[paper]:
        assert f"`{name}`" in section(paper), name
    assert paper in {number for number, _ in COMMANDS}
    assert paper in {number for number, _ in CELLS}
    assert EXAMPLE.search(section(paper))


def test_other_papers_have_no_section():
    assert [n for n in STEMS if f"\n## Paper {n}: " in CHAPTER] == OWN


@pytest.mark.parametrize(("paper", "words"), COMMANDS)
def test_every_command_names_parameters_and_files_that_are_there(paper, words, folder):
    known = defaults(paper)
    split = re.findall(r"\w+=(?:'[^']*'|\[[^=]*\]|\S+)", words)
    assert " ".join(split) == words
    for name, value in runner.overrides(known, split).items():
        if isinstance(value, str) and "." in value and not value.startswith("my data/"):
            assert (folder / value.strip("'")).is_file(), (name, value)


@pytest.mark.parametrize(("paper", "words"), [one for one in COMMANDS if "my data" not in one[1]])
def test_every_command_is_read_by_the_notebook(paper, words, folder):
    split = re.findall(r"\w+=(?:'[^']*'|\[[^=]*\]|\S+)", words)
    with chdir(folder):
        first_cells(paper, runner.overrides(defaults(paper), split))


@pytest.mark.parametrize(("paper", "source"), CELLS)
def test_every_parameters_cell_is_read_by_the_notebook(paper, source, folder):
    names: dict = {}
    exec(source, names)
    changes = {name: value for name, value in names.items() if not name.startswith("__")}
    assert set(changes) <= set(defaults(paper))
    (folder / "notebooks").mkdir(exist_ok=True)
    with chdir(folder / "notebooks"):
        first_cells(paper, changes)


@pytest.mark.parametrize("paper", OWN)
def test_every_parameter_of_the_text_is_declared(paper):
    known = set().union(*map(defaults, STEMS))
    text = re.sub(r"```.*?```", "", section(paper), flags=re.DOTALL)
    named = set(re.findall(r"`(\w+_(?:file|source|path_km|gap_s|mean|model|share))`", text))
    assert named
    assert named <= known
    assert named & set(defaults(paper))


@pytest.mark.parametrize("paper", OWN)
def test_a_file_that_is_missing_is_one_line(paper):
    for name in FILES[paper]:
        with pytest.raises(ParameterError, match=rf"^{name} = 'none\.csv': [^\n]*$"):
            first_cells(paper, {name: "none.csv"})


def test_every_message_of_the_table_is_one_of_ours():
    table = CHAPTER[CHAPTER.index("| it says |") :]
    said = [row.split("|")[1] for row in table.split("\n\n")[0].splitlines()[2:]]
    code = "".join(
        path.read_text(encoding="utf-8")
        for folder in ("records", "studies")
        for path in (ROOT / "src/seanav" / folder).rglob("*.py")
    )
    messages = [one for row in said for one in re.findall(r"`([^`]*)`", row)]
    assert len(messages) >= 15
    for message in messages:
        words = re.sub(r'"\s*\n\s*f?"', "", code)  # a text over two lines
        assert message in words, message
