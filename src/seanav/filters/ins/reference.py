"""One mission in plain numpy, in the paper's equations: to read, and to test against.

`fly` does for one run what the compiled `seanav.filters.ins.fly` does for a batch, with dense
matrices of all 18 error states: the rows and columns of height and vertical velocity, held by
the depth gauge, are zero. Errors are estimate minus truth, C(q̂) = (I − [φ×]) C(q).

Source: Cha, Hwang and Park, *The Journal of Navigation*, 2022, equations (6)-(26).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from seanav.filters.ins.layout import KEPT
from seanav.filters.ins.score import Flight, MeanSquares, Series
from seanav.models import earth
from seanav.models.attitude import attitude_error, exp_so3, skew
from seanav.models.inertial import BA, BG, P_, PHI, SLAVED, STATES, V_, VC, error_dynamics

I = np.eye(STATES)  # noqa: E741
DT = 1.0  # s


@dataclass(frozen=True)
class State:
    """Nominal state: what an error of 18 elements is the error of, block by block."""

    position: np.ndarray  # latitude, longitude (rad), height (m)
    v_n: np.ndarray  # m/s
    C_bn: np.ndarray
    b_a: np.ndarray  # m/s²
    b_g: np.ndarray  # rad/s
    v_c: np.ndarray  # sea current, m/s

    def plus(self, e: np.ndarray) -> "State":
        """Return the state that is off by the error `e` (18,)."""
        return State(
            self.position + e[P_],
            self.v_n + e[V_],
            exp_so3(-e[PHI]) @ self.C_bn,
            self.b_a + e[BA],
            self.b_g + e[BG],
            self.v_c + e[VC],
        )

    def minus(self, other: "State") -> np.ndarray:
        """Return the error (18,) of this state if `other` is the truth."""
        e = np.empty(STATES)
        e[P_], e[V_] = self.position - other.position, self.v_n - other.v_n
        # phi is twice the vector part of the quaternion of C(q̂) Cᵀ, which is
        # 2 sin(angle / 2); `attitude_error` is sin(angle).
        cosine = 0.5 * math.sqrt(1.0 + np.trace(self.C_bn @ other.C_bn.T))
        e[PHI] = attitude_error(self.C_bn, other.C_bn) / cosine
        e[BA], e[BG], e[VC] = self.b_a - other.b_a, self.b_g - other.b_g, self.v_c - other.v_c
        return e


def from_nominal(x: np.ndarray, height: float) -> State:
    """Return the state of a nominal vector (17,), as `seanav.filters.ins.fly` takes it."""
    w, q = x[4], x[5:8]
    C_bn = (w * w - q @ q) * np.eye(3) + 2.0 * np.outer(q, q) + 2.0 * w * skew(q)
    position, v_n = np.array([x[0], x[1], height]), np.array([x[2], x[3], 0.0])
    return State(position, v_n, C_bn, x[8:11], x[11:14], x[14:17])


# ---------------------------------------------------------------- one extended Kalman filter


def predict(
    state: State, P: np.ndarray, theta: np.ndarray, dv: np.ndarray, decay: float, Q: np.ndarray
) -> tuple[State, np.ndarray]:
    """Mechanise one second and carry the covariance through it: (6)-(10)."""
    # The biases acted inside the second: on average after half of its rotation.
    theta = theta - state.b_g * DT
    turned = np.cross(theta, state.b_a) / 2 + np.cross(state.b_g, dv) / 2
    a_n = state.C_bn @ (dv - (state.b_a + turned) * DT)

    latitude, _, height = state.position
    R_n, R_t = earth.radii(latitude)
    half_way = state.v_n + 0.5 * a_n * [1.0, 1.0, 0.0]  # height is held, so v_D is zero
    w_ie, rho = earth.earth_rate(latitude), earth.transport_rate(latitude, height, half_way)
    a_n = a_n - np.cross(0.5 * DT * (w_ie + rho), a_n)  # the n axes have turned half the way
    v_n = state.v_n + a_n - DT * np.cross(2 * w_ie + rho, half_way)
    v_n[2] = 0.0
    mean = 0.5 * (state.v_n + v_n)
    north = DT * mean[0] / (R_n + height)
    middle = np.array([latitude + 0.5 * north, 0.0, height])
    east = DT * mean[1] / ((R_t + height) * math.cos(middle[0]))
    C_bn = exp_so3(-(w_ie + rho) * DT) @ state.C_bn @ exp_so3(theta)
    position = state.position + np.array([north, east, 0.0])
    after = replace(state, position=position, v_n=v_n, C_bn=C_bn, v_c=decay * state.v_c)

    F = error_dynamics(middle, mean, C_bn @ exp_so3(-0.5 * theta), a_n / DT, 1.0)
    Phi = transition(F, decay)
    return after, Phi @ P @ Phi.T + Q


def transition(F: np.ndarray, decay: float) -> np.ndarray:
    """Return Phi of one second: attitude first, then velocity, then position, as mechanised.

    Each block is moved by the mean, over the second, of the errors that drive it.
    """
    Phi = I
    for block in (PHI, V_, P_):
        rows = np.zeros((STATES, STATES))
        rows[block] = F[block]
        Phi = Phi + DT * rows @ (I + Phi) / 2
    Phi[VC, VC] = decay * np.eye(3)
    return Phi


def log_row(state: State, axis: int, about: str, heading: float) -> tuple:
    """Return the log's predicted value and its row of H, equation (11)."""
    ahead, relative = state.C_bn[:, axis], state.v_n - state.v_c
    h, predicted = np.zeros(STATES), ahead @ relative
    if about == "estimate":
        h[PHI] = np.cross(relative, ahead)
    elif about == "truth":
        ahead = np.array([math.cos(heading), math.sin(heading), 0.0])
    h[V_], h[VC] = ahead, -ahead
    h[list(SLAVED)] = 0.0
    return predicted, h


