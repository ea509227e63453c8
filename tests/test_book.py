"""Chapters of the book, as Sphinx is given them, and what links in them lead to."""

import importlib
import re
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from docutils import nodes
from docutils.utils import new_document

from seanav import runner
from seanav.exercises import stated

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "book"))
build, chapters, links = map(importlib.import_module, ("build", "chapters", "links"))
STEMS = [*runner.lessons(ROOT), *runner.papers(ROOT)]

# ---------------------------------------------------------------- chapters


@pytest.mark.parametrize("stem", STEMS)
def test_every_picture_has_words_and_every_solution_is_folded(stem):
    pictures = solutions = 0
    for cell in chapters.chapter(stem).cells:
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            assert "image/png" not in data
            for words in re.findall(r'<img .*? alt="(.*?)">', data.get("text/html", "")):
                pictures += 1
                assert len(words) > 10
        if "solution" in cell.metadata.get("tags", []):
            solutions += 1
            assert "hide-cell" in cell.metadata.tags
            assert cell.metadata["mystnb"]["code_prompt_show"].startswith("Solution")
    shown = [o for c in runner.notebook(ROOT, stem).cells for o in c.get("outputs", [])]
    assert pictures == sum("image/png" in output.get("data", {}) for output in shown)
    assert solutions >= 3


@pytest.mark.parametrize("stem", runner.papers(ROOT))
def test_a_chapter_hands_out_its_files(stem):
    cells = chapters.chapter(stem).cells
    assert f'href="downloads/{stem}.ipynb"' in cells[0].source
    asked = bool(stated(runner.notebook(ROOT, stem).cells))
    assert (f'href="downloads/{stem}_handout.ipynb"' in cells[0].source) == asked
    for path in (ROOT / "paper_figures" / stem).glob("*.pdf"):
        assert f'href="{stem}/{path.name}"' in cells[-1].source


@pytest.mark.parametrize("stem", STEMS)
def test_a_handout_asks_and_does_not_tell(stem):
    book = chapters.handout(stem)
    whole = runner.notebook(ROOT, stem)
    assert len(book.cells) == len(whole.cells)
    for exercise, solved in zip(stated(book.cells), stated(whole.cells), strict=True):
        assert exercise.question == solved.question
        assert exercise.solution.source.endswith(f'check("{exercise.number}", answer)')
        assert exercise.solution.outputs == []
        assert not exercise.solution.metadata.get("jupyter", {}).get("source_hidden")
    nbformat.validate(book)


def test_the_table_of_exercises_has_each_once_and_the_easy_ones_first():
    rows = chapters.exercises(STEMS).splitlines()[2:]
    numbers = [re.search(r"\[(\d+\.\d+)\]", row)[1] for row in rows]
    found = [e.number for s in STEMS for e in stated(runner.notebook(ROOT, s).cells)]
    assert sorted(numbers) == sorted(found)
    stars = [row.count("★") for row in rows]
    assert stars == sorted(stars)


# ---------------------------------------------------------------- what cells show


def printed(text):
    return nbformat.v4.new_output("stream", name="stdout", text=text)


def picture(alt="What is seen, in words."):
    about = {"image/png": {"alt": alt, "width": 300}}
    return nbformat.v4.new_output("display_data", data={"image/png": "aWJt\n"}, metadata=about)


TABLE = """before
Table B9. Two filters, one < two.
filter  rmse (m)  word
EKF     1.25
IMM     -3e-05    of late
after it, a sentence that is longer than the columns
"""


def test_a_printed_table_becomes_one_and_the_text_around_it_stays():
    before, table, after = chapters.shown("none", [printed(TABLE)])
    assert before.text == "before\n"
    assert after.text == "after it, a sentence that is longer than the columns\n"
    html = table.data["text/html"]
    assert '<figure class="result" id="table-b9">' in html
    assert "<figcaption>Table B9. Two filters, one &lt; two.</figcaption>" in html
    heads = re.findall(r"<th scope[^>]*>(.*?)</th>", html)
    assert heads == ["filter", "rmse (m)", "word"]
    rows = [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in re.findall(r"<tr>(.*?)</tr>", html)]
    assert rows[1:] == [["EKF", "1.25", ""], ["IMM", "-3e-05", "of late"]]
    assert html.count("<td class=number>") == 2
    assert "<details>" not in html


