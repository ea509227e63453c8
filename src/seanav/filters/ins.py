"""Inertial navigation aided by a speed log: 18-state error-state EKF, and IMM of several.

Many runs at once: every array has `LANES` runs innermost. Height and vertical velocity are
held by the depth gauge, so their error states are exactly zero; the kernels carry the other
16 (`KEPT`). Covariances are packed upper triangles, row by row, hence symmetric for ever.

A batch of nominal states is x, shape (17, LANES): latitude, longitude (rad), v_N, v_E (m/s),
quaternion body to n (4, scalar first), accelerometer bias (3, m/s²), gyro bias (3, rad/s),
sea current (3, m/s).

The transition is the product of three maps that mirror the mechanisation (attitude, then
velocity with the mean attitude error, then position with the mean velocity error). It differs
from I + F dt + F² dt²/2 by no more than half the squared Schuler rate, 8e-7 in one second,
and costs half as much.

The covariance kernels take flat arrays: element (i, run) is at i · LANES + run. With that
constant in the index the compiler sees that rows do not overlap, and vectorises over runs;
with two subscripts it does not, and they are three times slower.

Source: Cha, Hwang and Park, *The Journal of Navigation*, 2022, equations (6)-(26).
"""

import math

import numpy as np

from seanav._compile import kernel
from seanav.checks import ParameterError, array, choice, integer, number
from seanav.filters import fading, imm
from seanav.models import earth, inertial

LANES = 16
KEPT = np.array([i for i in range(inertial.STATES) if i not in inertial.SLAVED])
N = len(KEPT)  # 16: L λ | v_N v_E | φ | b_a | b_g | v_c
PACKED = N * (N + 1) // 2
NOMINAL = 17
NAVIGATION = 7  # of the 16, those with dynamics of their own besides the current
LOOKED = np.array([2, 3, 4, 5, 6, 13, 14, 15])  # columns where H is not zero

# Unsigned: no check for negative subscripts stands in the way of the compiler's vectorising.
ROW = np.arange(PACKED, dtype=np.uint64) * np.uint64(LANES)  # where row i of a flat array begins

# Place of element (i, j) in a packed upper triangle.
AT = np.zeros((N, N), dtype=np.int64)
AT[np.triu_indices(N)] = np.arange(PACKED)
AT = np.maximum(AT, AT.T)
PLACE = ROW[AT]  # the same in a flat array
HALF = NAVIGATION * N * LANES

# Where H is linearised. All but the first need the truth, so only a study can use them.
ESTIMATE, TRUE_RELATIVE_VELOCITY, TRUTH = range(3)
LINEARISED = {"estimate": ESTIMATE, "relative velocity": TRUE_RELATIVE_VELOCITY, "truth": TRUTH}

# Rows of the coefficient array that `_predict_state` fills.
_C = 0  # C_bn at mid-interval, 9, row by row
_F = 9  # f_n, 3
_W = 12  # omega_in, 3
_AL = 15  # latitude into phi, 3
_VN, _VEN, _VED = 18, 19, 20  # v_N into phi_E; v_E into phi_N and phi_D
_VL = 21  # latitude into v_N, v_E, 2
_VV = 23  # v_E into v_N, v_N into v_E, v_E into v_E, 3
_PL = 26  # latitude into latitude and longitude, 2
_PV = 28  # v_N into latitude, v_E into longitude, 2
COEFFICIENTS = 30


