"""Turn stored notebooks into chapters of the book, and into notebooks to hand out."""

import copy
import csv
import re
from base64 import b64encode
from collections.abc import Container
from html import escape
from pathlib import Path

import nbformat
from nbformat.v4 import new_markdown_cell, new_output

from seanav import runner
from seanav.exercises import stated

ROOT = Path(__file__).resolve().parents[1]
FIGURE = re.compile(r"Figure (\w+)\. (.+)")
TABLE = re.compile(r"Table (\w+)\. (.+)")
ORIGINS = re.compile(r"name {2,}value {2,}unit {2,}origin")
SOURCE = re.compile(r"\]\((?:\.\./)+((?:src|tests|benchmarks)/[\w/]*\w)(?:\.py|/)?(?:#\w+)?\)")
LONG = 30  # rows, from which on a table is folded

# ---------------------------------------------------------------- names and places


def anchor(kind: str, number: str) -> str:
    """Return the place of a figure or a table in its chapter, such as ``figure-4``."""
    return f"{kind}-{number.lstrip('0') or '0'}".lower()


def saved(stem: str, kind: str, number: str) -> Path:
    """Return the committed file of a figure or a table, without its suffix."""
    label = f"{int(number):02d}" if kind == "figure" and number.isdigit() else number
    return ROOT / "paper_figures" / stem / f"{kind}_{label}"


def relink(text: str, places: Container[str] = ()) -> str:
    """Let links to sources and to results lead to pages of the book.

    A result is looked for among `places`, such as ``"4_imm_sea_current.html#figure-4"``.
    """

    def result(found):
        words, stem, kind, number, suffix = found.groups()
        place = f"{stem}.html#{anchor(kind, number)}"
        if place not in places:
            place = f"{stem}/{kind}_{number}.{suffix}"
        return f'<a href="{place}">{words}</a>'

    text = SOURCE.sub(lambda found: f"](code/{found[1].replace('/', '.')}.md)", text)
    text = text.replace("](../paper_figures/REPORT.md", "](REPORT.md")
    return re.sub(r"\[([^]]*)\]\((\d\w*)/(figure|table)_(\w+)\.(png|csv)\)", result, text)


# ---------------------------------------------------------------- what cells show


def streams(outputs: list) -> list:
    """Return `outputs` with neighbouring texts in one, as they were printed."""
    merged: list = []
    for output in outputs:
        if merged and output.get("name") and output.get("name") == merged[-1].get("name"):
            merged[-1].text += output.text
        else:
            merged.append(copy.deepcopy(output))
    return merged


def html(text: str) -> nbformat.NotebookNode:
    """Return an output that is shown as HTML."""
    return new_output("display_data", data={"text/html": text})


def figure(stem: str, caption: str, output: nbformat.NotebookNode) -> str:
    """Return a picture with its caption and, of a result, its file to take along."""
    about = output.get("metadata", {}).get("image/png", {})
    words, source, place, file = caption or about.get("alt", ""), "", "", ""
    if line := FIGURE.fullmatch(caption):
        path = saved(stem, "figure", line[1])
        place = f' id="{anchor("figure", line[1])}"'
        words = about.get("alt") or line[2]
        if path.with_suffix(".png").exists():
            source = f"{stem}/{path.name}.png"  # twice as fine as the one in the notebook
            file = f' <a class="file" href="{stem}/{path.name}.pdf" download>PDF</a>'
    if not source:
        data = output.data["image/png"]
        text = data if isinstance(data, str) else b64encode(data).decode()
        source = "data:image/png;base64," + "".join(text.split())
    width = f' width="{about["width"]}"' if "width" in about else ""
    picture = f'<img src="{source}"{width} alt="{escape(words)}">'
    if file:
        picture = f'<a href="{source}">{picture}</a>'
    below = f"<figcaption>{escape(caption)}{file}</figcaption>" if caption else ""
    return f'<figure class="result"{place}>{picture}{below}</figure>'


