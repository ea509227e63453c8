"""The Makefile and the environment it builds, on tiny checkouts."""

import errno
import fcntl
import hashlib
import json
import os
import shlex
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from tiny import CHECKOUT, FINISH, REPORT, STUDY, cell, empty_checkout, save

from seanav import environment, runner
from seanav.__main__ import words

PACKAGES = Path(pytest.__file__).parents[1]


def surroundings():
    """Return those of a shell of its own, not those of the make that runs the tests."""
    ours = ("MAKE", "MFLAGS", "PYTHON", "PIP_", "PAPER", "QUICK", "PARAMS", "SEANAV_")
    return {name: value for name, value in os.environ.items() if not name.startswith(ours)}


def make(root, *arguments, **settings):
    """Call make as from a shell of its own."""
    return subprocess.run(
        ["make", *arguments],
        cwd=root,
        env=surroundings() | {name: str(value) for name, value in settings.items()},
        check=False,
        capture_output=True,
        text=True,
    )


def planned(root, *arguments):
    """Return what ``make figures`` would call."""
    done = make(root, "--dry-run", "figures", *arguments)
    assert done.returncode == 0, done.stderr
    calls = [line.partition("-m seanav ")[2] for line in done.stdout.splitlines()]
    return [" ".join(call.split()) for call in calls if call]


def borrow(root):
    """Give a checkout an environment in which it finds the packages of this one."""
    command = [sys.executable, "-m", "venv", "--without-pip", root / ".venv"]
    subprocess.run(command, check=True)
    environment.mark(root, environment.wanted(root))
    (packages,) = (root / ".venv").glob("lib/python*/site-packages")
    (packages / "borrowed.pth").write_text(f"{PACKAGES}\n", encoding="utf-8")


def pretend(root):
    """Give a checkout an interpreter that only notes how it is called; return the calls."""
    note = root / "note.py"
    note.write_text(
        "import json, os, sys\n"
        "with open('calls', 'a') as file:\n"
        "    print(json.dumps([sys.argv[1:], dict(os.environ)]), file=file)\n",
        encoding="utf-8",
    )
    python = root / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    this = shlex.quote(sys.executable)
    python.write_text(
        f'#!/bin/sh\ncase $1 in -I) ;; *) exec {this} note.py "$@";; esac\n', encoding="utf-8"
    )
    python.chmod(0o755)

    def calls():
        if not (root / "calls").exists():
            return []
        return [
            json.loads(line) for line in (root / "calls").read_text(encoding="utf-8").splitlines()
        ]

    return calls


# ---------------------------------------------------------------- what runs again


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


DAMAGE = {
    "gone": None,
    "empty": lambda text: b"",
    "zeros": lambda text: bytes(len(text)),
    "first word": lambda text: text[:20],
    "first rule": lambda text: text[: text.index(b"\n") + 1],
    "in a word": lambda text: text[:-5],
    "in the last rule": lambda text: text[:-2],
    "another paper's": lambda text: text.replace(b"9_tiny", b"8_tiny"),
    "no rule": lambda text: b"\tfoo: bar\n" + text,
    "function": lambda text: text + b"$(error never)\n",
    "binary": lambda text: text + b"\xff\xfe: \x00",
}


@pytest.mark.parametrize("name", DAMAGE)
def test_damaged_notes_stop_nothing_and_the_paper_runs_again(finished, name):
    assert planned(finished) == []
    note = finished / "build" / "stamps" / "9_tiny.d"
    text = note.read_bytes()
    note.unlink()
    if DAMAGE[name]:
        note.write_bytes(DAMAGE[name](text))
    for target in ("help", "clean", "lint"):
        done = make(finished, "--dry-run", target)
        assert (done.returncode, done.stderr) == (0, ""), target
    assert planned(finished) == ["run --paper 9_tiny"]


