"""Checks of what a user hands in: each failure is one line that can be acted on."""

import math
from numbers import Integral, Real


class ParameterError(ValueError):
    """A parameter is not usable; the message names it, its value and what is allowed."""

    def __init__(self, name, value, allowed):
        super().__init__(f"{name} = {value!r}: {allowed}")


def integer(name, value, *, at_least, at_most=None):
    """Return `value` as an int within the stated bounds, else raise `ParameterError`."""
    allowed = f"must be an integer of at least {at_least}"
    if at_most is not None:
        allowed += f" and at most {at_most}"
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    if not whole or value < at_least or (at_most is not None and value > at_most):
        raise ParameterError(name, value, allowed)
    return int(value)


def number(name, value, *, above=-math.inf, at_least=-math.inf, below=math.inf, at_most=math.inf):
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
    real = isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
    if not real or not (above < value < below and at_least <= value <= at_most):
        raise ParameterError(name, value, allowed)
    return float(value)


def choice(name, value, allowed):
    """Return `value` if it is one of `allowed`, else raise `ParameterError`."""
    options = list(allowed)
    if value not in options:
        raise ParameterError(name, value, "must be one of " + ", ".join(map(repr, options)))
    return value
