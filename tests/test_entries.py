"""Every public function of filters/ and models/ against damaged arguments.

A kernel believes the shapes that it is given: one array too short, and it reads or writes
memory that is not its own. So a kernel's name begins with an underscore, and what has no
underscore checks what it hands on. Here each public function is called with damaged copies
of valid arguments; it must raise `ParameterError`, or return what it returns for the same
numbers in a plain array. The calls are made in a process of their own, because the fault
that is looked for ends a process.

To add a function, add a row to `ROWS`: the function and valid arguments by name. Only if
needed: `free`, arrays with an axis whose length is their own affair, as ("z", 0), or all
of them, as ("z", ...), and such as may be None, as ("z", None); `in_place`, arrays that the
function changes; `infinite`, arguments in which an infinity has a meaning. Arguments that
are neither numbers, texts nor arrays of them stay as they are; `name` is for what is not a
plain function. All public functions of a module must have a row unless it stands in `OPEN`.
"""

import copy
import dataclasses
import importlib
import inspect
import json
import math
import pkgutil
import subprocess
import sys
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

import seanav.filters
import seanav.models
from seanav import checks, montecarlo
from seanav.filters import adaptive, blended, imm, ins, kalman, linear_covariance, moments, neural
from seanav.filters.gravity import labels, matching, pcrb, planning, point_mass
from seanav.filters.moments import continuous_discrete, generated, particles
from seanav.models import (
    attitude,
    currents,
    earth,
    gravity,
    inertial,
    paths,
    trajectories,
    vehicles,
)

# ---------------------------------------------------------------- the table

# Modules without rows so far, and why.
OPEN = {
    "filters.ins.reference": "plain numpy, no kernel",
    "filters.moments.equations": "symbols, no kernel",
    "filters.moments.formulas": "text and symbols, no kernel",
    "filters.moments.sde": "symbols, no kernel",
    "filters.moments.sources": "symbols, no kernel",
    "models.bodies": "symbols, no kernel",
    "models.nomoto": "plain Python, no kernel",
    "models.tides": "plain numpy, no kernel",
    "models.gravity.coordinates": "reads files, no kernel",
    "models.gravity.files": "reads files, no kernel",
    "models.gravity.geoid": "no kernel",
    "models.gravity.geotiff": "reads files, no kernel",
    "models.gravity.grids": "what readers of files hand to each other, no kernel",
    "models.gravity.netcdf": "reads files, no kernel",
    "models.gravity.packing": "reads files, no kernel",
    "models.gravity.quality": "what readers of files hand to each other, no kernel",
    "models.gravity.sources": "draws a field, reads files, no kernel",
    "models.trajectories": "no kernel",
}


class Row(NamedTuple):
    """A public function and what it is called with."""

    function: Any
    arguments: dict
    free: tuple = ()
    in_place: tuple = ()
    infinite: tuple = ()
    name: str = ""

    def called(self):
        """Return the module and the name that stand for the function."""
        home = self.function.__module__.removeprefix("seanav.")
        return self.name or f"{home}.{self.function.__qualname__}"


def _random(*shape):
    return np.random.default_rng(sum(shape)).standard_normal(shape)


def _kalman(runs=3, steps=4, n=2, m=1):
    return {
        "Phi": np.eye(n) + 0.1 * _random(n, n),
        "offsets": _random(steps, n),
        "H": _random(m, n),
        "Q": np.diag([2.0, 1.0][:n]),
        "R": np.eye(m),
        "x0": _random(runs, n),
        "P0": np.eye(n),
        "z": _random(runs, steps, m),
    }


def _pick(arguments, *names, **others):
    return {name: arguments[name] for name in names} | others


