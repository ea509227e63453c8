"""What is declared once says the same everywhere: checks, origins, quick run, notebook cell."""

import attrs
import pytest

from seanav.checks import ParameterError
from seanav.scenario import Choice, Integer, List, Number, Parameters, Text, parameter, tenth


@attrs.frozen(kw_only=True)
class Scenario(Parameters):
    runs: int = parameter(100, Integer(2, 10**6), origin="text", note="missions", quick=tenth(20))
    noise: float = parameter(0.3, Number(above=0), unit="m/s", origin="assumed")
    shape: str = parameter("circle", Choice(("circle", "square")), origin="derived")
    levels: tuple = parameter((1.0, 2.0), List(Number(at_least=0)), unit="mGal", origin="text")
    names: tuple = parameter(("v", "r"), List(Choice("vr"), distinct=True), origin="ours")
    chain: tuple = parameter(((0.9, 0.1),), List(List(Number(), 2), 1), origin="recalled")
    file: str = parameter("", Text(), origin="ours", note="x" * 90)


def test_values_are_converted_once():
    scenario = Scenario(noise=1, levels=[3], names=["r"], chain=[[1, 0]])
    assert scenario.noise == 1.0
    assert isinstance(scenario.noise, float)
    assert scenario.levels == (3.0,)
    assert scenario.chain == ((1.0, 0.0),)
    assert hash(scenario) == hash(Scenario(noise=1.0, levels=(3.0,), names=("r",), chain=((1, 0),)))


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"runs": 1}, "runs = 1: must be an integer of at least 2 and at most 1000000"),
        ({"runs": 10**400}, "must be an integer"),
        ({"runs": True}, "runs = True: must be an integer"),
        ({"noise": float("nan")}, "noise = nan: must be a finite number above 0"),
        ({"shape": "line"}, "shape = 'line': must be one of 'circle', 'square'"),
        ({"shape": ["circle"]}, "must be one of"),
        ({"levels": []}, r"levels = \[\]: must be a list of 1 to 64 values"),
        ({"levels": "12"}, "levels = '12': must be a list of 1 to 64 values"),
        ({"levels": {1.0}}, "must be a list"),
        ({"levels": [1.0, -1.0]}, "levels = -1.0: must be a finite number at least 0"),
        ({"names": ["v", "v"]}, "must hold every value once"),
        ({"chain": [[1.0]]}, "must be a list of 2 values"),
        ({"file": 3}, "file = 3: must be text"),
        ({"file": "a\0b"}, "must be text"),
    ],
)
def test_what_is_not_allowed_is_one_line(given, told):
    with pytest.raises(ParameterError, match=told) as caught:
        Scenario(**given)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


def test_the_reduced_run_comes_from_the_declaration():
    assert Scenario().quick() == Scenario(runs=20)
    assert Scenario(runs=1000).quick().runs == 100
    assert Scenario(runs=5).quick().runs == 5


def test_the_cell_is_python_and_gives_the_defaults_back():
    names = {}
    exec(Scenario.cell(), names)
    assert names["quick"] is False
    assert Scenario.read(names) == Scenario()
    assert Scenario.read(names | {"quick": True}) == Scenario().quick()
    with pytest.raises(ParameterError, match="quick = 1: must be one of False, True"):
        Scenario.read(names | {"quick": 1})


def test_the_cell_says_unit_meaning_and_origin_in_lines_that_fit():
    lines = Scenario.cell().splitlines()
    assert "noise = 0.3  # m/s; assumed" in lines
    assert 'shape = "circle"  # one of "circle", "square"; derived' in lines
    assert "runs = 100  # missions; text" in lines
    assert 'names = ["v", "r"]  # ours' in lines  # nothing to say but the origin
    assert lines[lines.index('file = ""') - 1] == f"# {'x' * 90}; ours"
    assert max(map(len, lines)) <= 100


def test_the_origins_are_those_of_the_declaration():
    rows = Scenario(levels=[1, 2.5]).origins()
    assert ("levels", "1.0 2.5", "mGal", "text", "") in rows
    assert [row[0] for row in rows] == [field.name for field in attrs.fields(Scenario)]


def test_an_unknown_origin_is_refused():
    with pytest.raises(ValueError, match="origin"):
        parameter(1, Integer(0), origin="somewhere")
