"""The picture behind every notebook's sliders is drawn wherever they can be put.

Where that is, is read from the notebooks: the cell that calls `lesson.explore`, and the lines
that it needs from the cells before it.
"""

import ast
import itertools
import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot as plt

from seanav import lesson

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "notebooks").glob("[0-9]_*.ipynb"))


def calls(statement):
    """Tell whether a statement calls `lesson.explore`."""
    return any(
        isinstance(node, ast.Call) and ast.unparse(node.func) == "lesson.explore"
        for node in ast.walk(statement)
    )


def names(statement):
    """Return the names that a statement makes, and those that it takes from others."""
    makes, takes, inner = set(), set(), set()
    for node in ast.walk(statement):
        if isinstance(node, ast.Name):
            (takes if isinstance(node.ctx, ast.Load) else makes).add(node.id)
        elif isinstance(node, ast.arg):
            inner.add(node.arg)
        elif isinstance(node, ast.comprehension):
            inner |= {one.id for one in ast.walk(node.target) if isinstance(one, ast.Name)}
        elif isinstance(node, ast.Import | ast.ImportFrom):
            makes |= {(one.asname or one.name).split(".")[0] for one in node.names}
    if isinstance(statement, ast.FunctionDef):
        return {statement.name}, takes - makes - inner
    return makes - inner, takes - inner


def needed(notebook):
    """Return the statements that the sliders need, in order; the cell of parameters is first."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    sources = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    parameters, *statements = [ast.parse(source).body for source in sources]
    statements = [one for cell in statements for one in cell]
    (last,) = [number for number, one in enumerate(statements) if calls(one)]
    kept, wanted = [statements[last]], names(statements[last])[1]
    for statement in reversed(statements[:last]):
        makes, takes = names(statement)
        if makes & wanted:
            kept.insert(0, statement)
            wanted |= takes
    return [*parameters, *kept]


@pytest.fixture
def explored(monkeypatch):
    """Return what gives a notebook's picture and its controls."""
    handed = []

    def keep(picture, caption, **controls):
        handed.append((picture, controls))

    def read(notebook):
        monkeypatch.setattr(lesson, "explore", keep)
        module = ast.Module(needed(notebook), [])
        exec(compile(module, str(notebook), "exec"), {"__name__": "notebook"})
        (found,) = handed
        return found

    return read


def places(controls):
    """Return the first values, and all ends of the sliders with each option of the choices."""
    yield {name: one.value for name, one in controls.items()}
    sliders = {n: (c.low, c.high) for n, c in controls.items() if isinstance(c, lesson.Slider)}
    choices = {n: list(c.options) for n, c in controls.items() if isinstance(c, lesson.Choice)}
    rounds = max(map(len, choices.values()), default=1)
    for ends in itertools.product(*sliders.values()):
        for turn in range(rounds):
            options = {name: each[turn % len(each)] for name, each in choices.items()}
            yield dict(zip(sliders, ends, strict=True)) | options


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_picture_is_drawn_at_every_end_of_the_sliders(notebook, explored):
    picture, controls = explored(notebook)
    assert any(isinstance(one, lesson.Slider) for one in controls.values())
    for values in places(controls):
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # nobody reads a warning below a slider
            fig = picture(**values)
            fig.canvas.draw()
        drawn = [line for axes in fig.axes for line in axes.lines]
        assert drawn, values
        for line in drawn:
            assert np.isfinite(np.asarray(line.get_ydata(), dtype=float)).all(), values
        plt.close(fig)


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_first_values_are_places_of_the_controls(notebook, explored):
    for name, one in explored(notebook)[1].items():
        if isinstance(one, lesson.Choice):
            assert one.value in one.options, name
        else:
            assert one.low <= one.value <= one.high, name
            for end in (one.value, one.high):
                steps = (end - one.low) / one.step
                assert steps == pytest.approx(round(steps), abs=1e-9), name