def adapt(
    state: State,
    P: np.ndarray,
    z: np.ndarray,
    past: list[float],
    form: str,
    q: float,
    R: float,
    window: int,
    cap: float,
    about: str,
    heading: float,
) -> tuple[float, np.ndarray, float]:
    """Return beta, the adapted covariance and the factor of the gain: (14)-(17)."""
    squared = spread = 0.0
    for axis, measured in enumerate(z):
        predicted, h = log_row(state, axis, about, heading)
        squared += (predicted - measured) ** 2
        spread += h @ P @ h + R
    past.append(squared)
    del past[:-window]
    beta = 1.0
    if len(past) > 1:
        beta = min(max(1.0, sum(past) / (len(past) - 1) / spread), cap)
    doubtful = np.zeros((STATES, STATES))
    doubtful[VC, VC] = 1.0
    P = {
        "literal": lambda: beta * P,
        "literal-gain": lambda: beta * P,
        "block": lambda: P * np.where(doubtful, beta, 1.0),
        "variance": lambda: P + (beta - 1.0) * q * doubtful * I,
        "sigma": lambda: P + (beta**2 - 1.0) * q * doubtful * I,
    }[form]()
    return beta, P, 1.0 / beta if form == "literal-gain" else 1.0


def update(
    state: State, P: np.ndarray, z: np.ndarray, R: float, gain: float, about: str, heading: float
) -> tuple[State, np.ndarray, float, float]:
    """Return state, covariance, NIS and log likelihood after one second's log: (23), (24)."""
    nis = log_likelihood = 0.0
    for axis, measured in enumerate(z):
        predicted, h = log_row(state, axis, about, heading)
        residual, S = predicted - measured, h @ P @ h + R
        K = gain * P @ h / S
        state = state.plus(-K * residual)
        A = I - np.outer(K, h)
        P = A @ P @ A.T + R * np.outer(K, K)
        nis += residual**2 / S
        log_likelihood -= 0.5 * (math.log(2 * math.pi * S) + residual**2 / S)
    return state, P, nis, log_likelihood


