"""The kernels beside other libraries, in one interleaved run: benchmarks/RESULTS.md and a picture.

    make bench-peers    builds build/peers, where all peers are, and writes the table
    make bench          times the studies, too

The cases take turns, and each figure is the least CPU time of its turns, so that a busy machine
disturbs all of them alike. Peers that compute the same numbers must show so first. The count is of
the multiply-adds of the textbook's dense form, each at the cost that it has in a compiled loop over
numbers in the cache: who is below does less than that form asks for, such as not to multiply by
zeros.
"""

import math
import platform
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import numba
import numpy as np
from bench_ito_filter import INTERVAL, RUNS, STEP, starts
from bench_ito_filter import ours as torpedo
from matplotlib import pyplot as plt

from seanav.models import bodies

ROOT = Path(__file__).resolve().parents[1]
TURNS = 5


@dataclass
class Case:
    """One operation: ours, the peers that do it, steps per call of each, multiply-adds."""

    name: str
    ours: tuple[Callable, int]
    operations: float
    peers: dict[str, tuple[Callable, int]] = field(default_factory=dict)


def kalman_operations(n, m):
    """Multiply-adds of one dense step of a Kalman filter, Joseph form, n states, m measured."""
    return 2 * n**3 + n * n + (n * n * m + n * m * m + m**3 / 3 + n * m * m) + 2 * n**3 + n * n * m


def agree(theirs, ours, rtol):
    """Stop if two results differ by more than a share of the largest number."""
    apart = np.abs(np.asarray(theirs) - ours).max() / np.abs(ours).max()
    if not apart < rtol:
        raise SystemExit(f"results differ by {apart:.2g} of the largest number")


def linear_filter():
    """Filter three states, all measured: the steering plane of paper 3, 100 runs."""
    from seanav.filters import kalman
    from seanav.studies.adaptive_fading import run
    from seanav.studies.adaptive_fading.scenario import Scenario

    scenario = Scenario()
    case = run.problem(scenario)
    z = run.simulate(case, run.draw(scenario))[1]
    runs, steps, _ = z.shape
    start, nothing = np.zeros((runs, 3)), np.zeros((steps, 3))
    model = (case.Phi, nothing, case.H, case.Q, case.R, start, case.P0, z)
    ours = kalman.run(*model).x
    found = Case(
        "Kalman filter, 3 states, 3 measured",
        (lambda: kalman.run(*model), runs * steps),
        kalman_operations(3, 3),
    )
    from filterpy.kalman import KalmanFilter

    def one_by_one():
        one = KalmanFilter(dim_x=3, dim_z=3)
        one.F, one.H, one.Q, one.R = case.Phi, case.H, case.Q, case.R
        one.P, one.x = case.P0.copy(), np.zeros(3)
        for k in range(400):
            one.predict()
            one.update(z[0, k])
        return one.x

    agree(one_by_one(), ours[0, 399], 1e-9)
    found.peers["filterpy"] = one_by_one, 400
    import simdkalman

    many = simdkalman.KalmanFilter(case.Phi, case.Q, case.H, case.R)

    # Its first state is that of the first measurement.
    first = case.Phi @ case.P0 @ case.Phi.T + case.Q

    def vectorised():
        return many.compute(z, 0, np.zeros(3), first, smoothed=False, filtered=True)

    agree(vectorised().filtered.states.mean, ours, 1e-9)
    found.peers["simdkalman"] = vectorised, runs * steps
    return found


def missions():
    """Fly two hours of paper 4: sixteen states and the mechanisation beside them."""
    from seanav.filters import ins
    from seanav.studies.imm_sea_current import linear, run
    from seanav.studies.imm_sea_current.scenario import Scenario

    scenario = Scenario()
    sensors = run.sense(scenario, 0)
    steps = int(ins.LANES * scenario.duration_s)

    def flown(filter_):
        return lambda: run.fly(scenario, sensors, filter_, 0.5), steps

    single = Case("EKF with its INS, 16 states, 1 measured", flown(run.EKF(0.1)), 0)
    single.operations = kalman_operations(16, 1)
    both = Case("IMM of two fading EKFs", flown(run.AFEKF(scenario, 0.1, 0.5)), 0)
    both.operations = 2 * single.operations + 4 * 16 * 17 / 2
    from filterpy.kalman import IMMEstimator, KalmanFilter

    Phi, H = linear.model(scenario.path(), scenario.correlation_time_s)

    def theirs(sigma):
        one = KalmanFilter(dim_x=18, dim_z=1)
        one.F, one.H, one.R = Phi[0], H[0][None], np.array([[scenario.log_noise**2]])
        one.Q = np.diag(linear.process_noise(scenario, 1e-4 * sigma**2))
        one.P = linear.believed_start(scenario, sigma) + 1e-18 * np.eye(18)
        return one

    def stepped(filter_):
        def call():
            for _ in range(200):
                filter_.predict()
                filter_.update(np.zeros((1, 1)))

        return call, 200

    pair = [theirs(0.1), theirs(0.5)]
    mixed = IMMEstimator(pair, np.array([0.5, 0.5]), np.array(scenario.transition))
    single.peers["filterpy (no INS)"] = stepped(theirs(0.1))
    both.peers["filterpy (no INS)"] = stepped(mixed)
    return [single, both]


