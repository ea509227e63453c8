"""Build the book, `build/book/`, from the stored notebooks, the report and the pages here."""

import importlib.util
import pkgutil
import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
from nbformat.v4 import new_markdown_cell

import seanav
from seanav.runner import papers

ROOT = Path(__file__).resolve().parents[1]
SOURCE, PAGES = ROOT / "build" / "book-source", ROOT / "build" / "book"
PRIVATE = ("__main__", "_", "runner", "environment")


def chapter(stem: str) -> nbformat.NotebookNode:
    """Return a notebook as a chapter: solutions folded, pictures with words, downloads."""
    book = nbformat.read(ROOT / "notebooks" / f"{stem}.ipynb", as_version=4)
    for cell in book.cells:
        tags = cell.metadata.get("tags", [])
        cell.metadata = nbformat.from_dict({"tags": tags})
        if "solution" in tags:
            cell.metadata.tags = [*tags, "hide-cell"]
            cell.metadata.mystnb = {"code_prompt_show": "Solution", "code_prompt_hide": "Solution"}
        captions = [
            output.metadata["image/png"]["alt"]
            for output in cell.get("outputs", [])
            if "alt" in output.get("metadata", {}).get("image/png", {})
        ]
        if captions:
            cell.metadata.setdefault("mystnb", {})["image"] = {"alt": " ".join(captions)}
    folder = ROOT / "paper_figures" / stem
    files = sorted(folder.glob("figure_*.pdf")) + sorted(folder.glob("table_*.csv"))
    links = [f"[{path.stem.replace('_', ' ')}]({stem}/{path.name})" for path in files]
    text = f"**Downloads.** [This notebook](downloads/{stem}.ipynb); " + ", ".join(links) + "."
    book.cells.append(new_markdown_cell(text))
    return book


def reference() -> str:
    """Return the page of the public modules."""
    names = [
        module.name
        for module in pkgutil.walk_packages(seanav.__path__, "seanav.")
        if not any(part.startswith(PRIVATE) for part in module.name.split(".")[1:])
        and ".studies" not in module.name
    ]
    blocks = [f"## {name}\n\n```{{automodule}} {name}\n:members:\n```\n" for name in names]
    return "# The functions\n\n" + "\n".join(blocks)


def lay_out() -> None:
    """Write the sources that Sphinx reads."""
    shutil.rmtree(SOURCE, ignore_errors=True)
    ignored = shutil.ignore_patterns("build.py", "__pycache__")
    shutil.copytree(Path(__file__).parent, SOURCE, ignore=ignored)
    for stem in papers(ROOT):
        nbformat.write(chapter(stem), SOURCE / f"{stem}.ipynb")
        shutil.copytree(ROOT / "paper_figures" / stem, SOURCE / stem)
        (SOURCE / "downloads").mkdir(exist_ok=True)
        shutil.copy(ROOT / "notebooks" / f"{stem}.ipynb", SOURCE / "downloads")
    for name in ("claims.png", "REPORT.md"):
        if (ROOT / "paper_figures" / name).exists():
            shutil.copy(ROOT / "paper_figures" / name, SOURCE)
    (SOURCE / "api.md").write_text(reference(), encoding="utf-8")
    # From a package: nothing is fetched when a page is read.
    mathjax = Path(importlib.util.find_spec("mathjax").origin).parent / "static/mathjax/es5"
    target = SOURCE / "_static" / "mathjax"
    shutil.copytree(mathjax / "input", target / "input")
    shutil.copy(mathjax / "tex-svg.js", target)


def main() -> int:
    """Lay out the sources and call Sphinx; return its exit status."""
    lay_out()
    shutil.rmtree(PAGES, ignore_errors=True)
    command = [sys.executable, "-m", "sphinx", "-q", "-b", "html", str(SOURCE), str(PAGES)]
    done = subprocess.run(command, check=False)
    print(f"{len(list(PAGES.glob('*.html')))} pages in {PAGES.relative_to(ROOT)}/")
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
