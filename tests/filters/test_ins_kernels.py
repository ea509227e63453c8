"""The parts of a mission against dense algebra, differences and filterpy."""

import math

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from seanav.filters import fading, ins
from seanav.filters.ins import layout, mission, predict, reference, score, states, update
from seanav.models import attitude, currents, inertial

LANES = ins.LANES
DECAY = math.exp(-1 / 7200)


def _settings(**changes):
    """One hundredth (m/s)² of noise on the log, and process noise that shows."""
    plain = mission.Settings(
        models=1,
        height=0.0,
        dt=1.0,
        R=0.01,
        window=20,
        cap=10.0,
        velocity_noise=1e-9,
        attitude_noise=1e-14,
        aided=True,
        about=update.ESTIMATE,
        stride=0,
    )
    return plain._replace(**changes)


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


def _predicted(x):
    random = np.random.default_rng(4)
    theta = np.zeros((3, LANES))
    theta[2] = 0.03 * random.standard_normal(LANES)
    theta[:2] = 1e-4 * random.standard_normal((2, LANES))
    dv = np.array([[0.1], [0.2], [-9.8]]) + 0.1 * random.standard_normal((3, LANES))
    f, after = np.zeros(layout.COEFFICIENTS * LANES), x.copy()
    predict._predict_state(after, theta, dv, _settings(), DECAY, f)
    return theta, dv, f, after


def _dense_F(x, after, theta, f, r):
    """F of the 18 states of run r at mid-interval, from the dense error model."""
    C = _matrix(after[4:8, r]) @ attitude.exp_so3(-0.5 * (theta[:, r] - x[11:14, r]))
    position = (0.5 * (x[0, r] + after[0, r]), 0.0, 0.0)
    v = np.r_[0.5 * (x[2:4, r] + after[2:4, r]), 0.0]
    return inertial.error_dynamics(position, v, C, layout._three(f, layout.FORCE, r), 7200.0)


def _dense_transition(x, after, theta, f, r):
    """I + F dt + F² dt²/2 of the 16 states of run r."""
    F = _dense_F(x, after, theta, f, r)[np.ix_(ins.KEPT, ins.KEPT)]
    F[layout.CURRENT :] = 0.0
    Phi = np.eye(16) + F + 0.5 * F @ F
    Phi[range(13, 16), range(13, 16)] = DECAY
    return Phi


def _column(f, column):
    """A column of the transition, its seven navigation rows."""
    y, out = np.zeros((16, LANES)), np.zeros((7, 16, LANES))
    y[column] = 1.0
    predict._transition(f, 1.0, y.reshape(-1), out.reshape(-1))
    assert not out[:, 1:].any()
    return out[:, 0]


def test_every_coefficient_is_its_entry_of_F():
    # Relative to its own size: some are too small to be seen in a transition.
    x = _nominal(3)
    theta, _, f, after = _predicted(x)
    places = {
        name: [getattr(layout, name) for name in names]
        for name, names in {
            "phi, L": ("PHI_N_L", "PHI_E_L", "PHI_D_L"),
            "phi, v": ("PHI_E_VN", "PHI_N_VE", "PHI_D_VE"),
            "v, L": ("VN_L", "VE_L"),
            "v, v": ("VN_VE", "VE_VN", "VE_VE"),
            "p, p": ("LATITUDE_L", "LONGITUDE_L"),
            "p, v": ("LATITUDE_VN", "LONGITUDE_VE"),
            "C": ("C_N", "C_E", "C_D"),
        }.items()
    }
    for r in range(LANES):
        F = _dense_F(x, after, theta, f, r)
        expected = {
            "phi, L": F[6:9, 0],
            "phi, v": (F[7, 3], F[6, 4], F[8, 4]),
            "v, L": F[3:5, 0],
            "v, v": (F[3, 4], F[4, 3], F[4, 4]),
            "p, p": F[0:2, 0],
            "p, v": (F[0, 3], F[1, 4]),
        }
        for name, values in expected.items():
            got = [f[place + r] for place in places[name]]
            assert got == pytest.approx(values, rel=1e-7), name
        assert [layout._three(f, row, r) for row in places["C"]] == [
            pytest.approx(row, rel=1e-4, abs=1e-5) for row in F[6:9, 12:15]
        ]
        # F_phi,phi = −[omega×]
        assert layout._three(f, layout.OMEGA, r) == pytest.approx((F[7, 8], F[8, 6], F[6, 7]))


