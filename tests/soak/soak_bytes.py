"""The same bytes from any number of threads and from an older processor: `make soak` runs this.

Each notebook in its quick form, with many threads here and with one on old kernels; all that
the runs leave in ``build/quick/`` is compared byte by byte.
"""

import json
import os
import shutil
import subprocess
import sys

import pytest
from cells import NOTEBOOKS, SMALL
from numpy._core import _multiarray_umath as numpy_kernels

from seanav.runner.check import _differences, _numbers

# The kernels of numpy and OpenBLAS for any processor of this kind, in place of its newest ones.
# numpy takes the names of what it would use here; OpenBLAS has one name for each of the kinds.
NEWEST = [name for name in numpy_kernels.__cpu_dispatch__ if numpy_kernels.__cpu_features__[name]]
OLD = {
    "NPY_DISABLE_CPU_FEATURES": " ".join(NEWEST),
    "OPENBLAS_CORETYPE": "Prescott" if "X86_V2" in numpy_kernels.__cpu_baseline__ else "ARMV8",
}
WAYS = {
    "5 threads": {"SEANAV_THREADS": "5"},
    "1 thread, old kernels": {"SEANAV_THREADS": "1"} | OLD,
}


# A result that is a rounding error itself, the least eigenvalue of a difference of covariances
# that is singular: 5e-12 of it, with ten digits of these.
LAST_DIGITS = ["3_adaptive_fading/claims.json"]


def put_out(notebook):
    """Return what the cells of a notebook printed and showed, however a kernel cut it up."""
    found = []
    for cell in json.loads(notebook)["cells"]:
        outputs = cell.get("outputs", [])
        printed = "".join("".join(one.get("text", "")) for one in outputs)
        found.append((printed, [one["data"] for one in outputs if "data" in one]))
    return json.dumps(found, sort_keys=True).encode()


def left(root, stem, settings):
    """Run a notebook in its quick form; return {file: bytes} of what that leaves."""
    (root / "notebooks").mkdir(parents=True)
    shutil.copy(NOTEBOOKS / f"{stem}.ipynb", root / "notebooks")
    command = [sys.executable, "-m", "seanav", "--root", root, "run", "--quick", "--paper", stem]
    done = subprocess.run(
        list(map(str, command)),
        env=os.environ | settings,
        check=False,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    folder, found = root / "build" / "quick", {}
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        data = path.read_bytes()
        data = put_out(data) if path.suffix == ".ipynb" else data
        found[path.relative_to(folder).as_posix()] = data
    return found


@pytest.mark.parametrize("stem", SMALL)
def test_threads_and_processors_change_no_byte(stem, tmp_path):
    roots = [tmp_path / way for way in WAYS]
    one, other = map(left, roots, [stem, stem], WAYS.values())
    assert f"{stem}/claims.json" in one
    names = sorted(one.keys() | other.keys())
    differ = [name for name in names if one.get(name) != other.get(name)]
    assert [name for name in differ if name not in LAST_DIGITS] == [], list(WAYS)
    for name in differ:
        old, new = (_numbers(root / "build" / "quick" / name) for root in roots)
        assert _differences(name, old, new, 1e-9, []) == []
