"""The 18-state kernels against dense algebra, differences, filterpy and each other."""

import math

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from seanav.filters import fading, ins
from seanav.models import attitude, currents, earth, inertial

LANES = ins.LANES


def _nominal(seed=0):
    """Random nominal states with a large current, and the same as plain arrays."""
    random = np.random.default_rng(seed)
    x = np.zeros((ins.NOMINAL, LANES))
    x[0], x[1] = 0.6 + 0.1 * random.random(LANES), 2.2
    x[2:4] = 8 * random.standard_normal((2, LANES))
    q = np.concatenate([random.standard_normal((1, LANES)), np.zeros((2, LANES))])
    q = np.concatenate([q, random.standard_normal((1, LANES))]) + 0.02
    x[4:8] = q / np.sqrt((q**2).sum(axis=0))
    x[8:11] = 1e-3 * random.standard_normal((3, LANES))
    x[11:14] = 1e-6 * random.standard_normal((3, LANES))
    x[14:17] = 3 * random.standard_normal((3, LANES))
    return x


def _matrix(q):
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _covariance(seed=1):
    """Random positive covariances on the scale of the problem, packed and (LANES, 16, 16)."""
    random = np.random.default_rng(seed)
    scale = np.r_[[1e-6] * 2, [0.3] * 2, [1e-4] * 3, [5e-4] * 3, [1e-7] * 3, [0.5] * 3]
    A = random.standard_normal((LANES, 16, 40))
    full = A @ A.transpose(0, 2, 1) / 40 * np.outer(scale, scale)
    i, j = np.triu_indices(16)
    return np.ascontiguousarray(full[:, i, j].T), full


def _predicted(x, dt=1.0):
    random = np.random.default_rng(4)
    theta = np.zeros((3, LANES))
    theta[2] = 0.03 * random.standard_normal(LANES)
    theta[:2] = 1e-4 * random.standard_normal((2, LANES))
    dv = np.array([[0.1], [0.2], [-9.8]]) * dt + 0.1 * random.standard_normal((3, LANES))
    f, after = np.zeros((ins.COEFFICIENTS, LANES)), x.copy()
    ins._predict_state(after, theta, dv, 0.0, dt, math.exp(-dt / 7200), f)
    return theta, dv, f, after


def _dense_transition(x, after, theta, f, r):
    """I + F dt + F² dt²/2 of the 16 states of run r, from the dense error model."""
    C = _matrix(after[4:8, r]) @ attitude.exp_so3(-0.5 * (theta[:, r] - x[11:14, r]))
    position = (0.5 * (x[0, r] + after[0, r]), 0.0, 0.0)
    v = np.r_[0.5 * (x[2:4, r] + after[2:4, r]), 0.0]
    F = inertial.error_dynamics(position, v, C, f[ins._F : ins._F + 3, r], 7200.0)
    F = F[np.ix_(ins.KEPT, ins.KEPT)]
    F[13:] = 0.0
    Phi = np.eye(16) + F + 0.5 * F @ F
    Phi[range(13, 16), range(13, 16)] = math.exp(-1 / 7200)
    return Phi


def _column(f, column):
    """A column of the transition, its seven navigation rows."""
    y, out = np.zeros((16, LANES)), np.zeros((7, 16, LANES))
    y[column] = 1.0
    ins._transition(f.reshape(-1), 1.0, y.reshape(-1), out.reshape(-1))
    assert not out[:, 1:].any()
    return out[:, 0]


def test_covariance_prediction_equals_dense_algebra():
    x = _nominal()
    theta, _, f, after = _predicted(x)
    P, full = _covariance()
    ins._predict_covariance(
        P.reshape(-1),
        f.reshape(-1),
        1.0,
        math.exp(-1 / 7200),
        1e-9,
        1e-14,
        1e-5,
        np.zeros((2 * 7 * 16 + 16) * LANES),
    )
    Q = np.diag([0.0] * 2 + [1e-9] * 2 + [1e-14] * 3 + [0.0] * 6 + [1e-5] * 3)
    got = P[ins.AT]
    for r in range(LANES):
        Phi = _dense_transition(x, after, theta, f, r)
        expected = Phi @ full[r] @ Phi.T + Q
        scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
        assert (np.abs(got[:, :, r] - expected) / scale).max() < 3e-6
        # The order of the three maps costs half the squared Schuler rate, 8e-7 per second;
        # the step itself is far larger.
        assert (np.abs(full[r] - expected) / scale).max() > 1e-4