@kernel
def _predict_state(x, theta, dv, height, dt, decay, f):
    """Mechanise one interval and fill the coefficients `f` of the error dynamics."""
    q, rotation, velocity = np.empty(4), np.empty(3), np.empty(3)
    for r in range(x.shape[1]):
        latitude, v_N, v_E = x[0, r], x[2, r], x[3, r]
        for i in range(4):
            q[i] = x[4 + i, r]
        for i in range(3):
            rotation[i] = theta[i, r] - x[11 + i, r] * dt
            x[14 + i, r] *= decay
        # Both biases acted inside the interval: on average after half of its rotation.
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            turned = 0.5 * (rotation[j] * x[8 + k, r] - rotation[k] * x[8 + j, r])
            turned += 0.5 * (x[11 + j, r] * dv[k, r] - x[11 + k, r] * dv[j, r])
            velocity[i] = dv[i, r] - (x[8 + i, r] + turned) * dt
        step = inertial._advance(latitude, height, v_N, v_E, q, rotation, velocity, dt)
        dL, dlongitude, n_N, n_E, f[_F, r], f[_F + 1, r], f[_F + 2, r] = step
        # Attitude of mid-interval: q(end) times half the rotation backwards.
        hx, hy, hz = -0.25 * rotation[0], -0.25 * rotation[1], -0.25 * rotation[2]
        hw = 1.0 - 0.5 * (hx * hx + hy * hy + hz * hz)
        h = hw * q[0] - hx * q[1] - hy * q[2] - hz * q[3]
        a = hw * q[1] + hx * q[0] + hz * q[2] - hy * q[3]
        b = hw * q[2] + hy * q[0] + hx * q[3] - hz * q[1]
        c = hw * q[3] + hz * q[0] + hy * q[1] - hx * q[2]
        f[_C, r] = 1.0 - 2.0 * (b * b + c * c)
        f[_C + 1, r] = 2.0 * (a * b - h * c)
        f[_C + 2, r] = 2.0 * (a * c + h * b)
        f[_C + 3, r] = 2.0 * (a * b + h * c)
        f[_C + 4, r] = 1.0 - 2.0 * (a * a + c * c)
        f[_C + 5, r] = 2.0 * (b * c - h * a)
        f[_C + 6, r] = 2.0 * (a * c - h * b)
        f[_C + 7, r] = 2.0 * (b * c + h * a)
        f[_C + 8, r] = 1.0 - 2.0 * (a * a + b * b)
        for i in range(4):
            x[4 + i, r] = q[i]
        x[0, r] += dL
        x[1, r] += dlongitude
        x[2, r], x[3, r] = n_N, n_E

        m_N, m_E = 0.5 * (v_N + n_N), 0.5 * (v_E + n_E)
        # Half the step on from the sine and cosine of its start; the next term is below 1e-20.
        s, c, half = math.sin(latitude), math.cos(latitude), 0.5 * dL
        s, c = s + half * (c - 0.5 * half * s), c - half * (s + 0.5 * half * c)
        t = s / c
        w = 1.0 - earth.ECCENTRICITY_SQUARED * s * s
        R_t = earth.SEMI_MAJOR / math.sqrt(w)
        R_tt = R_t * earth.ECCENTRICITY_SQUARED * s * c / w
        R_n = R_t * (1.0 - earth.ECCENTRICITY_SQUARED) / w
        R_nn = 3.0 * R_n * earth.ECCENTRICITY_SQUARED * s * c / w
        M, T = R_n + height, R_t + height
        r_N, r_E = m_E / T, -m_N / M
        o_N, o_D, r_D = earth.RATE * c, -earth.RATE * s, -r_N * t
        f[_W, r], f[_W + 1, r], f[_W + 2, r] = o_N + r_N, r_E, o_D + r_D
        down = -r_N / (c * c) + r_N * t * R_tt / T
        f[_AL, r] = o_D - r_N * R_tt / T
        f[_AL + 1, r] = -r_E * R_nn / M
        f[_AL + 2, r] = -o_N + down
        f[_VN, r], f[_VEN, r], f[_VED, r] = -1.0 / M, 1.0 / T, -t / T
        f[_VL, r] = m_E * (down - 2.0 * o_N)
        f[_VL + 1, r] = -m_N * (down - 2.0 * o_N)
        turn = 2.0 * o_D + r_D
        f[_VV, r], f[_VV + 1, r], f[_VV + 2, r] = turn - r_N * t, -turn, m_N * t / T
        f[_PL, r], f[_PL + 1, r] = r_E * R_nn / M, r_N / c * (t - R_tt / T)
        f[_PV, r], f[_PV + 1, r] = 1.0 / M, 1.0 / (T * c)


