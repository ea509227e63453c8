"""Prediction: mechanise the nominal states, carry their covariances through F.

The transition is the product of three maps that mirror the mechanisation (attitude, then
velocity with the mean attitude error, then position with the mean velocity error). It differs
from I + F dt + F² dt²/2 by no more than half the squared Schuler rate, 8e-7 in one second,
and costs half as much.

Source: Cha, Hwang and Park, *The Journal of Navigation*, 2022, equations (6)-(10), (A1)-(A11).
"""

import math

import numpy as np

from seanav._compile import kernel
from seanav.filters.ins.layout import (
    B_A_ROW,
    B_G_ROW,
    C_D,
    C_E,
    C_N,
    COLUMNS,
    CURRENT,
    FORCE,
    HALF,
    LANES,
    LATITUDE,
    LATITUDE_L,
    LATITUDE_VN,
    LONGITUDE,
    LONGITUDE_L,
    LONGITUDE_VE,
    NAVIGATION,
    OMEGA,
    PHI,
    PHI_D_L,
    PHI_D_VE,
    PHI_E_L,
    PHI_E_VN,
    PHI_N_L,
    PHI_N_VE,
    PHI_ROW,
    PLACE,
    ROW,
    V_E,
    V_N,
    VE_L,
    VE_VE,
    VE_VN,
    VN_L,
    VN_VE,
    WORKSPACE,
    X_B_A,
    X_B_G,
    X_CURRENT,
    N,
    _put,
    _three,
)
from seanav.filters.ins.states import _quaternion, _set_quaternion
from seanav.models import attitude, earth, inertial

# ---------------------------------------------------------------- nominal states


@kernel
def _predict_state(x, theta, dv, settings, decay, f):
    """Mechanise one interval and fill the coefficients `f` of the error dynamics.

    Parameters
    ----------
    x : (17, runs), changed
    theta, dv : (3, runs)
        Increments as reported, rad and m/s.
    settings : seanav.filters.ins.mission.Settings
    decay : float
        Of the current over one interval.
    f : (30 · runs,), output
        See `layout`.
    """
    height, dt = settings.height, settings.dt
    for r in range(LANES):
        latitude, v_N, v_E = x[LATITUDE, r], x[V_N, r], x[V_E, r]
        turn, gained = _without_biases(x, theta, dv, dt, r)
        dL, dlongitude, x[V_N, r], x[V_E, r], q, force = inertial._advance(
            latitude, height, v_N, v_E, _quaternion(x, r), turn, gained, dt
        )
        x[LATITUDE, r] += dL
        x[LONGITUDE, r] += dlongitude
        _set_quaternion(x, r, q)
        for i in range(3):
            x[X_CURRENT + i, r] *= decay
        # Attitude of mid-interval: q at the end times half the rotation backwards.
        back = (-0.25 * turn[0], -0.25 * turn[1], -0.25 * turn[2])
        middle = attitude._multiply(q, attitude._from_half_angles(back))
        for axis in range(3):
            c_N, c_E, c_D = attitude._column(middle, axis)
            at = axis * LANES + r
            f[C_N + at], f[C_E + at], f[C_D + at] = c_N, c_E, c_D
        _put(f, FORCE, r, force)
        m_N, m_E = 0.5 * (v_N + x[V_N, r]), 0.5 * (v_E + x[V_E, r])
        _coefficients(latitude, dL, height, m_N, m_E, f, r)


@kernel
def _without_biases(x, theta, dv, dt, r):
    """Return rotation vector and velocity increment of run r, less its estimated biases."""
    b_a = (x[X_B_A, r], x[X_B_A + 1, r], x[X_B_A + 2, r])
    b_g = (x[X_B_G, r], x[X_B_G + 1, r], x[X_B_G + 2, r])
    gained = (dv[0, r], dv[1, r], dv[2, r])
    turn = theta[0, r] - b_g[0] * dt, theta[1, r] - b_g[1] * dt, theta[2, r] - b_g[2] * dt
    # Both biases acted inside the interval: on average after half of its rotation.
    one, two = attitude._cross(turn, b_a), attitude._cross(b_g, gained)
    return turn, (
        gained[0] - (b_a[0] + (0.5 * one[0] + 0.5 * two[0])) * dt,
        gained[1] - (b_a[1] + (0.5 * one[1] + 0.5 * two[1])) * dt,
        gained[2] - (b_a[2] + (0.5 * one[2] + 0.5 * two[2])) * dt,
    )


@kernel
def _coefficients(latitude, dL, height, v_N, v_E, f, r):
    """Fill the entries of F of run r, half the step `dL` on, at the mean velocity."""
    # Sine and cosine half the step on; the next term is below 1e-20.
    s, c, half = math.sin(latitude), math.cos(latitude), 0.5 * dL
    s, c = s + half * (c - 0.5 * half * s), c - half * (s + 0.5 * half * c)
    t = s / c
    R_n, R_t = earth._radii_at(s)
    R_nn, R_tt = earth._slopes_at(s, c, R_n, R_t)
    M, T = R_n + height, R_t + height
    # Transport rate rho and earth rate.
    r_N, r_E = v_E / T, -v_N / M
    o_N, o_D, r_D = earth.RATE * c, -earth.RATE * s, -r_N * t
    _put(f, OMEGA, r, (o_N + r_N, r_E, o_D + r_D))
    down = -r_N / (c * c) + r_N * t * R_tt / T  # d rho_D / dL
    f[PHI_N_L + r] = o_D - r_N * R_tt / T
    f[PHI_E_L + r] = -r_E * R_nn / M
    f[PHI_D_L + r] = -o_N + down
    f[PHI_E_VN + r], f[PHI_N_VE + r], f[PHI_D_VE + r] = -1.0 / M, 1.0 / T, -t / T
    f[VN_L + r] = v_E * (down - 2.0 * o_N)
    f[VE_L + r] = -v_N * (down - 2.0 * o_N)
    turn = 2.0 * o_D + r_D
    f[VN_VE + r], f[VE_VN + r], f[VE_VE + r] = turn - r_N * t, -turn, v_N * t / T
    f[LATITUDE_L + r], f[LONGITUDE_L + r] = r_E * R_nn / M, r_N / c * (t - R_tt / T)
    f[LATITUDE_VN + r], f[LONGITUDE_VE + r] = 1.0 / M, 1.0 / (T * c)


