"""Sets of parameters that every notebook must run with, or refuse in its first cell."""

import importlib
from itertools import combinations

from cells import own_map

from seanav.models.gravity.files import MAP_UNITS
from seanav.scenario import Choice

# ---------------------------------------------------------------- every pair of levels


def covering(factors):
    """Return {factor: level} rows in which each two levels of two factors meet at least once.

    Each row begins with a pair that is still missing; every further factor takes the level
    that meets the most missing pairs.
    """
    missing = {
        (one, a, other, b): None  # a dict keeps its order, on every machine
        for one, other in combinations(factors, 2)
        for a in range(len(factors[one]))
        for b in range(len(factors[other]))
    }
    order, rows = list(factors), []

    def met(row, name, level):
        found = []
        for other, chosen in row.items():
            first = order.index(other) < order.index(name)
            found.append((other, chosen, name, level) if first else (name, level, other, chosen))
        return [pair for pair in found if pair in missing]

    while missing:
        one, a, other, b = next(iter(missing))
        row = {one: a, other: b}
        for name in factors:
            if name not in row:
                most = [len(met(row, name, level)) for level in range(len(factors[name]))]
                row[name] = most.index(max(most))
        for name, level in row.items():
            for pair in met({k: v for k, v in row.items() if k != name}, name, level):
                del missing[pair]
        rows.append({name: factors[name][row[name]] for name in factors})
    return rows


# ---------------------------------------------------------------- levels that can work together

_UNITS = {"file": own_map(1.0, units="mGal")}
_UNITS |= {unit: own_map(per) for unit, per in (("mGal", 1), ("m/s2", 1e-5))}
_UNITS |= {unit: own_map(1e3) for unit in ("µGal", "uGal")}