def rows_of(lines: list[str], most: int | None = None) -> tuple[list[list[str]], int]:
    """Return the rows of the table that `lines` begin with, if any, and how many lines it has.

    A line without a first entry goes on with the row above it: its long entries are folded.
    """
    starts = [k for found in re.finditer(r"\S+(?: \S+)*", lines[0]) if (k := found.start())]
    cut = [slice(a, b) for a, b in zip([0, *starts], [*starts, None], strict=True)]
    rows: list = []
    count = 0
    for text in lines[:most]:
        # What is not a row has letters where the columns are parted.
        if not text.strip() or any(text[k - 2 : k].strip() for k in starts):
            break
        row = [text[k].strip() for k in cut]
        if rows and not row[0]:
            rows[-1] = [" ".join(filter(None, pair)) for pair in zip(rows[-1], row, strict=True)]
        else:
            rows.append(row)
        count += 1
    return (rows, count) if starts and len(rows) > 1 else ([], 0)


def grid(rows: list[list[str]]) -> str:
    """Return rows, the first with the headings, as a table that scrolls; a long one folded."""
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in rows[0])
    body = "".join(f"<tr>{''.join(map(entry, row))}</tr>" for row in rows[1:])
    text = (
        '<div class="table-wrapper" tabindex="0"><table class="docutils">'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )
    if len(rows) - 1 > LONG:
        text = f"<details><summary>{len(rows) - 1} rows</summary>{text}</details>"
    return text


def table(stem: str, caption: str, lines: list[str]) -> str:
    """Return what is printed below a caption as HTML, and take it from `lines`.

    There may be several tables below each other, as parts of the one that was saved, or none.
    """
    number = found[1] if (found := TABLE.fullmatch(caption)) else ""
    path = saved(stem, "table", number).with_suffix(".csv")
    if not number:
        path = path.with_name("parameters.csv")
    most, file = None, ""
    if path.exists():
        if number:  # the parameters are folded: they have more lines than rows
            with path.open(encoding="utf-8", newline="") as text:
                most = sum(1 for _ in csv.reader(text))
        file = f' <a class="file" href="{stem}/{path.name}" download>CSV</a>'
    grids = []
    while lines and (found := rows_of(lines, most))[0]:
        grids.append(grid(found[0]))
        del lines[: found[1]]
        if lines[1:] and not lines[0].strip() and rows_of(lines[1:], most)[0]:
            del lines[0]
    place = anchor("table", number) if number else "parameters"
    above = f"<figcaption>{escape(caption)}{file}</figcaption>"
    return f'<figure class="result" id="{place}">{above}{"".join(grids)}</figure>'


def entry(text: str) -> str:
    """Return a cell of a table; numbers stand at its right."""
    number = re.fullmatch(r"[-−+]?[\d.,]+(?:e[-+]?\d+)?(?: ?%)?|nan|-?inf", text)
    return f"<td{' class=number' if number else ''}>{escape(text)}</td>"


def shown(stem: str, outputs: list) -> list:
    """Return what a cell shows: tables as tables, each picture above its caption."""
    found: list = []
    for output in streams(outputs):
        if output.get("name") == "stdout":
            lines, said = output.text.splitlines(), []
            while lines:
                title = bool(TABLE.fullmatch(lines[0]))
                if title or ORIGINS.fullmatch(lines[0]):
                    caption = lines.pop(0) if title else "Where each parameter comes from."
                    found += [*text_of(said), html(table(stem, caption, lines))]
                    said = []
                else:
                    said.append(lines.pop(0))
            found += text_of(said)
        elif "image/png" in output.get("data", {}):
            caption = ""
            if found and found[-1].output_type == "stream":
                *before, last = found[-1].text.splitlines()
                if FIGURE.fullmatch(last):
                    caption, found[-1:] = last, text_of(before)
            found.append(html(figure(stem, caption, output)))
        else:
            output.get("data", {}).pop("application/vnd.jupyter.widget-view+json", None)
            found.append(output)
    return found


def text_of(lines: list[str]) -> list:
    """Return printed lines as an output, or nothing where there are none."""
    text = "\n".join(lines)
    return [new_output("stream", name="stdout", text=text + "\n")] if text.strip() else []


# ---------------------------------------------------------------- chapters