def mechanisation():
    """Integrate an hour of increments at 10 Hz, north-east-down axes, height held."""
    from seanav.models import inertial

    steps, dt = 36_000, 0.1
    noise = np.random.default_rng(1).standard_normal((2, steps, 3))
    theta, dv = 1e-4 * noise[0], 1e-2 * noise[1] - np.array([0, 0, 9.8]) * dt
    position, v_n, q = np.array([0.6, 2.2, 0.0]), np.array([5.0, 0, 0]), np.eye(4)[0]
    found = Case(
        "strapdown mechanisation",
        (lambda: inertial.mechanise(position, v_n, q, theta, dv, dt), steps),
        120,
    )
    import pandas as pd
    import pyins.strapdown
    from pyins.util import LLA_COLS, RPH_COLS, VEL_COLS

    columns = ["theta_x", "theta_y", "theta_z", "dv_x", "dv_y", "dv_z"]
    increments = pd.DataFrame(np.hstack([theta, dv]), columns=columns)
    increments.insert(0, "dt", dt)
    increments.index = dt * (1 + np.arange(steps))
    degrees = [*np.degrees(position[:2]), 0.0]
    start = [*degrees, *v_n, 0.0, 0.0, 0.0]
    pva = pd.Series(start, index=[*LLA_COLS, *VEL_COLS, *RPH_COLS], name=0.0)

    def theirs():
        return pyins.strapdown.Integrator(pva, with_altitude=False).integrate(increments)

    mine = inertial.mechanise(position, v_n, q, theta, dv, dt)[-1, :4]
    agree(theirs()[["lat", "lon"]].to_numpy()[-1], np.degrees(mine[:2]), 1e-5)
    found.peers["python-ins"] = theirs, steps
    return found


def continuous_discrete():
    """Propagate the torpedo of paper 1, EKF, one interval: same scheme, steps and precision."""
    parts = round(INTERVAL / STEP)
    (ours, mine), (theirs, other) = torpedo("ekf"), cd_dynamax()
    for one, two in zip(other, mine, strict=True):
        agree(one, two, 1e-9)
    return Case(
        f"continuous-discrete EKF, 6 states, {parts} parts",
        (ours, RUNS),
        parts * 4 * (2 * 6**3 + 60),
        {"cd-dynamax": (theirs, RUNS)},
    )


def cd_dynamax():
    """Return (function that propagates all runs with cd-dynamax's EKF, its result)."""
    import diffrax
    import jax
    from cd_dynamax.src.continuous_discrete_nonlinear_gaussian_ssm import inference_ekf

    jax.config.update("jax_enable_x64", True)
    jnp, body = jax.numpy, bodies.TORPEDO
    M = jnp.array([*body.mass, *body.inertia])
    a, c, tau = (jnp.array(part) for part in (body.linear, body.cubic, body.inputs))

    def drift(x, u, t):
        v, w = x[:3], x[3:]
        force = jnp.cross(M[:3] * v, w)
        moment = jnp.cross(M[3:] * w, w) + jnp.cross(M[:3] * v, v)
        push = tau * (1 + 0.5 * jnp.sin(0.3 * t))
        return (jnp.concatenate([force, moment]) + push - a * x - c * x**3) / M

    class RungeKutta4(diffrax.AbstractERK):
        """The classical scheme, as ours."""

        tableau = diffrax.ButcherTableau(
            a_lower=(np.array([0.5]), np.array([0.0, 0.5]), np.array([0.0, 0.0, 1.0])),
            b_sol=np.array([1 / 6, 1 / 3, 1 / 3, 1 / 6]),
            b_error=np.zeros(4),
            c=np.array([0.5, 0.5, 1.0]),
        )
        interpolation_cls = diffrax.ThirdOrderHermitePolynomialInterpolation.from_k

        def order(self, terms):
            return 4

    fixed = {
        "drift": drift,
        "diffusion_cov": lambda x, u, t: jnp.eye(6),
        "diffusion_coefficient": lambda x, u, t: jnp.diag(jnp.array(body.noise)),
    }
    dynamics = SimpleNamespace(**{k: SimpleNamespace(f=f) for k, f in fixed.items()})
    settings = {"solver": RungeKutta4(), "dt0": STEP, "max_steps": round(INTERVAL / STEP) + 2}
    hyper = inference_ekf.EKFHyperParams(diffeqsolve_settings=settings)
    whole = SimpleNamespace(dynamics=dynamics)

    def one(mean, P):
        return inference_ekf._predict(mean, P, whole, 0.0, INTERVAL, None, hyper, warn=False)

    batch = jax.jit(jax.vmap(one))
    arguments = [jnp.array(part) for part in starts()]
    ends = [np.asarray(part) for part in batch(*arguments)]
    return lambda: jax.block_until_ready(batch(*arguments)), ends


