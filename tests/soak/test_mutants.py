"""The tool that breaks the sources breaks what it says, and nothing that cannot matter."""

import ast

import mutants
import pytest

SOURCE = '''
"""A docstring with 1 + 1."""
FIXED = 3 + 4


def score(a: "1 + 2", b=2):
    """Return 5."""
    if a < b and not b == 0:
        raise ValueError(f"a is {a + 1}")
    return -max(a, b) * b[0] + 0.5
'''
DONE = [
    "a < b and (not b == 0)  ->  a < b or not b == 0",
    "a < b  ->  a <= b",
    "b == 0  ->  b != 0",
    "0  ->  1",
    "-max(a, b) * b[0] + 0.5  ->  -max(a, b) * b[0] - 0.5",
    "-max(a, b) * b[0]  ->  -max(a, b) / b[0]",
    "-max(a, b)  ->  +max(a, b)",
    "max  ->  min",
    "0  ->  1",
    "0.5  ->  1.0",
]


def test_each_place_is_broken_once():
    places = range(len(mutants.breakable(ast.parse(SOURCE))))
    broken = [mutants.broken(SOURCE, number) for number in places]
    assert [what for _, _, what in broken] == DONE
    whole = ast.unparse(ast.parse(SOURCE))
    assert all(text != whole for text, *_ in broken)
    assert len({text for text, *_ in broken}) == len(DONE)


@pytest.mark.parametrize("path", mutants.targets(), ids=lambda path: path.stem)
def test_every_module_that_can_be_broken_has_tests(path):
    if mutants.breakable(ast.parse(path.read_text(encoding="utf-8"))):
        assert mutants.tests_of(path)
