"""Run notebooks strictly, publish their results as a whole, and compare them later."""

from seanav.runner.check import check
from seanav.runner.checkout import (
    Refused,
    claims,
    declare,
    lessons,
    manifest,
    notebook,
    papers,
    parameters_cell,
)
from seanav.runner.confirm import confirm
from seanav.runner.new import new
from seanav.runner.publish import dependencies, imports, mend, publish, readme, store
from seanav.runner.run import defaults, overrides, parameters, run, teach
from seanav.runner.summary import listed

__all__ = [
    "Refused",
    "check",
    "claims",
    "confirm",
    "declare",
    "defaults",
    "dependencies",
    "imports",
    "lessons",
    "listed",
    "manifest",
    "mend",
    "new",
    "notebook",
    "overrides",
    "papers",
    "parameters",
    "parameters_cell",
    "publish",
    "readme",
    "run",
    "store",
    "teach",
]
