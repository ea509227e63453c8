"""Monte Carlo without a paper in it: random streams, parallel batches, 95 % intervals."""

import math
import os
import sys
import zlib
from collections.abc import Callable, Iterable
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from joblib import Parallel, delayed
from scipy import stats
from tqdm import tqdm

from seanav.checks import integer

# ---------------------------------------------------------------- random numbers


def streams(seed: int, purpose: str, count: int) -> list[np.random.Generator]:
    """Return one independent random generator per run, for one purpose.

    Stream r depends on `seed`, `purpose` and r alone, so run r meets the same noise
    whatever the number of runs, and filters that are compared meet the same noise.

    Parameters
    ----------
    seed : int
        Seed of the whole study, at least 0.
    purpose : str
        What the numbers are for, such as ``"gyro noise"``.
    count : int
        Number of streams, one per run, at least 1.

    Raises
    ------
    ParameterError
        If `seed` or `count` is not such an integer.
    """
    seed = integer("seed", seed, at_least=0)
    count = integer("runs", count, at_least=1)
    # CRC-32 only turns the name into a number; independence is SeedSequence's work.
    parent = np.random.SeedSequence(seed, spawn_key=(zlib.crc32(purpose.encode()),))
    return [np.random.default_rng(child) for child in parent.spawn(count)]


def normals(seed: int, purpose: str, runs: int, shape: tuple[int, ...]) -> np.ndarray:
    """Return standard normal numbers, shape (runs, *shape); run r from its own stream."""
    generators = streams(seed, purpose, runs)
    numbers = np.empty((runs, *shape))
    for run, generator in enumerate(generators):
        numbers[run] = generator.standard_normal(shape)
    return numbers


# ---------------------------------------------------------------- parallel batches


def parallel_map(
    function: Callable, items: Iterable, *, threads: int | None = None, client=None, label=None
) -> list:
    """Return ``[function(item) for item in items]``, computed in parallel, in order.

    Kernels release the interpreter lock, so threads suffice on one machine. Let an
    item be a batch of fixed size, so that results do not depend on the number of
    threads. A progress bar is shown in a terminal and in a live notebook, where it
    clears the output of its cell when done: do long work before printing. Stored
    outputs never contain a bar.

    Parameters
    ----------
    function : callable
        Takes one item. With `client` it must be picklable.
    items : iterable
        The batches.
    threads : int, optional
        Default: environment variable ``SEANAV_THREADS``, else the number of processors.
    client : dask.distributed.Client, optional
        Run on this Dask cluster instead.
    label : str, optional
        Text beside the progress bar.

    Raises
    ------
    ParameterError
        If `threads` is not an integer of at least 1.
    """
    items = list(items)
    if threads is None:
        given = os.environ.get("SEANAV_THREADS") or str(os.cpu_count() or 1)
        threads = int(given) if given.isdecimal() else given
    threads = integer("threads", threads, at_least=1)
    with _progress_bar(len(items), label) as advance:
        if client is not None:
            futures = client.map(function, items, pure=False)
            results = (future.result() for future in futures)
        else:
            workers = Parallel(n_jobs=threads, backend="threading", return_as="generator")
            results = workers(delayed(function)(item) for item in items)
        done = []
        for result in results:
            done.append(result)
            advance()
    return done


@contextmanager
def _progress_bar(total, label):
    """Yield a function to call after each item; it draws a bar where somebody can see it."""
    # The runner says where: a terminal's device name, or nothing for no bar at all,
    # because what a kernel writes to its own streams would end up in the notebook.
    device = os.environ.get("SEANAV_PROGRESS")
    live_notebook = device is None and _in_jupyter()
    if device:
        with open(device, "w") as terminal, _bar(total, label, terminal, position=1) as bar:
            yield bar.update
    elif live_notebook or (device is None and sys.stderr.isatty()):
        with _bar(total, label, sys.stderr) as bar:
            yield bar.update
        if live_notebook:
            from IPython.display import clear_output

            clear_output()
    else:
        yield lambda: None


def _bar(total, label, file, position=0):
    return tqdm(total=total, desc=label, file=file, position=position, leave=False)


