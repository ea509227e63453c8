"""Results of a notebook: rounding, verdicts, agreement, and files that do not change."""

import csv
import io
import itertools
import json
import math
from types import SimpleNamespace

import attrs
import numpy as np
import pytest
from matplotlib import colors, image, legend
from matplotlib import pyplot as plt

from seanav.claims import Claim, Condition
from seanav.estimates import Estimate, exact, root_mean_square, significant
from seanav.report import Report, json_text


@attrs.frozen
class Scenario:
    runs: int = 1000
    radii_km: tuple = (1.0, 2.5)


@pytest.fixture
def results(tmp_path, monkeypatch):
    monkeypatch.setenv("SEANAV_RESULTS", str(tmp_path))
    return tmp_path / "9_tiny"


@pytest.fixture
def report(results):
    return opened(CLAIMS)


def opened(claims=(), **more):
    return Report("9_tiny", scenario=Scenario(), claims=claims, seed=7, **more)


def between(low, high):
    return Estimate((low + high) / 2, low, high, (high - low) / 4, 100)


# ---------------------------------------------------------------- rounding


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (0.93216, "0.932"),
        (1.0, "1.00"),
        (110.04, "110"),
        (12345.6, "12300"),
        (999.6, "1000"),
        (9.996, "10.0"),
        (999999.6, "1.00e+06"),
        (0.00012345, "0.000123"),
        (0.000012345, "1.23e-05"),
        (1234567.0, "1.23e+06"),
        (-2.0, "-2.00"),
        (-0.0, "0"),
        (1000, "1000"),
        (np.int64(123456), "123456"),
        (np.float64(0.25), "0.250"),
        (math.inf, "inf"),
    ],
)
def test_significant_digits(number, text):
    assert significant(number) == text


def test_significant_keeps_three_digits_of_any_number():
    numbers = 10.0 ** np.random.default_rng(1).uniform(-8, 8, 500)
    for x in numbers:
        assert float(significant(x)) == pytest.approx(x, rel=0.5e-2)
        assert float(significant(x, 6)) == pytest.approx(x, rel=0.5e-5)


def test_significant_shows_an_interval_only_where_there_is_one():
    assert significant(between(0.9, 1.1)) == "1.00 [0.900, 1.10]"
    assert significant(exact(3.0)) == "3.00"


def test_json_keeps_ten_digits_and_refuses_what_is_not_a_number():
    content = {"a": np.array([1 / 3, 2.0]), "n": np.int64(3), "yes": np.bool_(True), "none": None}
    assert json.loads(json_text(content)) == {
        "a": [0.3333333333, 2.0],
        "n": 3,
        "yes": True,
        "none": None,
    }
    with pytest.raises(ValueError, match="not JSON compliant"):
        json_text({"a": math.nan})


# ---------------------------------------------------------------- files


HOLDS = Condition("near", between(1, 2), low=0, unit="m")
FAILS = Condition("far", between(-2, -1), low=0, group="north")
OPEN = Condition("between", between(-1, 1), low=0, group="south")
CLAIMS = (
    Claim("9.1", "it is large", "section 1", "at least 2"),
    Claim("9.2", "it is smaller", "section 2", "above 0", shown=("figure_01", "table_2")),
    Claim("9.10", "it is known", "abstract", "nothing to test", stated=False),
)
NAMES = ("words", "holds", "fails", "undecided", "depends", "beyond")
FINDINGS = {name: f"{name}: 3." for name in NAMES}


def fill(report):
    fig, ax = plt.subplots()
    ax.plot([0.0, 1.0], [1.0, 0.5], label="error (m)")
    picture = report.figure(1, fig, "A line")
    report.table(2, ["path", "rmse_km"], [["direct", 1 / 3], ["planned", np.int64(2)]], "Sums")
    report.parameters(
        [("runs", 1000, "", "text", "Table 1"), ("radii_km", (1.0, 2.5), "km", "assumed")]
    )
    ours = Estimate(8.0, 7.8, 8.2, 0.1, 1000)
    report.deviation("2", "direct", "R = 1", 8.1, ours, why="another map")
    report.deviation("2", "direct", "R = 2", 9.1, ours, why="another map")
    report.claim("9.10", [], "no statement")
    report.claim("9.2", [FAILS, OPEN], "Monte Carlo")
    report.claim("9.1", [Condition("map", exact(3.0), low=2.0, unit="m")], "a count")
    report.findings(**FINDINGS)
    report.finish()
    return picture