# ---------------------------------------------------------------- covariances


@kernel
def _transition(f, dt, y, out):
    """Apply the transition to y (16 rows, less the current); seven navigation rows go to out.

    `out` begins at the first row's place in an array of 16 columns. All arrays are flat.
    """
    for r in range(LANES):
        L, v_N, v_E = y[LATITUDE * LANES + r], y[V_N * LANES + r], y[V_E * LANES + r]
        # phi' = F_pL L + F_pv v − omega × phi + C b_g
        p_N, p_E, p_D = _three(y, PHI_ROW, r)
        b_g = _three(y, B_G_ROW, r)
        w_N, w_E, w_D = _three(f, OMEGA, r)
        d_N = f[PHI_N_L + r] * L + f[PHI_N_VE + r] * v_E + w_D * p_E - w_E * p_D
        d_E = f[PHI_E_L + r] * L + f[PHI_E_VN + r] * v_N - w_D * p_N + w_N * p_D
        d_D = f[PHI_D_L + r] * L + f[PHI_D_VE + r] * v_E + w_E * p_N - w_N * p_E
        d_N += attitude._dot(_three(f, C_N, r), b_g)
        d_E += attitude._dot(_three(f, C_E, r), b_g)
        d_D += attitude._dot(_three(f, C_D, r), b_g)
        out[PHI * COLUMNS + r] = p_N + dt * d_N
        out[(PHI + 1) * COLUMNS + r] = p_E + dt * d_E
        out[(PHI + 2) * COLUMNS + r] = p_D + dt * d_D
        # v' = F_vL L + F_vv v + f × phi − C b_a, with the mean phi of the interval
        p_N, p_E, p_D = p_N + 0.5 * dt * d_N, p_E + 0.5 * dt * d_E, p_D + 0.5 * dt * d_D
        b_a = _three(y, B_A_ROW, r)
        f_N, f_E, f_D = _three(f, FORCE, r)
        a_N = f[VN_L + r] * L + f[VN_VE + r] * v_E - f_D * p_E + f_E * p_D
        a_E = f[VE_L + r] * L + f[VE_VN + r] * v_N + f[VE_VE + r] * v_E + f_D * p_N - f_N * p_D
        a_N -= attitude._dot(_three(f, C_N, r), b_a)
        a_E -= attitude._dot(_three(f, C_E, r), b_a)
        out[V_N * COLUMNS + r], out[V_E * COLUMNS + r] = v_N + dt * a_N, v_E + dt * a_E
        # p' = F_pL L + F_pv v, with the mean v of the interval
        m_N, m_E = v_N + 0.5 * dt * a_N, v_E + 0.5 * dt * a_E
        out[LATITUDE * COLUMNS + r] = L + dt * (f[LATITUDE_L + r] * L + f[LATITUDE_VN + r] * m_N)
        out[LONGITUDE * COLUMNS + r] = y[LONGITUDE * LANES + r] + dt * (
            f[LONGITUDE_L + r] * L + f[LONGITUDE_VE + r] * m_E
        )


@kernel
def _predict_covariance(P, f, settings, decay, q_current, work):
    """P ← Phi P Phiᵀ + Q in place, all arrays flat.

    Parameters
    ----------
    P : (136 · runs,), changed
    f : (30 · runs,)
        As `predict_state` filled it.
    settings : seanav.filters.ins.mission.Settings
    decay, q_current : float
        Of the current over one interval; its process noise variance, (m/s)².
    work : (`WORKSPACE`,)
        Workspace.
    """
    dt, q_velocity, q_attitude = settings.dt, settings.velocity_noise, settings.attitude_noise
    width = np.uint64(len(work) // (WORKSPACE // LANES))
    left, right, y = work[:HALF], work[HALF : 2 * HALF], work[2 * HALF :]
    for j in range(N):
        for i in range(CURRENT):  # the current drives no other error
            to, at = ROW[i], PLACE[i, j]
            for r in range(width):
                y[to + r] = P[at + r]
        _transition(f, dt, y, left[j * LANES :])  # column j of Phi P, seven rows
    for i in range(NAVIGATION):
        y = left[i * COLUMNS : (i + 1) * COLUMNS]  # row i of Phi P
        _transition(f, dt, y, right[i * LANES :])  # column i of Phi P Phiᵀ
        for j in range(i, NAVIGATION):
            to, at = PLACE[i, j], ROW[j * N + i]
            for r in range(width):
                P[to + r] = right[at + r]
        for j in range(NAVIGATION, N):
            to, at = PLACE[i, j], ROW[j]
            factor = decay if j >= CURRENT else 1.0
            for r in range(width):
                P[to + r] = factor * y[at + r]
    for j in range(CURRENT, N):
        for i in range(NAVIGATION, j + 1):
            to = PLACE[i, j]
            factor = decay * decay if i >= CURRENT else decay
            for r in range(width):
                P[to + r] *= factor
    for i in range(V_N, N):
        if i < NAVIGATION or i >= CURRENT:
            q = q_velocity if i < PHI else q_attitude if i < NAVIGATION else q_current
            to = PLACE[i, i]
            for r in range(width):
                P[to + r] += q
