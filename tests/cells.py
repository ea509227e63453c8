"""All cells of a notebook with other parameters, in this process and with coarse pictures."""

import ast
import io
import json
import os
import random
import re
import warnings
from contextlib import redirect_stdout
from functools import cache
from pathlib import Path
from unittest import mock

import netCDF4
import numpy as np
from bounded import limit
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from seanav.checks import ParameterError
from seanav.report import Report

NOTEBOOKS = Path(__file__).resolve().parents[1] / "notebooks"
SECONDS = 600  # of one notebook on a busy machine; on a quiet one it takes about ten

# Few runs, short missions, short searches.
SMALL = {
    "1_ito_filter": {"runs": 4, "particle_runs": 2, "particles": 50, "mission": 4.0},
    "2_neural_estimator": {"runs": 4, "max_epochs": 20, "hidden": 10, "hidden_sizes": [10, 5]},
    "3_adaptive_fading": {"runs": 4, "settings": 6, "sweep_runs": 4},
    "4_imm_sea_current": {"runs": 2, "duration_s": 600.0},
    "5_gravity_planning": {"runs": 4, "samples": 12, "pairs": 2, "label_pairs": 2}
    | {"bound_expansions": 20, "epsilon": 2.0, "noise_mgal": [2.0]}
    | {"start_1": [58, 22], "start_2": [52, 16]},
}


def own_map(per_mgal, **attributes):
    """Return what writes a grid around the default window: latitudes fall, holes lie beside it."""

    def write(folder):
        latitude, longitude = 19.6 - np.arange(81) / 50, 127.2 + np.arange(81) / 50
        waves = np.add.outer(np.sin(latitude * 30), np.cos(longitude * 40))
        with netCDF4.Dataset(folder / "own.nc", "w") as file:
            for name, axis in (("lat", latitude), ("lon", longitude)):
                file.createDimension(name, len(axis))
                file.createVariable(name, "f8", (name,))[:] = axis
            for name in ("error", "anomaly"):
                grid = file.createVariable(name, "i4", ("lat", "lon"), fill_value=-999_999)
                grid.setncatts({"scale_factor": 1e-3 * per_mgal, "add_offset": 0.0} | attributes)
                grid[:] = np.ma.masked_array(20 * per_mgal * waves, np.indices(waves.shape)[0] < 2)
        return str(folder / "own.nc")

    return {"map_source": write, "map_variable": "anomaly"}


def own_file(name, header, rows):
    """Return what writes a table of a user's, or any text if there are no rows."""

    def write(folder):
        lines = [",".join(f"{x:.12g}" for x in row) for row in rows]
        (folder / name).write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
        return str(folder / name)

    return write


@cache
def code(stem):
    """Return (source, hidden) of a notebook's cells.

    If no parameter reaches a cell, as where equations are derived, `hidden` are the names that
    parameters do reach: it runs without them, once for all sets. Otherwise it is None.
    """
    text = (NOTEBOOKS / f"{stem}.ipynb").read_text("utf-8")
    found, reached = [], set()
    for cell in json.loads(text)["cells"]:
        if cell["cell_type"] == "code":
            source = "".join(cell["source"])
            uses, makes, imports = _names(source)
            # The first two cells are the parameters and what reads them.
            apart = len(found) >= 2 and not (imports or uses & reached)
            found.append((source, frozenset(reached) if apart else None))
            reached = reached - makes if apart else reached | makes
    return found


def _names(source):
    """Return the names that a cell takes from others, those that it makes, and its imports."""
    nodes = list(ast.walk(ast.parse(source)))
    named = [node for node in nodes if isinstance(node, ast.Name)]
    makes = {node.id for node in named if isinstance(node.ctx, ast.Store)}
    makes |= {node.name for node in nodes if isinstance(node, ast.FunctionDef)}
    imports = [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)]
    return {node.id for node in named} - makes, makes, imports


_ONCE = {}  # source: (what it prints, what it makes) of cells that no parameter reaches


def run_cell(source, hidden, names):
    """Run a cell of `code`, or give what it printed and made when it ran for another set."""
    if hidden is None:
        exec(source, names)
        return
    if source not in _ONCE:
        before = {name: x for name, x in names.items() if name not in hidden}
        after, printed = dict(before), io.StringIO()
        with redirect_stdout(printed):
            exec(source, after)
        made = {name: x for name, x in after.items() if before.get(name, _ONCE) is not x}
        _ONCE[source] = printed.getvalue(), made
    printed, made = _ONCE[source]
    print(printed, end="")
    names.update(made)


def some_pictures(changes, share):
    """Return `Report.figure` that draws a share of the pictures, others for other changes."""
    plain = {name: value for name, value in changes.items() if not callable(value)}
    chance, whole = random.Random(repr(plain)), Report.figure

    def figure(self, number, fig, caption):
        if chance.random() < share:
            return whole(self, number, fig, caption)
        plt.close(fig)
        self._new("figure", number, ".png").touch()
        print(f"Figure {number}. {caption}")
        return None

    return mock.patch.object(Report, "figure", figure)


def execute(stem, changes, folder, pictures=1.0):
    """Run every cell and return what was printed; `pictures` is the share that is drawn.

    Raises
    ------
    seanav.checks.ParameterError
        From the cell after the parameters only; a later cell must refuse nothing.
    """
    cells = code(stem)
    names, printed, save = {"__name__": "notebook"}, io.StringIO(), Figure.savefig

    def coarse(figure, file, **options):
        if options.get("format") == "png":
            save(figure, file, **{**options, "dpi": 20})

    with (
        mock.patch.dict(os.environ, SEANAV_RESULTS=str(folder)),
        mock.patch.object(Figure, "savefig", coarse),
        some_pictures(changes, pictures),
        redirect_stdout(printed),
        limit(SECONDS),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("error")  # what a cell writes to stderr
        exec(cells[0][0], names)
        for name, value in (SMALL[stem] | changes).items():
            names[name] = value(folder) if callable(value) else value
        exec(cells[1][0], names)
        for number, cell in enumerate(cells[2:], 3):
            try:
                run_cell(*cell, names)
            except Exception as error:
                raise AssertionError(f"cell {number}: {type(error).__name__}: {error}") from error
    return printed.getvalue()


def judge(stem, changes, folder, pictures=1.0):
    """Run every cell; see that nothing is without a number unless it says why; return the text."""
    printed = execute(stem, changes, folder, pictures)
    assert not re.search(r"\b(nan|inf)\b", printed), printed
    claims = json.loads((folder / stem / "claims.json").read_text("utf-8"))
    for claim in claims.values():
        if claim["verdict"] == "cannot be tested":
            why = " ".join([claim["basis"], *(c["aside"] for c in claim["conditions"])])
            assert re.search(
                "was not run|diverged|never falls|nothing of what|is not named", why
            ), claim
    return printed


def refusal(stem, changes, folder):
    """Return why a notebook's first cell refuses `changes`, or "" if all cells ran.

    A third of the pictures is drawn: they take most of the time.
    """
    try:
        judge(stem, changes, folder, pictures=1 / 3)
    except ParameterError as error:
        said = str(error)
        assert "\n" not in said
        assert len(said) < 400
        return said
    return ""
