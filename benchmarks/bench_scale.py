"""From 100 to 100 000 missions of paper 4: time, memory, and what a cluster would make of it.

Each number of missions is flown in a process of its own: ten minutes, the IMM of two fading EKFs
in ten seas, so ten missions a run.
`python benchmarks/bench_scale.py short` stops at 10 000.
"""

import json
import os
import platform
import resource
import subprocess
import sys
import time
from pathlib import Path

from seanav import cluster
from seanav.studies.imm_sea_current import run
from seanav.studies.imm_sea_current.scenario import Scenario

COUNTS = (100, 1_000, 10_000, 100_000)
CORES = 32  # of a node, for the projection
HOURS = 2.0  # of the paper's missions


def flown(runs):
    """Fly; print wall and CPU time and the largest memory of this process as JSON."""
    few, many = (Scenario(runs=n, duration_s=600.0, trajectory="circle") for n in (16, runs))
    run.fly_all(few, jobs(few))  # compiles
    wall, cpu = time.perf_counter(), time.process_time()
    run.fly_all(many, jobs(many), stride=60, series=False)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps([wall, cpu, megabytes]))


def jobs(scenario):
    """Return one IMM in ten seas."""
    return [(run.AFEKF(scenario, 0.1, 0.5), 0.1 * k) for k in range(1, 11)]


def overhead(tasks=2000):
    """Return what a task costs a Dask scheduler that has nothing else to do, s."""
    list(cluster.results(abs, range(16), "local"))
    begun = time.perf_counter()
    list(cluster.results(abs, range(tasks), "local"))
    spent = time.perf_counter() - begun
    cluster.leave()
    return spent / tasks


def whole_task():
    """Return the CPU time of one batch of the paper's length: sensing, and one IMM, s."""
    scenario = Scenario(runs=16)
    scenario.path().increments()
    begun = time.process_time()
    sensors = run.sense(scenario, 0)
    run.fly(scenario, sensors, *jobs(scenario)[0])
    return time.process_time() - begun


def main():
    """Write the table and the projection; the short form only prints them."""
    short = sys.argv[1:] == ["short"]
    lines = [
        f"{platform.machine()}, {os.cpu_count()} processors; ten minutes of one IMM, ten a run:",
        "",
        "| missions | wall (s) | CPU (s) | CPU of a mission (ms) | memory (MB) |",
        "|---|---|---|---|---|",
    ]
    for count in COUNTS[:3] if short else COUNTS:
        command = [sys.executable, __file__, str(count // len(jobs(Scenario())))]
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE, encoding="utf-8")
        wall, cpu, megabytes = json.loads(done.stdout.splitlines()[-1])
        each = 1e3 * cpu / count
        lines.append(f"| {count} | {wall:.1f} | {cpu:.1f} | {each:.2f} | {megabytes:.0f} |")
    a_task, a_message = whole_task(), overhead()
    lines += [
        "",
        f"A batch of {run.LANES} missions of {HOURS:g} hours takes {a_task:.2f} s of a processor; "
        f"Dask adds {1e3 * a_message:.2f} ms to a batch. With that:",
        "",
        f"| nodes of {CORES} processors | missions an hour | bound by |",
        "|---|---|---|",
    ]
    for nodes in (1, 10, 100):
        processors, scheduler = nodes * CORES / a_task, 1 / a_message
        bound = "processors" if processors < scheduler else "the scheduler"
        missions = 3600 * run.LANES * min(processors, scheduler)
        lines.append(f"| {nodes} | {missions:.2g} | {bound} |")
    text = "\n".join(lines) + "\n"
    print(text)
    if not short:
        Path(__file__).with_name("SCALE.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    if sys.argv[1:] and sys.argv[1].isdecimal():
        flown(int(sys.argv[1]))
    else:
        main()
