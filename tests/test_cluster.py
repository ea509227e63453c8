"""Batches on a Dask cluster: a real scheduler and worker processes of their own."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import attrs
import numpy as np
import pytest

from seanav import cluster
from seanav.checks import ParameterError
from seanav.montecarlo import normals, parallel_map
from seanav.studies.imm_sea_current import run
from seanav.studies.imm_sea_current.scenario import Scenario

SOURCES = Path(cluster.__file__).resolve().parents[1]


def start(kind, *words, until, **environment):
    """Start a Dask process; return it and the last word of the line that holds `until`."""
    command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *words, "--no-dashboard"]
    process = subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, env=os.environ | environment
    )
    for line in process.stderr:
        if until in line:
            return process, line.split()[-1]
    raise AssertionError(f"{words}: {process.wait()}")


class Machines:
    """A scheduler and what has joined it."""

    def __init__(self):
        words = ("--host", "127.0.0.1", "--port", "0")
        scheduler, self.address = start("scheduler", *words, until="Scheduler at")
        self.processes = [scheduler]

    def join(self, **environment):
        words = (self.address, "--nthreads", "1", "--no-nanny")
        worker, _ = start("worker", *words, until="Registered to", **environment)
        self.processes.append(worker)

    def end(self):
        cluster.leave()
        for process in reversed(self.processes):
            process.kill()
            process.wait()
            process.stderr.close()


@pytest.fixture
def machines(monkeypatch):
    found = Machines()
    monkeypatch.setenv(cluster.VARIABLE, found.address)
    monkeypatch.setattr(cluster, "PATIENCE", 5)
    yield found
    found.end()


def refused(items=range(2), function=abs):
    with pytest.raises(ParameterError) as error:
        parallel_map(function, items)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_a_study_has_the_same_bits_on_a_cluster_as_in_threads(machines, monkeypatch):
    short = attrs.evolve(Scenario(), runs=40, duration_s=300.0, corner_radius=60.0, seed=3)
    jobs = [(run.PURE, 0.5), (run.EKF(0.1), 0.5), (run.AFEKF(short, 0.1, 0.5), 1.0)]
    machines.join()
    machines.join()
    far = run.fly_all(short, jobs, stride=60)
    monkeypatch.delenv(cluster.VARIABLE)
    for here, there in zip(run.fly_all(short, jobs, stride=60), far, strict=True):
        for one, other in zip(here.mean_squares, there.mean_squares, strict=True):
            assert one.tobytes() == other.tobytes()
        assert here.series.errors.tobytes() == there.series.errors.tobytes()


def test_local_functions_and_their_arrays_travel_and_come_back_in_order(machines):
    noise = normals(1, "noise", 9, (3,))
    machines.join()
    machines.join()
    found = parallel_map(lambda k: (k, noise[k].sum(), os.getpid()), range(9))
    assert [k for k, *_ in found] == list(range(9))
    assert np.array_equal([x for _, x, _ in found], noise.sum(axis=1))
    assert {pid for *_, pid in found} == {p.pid for p in machines.processes[1:]}


def test_what_a_function_holds_may_be_large(machines):
    machines.join()
    whole = np.arange(2_000_000.0)  # 16 MB: a warning here would stand in a notebook
    assert parallel_map(lambda k: float(whole[k]), [3, 1_999_999]) == [3.0, 1_999_999.0]


def test_a_worker_that_dies_costs_time_and_no_result(machines):
    machines.join()
    machines.join()
    doomed = machines.processes[1].pid

    def slow(k):
        if k >= 3 and os.getpid() == doomed:
            os.kill(doomed, signal.SIGKILL)
        time.sleep(0.05)
        return k * k

    assert parallel_map(slow, range(12)) == [k * k for k in range(12)]
    assert machines.processes[1].wait(timeout=10) == -signal.SIGKILL


def test_an_error_of_a_batch_is_passed_on_as_it_is(machines):
    machines.join()

    def fails(k):
        raise OSError(f"batch {k}")

    with pytest.raises(OSError, match="batch 0"):
        parallel_map(fails, range(3))


def test_other_sources_are_refused(machines, tmp_path):
    shutil.copytree(SOURCES / "seanav", tmp_path / "seanav")
    with (tmp_path / "seanav" / "models" / "earth.py").open("a", encoding="utf-8") as file:
        file.write("# another word\n")
    machines.join(PYTHONPATH=str(tmp_path))
    assert "must run the same sources" in refused()


def test_a_late_worker_with_other_sources_is_refused_too():
    with pytest.raises(ParameterError, match="must run the same sources"):
        cluster._computed(abs, "another hash", -1)
    assert cluster._computed(abs, cluster.sources(), -1) == 1


def test_no_worker_and_no_scheduler_are_one_line_each(machines, monkeypatch):
    assert "must have a worker" in refused()
    monkeypatch.setenv(cluster.VARIABLE, "tcp://127.0.0.1:9")
    assert "SCHEDULER = 'tcp://127.0.0.1:9': must be local or the address" in refused()
    monkeypatch.setenv(cluster.VARIABLE, "no address")
    assert "must be local or the address" in refused()


def test_a_scheduler_that_goes_away_is_one_line(machines):
    machines.join()
    scheduler = machines.processes[0].pid

    def killing(k):
        if k == 1:
            os.kill(scheduler, signal.SIGKILL)
        time.sleep(0.2)
        return k

    assert "went away" in refused(range(50), killing)


def test_a_cluster_of_this_machine_is_started(monkeypatch):
    monkeypatch.setenv(cluster.VARIABLE, "local")
    pids = parallel_map(lambda _: os.getpid(), range(8))
    assert os.getpid() not in pids
    cluster.leave()


def test_without_the_package_one_line_says_so(monkeypatch):
    monkeypatch.setenv(cluster.VARIABLE, "local")
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "needs the package distributed" in refused()


def test_a_run_asks_the_cluster_before_it_starts(machines):
    with pytest.raises(ParameterError, match="must have a worker"):
        cluster.check()
    machines.join()
    cluster.check()
