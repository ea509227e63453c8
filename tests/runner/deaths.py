"""Die at every file operation of a run, then run again: what must hold at each death.

``python deaths.py CHECKOUT ACTION [ERROR]``, with the checkout of `conftest.finished`. Prints
the number of deaths on the last line, and a line for each fault before it.

With ERROR the run does not die: from that operation on the disk is full (ENOSPC) or may only
be read (EROFS), and the run must end with one line that says so.
"""

import errno
import hashlib
import json
import os
import shutil
import sys
from functools import cache
from pathlib import Path

import nbformat
import papermill

from seanav import runner
from seanav.__main__ import main

WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC
CHANGES = {"os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.utime", "os.truncate", "os.link"}


# What a full disk still allows; one that may only be read allows no change at all.
ON_A_FULL_DISK = CHANGES - {"os.mkdir", "os.link"}


class Disturbed:
    """What happens at the operation `number` on a file, and from there on if it is an error."""

    def __init__(self, number, half_written, error):
        self.number, self.half_written, self.error = number, half_written, error
        self.count, self.busy = 0, False
        sys.addaudithook(self.hook)

    @property
    def happened(self):
        return self.count >= self.number

    def hook(self, event, arguments):
        opened = event == "open" and arguments[2] & WRITING and arguments[0] != os.devnull
        if self.busy or not (opened or event in CHANGES):
            return
        self.count += 1
        if not self.happened:
            return
        if self.half_written and opened and self.count == self.number:
            self.busy = True
            with open(arguments[0], "w", encoding="utf-8") as file:
                file.write('{"half')
            self.busy = False
        if not self.error:
            os._exit(9)
        if self.error == errno.EROFS or event not in ON_A_FULL_DISK:
            raise OSError(self.error, os.strerror(self.error), str(arguments[0]))


def ends(number, half_written, words):
    """Run with `words` in a process of its own; return whether it was disturbed, and faults."""
    said = WORK / "said"
    child = os.fork()
    if child == 0:
        with open(said, "wb") as file:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            os.dup2(file.fileno(), 2)
        disturbed = Disturbed(number, half_written, ERROR)
        code = main(words)
        sys.stderr.flush()
        os._exit(code + 2 * disturbed.happened)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if not ERROR:
        return code == 9, []
    text = said.read_text(encoding="utf-8")
    lines = text.splitlines()
    told = len(lines) == 1 and os.strerror(ERROR) in lines[0] and lines[0].startswith("9_tiny: ")
    # Whatever can be done without stays undone without a word: remains of earlier runs.
    return code != 0, [] if (told if code == 3 else code in (0, 2)) else [f"code {code}: {text}"]


def tree(folder):
    return {
        p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()
    }


def results(folder, seed):
    """Write other results than those of the checkout, as a notebook would."""
    shutil.copytree(ORIGINAL / "paper_figures/9_tiny", folder / "9_tiny")
    about = json.loads((ORIGINAL / "build/full/9_tiny.json").read_text(encoding="utf-8"))
    (folder / "9_tiny.json").write_text(json.dumps(about | {"seed": seed}), encoding="utf-8")
    claims = folder / "9_tiny/claims.json"
    text = claims.read_text(encoding="utf-8").replace("positive", f"positive {seed}")
    claims.write_text(text, encoding="utf-8")


def execute(notebook, output, **_):
    book = nbformat.read(ORIGINAL / "build/full/9_tiny.ipynb", as_version=4)
    book.cells[-1].outputs[0].text = "seed 2\n"
    nbformat.write(book, str(output))
    results(Path(output).parent, seed=2)
    return book


def fits(root):
    """Return whether files, manifest and report belong together, without mending them."""
    figures = root / "paper_figures"
    if not (figures / "9_tiny").is_dir():
        return False
    files = {
        p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in (figures / "9_tiny").iterdir()
    }
    (entry,) = json.loads((figures / "manifest.json").read_text(encoding="utf-8")).values()
    word = "positive 2" if entry["seed"] == 2 else "positive”"
    return files == entry["files"] and word in (figures / "REPORT.md").read_text(encoding="utf-8")


