"""Streams and parallel batches, each against an independent reference."""

import os
import threading
import time
import zlib

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient
from scipy import stats

from seanav import montecarlo
from seanav.checks import ParameterError
from seanav.montecarlo import normals, parallel_map, streams

# ---------------------------------------------------------------- random numbers


def test_run_meets_the_same_noise_whatever_the_number_of_runs():
    few = normals(7, "gyro", 3, (4, 2))
    many = normals(7, "gyro", 50, (4, 2))
    np.testing.assert_array_equal(few, many[:3])


def test_streams_differ_between_runs_purposes_and_seeds():
    base = normals(7, "gyro", 2, (100,))
    for other in (base[1], normals(7, "drift", 1, (100,))[0], normals(8, "gyro", 1, (100,))[0]):
        assert abs(np.corrcoef(base[0], other)[0, 1]) < 0.4
    assert not np.array_equal(base[0], base[1])


def test_streams_are_those_of_the_seed_the_name_and_the_run_on_every_machine():
    for run, generator in enumerate(streams(7, "gyro", 3)):
        sequence = np.random.SeedSequence(7, spawn_key=(zlib.crc32(b"gyro"), run))
        expected = np.random.default_rng(sequence).standard_normal(5)
        np.testing.assert_array_equal(generator.standard_normal(5), expected)


def test_normals_are_standard_normal_over_runs():
    # The first number of every stream: a bad spawn would correlate exactly these.
    first = normals(1, "gyro", 4000, (1,))[:, 0]
    assert stats.kstest(first, "norm").pvalue > 1e-3
    assert stats.kstest(1.05 * first + 0.1, "norm").pvalue < 1e-3  # the test has power


def test_normals_come_from_the_streams():
    expected = [generator.standard_normal((2, 3)) for generator in streams(3, "a", 4)]
    np.testing.assert_array_equal(normals(3, "a", 4, (2, 3)), expected)


@pytest.mark.parametrize(("seed", "count"), [(-1, 1), (1, 0), (1.0, 1), (1, True)])
def test_streams_name_the_bad_parameter(seed, count):
    with pytest.raises(ParameterError, match=r"^(seed|runs) = .*must be an integer"):
        streams(seed, "gyro", count)


# ---------------------------------------------------------------- parallel batches


def test_parallel_map_keeps_the_order_for_any_number_of_threads():
    def late_first(item):
        time.sleep(0.02 * (item == 0))
        return item**2

    for threads in (1, 2, 5):
        assert parallel_map(late_first, range(9), threads=threads) == [i**2 for i in range(9)]


def test_parallel_map_runs_in_as_many_threads_as_asked(monkeypatch):
    barrier = threading.Barrier(3, timeout=20)  # passes only if three threads meet
    assert parallel_map(lambda _: barrier.wait() >= 0, range(3), threads=3) == [True] * 3
    monkeypatch.setenv("SEANAV_THREADS", "3")
    assert parallel_map(lambda _: barrier.wait() >= 0, range(3)) == [True] * 3


def test_parallel_map_passes_an_error_on():
    def fails(item):
        raise ArithmeticError(f"batch {item}")

    with pytest.raises(ArithmeticError, match="batch"):
        parallel_map(fails, range(3), threads=2)


@pytest.mark.parametrize("threads", [0, -2, 1.5])
def test_parallel_map_names_bad_threads(threads):
    with pytest.raises(ParameterError, match=r"^threads = .*at least 1"):
        parallel_map(abs, [1], threads=threads)


def test_parallel_map_names_bad_threads_from_the_environment(monkeypatch):
    monkeypatch.setenv("SEANAV_THREADS", "many")
    with pytest.raises(ParameterError, match=r"^threads = 'many'"):
        parallel_map(abs, [1])


def test_progress_goes_to_the_named_terminal_and_nowhere_else(monkeypatch, capfd):
    reader, device = os.openpty()
    os.set_blocking(reader, False)  # an empty terminal is an error, not a wait
    monkeypatch.setenv("SEANAV_PROGRESS", os.ttyname(device))
    parallel_map(abs, range(3), label="batches")
    assert b"batches" in os.read(reader, 4096)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("setting", ["", None], ids=["runner without terminal", "pipe"])
def test_no_progress_where_nobody_looks(monkeypatch, capfd, setting):
    monkeypatch.delenv("SEANAV_PROGRESS")
    if setting is not None:
        monkeypatch.setenv("SEANAV_PROGRESS", setting)
    parallel_map(abs, range(3), label="batches")
    assert capfd.readouterr() == ("", "")


def test_progress_in_a_plain_terminal(monkeypatch, capsys):
    monkeypatch.delenv("SEANAV_PROGRESS")
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    parallel_map(abs, range(3), label="batches")
    assert "batches" in capsys.readouterr().err


def test_progress_in_a_live_notebook_is_cleared(monkeypatch, capsys):
    monkeypatch.delenv("SEANAV_PROGRESS")
    monkeypatch.setattr(montecarlo, "_in_jupyter", lambda: True)
    cleared = []
    monkeypatch.setattr("IPython.display.clear_output", lambda: cleared.append(True))
    parallel_map(abs, range(3), label="batches")
    assert "batches" in capsys.readouterr().err
    assert cleared == [True]


def test_no_progress_stays_in_a_notebook_run_by_hand(monkeypatch):
    monkeypatch.delenv("SEANAV_PROGRESS")
    code = (
        "from seanav import montecarlo\n"
        "assert montecarlo._in_jupyter()\n"
        "done = montecarlo.parallel_map(abs, range(3), label='batches')\n"
        "print(done)"
    )
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])
    NotebookClient(book, kernel_name="python3").execute()
    assert [output.text for output in book.cells[0].outputs] == ["[0, 1, 2]\n"]
