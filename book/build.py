"""Render the notebooks and the report of claims as web pages in build/book/."""

from pathlib import Path

import nbformat
from nbconvert import HTMLExporter

from seanav.runner import papers

ROOT = Path(__file__).resolve().parents[1]


def chapter(book: nbformat.NotebookNode) -> str:
    """Return a notebook as a page of HTML, its solutions folded."""
    # "Folded" replaces "hidden by the front end", which a page could not unfold.
    for cell in book.cells:
        cell.metadata.get("jupyter", {}).pop("source_hidden", None)
    folders = [str(ROOT / "book")]
    exporter = HTMLExporter(template_name="folded", extra_template_basedirs=folders)
    return exporter.from_notebook_node(book)[0]


def main() -> None:
    """Write one page per notebook, one for the report, and an index."""
    pages = ROOT / "build" / "book"
    pages.mkdir(parents=True, exist_ok=True)
    names = papers(ROOT)
    for path in [ROOT / "notebooks" / f"{name}.ipynb" for name in names]:
        (pages / f"{path.stem}.html").write_text(
            chapter(nbformat.read(path, as_version=4)), encoding="utf-8"
        )
    report, contents = ROOT / "paper_figures" / "REPORT.md", "# seanav\n\n"
    if report.exists():
        names.append("REPORT")
        text = nbformat.v4.new_markdown_cell(report.read_text(encoding="utf-8"))
        page = chapter(nbformat.v4.new_notebook(cells=[text], metadata={"title": "Claims"}))
        (pages / "REPORT.html").write_text(page, encoding="utf-8")
    contents += "\n".join(f"- [{name}]({name}.html)" for name in names)
    index = nbformat.v4.new_notebook(
        cells=[nbformat.v4.new_markdown_cell(contents)], metadata={"title": "seanav"}
    )
    (pages / "index.html").write_text(chapter(index), encoding="utf-8")
    print(f"{len(names)} pages and index.html in {pages.relative_to(ROOT)}/")


if __name__ == "__main__":
    main()
