"""What a parameter is: default, unit, origin, note and bounds, declared once.

A study declares a `Scenario`: one line per parameter. From these lines come the checks,
the table of origins, the reduced run, and the parameters cell of the notebook::

    @attrs.frozen(kw_only=True)
    class Scenario(Parameters):
        runs: int = parameter(100, Integer(2), origin="text", note="missions", quick=tenth(2))
        noise: float = parameter(0.3, Number(above=0), unit="m/s", origin="assumed")

Conditions between parameters go into ``__attrs_post_init__``.
"""

import math
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sized
from pathlib import Path
from typing import Any, Self

import attrs

from seanav import checks
from seanav.checks import ParameterError

ORIGINS = {
    "text": "the paper's text or tables",
    "public source": "a published source other than the paper",
    "recalled": "from memory of the literature, found nowhere public",
    "derived": "follows from something the paper says",
    "assumed": "the paper needs it and does not give it",
    "ours": "belongs to what goes beyond the paper, or to the computation",
}
WIDTH = 100  # characters of a line in the notebook's cell

# ---------------------------------------------------------------- kinds of values


@attrs.frozen
class Integer:
    """An integer within bounds, ends included."""

    at_least: int
    at_most: int | None = None

    def __call__(self, name: str, value: Any) -> int:
        """Return the checked value."""
        return checks.integer(name, value, at_least=self.at_least, at_most=self.at_most)


@attrs.frozen(kw_only=True)
class Number:
    """A finite real number within bounds."""

    above: float = -math.inf
    at_least: float = -math.inf
    below: float = math.inf
    at_most: float = math.inf

    def __call__(self, name: str, value: Any) -> float:
        """Return the checked value."""
        return checks.number(name, value, **attrs.asdict(self))


def _tuple(values: Iterable) -> tuple:
    return tuple(values)


@attrs.frozen
class Choice:
    """One of a few values."""

    options: tuple = attrs.field(converter=_tuple)

    def __call__(self, name: str, value: Any) -> Any:
        """Return the checked value."""
        return checks.choice(name, value, self.options)


@attrs.frozen
class Text:
    """Any text, such as the name of a file."""

    def __call__(self, name: str, value: Any) -> str:
        """Return the checked value."""
        if not isinstance(value, str) or "\0" in value:
            raise ParameterError(name, value, "must be text")
        return value


@attrs.frozen
class File(Text):
    """The path of a user's own file, empty for none; results show its name alone."""


@attrs.frozen
class List:
    """A list of values of one kind; kept as a tuple.

    Attributes
    ----------
    of : callable
        Kind of the entries.
    count : int, optional
        Exact number of entries; otherwise from `at_least` to `at_most`.
    distinct : bool
        Whether an entry may stand in it only once.
    """

    of: Callable
    count: int | None = None
    at_least: int = attrs.field(default=1, kw_only=True)
    at_most: int = attrs.field(default=64, kw_only=True)
    distinct: bool = attrs.field(default=False, kw_only=True)

    def __call__(self, name: str, value: Any) -> tuple:
        """Return the checked entries."""
        usable = hasattr(value, "__iter__") and isinstance(value, Sized)
        if not usable or isinstance(value, (str, bytes, Mapping, set, frozenset)):
            raise ParameterError(name, value, f"must be a list of {self._number()}")
        low, high = (self.at_least, self.at_most) if self.count is None else (self.count,) * 2
        if not low <= len(value) <= high:
            raise ParameterError(name, value, f"must be a list of {self._number()}")
        entries = tuple(self.of(name, entry) for entry in value)
        if self.distinct and len(set(entries)) < len(entries):
            raise ParameterError(name, value, "must hold every value once")
        return entries

    def _number(self):
        if self.count is not None:
            return f"{self.count} values"
        return f"{self.at_least} to {self.at_most} values"


# ---------------------------------------------------------------- declaration


@attrs.frozen(kw_only=True)
class Declaration:
    """What stands beside a parameter's name and default."""

    kind: Callable
    unit: str
    origin: str = attrs.field(validator=attrs.validators.in_(ORIGINS))
    note: str
    quick: Callable | None


