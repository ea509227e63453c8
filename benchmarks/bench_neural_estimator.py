"""Speed of paper 2: teaching, network against Kalman filter. Nothing passes or fails.

Ratios are taken between things that ran in this one process.
"""

import attrs
import numpy as np
from timing import best_of

from seanav.filters import blended
from seanav.studies.neural_estimator import run
from seanav.studies.neural_estimator.scenario import Scenario


def main():
    scenario = attrs.evolve(Scenario(), runs=300)
    z = run.measure(scenario, run.course(scenario, "steady"))
    teacher = run.numerical(scenario, z)
    taught = run.first_teaching(scenario, z, teacher)
    start = z[:1, 0]
    one = attrs.evolve(scenario, runs=2)
    alone = run.first_teaching(one, z[:1], teacher[:1])[0].network
    points = np.ascontiguousarray(np.moveaxis(z[:1], 0, -1))
    K, _ = blended.gains(scenario.q, scenario.R, scenario.R, scenario.steps)
    rows = [
        ("teach 300 networks, H = 100", 5.0, lambda: run.first_teaching(scenario, z, teacher)),
        (
            "re-taught examination, 300 runs",
            None,
            lambda: run.examine(scenario, z, teacher, taught, "re-taught"),
        ),
        ("network, one run, 200 steps", None, lambda: alone(points)),
        (
            "numerical filter, one run, 200 steps",
            None,
            lambda: blended.estimate(z[:1], K, 0.3, start),
        ),
    ]
    print(f"{'what':40} {'wall (s)':>10} {'CPU (s)':>10} {'target (s)':>11}")
    times = {}
    for what, target, function in rows:
        times[what] = best_of(function, 3)
        wall, cpu = times[what]
        print(f"{what:40} {wall:10.4f} {cpu:10.4f} {target if target else '':>11}")
    ours = times["teach 300 networks, H = 100"][1] / 300
    print(f"teaching: {ours * 1e3:.1f} ms CPU a network")
    step = times["network, one run, 200 steps"][1] / scenario.steps
    kalman = times["numerical filter, one run, 200 steps"][1] / scenario.steps
    share = ours / (scenario.steps - scenario.examination)
    print(
        f"per step: network {step * 1e6:.1f} µs, with its teaching {(step + share) * 1e6:.0f} µs, "
        f"numerical filter in NumPy {kalman * 1e6:.1f} µs"
    )


if __name__ == "__main__":
    main()
