"""A tiny notebook and a checkout of its own, for the tests of the runner."""

import shutil
from pathlib import Path

import nbformat
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

CHECKOUT = Path(__file__).resolve().parents[2]
PARAMETERS = """
runs = 20  # text
seed = 1
noise_mgal = 2.0
name = 'real'
radii = (1.0, 2.0)
quick = False
"""
STUDY = """
import attrs
from matplotlib import pyplot as plt
from seanav import checks, estimates, montecarlo
from seanav.claims import Claim, Condition
from seanav.report import Report

@attrs.frozen
class Scenario:
    runs: int
    def __attrs_post_init__(self):
        checks.integer("runs", self.runs, at_least=2)

CLAIMS = [Claim("9.1", "the mean | is positive", "section 2", "the mean is at least 0")]
scenario = Scenario(runs // 10 if quick else runs)
report = Report("9_tiny", scenario=scenario, claims=CLAIMS, seed=seed, quick=quick)
"""
REPORT = """
batches = montecarlo.parallel_map(abs, range(5), label="batches")
rmse = estimates.mean(noise_mgal + montecarlo.normals(seed, "noise", runs, ())[:])
fig, ax = plt.subplots()
ax.plot(batches)
print(f"mean {rmse.value:.3f}")
report.figure(1, fig, "A line")
"""
FINISH = """
report.table(1, ["noise", "mean"], [[noise_mgal, rmse.value]], "Means")
report.parameters([("runs", runs, "", "text")])
report.deviation("1", "noise 2", "mean", 2.0, rmse)
report.claim("9.1", [Condition("tiny", rmse, low=0.0)], "Monte Carlo")
words = dict.fromkeys(("words", "fails", "undecided", "depends", "beyond"), "Nothing.")
report.findings(holds=f"The mean is {rmse.value:.3f}.", **words)
report.finish()
"""


def cell(source, *tags):
    return new_code_cell(source.strip(), metadata={"tags": list(tags)} if tags else {})


def save(root, *cells, parameters=PARAMETERS, stem="9_tiny"):
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    seconds = {"seanav": {"expected_seconds": {"full": 4, "quick": 2}}}
    book = new_notebook(
        cells=[new_markdown_cell("# Tiny"), cell(parameters, "parameters"), *cells],
        metadata=kernel | seconds,
    )
    path = root / "notebooks" / f"{stem}.ipynb"
    path.parent.mkdir(exist_ok=True)
    nbformat.write(book, path)
    return path


def empty_checkout(root):
    without = shutil.ignore_patterns("__pycache__")
    shutil.copytree(CHECKOUT / "src", root / "src", ignore=without)
    for name in ("pyproject.toml", "requirements.lock", "Makefile"):
        shutil.copy(CHECKOUT / name, root)
    return root


def tree(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
