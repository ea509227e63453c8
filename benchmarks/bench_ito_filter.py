"""Speed of paper 1: derivation, propagation, the run. Figures to read, nothing passes or fails."""

import subprocess
import sys
import time

import numpy as np
from timing import best_of

from seanav.filters import moments
from seanav.models import bodies
from seanav.studies.ito_filter import run
from seanav.studies.ito_filter.scenario import Scenario

RUNS, INTERVAL, STEP = 150, 0.5, 0.05
DERIVE = """
import time
from seanav.filters import moments
from seanav.studies.ito_filter import run
start = time.process_time()
model = run.body()
moments.characteristic(model), moments.exact(model)
for closure in moments.CLOSURES:
    moments.close(model, closure)
print(time.process_time() - start)
"""


def starts():
    """Return means (RUNS, 6) and covariances (RUNS, 6, 6) that differ from run to run."""
    x0, P0 = Scenario().prior("torpedo")
    mean = x0 + np.random.default_rng(0).standard_normal((RUNS, 6)) @ np.sqrt(P0)
    return mean, np.tile(P0, (RUNS, 1, 1))


def ours(closure):
    """Return (function that propagates all runs, its result)."""
    mean, P = starts()
    steps = round(INTERVAL / STEP)
    inputs = bodies.TORPEDO.forces(np.linspace(0, INTERVAL, 2 * steps + 1))
    parameters, propagate = bodies.TORPEDO.parameters(), run.propagator(closure)
    ends = mean.copy(), P.copy()
    propagate(*ends, INTERVAL, STEP, inputs, parameters)
    return lambda: propagate(mean.copy(), P.copy(), INTERVAL, STEP, inputs, parameters), ends


def plain(mean, P):
    """Propagate one EKF in NumPy, the few lines a reader would write: for a ratio."""
    body = bodies.TORPEDO
    M = np.array([*body.mass, *body.inertia])
    a, c = np.array(body.linear), np.array(body.cubic)
    Q = np.diag(np.square(body.noise))

    def f(x, tau):
        v, w = x[:3], x[3:]
        force = np.cross(M[:3] * v, w)
        moment = np.cross(M[3:] * w, w) + np.cross(M[:3] * v, v)
        return (np.concatenate([force, moment]) + tau - a * x - c * x**3) / M

    def rate(x, C, tau):
        eye = np.eye(6)
        A = np.array([(f(x + 1e-6 * e, tau) - f(x - 1e-6 * e, tau)) / 2e-6 for e in eye]).T
        return f(x, tau), A @ C + C @ A.T + Q

    x, C, t = mean, P, 0.0
    while t < INTERVAL - 1e-9:
        tau = body.forces([t, t + STEP / 2, t + STEP])
        k1 = rate(x, C, tau[0])
        k2 = rate(x + STEP / 2 * k1[0], C + STEP / 2 * k1[1], tau[1])
        k3 = rate(x + STEP / 2 * k2[0], C + STEP / 2 * k2[1], tau[1])
        k4 = rate(x + STEP * k3[0], C + STEP * k3[1], tau[2])
        parts = zip(k1, k2, k3, k4, strict=True)
        dx, dC = (STEP / 6 * (p + 2 * q + 2 * r + s) for p, q, r, s in parts)
        x, C, t = x + dx, C + dC, t + STEP
    return x, C


def main():
    print(f"{'what':52} {'wall':>10} {'CPU':>10} {'target':>10}")

    def line(what, wall, cpu, unit, target=""):
        print(f"{what:52} {wall:8.2f} {unit:2}{cpu:8.2f} {unit:2}{target:>9}")

    begin = time.perf_counter()
    shown = subprocess.run([sys.executable, "-c", DERIVE], capture_output=True, text=True)
    line("six-state derivation", time.perf_counter() - begin, float(shown.stdout), "s", "30 s")
    cpu = {}
    for closure in moments.CLOSURES:
        function, _ = ours(closure)
        wall, cpu[closure] = best_of(function)
        what = f"one interval, {closure}, per filter in a batch of {RUNS}"
        line(what, wall / RUNS * 1e6, cpu[closure] / RUNS * 1e6, "µs", "20 µs")
    mean, P = starts()
    wall, slow = best_of(lambda: plain(mean[0], P[0]), 3)
    line("the same in NumPy (ekf)", wall * 1e6, slow * 1e6, "µs")
    np.testing.assert_allclose(plain(mean[0], P[0])[0], ours("ekf")[1][0][0], rtol=1e-7)
    print(f"ekf against NumPy: {slow * RUNS / cpu['ekf']:.0f} times faster")
    scenario = Scenario()
    wall, used = best_of(lambda: run.run_all(scenario), 1)
    line(f"study: {scenario.runs} runs, all cases, all filters", wall, used, "s", "45 s")


if __name__ == "__main__":
    main()
