"""Paper 1, beyond the paper: where second-order terms matter, and what the closure misses."""

from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from seanav.filters import generated, moments
from seanav.models import bodies
from seanav.studies import ito_filter as study

# ---------------------------------------------------------------- second-order map


def second_order_map(scenario, vehicle) -> list:
    """Return rows (noise factor, interval, error of the Gaussian closure over the EKF's).

    Linear velocities measured with variance `map_R`, for `map_mission` s; truth in steps of
    `map_step`, which divides every interval, and the same for all of them. The last entry
    of a row is a paired `Estimate`, or None if a filter diverged.
    """
    case = study.Case(1, (0, 1, 2), scenario.map_R, "map")
    finest = min(scenario.map_interval)
    about = {"keep": finest, "mission": scenario.map_mission, "step": "map_step"}
    rows = []
    for factor in scenario.map_noise:
        noise = factor * scenario.noise(vehicle)
        fine = study.simulate(scenario, vehicle, noise, **about)
        for interval in scenario.map_interval:
            every = round(interval / finest)
            truth = replace(fine, times=fine.times[::every], x=fine.x[:, ::every])
            tracks = {c: study.estimate(scenario, truth, case, c) for c in ("gaussian", "ekf")}
            scores = {name: study.score(truth, track) for name, track in tracks.items()}
            free = study.score(truth, study.estimate(scenario, truth, case, corrected=False))
            gain = study.root_ratio(*(study.total(scores[c], free) for c in ("gaussian", "ekf")))
            rows.append((factor, interval, gain))
    return rows


def falling(rows, along):
    """Return in how many lines of a map the ratio falls all along, and of how many.

    `along` 1: with the interval, a line per noise factor; 0: with the noise factor, a line
    per interval. A line in which a filter diverged does not fall.
    """
    lines = {}
    for row in sorted(rows, key=lambda row: row[along]):
        lines.setdefault(row[1 - along], []).append(row[2])
    held = [line for line in lines.values() if None not in line]
    falls = [all(b.value < a.value for a, b in pairwise(line)) for line in held]
    return sum(falls), len(lines)


# ---------------------------------------------------------------- sensitivity of P