@kernel
def _transition(f, dt, y, out):
    """Apply the transition to y (16 rows); the seven navigation rows go to out.

    `out` begins at the first row's place in an array of 16 columns.
    """
    for r in range(LANES):
        L, vn, ve = y[r], y[2 * LANES + r], y[3 * LANES + r]
        pn, pe, pd = y[4 * LANES + r], y[5 * LANES + r], y[6 * LANES + r]
        gx, gy, gz = y[10 * LANES + r], y[11 * LANES + r], y[12 * LANES + r]
        wn, we, wd = f[_W * LANES + r], f[(_W + 1) * LANES + r], f[(_W + 2) * LANES + r]
        dn = f[_AL * LANES + r] * L + f[_VEN * LANES + r] * ve + wd * pe - we * pd
        dn += f[_C * LANES + r] * gx + f[(_C + 1) * LANES + r] * gy + f[(_C + 2) * LANES + r] * gz
        de = f[(_AL + 1) * LANES + r] * L + f[_VN * LANES + r] * vn - wd * pn + wn * pd
        de += (
            f[(_C + 3) * LANES + r] * gx
            + f[(_C + 4) * LANES + r] * gy
            + f[(_C + 5) * LANES + r] * gz
        )
        dd = f[(_AL + 2) * LANES + r] * L + f[_VED * LANES + r] * ve + we * pn - wn * pe
        dd += (
            f[(_C + 6) * LANES + r] * gx
            + f[(_C + 7) * LANES + r] * gy
            + f[(_C + 8) * LANES + r] * gz
        )
        out[4 * N * LANES + r], out[5 * N * LANES + r], out[6 * N * LANES + r] = (
            pn + dt * dn,
            pe + dt * de,
            pd + dt * dd,
        )
        pn, pe, pd = pn + 0.5 * dt * dn, pe + 0.5 * dt * de, pd + 0.5 * dt * dd
        ax, ay, az = y[7 * LANES + r], y[8 * LANES + r], y[9 * LANES + r]
        fn, fe, fd = f[_F * LANES + r], f[(_F + 1) * LANES + r], f[(_F + 2) * LANES + r]
        un = f[_VL * LANES + r] * L + f[_VV * LANES + r] * ve - fd * pe + fe * pd
        un -= f[_C * LANES + r] * ax + f[(_C + 1) * LANES + r] * ay + f[(_C + 2) * LANES + r] * az
        ue = (
            f[(_VL + 1) * LANES + r] * L
            + f[(_VV + 1) * LANES + r] * vn
            + f[(_VV + 2) * LANES + r] * ve
            + fd * pn
            - fn * pd
        )
        ue -= (
            f[(_C + 3) * LANES + r] * ax
            + f[(_C + 4) * LANES + r] * ay
            + f[(_C + 5) * LANES + r] * az
        )
        out[2 * N * LANES + r], out[3 * N * LANES + r] = vn + dt * un, ve + dt * ue
        out[r] = L + dt * (f[_PL * LANES + r] * L + f[_PV * LANES + r] * (vn + 0.5 * dt * un))
        out[N * LANES + r] = y[LANES + r] + dt * (
            f[(_PL + 1) * LANES + r] * L + f[(_PV + 1) * LANES + r] * (ve + 0.5 * dt * ue)
        )