def test_an_own_notebook_is_no_paper(finished):
    for name in ("Untitled", "my notes", "9_tiny-Copy1", "9_tiny copy", "it's", "a$b", "x"):
        shutil.copy(finished / "notebooks/9_tiny.ipynb", finished / f"notebooks/{name}.ipynb")
    assert planned(finished) == []
    assert planned(finished, "PAPER=9") == []
    assert runner.papers(finished) == ["9_tiny"]
    done = make(finished, "--dry-run", "test")
    assert " notebooks/9_tiny.ipynb\n" in done.stdout
    assert "Untitled" not in done.stdout + done.stderr


# ---------------------------------------------------------------- the command line


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ["PARAM=runs=20"],
            "unknown: PARAM=...; did you mean PAPER=, QUICK=, PARAMS=, SEED=, SCHEDULER=",
        ),
        (["paper=3"], "unknown: paper=...; did you mean"),
        (["PAPERS=3", "Quick=1"], "unknown: "),
        (["CHOSEN=8_other"], "unknown: CHOSEN=...; did you mean"),
        (["BIN=/bin"], "unknown: BIN=...; did you mean"),
        (["PAPER=7"], "no paper 7; there are: 8_other 9_tiny."),
        (["PAPER=9 7 6"], "no paper 7 6; there are: 8_other 9_tiny."),
        (["PAPER=9_tin"], "no paper 9_tin; there are: 8_other 9_tiny."),
        (["QUICK=maybe"], "QUICK=maybe: must be 1 or 0."),
        (["QUICK=2"], "QUICK=2: must be 1 or 0."),
        (["notebooks", "QUICK=1"], "QUICK belongs to: make figures."),
        (["test", "PARAMS=runs=2"], "PARAMS belongs to: make figures."),
        (["SEED=3"], "SEED belongs to: make confirm."),
        (["test", "SCHEDULER=local"], "SCHEDULER belongs to: make figures confirm."),
        (["confirm"], "make confirm SEED=...: a whole number"),
        (["PAPER=8", "PAPER=9"], 'given twice: PAPER; several papers are one word: PAPER="2 5".'),
        (["SEED=3", "PARAMS=a b=1", "QUICK=0", "PARAMS=", "QUICK:=1"], "given twice: PARAMS QUICK"),
        (["test", "PAPER=9"], "PAPER belongs to: make figures notebooks confirm."),
    ],
)
def test_make_refuses_what_it_would_not_follow(finished, words, message):
    save(finished, stem="8_other")
    calls = pretend(finished)
    done = make(finished, "figures", *words)
    assert done.returncode == 2
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
    assert calls() == []


@pytest.mark.parametrize("word", ["1", "true", "True", "YES", "on"])
def test_yes_is_quick(finished, word):
    assert planned(finished, f"QUICK={word}") == [
        'run --paper 9_tiny --quick --params="$SEANAV_PARAMS"'
    ]


@pytest.mark.parametrize("word", ["", " ", "0", "false", "False", "NO", "off"])
def test_no_is_not_quick(finished, word):
    assert planned(finished, f"QUICK={word}") == []
    assert planned(finished, f"QUICK={word}", "PARAMS= ") == []


def test_make_without_proc_asks_ps(finished):
    """As on macOS: the words of a value are not told from those of the command line, names are."""
    makefile = finished / "Makefile"
    text = makefile.read_text(encoding="utf-8").replace("/proc/", "/none/")
    makefile.write_text(text, encoding="utf-8")
    tools = finished / "tools"
    tools.mkdir()
    (tools / "ps").write_text(
        "#!/bin/sh\necho make figures PAPER=8 b c PAPER=9\n", encoding="utf-8"
    )
    (tools / "ps").chmod(0o755)
    done = make(finished, "help", PATH=f"{tools}:{os.environ['PATH']}")
    assert done.stderr.startswith("Makefile:")
    assert "given twice: PAPER;" in done.stderr
    (tools / "ps").write_text("#!/bin/sh\nexit 127\n", encoding="utf-8")  # there is none
    done = make(finished, "help", "PAPER=", PATH=f"{tools}:{os.environ['PATH']}")
    assert (done.returncode, done.stderr) == (0, "")