def test_every_row_of_the_transition_equals_the_dense_one():
    x = _nominal(3)
    theta, _, f, after = _predicted(x)
    for column in range(16):
        out = _column(f, column)
        for r in range(LANES):
            expected = _dense_transition(x, after, theta, f, r)[:7, column]
            size = np.array([1e-6, 1e-6, 1, 1, 1e-4, 1e-4, 1e-4])
            unit = np.r_[[1e-6] * 2, [1] * 2, [1e-4] * 3, [1e-3] * 3, [1e-6] * 3, [1] * 3][column]
            assert np.abs((out[:7, r] - expected) * unit / size).max() < 2e-6


def test_prediction_of_the_error_matches_differences_of_the_mechanisation():
    x = _nominal(5)
    theta, dv, f, after = _predicted(x)
    decay = math.exp(-1 / 7200)
    sizes = np.r_[[1e-6] * 2, [0.1] * 2, [1e-4] * 3, [1e-3] * 3, [1e-5] * 3, [0.1] * 3]
    for column, size in enumerate(sizes):
        ends = []
        for sign in (1, -1):
            e = np.zeros((16, LANES))
            e[column] = sign * size
            moved = x.copy()
            ins._shift(moved, e, 1.0)
            ins._predict_state(moved, theta, dv, 0.0, 1.0, decay, np.zeros_like(f))
            ins._difference(moved, after, e)
            ends.append(e)
        numeric = (ends[0] - ends[1]) / (2 * size)
        out = _column(f, column)
        scale = np.array([1e-6, 1e-6, 0.1, 0.1, 1e-4, 1e-4, 1e-4])[:, None] / size
        assert (np.abs(out[:7] - numeric[:7]) / scale).max() < 2e-4, column


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_H_matches_differences_at_a_large_current(axis):
    x = _nominal()
    P, full = _covariance()
    h, u = np.zeros((8, LANES)), np.zeros((16, LANES))
    rho, S, z = np.zeros(LANES), np.zeros(LANES), np.zeros(LANES)
    ins._look(x, P.reshape(-1), z, axis, 0.01, 0, 0.0, h.reshape(-1), u.reshape(-1), rho, S)
    H = np.zeros((16, LANES))
    H[[2, 3, 4, 5, 6, 13, 14, 15]] = h
    for r in range(LANES):
        relative = np.r_[x[2:4, r], 0.0] - x[14:17, r]
        assert rho[r] == pytest.approx((_matrix(x[4:8, r]).T @ relative)[axis])
        assert u[:, r] == pytest.approx(full[r] @ H[:, r])
        assert S[r] == pytest.approx(H[:, r] @ full[r] @ H[:, r] + 0.01)
    for column in range(16):
        ends = []
        for sign in (1, -1):
            e = np.zeros((16, LANES))
            e[column] = sign * 1e-4
            moved = x.copy()
            ins._shift(moved, e, 1.0)
            ins._look(
                moved, P.reshape(-1), z, axis, 0.01, 0, 0.0, h.reshape(-1), u.reshape(-1), rho, S
            )
            ends.append(rho.copy())
        assert (ends[0] - ends[1]) / 2e-4 == pytest.approx(H[column], abs=2e-7)


def test_shift_and_difference_are_inverse_and_follow_the_paper():
    x, random = _nominal(), np.random.default_rng(2)
    e = 1e-4 * random.standard_normal((16, LANES))
    moved, back = x.copy(), np.zeros_like(e)
    ins._shift(moved, e, 1.0)
    ins._difference(moved, x, back)
    assert back == pytest.approx(e, abs=1e-11)
    C, C_hat = _matrix(x[4:8, 0]), _matrix(moved[4:8, 0])
    assert C_hat == pytest.approx((np.eye(3) - attitude.skew(e[4:7, 0])) @ C, abs=1e-7)
    assert attitude.attitude_error(C_hat, C) == pytest.approx(e[4:7, 0], rel=1e-6)


@pytest.mark.parametrize("gain", [1.0, 0.4])
def test_correction_is_joseph_form_for_any_gain(gain):
    P, full = _covariance()
    random = np.random.default_rng(0)
    H = random.standard_normal((LANES, 16)) / np.sqrt(np.einsum("rii->ri", full))
    u = np.einsum("rij,rj->ir", full, H)
    S = np.einsum("ri,ir->r", H, u) + 0.5
    ins._correct(P.reshape(-1), np.ascontiguousarray(u).reshape(-1), S, np.full(LANES, gain))
    for r in range(LANES):
        K = gain * u[:, r] / S[r]
        A = np.eye(16) - np.outer(K, H[r])
        expected = A @ full[r] @ A.T + 0.5 * np.outer(K, K)
        scale = np.sqrt(np.outer(np.diag(full[r]), np.diag(full[r])))
        assert P[ins.AT][:, :, r] / scale == pytest.approx(expected / scale, abs=1e-12)
        if gain == 1.0:
            one = KalmanFilter(dim_x=16, dim_z=1)
            one.P, one.R = full[r].copy(), np.array([[0.5]])
            one.update(np.zeros((1, 1)), H=H[r][None])
            assert P[ins.AT][:, :, r] / scale == pytest.approx(one.P / scale, abs=1e-10)
            # P after is below P before.
            drop = (full[r] - P[ins.AT][:, :, r]) / scale
            assert np.linalg.eigvalsh(drop).min() > -1e-12


