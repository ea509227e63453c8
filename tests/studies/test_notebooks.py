"""Every cell of a notebook runs to its end, far from the paper's settings."""

import importlib
import json
import re
import warnings
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from matplotlib.figure import Figure

from seanav.scenario import Choice

NOTEBOOKS = Path(__file__).resolve().parents[2] / "notebooks"

# Every option of every choice, and lists of one entry, unsorted, and off the printed points.
ITO = {"runs": 4, "particle_runs": 2, "particles": 50, "mission": 4.0}
IMM = {"runs": 2, "duration_s": 600.0}
NEURAL = {"runs": 4, "max_epochs": 20, "hidden": 10, "hidden_sizes": [10, 5], "w1": 0.3}
FADING = {"runs": 4, "settings": 6, "sweep_runs": 4}
GRAVITY = {"runs": 4, "samples": 12, "pairs": 2, "label_pairs": 2, "bound_expansions": 20}
GRAVITY |= {"epsilon": 2.0, "noise_mgal": [2.0], "start_1": [58, 22], "start_2": [52, 16]}


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


CASES = {
    ("1_ito_filter", "two measurements"): ITO
    | {"interval": 20.0, "mission": 40.0, "map_noise": [1.0], "map_interval": [2.0]},
    ("1_ito_filter", "ten runs"): ITO
    | {"runs": 10, "particle_runs": 12, "map_noise": [2.0, 0.5], "map_interval": [1.0, 0.5]},
    ("1_ito_filter", "diverging"): ITO
    | {"strong_noise": 30.0, "filter_step": 0.25, "map_noise": [30.0], "map_interval": [0.5]},
    ("2_neural_estimator", "short"): NEURAL
    | {"steps": 60, "settle": 5, "pairs": 2, "innovation": "printed", "reading": "rms"},
    ("2_neural_estimator", "one entry"): NEURAL
    | {"steps": 90, "hidden_sizes": [10], "weights": [0.5], "intervals": [2]}
    | {"turn_rates_deg_s": [0.05], "reading": "mean square", "examination_input": "estimate"},
    ("2_neural_estimator", "scikit-learn"): NEURAL | {"steps": 70, "learner": "MLPRegressor"},
    ("3_adaptive_fading", "two measured"): FADING
    | {"measured_steering": ["r", "psi"], "fault": "reversal", "discretisation": "exact"},
    ("3_adaptive_fading", "one measured"): FADING
    | {"measured_steering": ["r"], "measured_diving": ["z"], "fault": "half", "fin": "step"},
    ("3_adaptive_fading", "stuck"): FADING | {"fault": "stuck", "trigger": "trace"},
    ("3_adaptive_fading", "bias"): FADING | {"fault": "bias", "dt": 0.2, "fault_time": 30.0},
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
    ("5_gravity_planning", "geoid elsewhere"): GRAVITY
    | {
        "map_latitude_deg": 30.5,
        "map_longitude_deg": 140.2,
        "start_1": [2, 3],
        "start_2": [4, 9],
        "goal": [18, 2],
        "fan_1_km": [-30.0],
        "fan_2_km": [60.0],  # leaves the map
        "user_path_km": [[2, 3], [50, 80], [95, 3]],
        "noise_mgal": [3.0, 0.7],
        "planning_noise_mgal": 0.7,
    },
    ("5_gravity_planning", "synthetic"): GRAVITY
    | {
        "map_source": "synthetic",
        "noise_mgal": [1.5],
        "planning_noise_mgal": 1.5,
        "initial_std_km": 0.3,
        "process_noise": 1.0,
        "window_sigmas": 2.5,
        "epsilon": 0.5,
    },
    ("5_gravity_planning", "own map"): GRAVITY | own_map(1.0, units="mGal"),
    ("5_gravity_planning", "in mGal"): GRAVITY | own_map(1.0) | {"map_unit": "mGal"},
    ("5_gravity_planning", "in m/s2"): GRAVITY
    | own_map(1e-5)
    | {"map_unit": "m/s2", "process_noise": 0.0, "speed": 0.5},
    ("5_gravity_planning", "in µGal"): GRAVITY
    | own_map(1e3, units="1e-8 m/s2")
    | {"map_unit": "µGal"},
    ("5_gravity_planning", "in uGal"): GRAVITY | own_map(1e3) | {"map_unit": "uGal"},
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
                for name, value in CASES[stem, case].items():
                    names[name] = value(tmp_path) if callable(value) else value
    printed = capsys.readouterr().out
    assert not re.search(r"\b(nan|inf)\b", printed), printed
    claims = json.loads((tmp_path / stem / "claims.json").read_text("utf-8"))
    for claim in claims.values():
        if claim["verdict"] == "cannot be tested":
            why = " ".join([claim["basis"], *(c["aside"] for c in claim["conditions"])])
            assert re.search("was not run|diverged|never falls|nothing of what", why), claim
    if case.startswith("literal"):
        assert "diverged" in printed


@pytest.mark.parametrize("stem", sorted({stem for stem, _ in CASES}))
def test_every_option_of_every_choice_has_a_case(stem):
    study = importlib.import_module(f"seanav.studies.{stem.partition('_')[2]}.scenario")
    cases = [case for (of, _), case in CASES.items() if of == stem]
    for name, (default, about) in study.Scenario.declared().items():
        if isinstance(about.kind, Choice):
            run = {default, *(case[name] for case in cases if name in case)}
            assert run == set(about.kind.options), name
