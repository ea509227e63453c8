"""Speed of paper 4: filter steps, the whole sweep, memory. Figures to read, nothing passes.

The kernels take turns; each figure is the least of its turns.
`python benchmarks/bench_imm_sea_current.py short` leaves the whole sweep out.
"""

import resource
import sys
import time
from pathlib import Path

import attrs
import numpy as np
from matplotlib.figure import Figure

from seanav.filters import ins
from seanav.studies.imm_sea_current import run
from seanav.studies.imm_sea_current.scenario import Scenario

TURNS = 5


def cpu(function):
    """Return the CPU time of one call in this thread, s."""
    start = time.thread_time()
    function()
    return time.thread_time() - start


def main():
    """Print the figures."""
    scenario = Scenario()
    sensors = run.sense(scenario, 0)
    ours = {
        "EKF": (run.EKF(0.1), 1.5),
        "AFEKF": (run.AFEKF(scenario, 0.1), 1.5),
        "IMM of two AFEKFs": (run.AFEKF(scenario, 0.1, 0.5), 4.0),
    }
    for filter_, _ in ours.values():
        run.fly(scenario, sensors, filter_, 0.5)  # compiles
    missions = ins.LANES * scenario.duration_s
    best = dict.fromkeys(ours, np.inf)
    for _ in range(TURNS):
        for name, (filter_, _) in ours.items():
            spent = cpu(lambda f=filter_: run.fly(scenario, sensors, f, 0.5)) / missions
            best[name] = min(best[name], spent)
    print(f"{'18 states, per step':24} {'CPU (µs)':>9} {'target (µs)':>12}")
    for name, spent in best.items():
        print(f"{name:24} {spent * 1e6:9.2f} {ours[name][1]:>12}")
    print(f"IMM of two against one EKF: {best['IMM of two AFEKFs'] / best['EKF']:.1f} times")

    counts, spent = (16, 32, 64, 128), []
    for runs in counts:
        some = attrs.evolve(scenario, runs=runs, duration_s=600.0)
        spent.append(cpu(lambda s=some: run.fly_all(s, [(run.EKF(0.1), 0.5)], threads=1)))
    figure = Figure(layout="constrained")
    axis = figure.add_subplot(xlabel="runs", ylabel="CPU time (s)", title="ten-minute missions")
    axis.plot(counts, spent, "o-")
    target = Path(__file__).parents[1] / "build" / "bench_imm_sea_current.png"
    target.parent.mkdir(exist_ok=True)
    figure.savefig(target)
    per_run = ", ".join(f"{1e3 * s / n:.1f}" for n, s in zip(counts, spent, strict=True))
    print(f"CPU time per run for {counts} runs: {per_run} ms (build/{target.name})")

    if "short" not in sys.argv:
        start, wall = time.process_time(), time.perf_counter()
        results = run.sweep(scenario)
        start, wall = time.process_time() - start, time.perf_counter() - wall
        flown = sum(name.startswith("IMM") + 1 for name in results if not name.startswith("pure"))
        flown *= len(scenario.sigma_true) * scenario.runs
        print(
            f"sweep of {flown} filter missions: {start:.0f} s CPU, {wall:.0f} s (target 200 s CPU)"
        )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory of this process: {peak:.0f} MB (target 2048)")


if __name__ == "__main__":
    main()
