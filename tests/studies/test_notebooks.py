"""Every cell of a notebook runs to its end, far from the paper's settings."""

import importlib
import json
import re
import warnings
from pathlib import Path

import pytest
from matplotlib.figure import Figure

NOTEBOOKS = Path(__file__).resolve().parents[2] / "notebooks"

# Every option of every choice, and lists of one entry, unsorted, and off the printed points.
ITO = {"runs": 4, "particle_runs": 2, "particles": 50, "mission": 4.0}
IMM = {"runs": 2, "duration_s": 600.0}
NEURAL = {"runs": 4, "max_epochs": 20, "hidden": 10, "hidden_sizes": [10, 5], "w1": 0.3}
FADING = {"runs": 4, "settings": 6, "sweep_runs": 4}
CASES = {
    ("1_ito_filter", "two measurements"): ITO
    | {"interval": 20.0, "mission": 40.0, "map_noise": [1.0], "map_interval": [2.0]},
    ("1_ito_filter", "ten runs"): ITO
    | {"runs": 10, "particle_runs": 12, "map_noise": [2.0, 0.5], "map_interval": [1.0, 0.5]},
    ("1_ito_filter", "diverging"): ITO
    | {"strong_noise": 30.0, "filter_step": 0.25, "map_noise": [30.0], "map_interval": [0.5]},
    ("2_neural_estimator", "short"): NEURAL | {"steps": 60, "settle": 5, "pairs": 2},
    ("2_neural_estimator", "one entry"): NEURAL
    | {"steps": 90, "hidden_sizes": [10], "weights": [0.5], "intervals": [2]},
    ("3_adaptive_fading", "two measured"): FADING | {"measured_steering": ["r", "psi"]},
    ("3_adaptive_fading", "one measured"): FADING
    | {"measured_steering": ["r"], "measured_diving": ["z"]},
    ("4_imm_sea_current", "literal"): IMM
    | {"fading_form": "literal", "sigma_filter": [0.5], "trajectory": "circle", "log_axes": 3},
    ("4_imm_sea_current", "literal-gain"): IMM
    | {
        "fading_form": "literal-gain",
        "sigma_filter": [0.5, 0.1],
        "sigma_true": [0.7, 0.3],
        "trajectory": "straight",
        "initial_current": "stationary",
        "fading_cap": 1e6,
    },
    ("4_imm_sea_current", "block"): IMM
    | {
        "fading_form": "block",
        "sigma_filter": [0.2, 0.6, 0.9],
        "sigma_true": [1.0, 0.05, 0.5],
        "trajectory": "polygon",
        "sides": 3,
        "initial_errors": "drawn",
        "initial_tilt_rad": 0.1,
    },
    ("4_imm_sea_current", "variance"): IMM
    | {
        "fading_form": "variance",
        "sigma_true": [0.5],
        "trajectory": "laps",
        "laps": 2,
        "corner_radius": 100.0,
    },
    ("4_imm_sea_current", "none"): IMM
    | {"fading_form": "none", "duration_s": 60.0, "corner_radius": 60.0},
}


@pytest.mark.parametrize(("stem", "case"), CASES)
def test_every_cell_runs(stem, case, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("SEANAV_RESULTS", str(tmp_path))
    save = Figure.savefig

    def coarse(figure, file, **options):
        if options.get("format") == "png":
            save(figure, file, **{**options, "dpi": 20})

    monkeypatch.setattr(Figure, "savefig", coarse)
    names = {"__name__": "notebook"}
    text = (NOTEBOOKS / f"{stem}.ipynb").read_text("utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # what a cell writes to stderr
        for cell in (c for c in json.loads(text)["cells"] if c["cell_type"] == "code"):
            exec("".join(cell["source"]), names)
            if "parameters" in cell["metadata"].get("tags", ()):
                names |= CASES[stem, case]
    printed = capsys.readouterr().out
    assert not re.search(r"\b(nan|inf)\b", printed), printed
    claims = json.loads((tmp_path / stem / "claims.json").read_text("utf-8"))
    for claim in claims.values():
        if claim["verdict"] == "cannot be tested":
            assert re.search("was not run|diverged|never falls|nothing of what", claim["basis"])
    if case.startswith("literal"):
        assert "diverged" in printed


@pytest.mark.parametrize("stem", sorted({stem for stem, _ in CASES}))
def test_the_parameters_cell_is_the_declaration(stem):
    name = stem.partition("_")[2]
    scenario = importlib.import_module(f"seanav.studies.{name}.scenario").Scenario
    cells = json.loads((NOTEBOOKS / f"{stem}.ipynb").read_text("utf-8"))["cells"]
    (cell,) = [c for c in cells if "parameters" in c["metadata"].get("tags", ())]
    assert "".join(cell["source"]) == scenario.cell()
    assert sum("scenario = Scenario.read(globals())" in "".join(c["source"]) for c in cells) == 1
