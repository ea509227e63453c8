"""Nonlinear filtering by moment equations: derived in SymPy, compiled as derived.

``formulas``, ``sde``
    a user's equation dx = f(x, t) dt + G(x, t) dW, read and bounded; its observability;
``equations``
    operators, moments, closures, measurements, all in symbols;
``sources``, ``generated``
    the same symbols as the text of kernels, and compiled;
``continuous_discrete``, ``particles``
    filters between discrete measurements, the particle filter beside them;
``density``
    the Fokker–Planck equation of two states on a grid, a reference.

A user's own equation::

    model = moments.system("x y", ["y", "mu*(1 - x**2)*y - x"], [["0"], ["s"]], parameters="mu s")
    propagate = moments.Propagator(moments.close(model, "gaussian"))

Source: A. H. Jazwinski, *Stochastic Processes and Filtering Theory*, Academic Press, 1970.
"""

from seanav.filters.moments.continuous_discrete import Track
from seanav.filters.moments.density import Density, fokker_planck
from seanav.filters.moments.equations import (
    CLOSURES,
    Measurement,
    Moments,
    backward,
    central_moment,
    characteristic,
    close,
    exact,
    expectation,
    forward,
    gaussian_moment,
    isserlis,
    measurement,
    pairings,
)
from seanav.filters.moments.generated import Predictor, Propagator, Simulator
from seanav.filters.moments.sde import System, observability, system
from seanav.filters.moments.sources import triangle

__all__ = [
    "CLOSURES",
    "Density",
    "Measurement",
    "Moments",
    "Predictor",
    "Propagator",
    "Simulator",
    "System",
    "Track",
    "backward",
    "central_moment",
    "characteristic",
    "close",
    "exact",
    "expectation",
    "fokker_planck",
    "forward",
    "gaussian_moment",
    "isserlis",
    "measurement",
    "observability",
    "pairings",
    "system",
    "triangle",
]