# Beside the options of every choice. Of lists: one entry, unsorted, many; of numbers: the
# least, a usual one, a large one. A level may be several parameters at once.
LEVELS = {
    "1_ito_filter": {
        "torpedo_start": [[1.0, 0, 0, 0, 0, 0], [0.0] * 6, [-2.0, 1.0, 0.5, 0.1, -0.1, 0.2]],
        "torpedo_variance": [[0.05, 0.02, 0.02, 0.02, 0.02, 0.02], [1e-12] * 6],
        "torpedo_noise": [[0.1, 0.1, 0.1, 0.2, 0.2, 0.2], [1.0, 1, 1, 2, 2, 2], [1e-6] * 6],
        "sphere_start": [[0.3, 0.1, -0.05, 0.05, -0.05, 0.15], [0.0] * 6],
        "sphere_variance": [[0.02] * 6, [1e-12] * 6],
        "sphere_noise": [[0.03, 0.03, 0.03, 0.12, 0.12, 0.12], [1e-6] * 6, [0.3] * 3 + [1.2] * 3],
        "strong_noise": [3.0, 1e-3, 30.0, 1.0],
        "small_R": [1e-4, 1e-12, 1.0],
        "large_R": [1.0, 1e12, 1e-4],
        "interval": [0.5, 0.25, 1.0],
        "mission": [2.0, 4.0],
        "torpedo_step": [0.0125, 0.025],
        "sphere_step": [0.025, 0.05],
        "filter_step": [0.05, 0.25, 0.0125],
        "runs": [4, 2, 11],
        "particles": [50, 2],
        "particle_runs": [2, 12],
        "map_noise": [[1.0], [30.0, 0.01], [2.0, 0.5, 1.0], [0.001]],
        "map_interval": [[0.5], [1.0, 0.5], [0.25, 2.0, 0.5], [0.25]],
        "map_step": [0.01, 0.05],
        "map_R": [0.01, 1e-12, 1e12],
        "seed": [0, 2**70],
    },
    "2_neural_estimator": {
        "speed": [6.0, 0.01, 9.99],
        "heading_deg": [30.0, 0.0, -360.0],
        "steps": [70, 41, 120],
        "settle": [5, 1, 20],
        "pairs": [20, 2],
        "noise": [0.3, 1e-6, 10.0],
        "q": [0.005, 1e-12, 100.0],
        "w1": [0.3, 0.0, 1.0],
        "hidden": [10, 1],
        "rate": [0.1, 1e-6, 100.0],
        "spread": [0.5, 1e-6, 100.0],
        "delta": [0.001, 1e-12, 1.0],
        "max_epochs": [20, 1],
        "interval": [5, 1, 1000],
        "reteach_epochs": [5, 1],
        "hidden_sizes": [[10, 5], [1], [20, 2, 7]],
        "weights": [[0.3], [0.0, 1.0], [1.0, 0.0, 0.5], [0.5, 0.2, 0.9, 0.1, 0.7]],
        "intervals": [[2], [20, 5], [1000], [5, 10, 20, 1]],
        "turn_rates_deg_s": [[0.0], [90.0], [0.2, 0.0, 0.05], [0.01, 0.003, 0.1, 10.0, 0.02]],
        "runs": [4, 2],
        "seed": [0, 2**70],
    },
    "3_adaptive_fading": {
        "dt": [0.1, 0.2],
        "duration": [60.0, 100.0],
        "fault_time": [15.0, 30.0, 48.0],
        "fin_rad": [0.2, 0.0, -0.6],
        "fin_period": [20.0, 1e-3, 1e6],
        "bias_rad": [0.1, 0.0],
        "stuck_rad": [0.2, 0.0],
        "Q_steering": [[1e-5] * 3, [1e-20] * 3, [1.0, 1e-5, 1e-10]],
        "R_steering": [[1e-4] * 3, [1e6] * 3, [1e-20] * 3],
        "Q_diving": [[1e-5] * 4, [1e-20] * 4, [1e-10, 1.0, 1e-5, 1e6]],
        "R_diving": [[1e-4] * 4, [1e6] * 4, [1e-20] * 4],
        "measured_steering": [["v"], ["v", "r"], ["psi", "v"], ["v", "r", "psi"], ["r"]],
        "measured_diving": [["z"], ["theta", "w"], ["q"], ["w", "q", "theta", "z"]],
        "initial_variance": [1e-2, 1e-20, 1e6],
        "alpha": [0.05, 1e-12, 0.999],
        "window": [20, 1, 1000],
        "larger_Q": [100.0, 1.0, 1e9],
        "bias_walk_rad": [0.01, 1e-9, 10.0],
        "settings": [6, 4],
        "sweep_runs": [4, 2],
        "runs": [4, 2],
        "seed": [0, 2**70],
    },
    "4_imm_sea_current": {
        "duration_s": [300.0, 601.0],
        "speed_kn": [20.0, 15.0],
        "latitude_deg": [36.0, -80.0, 0.0],
        "longitude_deg": [127.0, 360.0, -180.0],
        "corner_radius": [60.0, 55.0],
        "sides": [4, 3, 6],
        "laps": [1, 2],
        "accelerometer_bias_mg": [0.05, 1e-6, 100.0],
        "accelerometer_noise_mg": [0.01, 1e-6, 100.0],
        "gyro_bias_deg_h": [0.02, 1e-6, 100.0],
        "gyro_noise_deg_sqrt_h": [0.005, 1e-6, 100.0],
        "log_noise": [0.01, 1e-4, 10.0],
        "correlation_time_s": [7200.0, 1.0, 1e7],
        "sigma_true": [[0.5], [1.0, 0.05, 0.5], [0.001, 10.0]],
        "sigma_filter": [[0.5], [1.0, 0.1, 0.5], [10.0, 0.001]],  # and more below, one by one
        "initial_position_m": [1.0, 1e-3, 1e4],
        "initial_velocity": [1e-3, 1e-6, 10.0],
        "initial_tilt_rad": [1e-6, 1e-9, 0.1],
        "initial_heading_rad": [1e-6, 1e-9, 0.5],
        "fading_window": [20, 2, 1000],
        "fading_cap": [10.0, 1.0, 1e6],
        "transition": [[[0.9, 0.1], [0.1, 0.9]], [[1, 0], [0, 1]], [[0, 1], [1, 0]]],
        "initial_probabilities": [[0.5, 0.5], [1.0, 0.0], [0.2, 0.8]],
        "runs": [2, 3],
        "seed": [0, 2**70],
    },
    "5_gravity_planning": {
        "map_source": [{"map_source": "geoid"}, {"map_source": "synthetic"}]
        + [_UNITS[unit] | {"map_unit": unit} for unit in MAP_UNITS],
        "start_1": [[58, 22], [70, 12], [64, 9]],
        "start_2": [[52, 16], [60, 30]],
        "goal": [[65, 9], [62, 20]],
        "fan_1_km": [[11.0], [5.5, -99.0], [500.0], [0.0], [-5.5, 11.0, 22.0, 16.5]],
        "fan_2_km": [[11.0], [-99.0, 5.5], [-500.0], [0.0], [-5.5, 11.0, 22.0, 16.5]],
        "user_path_km": [[], [[5, 5], [50, 60]], [[1, 1], [1, 1], [2.5, 2]], [[60, 5], [9, 9]] * 4],
        "noise_mgal": [[2.0], [4.0, 1e-3, 2.0], [2.0, 1e4]],
        "initial_std_km": [1.0, 1e-3, 20.0],
        "process_noise": [0.01, 0.0, 10.0],
        "speed": [5.0, 0.1, 100.0],
        "samples": [12, 10, 50],
        "window_sigmas": [1.0, 1e-3, 100.0],
        "epsilon": [2.0, 0.5, 1e6],  # and 0 below, once
        "bound_expansions": [20, 1],
        "pairs": [2, 3],
        "runs": [4, 3],
        "seed": [0, 2**70],
    },
}


