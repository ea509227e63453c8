"""Turn stored notebooks into chapters of the book, and into notebooks to hand out."""

import copy
import csv
import re
from base64 import b64encode
from html import escape
from itertools import islice
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


def relink(text: str) -> str:
    """Let links to sources and to the files of results lead to pages of the book."""
    text = SOURCE.sub(lambda found: f"](code/{found[1].replace('/', '.')}.md)", text)
    text = text.replace("](../paper_figures/REPORT.md", "](REPORT.md")
    return re.sub(
        r"\[([^]]*)\]\((\d\w*)/(figure|table)_(\w+)\.(?:png|csv)\)",
        lambda found: f'<a href="{found[2]}.html#{anchor(found[3], found[4])}">{found[1]}</a>',
        text,
    )


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
    below = f"<figcaption>{escape(caption)}{file}</figcaption>" if caption else ""
    return f'<figure class="result"{place}>{picture}{below}</figure>'


def columns(head: str) -> list[int]:
    """Return where the columns of a printed table begin."""
    return [found.start() for found in re.finditer(r"\S+(?: \S+)*", head)]


def table(stem: str, caption: str, lines: list[str]) -> tuple[str, int]:
    """Return a printed table as HTML, and how many of the lines it took."""
    number = line[1] if (line := TABLE.fullmatch(caption)) else ""
    path = saved(stem, "table", number).with_suffix(".csv")
    if not number:
        path = path.with_name("parameters.csv")
    starts = columns(lines[0])
    cut = [slice(a, b) for a, b in zip([0, *starts[1:]], [*starts[1:], None], strict=True)]
    rows = []
    for text in lines:
        # What is not a row has letters where the columns are parted.
        if not text.strip() or any(text[k - 2 : k].strip() for k in starts[1:]):
            break
        rows.append([text[k].strip() for k in cut])
    if path.exists():
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(islice(rows, sum(1 for _ in csv.reader(file))))
    taken = f' <a class="file" href="{stem}/{path.name}" download>CSV</a>' if path.exists() else ""
    body = "".join(f"<tr>{''.join(map(entry, row))}</tr>" for row in rows[1:])
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in rows[0])
    grid = (
        '<div class="table-wrapper" tabindex="0"><table class="docutils">'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )
    if len(rows) - 1 > LONG:
        grid = f"<details><summary>{len(rows) - 1} rows</summary>{grid}</details>"
    place = f' id="{anchor("table", number)}"' if number else ' id="parameters"'
    above = f"<figcaption>{escape(caption)}{taken}</figcaption>"
    return f'<figure class="result"{place}>{above}{grid}</figure>', len(rows)


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
                title = bool(TABLE.fullmatch(lines[0])) and len(lines) > 1
                if title or ORIGINS.fullmatch(lines[0]):
                    caption = lines.pop(0) if title else "Where each parameter comes from."
                    grid, used = table(stem, caption, lines)
                    found += [*text_of(said), html(grid)]
                    lines, said = lines[used:], []
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


def chapter(stem: str) -> nbformat.NotebookNode:
    """Return a notebook as a chapter: solutions folded, pictures with words, downloads."""
    book = runner.notebook(ROOT, stem)
    for key in set(book.metadata) - {"kernelspec", "language_info"}:
        del book.metadata[key]  # widgets, should there be any: they would be fetched
    for exercise in stated(book.cells):
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
    book.cells[0].source = f"# {title(stem)}\n\n{downloads(book, stem)}\n{rest}"
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


def downloads(book: nbformat.NotebookNode, stem: str) -> str:
    """Return the line below the title of a chapter."""
    links = [link(f"downloads/{stem}.ipynb", "the notebook")]
    if stated(book.cells):
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
