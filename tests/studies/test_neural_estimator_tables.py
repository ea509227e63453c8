"""Pivots of paper 2: every number of a long table stands where its names cross."""

import csv

import pytest

from seanav.report import Report
from seanav.studies.neural_estimator import tables
from seanav.studies.neural_estimator.claims import CLAIMS
from seanav.studies.neural_estimator.scenario import Scenario

LONG = [
    ["steady", "examination", "KF", 0.1, 0.09, 0.11, 0.5],
    ["steady", "examination", "GLS", 0.25, 0.2, 0.3, 0.0],
    ["one turn", "turn", "KF", 0.4, 0.39, 0.41, 1.0],
]


def test_pivot_puts_each_number_where_its_names_cross():
    assert tables.pivot(LONG, (0, 1), 2, 3) == [
        ["", "KF", "GLS"],
        ["steady", "0.100", "0.250"],
        ["one turn, turning", "0.400", ""],
    ]
    assert tables.pivot([[0.5, 2, 7.0]], (0,), 1, 2) == [["", "2"], ["0.5", "7.00"]]
    assert tables.per_cent(0.125) == "12.5"


def test_the_widest_interval_is_told():
    assert tables.widest(LONG, 3) == "20 %"
    assert tables.widest([["a", 0.0, -1.0, 1.0]], 1) == "0 %"


def test_a_table_is_printed_in_columns(capsys):
    tables.show([["", "a", "long heading"], ["row", "1", "2"]], "title")
    assert capsys.readouterr().out == "title  a  long heading\nrow    1  2\n\n"


def test_the_long_table_is_kept_and_not_printed(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("SEANAV_RESULTS", str(tmp_path))
    report = Report("2_neural_estimator", scenario=Scenario(), claims=CLAIMS, seed=2)
    heads = ["course", "phase", "estimator", "RMSE", "low", "high", "won"]
    report.table(7, heads, LONG, "A caption.", shown=False)
    assert capsys.readouterr().out == "Table 7. A caption.\n"
    (path,) = tmp_path.rglob("table_7.csv")
    with path.open(encoding="utf-8", newline="") as file:
        assert [row[3] for row in csv.reader(file)] == ["RMSE", "0.1", "0.25", "0.4"]


@pytest.mark.parametrize(
    ("won", "said"), [(0.0, "no run was won on the other"), (0.4, "40.0 % (zigzag, 5)")]
)
def test_factors_tell_where_runs_were_won(won, said, capsys):
    rows = [
        [5, "steady", "examination", 0.1, 0.09, 0.11, 0.95, 0.9, 1.0],
        [5, "zigzag", "examination", 0.4, 0.39, 0.41, won, 0.0, 1.0],
        [5, "zigzag", "turn", 9.0, 8.0, 9.0, 1.0, 0.0, 1.0],
    ]
    tables.factors(rows, "level")
    printed = capsys.readouterr().out
    assert said in printed
    assert "5      0.100   0.400   95.0" in printed
    assert "9.00" not in printed
