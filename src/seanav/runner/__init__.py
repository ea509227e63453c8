"""Run notebooks strictly, publish their results as a whole, and compare them later."""

from seanav.runner.check import check
from seanav.runner.checkout import (
    Refused,
    claims,
    declare,
    manifest,
    notebook,
    papers,
    parameters_cell,
)
from seanav.runner.publish import dependencies, imports, mend, publish, store, summary
from seanav.runner.run import defaults, overrides, parameters, run

__all__ = [
    "Refused",
    "check",
    "claims",
    "declare",
    "defaults",
    "dependencies",
    "imports",
    "manifest",
    "mend",
    "notebook",
    "overrides",
    "papers",
    "parameters",
    "parameters_cell",
    "publish",
    "run",
    "store",
    "summary",
]