def test_several_papers(finished):
    for stem in ("5_b", "8_other", "15_c"):
        save(finished, stem=stem)
    assert planned(finished, "PAPER=5 8") == ["run --paper 5_b", "run --paper 8_other"]
    (call,) = planned(finished, "PAPER=8 5_b", "QUICK=1")
    assert call.startswith("run --paper 5_b --paper 8_other --quick")


def test_only_the_command_line_counts(finished):
    calls = pretend(finished)
    settings = {"PAPER": "7", "QUICK": "1", "PARAMS": "runs=3", "PYTHON": "/none", "PARAM": "x"}
    for target in ("help", "figures"):
        done = make(finished, target, **settings)
        assert (done.returncode, done.stderr) == (0, ""), target
    assert calls() == []


TEXTS = {
    "two": ("runs=20 seed=7", ["runs=20", "seed=7"]),
    "single quotes": ("measured=['v','r']", ["measured=['v','r']"]),
    "double quotes": ('measured=["v","r"] runs=3', ['measured=["v","r"]', "runs=3"]),
    "blanks in a list": ("noise=[1.0, 2.0]  runs=3 ", ["noise=[1.0, 2.0]", "runs=3"]),
    "nested": ("t=[[0.9, 0.1], [0.1, 0.9]]", ["t=[[0.9, 0.1], [0.1, 0.9]]"]),
    "dollars": ("file=$HOME/$(x)/`y`$$ n=1", ["file=$HOME/$(x)/`y`$$", "n=1"]),
    "not ASCII": ("file=größe/地図.nc n=1", ["file=größe/地図.nc", "n=1"]),
    "blanks in a path": ("file=/my maps/a b.nc n=1", ["file=/my maps/a b.nc", "n=1"]),
    "apostrophe": ("file=Bob's.nc n=1", ["file=Bob's.nc", "n=1"]),
    "quoted": ("file='my map.nc' word=\"delta rule\"", ["file=my map.nc", "word=delta rule"]),
    "as in the notebook": ("word = 'printed' runs = 3", ["word=printed", "runs=3"]),
    "signs": ("a=#1;&|<>*?~\\ b=(1,)", ["a=#1;&|<>*?~\\", "b=(1,)"]),
    "comparison": ("text=x == y", ["text=x == y"]),
    "an option": ("--quick", ["--quick"]),
    "no value": ("runs 20 seed=3", ["runs 20", "seed=3"]),
}


@pytest.mark.parametrize("name", TEXTS)
def test_parameters_reach_the_program_as_typed(finished, name):
    text, expected = TEXTS[name]
    calls = pretend(finished)
    done = make(finished, "figures", f"PARAMS={text}", LC_ALL="C")
    assert (done.returncode, done.stderr) == (0, "")
    ((arguments, _),) = calls()
    *head, params = arguments
    assert head == ["-m", "seanav", "run", "--paper", "9_tiny"]
    assert params.encode(errors="surrogateescape") == f"--params={text}".encode()
    assert words(text) == expected


def test_no_setting_of_the_user_leaks_in(finished):
    calls = pretend(finished)
    names = "PYTHONPATH PYTHONSTARTUP PYTHONWARNINGS PYTHONDEVMODE PYTHONOPTIMIZE MATPLOTLIBRC "
    names += "MPLBACKEND JUPYTER_PATH JUPYTER_PLATFORM_DIRS PROJ_LIB PROJ_DATA GDAL_DATA "
    names += (
        "PYTEST_ADDOPTS NUMBA_DISABLE_JIT SEANAV_RESULTS SEANAV_PARAMS PAPER PARAMS VIRTUAL_ENV"
    )
    settings = dict.fromkeys(names.split(), "leak")
    kept = {"SEANAV_THREADS": "2", "HTTPS_PROXY": "", "TMPDIR": os.environ.get("TMPDIR", "/tmp")}
    make(finished, "figures", "PARAMS=runs=3", **settings, **kept, PIP_USER=1)
    ((_, environ),) = calls()
    assert [name for name, value in environ.items() if value == "leak"] == []
    assert environ["SEANAV_PARAMS"] == "runs=3"
    assert environ.items() >= (kept | {"PYTHONUTF8": "1", "OMP_NUM_THREADS": "1"}).items()
    assert Path(environ["MPLCONFIGDIR"]) == finished / "build/home/matplotlib"
    assert not environ.keys() & {"PAPER", "PARAMS", "QUICK", "PYTHON"}


