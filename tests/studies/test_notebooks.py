"""Every cell of a notebook runs to its end, far from the paper's settings."""

import importlib
import math

import pytest
from cells import judge, own_file, own_map

from seanav.scenario import Choice

TRACK = [(t, 4.0 * t + math.sin(7 * t), 90 * math.sin(t / 60)) for t in range(0, 400, 2)]
LOG = [(k / 10, 5 * math.sin(k / 20), 0.1, math.sin(k / 9), k % 360) for k in range(600)]
CURRENT = [(600 * k, 0.4 + 0.3 * math.sin(k / 9), 0.1 * math.cos(k / 5)) for k in range(60)]
SYSTEM = """
states = ["x"]
step = 0.1
interval = 0.5
duration = 2.0
drift.x = "-x*Abs(x)"
diffusion.x = ["0.1", "0.2"]
mean.x = 1.0
variance.x = 0.0
measurement.h = ["sqrt(1 + x**2)"]
measurement.variance = [0.01]
"""

# Every option of every choice, and lists of one entry, unsorted, and off the printed points.
CASES = {
    ("1_ito_filter", "two measurements"): {
        "interval": 20.0,
        "mission": 40.0,
        "map_noise": [1.0],
        "map_interval": [2.0],
    },
    ("1_ito_filter", "ten runs"): {
        "runs": 10,
        "particle_runs": 12,
        "map_noise": [2.0, 0.5],
        "map_interval": [1.0, 0.5],
    },
    ("1_ito_filter", "diverging"): {
        "strong_noise": 30.0,
        "filter_step": 0.25,
        "map_noise": [30.0],
        "map_interval": [0.5],
    },
    ("1_ito_filter", "own system"): {
        "sde_file": own_file("own.toml", SYSTEM, []),
        "map_noise": [1.0],
        "map_interval": [0.5],
    },
    ("2_neural_estimator", "own track"): {
        "track_file": own_file("own.csv", "time,north_m,east_m", TRACK),
        "reference_file": own_file("better.csv", "time,east_m,north_m", TRACK),
        "steps": 90,
    },
    ("3_adaptive_fading", "own log of three states"): {
        "log_file": own_file("own.csv", "time,rudder_deg,sway_m_s,yaw_rate_deg_s,heading_deg", LOG),
        "log_model": "remus",
        "log_share": 0.5,
    },
    ("3_adaptive_fading", "own log"): {
        "log_file": own_file(
            "own.csv",
            "time,rudder_deg,yaw_rate_deg_s",
            [(t, d, 0.1 * d + 0.3 * math.sin(t / 3)) for t, d, *_ in LOG],
        ),
    },
    ("4_imm_sea_current", "own current"): {
        "current_file": own_file("own.csv", "time,north_m_s,east_m_s", CURRENT),
        "current_mean": "removed",
        "sigma_true": [0.5],
    },
    ("4_imm_sea_current", "the paper's current"): {
        "current": "markov",
        "sigma_true": [0.5],
        "current_missions": 2,
    },
    ("2_neural_estimator", "short"): {
        "steps": 60,
        "settle": 5,
        "pairs": 2,
        "innovation": "printed",
        "reading": "rms",
    },
    ("2_neural_estimator", "one entry"): {
        "steps": 90,
        "hidden_sizes": [10],
        "weights": [0.5],
        "intervals": [2],
    }
    | {"turn_rates_deg_s": [0.05], "reading": "mean square", "examination_input": "estimate"},
    ("2_neural_estimator", "scikit-learn"): {"steps": 70, "learner": "MLPRegressor"},
    ("3_adaptive_fading", "two measured"): {
        "measured_steering": ["r", "psi"],
        "fault": "reversal",
        "discretisation": "exact",
    },
    ("3_adaptive_fading", "one measured"): {
        "measured_steering": ["r"],
        "measured_diving": ["z"],
        "fault": "half",
        "fin": "step",
    },
    ("3_adaptive_fading", "stuck"): {"fault": "stuck", "trigger": "trace"},
    ("3_adaptive_fading", "bias"): {"fault": "bias", "dt": 0.2, "fault_time": 30.0},
    ("4_imm_sea_current", "literal"): {
        "fading_form": "literal",
        "sigma_filter": [0.5],
        "trajectory": "circle",
        "log_axes": 3,
    },
    ("4_imm_sea_current", "literal-gain"): {
        "fading_form": "literal-gain",
        "sigma_filter": [0.5, 0.1],
        "sigma_true": [0.7, 0.3],
        "trajectory": "straight",
        "speed_kn": 0.1,
        "gyro_bias_deg_h": 1e-6,
        "initial_current": "stationary",
        "fading_cap": 1e6,
    },
    ("4_imm_sea_current", "block"): {
        "fading_form": "block",
        "sigma_filter": [0.2, 0.6, 0.9],
        "sigma_true": [1.0, 0.05, 0.5],
        "trajectory": "polygon",
        "sides": 3,
        "initial_errors": "drawn",
        "initial_tilt_rad": 0.1,
    },
    ("4_imm_sea_current", "variance"): {
        "fading_form": "variance",
        "sigma_true": [0.5],
        "trajectory": "laps",
        "laps": 2,
        "corner_radius": 100.0,
    },
    ("4_imm_sea_current", "none"): {
        "fading_form": "none",
        "duration_s": 60.0,
        "corner_radius": 60.0,
    },
    ("5_gravity_planning", "geoid elsewhere"): {
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
    ("5_gravity_planning", "synthetic"): {
        "map_source": "synthetic",
        "noise_mgal": [1.5],
        "planning_noise_mgal": 1.5,
        "initial_std_km": 0.3,
        "process_noise": 1.0,
        "window_sigmas": 2.5,
        "epsilon": 0.5,
    },
    ("5_gravity_planning", "own map"): own_map(1.0, units="mGal"),
    ("5_gravity_planning", "in mGal"): own_map(1.0) | {"map_unit": "mGal"},
    ("5_gravity_planning", "in m/s2"): own_map(1e-5)
    | {"map_unit": "m/s2", "process_noise": 0.0, "speed": 0.5},
    ("5_gravity_planning", "in µGal"): own_map(1e3, units="1e-8 m/s2") | {"map_unit": "µGal"},
    ("5_gravity_planning", "in uGal"): own_map(1e3) | {"map_unit": "uGal"},
}


@pytest.mark.parametrize(("stem", "case"), CASES)
def test_every_cell_runs(stem, case, tmp_path):
    printed = judge(stem, CASES[stem, case], tmp_path)
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
