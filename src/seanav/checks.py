"""Checks of what a user hands in: each failure is one line that can be acted on."""

import math
from collections.abc import Iterable
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike


class ParameterError(ValueError):
    """A parameter is not usable; the message names it, its value and what is allowed."""

    def __init__(self, name, value, allowed):
        super().__init__(f"{name} = {_short(value)}: {allowed}")
        self.name, self.value, self.allowed = name, value, allowed

    def __reduce__(self):
        # As it was raised, also when it comes from another process.
        return type(self), (self.name, self.value, self.allowed)


def integer(name: str, value: Any, *, at_least: int, at_most: int | None = None) -> int:
    """Return `value` as an int within the stated bounds, else raise `ParameterError`."""
    allowed = f"must be an integer of at least {at_least}"
    if at_most is not None:
        allowed += f" and at most {at_most}"
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    if not whole or value < at_least or (at_most is not None and value > at_most):
        raise ParameterError(name, value, allowed)
    return int(value)


def number(
    name: str,
    value: Any,
    *,
    above: float = -math.inf,
    at_least: float = -math.inf,
    below: float = math.inf,
    at_most: float = math.inf,
) -> float:
    """Return `value` as a finite float within the stated bounds, else raise `ParameterError`."""
    bounds = [
        f"{word} {bound:g}"
        for word, bound in (
            ("above", above),
            ("at least", at_least),
            ("below", below),
            ("at most", at_most),
        )
        if math.isfinite(bound)
    ]
    allowed = " ".join(["must be a finite number", " and ".join(bounds)]).strip()
    real = isinstance(value, Real) and not isinstance(value, bool) and _finite(value)
    if not real or not (above < value < below and at_least <= value <= at_most):
        raise ParameterError(name, value, allowed)
    return float(value)


def parts(name: str, part: float, whole_name: str, whole: float, *, at_most: int = 100_000) -> int:
    """Return how many times the time `part` fits into `whole`, else raise `ParameterError`.

    It must fit evenly: what a rounded number of steps reaches is not the time that labels
    it. `at_most` bounds the work before it starts.

    Examples
    --------
    >>> parts("step", 0.02, "interval", 0.5)
    25
    >>> parts("step", 0.02, "interval", 0.25)
    Traceback (most recent call last):
    seanav.checks.ParameterError: step = 0.02: must divide interval = 0.25 evenly
    """
    part, whole = number(name, part, above=0), number(whole_name, whole, above=0)
    count = whole / part
    if count > at_most:
        allowed = f"must cut {whole_name} = {whole:g} into at most {at_most} parts"
        raise ParameterError(name, part, allowed)
    if round(count) < 1 or abs(count - round(count)) > 1e-9 * count:
        raise ParameterError(name, part, f"must divide {whole_name} = {whole:g} evenly")
    return round(count)


def _finite(value):
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond the range of a float
        return False


def choice(name: str, value: Any, allowed: Iterable) -> Any:
    """Return `value` if it is one of `allowed`, else raise `ParameterError`."""
    options = list(allowed)
    # Python calls True and 1 equal; a user who says one does not mean the other.
    same = [
        option
        for option in options
        if isinstance(value, (str, Real)) and isinstance(value, bool) == isinstance(option, bool)
        if value == option
    ]
    if not same:
        raise ParameterError(name, value, "must be one of " + ", ".join(map(repr, options)))
    return same[0]


def array(
    name: str,
    value: Any,
    shape: tuple,
    sizes: dict | None = None,
    *,
    at_least: float = -math.inf,
    at_most: float = math.inf,
    also: float = math.nan,
    contiguous: bool = True,
) -> np.ndarray:
    """Return `value` as a finite, C-contiguous float array of the wanted shape.

    Parameters
    ----------
    shape : tuple of int, str and ...
        Wanted length of each axis; a word stands for any length of at least 1, and ``...``
        for any number of axes of any length.
    sizes : dict, optional
        Length of each word so far: it grows, and the same word, or ``...``, must mean the
        same in every array that is checked with it.
    at_least, at_most : float
        Bounds of every entry.
    also : float
        An infinity that has a meaning and is allowed.
    contiguous : bool
        False: the order in memory does not matter, and an array of floats is not copied.

    Raises
    ------
    ParameterError
        If it is no such array of real numbers.

    Examples
    --------
    >>> sizes = {}
    >>> mean = array("mean", [[0, 1]], ("runs", 2), sizes)
    >>> array("P", np.eye(2), ("runs", 2, 2), sizes)
    Traceback (most recent call last):
    seanav.checks.ParameterError: P = (2, 2): must have the shape (1, 2, 2) (runs, 2, 2)
    """
    try:
        found = np.asarray(value)
        if found.dtype.kind not in "iuf" or np.ma.is_masked(value):
            raise TypeError
        found = np.asarray(found, dtype=float, order="C" if contiguous else None)
    except (TypeError, ValueError):
        raise ParameterError(name, value, "must be an array of real numbers") from None
    _demand_shape(name, found.shape, shape, {} if sizes is None else sizes)
    usable = np.isfinite(found)
    if not math.isnan(also):
        usable |= found == also
    if not usable.all():
        place = tuple(int(i) for i in np.argwhere(~usable)[0])
        at = f" at {place}" if place else ""
        raise ParameterError(name, float(found[place]), f"must be finite everywhere, is not{at}")
    if at_least > -math.inf and found.size and found.min() < at_least:
        allowed = f"must be at least {at_least:g} everywhere"
        raise ParameterError(name, float(found.min()), allowed)
    if at_most < math.inf and found.size and found.max() > at_most:
        raise ParameterError(name, float(found.max()), f"must be at most {at_most:g} everywhere")
    return found


