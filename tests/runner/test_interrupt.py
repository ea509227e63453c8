"""Ctrl-C, whenever it comes: one line, nothing half-written, no kernel left behind."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from tiny import FINISH, REPORT, STUDY, cell, save, tree

BUSY = "open('in_cell', 'w').close()\nimport time\ntime.sleep(60)"


@pytest.fixture
def start():
    """Start runs as a terminal does, each a process group of its own; none outlives the test."""
    started = []

    def start(root, *words):
        process = subprocess.Popen(
            [sys.executable, "-m", "seanav", "--root", str(root), "run", *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
            encoding="utf-8",
            # As from a terminal, even if these tests run under nohup, which a run would heed.
            preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
        )
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.communicate()


def wait_for(condition, seconds=60):
    end = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.005)
    return found


def listens(process):
    """Return whether the program has begun: the interpreter itself leaves SIGTERM alone."""
    status = Path(f"/proc/{process.pid}/status")
    if not status.exists():  # not Linux: a guess
        time.sleep(0.5)
        return True
    caught = status.read_text(encoding="utf-8").partition("SigCgt:")[2].split()
    return process.poll() is not None or bool(caught and int(caught[0], 16) >> 14 & 1)


def kernels(root):
    """Return the processes, apart from zombies, that run in the checkout."""
    found = []
    for process in psutil.process_iter():
        try:
            if process.status() != psutil.STATUS_ZOMBIE and process.cwd() == str(root):
                found.append(process)
        except psutil.Error:
            pass
    return found


def finish(process):
    _, error = process.communicate(timeout=60)
    return process.returncode, error


@pytest.fixture
def busy(root):
    save(root, cell(STUDY), cell(BUSY))
    return root


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.3, 1.7, 2.2])
def test_interrupt_at_any_moment_of_the_way_in(start, busy, delay):
    process = start(busy)
    wait_for(lambda: listens(process))
    time.sleep(delay)
    os.killpg(process.pid, signal.SIGINT)
    assert finish(process) == (130, "interrupted\n")
    wait_for(lambda: not kernels(busy), seconds=5)
    assert not (busy / "paper_figures/9_tiny").exists()


def test_interrupt_as_soon_as_there_is_a_kernel(start, busy):
    process = start(busy)
    wait_for(lambda: kernels(busy))
    os.killpg(process.pid, signal.SIGINT)
    assert finish(process) == (130, "interrupted\n")
    wait_for(lambda: not kernels(busy), seconds=5)


@pytest.mark.parametrize(
    ("number", "status", "error"),
    [
        (signal.SIGINT, 130, "interrupted\n"),
        (signal.SIGTERM, 143, "interrupted\n"),
        (signal.SIGHUP, 129, "interrupted\n"),
        (signal.SIGKILL, -9, ""),
    ],
)
def test_end_within_a_cell(start, busy, number, status, error):
    process = start(busy)
    wait_for((busy / "in_cell").exists)
    os.killpg(process.pid, number)
    assert finish(process) == (status, error)
    wait_for(lambda: not kernels(busy), seconds=5)
    assert not (busy / "paper_figures/9_tiny").exists()
    # Neither a lock nor what was half-written stops the next run.
    save(busy, cell(STUDY), cell(REPORT), cell(FINISH))
    again = start(busy)
    assert finish(again) == (0, "")
    assert not list((busy / "build").glob("running/*/*/*"))


@pytest.mark.parametrize("delay", [0.0, 0.01, 0.03, 0.1])
def test_interrupt_around_publication(start, finished, delay):
    before = tree(finished / "paper_figures")
    (finished / "build/full/9_tiny.ipynb").unlink()
    process = start(finished)
    wait_for((finished / "build/full/9_tiny.ipynb").exists)
    time.sleep(delay)
    os.killpg(process.pid, signal.SIGINT)
    assert finish(process) in [(130, "interrupted\n"), (0, "")]
    assert finish(start(finished)) == (0, "")
    assert tree(finished / "paper_figures") == before


def test_what_a_caller_ignores_stays_ignored(finished):
    command = [sys.executable, "-m", "seanav", "--root", str(finished), "list"]
    process = subprocess.Popen(
        ["sh", "-c", "trap '' HUP; echo ready; exec \"$@\"", "sh", *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
    )
    assert process.stdout.readline() == "ready\n"
    while process.poll() is None:
        process.send_signal(signal.SIGHUP)
        time.sleep(0.05)
    assert (process.communicate(), process.returncode) == (("9_tiny\n", ""), 0)
