"""Speed of paper 3: filter steps, the main comparison, the sweep. Nothing passes or fails."""

import numpy as np
from timing import best_of

from seanav.filters import adaptive, kalman
from seanav.studies.adaptive_fading import beyond, run
from seanav.studies.adaptive_fading.scenario import Scenario


def main():
    scenario = Scenario()
    case = run.problem(scenario)
    noise = run.draw(scenario)
    _, z = run.simulate(case, noise)
    start = np.zeros((scenario.runs, len(case.B)))
    model = (case.Phi, case.believed, case.H, case.Q, case.R, start, case.P0, z)
    five = ("OKF", "SFF(1)", f"SFF({scenario.window})", "MFF(1)", f"MFF({scenario.window})")
    steps = z.shape[0] * z.shape[1]
    single = {"method": "single"}
    multiple = {"method": "multiple", "window": scenario.window}
    rows = [
        ("Kalman filter, 100 runs × 1000 steps", None, lambda: kalman.run(*model), 5),
        ("single factor, as printed", None, lambda: adaptive.run(*model, **single), 5),
        (f"multiple factors, μ = {scenario.window}", None,
         lambda: adaptive.run(*model, **multiple), 5),
        ("five filters, simulated and scored", 1.0,
         lambda: run.compare(scenario, case, noise, five), 5),
        (f"sweep of {scenario.settings} settings", 60.0, lambda: beyond.sweep(scenario), 1),
    ]  # fmt: skip
    print(f"{'what':40} {'wall (s)':>10} {'CPU (s)':>10} {'target (s)':>11} {'ns per step':>12}")
    for what, target, function, repeats in rows:
        wall, cpu = best_of(function, repeats)
        per_step = f"{cpu / steps * 1e9:12.0f}" if target is None else ""
        print(f"{what:40} {wall:10.4f} {cpu:10.4f} {target or '':>11} {per_step}")
    fast = best_of(lambda: kalman.run(*model))[1] / steps
    print(f"target: 250 ns per run and step with three measurements; here {fast * 1e9:.0f} ns")


if __name__ == "__main__":
    main()