def faults_of_a_full_run(root):
    stamp = root / "build/stamps/9_tiny"
    if stamp.exists() and not fits(root):
        yield "make has nothing to do, and the results do not fit"
    rules = stamp.with_suffix(".d")
    if rules.exists() and rules.read_bytes() != RULES:
        yield "half-written rules for make"
    wrong = [runner.check(root, fresh) for fresh in (FRESH[1], FRESH[2])]
    if [] not in wrong:
        yield f"after mending: {wrong}"
    if not fits(root):
        yield "not mended"
    runner.run(root, "9_tiny")
    if runner.check(root, FRESH[2]) or not fits(root) or rules.read_bytes() != RULES:
        yield "the next run did not end in a consistent state"
    names = {path.name for path in (root / "paper_figures").iterdir()}
    if names != {"9_tiny", "manifest.json", "REPORT.md", "claims.png"} or not stamp.exists():
        yield f"left behind: {names}"
    if list((root / "build/running").rglob("claims.json")):
        yield "work left behind in build/"


def faults_of_a_quick_run(root):
    folder = root / "build/quick/9_tiny"
    whole = [tree(FRESH[k] / "9_tiny") for k in (1, 2)]
    if folder.exists() and tree(folder) not in whole:
        yield "half-written results"
    if tree(root / "paper_figures") != tree(ORIGINAL / "paper_figures"):
        yield "a quick run touched the committed results"
    runner.run(root, "9_tiny", quick=True)
    if tree(folder) != whole[1]:
        yield "the next run is not complete"


def faults_of_a_store(root):
    path = root / "notebooks/9_tiny.ipynb"
    nbformat.read(path, as_version=4)
    runner.store(root, "9_tiny")
    if path.read_bytes() != STORED or len(list(path.parent.iterdir())) != 1:
        yield "not stored"


ORIGINAL, action, *error = Path(sys.argv[1]), *sys.argv[2:]
ERROR = getattr(errno, error[0]) if error else 0
WORK = ORIGINAL.parent / "-".join(["deaths", *sys.argv[2:]])
RULES = (ORIGINAL / "build/stamps/9_tiny.d").read_bytes()
FRESH = {seed: WORK / f"fresh{seed}" for seed in (1, 2)}
FRESH[1].mkdir(parents=True)
shutil.copytree(ORIGINAL / "paper_figures/9_tiny", FRESH[1] / "9_tiny")
shutil.copy(ORIGINAL / "build/full/9_tiny.json", FRESH[1])
results(FRESH[2], seed=2)
shutil.copytree(ORIGINAL, WORK / "stored")
runner.store(WORK / "stored", "9_tiny")
STORED = (WORK / "stored/notebooks/9_tiny.ipynb").read_bytes()
shutil.copytree(FRESH[1] / "9_tiny", ORIGINAL / "build/quick/9_tiny", dirs_exist_ok=True)

papermill.execute_notebook = execute
publish = sys.modules["seanav.runner.publish"]  # its name in the package is a function's
# What comes out the same each time is computed once: it is the files that are looked at.
drawn = publish.picture(runner.claims(ORIGINAL))
publish.picture = lambda everything: drawn
publish.version, imports = cache(publish.version), cache(publish.imports)
publish.imports = lambda *source: set(imports(*source))  # who takes from it takes from a copy
words, faults = {
    "full": (["run"], faults_of_a_full_run),
    "quick": (["run", "--quick"], faults_of_a_quick_run),
    "store": (["store"], faults_of_a_store),
}[action]
deaths = 0
terminal = os.dup(1)
# A full disk takes a part of a file; one that may only be read takes nothing.
for half_written in {errno.ENOSPC: (True,), errno.EROFS: (False,)}.get(ERROR, (False, True)):
    for number in range(1, 1000):
        root = WORK / f"{number}-{half_written}"
        shutil.copytree(ORIGINAL, root)
        ended, found = ends(number, half_written, ["--root", str(root), *words])
        if not ended:
            break
        deaths += 1
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what the runner prints
        try:
            found += faults(root)
        except Exception as error:
            found.append(f"{type(error).__name__}: {error}")
        sys.stdout.flush()
        os.dup2(terminal, 1)
        for fault in found:
            print(f"operation {number}, half-written {half_written}: {fault}", flush=True)
        shutil.rmtree(root)
print(deaths)
