"""How this package compiles its kernels: one decorator, one cache."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

_PACKAGE = Path(__file__).resolve().parent
_CHECKOUT = _PACKAGE.parent.parent


def _sources_digest() -> str:
    # numba's own cache looks only at the file that holds a kernel, so a kernel goes
    # stale when a function it calls changes elsewhere. Kernels live in these two
    # folders only, so a hash of both is a key that cannot go stale.
    digest = hashlib.sha256()
    for folder in ("models", "filters"):
        for path in sorted((_PACKAGE / folder).rglob("*.py")):
            digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


# An installed copy has no checkout to write into: numba's default place serves there.
CACHE = None
if (_CHECKOUT / "pyproject.toml").is_file():
    CACHE = _CHECKOUT / "build" / "numba" / _sources_digest()


def kernel(function: Callable) -> Callable:
    """Compile `function` for loops over arrays, the same bits on every machine.

    No ``fastmath`` and no BLAS call: the order of every addition is the one written.
    The interpreter lock is released, so `seanav.montecarlo.parallel_map` can run
    batches in threads. Division by zero follows IEEE 754.

    A kernel believes the shapes it is given and reads beyond an array that does not fit.
    Its name therefore begins with an underscore: it is called by other kernels, and by
    public functions that have checked what they hand on (`seanav.checks`).
    """
    # numba asks for the place of its cache here only; a user's own functions keep theirs.
    config: Any = numba.config  # whose settings are made at run time
    theirs = config.CACHE_DIR
    config.CACHE_DIR = str(CACHE or theirs)
    try:
        return numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    finally:
        config.CACHE_DIR = theirs
