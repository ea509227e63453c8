"""Compile SymPy expressions to kernels: the equation that is printed is what runs.

A kernel is written as Python source into the folder of the compiled cache, under a name
that is a hash of its text, and imported from there: numba can then keep it on disk,
which it cannot for code that exists in memory only. Runs are taken eight at a time,
innermost, at constant distances in one flat array, so that the compiler vectorises.
"""

import hashlib
import importlib.util
import math
import os
import sys
import tempfile
import threading
import uuid
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from seanav import _compile
from seanav.checks import ParameterError, array, in_place, integer, number
from seanav.filters.moments.equations import Measurement, Moments
from seanav.filters.moments.sde import System
from seanav.filters.moments.sources import (
    measurement_source,
    propagator_source,
    simulator_source,
    triangle,
)

MAX_STEPS = 1_000_000  # of one call of a propagator


def _module(source):
    """Import generated `source` from the cache folder; the same text is written once."""
    name = "generated_" + hashlib.sha256(source.encode()).hexdigest()[:20]
    with _IMPORTING:  # a thread must not meet a module that another one is still running
        if name not in _MODULES:
            _MODULES[name] = _imported(name, source)
        return _MODULES[name]


_IMPORTING, _MODULES = threading.Lock(), {}


def _imported(name, source):
    folder = Path(_compile.CACHE or tempfile.mkdtemp(prefix="seanav")) / "generated"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.py"
    # numba looks at the time stamp: a file that is right stays.
    if not path.is_file() or path.read_text(encoding="utf-8") != source:
        beside = path.with_suffix(f".{uuid.uuid4().hex}")
        beside.write_text(source, encoding="utf-8")
        os.replace(beside, path)
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


class _Compiled:
    """A kernel by its source: so it is pickled, copied, and sent to another machine."""

    def __init__(self, source):
        self.source = source
        self._kernels = _module(source)

    def __getstate__(self):
        return {name: value for name, value in vars(self).items() if name != "_kernels"}

    def __setstate__(self, state):
        vars(self).update(state)
        self._kernels = _module(self.source)


def _known(model, inputs, parameters, *rows):
    """Return checked inputs (*rows, inputs), None being 0, and parameters."""
    names = [", ".join(x.name for x in s) or "none" for s in (model.inputs, model.parameters)]
    shape = (*rows, len(model.inputs))
    inputs = np.zeros(shape) if inputs is None else array(f"inputs ({names[0]})", inputs, shape)
    return inputs, array(f"parameters ({names[1]})", parameters, (len(model.parameters),))


def steps_within(duration: float, step: float) -> int:
    """Return the number of equal steps of at most `step` in `duration`, at most `MAX_STEPS`."""
    number("step", step, above=0)
    ratio = number("duration", duration, above=0) / float(step)
    if ratio > MAX_STEPS:
        allowed = f"must be at least duration / {MAX_STEPS} = {duration / MAX_STEPS:g}"
        raise ParameterError("step", step, allowed)
    return max(1, math.ceil(ratio - 1e-9))


