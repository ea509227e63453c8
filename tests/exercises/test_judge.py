"""The judge on made-up exercises, and what holds for the exercises of all notebooks."""

import re
from pathlib import Path

import nbformat
import numpy as np
import pytest
import sympy as sp

from seanav import exercises
from seanav.checks import ParameterError
from seanav.exercises import check, find, stated
from seanav.exercises.judge import Exercise, hint


def number(value, **options):
    return Exercise(right=lambda: value, **options)


@pytest.mark.parametrize("answer", [2.5, 2.49, np.float32(2.51), np.array(2.5)])
def test_a_number_is_right_within_its_tolerance(answer):
    assert hint(number(2.5), answer) == ""


@pytest.mark.parametrize(
    ("answer", "word"),
    [
        (-2.5, "sign"),
        (5.0, "twice"),
        (2500.0, "power of ten"),
        (150.0, "minutes"),
        (np.degrees(2.5), "degrees"),
        (6.25, "square"),
        (np.sqrt(2.5), "root"),
        (2.6, "close"),
        (7.7, "steps once more"),
        (np.nan, "finite"),
        (np.inf, "finite"),
        ([2.5], "one number"),
        ("2.5 m", "Hand in a number"),
        (None, "finite"),
        (2.5 + 1j, "Hand in a number"),
        ({}, "Hand in a number"),
        (np.mean, "not a function"),
        (sp.Symbol("x"), "Hand in a number"),
    ],
)
def test_a_wrong_number_gets_its_hint(answer, word):
    assert word in hint(number(2.5), answer)


def test_a_declared_mistake_comes_before_the_general_ones():
    exercise = number(2.5, mistakes={"Own words.": lambda: -2.5, "Two ways.": lambda: [1.0, 9.0]})
    assert hint(exercise, -2.5) == "Own words."
    assert hint(exercise, 9.0) == "Two ways."


@pytest.mark.parametrize(
    ("answer", "word"),
    [
        ([3.0, 1.0], "order"),
        ([[1.0, 3.0]], "shape (1, 2)"),
        ([1.0, np.nan], "finite"),
        ([[1.0], [2.0, 3.0]], "array of numbers"),
        ([1.0, 3.5], "steps"),
    ],
)
def test_arrays(answer, word):
    assert hint(number(np.array([1.0, 3.0])), [1.0, 3.0]) == ""
    assert word in hint(number(np.array([1.0, 3.0])), answer)


def test_a_transposed_matrix_is_told():
    A = np.array([[1.0, 2.0], [5.0, 7.0]])
    assert "exchanged" in hint(number(A), A.T)


def test_zero_is_right_only_as_zero():
    assert hint(number(0.0), 0) == ""
    assert hint(number(0.0), 1e-9) != ""


def test_words_and_sets_of_words():
    assert hint(number("Process  noise"), "process noise ") == ""
    assert hint(number("left"), "right") != ""
    assert "quotation" in hint(number("left"), 3)
    assert hint(number({"u", "v"}), ["V", "u"]) == ""
    assert hint(number({"u", "v"}), {"u"}) != ""
    assert "set" in hint(number({"u", "v"}), 5)


def test_expressions_are_compared_by_what_they_mean():
    x, t = sp.symbols("x t", real=True)
    right = number((x + t) ** 2)
    y = sp.Symbol("x", positive=True)
    assert hint(right, y**2 + 2 * y * sp.Symbol("t") + sp.Symbol("t") ** 2) == ""
    assert hint(right, "x**2 + 2*x*t + t**2") == ""
    assert hint(right, x**2 + t**2) != ""
    assert "SymPy" in hint(right, "x +")
    assert hint(right, sp.Eq(x, t)) != ""


FUNCTION = Exercise(
    right=lambda P, H: H @ P @ H.T,
    mistakes={"H stands on the wrong side.": lambda P, H: H.T @ P @ H},
    cases=[(np.diag([1.0, 4.0]), np.array([[1.0, 2.0], [0.0, 1.0]]))],
)