def _fly(steps=4, models=2, stride=2):
    lanes = ins.LANES
    x0 = np.zeros((ins.NOMINAL, lanes))
    x0[0], x0[4] = 0.6, 1.0
    truth = np.zeros((steps, 10))
    truth[:, 0], truth[:, 4], truth[:, 8:] = 0.6, 1.0, 6.4e6
    return {
        "theta": 1e-5 * _random(steps, 3, lanes),
        "dv": np.array([[0.0], [0.0], [-9.8]]) + 1e-3 * _random(steps, 3, lanes),
        "z": 0.1 * _random(steps, 1, lanes),
        "truth": truth,
        "x0": x0,
        "P0": np.array([ins.pack_diagonal(np.full(ins.N, 1e-4))] * models),
        "height": 1.0,
        "R": 0.01,
        "noise": np.array([[0.999, 1e-3], [0.99, 1e-2]]),
        "forms": ["sigma"] * models,
        "velocity_noise": 1e-6,
        "attitude_noise": 1e-12,
        "transition": np.array([[0.9, 0.1], [0.2, 0.8]]),
        "mu0": np.array([0.4, 0.6]),
        "window": 3,
        "cap": 10.0,
        "about": "estimate",
        "stride": stride,
        "true_rest": 1e-3 * _random(steps // stride, 9, lanes),
    }


def _linear(steps=3, n=2):
    return {
        "Phi": np.eye(n) + 0.1 * _random(steps, n, n),
        "Q": np.array([1.0, 2.0][:n]),
        "H": _random(steps, n),
        "R": 1.0,
    }


def _network(runs=3, hidden=4):
    network = neural.random_network(montecarlo.streams(0, "entries", runs), hidden)
    return {"hidden": network.hidden, "output": network.output}


def _answer(hidden, output, x):
    return neural.Network(hidden, output)(x)


def _teach(hidden, output, **others):
    return neural.teach(neural.Network(hidden, output), **others)


def _sense(trajectory, generator, **others):
    generator = copy.deepcopy(generator)  # a second call must draw the same
    return inertial.sensor_increments(trajectory, inertial.SensorErrors(), generator, **others)


def _draw(**others):
    return neural.random_network(montecarlo.streams(0, "entries", 2), **others)


def _discretise(A, B, **others):
    return vehicles.Plane("one", ("a", "b"), ("m", "m"), A, B).discretise(**others)


def _match(runs=3, steps=4):
    return {
        "anomaly": _random(5, 6),
        "spacing": 1000.0,
        "truth": 1e3 + 500.0 * np.arange(2.0 * steps).reshape(steps, 2),
        "initial_error": 100.0 * _random(runs, 2),
        "drift": 10.0 * _random(runs, steps, 2),
        "noise": _random(runs, steps),
        "R": 0.5,
        "P0": np.diag([1e4, 2e4]),
        "Q": np.diag([100.0, 200.0]),
    }


def _sitan(**arguments):
    tracks = matching.sitan(**arguments)
    return tracks.errors, tracks.P, tracks.nis[:, 1:]  # sample 0 has no measurement


def _plan(**others):
    return {
        "gradient": _random(2, 4, 5),
        "spacing": 1.0,
        "start": [0, 1],
        "goal": [3, 2],
        "noise": 0.8,
        "P0": np.eye(2),
        "process_noise": 0.05,
        "speed": 1.0,
    } | others


def _plan_labels(**others):
    # A table is taken as it is or refused, see test_labels: float32 is its only kind.
    return labels.plan_labels(**others, table=labels.gain_table(_random(2, 4, 5)))


def _mgal(**others):
    return gravity.GravityMap.from_mgal(**others, name="random", source="none")


_MAP = gravity.GravityMap(_random(4, 5))
_WALK = {"gradients": _random(4, 2), "noise": 0.5, "P0": np.eye(2), "Q": np.diag([0.1, 0.2])}
_PLACES = {"centre": np.array([18.5, 128.0])}


@cache
def _oscillator():
    """Return the compiled equation, moments and measurement: two states, an input, a parameter."""
    model = moments.system(
        "x y", ["y", "mu*(1 - x**2)*y - x + f"], [["0"], ["0.3"]], inputs="f", parameters="mu"
    )
    measurement = moments.measurement(model, ["x + x*y", "y"])
    return (
        generated.Propagator(moments.close(model, "gaussian")),
        generated.Simulator(model),
        generated.Predictor(measurement),
    )


def _batch(runs=3, n=2):
    return {"mean": _random(runs, n), "P": np.ones((runs, 1, 1)) * np.diag([2.0, 1.0])}


def _records(runs=3):
    return {
        "x0": np.ones(2), "P0": np.eye(2), "z": _random(runs, 4, 2), "interval": 0.4, "step": 0.1,
        "R": np.diag([2.0, 1.0]), "H": np.eye(2), "parameters": np.array([1.0]), "limit": 1e6,
    }  # fmt: skip


def _forces(times):
    return np.sin(times)[:, None]


def _filter(**others):
    track = continuous_discrete.run(_oscillator()[0], forces=_forces, **others)
    # What the NIS has not, the start and a filter that never corrects, is NaN.
    return track.mean, track.P, *([] if others["R"] is None else [track.nis[:, 1:]])


def _filter_expanded(**others):
    return _filter(H=_oscillator()[2], **others)


def _cloud(**others):
    track = particles.particle_filter(_oscillator()[1], forces=_forces, **others)
    return track.mean, track.P, track.nis[:, 1:]


def _rates(**others):
    return _oscillator()[0].rates(**others)


def _advance(**others):
    return _oscillator()[0](**others)


def _simulate(**others):
    return _oscillator()[1](**others)


def _predict(**others):
    return _oscillator()[2](**others)


def _fokker_planck(**others):
    return moments.fokker_planck(lambda x, y: (y - x, -y), **others)


_GENERATORS = montecarlo.streams(0, "entries", 3)
_KNOWN = {"inputs": np.array([0.5]), "parameters": np.array([1.0])}
_CHAIN = {"T": np.array([[0.9, 0.1], [0.2, 0.8]]), "mu": np.array([[0.4, 0.5, 1], [0.6, 0.5, 0]])}
_AT = {"latitude": 0.6, "height": 10.0}
_V_N = np.array([5.0, -3.0, 1.0])
_STEADY = {"z": _random(3, 6, 2), "K": np.full(6, 0.3), "x0": _random(3, 2)}

_BENT = np.array([[0.0, 0.0], [3.0, 1.0], [3.0, 5.0]])

ROWS = [
    Row(paths.length, {"points": _BENT}, free=(("points", 0),)),
    Row(paths.resample, {"points": _BENT, "count": 4}, free=(("points", 0),)),
    Row(paths.bow, {"start": np.zeros(2), "goal": np.ones(2), "amplitude": 0.5, "count": 4}),
    Row(paths.inside, {"points": _BENT, "extent": np.ones(2)}, free=(("points", 0),)),
    Row(paths.displaced, {"points": _BENT, "amplitude": 0.5}, free=(("points", 0),)),
    Row(kalman.run, _kalman()),
    Row(kalman.nees, {"errors": _random(3, 4, 2), "P": np.ones((3, 4, 1, 1)) * np.eye(2)}),
    Row(
        continuous_discrete.update,
        _batch()
        | {"z": _random(3, 2), "R": np.diag([2.0, 1.0]), "H": np.eye(2)}
        | {"predicted": _random(3, 2), "spread": np.ones((3, 1, 1)) * np.eye(2)},
        free=(("predicted", None), ("spread", None)),
        in_place=("mean", "P"),
    ),
    Row(
        continuous_discrete.update,
        _batch() | {"z": _random(3, 1), "R": np.eye(1), "H": _random(3, 1, 2)},
        free=(("H", ...),),  # H of one run is one for all
        in_place=("mean", "P"),
    ),
    Row(particles.systematic, {"weights": np.array([0.5, 0.3, 0.2]), "offset": 0.5}),
    Row(
        _filter,
        _records(),
        free=(("z", 0), ("z", 1), ("R", None)),
        name="filters.moments.continuous_discrete.run",
    ),
    Row(
        _filter_expanded,
        _pick(_records(), "x0", "P0", "z", "interval", "step", "R", "parameters"),
        free=(("z", 0), ("z", 1), ("R", None)),
        name="filters.moments.continuous_discrete.run",
    ),
    Row(
        _cloud,
        _records() | {"particles": 20, "generators": _GENERATORS},
        free=(("z", 1),),
        name="filters.moments.particles.particle_filter",
    ),
    Row(
        _fokker_planck,
        {
            "spread": np.array([0.2, 0.3]),
            "mean": np.array([0.1, -0.2]),
            "P": np.eye(2),
            "duration": 0.1,
            "half_widths": np.array([3.0, 4.0]),
            "nodes": 11,
            "steps": 5,
        },
        name="filters.moments.density.fokker_planck",
    ),
    Row(generated.steps_within, {"duration": 0.4, "step": 0.1}),
    Row(
        _rates,
        {"mean": np.ones(2), "P": np.eye(2)} | _KNOWN,
        free=(("inputs", None),),
        name="filters.moments.generated.Propagator.rates",
    ),
    Row(
        _advance,
        _batch()
        | {"duration": 0.4, "step": 0.1, "inputs": _random(9, 1), "parameters": np.array([1.0])},
        free=(("inputs", None),),
        in_place=("mean", "P"),
        name="filters.moments.generated.Propagator.__call__",
    ),
    Row(
        _simulate,
        {"x": _random(3, 2), "noise": _random(3, 4, 1), "step": 0.1, "inputs": _random(5, 1)}
        | {"parameters": np.array([1.0]), "keep": 2},
        free=(("inputs", None),),
        in_place=("x",),
        name="filters.moments.generated.Simulator.__call__",
    ),
    Row(
        _predict,
        _batch() | _KNOWN,
        free=(("inputs", ...), ("inputs", None)),
        name="filters.moments.generated.Predictor.__call__",
    ),
    Row(
        adaptive.run,
        _kalman()
        | {"method": "single", "window": 2, "trigger": "chi2", "alpha": 0.5, "floor": 1.0},
        infinite=("floor",),
    ),
    Row(adaptive.run, _kalman(m=2) | {"method": "multiple", "trigger": "trace", "alpha": 0.5}),
    Row(adaptive.threshold, {"alpha": 0.05, "m": 3}),
    Row(adaptive.weights, _pick(_kalman(), "H", "Q", method="multiple")),
    Row(imm.interact, _CHAIN, free=(("mu", 1),)),
    Row(
        imm.probabilities,
        {"predicted": _CHAIN["mu"], "logs": _random(2, 3)},
        infinite=("logs",),
    ),
    Row(imm.log_likelihood, {"squared": 0.3, "S": 0.1}),
    Row(ins.fly, _fly(), free=(("z", 1), ("true_rest", None))),
    Row(ins.shift, {"x": _fly()["x0"], "e": 1e-3 * _random(ins.N, ins.LANES), "sign": -1.0}),
    Row(ins.pack_diagonal, {"variances": np.arange(1.0, 17.0)}),
    Row(ins.unpack, {"P": _random(ins.PACKED, 3)}, free=(("P", 1),)),
    Row(linear_covariance.design, _linear() | {"P0": np.eye(2)}),
    Row(linear_covariance.achieve, _linear() | {"M0": np.eye(2), "gains": _random(3, 2)}),
    Row(
        linear_covariance.respond,
        {
            "Phi": np.eye(2) + 0.1 * _random(3, 2, 2),
            "H": _random(3, 2),
            "gains": _random(3, 2),
            "seen": _random(3, 4),
            "kept": 1,
        },
        free=[("seen", 1)],
    ),
    Row(blended.gains, {"q": 0.1, "R": 0.2, "P0": 0.3, "steps": 5}),
    Row(blended.steady_gain, {"q": 0.1, "R": 0.2}),
    Row(blended.estimate, _STEADY | {"w1": 0.3, "innovation": "blended"}),
    Row(blended.estimate, _STEADY | {"w1": np.full((3, 6), 0.3)}),
    Row(
        blended.manoeuvre_weight,
        _STEADY | {"P": np.full(6, 0.1), "R": 0.2, "q": 0.1, "memory": 2, "threshold": 9.0},
    ),
    Row(blended.steady_variance, {"K": 0.3, "w1": 0.2, "R": 0.2}),
    Row(neural.scale, {"v": _random(4, 2)}, free=(("v", ...),)),
    Row(neural.unscale, {"s": _random(4, 2)}, free=(("s", ...),)),
    Row(_draw, {"hidden": 4, "spread": 0.5}, name="filters.neural.random_network"),
    Row(neural.Network, _network(), free=(("hidden", 1),)),
    Row(
        _answer,
        _network() | {"x": _random(5, 2, 3)},
        free=(("hidden", 1), ("x", 0)),
        name="filters.neural.Network.__call__",
    ),
    Row(
        _teach,
        _network()
        | {
            "inputs": _random(5, 2, 3),
            "targets": _random(5, 2, 3),
            "rate": 0.1,
            "delta": 0.01,
            "reading": "rms",
            "max_epochs": 3,
        },
        free=(("hidden", 1),),
        name="filters.neural.teach",
    ),
    Row(
        matching.block_gradient,
        {"anomaly": _random(6, 7), "spacing": 2.0, "i": 2, "j": 3, "size": 2},
        free=(("anomaly", 0), ("anomaly", 1)),
    ),
    Row(matching.checked, _match(), free=(("anomaly", 0), ("anomaly", 1))),
    *(
        Row(
            _sitan,
            _match() | {"gradient": gradient, "window_sigmas": 1.0, "largest_window": 2},
            free=(("anomaly", 0), ("anomaly", 1)),
            name="filters.gravity.matching.sitan",
        )
        for gradient in ("block", "point")
    ),
    Row(
        point_mass.point_mass,
        _match() | {"cell": 50.0, "span_sigmas": 3.0},
        free=(("anomaly", 0), ("anomaly", 1)),
    ),
    Row(pcrb.deviation, {"noise": 0.5}),
    Row(pcrb.pcrb, _WALK, free=(("gradients", ...),)),
    Row(pcrb.pcrb, _WALK | {"gradients": _random(3, 4, 2)}, free=(("gradients", ...),)),
    Row(
        pcrb.pcrb,
        _WALK | {"Q": np.ones((4, 1, 1)) * np.eye(2)},
        free=(("gradients", ...), ("Q", ...)),
    ),
    Row(
        pcrb.expected_pcrb,
        _WALK | {"gradients": _random(3, 4, 2)},
        free=(("gradients", 0), ("gradients", 1)),
    ),
    Row(
        pcrb.information,
        {"gradient": _random(2, 3, 4), "noise": 0.5},
        free=(("gradient", 1), ("gradient", 2)),
    ),
    Row(planning.problem, _plan(), free=(("gradient", 1), ("gradient", 2))),
    Row(planning.plan, _plan(), free=(("gradient", 1), ("gradient", 2))),
    Row(labels.gain_table, {"gradient": _random(2, 3, 4)}, free=(("gradient", 1), ("gradient", 2))),
    Row(
        labels.plan_labels,
        _plan(epsilon=0.3, max_expansions=50, max_comparisons=500),
        free=(("gradient", 1), ("gradient", 2)),
    ),
    Row(
        _plan_labels,
        _plan(epsilon=0.0, incumbent=planning.plan(**_plan())),
        name="filters.gravity.labels.plan_labels",
    ),
    Row(
        gravity.GravityMap,
        {"anomaly": _random(4, 5), "spacing": 1000.0} | _PLACES,
        free=(("anomaly", 0), ("anomaly", 1), ("centre", None)),
    ),
    Row(
        _mgal,
        {"anomaly_mgal": _random(4, 5), "spacing": 1000.0} | _PLACES,
        free=(("anomaly_mgal", 0), ("anomaly_mgal", 1), ("centre", None)),
        name="models.gravity.map.GravityMap.from_mgal",
    ),
    Row(gravity.gradient, {"gravity_map": _MAP}),
    Row(
        gravity.interpolate,
        {"grid": _random(4, 5), "spacing": 2.0, "points": np.abs(_random(6, 2))},
        free=(("grid", ...), ("points", ...)),
    ),
    Row(
        gravity.interpolate,
        {"grid": _random(2, 4, 5), "spacing": 2.0, "points": np.abs(_random(3, 6, 2))},
        free=(("grid", ...), ("points", ...)),
    ),
    Row(
        gravity.geodetic_to_local,
        _PLACES | {"latitude_deg": 10.0 * _random(3), "longitude_deg": _random(3)},
        free=(("latitude_deg", ...), ("longitude_deg", ...)),
    ),
    Row(
        gravity.local_to_geodetic,
        _PLACES | {"east": 1e3 * _random(3), "north": 1e3 * _random(3)},
        free=(("east", ...), ("north", ...)),
    ),
    Row(gravity.square_nodes, _PLACES | {"size": 5, "spacing": 1000.0}),
    Row(attitude.skew, {"a": _V_N}),
    Row(attitude.exp_so3, {"rotation": _V_N}),
    Row(attitude.C_bn_from_rpy, {"rpy": _V_N}),
    Row(attitude.attitude_error, {"C_bn_estimate": np.eye(3), "C_bn": np.eye(3)}),
    Row(earth.radii, _pick(_AT, "latitude")),
    Row(earth.radii_slopes, _pick(_AT, "latitude")),
    Row(earth.gravity, _AT),
    Row(earth.earth_rate, _pick(_AT, "latitude")),
    Row(earth.transport_rate, _AT | {"v_n": _V_N}),
    Row(currents.decay, {"dt": 1.0, "correlation_time": 100.0}),
    Row(
        currents.gauss_markov,
        {
            "noise": _random(4, 3),
            "start": np.ones(3),
            "dt": 1.0,
            "correlation_time": 100.0,
            "sigma": np.arange(1.0, 5.0),
        },
        free=(("sigma", ...),),
    ),
    Row(
        currents.log_velocity,
        {"C_bn": np.ones((4, 1, 1)) * np.eye(3), "v_n": _random(4, 3), "current_n": _random(4, 3)},
    ),
    Row(currents.doppler_shift, {"speed": 2.0, "frequency": 3e5, "sound_speed": 1500.0}),
    Row(currents.doppler_speed, {"shift": 8e2, "frequency": 3e5, "sound_speed": 1500.0}),
    Row(currents.electromotive_force, {"speed": 2.0, "current": 0.5, "field": 0.1, "gap": 0.2}),
    Row(
        inertial.error_dynamics,
        {
            "position": np.array([0.6, 2.0, 10.0]),
            "v_n": _V_N,
            "C_bn": np.eye(3),
            "f_n": np.array([0.1, 0.2, -9.8]),
            "correlation_time": 7200.0,
        },
    ),
    Row(
        inertial.preintegrate,
        {"rotation": 1e-3 * _random(6, 3), "velocity": _random(6, 3), "per_step": 3},
    ),
    Row(
        _sense,
        {
            "trajectory": trajectories.Trajectory(duration=600.0, corner_radius=100.0),
            "generator": np.random.default_rng(0),
            "initial_bias": np.full(6, 1e-4),
            "rate": 2,
        },
        name="models.inertial.sensor_increments",
    ),
    Row(
        inertial.mechanise,
        {
            "position": np.array([0.6, 2.0, 10.0]),
            "v_n": _V_N,
            "q": np.array([1.0, 0.0, 0.0, 0.0]),
            "theta": 1e-5 * _random(4, 3),
            "dv": np.array([0.0, 0.0, -9.8]) + 0.01 * _random(4, 3),
            "dt": 1.0,
        },
    ),
    Row(
        vehicles.simulate,
        _pick(_kalman(), "Phi", "offsets", "x0", noise=_random(3, 4, 2)),
    ),
    Row(vehicles.steering, {"m": 31.0}),
    Row(vehicles.diving, {"m": 31.0}),
    Row(vehicles.as_printed, {"name": "steering"}),
    Row(
        _discretise,
        {"A": -np.eye(2), "B": np.ones(2), "dt": 0.1, "method": "exact"},
        name="models.vehicles.Plane.discretise",
    ),
]

# ---------------------------------------------------------------- damage

REFUSED, SAME, FINITE = "refused", "refused or the same", "refused or finite"


def _damaged_array(x, label, row):
    """Yield (what was done, damaged array, what is allowed, the plain array it equals)."""
    own = {axis for name, axis in row.free if name == label}
    loose = FINITE if ... in own else REFUSED
    for axis in range(x.ndim):
        allowed = FINITE if axis in own else loose
        yield f"axis {axis} one shorter", np.delete(x, -1, axis), allowed, None
        longer = np.concatenate([x, np.take(x, [-1], axis)], axis)
        yield f"axis {axis} one longer", longer, allowed, None
        yield f"axis {axis} empty", np.take(x, [], axis), loose, None
    yield "first entry of axis 0 only", x[0], loose, None
    yield "one more axis", x[None], loose, None
    yield "no axis", np.float64(1.5), loose, None
    for bad in (np.nan, np.inf, -np.inf):
        worse = x.copy()
        worse[(-1,) * x.ndim] = bad
        meant = label in row.infinite and not math.isnan(bad)
        yield f"{bad} in the last place", worse, FINITE if meant else REFUSED, None
    masked = np.ma.array(x, mask=np.zeros(x.shape, bool))
    masked[(-1,) * x.ndim] = np.ma.masked
    yield "None", None, FINITE if None in own else REFUSED, None
    for kind, worse in {
        "complex": x.astype(complex),
        "truth values": x > 0,
        "texts": x.astype(str),
        "objects": x.astype(object),
        "masked": masked,
        "dates": x.astype("M8[s]"),
        "a text": "1",
    }.items():
        yield kind, worse, REFUSED, None
    if x.ndim > 1:
        yield "ragged lists", [*x.tolist()[:-1], x.tolist()[-1][:-1]], REFUSED, None
    spread = np.repeat(x, 2, axis=-1)
    fixed = x.copy()
    fixed.flags.writeable = False
    for kind, other in {
        "Fortran order": np.asfortranarray(x),
        "transposed memory": np.ascontiguousarray(x.T).T,
        "every second of another": spread[..., ::2],
        "read backwards": x[::-1].copy()[::-1],
        "read-only": fixed,
        "lists": x.tolist(),
        "integers": x.astype(np.int64),
        "small unsigned integers": np.abs(x).astype(np.uint8),
        "float32": x.astype(np.float32),
        "float16": x.astype(np.float16),
        "long double": x.astype(np.longdouble),
        "other byte order": x.astype(">f8"),
        "a subclass": x.view(np.matrix) if x.ndim == 2 else x.view(np.recarray),
    }.items():
        yield kind, other, SAME, np.array(other, dtype=float)


def _damaged_number(x, label, row):
    for bad in (math.nan, math.inf, -math.inf):
        meant = label in row.infinite and not math.isnan(bad)
        yield str(bad), bad, FINITE if meant else REFUSED, None
    for bad in (None, "1", 1j, [1.0, 2.0], np.array([1.0, 2.0]), object()):
        yield repr(bad)[:20], bad, REFUSED, None
    yield "True", True, REFUSED, None
    if isinstance(x, int):
        yield "a fraction", x + 0.5, REFUSED, None
        yield "a whole float", float(x), SAME, x
    yield "its numpy kind", np.array(x)[()], SAME, x
    for other in (0, -1, -x, -(10**6), 10**400):
        yield f"{other}"[:20], other, FINITE, None


def _damages(value, label, row):
    if isinstance(value, np.ndarray):
        yield from _damaged_array(value, label, row)
    elif isinstance(value, (int, float)):
        yield from _damaged_number(value, label, row)
    elif isinstance(value, str):
        for bad in ("no such word", "", None, 1, ["single"]):
            yield repr(bad), bad, REFUSED, None
    elif isinstance(value, list):
        for bad in (value[:-1], [*value, value[-1]], [], ["no such word"] * len(value), None):
            yield repr(bad), bad, REFUSED, None


def _numbers(result):
    """Return all arrays of numbers in a result, whatever it is made of."""
    if dataclasses.is_dataclass(result) and not isinstance(result, type):
        result = list(vars(result).values())
    if isinstance(result, dict):
        result = list(result.values())
    if isinstance(result, (tuple, list)):
        return [array for entry in result for array in _numbers(entry)]
    numeric = isinstance(result, (np.ndarray, np.generic, int, float))
    return [np.array(result)] if numeric else []


def _call(row, changed):
    arguments = {**{k: copy.deepcopy(v) for k, v in row.arguments.items()}, **changed}
    before = {k: np.array(v) for k, v in arguments.items() if isinstance(v, np.ndarray)}
    result = _numbers(row.function(**arguments))
    for label, array in before.items():
        if label in row.in_place:
            result.append(np.array(arguments[label]))
        elif array.dtype.kind in "iuf" and not np.array_equal(array, arguments[label], True):
            raise AssertionError(f"{label} was changed")
    return result


def _same(one, other):
    return len(one) == len(other) and all(
        a.dtype == b.dtype and np.array_equal(a, b, a.dtype.kind == "f")
        for a, b in zip(one, other, strict=True)
    )


def _outcome(row, changed):
    """Return the numbers, or the class of the error if it is no `ParameterError`."""
    try:
        return _call(row, changed)
    except checks.ParameterError as error:
        return "refused" if "\n" not in str(error) else "refused in more than one line"
    except Exception as error:  # every other kind is a finding
        return f"{type(error).__name__}: {error}".splitlines()[0][:90]


def faults(row):
    """Return what a row's function does wrong, one line each."""
    found = []
    whole = _outcome(row, {})
    if isinstance(whole, str):
        return [f"the valid arguments: {whole}"]
    for label, value in row.arguments.items():
        for done, damaged, allowed, plain in _damages(value, label, row):
            print(f"  {label}: {done}", file=sys.stderr, flush=True)
            got = _outcome(row, {label: damaged})
            if got == "refused":
                continue
            wrong = isinstance(got, str) or allowed == REFUSED
            if not wrong and allowed == FINITE:
                wrong = not all(
                    np.isfinite(array).all() for array in got if array.dtype.kind == "f"
                )
            if not wrong and allowed == SAME:
                expected = _outcome(row, {label: plain})
                wrong = isinstance(expected, str) or not _same(got, expected)
            if wrong:
                answer = got if isinstance(got, str) else "an answer"
                found.append(f"{label}: {done}: {answer}, must be {allowed}")
    return found


# ---------------------------------------------------------------- tests


def _modules():
    for package in (seanav.filters, seanav.models):
        for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            yield importlib.import_module(info.name)


def _short(module):
    return module.__name__.removeprefix("seanav.")


CLOSED = [module for module in _modules() if _short(module) not in OPEN]


def test_open_modules_exist():
    assert set(OPEN) <= {_short(module) for module in _modules()}


@pytest.mark.parametrize("module", CLOSED, ids=_short)
def test_no_kernel_is_public(module):
    public = [n for n, f in vars(module).items() if isinstance(f, Dispatcher) and n[0] != "_"]
    assert not public


@pytest.mark.parametrize("module", CLOSED, ids=_short)
def test_every_public_function_has_a_row(module):
    functions = {
        f"{_short(module)}.{name}"
        for name, f in vars(module).items()
        if inspect.isfunction(f) and f.__module__ == module.__name__ and name[0] != "_"
    }
    assert functions <= {row.called() for row in ROWS}


def test_an_unchecked_function_is_found():
    def mean_of_rows(x, count):
        x *= 1.0
        return x[:count].sum(axis=0) / count

    rows = [Row(mean_of_rows, {"x": np.ones((3, 2)), "count": 3}, name="any.one")]
    (line,) = faults(rows[0]._replace(arguments={"x": [1.0], "count": 1}))[:1]
    assert line.startswith("the valid arguments: TypeError")
    found = faults(rows[0])
    assert "x: axis 0 one shorter: an answer, must be refused" in found
    assert "x: nan in the last place: an answer, must be refused" in found
    assert "count: a fraction: TypeError" in "\n".join(found)


def _homes():
    # The deepest module of each row's name: a class may follow it.
    names = {_short(module) for module in _modules()}
    return sorted({max(n for n in names if row.called().startswith(f"{n}.")) for row in ROWS})


def _examined(homes):
    """Return {home: faults} from a process of its own, and what that process said last."""
    command = [sys.executable, "-X", "faulthandler", __file__, *homes]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900, check=False)
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    return {home: found for answer in answers for home, found in answer.items()}, done.stderr


@pytest.fixture(scope="module")
def examined():
    """What all modules do wrong; a process that dies leaves out the rest of them."""
    return _examined(_homes())[0]


@pytest.mark.parametrize("home", _homes())
def test_damaged_arguments_are_refused_or_understood(home, examined):
    found, said = (examined, "") if home in examined else _examined([home])
    assert home in found, f"died at\n{said[-3000:]}"
    assert not found[home], "\n".join(found[home])


if __name__ == "__main__":
    for home in sys.argv[1:]:
        found = []
        for row in ROWS:
            if row.called().startswith(home + "."):
                print(row.called(), file=sys.stderr, flush=True)
                found += [f"{row.called()}: {line}" for line in faults(row)]
        print(json.dumps({home: found}), flush=True)
