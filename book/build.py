"""Build the book, `build/book/`, from the stored notebooks, the report and the pages here."""

import importlib.util
import pkgutil
import re
import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
from chapters import ROOT, SOURCE, chapter, exercises, handout, relink, shown_in

import seanav
from seanav import runner

HERE = Path(__file__).parent
PRIVATE = ("__main__", "_", "runner", "environment", "exercises")
HIDDEN = (".studies", ".exercises.")  # rooms of the papers; the right answers


def stems() -> list[str]:
    """Return the notebooks of the book, lessons first."""
    return [*runner.lessons(ROOT), *runner.papers(ROOT)]


def reference() -> str:
    """Return the page of the public modules."""
    names = [
        module.name
        for module in pkgutil.walk_packages(seanav.__path__, "seanav.")
        if not any(part.startswith(PRIVATE) for part in module.name.split(".")[1:])
        and not any(part in module.name for part in HIDDEN)
    ]
    # Docstrings are reStructuredText, the pages are Markdown. What a package hands on is
    # described where it is defined.
    block = "## {0}\n\n```{{eval-rst}}\n.. automodule:: {0}\n   :members:\n"
    block += "   :ignore-module-all:\n```\n"
    return "# The functions\n\n" + "\n".join(block.format(name) for name in names)


def listing(text: str, folder: Path) -> str:
    """Return `text` without the lines that name pages which are not in `folder`."""
    pages = {page.stem for page in folder.iterdir()}
    kept = []
    for line in text.splitlines():
        names = re.findall(r"\]\((\w+)\.(?:md|ipynb)\)", line)
        names += re.findall(r"^\w+$", line)
        if pages.issuperset(names):
            kept.append(line)
    return "\n".join(kept) + "\n"


def lay_out(laid: Path) -> None:
    """Write the sources that Sphinx reads into the folder `laid`."""
    shutil.rmtree(laid, ignore_errors=True)
    ignored = shutil.ignore_patterns("build.py", "chapters.py", "__pycache__")
    shutil.copytree(HERE, laid, ignore=ignored)
    files = laid / "files"  # copied as they are
    (files / "downloads").mkdir(parents=True)
    shown: set[str] = set()
    for stem in stems():
        book = chapter(stem)
        shown |= shown_in(stem, book)
        nbformat.write(book, laid / f"{stem}.ipynb")
        shutil.copy(ROOT / "notebooks" / f"{stem}.ipynb", files / "downloads")
        nbformat.write(handout(stem), files / "downloads" / f"{stem}_handout.ipynb")
        if (ROOT / "paper_figures" / stem).exists():
            shutil.copytree(ROOT / "paper_figures" / stem, files / stem)
    for name in ("paper_figures/claims.png", "paper_figures/REPORT.md"):
        if (ROOT / name).exists():
            shutil.copy(ROOT / name, laid)
    for path in (ROOT / "benchmarks").glob("[A-Z]*"):  # tables that pages include
        shutil.copy(path, files)
    (laid / "api.md").write_text(reference(), encoding="utf-8")
    for page in laid.glob("*.md"):
        text = relink(page.read_text(encoding="utf-8"), shown)
        text = text.replace("<!-- exercises -->\n", exercises(stems()))
        if (HERE / page.name).exists():
            text = listing(text, laid)
        page.write_text(text, encoding="utf-8")
    (laid / "code").mkdir()
    pages = [*HERE.glob("*.md"), *(ROOT / "notebooks" / f"{stem}.ipynb" for stem in stems())]
    for source in {s for page in pages for s in SOURCE.findall(page.read_text(encoding="utf-8"))}:
        show(source, laid / "code")
    # From a package: nothing is fetched when a page is read.
    mathjax = Path(importlib.util.find_spec("mathjax").origin).parent / "static/mathjax/es5"
    target = laid / "_static" / "mathjax"
    shutil.copytree(mathjax / "input", target / "input")
    shutil.copy(mathjax / "tex-svg.js", target)


def show(source: str, folder: Path) -> None:
    """Write the page of a source file that some chapter links to."""
    name, file = source.replace("/", "."), ROOT / f"{source}.py"
    shutil.copy(file if file.exists() else ROOT / source / "__init__.py", folder / f"{name}.py")
    text = f"---\norphan: true\n---\n\n# {source}\n\n"
    text += f"```{{literalinclude}} {name}.py\n:language: python\n:lineno-match:\n```\n"
    (folder / f"{name}.md").write_text(text, encoding="utf-8")


def build(folder: Path) -> subprocess.CompletedProcess:
    """Build the book in `folder`: the pages lie in its folder `book`."""
    laid, pages = folder / "book-source", folder / "book"
    lay_out(laid)
    shutil.rmtree(pages, ignore_errors=True)
    command = [sys.executable, "-m", "sphinx", "-q", "-j", "2", "-b", "html", "-E"]
    command += ["-d", str(folder / "book-doctrees"), str(laid), str(pages)]
    return subprocess.run(command, check=False, stderr=subprocess.PIPE, encoding="utf-8")


def main() -> int:
    """Build the book; return the exit status of Sphinx."""
    done = build(ROOT / "build")
    print(done.stderr, end="", file=sys.stderr)
    print(f"{len(list((ROOT / 'build/book').glob('*.html')))} pages in build/book/")
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