def test_files_are_those_that_the_project_promises(report, results):
    fill(report)
    assert sorted(path.name for path in results.iterdir()) == [
        "claims.json",
        "deviations.csv",
        "figure_01.pdf",
        "figure_01.png",
        "findings.json",
        "parameters.csv",
        "table_2.csv",
    ]
    assert (results / "table_2.csv").read_text(encoding="utf-8") == (
        "path,rmse_km\ndirect,0.3333333333\nplanned,2\n"
    )
    assert (results / "deviations.csv").read_text(encoding="utf-8") == (
        "table,row,column,printed,ours,low,high,agrees,why\n"
        "2,direct,R = 1,8.1,8,7.8,8.2,true,\n2,direct,R = 2,9.1,8,7.8,8.2,false,another map\n"
    )
    with (results / "parameters.csv").open() as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["name", "value", "unit", "origin"]
    assert rows[1:] == [
        ["runs", "1000", "", "text: Table 1"],
        ["radii_km", "(1.0, 2.5)", "km", "assumed"],
    ]


def test_claims_have_the_promised_form(report, results):
    fill(report)
    claims = json.loads((results / "claims.json").read_text(encoding="utf-8"))
    assert list(claims) == ["9.1", "9.2", "9.10"]
    condition = {
        "what": "map",
        "group": "",
        "value": 3.0,
        "interval": None,
        "unit": "m",
        "region": [2.0, None],
        "outcome": "holds",
        "shown": "3.00 m",
        "claimed": "at least 2.00",
        "aside": "",
        "confirmed": True,
    }
    assert claims["9.1"] == {
        "quote": "it is large",
        "section": "section 1",
        "reading": "at least 2",
        "stated": True,
        "main": False,
        "verdict": "reproduced",
        "holds": 1,
        "fails": 0,
        "undecided": 0,
        "decisive": condition,
        "basis": "a count",
        "shown": [],
        "conditions": [condition],
    }
    assert claims["9.2"]["verdict"] == "not reproduced"
    assert claims["9.2"]["decisive"]["what"] == "far"
    assert claims["9.2"]["conditions"][1]["interval"] == [-1.0, 1.0]
    assert claims["9.2"]["conditions"][1]["region"] == [0.0, None]
    assert claims["9.10"]["decisive"] is None
    assert claims["9.10"]["verdict"] == "cannot be tested"
    assert json.loads((results / "findings.json").read_text(encoding="utf-8")) == {
        "Words": "words: 3.",
        "What holds": "holds: 3.",
        "What fails": "fails: 3.",
        "What is open": "undecided: 3.",
        "What it hangs on": "depends: 3.",
        "Beyond the paper": "beyond: 3.",
    }


def test_quick_claims_are_marked(results):
    fill(opened(CLAIMS, quick=True))
    claims = json.loads((results / "claims.json").read_text(encoding="utf-8"))
    assert all(claim["quick"] is True for claim in claims.values())


def test_part_for_the_manifest(report, results):
    fill(report)
    assert json.loads(results.with_suffix(".json").read_text(encoding="utf-8")) == {
        "seed": 7,
        "quick": False,
        "parameters": {"runs": 1000, "radii_km": [1.0, 2.5]},
        "headline": {"9.1": "3.00 m", "9.2": "-1.50 [-2.00, -1.00]"},
    }


def test_files_are_byte_identical_on_a_rerun(results, monkeypatch):
    def once(epoch):
        # Dates in a file would come from the clock or from this variable.
        monkeypatch.setenv("SOURCE_DATE_EPOCH", epoch)
        fill(opened(CLAIMS))
        return {path.name: path.read_bytes() for path in results.iterdir()}

    assert once("1000000000") == once("1700000000")


