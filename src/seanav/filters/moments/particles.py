"""The particle filter of an Itô process with discrete measurements, a reference."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from seanav import checks
from seanav._compile import kernel
from seanav.checks import ParameterError
from seanav.filters.moments.continuous_discrete import Track, _prepared
from seanav.filters.moments.generated import Simulator

MAX_PARTICLES = 1_000_000


@kernel
def _systematic(weights, offset):
    count = len(weights)
    chosen = np.empty(count, np.int64)
    total, source = weights[0], 0
    for i in range(count):
        level = (i + offset) / count
        while total < level and source < count - 1:
            source += 1
            total += weights[source]
        chosen[i] = source
    return chosen


def systematic(weights: ArrayLike, offset: float) -> np.ndarray:
    """Return the indices of systematic resampling, (particles,).

    Parameters
    ----------
    weights : array, shape (particles,)
        Not negative, sum one.
    offset : float
        Uniform in [0, 1).

    Raises
    ------
    seanav.checks.ParameterError
        If the weights or the offset are not such.
    """
    weights = checks.array("weights", weights, ("particles",))
    if weights.min() < 0:
        raise ParameterError("weights", float(weights.min()), "must not be negative")
    if abs(weights.sum() - 1) > 1e-9:
        raise ParameterError("weights", float(weights.sum()), "must be weights that sum to one")
    return _systematic(weights, checks.number("offset", offset, at_least=0, below=1))


def particle_filter(
    simulate: Simulator,
    x0: ArrayLike,
    P0: ArrayLike,
    z: np.ndarray,
    interval: float,
    step: float,
    R: Any,
    H: Any,
    generators: Sequence,
    particles: int,
    forces: Callable | None = None,
    parameters: tuple = (),
    limit: float = 1e100,
) -> Track:
    """Run a bootstrap particle filter on each record, systematic resampling at each sample.

    Parameters
    ----------
    simulate : seanav.filters.moments.generated.Simulator
    P0 : array, shape (n, n)
        Positive definite: the cloud is drawn from it.
    generators : list of numpy.random.Generator, one per run
    particles : int
        At most `MAX_PARTICLES`.
    limit : float
        A particle that leaves ±`limit` has exploded and carries no weight; a run without
        any other has diverged and is NaN from there on.

    Others as in `run`; `H` is a (k, n) array.

    Returns
    -------
    Track
        `nis` holds the effective sample size 1/Σw² before resampling: near 1 the
        filter has collapsed and is no reference.

    Raises
    ------
    seanav.checks.ParameterError
        As `run`.

    References
    ----------
    N. J. Gordon, D. J. Salmond and A. F. M. Smith, "Novel approach to
    nonlinear/non-Gaussian Bayesian state estimation", *IEE Proceedings F* 140 (1993).
    """
    checks.integer("particles", particles, at_least=2, at_most=MAX_PARTICLES)
    x0, P0, z, R, H, steps = _prepared(x0, P0, z, interval, step, R, H, cloud=True)
    limit = checks.number("limit", limit, above=0, at_most=1e100)
    (runs, count, _), n = z.shape, len(x0)
    usable = isinstance(generators, (list, tuple)) and len(generators) == runs
    if not usable or not all(isinstance(g, np.random.Generator) for g in generators):
        allowed = f"must be {runs} random generators, one per run of z"
        raise ParameterError("generators", generators, allowed)
    inverse, root = np.linalg.inv(R), np.linalg.cholesky(P0)
    means, Ps = np.full((runs, count + 1, n), np.nan), np.full((runs, count + 1, n, n), np.nan)
    sizes = np.full((runs, count + 1), np.nan)
    means[:, 0], Ps[:, 0] = x0, P0
    for r, generator in enumerate(generators):
        x = x0 + np.einsum("ij,pj->pi", root, generator.standard_normal((particles, n)))
        for k in range(count):
            times = interval * (k + np.arange(steps + 1) / steps)
            noise = generator.standard_normal((particles, steps, simulate.model.diffusion.shape[1]))
            inputs = forces(times) if forces else None
            simulate(x, noise, interval / steps, inputs, parameters, steps)
            exploded = ~(np.abs(x) < limit).all(axis=1)
            if exploded.all():
                break
            x[exploded] = x0
            residual = z[r, k] - np.einsum("ai,pi->pa", H, x)
            log = -0.5 * np.einsum("pa,ab,pb->p", residual, inverse, residual)
            log[exploded] = -np.inf
            weights = np.exp(log - log.max())
            weights /= weights.sum()
            means[r, k + 1] = np.einsum("p,pi->i", weights, x)
            offset = x - means[r, k + 1]
            Ps[r, k + 1] = np.einsum("pi,pj->ij", weights[:, None] * offset, offset)
            sizes[r, k + 1] = 1.0 / (weights**2).sum()
            x = x[_systematic(weights, generator.random())]
    return Track(means, Ps, sizes)
