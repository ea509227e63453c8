"""Build the book, `build/book/`, from the stored notebooks, the report and the pages here."""

import importlib.util
import pkgutil
import re
import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
from chapters import ROOT, SOURCE, chapter, exercises, handout, relink

import seanav
from seanav import runner

HERE = Path(__file__).parent
LAID, PAGES = ROOT / "build" / "book-source", ROOT / "build" / "book"
PRIVATE = ("__main__", "_", "runner", "environment")
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
    blocks = [f"## {name}\n\n```{{automodule}} {name}\n:members:\n```\n" for name in names]
    return "# The functions\n\n" + "\n".join(blocks)


def listing(text: str) -> str:
    """Return the front page, its lists without the pages that are not there."""
    there = [line for line in text.splitlines() if not re.fullmatch(r"\w+", line) or known(line)]
    return "\n".join(there) + "\n"


def known(name: str) -> bool:
    """Return whether there is a page of this name."""
    return any((LAID / f"{name}{suffix}").exists() for suffix in (".md", ".ipynb"))


def lay_out() -> None:
    """Write the sources that Sphinx reads."""
    shutil.rmtree(LAID, ignore_errors=True)
    ignored = shutil.ignore_patterns("build.py", "chapters.py", "__pycache__")
    shutil.copytree(HERE, LAID, ignore=ignored)
    files = LAID / "files"  # copied as they are
    (files / "downloads").mkdir(parents=True)
    for stem in stems():
        nbformat.write(chapter(stem), LAID / f"{stem}.ipynb")
        shutil.copy(ROOT / "notebooks" / f"{stem}.ipynb", files / "downloads")
        nbformat.write(handout(stem), files / "downloads" / f"{stem}_handout.ipynb")
        if (ROOT / "paper_figures" / stem).exists():
            shutil.copytree(ROOT / "paper_figures" / stem, files / stem)
    for name in ("claims.png", "REPORT.md"):
        if (ROOT / "paper_figures" / name).exists():
            shutil.copy(ROOT / "paper_figures" / name, LAID)
    (LAID / "api.md").write_text(reference(), encoding="utf-8")
    sources = set()
    for page in [*HERE.glob("*.md"), *(ROOT / "notebooks" / f"{stem}.ipynb" for stem in stems())]:
        sources |= {found[1] for found in SOURCE.finditer(page.read_text(encoding="utf-8"))}
    for page in LAID.glob("*.md"):
        text = relink(page.read_text(encoding="utf-8"))
        page.write_text(text.replace("<!-- exercises -->\n", exercises(stems())), "utf-8")
    (LAID / "code").mkdir()
    for source in sources:
        name = source.replace("/", ".")
        shutil.copy(ROOT / f"{source}.py", LAID / "code" / f"{name}.py")
        text = f"---\norphan: true\n---\n\n# {source}.py\n\n"
        text += f"```{{literalinclude}} {name}.py\n:language: python\n:lineno-match:\n```\n"
        (LAID / "code" / f"{name}.md").write_text(text, encoding="utf-8")
    front = LAID / "index.md"
    front.write_text(listing(front.read_text(encoding="utf-8")), encoding="utf-8")
    # From a package: nothing is fetched when a page is read.
    mathjax = Path(importlib.util.find_spec("mathjax").origin).parent / "static/mathjax/es5"
    target = LAID / "_static" / "mathjax"
    shutil.copytree(mathjax / "input", target / "input")
    shutil.copy(mathjax / "tex-svg.js", target)


def main() -> int:
    """Lay out the sources and call Sphinx; return its exit status."""
    lay_out()
    shutil.rmtree(PAGES, ignore_errors=True)
    command = [sys.executable, "-m", "sphinx", "-q", "-j", "2", "-b", "html"]
    command += ["-d", str(PAGES.with_name("book-doctrees")), "-E", str(LAID), str(PAGES)]
    done = subprocess.run(command, check=False)
    print(f"{len(list(PAGES.glob('*.html')))} pages in {PAGES.relative_to(ROOT)}/")
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