def test_fading_forms_inflate_what_they_say():
    beta, q = np.full(LANES, 3.0), 1e-3
    _, full = _covariance()
    for name, form in fading.FORMS.items():
        P, _ = _covariance()
        before = P.copy()
        ins._inflate(P.reshape(-1), form, beta, q)
        change = (P - before)[ins.AT]
        expected = np.zeros_like(change)
        if name.startswith("literal"):
            expected = 2 * before[ins.AT]
        elif name == "block":
            expected[13:, 13:] = 2 * before[ins.AT][13:, 13:]
        elif name in ("variance", "sigma"):
            expected[range(13, 16), range(13, 16)] = q * (2 if name == "variance" else 8)
        assert change == pytest.approx(expected, rel=1e-9, abs=1e-18), name
    assert full.shape == (LANES, 16, 16)


def test_nees_is_the_quadratic_form():
    P, full = _covariance()
    e = np.linalg.cholesky(full) @ np.random.default_rng(3).standard_normal((LANES, 16, 1))
    e = np.ascontiguousarray(e[..., 0].T)
    for r in range(LANES):
        expected = e[:, r] @ np.linalg.solve(full[r], e[:, r])
        got = ins._cholesky_nees(P, e, r, np.zeros((16, 17)))
        assert got == pytest.approx(expected, rel=1e-6)


def test_unpack_restores_all_eighteen_states():
    P, full = _covariance()
    wide = ins.unpack(P)
    assert wide.shape == (18, 18, LANES)
    assert not wide[inertial.SLAVED, :].any()
    assert wide[np.ix_(ins.KEPT, ins.KEPT)][:, :, 2] == pytest.approx(full[2])
    diagonal = ins.pack_diagonal(np.arange(16.0))
    assert diagonal[ins.AT][:, :, 0] == pytest.approx(np.diag(np.arange(16.0)))


def test_current_decays_by_its_own_law():
    a, variance = currents.decay(1.0, 7200.0)
    assert a == pytest.approx(math.exp(-1 / 7200))
    assert variance == pytest.approx(1 - a * a, rel=1e-9)
    x = _nominal()
    _, _, _, after = _predicted(x)
    assert after[14:17] == pytest.approx(a * x[14:17])
    assert earth.RATE == pytest.approx(2 * math.pi / 86164.1, rel=1e-6)


def _dense(x, theta, dv, decay):
    """Predicted states and the dense transition of every run, (LANES, 16, 16)."""
    f, after = np.zeros((ins.COEFFICIENTS, LANES)), x.copy()
    ins._predict_state(after, theta, dv, 0.0, 1.0, decay, f)
    Phi = np.repeat(np.diag([1.0] * 13 + [decay] * 3)[None], LANES, axis=0)
    for column in range(16):
        Phi[:, :7, column] = _column(f, column).T
    return after, Phi


def _looked(x, P, z, R):
    """H (LANES, 16), residual and S of the forward axis, by the tested kernel and algebra."""
    h, u = np.zeros(8 * LANES), np.zeros(16 * LANES)
    rho, S = np.zeros(LANES), np.zeros(LANES)
    ins._look(x, np.zeros(ins.PACKED * LANES), z, 0, R, 0, 0.0, h, u, rho, S)
    H = np.zeros((LANES, 16))
    H[:, [2, 3, 4, 5, 6, 13, 14, 15]] = h.reshape(8, LANES).T
    return H, rho, np.einsum("ri,rij,rj->r", H, P, H) + R