def sensitivity(scenario, vehicle, variances, factors) -> np.ndarray:
    """Return the filter's own sd, averaged over time, (factors, variances, 6): Remark 3."""
    few = replace(scenario, runs=8, particle_runs=2)
    out = np.empty((len(factors), len(variances), 6))
    for i, factor in enumerate(factors):
        truth = study.simulate(few, vehicle, factor * scenario.noise(vehicle))
        for k, R in enumerate(variances):
            case = study.Case(1, (0, 1, 2), R, "sensitivity")
            track = study.estimate(few, truth, case)
            settled = track.P[:, track.P.shape[1] // 2 :]
            out[i, k] = np.sqrt(np.diagonal(settled, axis1=2, axis2=3).mean(axis=(0, 1)))
    return out


# ---------------------------------------------------------------- planar closed form


@cache
def planar():
    """Return an isotropic body in the plane with linear drag, r an Ornstein–Uhlenbeck process."""
    drift = ["v*r - d*u", "-u*r - d*v", "-k*r"]
    return moments.system("u v r", drift, [["0"], ["0"], ["g"]], parameters="d k g")


def planar_exact(z0, r0, variance, d, k, g, times):
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


def planar_closure(closure, z0, r0, variance, d, k, g, times):
    """Return the same from a closure: mean u + iv and tr P_uv at equidistant `times`."""
    propagate = generated.Propagator(moments.close(planar(), closure))
    mean, P = np.array([[z0.real, z0.imag, r0]]), np.zeros((1, 3, 3))
    P[0, 2, 2] = variance
    out = [(z0, 0.0)]
    for gap in np.diff(times):
        propagate(mean, P, gap, 0.01, None, [d, k, g])
        out.append((complex(mean[0, 0], mean[0, 1]), P[0, 0, 0] + P[0, 1, 1]))
    return tuple(np.array(column) for column in zip(*out, strict=True))


# ---------------------------------------------------------------- Fokker–Planck reference


@cache
def sway_yaw():
    """Return sway and yaw of the body at a held surge speed u0: two states, cubic drag.

    The six-state equations with w = p = q = 0 and u = u0, by substitution.
    """
    model = study.body()
    at = {x.name: x for x in (*model.states, *model.inputs, *model.parameters)}
    held = {at[name]: 0 for name in ("w", "p", "q")}
    drift = [model.drift[i].subs(held).subs(at["u"], "u0") for i in (1, 5)]
    names = ("u0", "m1", "m2", "j3", "a2", "a6", "c2", "c6", "g2", "g6", "tau2", "tau6")
    return moments.system("v r", drift, ["g2", "g6"], parameters=names)


def sway_yaw_parameters(u0, noise):
    """Return the torpedo's numbers for `sway_yaw`, diffusion (v, r) given."""
    t = bodies.TORPEDO
    drags = (t.linear[1], t.linear[5], t.cubic[1], t.cubic[5])
    return [u0, *t.mass[:2], t.inertia[2], *drags, *noise, t.inputs[1], t.inputs[5]]


@dataclass(frozen=True, eq=False)
class Density:
    """A density of two states on a grid: `p` (nx, ny) at the nodes `x`, `y`."""

    x: np.ndarray
    y: np.ndarray
    p: np.ndarray

    def moments(self):
        """Return mean (2,), covariance (2, 2) and third central moments of both axes (2,)."""
        p = self.p / self.p.sum()
        grid = np.meshgrid(self.x, self.y, indexing="ij")
        mean = np.array([(g * p).sum() for g in grid])
        off = [g - m for g, m in zip(grid, mean, strict=True)]
        P = np.array([[(a * b * p).sum() for a in off] for b in off])
        return mean, P, np.array([(a**3 * p).sum() for a in off])


def fokker_planck(drift, spread, mean, P, duration, half_widths, nodes=121, steps=200) -> Density:
    """Solve the Fokker–Planck equation of two states on a dense grid.

    Finite volumes with centred fluxes, nothing flows through the border; Crank–Nicolson
    in time. Second order in both.

    Parameters
    ----------
    drift : callable
        (x, y) -> (f, g), on arrays.
    spread : sequence of 2 floats
        Diagonal of G Gᵀ.
    mean, P : ndarray, shapes (2,), (2, 2)
        Gaussian start.
    duration : float
        s.
    half_widths : sequence of 2 floats
        Of the grid about the start's mean.
    nodes, steps : int
        Per axis; in time.
    """
    axes = [m + np.linspace(-w, w, nodes) for m, w in zip(mean, half_widths, strict=True)]
    operator = sparse.csc_array((nodes**2, nodes**2))
    for axis in (0, 1):
        h = axes[axis][1] - axes[axis][0]
        middles = list(axes)
        middles[axis] = axes[axis][:-1] + h / 2
        speed = drift(*np.meshgrid(*middles, indexing="ij"))[axis].ravel()
        ones = np.ones(nodes)
        average = sparse.diags_array([ones / 2, ones / 2], offsets=[0, 1], shape=(nodes - 1, nodes))
        slope = sparse.diags_array([-ones / h, ones / h], offsets=[0, 1], shape=(nodes - 1, nodes))
        same = sparse.eye_array(nodes)
        average, slope = (
            sparse.kron(part, same) if axis == 0 else sparse.kron(same, part)
            for part in (average, slope)
        )
        flux = sparse.diags_array(speed) @ average - 0.5 * spread[axis] * slope
        # slopeᵀ is minus the divergence: what leaves a cell enters its neighbour.
        operator = operator + slope.T @ flux
    dt = duration / steps
    same = sparse.eye_array(nodes**2)
    solve = splu(sparse.csc_array(same - 0.5 * dt * operator)).solve
    forward = sparse.csr_array(same + 0.5 * dt * operator)
    offset = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1) - mean
    p = np.exp(-0.5 * np.einsum("xyi,ij,xyj->xy", offset, np.linalg.inv(P), offset)).ravel()
    p /= p.sum()
    for _ in range(steps):
        p = solve(forward @ p)
    return Density(*axes, p.reshape(nodes, nodes))


def sway_yaw_reference(noise, duration, mean, P, u0=1.0, half_widths=(1.8, 3.6)):
    """Return {name: (mean, P)} of closures and the Fokker–Planck solution, and the density."""
    parameters = sway_yaw_parameters(u0, noise)
    u0, m1, m2, j3, a2, a6, c2, c6, _, _, t2, t6 = parameters

    def drift(v, r):
        sway = (-m1 * u0 * r + t2 - a2 * v - c2 * v**3) / m2
        return sway, ((m1 - m2) * u0 * v + t6 - a6 * r - c6 * r**3) / j3

    density = fokker_planck(drift, np.square(noise), mean, P, duration, half_widths)
    out = {"Fokker–Planck": density.moments()[:2]}
    for closure in moments.CLOSURES:
        m, C = np.array([mean], dtype=float), np.array([P], dtype=float)
        propagate = generated.Propagator(moments.close(sway_yaw(), closure))
        propagate(m, C, duration, 0.01, None, parameters)
        out[closure] = m[0], C[0]
    return out, density


# ---------------------------------------------------------------- observability

POINT = ("1/2", "1/3", "-1/5", "1/7", "-2/5", "3/11")  # a rational state, nothing special


def observability_rows(orders=8) -> list:
    """Return rows (vehicle, measured, rank by order of the Lie derivative …)."""
    model, rows = study.body(), []
    for vehicle in study.VEHICLES:
        craft = bodies.BODIES[vehicle]
        numbers = [f"{value}" for value in craft.parameters()]
        point = dict(zip(model.states, POINT, strict=True))
        point |= dict(zip(model.parameters, numbers, strict=True))
        point |= dict(zip(model.inputs, map(str, craft.inputs), strict=True))
        for words, chosen in (("linear", slice(0, 3)), ("angular", slice(3, 6))):
            ranks = moments.observability(model, model.states[chosen], point, orders)
            rows.append((vehicle, words, *ranks))
    return rows
