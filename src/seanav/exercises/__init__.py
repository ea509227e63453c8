"""Exercises of the notebooks: hand in an answer, hear that it is right, or one hint.

>>> from seanav.exercises import check
>>> check("4.1", answer)

The questions stand in the notebooks. What is right is computed here, in one module per
notebook, when it is asked for.
"""

import re
from collections.abc import Iterable
from importlib import import_module
from typing import Any, NamedTuple

from seanav.checks import ParameterError
from seanav.exercises.judge import Exercise, hint

# By the number of the notebook.
CHAPTERS = (
    "foundations",
    "ito_filter",
    "neural_estimator",
    "adaptive_fading",
    "imm_sea_current",
    "gravity_planning",
)
# The first line of an exercise in a notebook; the cell after it is the solution.
HEADING = re.compile(r"### Exercise (\d+\.\d+) (★{1,3}) \((\d+) min\): (.+)")


class Stated(NamedTuple):
    """An exercise as it stands in a notebook: stars, minutes, question and solution cell."""

    number: str
    stars: str
    minutes: int
    title: str
    question: str
    solution: Any


def check(number: str, answer: Any) -> None:
    """Print whether `answer` to an exercise is right, or one hint if it is not.

    Parameters
    ----------
    number : str
        Number of the exercise, such as ``"4.1"``: notebook 4, exercise 1.
    answer : number, array, str, set, SymPy expression or callable
        What the exercise asks for. A wrong answer, whatever it is, raises nothing.

    Raises
    ------
    ParameterError
        If there is no such exercise.
    """
    said = hint(find(number), answer)
    print(f"{number}: not yet. {said}" if said else f"{number}: right")


def exercises(chapter: int) -> dict[str, Exercise]:
    """Return the exercises of a notebook by their number, such as ``"4.1"``."""
    return import_module(f"seanav.exercises.{CHAPTERS[chapter]}").EXERCISES


def find(number: str) -> Exercise:
    """Return the exercise of a number such as ``"4.1"``."""
    chapter = str(number).partition(".")[0]
    numbers = [str(chapter) for chapter in range(len(CHAPTERS))]
    if chapter not in numbers:
        allowed = f"must begin with the number of a notebook, {numbers[0]} to {numbers[-1]}"
        raise ParameterError("exercise", number, f'{allowed}, such as "4.1"')
    known = exercises(int(chapter))
    if str(number) not in known:
        raise ParameterError("exercise", number, f"must be one of {', '.join(known)}")
    return known[str(number)]


def stated(cells: Iterable) -> list[Stated]:
    """Return the exercises among the cells of a notebook (nbformat's), in their order."""
    cells, found = list(cells), []
    for cell, after in zip(cells, [*cells[1:], None], strict=True):
        first = cell.source.partition("\n")[0]
        if cell.cell_type == "markdown" and (line := HEADING.fullmatch(first.strip())):
            number, stars, minutes, title = line.groups()
            found.append(Stated(number, stars, int(minutes), title, cell.source, after))
    return found
