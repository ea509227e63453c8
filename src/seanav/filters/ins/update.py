"""Update: look at one axis of the log, adapt to its residuals, correct states and covariances.

Source: Cha, Hwang and Park, *The Journal of Navigation*, 2022, equations (11)-(17), (23).
"""

import math
from typing import NamedTuple

import numpy as np

from seanav._compile import kernel
from seanav.filters import fading, imm
from seanav.filters.ins.layout import (
    CURRENT,
    ENTRIES,
    LANES,
    LOOKED,
    LOOKED_CURRENT,
    LOOKED_PHI,
    LOOKED_V,
    PACKED,
    PLACE,
    ROW,
    V_E,
    V_N,
    X_CURRENT,
    N,
    put,
)
from seanav.filters.ins.states import quaternion, shift
from seanav.models import attitude

# Where H is linearised. All but the first need the truth, so only a study can use them.
ESTIMATE, TRUE_RELATIVE_VELOCITY, TRUTH = range(3)
LINEARISED = {"estimate": ESTIMATE, "relative velocity": TRUE_RELATIVE_VELOCITY, "truth": TRUTH}


class Look(NamedTuple):
    """What one axis of the log shows, for a batch of runs; flat arrays.

    Attributes
    ----------
    h : (8 · runs,)
        The entries of the row of H in the columns `layout.LOOKED`; the others are zero.
    u : (16 · runs,)
        P hᵀ.
    rho, S : (runs,)
        Residual, predicted minus measured (m/s), and its variance.
    """

    h: np.ndarray
    u: np.ndarray
    rho: np.ndarray
    S: np.ndarray


@kernel
def empty_look():
    """Return zeros."""
    h, u = np.zeros(ENTRIES * LANES), np.zeros(N * LANES)
    return Look(h, u, np.zeros(LANES), np.zeros(LANES))


@kernel
def residual(x, z, axis, about, true_heading, h, rho):
    """Put the residual at the estimate into `rho` and H, taken where `about` says, into `h`.

    Parameters
    ----------
    x : (17, runs)
    z : (runs,)
        Log along body axis `axis`, m/s.
    about : int
        A value of `LINEARISED`.
    true_heading : float
        rad, of effect for H at the truth alone.
    """
    for r in range(LANES):
        c_N, c_E, c_D = attitude.column(quaternion(x, r), axis)
        # Through still water; the vertical velocity is held at zero.
        u_N, u_E = x[V_N, r] - x[X_CURRENT, r], x[V_E, r] - x[X_CURRENT + 1, r]
        u_D = -x[X_CURRENT + 2, r]
        rho[r] = c_N * u_N + c_E * u_E + c_D * u_D - z[r]
        if about == TRUTH:  # level, and only the forward axis has a linear counterpart
            c_N, c_E, c_D = math.cos(true_heading), math.sin(true_heading), 0.0
        scale = 1.0 if about == ESTIMATE else 0.0
        t_N, t_E, t_D = attitude.cross((u_N, u_E, u_D), (c_N, c_E, c_D))
        put(h, LOOKED_PHI, r, (scale * t_N, scale * t_E, scale * t_D))
        put(h, LOOKED_CURRENT, r, (-c_N, -c_E, -c_D))
        h[LOOKED_V + r], h[LOOKED_V + LANES + r] = c_N, c_E


@kernel
def project(P, h, R, u, S):
    """Put P hᵀ into `u` and h P hᵀ + R into `S`, the variance of the residual."""
    width = np.uint64(len(S))
    for i in range(N):
        to = ROW[i]
        for r in range(width):
            u[to + r] = 0.0
        for k in range(ENTRIES):
            at, entry = PLACE[i, LOOKED[k]], ROW[k]
            for r in range(width):
                u[to + r] += P[at + r] * h[entry + r]
    for r in range(width):
        S[r] = R
    for k in range(ENTRIES):
        at, entry = ROW[LOOKED[k]], ROW[k]
        for r in range(width):
            S[r] += h[entry + r] * u[at + r]


