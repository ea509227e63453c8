"""Formulas that a user hands in: read and bounded, never evaluated as a program.

`formula` takes text, a number or a SymPy expression. All three are rebuilt by the same
few operations out of numbers, declared names, + − * / and powers with a fixed exponent,
and the functions of `FUNCTIONS`; nothing else has a meaning. What the operations would
build is counted before it is built, so no formula is too long to wait for.
"""

import math
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from itertools import islice
from numbers import Rational, Real
from typing import Any

import sympy as sp

from seanav.checks import ParameterError

MAX_LENGTH = 5000  # characters of a text, parts of a SymPy expression
MAX_DEPTH = 40  # brackets, signs, powers and functions in one another
MAX_DEGREE = 20  # of all names together, and of a single power
MAX_TERMS = 500  # of the formula multiplied out
MAX_DIGITS = 60  # of a number's numerator and denominator
DIGITS = f"must not hold numbers of more than {MAX_DIGITS} digits"

FUNCTIONS = {
    "Abs": (sp.Abs, 1),
    "abs": (sp.Abs, 1),
    "sqrt": (sp.sqrt, 1),
    "exp": (sp.exp, 1),
    "log": (sp.log, 1),
    "sin": (sp.sin, 1),
    "cos": (sp.cos, 1),
    "atan2": (sp.atan2, 2),
}


class Sign(sp.Function):
    """Sign of a state; its derivative is taken as 0, which is right except at 0."""

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        """Return the derivative."""
        return sp.Integer(0)


class Magnitude(sp.Function):
    """|x| with the derivative sign(x)."""

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        """Return the derivative."""
        return Sign(self.args[0])


class SignedSquare(sp.Function):
    """x|x|, the quadratic drag law, with the derivative 2|x|."""

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        """Return the derivative."""
        return 2 * Magnitude(self.args[0])


_OWN = (Sign, Magnitude, SignedSquare)  # what a `System` holds may be handed in again
_CALLS = (*(function for function, _ in FUNCTIONS.values() if function is not sp.sqrt), *_OWN)
_CONSTANTS = (sp.NumberSymbol, *map(type, (sp.I, sp.zoo, sp.nan, sp.oo, -sp.oo)))
_TOKEN = re.compile(
    r"(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)"
    r"|(?P<name>[^\W0-9]\w*)|(?P<sign>\*\*|[-+*/(),])"
)


def symbols(name: str, names: Any) -> tuple[sp.Symbol, ...]:
    """Return real symbols of different names, given as text or list, else `ParameterError`.

    A name is what Python calls an identifier, keywords included: nothing here is a program.
    It is known by its characters as they stand; one that only looks the same is another.
    """
    if isinstance(names, str):
        found = names.replace(",", " ").split()
    elif isinstance(names, (list, tuple)):
        found = [x.name if type(x) is sp.Symbol else x for x in names]
    else:
        found = [names]
    usable = all(isinstance(x, str) and x.isidentifier() for x in found)
    if not usable or len(set(found)) < len(found):
        allowed = "must be different names, each letters and digits"
        raise ParameterError(name, [shown(x) for x in found], allowed)
    return tuple(sp.Symbol(x, real=True) for x in found)


def formula(name: str, given: Any, known: Sequence) -> sp.Expr:
    """Return the formula `given` as text, number or SymPy expression in `known` symbols.

    Text is read as Python would read it: numbers, decimals being exact fractions, names,
    ``+ - * / **``, brackets and `FUNCTIONS`. In a SymPy expression symbols are known by
    their names, whatever is assumed of them.

    Parameters
    ----------
    name : str
        What the formula is called in an error.
    given : str, real number or sympy.Expr
    known : iterable of Symbol
        Declared names.

    Raises
    ------
    ParameterError
        If it holds anything else or is larger than this module's bounds.
    """
    reader = _Reader({x.name: x for x in known})
    try:
        if isinstance(given, str):
            return reader.text(given).expression
        if isinstance(given, sp.Basic):
            return reader.tree(given, 0).expression
        return reader.number(given).expression
    except _Refused as reason:
        raise ParameterError(name, shown(given), str(reason)) from None


