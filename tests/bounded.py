"""Run a piece of code in a process of its own, with bounds on its time and memory."""

import os
import resource
import subprocess
import sys
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
