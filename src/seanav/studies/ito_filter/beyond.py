"""Paper 1, beyond the paper: where second-order terms matter, and what the closure misses."""

from collections.abc import Sequence
from functools import cache
from itertools import combinations, pairwise

import attrs
import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from seanav.filters import moments
from seanav.models import bodies
from seanav.studies.ito_filter import run, scores
from seanav.studies.ito_filter.scenario import VEHICLES, Case, Scenario

# ---------------------------------------------------------------- second-order map


def second_order_map(scenario: Scenario, vehicle: str) -> list:
    """Return rows (noise factor, interval, two errors over the EKF's): Gaussian, truncated.

    Linear velocities measured with variance `map_R`, for `map_mission` s; truth in steps of
    `map_step`, which divides every interval, and the same for all of them. The last entries
    of a row are paired `Estimate` s.
    """
    case = Case(1, (0, 1, 2), scenario.map_R, "map")
    finest = min(scenario.map_interval)
    about = {"keep": finest, "mission": scenario.map_mission, "step": "map_step"}
    rows = []
    for factor in scenario.map_noise:
        noise = factor * scenario.noise(vehicle)
        fine = run.simulate(scenario, vehicle, noise, **about)
        for interval in scenario.map_interval:
            every = round(interval / finest)
            truth = attrs.evolve(fine, times=fine.times[::every], x=fine.x[:, ::every])
            tracks = {c: run.estimate(scenario, truth, case, c) for c in moments.CLOSURES}
            scored = {name: scores.score(truth, track) for name, track in tracks.items()}
            free = scores.score(truth, run.estimate(scenario, truth, case, corrected=False))
            errors = {name: scores.total(one, free) for name, one in scored.items()}
            gains = (
                scores.root_ratio(errors[c], errors["ekf"]) for c in ("gaussian", "second order")
            )
            rows.append((factor, interval, *gains))
    return rows


def falling(rows: list, along: int) -> tuple[int, ...]:
    """Return in how many lines of a map the Gaussian ratio falls all along, and of how many.

    `along` 1: with the interval, a line per noise factor; 0: with the noise factor, a line
    per interval. A line in which a filter diverged does not fall.
    """
    lines = {}
    for row in sorted(rows, key=lambda row: row[along]):
        lines.setdefault(row[1 - along], []).append(row[2])
    held = [line for line in lines.values() if not any(ratio.diverged for ratio in line)]
    falls = [all(b.value < a.value for a, b in pairwise(line)) for line in held]
    return sum(falls), len(lines)


# ---------------------------------------------------------------- sensitivity of P