def number(name: str, given: Any) -> sp.Rational:
    """Return `given`, a real number or its text (also ``"1/3"``), as an exact fraction."""
    value = formula(name, given, ())
    if not value.is_Rational:
        raise ParameterError(name, shown(given), "must be a fraction or a decimal")
    return value


def shown(value: Any) -> str:
    """Return what an error message shows of something that a user handed in."""
    if isinstance(value, sp.Basic):
        # Printing would take for ever where parts are shared.
        small = len(list(islice(sp.preorder_traversal(value), 100))) < 100
        text = type(value).__name__
        if small:
            with suppress(ValueError):  # Python prints no integer of some thousand digits
                text = str(value)
    else:
        text = value if isinstance(value, str) else f"a {type(value).__name__}"
        if isinstance(value, (float, complex, bool)):
            text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


class _Refused(Exception):
    """Why a formula is not read."""


@dataclass(frozen=True)
class _Sized:
    """An expression, its number of terms when multiplied out, and its degree, from above."""

    expression: sp.Expr
    terms: int
    degree: int


class _Reader:
    def __init__(self, known):
        self.known = known
        self.parts = 0

    # ------------------------------------------------------------ operations

    def sized(self, terms, degree, build, *arguments):
        # Counted first, built afterwards.
        if degree > MAX_DEGREE:
            raise _Refused(f"must not be of a degree above {MAX_DEGREE}")
        if terms > MAX_TERMS:
            raise _Refused(f"must not have more than {MAX_TERMS} terms when multiplied out")
        value = build(*arguments)
        constants = sorted(map(str, value.atoms(*_CONSTANTS)))
        if constants:
            raise _Refused(f"must be a formula of real numbers, comes to {', '.join(constants)}")
        if not value.free_symbols:
            digits = 10**MAX_DIGITS
            if value.is_Rational:
                usable = abs(value.p) < digits and value.q < digits
            else:  # such as sqrt(2) or exp(3)
                usable = 1 < abs(value.evalf(30)) * digits < digits**2
            if not usable:
                raise _Refused(DIGITS)
        return _Sized(value, terms, degree)

    def number(self, value):
        if isinstance(value, bool) or not isinstance(value, (Real, Decimal)):
            raise _Refused("must be a formula: text, a real number or a SymPy expression")
        if isinstance(value, Rational):
            exact = Fraction(int(value.numerator), int(value.denominator))
        else:  # 0.1 means a tenth
            decimal = value if isinstance(value, Decimal) else Decimal(repr(float(value)))
            if not decimal.is_finite():
                raise _Refused("must be finite")
            if decimal and abs(decimal.adjusted()) > MAX_DIGITS:
                raise _Refused(DIGITS)
            exact = Fraction(decimal) if decimal else Fraction(0)
        return self.sized(1, 0, sp.Rational, exact.numerator, exact.denominator)

    def name(self, name):
        if name not in self.known:
            known = ", ".join(self.known) or "no name"
            raise _Refused(f"must not use {shown(name)}; known: {known}")
        return _Sized(self.known[name], 1, 1)

    def sum(self, parts):
        if len(parts) == 1:
            return parts[0]
        terms, degree = sum(x.terms for x in parts), max(x.degree for x in parts)
        return self.sized(terms, degree, sp.Add, *(x.expression for x in parts))

    def product(self, parts):
        if len(parts) == 1:
            return parts[0]
        terms, degree = math.prod(x.terms for x in parts), sum(x.degree for x in parts)
        return self.sized(terms, degree, sp.Mul, *(x.expression for x in parts))

    def power(self, base, exponent):
        power = exponent.expression
        if not power.is_Rational or power.q > 2 or abs(power) > MAX_DEGREE:
            raise _Refused(
                f"must not have a power other than a whole or half number up to {MAX_DEGREE}"
            )
        size = math.ceil(abs(power))
        terms = math.comb(base.terms + size - 1, size)
        return self.sized(terms, base.degree * size, sp.Pow, base.expression, power)

    def call(self, function, arguments):
        terms, degree = sum(x.terms for x in arguments), max(x.degree for x in arguments)
        return self.sized(terms, degree, function, *(x.expression for x in arguments))

    # ------------------------------------------------------------ SymPy

    def tree(self, node, depth):
        self.parts += 1
        if depth > MAX_DEPTH:
            raise _Refused(f"must not be nested deeper than {MAX_DEPTH}")
        if self.parts > MAX_LENGTH:
            raise _Refused(f"must not have more than {MAX_LENGTH} parts")
        if type(node) is sp.Symbol:
            return self.name(node.name)
        if isinstance(node, (sp.Rational, sp.Float)):
            return self.number(Fraction(node.p, node.q) if node.is_Rational else float(node))
        kind = node.func
        if kind not in (sp.Add, sp.Mul, sp.Pow, *_CALLS):
            raise _Refused(f"must not hold {shown(node)} ({type(node).__name__})")
        parts = [self.tree(part, depth + 1) for part in node.args]
        if kind is sp.Pow:
            return self.power(*parts)
        build = {sp.Add: self.sum, sp.Mul: self.product}.get(kind)
        return build(parts) if build else self.call(kind, parts)

    # ------------------------------------------------------------ text

    def text(self, text):
        if len(text) > MAX_LENGTH:
            raise _Refused(f"must not be longer than {MAX_LENGTH} characters")
        self.tokens, place = [], 0
        while place < len(text):
            if text[place].isspace():
                place += 1
                continue
            token = _TOKEN.match(text, place)
            if token is None:
                raise _Refused(f"must be a formula; {text[place]!r} has no meaning in one")
            self.tokens.append((token.lastgroup, token.group()))
            place = token.end()
        self.tokens.append(("end", "its end"))
        self.tokens.reverse()  # the next one is the last of the list
        value = self.read_sum(0)
        self.demand("its end")
        return value

    def accept(self, *signs):
        kind, token = self.tokens[-1]
        return self.tokens.pop()[1] if kind in ("sign", "end") and token in signs else None

    def demand(self, sign):
        if not self.accept(sign):
            raise _Refused(f"must be a formula; {shown(self.tokens[-1][1])} is unexpected")

    def read_sum(self, depth):
        parts = [self.read_product(depth)]
        while sign := self.accept("+", "-"):
            part = self.read_product(depth)
            parts.append(part if sign == "+" else self.minus(part))
        return self.sum(parts)

    def read_product(self, depth):
        parts = [self.read_factor(depth)]
        while sign := self.accept("*", "/"):
            part = self.read_factor(depth)
            parts.append(part if sign == "*" else self.power(part, self.number(-1)))
        return self.product(parts)

    def read_factor(self, depth):
        if depth > MAX_DEPTH:
            raise _Refused(f"must not be nested deeper than {MAX_DEPTH}")
        if sign := self.accept("+", "-"):
            part = self.read_factor(depth + 1)
            return part if sign == "+" else self.minus(part)
        base = self.read_atom(depth)
        if self.accept("**"):  # binds more tightly than a sign to its left, not to its right
            return self.power(base, self.read_factor(depth + 1))
        return base

    def read_atom(self, depth):
        if self.accept("("):
            value = self.read_sum(depth + 1)
            self.demand(")")
            return value
        kind, token = self.tokens[-1]
        if kind not in ("number", "name"):
            self.demand("a number, a name or (")
        self.tokens.pop()
        if kind == "number":
            if len(token) > 2 * MAX_DIGITS:
                raise _Refused(DIGITS)
            return self.number(Decimal(token))
        if token in self.known or token not in FUNCTIONS or not self.accept("("):
            return self.name(token)
        function, count = FUNCTIONS[token]
        arguments = [self.read_sum(depth + 1)]
        while self.accept(","):
            arguments.append(self.read_sum(depth + 1))
        self.demand(")")
        if len(arguments) != count:
            raise _Refused(f"must give {token} {count} argument{'s' * (count > 1)}")
        return self.call(function, arguments)

    def minus(self, part):
        return self.product([self.number(-1), part])