def dimensions(value: Any) -> int:
    """Return the number of axes of `value` as an array; 0 for ragged lists."""
    try:
        return np.ndim(value)
    except ValueError:
        return 0


def in_place(name: str, value: Any, shape: tuple, sizes: dict | None = None) -> np.ndarray:
    """Return `value`, an array that a kernel will change in place, after the checks of `array`.

    Raises
    ------
    ParameterError
        As `array`, and if it is not a writable, C-contiguous float64 array: a copy would
        take the result in its place.
    """
    array(name, value, shape, sizes)
    usable = isinstance(value, np.ndarray) and value.dtype == np.float64
    if not (usable and value.flags.c_contiguous and value.flags.writeable):
        kind = f"{type(value).__name__} of {getattr(value, 'dtype', 'objects')}"
        allowed = "must be a writable, C-contiguous array of float64: it is changed in place"
        raise ParameterError(name, kind, allowed)
    return value


def read_only(*arrays: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the arrays, locked: what is kept for later callers may not be written to."""
    for locked in arrays:
        locked.flags.writeable = False
    return arrays


def covariance(name: str, value: ArrayLike, size: int, *, definite: bool = False) -> np.ndarray:
    """Return a checked covariance matrix (size, size), else raise `ParameterError`."""
    matrix = array(name, value, (size, size))
    kind = "positive definite" if definite else "positive semidefinite"
    scale = np.sqrt(np.abs(np.diagonal(matrix)))
    # Relative to each state's own spread: units must not decide what counts as zero.
    with np.errstate(divide="ignore"):  # a state without variance that has a covariance
        unit = np.divide(matrix, np.outer(scale, scale), np.zeros_like(matrix), where=matrix != 0)
    usable = np.isfinite(unit).all() and np.abs(unit - unit.T).max() <= 1e-12
    if not usable or np.linalg.eigvalsh(unit).min() < (1e-14 if definite else -1e-12):
        raise ParameterError(name, matrix.tolist(), f"must be symmetric and {kind}")
    return matrix


def markov_chain(transition: ArrayLike, initial: tuple[float, ...]) -> tuple[tuple, tuple]:
    """Return a Markov chain as tuples of floats: transition matrix and first probabilities.

    Raises
    ------
    ParameterError
        If the rows of the square `transition` are no distributions, or `initial` is not
        one over the same states.
    """
    sizes = {}
    T = array("transition", transition, ("models", "models"), sizes)
    if (T < 0).any() or not np.allclose(T.sum(axis=1), 1, rtol=0, atol=1e-9):
        allowed = "must be a square matrix of probabilities whose rows sum to one"
        raise ParameterError("transition", transition, allowed)
    mu = array("initial_probabilities", initial, ("models",), sizes)
    if (mu < 0).any() or abs(mu.sum() - 1) > 1e-9:
        allowed = f"must be {len(T)} probabilities that sum to one"
        raise ParameterError("initial_probabilities", initial, allowed)
    return tuple(map(tuple, T.tolist())), tuple(mu.tolist())


def _demand_shape(name, found, wanted, sizes):
    if ... in wanted:
        at, more = wanted.index(...), len(found) - len(wanted) + 1
        rest = sizes.setdefault(..., found[at : at + more]) if more >= 0 else ()
        wanted = (*wanted[:at], *rest, *wanted[at + 1 :])
    fits = len(found) == len(wanted)
    if fits:
        for length, axis in zip(found, wanted, strict=True):
            if isinstance(axis, str):
                axis = sizes.setdefault(axis, length) if length else 1
            fits = fits and length == axis
    if not fits:
        numbers = tuple(sizes.get(a, a) if isinstance(a, str) else a for a in wanted)
        shown = f"must have the shape {_tuple(numbers)}"
        if numbers != tuple(wanted):
            shown += f" {_tuple(wanted)}"
        raise ParameterError(name, found, shown)


def _tuple(entries: Iterable) -> str:
    words = [str(entry) for entry in entries]
    return f"({words[0]},)" if len(words) == 1 else f"({', '.join(words)})"


def _short(value: Any) -> str:
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # Python prints no integer of more than some thousand digits
        return "a number of too many digits"
    return text if len(text) <= 100 else f"{text[:97]}..."