class Propagator(_Compiled):
    """Closed moment equations, compiled. It can be pickled.

    Attributes
    ----------
    moments : Moments
        The expressions that were compiled.
    source : str
        The Python text that runs.
    """

    def __init__(self, moments: Moments):
        super().__init__(propagator_source(moments))
        self.moments = moments

    def rates(
        self,
        mean: ArrayLike,
        P: ArrayLike,
        inputs: ArrayLike | None = None,
        parameters: ArrayLike = (),
    ) -> tuple[np.ndarray, ...]:
        """Return d(mean)/dt (n,) and dP/dt (n, n) at one point.

        Parameters
        ----------
        mean : array_like, shape (n,); P : array_like, shape (n, n)
            Of P the upper triangle is used, here and in a call.
        inputs, parameters : sequence of float
            Inputs are 0 by default.

        Raises
        ------
        ParameterError
            If a shape does not fit the equation or a number is not finite.
        """
        model, n = self.moments.model, len(self.moments.model.states)
        mean, P = array("mean", mean, (n,)), array("P", P, (n, n))
        inputs, parameters = _known(model, inputs, parameters)
        packed = self._kernels.rates(mean, P, inputs, parameters)
        rate = np.empty((n, n))
        for k, (i, j) in enumerate(triangle(n)):
            rate[i, j] = rate[j, i] = packed[n + k]
        return packed[:n], rate

    def __call__(
        self,
        mean: ArrayLike,
        P: ArrayLike,
        duration: float,
        step: float,
        inputs: ArrayLike | None = None,
        parameters: ArrayLike = (),
    ) -> None:
        """Advance mean and covariance together over `duration`, in place.

        Parameters
        ----------
        mean : ndarray, shape (runs, n); P : ndarray, shape (runs, n, n)
            Changed in place.
        duration, step : float
            s; `step` is the largest one: the duration is cut into equal steps, at most
            `MAX_STEPS`.
        inputs : ndarray, shape (2 steps + 1, inputs), optional
            At the ends and middles of the steps; default 0.
        parameters : sequence of float

        Raises
        ------
        ParameterError
            If a shape does not fit the equation, a number is not finite, the step is too
            small, or mean or P is no array that can be changed in place.
        """
        model, sizes = self.moments.model, {}
        n = len(model.states)
        in_place("mean", mean, ("runs", n), sizes)
        in_place("P", P, ("runs", n, n), sizes)
        steps = steps_within(duration, step)
        inputs, parameters = _known(model, inputs, parameters, 2 * steps + 1)
        self._kernels.propagate(mean, P, inputs, parameters, duration / steps)


class Simulator(_Compiled):
    """The stochastic differential equation itself, compiled (Euler–Maruyama).

    It can be pickled.
    """

    def __init__(self, model: System):
        super().__init__(simulator_source(model))
        self.model = model

    def __call__(
        self,
        x: ArrayLike,
        noise: ArrayLike,
        step: float,
        inputs: ArrayLike | None = None,
        parameters: ArrayLike = (),
        keep: int = 1,
    ) -> np.ndarray:
        """Advance `x` (runs, n) in place; return the track (runs, steps/keep + 1, n).

        `noise` (runs, steps, noises) are standard normals; `inputs` (steps + 1, inputs);
        every `keep`-th state is kept, and `keep` divides the number of steps.

        Raises
        ------
        ParameterError
            If a shape does not fit the equation, a number is not finite or allowed, or x
            is no array that can be changed in place.
        """
        model, sizes = self.model, {}
        in_place("x", x, ("runs", len(model.states)), sizes)
        noise = array("noise", noise, ("runs", "steps", model.diffusion.shape[1]), sizes)
        step, steps = number("step", step, above=0), sizes["steps"]
        inputs, parameters = _known(model, inputs, parameters, steps + 1)
        keep = integer("keep", keep, at_least=1, at_most=steps)
        if steps % keep:
            raise ParameterError("keep", keep, f"must divide the number of steps, {steps}")
        return self._kernels.simulate(x, inputs, parameters, noise, step, keep)


class Predictor(_Compiled):
    """A measurement function to second order, compiled. It can be pickled."""

    def __init__(self, measurement: Measurement):
        super().__init__(measurement_source(measurement))
        self.measurement = measurement

    def __call__(
        self,
        mean: ArrayLike,
        P: ArrayLike,
        inputs: np.ndarray | None = None,
        parameters: ArrayLike = (),
    ) -> tuple[np.ndarray, ...]:
        """Return predicted (runs, k), H (runs, k, n) and second-order spread (runs, k, k).

        `inputs` are (inputs,) or (1, inputs).

        Raises
        ------
        ParameterError
            If a shape does not fit the equation or a number is not finite.
        """
        model, k, sizes = self.measurement.model, len(self.measurement.predicted), {}
        n = len(model.states)
        mean = array("mean", mean, ("runs", n), sizes)
        P = array("P", P, ("runs", n, n), sizes)
        if isinstance(inputs, np.ndarray) and inputs.ndim == 2 and len(inputs) == 1:
            inputs = inputs[0]
        inputs, parameters = _known(model, inputs, parameters)
        predicted, H, spread = (np.empty((len(mean), *s)) for s in ((k,), (k, n), (k, k)))
        self._kernels.expand(mean, P, inputs, parameters, predicted, H, spread)
        return predicted, H, spread