# ---------------------------------------------------------------- the environment


@pytest.fixture(scope="module")
def shelf(tmp_path_factory):
    """A folder with one small wheel, and the lock that names it."""
    folder = tmp_path_factory.mktemp("shelf of wheels")
    wheel, info = folder / "tiny_thing-1.0-py3-none-any.whl", "tiny_thing-1.0.dist-info"
    with zipfile.ZipFile(wheel, "w") as file:
        file.writestr("tiny_thing.py", "")
        file.writestr(f"{info}/METADATA", "Metadata-Version: 2.1\nName: tiny-thing\nVersion: 1.0\n")
        file.writestr(
            f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any"
        )
        file.writestr(f"{info}/RECORD", "")
    digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
    return folder, f"tiny-thing==1.0 --hash=sha256:{digest}\n"


def place(root):
    """Return the folder of the package that a checkout's environment runs."""
    command = "import tiny_thing, seanav; print(*seanav.__path__)"
    done = subprocess.run(
        [root / ".venv/bin/python", "-I", "-c", command], check=True, capture_output=True, text=True
    )
    return Path(done.stdout.strip()).resolve()


def test_environment_belongs_to_its_folder_and_heeds_no_harmful_setting(root, shelf, tmp_path):
    folder, lock = shelf
    (root / "requirements.lock").write_text(lock, encoding="utf-8")
    other = tmp_path / "other"
    config = tmp_path / "pip.conf"
    config.write_text(
        f"[global]\nfind-links = {folder.as_uri()}\nno-index = true\nquiet = 1\n"
        f"[install]\nuser = true\nno-deps = true\nroot = {other}\nconstraint = /none\n",
        encoding="utf-8",
    )
    harmful = {"PIP_USER": 1, "PIP_TARGET": other, "PIP_PREFIX": other, "PIP_NO_BINARY": ":all:"}
    settings = {**harmful, "PIP_REQUIRE_VIRTUALENV": 1, "PIP_CONFIG_FILE": config}

    def built(root):
        done = make(root, ".venv", **settings)
        assert done.returncode == 0, done.stderr
        assert place(root) == (root / "src/seanav").resolve()
        return done.stdout

    first = make(root, ".venv", f"PYTHON={sys.executable}", **settings)
    assert first.returncode == 0, first.stderr
    assert first.stdout.startswith("building .venv anew, a few minutes: there is none")
    assert place(root) == root / "src/seanav"
    assert not other.exists()
    assert built(root) == ""  # it stands
    link = tmp_path / "link"
    link.symlink_to(root)
    assert built(link) == ""
    copy = shutil.copytree(root, tmp_path / "copy é $x 'y", symlinks=True)
    assert place(copy) == copy / "src/seanav"  # even before make mends it
    assert f"this one was built in {root}\n" in built(copy)
    assert built(copy) == built(root) == ""
    moved = root.rename(tmp_path / "moved")
    assert environment.fault(moved) == f"this one was built in {root}"
    borrowed = empty_checkout(tmp_path / "borrowed")
    (borrowed / "requirements.lock").write_text(lock + "\n", encoding="utf-8")
    (borrowed / ".venv").symlink_to(moved / ".venv")
    assert f"this one was built in {root}\n" in built(borrowed)
    assert place(moved) == moved / "src/seanav"  # untouched