def parameter(
    default: Any,
    kind: Callable,
    *,
    origin: str,
    unit: str = "",
    note: str = "",
    quick: Callable | None = None,
) -> Any:
    """Declare one parameter of a `Parameters` class.

    Parameters
    ----------
    default
        What the paper, or we, use.
    kind : callable
        ``kind(name, value)`` returns the value to use or raises `ParameterError`:
        `Integer`, `Number`, `Choice`, `Text`, `List`, or a function of the study's own.
    origin : str
        Where the default comes from, a key of `ORIGINS`.
    unit, note : str
        For the table of origins and the notebook's cell.
    quick : callable, optional
        Value in the reduced run, from the value in the full one.
    """
    about = Declaration(kind=kind, unit=unit, origin=origin, note=note, quick=quick)
    converter = attrs.Converter(lambda value, field: kind(field.name, value), takes_field=True)
    return attrs.field(default=default, converter=converter, metadata={"declaration": about})


def tenth(at_least: int) -> Callable[[int], int]:
    """Return the usual reduction: a tenth, not below `at_least`, never more than before."""
    return lambda value: min(value, max(at_least, value // 10))


@attrs.frozen(kw_only=True)
class Parameters:
    """Base of every `Scenario`; see the module."""

    @classmethod
    def declared(cls) -> dict[str, tuple[Any, Declaration]]:
        """Return {name: (default, `Declaration`)} in the order of the declaration."""
        return {f.name: (f.default, f.metadata["declaration"]) for f in attrs.fields(cls)}

    @classmethod
    def read(cls, names: Mapping[str, Any]) -> Self:
        """Return the scenario that a notebook's parameters cell describes.

        Parameters
        ----------
        names : mapping
            ``globals()`` of the notebook: every parameter by its name, and ``quick``.

        Raises
        ------
        ParameterError
            One line that names the parameter, its value and what is allowed.
        """
        scenario = cls(**{name: names[name] for name in cls.declared()})
        quick = checks.choice("quick", names["quick"], (False, True))
        return scenario.quick() if quick else scenario

    def quick(self) -> Self:
        """Return the reduced scenario."""
        reduced = {
            name: about.quick(getattr(self, name))
            for name, (_, about) in self.declared().items()
            if about.quick
        }
        return attrs.evolve(self, **reduced)

    def origins(self) -> list[tuple]:
        """Return rows (name, value, unit, origin, note) for `seanav.report.Report.parameters`."""
        return [
            (name, _shown(getattr(self, name), about.kind), about.unit, about.origin, about.note)
            for name, (_, about) in self.declared().items()
        ]

    @classmethod
    def cell(cls) -> str:
        """Return the source of the notebook's parameters cell."""
        lines = ["# The scenario. Each line: unit and meaning; where the value comes from."]
        for name, (default, about) in cls.declared().items():
            code, comment = f"{name} = {_literal(default)}", _comment(about)
            beside = f"{code}  # {comment}"
            above = textwrap.wrap(comment, WIDTH, initial_indent="# ", subsequent_indent="# ")
            lines += [beside] if len(beside) <= WIDTH else [*above, code]
        reduced = [name for name, (_, about) in cls.declared().items() if about.quick]
        return "\n".join([*lines, f"quick = False  # True: fewer {', '.join(reduced)}"])


def _comment(about):
    options = getattr(about.kind, "options", ())
    choice = "one of " + ", ".join(map(_literal, options)) if options else ""
    meaning = ", ".join(filter(None, [about.unit, about.note, choice]))
    return f"{meaning}; {about.origin}" if meaning else about.origin


def _literal(value):
    if isinstance(value, tuple):
        return "[" + ", ".join(map(_literal, value)) + "]"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(value)


def _shown(value, kind=None):
    if isinstance(kind, File):
        return Path(value).name  # results hold no place of a machine
    return " ".join(str(_shown(entry)) for entry in value) if isinstance(value, tuple) else value
