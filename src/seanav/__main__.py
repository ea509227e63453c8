"""``python -m seanav``: list papers, run them, check their results, list their claims."""

import sys
from typing import Any

from seanav import _process

if __name__ == "__main__":
    _process.install()  # before anything slow: an end may come while libraries are loaded

import argparse
import importlib
import re
from pathlib import Path

from seanav import runner
from seanav.claims import VERDICTS


def main(arguments: list[str] | None = None) -> int:
    """Do what the command line asks; return the exit status."""
    given = _parser().parse_args(arguments)
    try:
        return given.action(given.root.resolve(), given)
    except (runner.Refused, OSError) as error:
        print(error, file=sys.stderr)
    return 1


class _Once(argparse.Action):
    """An option that must not be given twice: the first one would be lost without a word."""

    def __call__(self, parser: Any, given: Any, value: Any, name: Any = None) -> None:
        if getattr(given, self.dest) is not self.default:
            parser.error(f"{name} is given twice")
        setattr(given, self.dest, value)


def _parser():
    checkout = Path(__file__).resolve().parents[2]
    parser = argparse.ArgumentParser(prog="python -m seanav", description=__doc__)
    parser.add_argument("--root", action=_Once, type=Path, default=checkout, help="the checkout")
    commands = parser.add_subparsers(required=True)

    def command(action, text):
        added = commands.add_parser(action.__name__.strip("_"), help=text)
        added.set_defaults(action=action)
        return added

    several = {"nargs": "+", "action": "extend", "default": []}
    command(_list, "list the papers")
    run = command(_run, "run the notebooks")
    run.add_argument("--quick", action="store_true", help="reduced runs, below build/")
    run.add_argument("--param", **several, metavar="NAME=VALUE", help="below build/")
    run.add_argument(
        "--params", action=_Once, default="", metavar="TEXT", help="several NAME=VALUE in one text"
    )
    store = command(_store, "keep the outputs of the last full runs in notebooks/")
    command(_lessons, "run the lessons and keep their outputs in notebooks/")
    check = command(_check, "compare fresh results with the committed ones")
    check.add_argument("--fresh", action=_Once, type=Path, help="default: build/nbval")
    check.add_argument("--rtol", action=_Once, type=float, default=1e-6, help="%(default)g")
    cells = command(_cells, "write the parameters cells as src/seanav/studies/ declares them")
    claims = command(_claims, "list the claims and their verdicts")
    claims.add_argument("--verdict", **several, choices=VERDICTS, help="only these")
    confirm = command(_confirm, "judge all claims again with another seed")
    confirm.add_argument("--seed", action=_Once, type=int, required=True)
    new = command(_new, "lay out notebook, study and tests of a new paper")
    new.add_argument("stem", help="its number and name, such as 6_wave_filter")
    for of_papers in (run, store, cells, claims, confirm):
        of_papers.add_argument("--paper", **several, help="numbers or names; default: all")
    return parser


def _list(root, given):
    for stem in runner.papers(root):
        print(stem)
    return 0


def words(text: str) -> list[str]:
    """Return the parameters in `text`, each ``name=value``; a value may hold blanks and quotes.

    A blank separates where ``name=`` follows; quotes around a whole text value fall away.
    """
    found = []
    for part in filter(None, re.split(r"\s+(?=[^\W\d]\w*\s*=(?!=))", text.strip())):
        name, equals, value = map(str.strip, part.partition("="))
        if re.fullmatch(r"""'[^']*'|"[^"]*\"""", value):
            value = value[1:-1]
        found.append(f"{name}{equals}{value}")
    return found


def _run(root, given):
    stems, chosen = runner.papers(root, given.paper), (*given.param, *words(given.params))
    for stem in stems:  # all of them, before the first one runs
        runner.parameters(root, stem, given.quick, chosen)
    for stem in stems:
        runner.run(root, stem, given.quick, chosen)
    return 0


def _store(root, given):
    for stem in runner.papers(root, given.paper):
        if warned := runner.store(root, stem):
            print(f"{stem}: stderr of cells {warned} is not stored", file=sys.stderr)
    if runner.readme(root):
        print("README.md: new table of claims")
    return 0


def _lessons(root, given):
    for stem in runner.lessons(root):
        if warned := runner.teach(root, stem):
            print(f"{stem}: stderr of cells {warned} is not stored", file=sys.stderr)
    return 0


def _check(root, given):
    wrong = runner.check(root, given.fresh or root / "build" / "nbval", given.rtol)
    print("\n".join(wrong), file=sys.stderr, end="\n" if wrong else "")
    print(f"{len(runner.papers(root))} papers checked, {len(wrong)} differences")
    return 1 if wrong else 0


def _cells(root, given):
    for stem in runner.papers(root, given.paper):
        name = stem.partition("_")[2]
        scenario = importlib.import_module(f"seanav.studies.{name}.scenario").Scenario
        if runner.declare(root, stem, scenario.cell()):
            print(f"notebooks/{stem}.ipynb: new parameters cell")
    return 0


def _new(root, given):
    for path in runner.new(root, given.stem):
        print(path.relative_to(root))
    return 0


def _claims(root, given):
    everything = runner.claims(root)
    for stem in runner.papers(root, given.paper):
        print(*runner.listed(everything.get(stem, {}), given.verdict), sep="\n")
    return 0


def _confirm(root, given):
    changed = runner.confirm(root, given.seed, runner.papers(root, given.paper))
    for row in changed:
        print(f"{row['claim']} {row['condition']}: {row['outcome']}, then {row['again']}")
    print(f"{len(changed)} conditions changed; make figures counts them as undecided")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    finally:
        _process.finished()
