"""Update: look at one axis of the log, adapt to its residuals, correct states and covariances.

Source: Cha, Hwang and Park, *The Journal of Navigation*, 2022, equations (11)-(17), (23).
"""

import math

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
    _put,
)
from seanav.filters.ins.states import _quaternion, _shift
from seanav.models import attitude

# Where H is linearised. All but the first need the truth, so only a study can use them.
ESTIMATE, TRUE_RELATIVE_VELOCITY, TRUTH = range(3)
LINEARISED = {"estimate": ESTIMATE, "relative velocity": TRUE_RELATIVE_VELOCITY, "truth": TRUTH}


# Length of the flat workspace of `look`, and where its parts end.
_H, _U, _RHO, SEEN = np.cumsum([ENTRIES * LANES, N * LANES, LANES, LANES]).tolist()


@kernel
def _parts(seen):
    """Return what one axis of the log shows, four parts of a flat array (`SEEN`,).

    h, the entries of the row of H in the columns `layout.LOOKED` (the others are zero);
    u = P hᵀ; the residual rho, predicted minus measured (m/s); its variance S.
    """
    return seen[:_H], seen[_H:_U], seen[_U:_RHO], seen[_RHO:]


@kernel
def _look(x, P, z, axis, settings, true_heading, h, u, rho, S):
    """Look at one axis of the log: the residual at the estimate, H where the settings say.

    Parameters
    ----------
    x : (17, runs)
    P : (136 · runs,)
    z : (axes, runs)
        Log of this step, m/s; row `axis`, along that body axis, is used.
    settings : seanav.filters.ins.mission.Settings
    true_heading : float
        rad, of effect for H at the truth alone.
    h, u, rho, S : output
        See `_parts`.
    """
    width = np.uint64(len(S))
    about, R = settings.about, settings.R
    for r in range(LANES):
        c_N, c_E, c_D = attitude._column(_quaternion(x, r), axis)
        # Through still water; the vertical velocity is held at zero.
        u_N, u_E = x[V_N, r] - x[X_CURRENT, r], x[V_E, r] - x[X_CURRENT + 1, r]
        u_D = -x[X_CURRENT + 2, r]
        rho[r] = c_N * u_N + c_E * u_E + c_D * u_D - z[axis, r]
        S[r] = R
        if about == TRUTH:  # level, and only the forward axis has a linear counterpart
            c_N, c_E, c_D = math.cos(true_heading), math.sin(true_heading), 0.0
        scale = 1.0 if about == ESTIMATE else 0.0
        t_N, t_E, t_D = attitude._cross((u_N, u_E, u_D), (c_N, c_E, c_D))
        h[LOOKED_V + r], h[LOOKED_V + LANES + r] = c_N, c_E
        _put(h, LOOKED_PHI, r, (scale * t_N, scale * t_E, scale * t_D))
        _put(h, LOOKED_CURRENT, r, (-c_N, -c_E, -c_D))
    for i in range(N):
        to, at = ROW[i], PLACE[i, LOOKED[0]]
        for r in range(width):
            u[to + r] = P[at + r] * h[r]
        for k in range(1, ENTRIES):
            at, entry = PLACE[i, LOOKED[k]], ROW[k]
            for r in range(width):
                u[to + r] += P[at + r] * h[entry + r]
    for k in range(ENTRIES):
        at, entry = ROW[LOOKED[k]], ROW[k]
        for r in range(width):
            S[r] += h[entry + r] * u[at + r]


@kernel
def _inflate(P, form, beta, q_current):
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
def _adapt(x, P, z, step, settings, true_heading, form, q_current, ring, seen, beta, gain):
    """Inflate P where the residuals of the last steps are larger than it says: (14)-(17).

    Parameters
    ----------
    x : (17, runs)
    P : (136 · runs,), changed
    z : (axes, runs)
        Log of this step, m/s.
    step : int
        Steps before this one.
    settings, true_heading
        As in `look`.
    form : int
        A value of `seanav.filters.fading.FORMS`.
    q_current : float
        Process noise variance of the current per step, (m/s)².
    ring : (window + 3, runs), changed
        Squared residuals of the last steps, then workspace.
    seen : (`SEEN`,)
        Workspace.
    beta, gain : (runs,), output
        Fading factor and the factor of the gain that goes with it.
    """
    window, cap = settings.window, settings.cap
    h, u, rho, S = _parts(seen)
    squared, total, spread = ring[window], ring[window + 1], ring[window + 2]
    squared[:] = 0.0
    spread[:] = 0.0
    for axis in range(len(z)):
        _look(x, P, z, axis, settings, true_heading, h, u, rho, S)
        for r in range(LANES):
            squared[r] += rho[r] * rho[r]
            spread[r] += S[r]
    fading._remember(ring[:window], step, squared, total)
    count = min(step + 1, window)
    for r in range(LANES):
        beta[r] = fading._factor(total[r], count, spread[r], cap)
    _inflate(P, form, beta, q_current)
    if form == fading.LITERAL_GAIN:
        for r in range(LANES):
            gain[r] = 1.0 / beta[r]


@kernel
def _correct(P, u, S, gain):
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
def _update(x, P, z, settings, true_heading, gain, seen, e, nis, logs):
    """Update x and P with all axes of the log, one after the other: (23).

    Parameters
    ----------
    x, P, z, settings, true_heading
        As in `adapt`; x is changed too.
    gain : (runs,)
        As from `adapt`.
    seen : (`SEEN`,); e : (16, runs)
        Workspace.
    nis, logs : (runs,), output
        Normalised squared residual of the step; log likelihood, if there are several models.
    """
    h, u, rho, S = _parts(seen)
    nis[:] = 0.0
    logs[:] = 0.0
    for axis in range(len(z)):
        _look(x, P, z, axis, settings, true_heading, h, u, rho, S)
        for r in range(LANES):
            nis[r] += rho[r] * rho[r] / S[r]
            if settings.models > 1:
                logs[r] += imm._log_likelihood(rho[r] * rho[r], S[r])
            rho[r] /= S[r]
        for i in range(N):
            for r in range(LANES):
                e[i, r] = gain[r] * u[i * LANES + r] * rho[r]  # K rho
        _correct(P, u, S, gain)
        _shift(x, e, -1.0)
