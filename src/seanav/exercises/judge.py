"""Whether an answer is right, and if not, what kind of mistake it looks like."""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import attrs
import numpy as np
import sympy as sp

# Mistakes that every number can have. The first one that fits is told.
FACTORS = {
    "The sign is wrong.": (-1.0,),
    "It is twice, or half, of what it should be.": (2.0, 0.5),
    "Look at the units: degrees or radians?": (np.degrees(1.0), np.radians(1.0)),
    "Look at the units: it is off by a power of ten.": tuple(10.0**k for k in range(-6, 7) if k),
    "Look at the units: seconds, minutes or hours?": (60.0, 1 / 60, 3600.0, 1 / 3600),
}
ROOTS = "Is it the square, or the root, of what is asked for?"


@attrs.frozen
class Exercise:
    """What is right, and which mistakes are told apart.

    Attributes
    ----------
    right : callable
        Without arguments, it returns the right answer: a number, an array, words, a set of
        words, or a SymPy expression. With `cases`, it is the function that is asked for.
    mistakes : mapping
        Hint -> callable that returns what this mistake leads to: an answer, or a list of
        answers; with `cases`, the hint's callable is a wrong function.
    rtol : float
        Relative tolerance of numbers, of the largest one of an array.
    cases : sequence of tuple
        Arguments on which a function is tried.
    """

    right: Callable
    mistakes: Mapping[str, Callable] = attrs.field(factory=dict)
    rtol: float = 1e-2
    cases: Sequence[tuple] = ()


def hint(exercise: Exercise, answer: Any) -> str:
    """Return nothing if `answer` is right, else one sentence that helps."""
    if exercise.cases:
        return _hint_of_function(exercise, answer)
    right = exercise.right()
    if wrong := unfit(right, answer):
        return wrong
    if same(right, answer, exercise.rtol):
        return ""
    for said, mistake in exercise.mistakes.items():
        made = mistake()
        for one in made if isinstance(made, list) else [made]:
            if same(one, answer, exercise.rtol):
                return said
    return next(_general(right, answer, exercise.rtol), "Go through the steps once more.")


def _hint_of_function(exercise, answer):
    if not callable(answer):
        return "Hand in the function itself, without calling it."
    said = ""
    for case in exercise.cases:
        try:
            given = answer(*_copied(case))
        except Exception as error:
            return f"On a test case it raised {type(error).__name__}: {error}"
        right = exercise.right(*_copied(case))
        if wrong := unfit(right, given):
            return f"What it returns on a test case does not fit. {wrong}"
        if said or same(right, given, exercise.rtol):
            continue
        said = "On a test case it returns other numbers. Go through the steps once more."
        for words, mistake in exercise.mistakes.items():
            if same(mistake(*_copied(case)), given, exercise.rtol):
                said = words
                break
    return said


def _copied(case):
    # A student's function may write into what it is given.
    return [x.copy() if isinstance(x, np.ndarray) else x for x in case]


def unfit(right: Any, answer: Any) -> str:
    """Return why `answer` cannot be compared with `right` at all, or nothing."""
    if isinstance(right, str):
        return "" if isinstance(answer, str) else "Hand in words, between quotation marks."
    if isinstance(right, (set, frozenset)):
        fits = isinstance(answer, (set, frozenset, list, tuple))
        return "" if fits else "Hand in a set of words, such as {'a', 'b'}."
    if isinstance(right, sp.Basic):
        try:
            sp.sympify(answer)
        except (sp.SympifyError, TypeError, SyntaxError, AttributeError):
            return "Hand in a SymPy expression."
        return ""
    if callable(answer):
        return "Hand in the number, not a function."
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            numbers = np.asarray(answer, dtype=float)
    except (TypeError, ValueError, Warning):
        return "Hand in a number." if np.ndim(right) == 0 else "Hand in an array of numbers."
    if not np.isfinite(numbers).all():
        return "There is a number in it that is not finite."
    if numbers.shape != np.shape(right):
        wanted = np.shape(right)
        text = f"an array of shape {wanted}" if wanted else "one number"
        return f"It has the shape {numbers.shape}; what is asked for is {text}."
    return ""


def same(right: Any, answer: Any, rtol: float) -> bool:
    """Return whether two answers of one kind are the same."""
    if isinstance(right, str):
        return isinstance(answer, str) and _words(right) == _words(answer)
    if isinstance(right, (set, frozenset)):
        return {_words(x) for x in right} == {_words(x) for x in answer}
    if isinstance(right, sp.Basic):
        return _equal(right, answer)
    right, answer = np.asarray(right, dtype=float), np.asarray(answer, dtype=float)
    if right.shape != answer.shape:
        return False
    return bool(np.all(np.abs(answer - right) <= rtol * np.max(np.abs(right), initial=0.0)))


def _words(text):
    return " ".join(str(text).casefold().split())


def _equal(right, answer):
    # By name: a student's symbols may carry other assumptions.
    expressions = [sp.sympify(x) for x in (right, answer)]
    if not all(isinstance(x, sp.Expr) for x in expressions):
        return False
    bare = [x.xreplace({s: sp.Symbol(s.name) for s in x.free_symbols}) for x in expressions]
    return sp.simplify(bare[0] - bare[1]) == 0


def _general(right: Any, answer: Any, rtol: float) -> Iterator[str]:
    """Yield the hints on common mistakes that fit."""
    if isinstance(right, (str, set, frozenset, sp.Basic)):
        return
    right, answer = np.asarray(right, dtype=float), np.asarray(answer, dtype=float)
    if not right.any():
        return
    for said, factors in FACTORS.items():
        if any(same(factor * right, answer, rtol) for factor in factors):
            yield said
    if same(right**2, answer, rtol) or same(np.sqrt(np.abs(right)), answer, rtol):
        yield ROOTS
    if right.ndim == 2 and same(right.T, answer, rtol):
        yield "Rows and columns are exchanged."
    if right.ndim == 1 and same(np.sort(right), np.sort(answer), rtol):
        yield "The numbers are right, their order is not."
    if right.ndim == 0 and abs(answer - right) <= 10 * rtol * abs(right):
        yield "That is close: look at what was rounded or left out."