def _plain_imm(theta, dv, z, truth, x0, P0, noise, T, mu, window, cap, R, q_velocity, q_attitude):
    """Equations (14)-(26) in numpy, with fading of the current's sigma: errors and modes."""
    models = len(noise)
    x, P = [x0.copy() for _ in range(models)], [p.copy() for p in P0]
    past = [[] for _ in range(models)]
    errors, modes = [], []
    for k in range(len(z)):
        predicted = T.T @ mu
        weights = T[:, :, None] * mu[:, None] / predicted  # from i to j
        about, deviations = x[0].copy(), np.zeros((models, 16, LANES))
        for i in range(models):
            ins._difference(x[i], about, deviations[i])
        mixed = []
        for j in range(models):
            mean = np.einsum("ir,ikr->kr", weights[:, j], deviations)
            c = deviations - mean
            spread = np.einsum("ir,ikr,imr->rkm", weights[:, j], c, c)
            mixed.append(sum(weights[i, j][:, None, None] * P[i] for i in range(models)) + spread)
            x[j] = about.copy()
            ins._shift(x[j], mean, 1.0)
        likelihoods = np.empty((models, LANES))
        for j, (decay, q) in enumerate(noise):
            x[j], Phi = _dense(x[j], theta[k], dv[k], decay)
            Q = np.diag([0.0] * 2 + [q_velocity] * 2 + [q_attitude] * 3 + [0.0] * 6 + [q] * 3)
            prior = Phi @ mixed[j] @ Phi.transpose(0, 2, 1) + Q
            H, rho, S = _looked(x[j], prior, z[k, 0], R)
            past[j] = [*past[j], rho**2][-window:]
            beta = np.ones(LANES)
            if len(past[j]) > 1:
                beta = np.clip(sum(past[j]) / (len(past[j]) - 1) / S, 1, cap)
            prior[:, range(13, 16), range(13, 16)] += ((beta**2 - 1) * q)[:, None]
            _, _, S = _looked(x[j], prior, z[k, 0], R)
            K = np.einsum("rij,rj->ri", prior, H) / S[:, None]
            A = np.eye(16) - K[:, :, None] * H[:, None]
            P[j] = A @ prior @ A.transpose(0, 2, 1) + R * K[:, :, None] * K[:, None]
            likelihoods[j] = np.exp(-0.5 * rho**2 / S) / np.sqrt(2 * math.pi * S)
            ins._shift(x[j], np.ascontiguousarray((K * rho[:, None]).T), -1.0)
        mu = likelihoods * predicted
        mu = mu / mu.sum(axis=0)
        about = x[0].copy()
        for i in range(models):
            ins._difference(x[i], about, deviations[i])
        ins._shift(about, np.einsum("ir,ikr->kr", mu, deviations), 1.0)
        true, e = np.zeros((ins.NOMINAL, LANES)), np.zeros((16, LANES))
        true[:8] = truth[k, :8, None]
        ins._difference(about, true, e)
        e[:2] *= truth[k, 8:10, None]
        errors.append(e)
        modes.append(mu)
    return np.array(errors), np.array(modes), np.array(P)


def test_a_mission_is_the_printed_equations_in_plain_numpy():
    steps, random = 25, np.random.default_rng(6)
    x0, (packed, full) = _nominal(7), _covariance()
    x0[4:8] = np.array([0.8, 0.0, 0.0, 0.6])[:, None]
    theta = 1e-3 * random.standard_normal((steps, 3, LANES))
    dv = np.array([[0.1], [0.2], [-9.8]]) + 0.05 * random.standard_normal((steps, 3, LANES))
    truth = np.zeros((steps, 10))
    truth[:, 0], truth[:, 1], truth[:, 4], truth[:, 7] = 0.65, 2.2, 0.8, 0.6
    truth[:, 8], truth[:, 9] = 6.3e6, 5.1e6
    z = 2 * random.standard_normal((steps, 1, LANES))
    noise, T = [(0.999, 1e-3), (0.99, 0.05)], np.array([[0.8, 0.2], [0.3, 0.7]])
    mu, P0 = np.array([0.6, 0.4]), np.stack([packed, 2 * packed])
    options = {"window": 5, "cap": 3.0, "R": 0.04}
    means, series, P = ins.fly(
        theta,
        dv,
        z,
        truth,
        x0,
        P0,
        height=0.0,
        noise=noise,
        forms=["sigma"] * 2,
        velocity_noise=1e-4,
        attitude_noise=1e-10,
        transition=T,
        mu0=mu,
        stride=1,
        **options,
    )
    errors, modes, covariances = _plain_imm(
        theta,
        dv,
        z,
        truth,
        x0,
        [full, 2 * full],
        noise,
        T,
        np.repeat(mu[:, None], LANES, axis=1),
        q_velocity=1e-4,
        q_attitude=1e-10,
        **options,
    )
    assert np.ptp(modes, axis=0).min() > 0.01  # the modes move, so that their order matters
    assert series[:, 17:] == pytest.approx(modes, rel=1e-7, abs=1e-12)
    scale = np.abs(errors).max(axis=(0, 2))[:, None]
    assert np.abs(series[:, :16] / scale - errors / scale).max() < 1e-8
    assert means[9] == pytest.approx(modes[:, 0].mean(axis=0))
    spread = np.sqrt(np.einsum("mrii->mri", covariances))
    got = P[:, ins.AT].transpose(0, 3, 1, 2) / spread[..., None] / spread[:, :, None]
    assert np.abs(got - covariances / spread[..., None] / spread[:, :, None]).max() < 1e-7
