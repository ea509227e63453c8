"""Streams, parallel batches and intervals, each against an independent reference."""

import math
import os
import threading
import time
import zlib
from concurrent.futures import ThreadPoolExecutor

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient
from scipy import stats

from seanav import montecarlo
from seanav.checks import ParameterError
from seanav.montecarlo import (
    Estimate,
    exact,
    from_influence,
    mean,
    normals,
    parallel_map,
    root_mean_square,
    share,
    streams,
)

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


def test_parallel_map_on_a_cluster_keeps_the_order():
    class Client:
        """The two calls of a Dask client that are used, on a pool of threads."""

        def map(self, function, items, pure):
            assert not pure  # Dask would merge batches that look equal
            return [pool.submit(function, item) for item in items]

    with ThreadPoolExecutor(2) as pool:
        assert parallel_map(abs, [-3, 2, -1], client=Client()) == [3, 2, 1]


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


# ---------------------------------------------------------------- intervals


def test_mean_has_the_textbook_t_interval():
    samples = np.random.default_rng(1).gamma(2.0, size=30)
    ours = mean(samples)
    reference = stats.ttest_1samp(samples, 0.0).confidence_interval(0.95)
    assert (ours.low, ours.high) == pytest.approx(tuple(reference), rel=1e-12)
    assert ours.se == pytest.approx(stats.sem(samples), rel=1e-12)
    assert ours.count == 30


@pytest.mark.parametrize(("wins", "count"), [(0, 14), (1, 14), (7, 14), (14, 14), (999, 1000)])
def test_share_is_the_wilson_interval(wins, count):
    ours = share(wins, count)
    reference = stats.binomtest(wins, count).proportion_ci(0.95, method="wilson")
    assert (ours.low, ours.high) == pytest.approx((reference.low, reference.high), abs=1e-12)
    assert ours.value == wins / count


@pytest.mark.parametrize(("wins", "count"), [(3, 2), (-1, 2), (0, 0), (1.0, 2)])
def test_share_names_the_bad_parameter(wins, count):
    with pytest.raises(ParameterError, match=r"^(wins|count) = "):
        share(wins, count)


def test_root_mean_square_has_the_delta_method_error():
    squared = np.random.default_rng(2).chisquare(2, 500)
    ours = root_mean_square(squared)
    assert ours.value == pytest.approx(math.sqrt(squared.mean()))
    # d sqrt(m) = dm / (2 sqrt(m))
    assert ours.se == pytest.approx(mean(squared).se / (2 * ours.value))


def test_root_mean_square_of_nothing_is_zero():
    assert root_mean_square(np.zeros(5)) == Estimate(0.0, 0.0, 0.0, 0.0, 5)


def coverage(estimate, truth, trials, seed):
    """Return (below, above): how often the true value lies outside, 2.5 % each."""
    rng = np.random.default_rng(seed)
    estimates = [estimate(rng) for _ in range(trials)]
    below = np.mean([truth < e.low for e in estimates])
    above = np.mean([truth > e.high for e in estimates])
    return below, above


def log_ratio(rng, paired=True):
    """Compare two errors that share most of their noise; the true log ratio is ln(1.1²)."""
    common = rng.standard_normal(200)
    a = (1.1 * (common + 0.3 * rng.standard_normal(200))) ** 2
    b = (common + 0.3 * rng.standard_normal(200)) ** 2
    other = b if paired else rng.permutation(b)
    influence = a / a.mean() - other / other.mean()
    return from_influence(math.log(a.mean() / b.mean()), influence)


INTERVALS = {
    "mean": (lambda rng: mean(rng.normal(3.0, 2.0, 12)), 3.0),
    "root mean square": (lambda rng: root_mean_square(rng.normal(0, 2.0, 400) ** 2), 2.0),
    "share": (lambda rng: share(int(rng.binomial(60, 0.8)), 60), 0.8),
    "paired log ratio": (log_ratio, math.log(1.21)),
}


@pytest.mark.parametrize("name", INTERVALS)
def test_intervals_cover_the_truth_in_95_percent(name):
    estimate, truth = INTERVALS[name]
    below, above = coverage(estimate, truth, 2000, seed=3)
    # Two-sided: both tails together near 5 %, neither far from its half.
    assert 0.03 < below + above < 0.07
    assert max(below, above) < 0.05


def test_coverage_test_sees_wrong_intervals():
    def too_narrow(rng):  # the normal quantile with 12 samples and no ddof
        samples = rng.normal(3.0, 2.0, 12)
        half = 1.96 * samples.std() / math.sqrt(12)
        return Estimate(samples.mean(), samples.mean() - half, samples.mean() + half, 1.0, 12)

    assert sum(coverage(too_narrow, 3.0, 2000, seed=3)) > 0.07
    unpaired = sum(coverage(lambda rng: log_ratio(rng, paired=False), math.log(1.21), 2000, 3))
    assert unpaired < 0.03  # ignoring the common noise makes the interval too wide


@pytest.mark.parametrize("bad", [[1.0], [], [[1.0, 2.0]], [1.0, math.nan], [1.0, math.inf]])
def test_from_influence_refuses_runs_without_an_interval(bad):
    with pytest.raises(ValueError, match="finite number for each of at least 2 runs"):
        from_influence(0.0, np.asarray(bad))


def test_estimate_refuses_a_value_outside_its_interval():
    with pytest.raises(ValueError, match="not an estimate"):
        Estimate(2.0, 0.0, 1.0, 0.5, 10)


def test_estimate_refuses_what_is_not_a_number():
    with pytest.raises(ValueError, match="not an estimate"):
        exact(math.nan)


def test_exact_has_no_width():
    assert exact(3) == Estimate(3.0, 3.0, 3.0, 0.0, 0)