def test_a_picture_is_the_same_if_the_last_digits_of_its_numbers_are_not(results):
    def drawn(noise):
        report = opened(CLAIMS)
        fig, (left, right) = plt.subplots(1, 2)
        x = np.linspace(0.1, 7, 400)
        y = np.exp(np.sin(x)) * (1 + noise * np.cos(9 * x))
        left.plot(x, y, "o-", label="line")
        left.fill_between(x, y - 1, y + 1)
        right.contour(np.outer(y, y))
        right.scatter(x, y)
        left.axhline(y.mean())
        left.legend()
        report.figure(1, fig, "a")
        return [path.read_bytes() for path in sorted(report._folder.glob("figure*"))]

    assert drawn(0.0) == drawn(3e-12)
    assert drawn(0.0) != drawn(3e-4)


def test_pictures_do_not_name_the_program_that_drew_them(report, results):
    fill(report)
    for path in results.glob("figure_*"):
        assert b"matplotlib" not in path.read_bytes().lower(), path.name


def test_saved_picture_has_200_dots_per_inch_and_the_shown_one_half_as_many(report, results):
    picture = fill(report)
    sizes = [
        image.imread(png).shape for png in (results / "figure_01.png", io.BytesIO(picture.data))
    ]
    assert sizes[0][:2] == (800, 1280)  # 6.4 by 4 inches
    assert sizes[1][:2] == (400, 640)


def test_few_colours_keep_those_of_thin_lines(report):
    # The hard case: thin lines in rare colours over a large shaded surface, which would
    # take every place of a palette that went by frequency.
    fig, axis = plt.subplots()
    field = np.sin(np.linspace(0, 3, 90))[:, None] * np.cos(np.linspace(0, 5, 90))
    axis.imshow(field, cmap="viridis", aspect="auto")
    for k in range(8):
        axis.plot([0, 89], [5 + 10 * k, 9 + 8 * k], color=f"C{k}", linewidth=1.5)
    wanted = np.array([colors.to_rgb(f"C{k}") for k in range(8)])
    whole = io.BytesIO()
    fig.savefig(whole, format="png", dpi=200)
    report.figure("B1", fig, "Lines over a map.")
    path = report._folder / "figure_B1.png"
    saved = np.unique(image.imread(path)[..., :3].reshape(-1, 3), axis=0)
    nearest = np.abs(saved[:, None] - wanted).max(axis=2).min(axis=0)
    assert nearest.max() < 10 / 255
    assert path.stat().st_size < 0.5 * whole.tell()


def test_a_filter_that_diverged_is_shown_as_such_and_holds_no_claim(results, capsys):
    lost = root_mean_square(np.array([1.0, math.inf]))
    report = opened(CLAIMS[:1])
    report.claim("9.1", [Condition("lost", lost, high=1.0)], "Monte Carlo")
    assert "9.1 not reproduced: 0 of 1 hold, 1 fail, 0 undecided" in capsys.readouterr().out
    report.parameters([])
    report.findings(**FINDINGS)
    report.finish()
    claim = json.loads((results / "claims.json").read_text(encoding="utf-8"))["9.1"]
    assert claim["decisive"]["value"] is None
    assert claim["decisive"]["shown"] == "diverges"


def test_a_busy_machine_is_no_error(report, monkeypatch):
    # Matplotlib warns if placing a legend takes over a second by this clock.
    ticks = itertools.count(step=10)
    monkeypatch.setattr(legend, "time", SimpleNamespace(perf_counter=lambda: next(ticks)))
    fig, axis = plt.subplots()
    axis.plot([0, 1], label="line")
    axis.legend()
    report.figure(1, fig, "A slow legend.")
    assert next(ticks) > 10  # the clock was asked


def test_figure_closes_what_it_saved(report):
    before = plt.get_fignums()
    fig, _ = plt.subplots()
    report.figure("B1", fig, "beyond")
    assert plt.get_fignums() == before


def test_lines_differ_in_grey_by_their_dashes(report):
    cycle = plt.rcParams["axes.prop_cycle"].by_key()
    assert len(set(map(str, cycle["linestyle"]))) == len(cycle["color"]) == 8