# ---------------------------------------------------------------- the IMM of several


def combine(
    weights: np.ndarray, states: list[State], covariances: list[np.ndarray]
) -> tuple[State, np.ndarray]:
    """Return the one Gaussian that has the moments of a mixture: (22), (26)."""
    about = states[0]
    errors = np.array([state.minus(about) for state in states])
    mean = weights @ errors
    spread = [P + np.outer(e - mean, e - mean) for P, e in zip(covariances, errors, strict=True)]
    return about.plus(mean), np.einsum("j,jkl->kl", weights, spread)


def fly(
    theta: np.ndarray, dv: np.ndarray, z: np.ndarray, truth: np.ndarray, x0: np.ndarray,
    P0: np.ndarray, *, height: float, R: float, noise: Sequence, forms: Sequence[str],
    velocity_noise: float, attitude_noise: float, transition: ArrayLike, mu0: ArrayLike,
    window: int = 20, cap: float = 10.0, about: str = "estimate", true_rest: np.ndarray,
) -> Flight:  # fmt: skip
    """Fly one run; every step is recorded.

    Arguments and result are those of `seanav.filters.ins.fly` without the last axis, but for
    `P0` and the final P, (models, 18, 18), and `true_rest`, (steps, 9). Always aided.
    """
    models, T, mu = len(P0), np.asarray(transition), np.asarray(mu0)
    states, P = [from_nominal(x0, height)] * models, list(P0)
    past = [[] for _ in range(models)]
    errors, nees, modes, nis, beta = [], [], [], [], np.ones((len(z), models))
    for k, (now, rest) in enumerate(zip(truth, true_rest, strict=True)):
        heading = 2.0 * math.atan2(now[7], now[4])
        prior = mu @ T  # (20)
        weights = T * mu[:, None] / prior  # (21): column j, where model j comes from
        mixed = [combine(weights[:, j], states, P) for j in range(models)]
        told = np.empty((2, models))
        for j, (decay, q) in enumerate(noise):
            Q = np.zeros((STATES, STATES))
            Q[V_, V_], Q[PHI, PHI], Q[VC, VC] = velocity_noise, attitude_noise, q
            Q[:, SLAVED] = 0.0
            state, Pj = predict(*mixed[j], theta[k], dv[k], decay, Q * I)
            gain = 1.0
            if forms[j] != "none":
                beta[k, j], Pj, gain = adapt(
                    state, Pj, z[k], past[j], forms[j], q, R, window, cap, about, heading
                )
            states[j], P[j], *told[:, j] = update(state, Pj, z[k], R, gain, about, heading)
        mu = prior * np.exp(told[1] - told[1].max())  # (25)
        mu = mu / mu.sum()
        best, best_P = combine(mu, states, P)
        true = from_nominal(np.r_[now[:8], rest], height)
        e = best.minus(true)[KEPT]
        nees.append(e @ np.linalg.solve(best_P[np.ix_(KEPT, KEPT)], e))
        errors.append(e * np.r_[now[8:], np.ones(len(e) - 2)])
        modes.append(mu)
        nis.append(told[0])
    series = Series(np.array(errors), np.array(nees), np.array(modes))
    return score(series, np.array(nis), beta, np.array(P))


def score(series: Series, nis: np.ndarray, beta: np.ndarray, P: np.ndarray) -> Flight:
    """Return means over time by their names; `nis` and `beta` are (steps, models)."""
    squared, modes = series.errors**2, series.mode_probability
    north, east, v_N, v_E, phi_N, phi_E, phi_D = squared[:, :7].mean(axis=0)
    return Flight(
        MeanSquares(north, east, v_N + v_E, phi_N + phi_E, phi_D),
        nis=(modes * nis).sum(axis=1).mean(),
        beta=(modes * beta).sum(axis=1).mean(),
        squared_nis=(nis[:, 0] ** 2).mean(),
        nees=series.nees.mean(),
        mode_probability=modes.mean(axis=0),
        series=series,
        P=P,
    )