def test_parts_of_a_table_stand_below_its_one_caption():
    text = "Table 2. Both.\nhere  a\nx     1\n\nthere  b\ny      2\n\nat most 3 %\nof all\n"
    table, after = chapters.shown("none", [printed(text)])
    html = table.data["text/html"]
    assert (html.count("<figcaption>"), html.count("<table")) == (1, 2)
    assert after.text == "\nat most 3 %\nof all\n"
    alone, after = chapters.shown("none", [printed("Table 3. Elsewhere.\nat most 3 %\n")])
    assert "<table" not in alone.data["text/html"]
    assert after.text == "at most 3 %\n"


def test_a_long_table_is_folded():
    text = "Table 1. Long.\nname    value\n" + "".join(f"row {k:02d}  {k}\n" for k in range(31))
    (table,) = chapters.shown("none", [printed(text)])
    assert "<details><summary>31 rows</summary>" in table.data["text/html"]


@pytest.mark.parametrize("stem", runner.papers(ROOT))
def test_tables_of_a_chapter_are_those_that_were_saved(stem):
    found = 0
    for cell in chapters.chapter(stem).cells:
        for output in cell.get("outputs", []):
            html = output.get("data", {}).get("text/html", "")
            found += len(re.findall(r'href="[^"]*/\w+\.csv"', html))
            for file, body in re.findall(r'href="[^"]*/(\w+\.csv)" .*?<tbody>(.*?)</tbody>', html):
                saved = ROOT / "paper_figures" / stem / file
                rows = len(saved.read_text("utf-8").splitlines()) - 1
                assert body.count("<tr>") <= rows
                if file == "parameters.csv":  # printed in folded lines
                    assert body.count("<tr>") == rows
            assert not re.search(r"^Table \w+\. ", output.get("text", ""), re.M)
    texts = [
        o.get("text", "") for c in runner.notebook(ROOT, stem).cells for o in c.get("outputs", [])
    ]
    assert found == sum(len(re.findall(r"^(?:Table \w+\. |name +value)", t, re.M)) for t in texts)


def test_captions_stay_with_their_pictures():
    outputs = [printed("a\nFigure 1. One.\n"), picture(), printed("b\n")]
    outputs += [printed("Figure B2. Two.\n"), picture("Other words for it."), picture()]
    one, first, two, second, bare = chapters.shown("none", outputs)
    assert (one.text, two.text) == ("a\n", "b\n")
    assert "<figcaption>Figure 1. One.</figcaption>" in first.data["text/html"]
    assert 'id="figure-1"' in first.data["text/html"]
    assert 'id="figure-b2"' in second.data["text/html"]
    assert 'alt="Other words for it."' in second.data["text/html"]
    assert 'src="data:image/png;base64,aWJt"' in second.data["text/html"]
    assert "figcaption" not in bare.data["text/html"]
    assert " id=" not in bare.data["text/html"]


def test_a_result_is_shown_from_its_file():
    (figure,) = chapters.shown(runner.papers(ROOT)[0], [printed("Figure 1. One.\n"), picture()])
    html = figure.data["text/html"]
    assert f'src="{runner.papers(ROOT)[0]}/figure_01.png"' in html
    assert f'href="{runner.papers(ROOT)[0]}/figure_01.pdf"' in html


def test_widgets_are_still_pictures():
    output = picture()
    output.data["application/vnd.jupyter.widget-view+json"] = {"model_id": "x"}
    (shown,) = chapters.shown("none", [output])
    assert list(shown.data) == ["text/html"]


# ---------------------------------------------------------------- links


def chapter_of(*children):
    document = new_document("chapter")
    document += children
    return document


def test_numbers_in_the_text_lead_to_what_they_name():
    block = nodes.math_block("", r"\begin{bmatrix} a \\ b \end{bmatrix} \tag{17}")
    both = nodes.math_block("", r"c = d \tag{12, B3}")
    raw = nodes.raw("", '<figure class="result" id="figure-b2"><img></figure>', format="html")
    text = "By (17) and (B3), see figures 9 to B2, not (18), f(17) or Figure B21."
    prose = nodes.paragraph("", "", nodes.Text(text), nodes.literal("", "(17)"))
    document = chapter_of(block, both, raw, prose)
    links.link(None, document)
    assert block["ids"] == ["equation-17"]
    assert both["ids"] == ["equation-12", "equation-b3"]
    assert block.astext().startswith(r"\[\begin{bmatrix}")
    found = [(r.astext(), r["refid"]) for r in prose.findall(nodes.reference)]
    assert found == [("17", "equation-17"), ("B3", "equation-b3"), ("B2", "figure-b2")]
    assert prose.astext() == text + "(17)"