@kernel
def inflate(P, form, beta, q_current):
    """Apply a form of `seanav.filters.fading` to the predicted covariance P (136 · runs,)."""
    width = np.uint64(len(beta))
    if form == fading.LITERAL or form == fading.LITERAL_GAIN:
        for k in range(PACKED):
            to = ROW[k]
            for r in range(width):
                P[to + r] *= beta[r]
    elif form == fading.BLOCK:
        for i in range(CURRENT, N):
            for j in range(i, N):
                to = PLACE[i, j]
                for r in range(width):
                    P[to + r] *= beta[r]
    elif form == fading.VARIANCE or form == fading.SIGMA:
        power = 2 if form == fading.SIGMA else 1
        for i in range(CURRENT, N):
            to = PLACE[i, i]
            for r in range(width):
                P[to + r] += (beta[r] ** power - 1.0) * q_current


@kernel
def adapt(x, P, z, step, settings, true_heading, form, q_current, ring, seen, beta, gain):
    """Inflate P where the residuals of the last steps are larger than it says: (14)-(17).

    Parameters
    ----------
    x : (17, runs)
    P : (136 · runs,), changed
    z : (axes, runs)
        Log of this step, m/s.
    step : int
        Steps before this one.
    settings : seanav.filters.ins.mission.Settings
    true_heading : float
        As in `residual`.
    form : int
        A value of `seanav.filters.fading.FORMS`.
    q_current : float
        Process noise variance of the current per step, (m/s)².
    ring : (window + 3, runs), changed
        Squared residuals of the last steps, then workspace.
    seen : Look
        Workspace.
    beta, gain : (runs,), output
        Fading factor and the factor of the gain that goes with it.
    """
    window, cap = len(ring) - 3, settings.cap
    h, u, rho, S = seen
    squared, total, spread = ring[window], ring[window + 1], ring[window + 2]
    squared[:] = 0.0
    spread[:] = 0.0
    for axis in range(len(z)):
        residual(x, z[axis], axis, settings.about, true_heading, h, rho)
        project(P, h, settings.R, u, S)
        for r in range(LANES):
            squared[r] += rho[r] * rho[r]
            spread[r] += S[r]
    fading.remember(ring[:window], step, squared, total)
    count = min(step + 1, window)
    for r in range(LANES):
        beta[r] = fading.factor(total[r], count, spread[r], cap)
    inflate(P, form, beta, q_current)
    if form == fading.LITERAL_GAIN:
        for r in range(LANES):
            gain[r] = 1.0 / beta[r]


@kernel
def correct(P, u, S, gain):
    """P ← (I − K H) P with K = gain · u / S, in Joseph's form (exact for any gain)."""
    width = np.uint64(len(gain))
    factor, scaled = np.empty(LANES), np.empty(LANES)
    for r in range(width):
        factor[r] = (2.0 * gain[r] - gain[r] * gain[r]) / S[r]
    for i in range(N):
        own = ROW[i]
        for r in range(width):
            scaled[r] = factor[r] * u[own + r]
        for j in range(i, N):
            to, at = PLACE[i, j], ROW[j]
            for r in range(width):
                P[to + r] -= scaled[r] * u[at + r]


@kernel
def update(x, P, z, settings, true_heading, gain, seen, e, nis, logs):
    """Update x and P with all axes of the log, one after the other: (23).

    Parameters
    ----------
    x, P, z, settings, true_heading
        As in `adapt`; x is changed too.
    gain : (runs,)
        As from `adapt`.
    seen : Look; e : (16, runs)
        Workspace.
    nis, logs : (runs,), output
        Normalised squared residual of the step; log likelihood, if there are several models.
    """
    h, u, rho, S = seen
    nis[:] = 0.0
    logs[:] = 0.0
    for axis in range(len(z)):
        residual(x, z[axis], axis, settings.about, true_heading, h, rho)
        project(P, h, settings.R, u, S)
        for r in range(LANES):
            nis[r] += rho[r] * rho[r] / S[r]
            if settings.models > 1:
                logs[r] += imm.log_likelihood(rho[r] * rho[r], S[r])
            rho[r] /= S[r]
        for i in range(N):
            for r in range(LANES):
                e[i, r] = gain[r] * u[i * LANES + r] * rho[r]  # K rho
        correct(P, u, S, gain)
        shift(x, e, -1.0)
