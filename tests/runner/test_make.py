"""What make calls."""

import os
import subprocess
import sys

import pytest
from tiny import save


def make(root, *words):
    """Call make as from a shell of its own, not as from the make that runs the tests."""
    ours = ("MAKE", "MFLAGS", "PYTHON", "PAPER", "QUICK", "PARAMS")
    clean = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    command = ["make", f"PYTHON={sys.executable}", *words]
    return subprocess.run(command, cwd=root, env=clean, check=False, capture_output=True, text=True)


def planned(root, *words):
    """Return what ``make figures`` would call, its environment taken as built."""
    built = ".venv/.built-{}.{}.{}".format(*sys.version_info)
    done = make(root, "--dry-run", f"--old-file={built}", "figures", *words)
    assert done.returncode == 0, done.stderr
    calls = [line.partition("-m seanav ")[2] for line in done.stdout.splitlines()]
    return [" ".join(call.split()) for call in calls if call]


def test_make_runs_what_a_changed_file_concerns(finished):
    assert planned(finished) == []
    package = finished / "src" / "seanav"
    for path in (package / "__main__.py", package / "studies" / "__init__.py"):
        os.utime(path, (2e9, 2e9))  # no notebook imports them
    assert planned(finished) == []
    files = ("notebooks/9_tiny.ipynb", "src/seanav/report.py", "src/seanav/seanav.mplstyle")
    for path in map(finished.joinpath, (*files, "requirements.lock")):
        before = path.stat()
        os.utime(path, (2e9, 2e9))
        assert planned(finished) == ["run --paper 9_tiny"], path
        os.utime(path, (before.st_atime, before.st_mtime))
    assert planned(finished) == []
    (package / "checks.py").unlink()  # a file that is gone must not stop make
    assert planned(finished) == ["run --paper 9_tiny"]


def test_make_runs_new_papers_and_lost_results(finished):
    save(finished, stem="8_other")
    assert planned(finished) == ["run --paper 8_other"]
    assert planned(finished, "PAPER=9") == []
    (finished / "paper_figures" / "9_tiny" / "claims.json").unlink()
    assert planned(finished, "PAPER=9") == planned(finished, "PAPER=9_tiny")
    assert planned(finished, "PAPER=9") == ["run --paper 9_tiny"]


def test_make_hands_quick_and_parameters_to_the_runner(finished):
    assert planned(finished, "QUICK=1") == ["run --quick"]
    assert planned(finished, "PAPER=9", "QUICK=1", "PARAMS=runs=30 radii=(1,2)") == [
        "run --paper 9 --quick --param 'runs=30' 'radii=(1,2)'"
    ]


def test_make_names_a_paper_that_is_not_there(root):
    save(root)
    done = make(root, "figures", "PAPER=7")
    assert done.returncode == 2
    assert "no paper 7; there are: 9_tiny." in done.stderr


INTERPRETERS = {
    "too old": ("3.10.4", 0, "is Python 3.10.4, not 3.11 to 3.13: say make PYTHON=..."),
    "without venv": ("3.11.9", 1, "lacks its venv module: install it"),
    "none": ("", 1, "does not run: install Python 3.11, 3.12 or 3.13"),
}


@pytest.mark.parametrize("name", INTERPRETERS)
def test_make_says_what_an_interpreter_lacks(root, name):
    version, status, message = INTERPRETERS[name]
    python = root / "python"
    python.write_text(f'#!/bin/sh\ncase "$*" in *version*) echo {version};; esac\nexit {status}\n')
    python.chmod(0o755)
    done = make(root, "figures", "QUICK=1", f"PYTHON={python}")
    assert done.returncode == 2
    assert done.stderr.startswith(f"{python} {message}")
    assert not (root / ".venv").exists()