def factors(stem):
    """Return {factor: levels}, each level the parameters that it sets, for `covering`."""
    study = importlib.import_module(f"seanav.studies.{stem.partition('_')[2]}.scenario")
    choices = {
        name: about.kind.options
        for name, (_, about) in study.Scenario.declared().items()
        if isinstance(about.kind, Choice) and name != "map_unit"  # it belongs to a map
    }
    return {
        name: [level if isinstance(level, dict) else {name: level} for level in levels]
        for name, levels in (choices | LEVELS[stem]).items()
    }


# ---------------------------------------------------------------- what has failed once

_THREE = {"transition": [[0.4, 0.3, 0.3]] * 3, "initial_probabilities": [0.4, 0.3, 0.3]}

RUNS = {
    "1_ito_filter": [
        {"mission": 1.0},
        {"filter_step": 0.5, "map_interval": [0.5]},
        {"torpedo_step": 0.0625},
        {"strong_noise": 30.0},
        {"strong_noise": 1e3},
        {"map_interval": [0.01], "filter_step": 0.01},
        {"torpedo_noise": [1.0, 1.0, 1.0, 2.0, 2.0, 2.0]},
        {"torpedo_noise": [1e-6] * 6, "sphere_noise": [1e-6] * 6},
        {"torpedo_noise": [30.0] * 6, "sphere_noise": [300.0] * 6},
        {"torpedo_start": [1e3] + [0.0] * 5},
    ],
    "2_neural_estimator": [
        {"weights": [0.3]},
        {"weights": [0.0, 1.0]},
        {"hidden_sizes": [10]},
        {"noise": 1e-6},
        {"noise": 1e-6, "q": 100.0, "innovation": "printed", "w1": 1.0},
        {"pairs": 2},
        {"settle": 1},
    ],
    "3_adaptive_fading": [
        {"measured_steering": ["v"]},
        {"measured_steering": ["v", "r"]},
        {"alpha": 1e-12},
        {"discretisation": "exact", "dt": 2.0},
        {"initial_variance": 1e6},
        {"R_steering": [1e6] * 3},
        {"Q_steering": [1e-20] * 3, "R_steering": [1e6] * 3, "initial_variance": 1e6},
        {"R_steering": [1e-20] * 3, "R_diving": [1e-20] * 4},
        {"fin_rad": 0.0, "bias_rad": 0.0, "stuck_rad": 0.0, "alpha": 1e-12},
    ],
    "4_imm_sea_current": [
        {"sigma_filter": [0.2, 0.6, 0.9]},
        {"sigma_filter": [0.5]},
        {"sigma_filter": [0.1, 0.5]},
        {"sigma_true": [0.5]},
        {"sigma_true": [0.3, 0.7]},
        {"sigma_true": [1.0, 0.05, 0.5]},
        {"trajectory": "circle", "log_axes": 3},
        {"initial_tilt_rad": 0.1, "initial_errors": "drawn"},
        {"duration_s": 60.0, "corner_radius": 60.0},
        {"duration_s": 60.0, "trajectory": "straight"},
        {"log_noise": 1e-4},
        {"speed_kn": 0.1, "trajectory": "straight"},
        {"speed_kn": 60.0, "trajectory": "circle"},
        {"gyro_bias_deg_h": 1e-6},
    ],
    "5_gravity_planning": [
        {"goal": [0, 0], "start_1": [9, 4], "start_2": [3, 9]},
        {"fan_1_km": [500.0]},
        {"initial_std_km": 20.0},
        {"process_noise": 10.0},
        # An exact search takes minutes, but half a minute where the start is nearly known.
        {"epsilon": 0.0, "bound_expansions": 1, "initial_std_km": 1e-3, "process_noise": 0.0},
        {"speed": 0.1},
        {"fan_2_km": [11.0]},
    ],
}

REFUSED = {
    "1_ito_filter": [
        {"filter_step": 0.5},
        {"torpedo_step": 0.5},
        {"map_interval": [0.01]},
        {"map_interval": [0.5, 0.5]},
    ],
    "2_neural_estimator": [
        {"hidden_sizes": [10, 10]},
        {"weights": [0.5, 0.5]},
        {"pairs": 1},
        {"noise": 0.0},
    ],
    "3_adaptive_fading": [
        {"alpha": 1e-300},
        {"initial_variance": 1e12},
        {"measured_steering": ["v", "v"]},
        {"dt": 2.0},
    ],
    "4_imm_sea_current": [
        {"sigma_filter": [0.5, 0.5]},
        _THREE,
        {"duration_s": 60.0, "corner_radius": 300.0},
        {"log_noise": 1e-30},
    ],
    "5_gravity_planning": [
        {"fan_2_km": []},
        {"user_path_km": [[5, 5], [5, 5]]},
        {"initial_std_km": 30.0},
        {"initial_std_km": 1e4},
        {"process_noise": 20.0},
        {"speed": 1e-9},
        {"goal": [65, 9], "start_1": [65, 9]},
    ],
}
