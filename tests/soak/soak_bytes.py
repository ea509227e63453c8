"""The same bytes from any number of threads and from an older processor: `make soak` runs this.

Each notebook in its quick form, with two and five threads here and with one on old kernels;
all that the runs leave in ``build/quick/`` is compared byte by byte.
"""

import json
import os
import shutil
import subprocess
import sys

import pytest
from cells import NOTEBOOKS, SMALL
from numpy._core import _multiarray_umath as numpy_kernels

# The kernels of numpy and OpenBLAS for any processor of this kind, in place of its newest ones.
# numpy takes the names of what it would use here; OpenBLAS has one name for each of the kinds.
NEWEST = [name for name in numpy_kernels.__cpu_dispatch__ if numpy_kernels.__cpu_features__[name]]
OLD = {
    "NPY_DISABLE_CPU_FEATURES": " ".join(NEWEST),
    "OPENBLAS_CORETYPE": "Prescott" if "X86_V2" in numpy_kernels.__cpu_baseline__ else "ARMV8",
}
WAYS = {
    "2 threads": {"SEANAV_THREADS": "2"},
    "5 threads": {"SEANAV_THREADS": "5"},
    "1 thread, old kernels": {"SEANAV_THREADS": "1"} | OLD,
}


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
    found = [left(tmp_path / way, stem, settings) for way, settings in WAYS.items()]
    assert f"{stem}/claims.json" in found[0]
    for way, other in zip(list(WAYS)[1:], found[1:], strict=True):
        names = sorted(found[0].keys() | other.keys())
        assert [name for name in names if found[0].get(name) != other.get(name)] == [], way