@kernel
def _predict_covariance(P, f, dt, decay, q_velocity, q_attitude, q_current, work):
    """P ← Phi P Phiᵀ + Q in place; `work` (2 · 7 · 16 + 16 rows) is workspace."""
    width = np.uint64(len(work) // (2 * NAVIGATION * N + N))
    left, right, y = work[:HALF], work[HALF : 2 * HALF], work[2 * HALF :]
    for j in range(N):
        for i in range(N):
            to, at = ROW[i], PLACE[i, j]
            for r in range(width):
                y[to + r] = P[at + r]
        _transition(f, dt, y, left[j * LANES :])  # column j of Phi P, seven rows
    for i in range(NAVIGATION):
        y = left[i * N * LANES : (i + 1) * N * LANES]  # row i of Phi P
        _transition(f, dt, y, right[i * LANES :])  # column i of Phi P Phiᵀ
        for j in range(i, NAVIGATION):
            to, at = PLACE[i, j], ROW[j * N + i]
            for r in range(width):
                P[to + r] = right[at + r]
        for j in range(NAVIGATION, N):
            to, at = PLACE[i, j], ROW[j]
            factor = decay if j >= 13 else 1.0
            for r in range(width):
                P[to + r] = factor * y[at + r]
    for j in range(13, N):
        for i in range(NAVIGATION, j + 1):
            to = PLACE[i, j]
            factor = decay * decay if i >= 13 else decay
            for r in range(width):
                P[to + r] *= factor
    for i in range(2, N):
        if i < NAVIGATION or i >= 13:
            q = q_velocity if i < 4 else q_attitude if i < NAVIGATION else q_current
            to = PLACE[i, i]
            for r in range(width):
                P[to + r] += q


@kernel
def _look(x, P, z, axis, R, about, true_heading, h, u, rho, S):
    """Fill the row h of H (8 of 16 entries), u = P hᵀ, residual rho (predicted − z) and S.

    H is taken at the point that `about` names, the residual at the estimate.
    """
    width = np.uint64(len(S))
    for r in range(LANES):
        w, a, b, c = x[4, r], x[5, r], x[6, r], x[7, r]
        if axis == 0:
            cn, ce, cd = 1.0 - 2.0 * (b * b + c * c), 2.0 * (a * b + w * c), 2.0 * (a * c - w * b)
        elif axis == 1:
            cn, ce, cd = 2.0 * (a * b - w * c), 1.0 - 2.0 * (a * a + c * c), 2.0 * (b * c + w * a)
        else:
            cn, ce, cd = 2.0 * (a * c + w * b), 2.0 * (b * c - w * a), 1.0 - 2.0 * (a * a + b * b)
        un, ue, ud = x[2, r] - x[14, r], x[3, r] - x[15, r], -x[16, r]
        rho[r] = cn * un + ce * ue + cd * ud - z[r]
        S[r] = R
        if about == TRUTH:  # level, and only the forward axis has a linear counterpart
            cn, ce, cd = math.cos(true_heading), math.sin(true_heading), 0.0
        attitude = 1.0 if about == ESTIMATE else 0.0
        h[r], h[LANES + r] = cn, ce
        h[2 * LANES + r] = attitude * (ue * cd - ud * ce)
        h[3 * LANES + r] = attitude * (ud * cn - un * cd)
        h[4 * LANES + r] = attitude * (un * ce - ue * cn)
        h[5 * LANES + r], h[6 * LANES + r], h[7 * LANES + r] = -cn, -ce, -cd
    for i in range(N):
        to = ROW[i]
        for r in range(width):
            u[to + r] = 0.0
        for k in range(8):
            at, entry = PLACE[i, LOOKED[k]], ROW[k]
            for r in range(width):
                u[to + r] += P[at + r] * h[entry + r]
    for k in range(8):
        at, entry = ROW[LOOKED[k]], ROW[k]
        for r in range(width):
            S[r] += h[entry + r] * u[at + r]


@kernel
def _shift(x, e, sign):
    # See `shift`; x is changed.
    for r in range(LANES):
        for i in range(4):
            x[i, r] += sign * e[i, r]
        # An estimate with error phi is (I − [phi×]) C: adding an error turns by −phi.
        hn, he, hd = -0.5 * sign * e[4, r], -0.5 * sign * e[5, r], -0.5 * sign * e[6, r]
        hw = 1.0 - 0.5 * (hn * hn + he * he + hd * hd)
        w, a, b, c = x[4, r], x[5, r], x[6, r], x[7, r]
        x[4, r] = hw * w - hn * a - he * b - hd * c
        x[5, r] = hw * a + hn * w + he * c - hd * b
        x[6, r] = hw * b + he * w + hd * a - hn * c
        x[7, r] = hw * c + hd * w + hn * b - he * a
        for i in range(9):
            x[8 + i, r] += sign * e[7 + i, r]


def shift(x, e, sign=1.0):
    """Return nominal states moved by error states.

    Parameters
    ----------
    x : array (17, LANES)
        Nominal states.
    e : array (16, LANES)
        Error states.
    sign : float
        +1 adds the errors, -1 takes them away.

    Returns
    -------
    ndarray (17, LANES)

    Raises
    ------
    seanav.checks.ParameterError
        If a shape does not fit or a number is not finite.
    """
    moved = array("x", x, (NOMINAL, LANES)).copy()
    _shift(moved, array("e", e, (N, LANES)), number("sign", sign))
    return moved


@kernel
def _difference(x, reference, e):
    """Write the error states of x relative to `reference`, (17, runs) each, into e (16, runs)."""
    for r in range(LANES):
        for i in range(4):
            e[i, r] = x[i, r] - reference[i, r]
        w, a, b, c = x[4, r], x[5, r], x[6, r], x[7, r]
        pw, pa, pb, pc = reference[4, r], reference[5, r], reference[6, r], reference[7, r]
        scale = -2.0 if w * pw + a * pa + b * pb + c * pc > 0.0 else 2.0
        e[4, r] = scale * (a * pw - w * pa - b * pc + c * pb)
        e[5, r] = scale * (b * pw - w * pb - c * pa + a * pc)
        e[6, r] = scale * (c * pw - w * pc - a * pb + b * pa)
        for i in range(9):
            e[7 + i, r] = x[8 + i, r] - reference[8 + i, r]


@kernel
def _inflate(P, form, beta, q_current):
    """Apply a fading form to the predicted covariance P (packed, runs)."""
    width = np.uint64(len(beta))
    if form == fading.LITERAL or form == fading.LITERAL_GAIN:
        for k in range(PACKED):
            to = ROW[k]
            for r in range(width):
                P[to + r] *= beta[r]
    elif form == fading.BLOCK:
        for i in range(13, N):
            for j in range(i, N):
                to = PLACE[i, j]
                for r in range(width):
                    P[to + r] *= beta[r]
    elif form == fading.VARIANCE or form == fading.SIGMA:
        power = 2 if form == fading.SIGMA else 1
        for i in range(13, N):
            to = PLACE[i, i]
            for r in range(width):
                P[to + r] += (beta[r] ** power - 1.0) * q_current


@kernel
def _correct(P, u, S, gain):
    """P ← (I − K H) P with K = gain · u / S, in Joseph's form (exact for any gain)."""
    width = np.uint64(len(gain))
    scaled = np.empty(LANES)
    for i in range(N):
        own = ROW[i]
        for r in range(width):
            scaled[r] = (2.0 * gain[r] - gain[r] * gain[r]) / S[r] * u[own + r]
        for j in range(i, N):
            to, at = PLACE[i, j], ROW[j]
            for r in range(width):
                P[to + r] -= scaled[r] * u[at + r]


@kernel
def _cholesky_nees(P, e, r, L):
    """Return eᵀ P⁻¹ e of run r; P is packed and scaled here to a correlation matrix."""
    total = 0.0
    for i in range(N):
        di = math.sqrt(P[AT[i, i], r])
        for j in range(i + 1):
            s = P[AT[i, j], r] / (di * math.sqrt(P[AT[j, j], r]))
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = math.sqrt(s) if i == j else s / L[j, j]
        s = e[i, r] / di
        for k in range(i):
            s -= L[i, k] * L[k, N]
        L[i, N] = s / L[i, i]
        total += L[i, N] * L[i, N]
    return total


# What `_mission` sums over the steps of a run, in this order; then one column per model.
SUMS = ("north", "east", "velocity", "levelling", "heading", "nis", "nees", "beta", "squared_nis")


@kernel
def _mission(
    theta, dv, z, truth, x, P, mu, T, settings, noise, forms, window, stride, sums, series, last
):
    """Fly one batch of runs; see `fly` for the arguments."""
    steps, models = z.shape[0], x.shape[0]
    height, dt, R, cap = settings[0], settings[1], settings[2], settings[3]
    q_velocity, q_attitude, aided = settings[4], settings[5], settings[6] > 0.0
    about = int(settings[7])
    f = np.zeros((COEFFICIENTS, LANES))
    flat_f, flat_P = f.reshape(-1), P.reshape((models, -1))
    work = np.zeros(2 * HALF + N * LANES)
    h, u = np.zeros(8 * LANES), np.zeros(N * LANES)
    rho, S = np.zeros(LANES), np.zeros(LANES)
    squared, total, spread = np.zeros(LANES), np.zeros(LANES), np.zeros(LANES)
    beta, gain = np.ones((models, LANES)), np.ones(LANES)
    nis = np.zeros((models, LANES))
    rings = np.zeros((models, window, LANES))
    logs, predicted = np.zeros((models, LANES)), np.zeros((models, LANES))
    weights = np.zeros((models, models, LANES))
    deviations = np.zeros((models, N, LANES))
    mixed_P, best_P = np.zeros((models, PACKED, LANES)), np.zeros((PACKED, LANES))
    best, mean, e = np.zeros((NOMINAL, LANES)), np.zeros((N, LANES)), np.zeros((N, LANES))
    true_state = np.zeros((NOMINAL, LANES))
    cholesky, centred = np.zeros((N, N + 1)), np.zeros((N, LANES))

    for step in range(steps):
        heading = 2.0 * math.atan2(truth[step, 7], truth[step, 4])
        if models > 1:
            imm._interact(T, mu, predicted, weights)
            best[:] = x[0]
            for i in range(models):
                _difference(x[i], best, deviations[i])
            for j in range(models):
                imm._mix(weights[j], deviations, P, mean, mixed_P[j], centred)
                x[j] = best
                _shift(x[j], mean, 1.0)
            P[:] = mixed_P
        for j in range(models):
            decay, q_current = noise[j, 0], noise[j, 1]
            _predict_state(x[j], theta[step], dv[step], height, dt, decay, f)
            if not aided:
                continue
            _predict_covariance(
                flat_P[j], flat_f, dt, decay, q_velocity, q_attitude, q_current, work
            )
            axes = z.shape[1]
            gain[:] = 1.0
            if forms[j] != fading.NONE:
                squared[:] = 0.0
                spread[:] = 0.0
                for axis in range(axes):
                    _look(x[j], flat_P[j], z[step, axis], axis, R, about, heading, h, u, rho, S)
                    for r in range(LANES):
                        squared[r] += rho[r] * rho[r]
                        spread[r] += S[r]
                fading._remember(rings[j], step, squared, total)
                for r in range(LANES):
                    beta[j, r] = fading._factor(total[r], min(step + 1, window), spread[r], cap)
                _inflate(flat_P[j], forms[j], beta[j], q_current)
                if forms[j] == fading.LITERAL_GAIN:
                    for r in range(LANES):
                        gain[r] = 1.0 / beta[j, r]
            for r in range(LANES):
                logs[j, r] = 0.0
                nis[j, r] = 0.0
            for axis in range(axes):
                _look(x[j], flat_P[j], z[step, axis], axis, R, about, heading, h, u, rho, S)
                for r in range(LANES):
                    nis[j, r] += rho[r] * rho[r] / S[r]
                    if models > 1:
                        logs[j, r] += imm._log_likelihood(rho[r] * rho[r], S[r])
                for i in range(N):
                    for r in range(LANES):
                        e[i, r] = gain[r] * u[i * LANES + r] * (rho[r] / S[r])
                _correct(flat_P[j], u, S, gain)
                _shift(x[j], e, -1.0)
        if models > 1:
            imm._probabilities(predicted, logs, mu)
            best[:] = x[0]
            for i in range(models):
                _difference(x[i], best, deviations[i])
            for k in range(N):
                for r in range(LANES):
                    mean[k, r] = 0.0
                for i in range(models):
                    for r in range(LANES):
                        mean[k, r] += mu[i, r] * deviations[i, k, r]
            _shift(best, mean, 1.0)
        else:
            best[:] = x[0]
        for i in range(8):
            for r in range(LANES):
                true_state[i, r] = truth[step, i]
        _difference(best, true_state, e)
        meters_N, meters_E = truth[step, 8], truth[step, 9]
        for r in range(LANES):
            north, east = e[0, r] * meters_N, e[1, r] * meters_E
            sums[0, r] += north * north
            sums[1, r] += east * east
            sums[2, r] += e[2, r] * e[2, r] + e[3, r] * e[3, r]
            sums[3, r] += e[4, r] * e[4, r] + e[5, r] * e[5, r]
            sums[4, r] += e[6, r] * e[6, r]
            for j in range(models):
                sums[5, r] += mu[j, r] * nis[j, r]
                sums[7, r] += mu[j, r] * beta[j, r]
                sums[9 + j, r] += mu[j, r]
            sums[8, r] += nis[0, r] * nis[0, r]
        if stride > 0 and (step + 1) % stride == 0:
            at = (step + 1) // stride - 1
            for i in range(N):
                for r in range(LANES):
                    series[at, i, r] = e[i, r]
            for r in range(LANES):
                series[at, 0, r] *= meters_N
                series[at, 1, r] *= meters_E
                for j in range(models):
                    series[at, N + 1 + j, r] = mu[j, r]
            if aided:
                # The sea current and the biases of the truth are the caller's to subtract.
                for i in range(7, N):
                    for r in range(LANES):
                        e[i, r] -= last[at, i - 7, r]
                        series[at, i, r] = e[i, r]
                if models > 1:
                    imm._mix(mu, deviations, P, mean, best_P, centred)
                else:
                    best_P[:] = P[0]
                for r in range(LANES):
                    series[at, N, r] = _cholesky_nees(best_P, e, r, cholesky)
                    sums[6, r] += series[at, N, r]


def pack_diagonal(variances):
    """Return a packed diagonal covariance of the 16 states, (136, LANES)."""
    P = np.zeros((PACKED, LANES))
    P[np.diagonal(AT)] = array("variances", variances, (N,), at_least=0)[:, None]
    return P


def unpack(P):
    """Return covariances (18, 18, runs) from packed ones (136, runs); held states are zero."""
    P = array("P", P, (PACKED, "runs"))
    full = np.zeros((inertial.STATES, inertial.STATES, P.shape[1]))
    full[np.ix_(KEPT, KEPT)] = P[AT]
    return full


def fly(
    theta,
    dv,
    z,
    truth,
    x0,
    P0,
    *,
    height,
    R,
    noise,
    forms,
    velocity_noise,
    attitude_noise,
    transition,
    mu0,
    window=20,
    cap=10.0,
    aided=True,
    about="estimate",
    stride=0,
    true_rest=None,
):
    """Fly one batch of missions with one EKF or the IMM of several.

    Parameters
    ----------
    theta, dv : (steps, 3, LANES)
        Increments as reported, 1 s each (see `seanav.models.inertial.preintegrate`).
    z : (steps, axes, LANES)
        Log at the end of each step, m/s; 1 axis (forward), 2 or 3, noise variance `R` each.
    truth : (steps, 10)
        Latitude, longitude, v_N, v_E, quaternion, metres per radian north and east.
    x0 : (17, LANES)
        Nominal state at the start, the same for every model.
    P0 : (models, 136, LANES)
        Packed covariances at the start.
    noise : (models, 2)
        Of the current per step: decay a and variance q.
    forms : sequence of str
        Fading form of each model, a key of `seanav.filters.fading.FORMS`.
    velocity_noise, attitude_noise : float
        Process noise variance per step, (m/s)² and rad².
    transition : (models, models); mu0 : (models,)
        Of the IMM; of no effect for one model.
    window, cap : int, float
        Of the fading.
    aided : bool
        False: pure inertial navigation.
    about : str
        Where H is linearised, a key of `LINEARISED`: at the estimate; with the attitude
        columns of the true velocity through still water, zero; or wholly at the truth.
    stride : int
        Record the error every so many steps; 0: never.
    true_rest : (steps // stride, 9, LANES)
        True biases and current at the recorded steps, for the NEES.

    Returns
    -------
    means : (9 + models, LANES)
        Means over time of `SUMS`, then of the mode probabilities.
    series : (steps // stride, 17 + models, LANES)
        Errors of the 16 states (position in metres), NEES, mode probabilities.
    P : (models, 136, LANES)
        Covariances at the end.

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit, a number is not finite or out of its bounds, or a word unknown.
    """
    sizes = {}
    theta = array("theta", theta, ("steps", 3, LANES), sizes)
    dv = array("dv", dv, ("steps", 3, LANES), sizes)
    z = array("z", z, ("steps", "axes", LANES), sizes)
    truth = array("truth", truth, ("steps", 10), sizes)
    x0 = array("x0", x0, (NOMINAL, LANES))
    P = array("P0", P0, ("models", PACKED, LANES), sizes).copy()
    T = imm._distributions("transition", transition, ("models", "models"), sizes, axis=1)
    mu = imm._distributions("mu0", mu0, ("models",), sizes)
    noise = array("noise", noise, ("models", 2), sizes, at_least=0)
    models, steps, axes = len(P), len(z), z.shape[1]
    integer("axes of z", axes, at_least=1, at_most=3)
    least = float(P[:, np.diagonal(AT)].min())
    if least < 0:
        raise ParameterError("P0", least, "must not be negative on the diagonal")
    if not isinstance(forms, (list, tuple)) or len(forms) != models:
        raise ParameterError("forms", forms, f"must be a list of {models} fading forms")
    forms = [fading.FORMS[choice("forms", form, fading.FORMS)] for form in forms]
    window = min(integer("window", window, at_least=1), steps)  # a longer one stays empty
    stride = min(integer("stride", stride, at_least=0), steps + 1)  # which is never
    settings = [
        number("height", height),
        1.0,
        number("R", R, above=0),
        number("cap", cap, at_least=1),
        number("velocity_noise", velocity_noise, at_least=0),
        number("attitude_noise", attitude_noise, at_least=0),
        float(choice("aided", aided, (True, False))),
        float(LINEARISED[choice("about", about, LINEARISED)]),
    ]
    records = steps // stride if stride else 0
    rest = np.zeros((max(records, 1), 9, LANES))
    if true_rest is not None and records:
        rest = array("true_rest", true_rest, (records, 9, LANES))
    sums = np.zeros((len(SUMS) + models, LANES))
    series = np.zeros((max(records, 1), N + 1 + models, LANES))
    _mission(
        theta,
        dv,
        z,
        truth,
        np.repeat(x0[None], models, axis=0),
        P,
        np.repeat(mu[:, None], LANES, axis=1),
        T,
        np.array(settings),
        noise,
        np.array(forms),
        window,
        stride,
        sums,
        series,
        rest,
    )
    sums /= steps
    if records:
        sums[6] *= steps / records
    return sums, series[:records], P