def test_what_is_printed_is_rounded(report, capsys):
    fill(report)
    printed = capsys.readouterr().out
    assert "direct   0.333\n" in printed
    assert "9.2 not reproduced: 0 of 2 hold, 1 fail, 1 undecided\n" in printed
    assert "decisive: far: -1.50 [-2.00, -1.00], claimed at least 0, fails\n" in printed
    assert "    north: 0 of 1 hold, 1 fail, 0 undecided\n" in printed
    assert "“it is known” (abstract, only implied)" in printed
    counts = "1 reproduced; 0 mixed; 0 undecided; 1 not reproduced; 1 cannot be tested\n"
    assert printed.endswith(counts)


def test_older_results_stay_until_the_new_ones_are_complete(results):
    results.mkdir()
    (results / "figure_09.png").write_text("stale", encoding="utf-8")
    report = opened()
    assert [path.name for path in results.iterdir()] == ["figure_09.png"]
    report.parameters([])
    report.findings(**FINDINGS)
    report.finish()
    assert not (results / "figure_09.png").exists()
    assert (results / "claims.json").is_file()


def test_by_hand_results_stay_below_build(monkeypatch):
    monkeypatch.delenv("SEANAV_RESULTS", raising=False)
    report = Report("9_by_hand_test", scenario=Scenario(), claims=(), seed=7)
    assert report._results.parts[-3:] == ("build", "by_hand", "9_by_hand_test")


# ---------------------------------------------------------------- refusals


def test_finish_demands_every_claim_the_findings_and_the_origins(results):
    report = opened(CLAIMS[:2])
    for message in (
        "claims that were not judged: 9.1, 9.2",
        "claim 9.2 is shown in figure_01, which is not there",
        "the origins of the parameters are missing",
        "the findings are missing",
    ):
        with pytest.raises(ValueError, match=message):
            report.finish()
        if "judged" in message:
            report.claim("9.1", [], "b")
            report.claim("9.2", [], "b")
        elif "figure_01" in message:
            report.figure(1, plt.figure(), "empty")
            report.table(2, ["a"], [[1]], "one")
        elif "origins" in message:
            report.parameters([])
    assert not (results / "claims.json").exists()


def test_a_claim_is_a_declared_one_judged_once_by_facts_of_their_own(report):
    report.claim("9.10", [], "")
    for number in ("9.3", "9.10"):
        with pytest.raises(ValueError, match=f"claim {number} is not declared, or is judged twice"):
            report.claim(number, [], "")
    with pytest.raises(ValueError, match=r"claim 9\.1: there are two conditions 'near'"):
        report.claim("9.1", [HOLDS, FAILS, HOLDS], "")


def test_unknown_origin_is_refused(report):
    with pytest.raises(ValueError, match="runs: origin 'guess' is none of text"):
        report.parameters([("runs", 3, "", "guess")])


def test_nothing_is_overwritten_within_a_run(report):
    fill(report)
    with pytest.raises(ValueError, match="table 2 is there already"):
        report.table(2, ["a"], [[1]], "again")


def test_a_number_that_is_no_file_name_is_refused(report):
    with pytest.raises(ValueError, match="not a number or short name"):
        report.table("../2", ["a"], [[1]], "outside")


def test_a_row_that_does_not_fit_is_refused(report):
    with pytest.raises(ValueError, match="does not fit the columns"):
        report.table(1, ["a", "b"], [[1]], "short")


def test_the_table_of_parameters_is_folded_to_a_page(report, capsys):
    long = [0.001 * k for k in range(40)]
    note = "assumed", "a reason of many words " * 9
    report.parameters([("runs", 100, "", "text"), ("a_long_name_of_a_list", long, "m/s", *note)])
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 95
    assert lines[1].split() == ["runs", "100", "text"]
    words = " ".join(lines).split()
    assert words.count("reason") == 9
    assert len(lines) > 5


def test_a_table_that_is_not_shown_is_kept(report, results, capsys):
    report.table(7, ["a", "b"], [[1, 2.5]], "Long", shown=False)
    assert capsys.readouterr().out == "Table 7. Long\n"
    (kept,) = results.parent.rglob("table_7.csv")
    assert kept.read_text(encoding="utf-8") == "a,b\n1,2.5\n"