def test_functions_are_tried_on_cases():
    assert hint(FUNCTION, lambda P, H: H.dot(P).dot(H.T)) == ""
    assert hint(FUNCTION, lambda P, H: H.T @ P @ H) == "H stands on the wrong side."
    assert "other numbers" in hint(FUNCTION, lambda P, H: 7 * P)
    assert "raised TypeError" in hint(FUNCTION, lambda P: P)
    assert "without calling" in hint(FUNCTION, np.eye(2))
    assert "does not fit" in hint(FUNCTION, lambda P, H: None)


def test_a_function_that_writes_into_its_arguments_harms_nobody():
    def careless(P, H):
        result = H @ P @ H.T
        P[:] = 0.0
        return result

    assert hint(FUNCTION, careless) == hint(FUNCTION, careless) == ""
    assert FUNCTION.cases[0][0].any()


@pytest.mark.parametrize(
    ("name", "word"),
    [("7.1", "0 to 5"), ("x", "0 to 5"), ("0.99", "must be one of 0.1, "), (4, "of 4.1")],
)
def test_an_exercise_that_is_not_there_is_refused_in_one_line(name, word):
    with pytest.raises(ParameterError, match=re.escape(word)):
        find(name)


def test_check_says_it_and_returns_nothing(capsys):
    assert check("0.1", None) is None
    assert re.fullmatch(r"0\.1: not yet\. .+\n", capsys.readouterr().out)


# ---------------------------------------------------------------- the notebooks' own

CHAPTERS = range(len(exercises.CHAPTERS))
NOTEBOOKS = Path(__file__).resolve().parents[2] / "notebooks"


def of_notebook(chapter):
    path = NOTEBOOKS / f"{chapter}_{exercises.CHAPTERS[chapter]}.ipynb"
    return stated(nbformat.read(path, as_version=4).cells)


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_there_are_six_exercises_and_each_tells_mistakes_apart(chapter):
    known = exercises.exercises(chapter)
    assert list(known) == [f"{chapter}.{k}" for k in range(1, len(known) + 1)]
    assert len(known) >= 6
    for name, exercise in known.items():
        assert len(exercise.mistakes) >= 2, name
        for said in exercise.mistakes:
            assert said.endswith((".", "?", "!")), name
            assert len(said) < 300


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_no_mistake_is_right_and_each_gets_its_own_hint(chapter):
    for name, exercise in exercises.exercises(chapter).items():
        for said, mistake in exercise.mistakes.items():
            made = mistake if exercise.cases else mistake()
            for wrong in made if isinstance(made, list) else [made]:
                assert hint(exercise, wrong) == said, name
        right = exercise.right if exercise.cases else exercise.right()
        assert hint(exercise, right) == "", name


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_every_exercise_stands_in_its_notebook_with_a_solution_that_is_right(chapter):
    found = of_notebook(chapter)
    assert [one.number for one in found] == list(exercises.exercises(chapter))
    assert len({one.stars for one in found}) == 3  # from one star to three
    for name, _, minutes, title, text, solution in found:
        assert 1 <= minutes <= 240
        assert title
        assert f'check("{name}"' in text.replace("'", '"'), f"{name}: nothing says what to hand in"
        assert "solution" in solution.metadata.get("tags", []), name
        assert f'check("{name}"' in solution.source, name
        said = "".join(output.get("text", "") for output in solution.outputs)
        assert said.rstrip().endswith(f"{name}: right"), name
        words = said.rsplit(f"{name}: right", 1)[0]
        assert len(re.findall(r"[A-Za-z]{2,}", words)) >= 8, f"{name}: no answer in words"


def test_the_form_of_an_exercise_is_read():
    cells = [
        nbformat.v4.new_markdown_cell("### Exercise 4.12 ★★ (90 min): A title\n\nThe question."),
        nbformat.v4.new_code_cell('check("4.12", 1)', metadata={"tags": ["solution"]}),
    ]
    ((name, stars, minutes, title, text, solution),) = stated(cells)
    assert (name, stars, minutes, title) == ("4.12", "★★", 90, "A title")
    assert "The question." in text
    assert solution is cells[1]
