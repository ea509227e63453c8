"""Chapters of the book, as Sphinx is given them."""

import importlib.util
from pathlib import Path

import pytest

from seanav import runner

ROOT = Path(__file__).resolve().parents[1]
_spec = importlib.util.spec_from_file_location("build_book", ROOT / "book" / "build.py")
build = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(build)


@pytest.mark.parametrize("stem", runner.papers(ROOT))
def test_every_picture_has_words_and_every_solution_is_folded(stem):
    pictures = solutions = 0
    for cell in build.chapter(stem).cells:
        shown = [o for o in cell.get("outputs", []) if "image/png" in o.get("data", {})]
        pictures += len(shown)
        if shown:
            assert len(cell.metadata["mystnb"]["image"]["alt"]) > 10
        if "solution" in cell.metadata.get("tags", []):
            solutions += 1
            assert "hide-cell" in cell.metadata.tags
            assert cell.metadata["mystnb"]["code_prompt_show"] == "Solution"
    assert pictures >= 8
    assert solutions >= 3


@pytest.mark.parametrize("stem", runner.papers(ROOT))
def test_the_last_lines_of_a_chapter_hand_out_its_files(stem):
    text = build.chapter(stem).cells[-1].source
    for path in (ROOT / "paper_figures" / stem).glob("figure_*.pdf"):
        assert f"]({stem}/{path.name})" in text


def test_the_reference_has_the_public_modules_once():
    page = build.reference()
    for name in ("seanav.claims", "seanav.filters.kalman", "seanav.models.earth"):
        assert page.count(f"{{automodule}} {name}\n") == 1
    for private in ("_files", "runner", "studies", "__main__"):
        assert f"seanav.{private}" not in page


def test_pages_need_no_network():
    sources = [*ROOT.glob("book/*.py"), *ROOT.glob("book/*.md"), *ROOT.glob("book/_static/*")]
    for path in sources:
        text = path.read_text(encoding="utf-8")
        assert "http://" not in text, path.name
        assert "https://" not in text, path.name