def network():
    """Teach by the delta rule, 100 hidden neurons: paper 2."""
    from seanav.filters import neural
    from seanav.studies.neural_estimator import run
    from seanav.studies.neural_estimator.scenario import Scenario

    scenario = Scenario(runs=50)
    z = run.measure(scenario, run.course(scenario, "steady"))
    teacher = run.numerical(scenario, z)
    lesson = slice(scenario.settle, scenario.examination)
    pairs = z[:, lesson].shape[1]
    taught = run.first_teaching(scenario, z, teacher)
    epochs = sum(int(one.epochs.sum()) for one in taught)
    found = Case(
        f"delta rule, {scenario.hidden} hidden, one pair",
        (lambda: run.first_teaching(scenario, z, teacher), epochs * pairs),
        12 * scenario.hidden,
    )
    from sklearn.neural_network import MLPRegressor

    x, t = neural.scale(z[0, lesson]), neural.scale(teacher[0, lesson])
    options = {"activation": "logistic", "solver": "sgd", "alpha": 0.0, "momentum": 0.0}
    options |= {"batch_size": 1, "max_iter": 20, "n_iter_no_change": 20, "tol": 0.0}

    def theirs():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            MLPRegressor(hidden_layer_sizes=(scenario.hidden,), random_state=0, **options).fit(x, t)

    found.peers["scikit-learn"] = theirs, 20 * pairs
    return found


@numba.njit(cache=False, error_model="numpy")
def _multiply_adds(y, turns):
    """Sixteen of them on each number, in the order written: vectors over the numbers are free."""
    for _ in range(turns):
        for i in range(len(y)):
            x = y[i]
            for _ in range(16):
                x = x * 0.5 + 0.25
            y[i] = x


def spent(call):
    """Return the CPU time of one call in all threads, s."""
    begun = time.process_time()
    call()
    return time.process_time() - begun


def measured(cases):
    """Return {(case, who): least CPU time of a step, s}, all in turns."""
    y = np.linspace(0.1, 1.0, 1024)
    calls = {("multiply-add", ""): ((lambda: _multiply_adds(y, 2000)), 2000 * 16 * len(y))}
    for case in cases:
        calls[case.name, "seanav"] = case.ours
        calls |= {(case.name, who): call for who, call in case.peers.items()}
    for call, _ in calls.values():
        call()  # compiles
    least = dict.fromkeys(calls, math.inf)
    for _ in range(TURNS):
        for key, (call, steps) in calls.items():
            least[key] = min(least[key], spent(call) / steps)
    return least


def main():
    """Write the table and the picture."""
    cases = [linear_filter(), *missions(), mechanisation(), continuous_discrete(), network()]
    least = measured(cases)
    rate = least["multiply-add", ""]
    rows, bars = [], {}
    for case in cases:
        ours = least[case.name, "seanav"]
        bound = case.operations * rate
        for who in case.peers:
            theirs = least[case.name, who]
            rows.append((case.name, ours, bound, ours / bound, who, theirs, theirs / ours))
            bars[f"{case.name}: {who}"] = theirs / ours
    lines = [
        "# Speed",
        "",
        f"{platform.machine()}, Python {platform.python_version()}, NumPy {np.__version__}, Numba "
        f"{numba.__version__}; one multiply-add in a compiled loop: {1e9 * rate:.2f} ns. CPU time "
        "of one step of one run; least of "
        f"{TURNS} turns. The count is of the multiply-adds of the dense form. `make bench-peers` "
        "writes this file.",
        "",
        "| step | ours (µs) | count (µs) | ours over it | peer | its (µs) | its over ours |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, ours, bound, over, who, theirs, ratio in rows:
        cells = (f"{1e6 * ours:.3g}", f"{1e6 * bound:.3g}", f"{over:.1f}", who)
        lines.append(
            "| " + " | ".join((name, *cells, f"{1e6 * theirs:.3g}", f"{ratio:.3g}")) + " |"
        )
    text = "\n".join(lines) + "\n"
    here = ROOT / "benchmarks"
    (here / "RESULTS.md").write_text(text, encoding="utf-8")
    print(text)
    fig, axes = plt.subplots(figsize=(7.2, 0.6 + 0.36 * len(bars)), layout="constrained")
    axes.barh(list(bars), list(bars.values()), color="0.45")
    axes.set(xscale="log", xlabel="CPU time of the peer's step over that of ours")
    axes.axvline(1, color="k")
    axes.invert_yaxis()
    fig.savefig(here / "RESULTS.png", dpi=100)


if __name__ == "__main__":
    main()
