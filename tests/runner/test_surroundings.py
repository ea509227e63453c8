"""What a user has set for other programs changes no result and stops no run."""

import json
import os
import subprocess
import sys

import pytest
from tiny import tree

from seanav._process import environment

STYLE = "text.usetex: True\nlines.linewidth: 9\nfigure.figsize: 2, 2\n"
STARTUP = """
max = sorted = None
import matplotlib, os
matplotlib.rcParams["axes.linewidth"] = 9
os.environ["NUMBA_DISABLE_JIT"] = "1"
"""


def styles(root, home):
    (root / "matplotlibrc").write_text(STYLE, encoding="utf-8")
    (home / "matplotlibrc").write_text(STYLE, encoding="utf-8")
    return {"MATPLOTLIBRC": str(home / "matplotlibrc")}


def startup(root, home):
    script = home / "startup.py"
    script.write_text(STARTUP, encoding="utf-8")
    profile = home / "ipython" / "profile_default" / "startup"
    profile.mkdir(parents=True)
    (profile / "00.py").write_text(STARTUP, encoding="utf-8")
    return {"PYTHONSTARTUP": str(script), "IPYTHONDIR": str(home / "ipython")}


def other_kernel(root, home):
    folder = home / "jupyter" / "kernels" / "python3"
    folder.mkdir(parents=True)
    spec = {"argv": ["false", "{connection_file}"], "display_name": "x", "language": "python"}
    (folder / "kernel.json").write_text(json.dumps(spec), encoding="utf-8")
    return {"JUPYTER_PATH": str(home / "jupyter"), "JUPYTER_DATA_DIR": str(home / "jupyter")}


def strict_python(root, home):
    return {"PYTHONWARNINGS": "error", "PYTHONDEVMODE": "1"}


def poor_machine(root, home):
    return {"HOME": "/nonexistent", "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


@pytest.mark.parametrize("set_up", [styles, startup, other_kernel, strict_python, poor_machine])
def test_settings_of_a_user_change_no_byte(finished, tmp_path, set_up):
    before = tree(finished / "paper_figures")
    home = tmp_path / "home"
    home.mkdir()
    theirs = {"JUPYTER_DATA_DIR", "IPYTHONDIR", "PYTHONUTF8", "MPLBACKEND"}
    given = {name: value for name, value in os.environ.items() if name not in theirs}
    done = subprocess.run(
        [sys.executable, "-m", "seanav", "--root", str(finished), "run"],
        env=given | set_up(finished, home),
        check=False,
        capture_output=True,
        encoding="utf-8",
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert tree(finished / "paper_figures") == before


def test_a_kernel_gets_what_is_listed_and_what_is_ours(tmp_path):
    given = {
        "PATH": "/bin",
        "SEANAV_THREADS": "2",
        "OMP_NUM_THREADS": "3",
        "PYTHONPATH": "/x",
        "PROJ_DATA": "/y",
        "LC_CTYPE": "C",
        "PIP_INDEX_URL": "z",
    }
    found = environment(tmp_path, given)
    kept = {name for name in given if name in found}
    assert kept == {"PATH", "SEANAV_THREADS", "OMP_NUM_THREADS"}
    assert (found["OMP_NUM_THREADS"], found["MKL_NUM_THREADS"]) == ("3", "1")
    assert (found["LC_ALL"], found["PYTHONUTF8"]) == ("C.UTF-8", "1")


IMPORT = """
import matplotlib, numba
matplotlib.use("svg")
before = dict(matplotlib.rcParams), numba.config.CACHE_DIR
import seanav.filters.kalman, seanav.filters.moments, seanav.report, seanav.runner
import seanav.__main__, seanav.studies.ito_filter.figures
assert before == (dict(matplotlib.rcParams), numba.config.CACHE_DIR)
"""


def test_importing_the_package_leaves_numba_and_matplotlib_as_they_are():
    done = subprocess.run(
        [sys.executable, "-c", IMPORT], check=False, capture_output=True, encoding="utf-8"
    )
    assert (done.returncode, done.stderr) == (0, "")