def shown_in(stem: str, book: nbformat.NotebookNode) -> set[str]:
    """Return the places of the figures and tables of a chapter."""
    outputs = [output for cell in book.cells for output in cell.get("outputs", [])]
    text = "".join(output.get("data", {}).get("text/html", "") for output in outputs)
    return {f"{stem}.html#{name}" for name in re.findall(r'<figure[^>]* id="([^"]*)"', text)}


def chapter(stem: str) -> nbformat.NotebookNode:
    """Return a notebook as a chapter: solutions folded, pictures with words, downloads."""
    book = runner.notebook(ROOT, stem)
    for key in set(book.metadata) - {"kernelspec", "language_info"}:
        del book.metadata[key]  # widgets, should there be any: they would be fetched
    asked = stated(book.cells)
    for exercise in asked:
        exercise.solution.metadata.number = exercise.number
    for cell in book.cells:
        tags = cell.metadata.get("tags", [])
        number = cell.metadata.get("number", "")
        cell.metadata = nbformat.from_dict({"tags": tags})
        if "solution" in tags:
            cell.metadata.tags = [*tags, "hide-cell"]
            words = f"Solution {number}".strip()
            cell.metadata.mystnb = {"code_prompt_show": words, "code_prompt_hide": words}
        if "hide-output" in tags:
            words = "All figures of this part"
            cell.metadata.mystnb = {"code_prompt_show": words, "code_prompt_hide": words}
        if cell.cell_type == "code":
            cell.outputs = shown(stem, cell.outputs)
        else:
            cell.source = relink(
                re.sub(r"^(### Exercise (\d+\.\d+) )", r"(exercise-\2)=\n\1", cell.source)
            )
    _, _, rest = book.cells[0].source.partition("\n")
    book.cells[0].source = f"# {title(stem)}\n\n{downloads(stem, handed=bool(asked))}\n{rest}"
    folder = ROOT / "paper_figures" / stem
    files = sorted(folder.glob("figure_*.pdf")) + sorted(folder.glob("*.csv"))
    if files:
        links = [link(f"{stem}/{path.name}", path.stem.replace("_", " ")) for path in files]
        text = f'## Files to take along\n\n<p class="files">{", ".join(links)}</p>'
        book.cells.append(new_markdown_cell(text))
    return book


def title(stem: str) -> str:
    """Return what a chapter is called: it says which paper it is about."""
    number = stem.partition("_")[0]
    name = runner.notebook(ROOT, stem).cells[0].source.partition("\n")[0].lstrip("# ")
    return f"Paper {number}: {name}" if int(number) else name


def link(target: str, words: str) -> str:
    """Return a link to a file that is saved, not shown."""
    return f'<a href="{target}" download>{escape(words)}</a>'


def downloads(stem: str, handed: bool) -> str:
    """Return the line below the title of a chapter."""
    links = [link(f"downloads/{stem}.ipynb", "the notebook")]
    if handed:
        links.append(link(f"downloads/{stem}_handout.ipynb", "without solutions"))
    return f'<p class="files">Download: {", ".join(links)}</p>\n'


def handout(stem: str) -> nbformat.NotebookNode:
    """Return a notebook in which the solutions are empty cells that end with the check."""
    book = runner.notebook(ROOT, stem)
    for exercise in stated(book.cells):
        exercise.solution.source = (
            f'# Your work\nanswer = None\n\ncheck("{exercise.number}", answer)'
        )
        exercise.solution.metadata = nbformat.from_dict({"tags": ["exercise"]})
        exercise.solution.outputs, exercise.solution.execution_count = [], None
    return book


def exercises(stems: list[str]) -> str:
    """Return the table of all exercises, the easy and short ones first."""
    found = []
    for stem in stems:
        cells = runner.notebook(ROOT, stem).cells
        found += [(e.stars, e.minutes, stem, e) for e in stated(cells)]
    rows = ["| difficulty | minutes | exercise | chapter |", "|---|---|---|---|"]
    for stars, minutes, stem, e in sorted(found, key=lambda row: row[:3]):
        exercise = f"[{e.number}](#exercise-{e.number}) {e.title[:1].upper()}{e.title[1:]}"
        where = title(stem).partition(":")[0]
        rows.append(f"| {stars} | {minutes} | {exercise} | [{where}]({stem}.ipynb) |")
    return "\n".join(rows) + "\n" if found else "There are none yet.\n"
