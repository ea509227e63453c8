"""Run notebooks strictly, publish their results as a whole, and compare them later."""

from seanav.runner.check import check
from seanav.runner.checkout import Refused, claims, manifest, notebook, papers
from seanav.runner.publish import dependencies, imports, publish, store, summary
from seanav.runner.run import defaults, overrides, run

__all__ = [
    "Refused",
    "check",
    "claims",
    "defaults",
    "dependencies",
    "imports",
    "manifest",
    "notebook",
    "overrides",
    "papers",
    "publish",
    "run",
    "store",
    "summary",
]
