"""Judging all claims again with another seed, and what a report makes of it."""

import csv
import json
import subprocess

import attrs
import pytest
from tiny import FINISH, REPORT, STUDY, cell, save

from seanav import runner
from seanav.__main__ import main
from seanav.claims import CONFIRMATION, Claim, Condition
from seanav.estimates import Estimate
from seanav.report import Report
from seanav.runner import Refused
from seanav.runner.confirm import compare
from seanav.scenario import Parameters


def stored(outcome, aside=""):
    return {"what": "near", "outcome": outcome, "aside": aside}


def rows(root):
    with (root / CONFIRMATION).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_conditions_are_compared_one_by_one():
    claims = {"9.1": {"conditions": [stored("holds"), stored("fails", "printed table")]}}
    for again in ("holds", "fails", "undecided"):
        (row,) = compare("9_tiny", 5, claims, {"9.1": {"conditions": [stored(again)]}})
        assert row == {
            "paper": "9_tiny",
            "claim": "9.1",
            "condition": "near",
            "seed": "5",
            "outcome": "holds",
            "again": again,
        }
    (row,) = compare("9_tiny", 5, claims, {"9.1": {"conditions": []}})
    assert row["again"] == "another condition"


def test_a_confirmation_runs_beside_the_committed_results(finished, capsys):
    before = (finished / "paper_figures/manifest.json").read_bytes()
    assert main(["--root", str(finished), "confirm", "--seed", "77"]) == 0
    assert "0 conditions changed" in capsys.readouterr().out
    (row,) = rows(finished)
    assert (row["condition"], row["seed"], row["again"]) == ("tiny", "77", "holds")
    assert (finished / "paper_figures/manifest.json").read_bytes() == before
    other = json.loads((finished / "build/params/9_tiny.json").read_text(encoding="utf-8"))
    assert other["seed"] == 77


def test_a_seed_that_was_run_confirms_nothing(finished):
    with pytest.raises(Refused, match="seed = 1: the committed results of 9_tiny have it"):
        runner.confirm(finished, 1, ["9_tiny"])
    save(finished, stem="8_other")
    with pytest.raises(Refused, match="8_other: no committed results"):
        runner.confirm(finished, 2, ["8_other"])
    assert not (finished / CONFIRMATION).exists()


def test_a_changed_condition_is_undecided_in_the_papers_own_run_only(tmp_path, monkeypatch):
    monkeypatch.setenv("SEANAV_RESULTS", str(tmp_path))
    monkeypatch.setattr("seanav.report.changed", lambda root, stem: {("9.1", "near")})

    @attrs.frozen
    class Scenario(Parameters):
        runs: int = 5

    claims = [Claim("9.1", "q", "s", "r")]
    for scenario, word in ((Scenario(), "undecided"), (Scenario(runs=6), "reproduced")):
        report = Report("9_tiny", scenario=scenario, claims=claims, seed=1)
        report.claim("9.1", [Condition("near", Estimate(1, 1, 1, 0, 9), low=0)], "basis")
        assert report._claims["9.1"]["verdict"] == word
        assert report._claims["9.1"]["conditions"][0]["outcome"] == "holds"


def test_the_report_lists_what_changed(finished):
    path = finished / CONFIRMATION
    text = "paper,claim,condition,seed,outcome,again\n9_tiny,9.1,tiny,77,holds,fails\n"
    path.write_text(text, encoding="utf-8")
    runner.run(finished, "9_tiny")
    report = (finished / "paper_figures/REPORT.md").read_text(encoding="utf-8")
    assert "(77): 1 of 1 conditions changed" in report
    assert "| 9.1 | tiny | holds | fails |" in report


def test_the_manifest_names_the_commit_that_held_the_regions(finished):
    def entry():
        text = (finished / "paper_figures/manifest.json").read_text(encoding="utf-8")
        return json.loads(text)["9_tiny"]

    def git(*words):
        identity = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
        command = ["git", *identity, "-C", finished, *words]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    assert entry()["regions_commit"] is None  # there is no repository
    git("init", "-q")
    git("add", "notebooks")
    git("commit", "-qm", "regions")
    head = git("rev-parse", "HEAD")
    runner.run(finished, "9_tiny")
    assert entry()["regions_commit"] == head
    git("commit", "-qm", "later", "--allow-empty")
    runner.run(finished, "9_tiny")  # the regions are as they were
    assert entry()["regions_commit"] == head
    save(finished, cell(STUDY), cell(REPORT), cell(FINISH.replace("low=0.0", "low=1.0")))
    runner.run(finished, "9_tiny")
    assert entry()["regions_commit"] is None  # not committed
