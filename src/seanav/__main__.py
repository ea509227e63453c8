"""``python -m seanav``: list papers, run them, check their results, list their claims."""

import argparse
import re
import sys
from pathlib import Path

from seanav import runner
from seanav.report import significant


def main(arguments: list[str] | None = None) -> int:
    """Do what the command line asks; return the exit status."""
    given = _parser().parse_args(arguments)
    try:
        return given.action(given.root.resolve(), given)
    except runner.Refused as error:
        print(error, file=sys.stderr)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
    return 1


def _parser():
    checkout = Path(__file__).resolve().parents[2]
    parser = argparse.ArgumentParser(prog="python -m seanav", description=__doc__)
    parser.add_argument("--root", type=Path, default=checkout, help="the checkout")
    commands = parser.add_subparsers(required=True)

    def command(action, text):
        added = commands.add_parser(action.__name__.strip("_"), help=text)
        added.set_defaults(action=action)
        return added

    command(_list, "list the papers")
    run = command(_run, "run the notebooks")
    run.add_argument("--quick", action="store_true", help="reduced runs, below build/")
    run.add_argument("--param", nargs="*", default=[], metavar="NAME=VALUE", help="below build/")
    run.add_argument("--params", default="", metavar="TEXT", help="several NAME=VALUE in one text")
    store = command(_store, "keep the outputs of the last full runs in notebooks/")
    check = command(_check, "compare fresh results with the committed ones")
    check.add_argument("--fresh", type=Path, help="default: build/nbval")
    check.add_argument("--rtol", type=float, default=1e-6, help="default: %(default)g")
    claims = command(_claims, "list the claims and their verdicts")
    for of_papers in (run, store, claims):
        of_papers.add_argument(
            "--paper", action="append", metavar="PAPER", help="number or name; default: all"
        )
    return parser


def _list(root, given):
    for stem in runner.papers(root):
        print(stem)
    return 0


def _papers(root, given):
    return sorted({stem for pick in given.paper or [None] for stem in runner.papers(root, pick)})


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
    given.param = [*given.param, *words(given.params)]
    for stem in _papers(root, given):
        runner.run(root, stem, given.quick, tuple(given.param))
    return 0


def _store(root, given):
    for stem in _papers(root, given):
        runner.store(root, stem)
    return 0


def _check(root, given):
    wrong = runner.check(root, given.fresh or root / "build" / "nbval", given.rtol)
    print("\n".join(wrong), file=sys.stderr, end="\n" if wrong else "")
    print(f"{len(runner.papers(root))} papers checked, {len(wrong)} differences")
    return 1 if wrong else 0


def _claims(root, given):
    everything = runner.claims(root)
    for stem in _papers(root, given):
        for number, claim in everything.get(stem, {}).items():
            value = "" if claim["value"] is None else f" ({significant(claim['value'])})"
            print(f"{number} {claim['verdict']}: {claim['claim']}{value}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
