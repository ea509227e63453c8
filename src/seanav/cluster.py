"""A Dask cluster that takes the batches of a study: named by ``SEANAV_SCHEDULER``.

``local`` starts one on this machine, ``tcp://host:8786`` uses one that runs. A batch is the
same wherever it is computed, so results are those of a run in threads, bit for bit.
"""

import atexit
import hashlib
import logging
import os
import platform
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache, partial
from pathlib import Path
from typing import Any

import numba
import numpy as np
import scipy

from seanav.checks import ParameterError

VARIABLE, NAME = "SEANAV_SCHEDULER", "SCHEDULER"  # in the environment; on make's command line
OTHERS = "a worker must run the same sources and versions as you do"
PATIENCE = 20  # s until a scheduler must answer and have a worker


@cache
def sources() -> str:
    """Return a hash of what decides the numbers: the package's files and its numerics stack."""
    digest, package = hashlib.sha256(), Path(__file__).resolve().parent
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes())
    stack = (platform.python_version(), np.__version__, scipy.__version__, numba.__version__)
    digest.update(" ".join(stack).encode())
    return digest.hexdigest()[:16]


def address() -> str:
    """Return the scheduler that the environment names, empty for none."""
    return os.environ.get(VARIABLE, "")


def check() -> None:
    """Refuse a cluster that cannot be used, before any work starts.

    Raises
    ------
    seanav.checks.ParameterError
        As `results`.
    """
    if where := address():
        _check(_client(where), where)
        leave()


def results(function: Callable, items: Sequence, where: str) -> Iterator:
    """Yield ``function(item)`` for every item in order, computed on the cluster at `where`.

    A worker that dies costs the time of its batches; they are computed again.

    Parameters
    ----------
    function : callable
        Takes one item; sent by cloudpickle, so it may be a local function.
    where : str
        ``local`` or the address of a scheduler.

    Raises
    ------
    seanav.checks.ParameterError
        One line, if no scheduler answers, it has no workers, one of them runs other sources,
        or the scheduler goes away.
    """
    client = _client(where)
    from distributed import KilledWorker, wait

    _check(client, where)
    with _gone(where), warnings.catch_warnings():
        # What is scattered beforehand is lost with its worker; what is sent with the batches
        # is sent again.
        warnings.filterwarnings("ignore", "Sending large graph")
        futures = deque(client.map(partial(_computed, function, sources()), items, pure=False))
    while futures:
        future = futures.popleft()  # the cluster forgets a result that was fetched
        with _gone(where):
            wait(future)
            error = future.exception() if future.status == "error" else None
            result = None if error else future.result()
        if isinstance(error, KilledWorker):
            raise ParameterError(
                NAME, where, f"a batch was lost with several workers: {_line(error)}"
            )
        if error:
            raise error
        yield result


def _computed(function, expected, item):
    # On a worker, which may have come after the others were asked.
    if sources() != expected:
        raise ParameterError(NAME, platform.node(), OTHERS)
    return function(item)


_joined: dict[str, Any] = {}  # the client of the one cluster in use


def leave() -> None:
    """Close the connection to a cluster, and the cluster itself if it was started here."""
    while _joined:
        _, client = _joined.popitem()
        with suppress(Exception):  # there may be nobody left to say goodbye to
            client.close(timeout=2)
            if client.cluster is not None:
                client.cluster.close(timeout=10)


atexit.register(leave)


def _client(where):
    try:
        from distributed import Client, LocalCluster  # the extra `cluster`
    except ImportError:
        allowed = "needs the package distributed: pip install 'seanav[cluster]'"
        raise ParameterError(NAME, where, allowed) from None
    if where not in _joined:
        leave()
        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # a fault is one line
        try:
            at = where
            if where == "local":
                quiet = {"dashboard_address": ":0", "silence_logs": logging.CRITICAL}
                at = LocalCluster(threads_per_worker=1, **quiet)
            _joined[where] = _connected(Client, at)
        except (OSError, TimeoutError, ValueError) as error:
            allowed = f"must be local or the address of a Dask scheduler: {_line(error)}"
            raise ParameterError(NAME, where, allowed) from None
    return _joined[where]


def _connected(connect, at):
    try:
        return connect(at, timeout=PATIENCE)
    except AssertionError:  # its thread had not begun after ten seconds: a machine that slept
        return connect(at, timeout=PATIENCE)


def _check(client, where):
    """Refuse workers with other sources; each call asks again, for workers come and go."""
    with _gone(where):
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            allowed = f"must have a worker; none came within {PATIENCE} s"
            raise ParameterError(NAME, where, allowed) from None
        found = client.run(sources, on_error="return")
    for worker, theirs in found.items():
        if theirs != sources():
            raise ParameterError(NAME, where, f"worker {worker}: {OTHERS}")


@contextmanager
def _gone(where):
    from distributed import CancelledError
    from distributed.comm.core import CommClosedError

    try:
        yield
    except (CommClosedError, CancelledError, TimeoutError, OSError) as error:
        leave()
        allowed = f"the scheduler went away: {_line(error)}"
        raise ParameterError(NAME, where, allowed) from None


def _line(error):
    return " ".join(str(error).split()) or type(error).__name__
