"""All cells of a notebook with other parameters, in this process and with coarse pictures."""

import io
import json
import os
import re
import warnings
from contextlib import redirect_stdout
from pathlib import Path
from unittest import mock

import netCDF4
import numpy as np
from bounded import limit
from matplotlib.figure import Figure

from seanav.checks import ParameterError

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


def execute(stem, changes, folder):
    """Run every cell and return what was printed.

    Raises
    ------
    seanav.checks.ParameterError
        From the cell after the parameters only; a later cell must refuse nothing.
    """
    text = (NOTEBOOKS / f"{stem}.ipynb").read_text("utf-8")
    cells = [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
    names, printed, save = {"__name__": "notebook"}, io.StringIO(), Figure.savefig

    def coarse(figure, file, **options):
        if options.get("format") == "png":
            save(figure, file, **{**options, "dpi": 20})

    with (
        mock.patch.dict(os.environ, SEANAV_RESULTS=str(folder)),
        mock.patch.object(Figure, "savefig", coarse),
        redirect_stdout(printed),
        limit(SECONDS),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("error")  # what a cell writes to stderr
        exec("".join(cells[0]["source"]), names)
        for name, value in (SMALL[stem] | changes).items():
            names[name] = value(folder) if callable(value) else value
        exec("".join(cells[1]["source"]), names)
        for number, cell in enumerate(cells[2:], 3):
            try:
                exec("".join(cell["source"]), names)
            except Exception as error:
                raise AssertionError(f"cell {number}: {type(error).__name__}: {error}") from error
    return printed.getvalue()


def judge(stem, changes, folder):
    """Run every cell; see that nothing is without a number unless it says why; return the text."""
    printed = execute(stem, changes, folder)
    assert not re.search(r"\b(nan|inf)\b", printed), printed
    claims = json.loads((folder / stem / "claims.json").read_text("utf-8"))
    for claim in claims.values():
        if claim["verdict"] == "cannot be tested":
            why = " ".join([claim["basis"], *(c["aside"] for c in claim["conditions"])])
            assert re.search("was not run|diverged|never falls|nothing of what", why), claim
    return printed


def refusal(stem, changes, folder):
    """Return why a notebook's first cell refuses `changes`, or "" if all cells ran."""
    try:
        judge(stem, changes, folder)
    except ParameterError as error:
        said = str(error)
        assert "\n" not in said
        assert len(said) < 400
        return said
    return ""
