"""REPORT.md, its picture, and the README's table, made from claims as they are stored."""

import io

import PIL.Image
import pytest
from tiny import save

from seanav.claims import VERDICTS, Claim, Condition, judged
from seanav.estimates import Estimate
from seanav.runner import summary
from seanav.runner.summary import BEGIN, CELL, END


def between(low, high):
    return Estimate((low + high) / 2, low, high, 0.1, 100)


CONDITIONS = {
    "holds": Condition("near", between(1, 2), low=0, group="north", unit="km"),
    "fails": Condition("far | away", between(-2, -1), low=0, group="south", unit="km"),
    "undecided": Condition("w" * 300, between(-1, 1), low=0, group="north"),
    "aside": Condition("printed", between(1, 2), low=0, aside="printed table"),
}
CASES = {
    "reproduced": ["holds", "aside"],
    "mixed": ["holds", "fails"],
    "undecided": ["holds", "undecided"],
    "not reproduced": ["fails", "undecided"],
    "cannot be tested": ["aside"],
}


@pytest.fixture
def everything(root):
    save(root)
    claims = {}
    for k, (word, names) in enumerate(CASES.items(), 1):
        shown = ("figure_01", "table_B2") if k == 1 else ()
        quote, main = f"a claim | of {word}", word == "mixed"
        claim = Claim(f"9.{k}", quote, "section 1", "it is so", main=main, shown=shown)
        claims[f"9.{k}"] = judged(claim, [CONDITIONS[name] for name in names], "runs")
        assert claims[f"9.{k}"]["verdict"] == word
    return {"9_tiny": claims}


@pytest.fixture
def report(root, everything):
    folder = root / "results"
    folder.mkdir()
    (folder / "findings.json").write_text('{"What holds": "Much."}', encoding="utf-8")
    (folder / "deviations.csv").write_text(
        "table,row,column,printed,ours,low,high,agrees,why\n"
        "2,a,b,1,1.01,0.9,1.1,true,\n2,c,d,1,2,1.9,2.1,false,another map\n",
        encoding="utf-8",
    )
    return summary.summary(root, {"9_tiny": folder}, everything)


def test_no_cell_of_the_report_is_long(report):
    rows = [line for line in report.splitlines() if line.startswith("|")]
    cells = [c for row in rows for c in row.replace(r"\|", "").strip("|").split("|")]
    assert len(rows) > 20
    assert max(map(len, cells)) <= CELL + 2


def test_rows_of_a_table_have_as_many_cells_as_its_head(report):
    widths = []
    for line in report.splitlines():
        if line.startswith("|"):
            widths.append(line.replace(r"\|", "").count("|"))
        elif widths:
            assert len(set(widths)) == 1, widths
            widths = []


def test_the_report_says_verdict_counts_decisive_number_and_links(report):
    assert "Of 5 claims: 1 reproduced, 1 mixed, 1 undecided, 1 not reproduced, 1 cannot" in report
    _, row = [x for x in report.splitlines() if x.startswith("| 9.2 | “")]
    assert r"“a claim \| of mixed”" in row
    assert "**mixed**: 1 of 2 hold, 1 fail, 0 undecided" in row
    assert r"far \| away: -1.50 [-2.00, -1.00] km, must be at least 0" in row
    assert "[figure 1](9_tiny/figure_01.png) [table B2](9_tiny/table_B2.csv)" in report
    assert "- **What holds.** Much." in report
    lines = report.splitlines()
    top = lines[lines.index("| paper | its main claim | verdict | what decides |") + 2 :][:2]
    assert top[0].startswith(r"| 9.2 | “a claim \| of mixed” | **mixed**: 1 of 2 hold, 1 fail")
    assert top[1] == ""
    assert "- north: 1 of 1 hold, 0 fail, 0 undecided" in report
    assert "of both: 1 of 2. 1 differ: another map" in report
    assert "rest on one seed" in report
    assert report.count("<details>") == report.count("</details>") == 6


def test_the_picture_has_a_square_of_the_verdicts_colour_for_each_claim(everything):
    picture = summary.picture(everything)
    assert picture == summary.picture(everything)
    with PIL.Image.open(io.BytesIO(picture)) as image:
        colours = {colour for _, colour in image.convert("RGB").getcolors(1 << 16)}
    wanted = [bytes.fromhex(summary.COLOURS[v][1][1:]) for v in VERDICTS]
    for colour in map(tuple, wanted):
        near = min(max(abs(a - b) for a, b in zip(colour, c, strict=True)) for c in colours)
        assert near < 4, colour


def test_the_readme_has_a_line_per_paper_between_its_marks(root, everything):
    path = root / "README.md"
    path.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n", encoding="utf-8")
    old, new = summary.in_readme(root, everything)
    assert old != new
    assert new.startswith(f"before\n{BEGIN}\n| paper | reproduced |")
    assert "| [9](notebooks/9_tiny.ipynb) Tiny | 1 | 1 | 1 | 1 | 1 | 3 of 7 hold, 2 fail" in new
    assert new.endswith(f"{END}\nafter\n")
    path.write_text("a readme without the marks\n", encoding="utf-8")
    assert len(set(summary.in_readme(root, everything))) == 1