def test_environment_is_rebuilt_for_a_reason_only(root, monkeypatch):
    assert environment.fault(root) == "there is none that was finished"
    borrow(root)
    assert environment.fault(root) == ""
    for text in ("", "{", "\0\0"):
        stamp = root / ".venv" / ".built"
        whole = stamp.read_text(encoding="utf-8")
        stamp.write_text(text, encoding="utf-8")
        assert environment.fault(root) == "there is none that was finished"
        stamp.write_text(whole, encoding="utf-8")
    os.utime(root / "requirements.lock")
    assert environment.fault(root) == ""
    monkeypatch.setattr(sys, "base_prefix", "/elsewhere")
    assert environment.fault(root).startswith("this one has Python ")
    assert environment.fault(root).endswith(" in /elsewhere")
    monkeypatch.undo()
    with (root / "requirements.lock").open("a", encoding="utf-8") as file:
        file.write("\n")
    assert environment.fault(root) == "requirements.lock has changed"


def test_a_lock_that_changes_while_packages_are_installed_is_installed_next(root, monkeypatch):
    def slowly(folder, *what):
        (folder / "lib" / "python3" / "site-packages").mkdir(parents=True)
        with (root / "requirements.lock").open("a", encoding="utf-8") as file:
            file.write("\n")

    monkeypatch.setattr(environment, "install", slowly)
    environment.build(root)
    assert environment.fault(root) == "requirements.lock has changed"


