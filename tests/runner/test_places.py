"""Wherever a checkout lies: short names, links, worktrees, a full disk, a disk that is not ours."""

import json
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from tiny import FINISH, REPORT, STUDY, cell, empty_checkout, save, tree

from seanav import runner
from seanav.runner import Refused
from seanav.runner.run import _demand_whole

# ---------------------------------------------------------------- a path of this machine

SHORT = [Path("/src"), Path("/git"), Path("/lab"), Path("/data/build")]


def book_of(text, **data):
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("1", execution_count=1)])
    book.cells[0].outputs = [
        nbformat.v4.new_output("stream", text=text),
        nbformat.v4.new_output("display_data", data=data),
    ]
    return book


@pytest.mark.parametrize("root", SHORT, ids=str)
def test_the_name_of_a_checkout_is_looked_for_in_text_and_as_a_whole(root):
    def demand(book, portable=True):
        _demand_whole(root, book, portable)

    # In a picture these letters come by chance; in a text they belong to other words.
    demand(book_of("1", **{"image/png": f"iVBOR {root} {root}/AA==", "text/plain": "<Figure>"}))
    near = f"a{root}/b m{root} .{root} {root}s {root}-2/x https://x.org{root}/y {root}.nc"
    demand(book_of(near, **{"text/html": near}))
    for text in (f"{root}", f"in {root}/own.nc", f"'{root}'", f"file={root}\n"):
        for book in (book_of(text), book_of("1", **{"text/plain": text, "image/png": "AA=="})):
            with pytest.raises(Refused, match=r"^cell 1 prints a path of this machine$"):
                demand(book)
            demand(book, portable=False)  # as with PARAMS: a user's own map may be named


def test_an_own_map_in_the_checkout_may_be_named(tmp_path):
    root = empty_checkout(tmp_path / "src")
    save(root, cell(STUDY), cell(REPORT), cell("print(name)"), cell(FINISH))
    runner.run(root, "9_tiny", words=(f"name={root}/own.nc",))


# ---------------------------------------------------------------- links and worktrees


def git(folder, *arguments):
    command = ["git", "-c", "user.name=x", "-c", "user.email=x", *arguments]
    done = subprocess.run(command, cwd=folder, check=True, capture_output=True, encoding="utf-8")
    return done.stdout.strip()


def seanav(root, *arguments):
    command = [sys.executable, "-m", "seanav", "--root", root, *arguments]
    return subprocess.run(
        list(map(str, command)), check=False, capture_output=True, encoding="utf-8"
    )


def test_a_worktree_knows_the_commit_of_its_regions(finished, tmp_path):
    room = finished / "src/seanav/studies/tiny"
    room.mkdir()
    (room / "claims.py").write_text('"""Regions."""\n', encoding="utf-8")
    (finished / ".gitignore").write_text("build\n__pycache__\n", encoding="utf-8")
    git(finished, "init", "-q")
    git(finished, "add", "--all")
    git(finished, "commit", "-q", "--message", "regions")
    tree = tmp_path / "tree"
    git(finished, "worktree", "add", "-q", "-b", "other", tree)
    (tree / "note").write_text("a commit that the first checkout is not at", encoding="utf-8")
    git(tree, "add", "note")
    git(tree, "commit", "-q", "--message", "note")

    def noted():
        done = seanav(tree, "run")
        assert (done.returncode, done.stderr) == (0, "")
        text = (tree / "paper_figures/manifest.json").read_text(encoding="utf-8")
        return json.loads(text)["9_tiny"]["regions_commit"]

    assert noted() == git(tree, "rev-parse", "HEAD") != git(finished, "rev-parse", "HEAD")
    (tree / "src/seanav/studies/tiny/claims.py").write_text('"""Others."""\n', encoding="utf-8")
    assert noted() is None  # these regions are in no commit
    assert git(finished, "status", "--porcelain") == ""


def test_a_link_to_a_checkout_is_the_checkout(finished, tmp_path):
    link = tmp_path / "link"
    link.symlink_to(finished)
    before = tree(finished / "paper_figures")
    done = seanav(link, "run")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith(", see paper_figures/9_tiny/\n")
    assert tree(finished / "paper_figures") == before
    assert runner.check(finished, finished / "build/full") == []
    # Paths are those of the checkout itself, and a notebook that prints them is refused.
    save(finished, cell(STUDY), cell("import os\nprint(os.getcwd())"))
    done = seanav(link, "run")
    assert (done.returncode, done.stderr) == (
        1,
        "9_tiny: cell 3 prints a path of this machine\n",
    )
    assert tree(finished / "paper_figures") == before
