"""The book as a reader sees it: its pages, opened from disk in a browser without a network."""

import importlib.util
import re
import shutil
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from seanav import runner

ROOT = Path(__file__).resolve().parents[1]
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "chrome"))), "")
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"]
ARGUMENTS += ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
WIDTHS = (1280, 390)
# Everything is unfolded first. Code may hold TeX, and does; what is read with the ears, too.
FACTS = r"""
async () => {
  if (window.MathJax) await MathJax.startup.promise;
  for (const fold of document.querySelectorAll("details")) fold.open = true;
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const raw = [];
  while (walker.nextNode()) {
    const text = walker.currentNode.data;
    if (/\\frac|\\begin\{|\$\$|\\\(|\\\[/.test(text)
        && !walker.currentNode.parentElement.closest("pre, code, script, style, title"))
      raw.push(text.slice(0, 80));
  }
  const formulas = [...document.querySelectorAll(".math")];
  const root = document.documentElement;
  return {
    raw: raw,
    bare: formulas.filter(f => !f.querySelector("mjx-container")).length,
    wrong: [...document.querySelectorAll("[data-mjx-error]")].map(
      e => e.dataset.mjxError + ": " + e.closest("p, td, div").textContent.slice(0, 80)),
    formulas: formulas.length,
    scroll: Math.max(root.scrollWidth, document.body.scrollWidth) - root.clientWidth,
    images: [...document.images].map(i => [i.alt, i.naturalWidth]),
  };
}
"""


@pytest.fixture(scope="session")
def pages(tmp_path_factory):
    """Build the book once; every warning of Sphinx is an error here."""
    sys.path.insert(0, str(ROOT / "book"))
    spec = importlib.util.spec_from_file_location("build_pages", ROOT / "book" / "build.py")
    build = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(build)
    folder = tmp_path_factory.mktemp("book")
    done = build.build(folder)
    assert done.stderr == ""
    assert done.returncode == 0
    return folder / "book"


@pytest.fixture(scope="session")
def browser():
    if not CHROMIUM:
        pytest.skip("there is no Chromium here: the book's pages are not looked at")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)


def opened(browser, width):
    """Return a page of this width and the list of what it complains about or asks for."""
    page, said = browser.new_page(viewport={"width": width, "height": 1000}), []
    page.on("console", lambda line: said.append(line.text) if line.type == "error" else None)
    page.on("pageerror", lambda error: said.append(str(error)))
    local = ("file:", "data:", "blob:")
    page.on("request", lambda r: None if r.url.startswith(local) else said.append(r.url))
    return page, said


@pytest.fixture(scope="session")
def facts(browser, pages):
    """Open every page at both widths; return what was found, by page and width."""
    found = {}
    for width in WIDTHS:
        page, said = opened(browser, width)
        listings = sorted(pages.glob("code/*.html"))[:2]  # alike, and without formulas
        for path in [*pages.glob("*.html"), *listings]:
            page.goto(path.as_uri())
            found[path.stem, width] = page.evaluate(FACTS) | {"said": said[:]}
            said.clear()
        page.close()
    return found


def test_formulas_are_typeset(facts):
    for place, fact in facts.items():
        assert fact["raw"] == [], place
        assert (fact["bare"], fact["wrong"]) == (0, []), place
    for stem in runner.papers(ROOT):
        assert facts[stem, 390]["formulas"] > 20, stem


def test_no_page_complains_or_asks_for_anything_elsewhere(facts):
    assert {place: fact["said"] for place, fact in facts.items() if fact["said"]} == {}


def test_no_page_scrolls_sideways(facts):
    assert {place: fact["scroll"] for place, fact in facts.items() if fact["scroll"] > 0} == {}


def test_every_picture_is_there_and_has_words(facts):
    for place, fact in facts.items():
        for words, width in fact["images"]:
            assert len(words) > 10, place
            assert width > 0, (place, words)
    for stem in runner.papers(ROOT):
        assert len(facts[stem, 1280]["images"]) >= 8, stem


def test_search_finds_the_innovation(browser, pages):
    page, said = opened(browser, 1280)
    page.goto(f"{(pages / 'search.html').as_uri()}?q=innovation")
    page.wait_for_selector("ul.search li a")
    hits = page.eval_on_selector_all("ul.search li a", "links => links.map(a => a.href)")
    assert any(Path(urlsplit(hit).path).stem in runner.papers(ROOT) for hit in hits)
    assert said == []
    page.close()


def test_solutions_unfold_and_the_light_goes_out(browser, pages):
    page, _ = opened(browser, 390)
    for stem in runner.papers(ROOT):
        page.goto((pages / f"{stem}.html").as_uri(), wait_until="domcontentloaded")
        folds = page.locator(".tag_solution details")
        assert folds.count() >= 3
        inside = folds.first.locator("pre").first
        assert not inside.is_visible()
        folds.first.locator("summary").click()
        assert inside.is_visible()
    color = "getComputedStyle(document.body).backgroundColor"
    light = page.evaluate(color)
    page.emulate_media(color_scheme="dark")
    assert page.evaluate(color) != light
    page.close()


class Links(HTMLParser):
    """The places of a page and where its links lead."""

    def __init__(self, path):
        super().__init__()
        self.places, self.links = set(), set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        named = dict(attrs)
        self.places |= {named.get("id"), named.get("name")}
        self.links |= {named[key] for key in ("href", "src") if named.get(key)}


def test_links_inside_the_book_lead_somewhere(pages):
    read = {path.resolve(): Links(path) for path in pages.rglob("*.html")}
    lost = set()
    for path, page in read.items():
        for link in page.links:
            url = urlsplit(link)
            if url.scheme in ("http", "https", "data", "mailto"):
                continue
            target = (path.parent / unquote(url.path)).resolve() if url.path else path
            places = read[target].places if target in read else {unquote(url.fragment)}
            if not target.is_file() or (url.fragment and unquote(url.fragment) not in places):
                lost.add((path.name, link))
    assert lost == set()


def test_every_chapter_hands_out_its_notebook_its_neighbours_and_its_files(pages):
    for stem in runner.papers(ROOT):
        text = (pages / f"{stem}.html").read_text(encoding="utf-8")
        assert f'href="downloads/{stem}.ipynb"' in text
        assert re.search(r'class="next-page"', text)
        assert re.search(r'class="prev-page"', text)
        for path in (ROOT / "paper_figures" / stem).iterdir():
            if path.suffix == ".pdf" or path.stem.startswith("table_"):
                assert f'href="{stem}/{path.name}"' in text
                assert (pages / stem / path.name).read_bytes() == path.read_bytes()