def test_the_reference_has_the_transition_of_the_kernels():
    # Both go attitude, velocity, position; the rest is rounding.
    x = _nominal(3)
    theta, _, f, after = _predicted(x)
    unit = np.r_[[1e-6] * 2, [0.3] * 2, [1e-4] * 3, [5e-4] * 3, [1e-7] * 3, [0.5] * 3]
    for r in range(LANES):
        F = _dense_F(x, after, theta, f, r)
        Phi = reference.transition(F, DECAY)[np.ix_(ins.KEPT, ins.KEPT)]
        for column in range(16):
            gap = (_column(f, column)[:, r] - Phi[:7, column]) * unit[column] / unit[:7]
            # The kernels take the half rotation to mid-interval to second order: 0.02³ / 3 of
            # an accelerometer bias of 5e-4 m/s², in units of 0.3 m/s.
            assert np.abs(gap).max() < 5e-9, column


def test_covariance_prediction_equals_dense_algebra():
    x = _nominal()
    theta, _, f, after = _predicted(x)
    P, full = _covariance()
    work = np.zeros(layout.WORKSPACE)
    predict._predict_covariance(P.reshape(-1), f, _settings(), DECAY, 1e-5, work)
    Q = np.diag([0.0] * 2 + [1e-9] * 2 + [1e-14] * 3 + [0.0] * 6 + [1e-5] * 3)
    got = P[layout.AT]
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
    sizes = np.r_[[1e-6] * 2, [0.1] * 2, [1e-4] * 3, [1e-3] * 3, [1e-5] * 3, [0.1] * 3]
    for column, size in enumerate(sizes):
        ends = []
        for sign in (1, -1):
            e = np.zeros((16, LANES))
            e[column] = sign * size
            moved = ins.shift(x, e)
            predict._predict_state(moved, theta, dv, _settings(), DECAY, np.zeros_like(f))
            states._difference(moved, after, e)
            ends.append(e)
        numeric = (ends[0] - ends[1]) / (2 * size)
        out = _column(f, column)
        scale = np.array([1e-6, 1e-6, 0.1, 0.1, 1e-4, 1e-4, 1e-4])[:, None] / size
        assert (np.abs(out[:7] - numeric[:7]) / scale).max() < 2e-4, column


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_H_matches_differences_at_a_large_current(axis):
    x, (P, full), z = _nominal(), _covariance(), np.zeros((3, LANES))
    z[axis] = np.arange(LANES)

    def look(x):
        parts = update._parts(np.zeros(update.SEEN))
        update._look(x, P.reshape(-1), z, axis, _settings(), 0.0, *parts)
        return parts

    h, u, rho, S = look(x)
    H, u = np.zeros((16, LANES)), u.reshape(16, LANES)
    H[[2, 3, 4, 5, 6, 13, 14, 15]] = h.reshape(8, LANES)
    for r in range(LANES):
        relative = np.r_[x[2:4, r], 0.0] - x[14:17, r]
        assert rho[r] == pytest.approx((_matrix(x[4:8, r]).T @ relative)[axis] - r)
        assert u[:, r] == pytest.approx(full[r] @ H[:, r])
        assert S[r] == pytest.approx(H[:, r] @ full[r] @ H[:, r] + 0.01)
    for column in range(16):
        e = np.zeros((16, LANES))
        e[column] = 1e-4
        above, below = (look(ins.shift(x, e, sign))[2] for sign in (1, -1))
        assert (above - below) / 2e-4 == pytest.approx(H[column], abs=2e-7)


def test_shift_and_difference_are_inverse_and_follow_the_paper():
    x, random = _nominal(), np.random.default_rng(2)
    e = 1e-4 * random.standard_normal((16, LANES))
    kept, moved, back = x.copy(), ins.shift(x, e), np.zeros_like(e)
    assert np.array_equal(x, kept)
    states._difference(moved, x, back)
    assert back == pytest.approx(e, abs=1e-11)
    C, C_hat = _matrix(x[4:8, 0]), _matrix(moved[4:8, 0])
    assert C_hat == pytest.approx((np.eye(3) - attitude.skew(e[4:7, 0])) @ C, abs=1e-7)
    assert attitude.attitude_error(C_hat, C) == pytest.approx(e[4:7, 0], rel=1e-6)
    assert ins.shift(moved, e, -1.0) == pytest.approx(x, abs=1e-11)