def test_a_number_that_names_nothing_stays_text():
    prose = nodes.paragraph("", "First (1), then (2); Table 3.")
    links.link(None, chapter_of(prose))
    assert not list(prose.findall(nodes.reference))


def test_no_line_begins_with_what_ends_a_formula():
    ends = nodes.math("", "x"), nodes.Text("); then")
    goes_on = nodes.math("", "y"), nodes.Text(" is")
    prose = nodes.paragraph("", "", *ends, *goes_on)
    links.link(None, chapter_of(prose))
    (together,) = prose.findall(nodes.inline)
    assert together["classes"] == ["together"]
    assert together.astext() == "x);"
    assert prose.astext() == "x); theny is"


def test_bars_and_stars_of_a_docstring_are_what_they_look_like():
    lines = ["x|x| of (runs, *S), mu_… or `cell`² and ``a*b``", "*Book*, **bold**, `a`, `b`"]
    links.as_prose(None, "function", "f", None, None, lines)
    assert lines == [
        r"x\|x\| of (runs, \*S), mu\_… or ``cell``\ ² and ``a*b``",
        "*Book*, **bold**, `a`, `b`",
    ]


def test_sentences_are_wrapped_and_columns_are_not():
    words = nodes.literal_block("", "A sentence.\n    its end", classes=["output", "stream"])
    grid = nodes.literal_block("", "a    b\n1.0  2.0", classes=["output", "stream"])
    links.link(None, chapter_of(words, grid))
    assert "wrapped" in words["classes"]
    assert "wrapped" not in grid["classes"]


def test_links_to_sources_and_results_lead_into_the_book():
    text = "[a](../src/seanav/filters/kalman.py) [b](../src/seanav/filters/ins/) [c](x.ipynb)"
    assert chapters.relink(text) == (
        "[a](code/src.seanav.filters.kalman.md) [b](code/src.seanav.filters.ins.md) [c](x.ipynb)"
    )
    report = "[f](4_x/figure_04.png) [t](4_x/table_B2.csv)"
    assert chapters.relink(report, {"4_x.html#figure-4"}) == (
        '<a href="4_x.html#figure-4">f</a> <a href="4_x/table_B2.csv">t</a>'
    )


def test_lines_about_pages_that_are_not_there_are_left_out(tmp_path):
    (tmp_path / "here.md").touch()
    text = "Words.\nhere\nabsent\n- [a](here.md)\n- [b](absent.md): b\n"
    assert build.listing(text, tmp_path) == "Words.\nhere\n- [a](here.md)\n"


# ---------------------------------------------------------------- pages


def test_the_reference_has_the_public_modules_once():
    page = build.reference()
    for name in ("seanav.claims", "seanav.filters.kalman", "seanav.models.earth"):
        assert page.count(f"automodule:: {name}\n") == 1
    for private in ("_files", "runner", "studies", "__main__", "exercises.ito"):
        assert f"seanav.{private}" not in page


def test_pages_need_no_network():
    sources = [*ROOT.glob("book/*.py"), *ROOT.glob("book/*.md"), *ROOT.glob("book/_static/*")]
    for path in sources:
        text = path.read_text(encoding="utf-8")
        assert "http://" not in text, path.name
        text = re.sub(r"\]\(https://[^)]*\)", "", text)  # a link: nothing is asked for by itself
        assert "https://" not in text, path.name


def test_the_bibliography_has_every_doi_that_is_cited():
    doi = re.compile(r"\b10\.\d{4,9}/[^\s\"'<>)\]},;`\\]+")
    known = doi.findall((ROOT / "book" / "references.bib").read_text(encoding="utf-8").lower())
    assert len(known) == len(set(known))
    texts = [*(ROOT / "src").rglob("*.py"), ROOT / "CITATION.cff", ROOT / "README.md"]
    said = {path.name: path.read_text(encoding="utf-8") for path in texts}
    for stem in STEMS:
        cells = runner.notebook(ROOT, stem).cells
        said[stem] = "\n".join(cell.source for cell in cells)
    for place, text in said.items():
        cited = {found.lower().rstrip(".:") for found in doi.findall(text)}
        assert cited <= set(known), place


def test_the_build_says_when_sphinx_fails(monkeypatch, capsys):
    failed = subprocess.CompletedProcess([], 2, stderr="why\n")
    monkeypatch.setattr(build, "build", lambda folder: failed)
    assert build.main() == 2
    assert "why" in capsys.readouterr().err
