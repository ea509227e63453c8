"""Monte Carlo without a paper in it: random streams, parallel batches."""

import os
import sys
import zlib
from collections.abc import Callable, Iterable
from contextlib import contextmanager

import numpy as np
from joblib import Parallel, delayed
from tqdm import tqdm

from seanav import cluster
from seanav.checks import integer

# ---------------------------------------------------------------- random numbers


def streams(seed: int, purpose: str, count: int, *, first: int = 0) -> list[np.random.Generator]:
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
    first : int
        The run that the first of them belongs to.

    Raises
    ------
    ParameterError
        If `seed`, `count` or `first` is not such an integer.
    """
    seed = integer("seed", seed, at_least=0)
    count = integer("runs", count, at_least=1)
    first = integer("first", first, at_least=0)
    # CRC-32 only turns the name into a number; independence is SeedSequence's work. The key
    # is that of the run-th child that SeedSequence would spawn, without those before it.
    name = zlib.crc32(purpose.encode())
    keys = ((name, run) for run in range(first, first + count))
    return [np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key)) for key in keys]


def normals(seed: int, purpose: str, runs: int, shape: tuple[int, ...]) -> np.ndarray:
    """Return standard normal numbers, shape (runs, *shape); run r from its own stream."""
    generators = streams(seed, purpose, runs)
    numbers = np.empty((runs, *shape))
    for run, generator in enumerate(generators):
        numbers[run] = generator.standard_normal(shape)
    return numbers


# ---------------------------------------------------------------- parallel batches


def parallel_map(
    function: Callable,
    items: Iterable,
    *,
    threads: int | None = None,
    label: str | None = None,
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
        Takes one item.
    items : iterable
        The batches.
    threads : int, optional
        Default: environment variable ``SEANAV_THREADS``, else the number of processors.
        Of no effect if ``SEANAV_SCHEDULER`` names a cluster, see `seanav.cluster`.
    label : str, optional
        Text beside the progress bar.

    Raises
    ------
    ParameterError
        If `threads` is not an integer of at least 1, or the cluster cannot be used.
    """
    items = list(items)
    given: int | str | None = threads
    if given is None:
        text = os.environ.get("SEANAV_THREADS") or str(os.cpu_count() or 1)
        given = int(text) if text.isdecimal() else text
    threads = integer("threads", given, at_least=1)
    with _progress_bar(len(items), label) as advance:
        if where := cluster.address():
            results = cluster.results(function, items, where)
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
        with (
            open(device, "w", encoding="utf-8") as terminal,
            _bar(total, label, terminal, position=1) as bar,
        ):
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
