"""The process that runs notebooks: how it ends, and what of its surroundings a kernel sees.

Only the standard library is imported here: `install` must come before everything slow.
"""

import io
import logging
import os
import signal
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from fnmatch import fnmatchcase
from pathlib import Path

# ---------------------------------------------------------------- surroundings

# The only variables that reach the kernel of a run: whatever else a user has set for other
# programs (styles, start-up files, other kernels, other libraries' data) changes no result.
PASSED_ON = (
    *("PATH", "HOME", "USER", "LOGNAME", "TMPDIR", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH"),
    *("SEANAV_*", "OMP_*", "OPENBLAS_*", "MKL_*", "NPY_*", "NUMBA_*", "MPLCONFIGDIR"),
    "DASK_CONFIG",
)


def environment(root: Path, given: dict[str, str]) -> dict[str, str]:
    """Return the environment of a kernel: `PASSED_ON` of `given`, and what is ours.

    One thread per library, UTF-8 whatever the locale, figures without a screen, and
    nothing read from or written to a home directory.
    """
    home = root / "build" / "home"
    defaults = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
    defaults["MPLCONFIGDIR"] = str(home / "matplotlib")  # its list of fonts
    passed = {
        name: value
        for name, value in given.items()
        if any(fnmatchcase(name, pattern) for pattern in PASSED_ON)
    }
    ours = {
        "LC_ALL": "C.UTF-8",
        "PYTHONUTF8": "1",
        "PYTHONNOUSERSITE": "1",
        "MPLBACKEND": "agg",
        "IPYTHONDIR": str(home / "ipython"),
        "JUPYTER_CONFIG_DIR": str(home / "jupyter" / "config"),
        "JUPYTER_DATA_DIR": str(home / "jupyter" / "data"),
        "JUPYTER_RUNTIME_DIR": str(home / "jupyter" / "runtime"),
    }
    return defaults | passed | ours


# ---------------------------------------------------------------- the end

_ENDS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP"))
kernels = set()  # process groups that must not outlive this process
_starting = False
_postponed = None


def install() -> None:
    """Make this process one that a terminal starts: it ends in one line, it prints UTF-8.

    An end is sudden, wherever it comes: results are published so that this may happen
    at any moment, and no library gets the chance to tell how it was interrupted.
    """
    for number in _ENDS:
        if signal.getsignal(number) != signal.SIG_IGN:  # as nohup would have it
            signal.signal(number, _end)
    # The libraries' own notes, PYTHONWARNINGS and PYTHONDEVMODE do not concern a user.
    warnings.resetwarnings()
    warnings.simplefilter("ignore")
    logging.disable()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # and not what a caller put in its place
            stream.reconfigure(encoding="utf-8", errors="backslashreplace")


def finished() -> None:
    """Let nothing interrupt what is done: Python gives up its handlers before it is gone."""
    for number in _ENDS:
        signal.signal(number, signal.SIG_IGN)


def _end(number, frame):
    global _postponed
    if _starting:
        _postponed = number
        return
    for other in _ENDS:
        signal.signal(other, signal.SIG_IGN)
    for group in kernels:
        with suppress(ProcessLookupError):
            os.killpg(group, signal.SIGKILL)
    # A terminal shows ^C, or a progress bar, on this line already.
    os.write(2, b"\ninterrupted\n" if os.isatty(2) else b"interrupted\n")
    os._exit(128 + number)


@contextmanager
def starting_kernel() -> Iterator:
    """Put an end off while a kernel starts, until it is in `kernels`."""
    global _starting
    _starting = True
    try:
        yield
    finally:
        _starting = False
        if _postponed:
            _end(_postponed, None)