def test_a_quaternion_and_its_negative_are_one_attitude():
    x, back = _nominal(), np.zeros((16, LANES))
    e = np.full((16, LANES), 1e-4)
    moved = ins.shift(x, e)
    moved[layout.QUATERNION : layout.QUATERNION + 4] *= -1
    states._difference(moved, x, back)
    assert back == pytest.approx(e, abs=1e-11)


@pytest.mark.parametrize("gain", [1.0, 0.4])
def test_correction_is_joseph_form_for_any_gain(gain):
    P, full = _covariance()
    random = np.random.default_rng(0)
    H = random.standard_normal((LANES, 16)) / np.sqrt(np.einsum("rii->ri", full))
    u = np.einsum("rij,rj->ir", full, H)
    S = np.einsum("ri,ir->r", H, u) + 0.5
    update._correct(P.reshape(-1), np.ascontiguousarray(u).reshape(-1), S, np.full(LANES, gain))
    for r in range(LANES):
        K = gain * u[:, r] / S[r]
        A = np.eye(16) - np.outer(K, H[r])
        expected = A @ full[r] @ A.T + 0.5 * np.outer(K, K)
        scale = np.sqrt(np.outer(np.diag(full[r]), np.diag(full[r])))
        assert P[layout.AT][:, :, r] / scale == pytest.approx(expected / scale, abs=1e-12)
        if gain == 1.0:
            one = KalmanFilter(dim_x=16, dim_z=1)
            one.P, one.R = full[r].copy(), np.array([[0.5]])
            one.update(np.zeros((1, 1)), H=H[r][None])
            assert P[layout.AT][:, :, r] / scale == pytest.approx(one.P / scale, abs=1e-10)
            # P after is below P before.
            drop = (full[r] - P[layout.AT][:, :, r]) / scale
            assert np.linalg.eigvalsh(drop).min() > -1e-12


def test_fading_forms_inflate_what_they_say():
    beta, q = np.full(LANES, 3.0), 1e-3
    for name, form in fading.FORMS.items():
        P, _ = _covariance()
        before = P.copy()
        update._inflate(P.reshape(-1), form, beta, q)
        change = (P - before)[layout.AT]
        expected = np.zeros_like(change)
        if name.startswith("literal"):
            expected = 2 * before[layout.AT]
        elif name == "block":
            expected[13:, 13:] = 2 * before[layout.AT][13:, 13:]
        elif name in ("variance", "sigma"):
            expected[range(13, 16), range(13, 16)] = q * (2 if name == "variance" else 8)
        assert change == pytest.approx(expected, rel=1e-9, abs=1e-18), name


def test_nees_is_the_quadratic_form():
    P, full = _covariance()
    e = np.linalg.cholesky(full) @ np.random.default_rng(3).standard_normal((LANES, 16, 1))
    e = np.ascontiguousarray(e[..., 0].T)
    for r in range(LANES):
        expected = e[:, r] @ np.linalg.solve(full[r], e[:, r])
        got = score._squared_error(P, e, r, np.zeros((16, 17)))
        assert got == pytest.approx(expected, rel=1e-6)


def test_unpack_restores_all_eighteen_states():
    P, full = _covariance()
    wide = ins.unpack(P)
    assert wide.shape == (18, 18, LANES)
    assert not wide[inertial.SLAVED, :].any()
    assert wide[np.ix_(ins.KEPT, ins.KEPT)][:, :, 2] == pytest.approx(full[2])
    diagonal = ins.pack_diagonal(np.arange(16.0))
    assert diagonal[layout.AT][:, :, 0] == pytest.approx(np.diag(np.arange(16.0)))


def test_current_decays_by_its_own_law():
    a, variance = currents.decay(1.0, 7200.0)
    assert a == pytest.approx(math.exp(-1 / 7200))
    assert variance == pytest.approx(1 - a * a, rel=1e-9)
    x = _nominal()
    _, _, _, after = _predicted(x)
    assert after[14:17] == pytest.approx(a * x[14:17])
