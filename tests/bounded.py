"""Run a piece of code with bounds: on its time, or in a process of its own, on memory too."""

import faulthandler
import os
import resource
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

TESTS = Path(__file__).resolve().parent
MEMORY = 4 * 2**30  # bytes of addresses; the compiler alone takes more than one of them


def run(code, *, seconds=60, **environment):
    """Return what `code` prints; fail if it dies, takes longer or needs more memory."""

    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))

    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=seconds,
        cwd=TESTS,  # so that the tests' own references can be imported
        env=os.environ | environment,
        preexec_fn=limit,
        check=False,
    )
    assert done.returncode == 0, f"code {done.returncode}: {done.stderr[-2000:]}"
    return done.stdout


@contextmanager
def limit(seconds):
    """Raise TimeoutError in what takes longer; end the process if a kernel never returns."""

    def late(number, frame):
        raise TimeoutError(f"no end within {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    faulthandler.dump_traceback_later(2 * seconds, exit=True, file=sys.__stderr__)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