def _in_jupyter() -> bool:
    if "IPython" not in sys.modules:
        return False
    shell = sys.modules["IPython"].get_ipython()
    return shell is not None and hasattr(shell, "kernel")


# ---------------------------------------------------------------- intervals

LEVEL = 0.95


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % confidence interval.

    Attributes
    ----------
    value, low, high : float
        Point estimate and ends of the interval, in the unit of the number.
    se : float
        Standard error in the same unit; 0 for an exact number.
    count : int
        Number of independent runs; 0 for an exact number.

    Raises
    ------
    ValueError
        If a number is not finite or the interval does not contain the value.
    """

    value: float
    low: float
    high: float
    se: float
    count: int

    def __post_init__(self):
        numbers = (self.value, self.low, self.high, self.se)
        if not all(map(math.isfinite, numbers)) or not self.low <= self.value <= self.high:
            raise ValueError(f"not an estimate with its interval: {self}")


def exact(value: float) -> Estimate:
    """Return a number that is computed without sampling."""
    return Estimate(float(value), float(value), float(value), 0.0, 0)


def from_influence(value: float, influence: np.ndarray) -> Estimate:
    """Return an estimate whose error is the mean of one contribution per run.

    The delta method: a smooth function g of means of per-run scores s has
    ``influence[r] = grad g . (s[r] - mean(s))`` and the standard error
    ``std(influence) / sqrt(runs)``. A paired comparison under common random numbers
    puts both scores of a run into one contribution, for example the log ratio of two
    mean squared errors: ``a / mean(a) - b / mean(b)``.

    Parameters
    ----------
    value : float
        The estimate.
    influence : ndarray, shape (runs,)
        Contribution of each run to the error, in the unit of `value`; its mean is
        near 0 and is not used.

    Raises
    ------
    ValueError
        If there are fewer than two runs or a number is not finite.

    References
    ----------
    A. W. van der Vaart, *Asymptotic Statistics*, Cambridge University Press, 1998,
    chapters 3 and 20; Student's t quantile in place of the normal one.
    """
    influence = np.asarray(influence, dtype=float)
    if influence.ndim != 1 or influence.size < 2 or not np.isfinite(influence).all():
        raise ValueError("need one finite number for each of at least 2 runs")
    count = influence.size
    se = float(np.std(influence, ddof=1)) / math.sqrt(count)
    half = float(stats.t.ppf(0.5 + LEVEL / 2, count - 1)) * se
    value = float(value)
    return Estimate(value, value - half, value + half, se, count)


def mean(samples: np.ndarray) -> Estimate:
    """Return the mean of independent `samples`, shape (runs,), with Student's t interval."""
    samples = np.asarray(samples, dtype=float)
    return from_influence(samples.mean(), samples - samples.mean())


def root_mean_square(squared: np.ndarray) -> Estimate:
    """Return the root of the mean of `squared` errors, shape (runs,), one number per run.

    For an RMSE over runs and time hand in each run's mean over time: errors within a
    run are not independent.
    """
    squared = np.asarray(squared, dtype=float)
    value = math.sqrt(squared.mean())
    if value == 0.0:
        return from_influence(0.0, np.zeros_like(squared))
    return from_influence(value, (squared - squared.mean()) / (2.0 * value))


def share(wins: int, count: int) -> Estimate:
    """Return the share of `wins` among `count` independent trials, with Wilson's interval.

    Raises
    ------
    ParameterError
        If `count` is below 1 or `wins` is not between 0 and `count`.

    References
    ----------
    E. B. Wilson, "Probable inference, the law of succession, and statistical
    inference", *Journal of the American Statistical Association* 22 (1927) 209-212.
    """
    count = integer("count", count, at_least=1)
    wins = integer("wins", wins, at_least=0, at_most=count)
    p = wins / count
    z = float(stats.norm.ppf(0.5 + LEVEL / 2))
    centre = (p + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z / (1 + z**2 / count) * math.sqrt(p * (1 - p) / count + z**2 / (4 * count**2))
    # At 0 and 1 the interval ends at the value: rounding must not put it outside.
    low, high = min(p, max(0.0, centre - half)), max(p, min(1.0, centre + half))
    return Estimate(p, low, high, math.sqrt(p * (1 - p) / count), count)