def sensitivity(
    scenario: Scenario, vehicle: str, variances: Sequence, factors: Sequence
) -> np.ndarray:
    """Return the filter's own variance per run, (factors, variances, 8, 6): Remark 3.

    The mean over the second half of the mission; linear velocities are measured.
    """
    few = attrs.evolve(scenario, runs=8, particle_runs=2)
    out = np.empty((len(factors), len(variances), few.runs, 6))
    for i, factor in enumerate(factors):
        truth = run.simulate(few, vehicle, factor * scenario.noise(vehicle))
        for k, R in enumerate(variances):
            case = Case(1, (0, 1, 2), R, "sensitivity")
            track = run.estimate(few, truth, case)
            settled = track.P[:, track.P.shape[1] // 2 :]
            out[i, k] = np.diagonal(settled, axis1=2, axis2=3).mean(axis=1)
    return out


def roll_by_interval(scenario: Scenario) -> dict:
    """Return {interval (s): RMSE of the torpedo's roll p over prediction only} in case 1.

    At the scenario's interval and, if the steps of the truth fit into it, at `filter_step`.
    """
    fits = scenario.filter_step / scenario.torpedo_step
    often = [scenario.filter_step] if abs(fits - round(fits)) < 1e-9 * fits else []
    out = {}
    for interval in (scenario.interval, *often):
        truth = run.simulate(scenario, "torpedo", keep=interval)
        case = scenario.cases[0]
        tracks = (run.estimate(scenario, truth, case, corrected=c) for c in (True, False))
        one, free = (scores.score(truth, track).squared[:, 3] for track in tracks)
        out[interval] = scores.root_ratio(one, free)
    return out


# ---------------------------------------------------------------- planar closed form


@cache
def planar() -> moments.System:
    """Return an isotropic body in the plane with linear drag, r an Ornstein–Uhlenbeck process."""
    drift = ["v*r - d*u", "-u*r - d*v", "-k*r"]
    return moments.system("u v r", drift, [["0"], ["0"], ["g"]], parameters="d k g")


def planar_exact(
    z0: complex, r0: float, variance: float, d: float, k: float, g: float, times: ArrayLike
) -> tuple[np.ndarray, ...]:
    """Return E[u + iv] and tr Cov(u, v) in closed form at `times`, for a certain z0.

    z' = −(d + i r) z gives z = z0 e^{−dT} e^{−iθ} with θ = ∫ r Gaussian, so that
    E z = z0 e^{−dT} e^{−iE[θ] − ½ Var θ} and E|z|² = |z0|² e^{−2dT}.
    """
    times = np.asarray(times, dtype=float)
    reach = -np.expm1(-k * times) / k
    angle = r0 * reach
    spread = variance * reach**2
    spread += g**2 / k**2 * (times - 2 * reach - np.expm1(-2 * k * times) / (2 * k))
    mean = z0 * np.exp(-d * times - 1j * angle - spread / 2)
    return mean, np.abs(z0) ** 2 * np.exp(-2 * d * times) * -np.expm1(-spread)


def planar_closure(
    closure: str,
    z0: complex,
    r0: float,
    variance: float,
    d: float,
    k: float,
    g: float,
    times: np.ndarray,
) -> tuple[np.ndarray, ...]:
    """Return the same from a closure: mean u + iv and tr P_uv at equidistant `times`."""
    propagate = moments.Propagator(moments.close(planar(), closure))
    mean, P = np.array([[z0.real, z0.imag, r0]]), np.zeros((1, 3, 3))
    P[0, 2, 2] = variance
    out = [(z0, 0.0)]
    for gap in np.diff(times):
        propagate(mean, P, gap, 0.01, None, [d, k, g])
        out.append((complex(mean[0, 0], mean[0, 1]), P[0, 0, 0] + P[0, 1, 1]))
    return tuple(np.array(column) for column in zip(*out, strict=True))


# ---------------------------------------------------------------- Fokker–Planck reference


@cache
def sway_yaw() -> moments.System:
    """Return sway and yaw of the body at a held surge speed u0: two states, cubic drag.

    The six-state equations with w = p = q = 0 and u = u0, by substitution.
    """
    model = run.body()
    at = {x.name: x for x in (*model.states, *model.inputs, *model.parameters)}
    held = {at[name]: 0 for name in ("w", "p", "q")}
    drift = [model.drift[i].subs(held).subs(at["u"], "u0") for i in (1, 5)]
    names = ("u0", "m1", "m2", "j3", "a2", "a6", "c2", "c6", "g2", "g6", "tau2", "tau6")
    return moments.system("v r", drift, ["g2", "g6"], parameters=names)


@cache
def _sway_yaw_propagator(closure):
    return moments.Propagator(moments.close(sway_yaw(), closure))


def sway_yaw_parameters(u0: float, noise: tuple[float, ...]) -> list[float]:
    """Return the torpedo's numbers for `sway_yaw`, diffusion (v, r) given."""
    t = bodies.TORPEDO
    drags = (t.linear[1], t.linear[5], t.cubic[1], t.cubic[5])
    return [u0, *t.mass[:2], t.inertia[2], *drags, *noise, t.inputs[1], t.inputs[5]]


def sway_yaw_reference(
    noise: tuple[float, ...],
    duration: float,
    mean: np.ndarray,
    P: np.ndarray,
    u0: float = 1.0,
    half_widths: tuple[float, ...] = (1.8, 3.6),
) -> tuple:
    """Return {name: (mean, P)} of closures and the Fokker–Planck solution, and the density."""
    parameters = sway_yaw_parameters(u0, noise)
    u0, m1, m2, j3, a2, a6, c2, c6, _, _, t2, t6 = parameters

    def drift(v, r):
        sway = (-m1 * u0 * r + t2 - a2 * v - c2 * v**3) / m2
        return sway, ((m1 - m2) * u0 * v + t6 - a6 * r - c6 * r**3) / j3

    density = moments.fokker_planck(drift, np.square(noise), mean, P, duration, half_widths)
    out = {"Fokker–Planck": density.moments()[:2]}
    for closure in moments.CLOSURES:
        m, C = np.array([mean], dtype=float), np.array([P], dtype=float)
        _sway_yaw_propagator(closure)(m, C, duration, 0.01, None, parameters)
        out[closure] = m[0], C[0]
    return out, density


# ---------------------------------------------------------------- observability

POINT = ("1/2", "1/3", "-1/5", "1/7", "-2/5", "3/11")  # a rational state, nothing special
MEASURED = {"linear": slice(0, 3), "angular": slice(3, 6)}


def point(vehicle: str) -> dict:
    """Return {symbol: rational number} of `POINT` and of a vehicle's numbers and inputs."""
    model, craft = run.body(), bodies.BODIES[vehicle]
    out = dict(zip(model.states, POINT, strict=True))
    out |= dict(zip(model.parameters, (f"{value}" for value in craft.parameters()), strict=True))
    out |= dict(zip(model.inputs, map(str, craft.inputs), strict=True))
    return {symbol: sp.Rational(value) for symbol, value in out.items()}


@cache
def observability_rows(orders: int = 8) -> list:
    """Return rows (vehicle, measured, rank by order of the Lie derivative …)."""
    model, rows = run.body(), []
    for vehicle in VEHICLES:
        for words, chosen in MEASURED.items():
            ranks = moments.observability(model, model.states[chosen], point(vehicle), orders)
            rows.append((vehicle, words, *ranks))
    return rows


@cache
def observability_matrix(words: str) -> sp.ImmutableMatrix:
    """Return the gradients of the Lie derivatives of orders 0 to 2 in symbols, (9, 6).

    `words`: "linear" or "angular", what is measured. To this order the matrix is the same
    for inputs that change in time: they enter the derivatives added to the state, not
    multiplied by it.
    """
    model = run.body()
    derivatives = [sp.Matrix(model.states[MEASURED[words]])]
    for _ in range(2):
        slope = derivatives[-1].jacobian(model.states)
        derivatives.append((slope * model.drift).applyfunc(sp.expand))
    return sp.ImmutableMatrix(sp.Matrix.vstack(*derivatives).jacobian(model.states))


@cache
def minor(words: str, vehicle: str) -> tuple[tuple, sp.Rational]:
    """Return three rows of `observability_matrix` and their minor at `point`, exactly.

    With the three rows of order 0, which are the measured states themselves, they make a
    6 × 6 minor of that size, up to its sign. The first that is not 0; if all are, the last.
    """
    matrix = observability_matrix(words).xreplace(point(vehicle))
    rest = range(6)[slice(3, 6) if words == "linear" else slice(0, 3)]
    for rows in combinations(range(3, 9), 3):
        value = matrix.extract(list(rows), list(rest)).det()
        if value != 0:
            break
    return rows, value


# ---------------------------------------------------------------- Remark 2


def information_form(
    mean: sp.Matrix, P: sp.Matrix, z: sp.Matrix, C: sp.Matrix, R: sp.Matrix
) -> tuple[sp.Matrix, sp.Matrix]:
    """Return mean and covariance after a measurement, by Bayes' rule: the form of Remark 2.

    The exponents of prior and likelihood add: P⁺ = (P⁻¹ + Cᵀ R⁻¹ C)⁻¹ and
    m⁺ = m + P⁺ Cᵀ R⁻¹ (z − C m). Shapes (6, 1), (6, 6), (3, 1), (3, 6), (3, 3); any units.
    """
    after = (P.inv() + C.T * R.inv() * C).inv()
    return mean + after * C.T * R.inv() * (z - C * mean), after


@cache
def remark_two(words: str) -> tuple[int, int]:
    """Return in how many entries (12) or (13) and `information_form` differ: mean, covariance.

    In fractions, without rounding, at a full covariance that is nothing special.
    """
    C = sp.eye(6)[MEASURED[words], :]
    root = sp.Matrix(6, 6, lambda i, j: sp.Rational((3 * i + 5 * j) % 7 - 2, 1 + (i + 2 * j) % 5))
    P, R = root * root.T + sp.eye(6) / 3, sp.Matrix(3, 3, lambda i, j: sp.Rational(1, 2 + i + j))
    mean, z = sp.Matrix(list(map(sp.Rational, POINT))), sp.Matrix([1, -2, 3]) / 5
    gain = P * C.T * (C * P * C.T + R).inv()
    rest = sp.eye(6) - gain * C
    one = mean + gain * (z - C * mean), rest * P * rest.T + gain * R * gain.T
    other = information_form(mean, P, z, C, R)
    return tuple(sum(e != 0 for e in a - b) for a, b in zip(one, other, strict=True))