def test_default_interpreter_is_that_of_the_environment(root):
    borrow(root)
    fake = root / "fake" / "python3"
    fake.parent.mkdir()
    fake.write_text("#!/bin/sh\necho another >&2\n", encoding="utf-8")
    fake.chmod(0o755)
    path = f"{fake.parent}:{os.environ['PATH']}"
    done = make(root, ".venv", PATH=path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert "another" in make(root, ".venv", f"PYTHON={fake}", PATH=path).stderr
    (root / ".venv/bin/python").unlink()  # as when its interpreter was removed
    assert "another" in make(root, ".venv", PATH=path).stderr


def test_second_make_waits_for_the_environment(root):
    (root / "requirements.lock").write_text("", encoding="utf-8")
    (root / "build").mkdir()
    command = ["make", ".venv", f"PYTHON={sys.executable}"]
    options = {"cwd": root, "env": surroundings(), "stdout": subprocess.PIPE, "text": True}
    with (root / "build/environment.lock").open("w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with subprocess.Popen(command, **options) as second:
            said = second.stdout.readline()
            borrow(root)
            fcntl.flock(lock, fcntl.LOCK_UN)
            rest = second.stdout.read()
    assert said == "waiting for another make that builds .venv\n"
    assert rest == ""  # the first one's stands
    assert second.returncode == 0


INTERPRETERS = {
    "too old": ((3, 10, 4), True, "is Python 3.10.4, not 3.11 to 3.13: say make PYTHON=..."),
    "too new": ((3, 14, 0), True, "is Python 3.14.0, not 3.11 to 3.13: say make PYTHON=..."),
    "without venv": ((3, 11, 9), None, "lacks its venv module: install it"),
}


@pytest.mark.parametrize("name", INTERPRETERS)
def test_an_interpreter_that_lacks_something_is_named(root, name, monkeypatch):
    version, venv, message = INTERPRETERS[name]
    monkeypatch.chdir(root)
    monkeypatch.setattr(sys, "version_info", version)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: venv)
    with pytest.raises(SystemExit, match=message.split(":")[0]) as caught:
        environment.main([])
    assert str(caught.value).startswith(f"{sys.executable} {message}")
    assert not (root / ".venv").exists()


@pytest.mark.parametrize("text", ["", "#!/bin/sh\nexit 1\n", "#!/none\n"])
def test_an_interpreter_that_does_not_run_is_named(root, text):
    python = root / "my python"
    if text:
        python.write_text(text, encoding="utf-8")
        python.chmod(0o755)
    done = make(root, "figures", "QUICK=1", f"PYTHON={python}")
    assert done.returncode == 2
    assert done.stderr.startswith(f"{python} does not run: install Python 3.11, 3.12 or 3.13")
    assert not (root / ".venv").exists()


def test_no_environment_says_why_in_one_line(root):
    (root / "requirements.lock").write_text(
        "tiny-thing==1.0 --hash=sha256:" + "0" * 64, encoding="utf-8"
    )
    done = make(root, ".venv", f"PYTHON={sys.executable}", PIP_NO_INDEX=1)
    assert done.returncode == 2
    assert "\nno environment: " in done.stderr
    assert "Traceback" not in done.stderr
    assert environment.fault(root) == "there is none that was finished"


# As root, whom no permission stops, may meet them too.
REFUSING = """
import os, runpy, sys

def hook(event, arguments):
    if event == "os.mkdir" or (event == "open" and arguments[2] & (os.O_WRONLY | os.O_RDWR)):
        raise OSError({number}, os.strerror({number}), str(arguments[0]))

sys.addaudithook(hook)
runpy.run_path("src/seanav/environment.py", run_name="__main__")
"""


@pytest.mark.parametrize("number", [errno.EROFS, errno.ENOSPC])
def test_no_environment_on_a_disk_that_takes_nothing(root, number):
    command = [sys.executable, "-I", "-c", REFUSING.format(number=number)]
    done = subprocess.run(command, cwd=root, check=False, capture_output=True, encoding="utf-8")
    assert done.returncode == 1
    expected = f"no environment: [Errno {number}] {os.strerror(number)}: '{root / 'build'}'\n"
    assert done.stderr == expected
    assert not (root / ".venv").exists()


# ---------------------------------------------------------------- odd folders


def test_both_commands_work_in_an_odd_folder(tmp_path):
    root = empty_checkout(tmp_path / 'it\'s a $HOME & `größe` "3"; #1 地')
    save(root, cell(STUDY), cell(REPORT), cell(FINISH))
    shutil.copy(CHECKOUT / "conftest.py", root)
    (root / "tests").mkdir()
    (root / "tests" / "test_one.py").write_text(
        "def test_one():\n    import seanav\n", encoding="utf-8"
    )
    borrow(root)
    settings = {"LC_ALL": "C", "PYTHONWARNINGS": "error", "PYTHONSTARTUP": "/none"}
    for target in ("figures", "notebooks", "test"):
        done = make(root, target, **settings)
        assert done.returncode == 0, done.stdout + done.stderr
    assert make(root, "figures").stdout == "paper_figures/ is up to date: 9_tiny\n"
    assert not [p for p in tmp_path.iterdir() if p != root]


# ---------------------------------------------------------------- the lock


def test_lock_is_written_only_if_every_platform_can_install_it(root):
    borrow(root)
    uv = root / "tools" / "uv"
    uv.parent.mkdir()
    uv.write_text(
        "#!/bin/sh\n"
        'echo "$MACOSX_DEPLOYMENT_TARGET $*" >> asked\n'
        'case "$*" in\n'
        "  *compile*) for last; do :; done; echo new > $last;;\n"
        '  *"$REFUSED"*) exit 1;;\n'
        "esac\n",
        encoding="utf-8",
    )
    uv.chmod(0o755)
    path, before = (
        f"{uv.parent}:{os.environ['PATH']}",
        (root / "requirements.lock").read_text(encoding="utf-8"),
    )
    for refused in (
        "3.13 --python-platform aarch64-apple-darwin",
        "3.11 --python-platform aarch64-m",
    ):
        done = make(root, "lock", PATH=path, REFUSED=refused)
        assert done.returncode == 2
        assert "no lock for aarch64-" in done.stderr
        assert (root / "requirements.lock").read_text(encoding="utf-8") == before
    (root / "asked").unlink()
    done = make(root, "lock", PATH=path, REFUSED="nothing")
    assert (root / "requirements.lock").read_text(encoding="utf-8") == "new\n"
    asked = (root / "asked").read_text(encoding="utf-8").splitlines()
    platforms = [line for line in asked if "--python-platform" in line]
    assert len(platforms) == 9
    assert all(line.startswith("14.0 ") for line in platforms if "darwin" in line)
