"""The sets of the soak: every pair of levels meets, every option is there, enough of them."""

import importlib
import json
from itertools import combinations, product

import cells
import pytest
from cells import SMALL
from sets import LEVELS, REFUSED, RUNS, covering, factors

from seanav.scenario import Choice


def scenario(stem):
    study = importlib.import_module(f"seanav.studies.{stem.partition('_')[2]}.scenario")
    return study.Scenario


@pytest.mark.parametrize("sizes", [(2, 2), (3, 1, 2), (5, 6, 2, 2, 3), (3,) * 20])
def test_every_pair_of_levels_meets(sizes):
    levels = {f"f{k}": list(range(size)) for k, size in enumerate(sizes)}
    rows = covering(levels)
    for (one, some), (other, more) in combinations(levels.items(), 2):
        assert {(row[one], row[other]) for row in rows} == set(product(some, more))
    first, second, *_ = sorted(sizes, reverse=True)
    assert first * second <= len(rows) <= 2 * first * second + len(sizes)


@pytest.mark.parametrize("stem", SMALL)
def test_sets_speak_of_parameters_and_hold_every_option(stem):
    declared, found = scenario(stem).declared(), factors(stem)
    assert set(LEVELS[stem]) <= declared.keys()
    for name, (_, about) in declared.items():
        if isinstance(about.kind, Choice):
            levels = [level.get(name) for of in found.values() for level in of]
            assert set(about.kind.options) <= set(levels), name
    for changes in (*RUNS[stem], *REFUSED[stem]):
        assert changes.keys() <= declared.keys()
    # A level that its own declaration refuses would run nothing: bounds move, sets stay.
    levels = [level for of in found.values() for level in of]
    for name, value in [item for changes in (*levels, *RUNS[stem]) for item in changes.items()]:
        if not callable(value):  # a file, see `cells.own_map`
            declared[name][1].kind(name, value)
    assert len(covering(found)) + len(RUNS[stem]) >= 25


def test_a_cell_that_no_parameter_reaches_runs_once(tmp_path, monkeypatch, capsys):
    sources = ["runs = 2", "scenario = runs", "import math", "calls = []\nfixed = math.pi"]
    sources += [
        "def f():\n    return scenario",
        "calls.append(fixed)\nprint(len(calls))",
        "y = f()",
    ]
    sources += ["fixed = runs", "print(fixed)"]
    notebook = {"cells": [{"cell_type": "code", "source": [source]} for source in sources]}
    (tmp_path / "9_it.ipynb").write_text(json.dumps(notebook), "utf-8")
    monkeypatch.setattr(cells, "NOTEBOOKS", tmp_path)
    code = cells.code.__wrapped__("9_it")
    assert [k for k, (_, hidden) in enumerate(code, 1) if hidden is not None] == [4, 6]
    for runs in (2, 3):
        names = {}
        for source, hidden in [(f"runs = {runs}", None), *code[1:]]:
            cells.run_cell(source, hidden, names)
        assert names["y"] == names["fixed"] == runs
    assert capsys.readouterr().out == "1\n2\n1\n3\n"
