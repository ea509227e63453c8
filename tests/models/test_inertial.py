"""Earth, strapdown and error model against closed forms, differences and python-ins."""

import math
import warnings

import numpy as np
import pandas as pd
import pyins.earth
import pyins.strapdown
import pytest

from seanav.checks import ParameterError
from seanav.models import attitude, currents, earth, inertial, trajectories

T_C = 7200.0


def test_radii_and_gravity_match_python_ins():
    for latitude in np.radians([-70.0, 0.0, 36.0, 60.0]):
        R_n, R_t = earth.radii(latitude)
        theirs = pyins.earth.principal_radii(math.degrees(latitude), 0.0)
        assert (R_n, R_t) == pytest.approx(theirs[:2], rel=1e-9)
        g = pyins.earth.gravity(math.degrees(latitude), 100.0)
        assert earth.gravity(latitude, 100.0) == pytest.approx(float(g), rel=1e-9)


def test_radii_and_gravity_take_arrays():
    latitudes = np.radians([[-70.0, 0.0, 36.0], [60.0, 89.0, -90.0]])
    each = np.array([[earth.radii(L) for L in row] for row in latitudes])
    assert np.array_equal(earth.radii(latitudes), np.moveaxis(each, -1, 0))
    assert earth.gravity(latitudes, 100.0)[1, 0] == earth.gravity(latitudes[1, 0], 100.0)
    with pytest.raises(ParameterError, match=r"latitude = 36.0: must be at most 1.57"):
        earth.radii([0.3, 36.0])


def test_slopes_of_radii_match_differences():
    step = 1e-4
    for latitude in (0.3, 0.63, 1.1):
        above, below = earth.radii(latitude + step), earth.radii(latitude - step)
        numeric = [(a - b) / (2 * step) for a, b in zip(above, below, strict=True)]
        assert earth.radii_slopes(latitude) == pytest.approx(numeric, rel=1e-6)


def _rates(position, v_n, C_bn, w_b, f_b):
    """The navigation equations, written independently of the error model."""
    latitude, _, height = position
    R_n, R_t = earth.radii(latitude)
    w_ie, rho = earth.earth_rate(latitude), earth.transport_rate(latitude, height, v_n)
    dp = [v_n[0] / (R_n + height), v_n[1] / ((R_t + height) * math.cos(latitude)), -v_n[2]]
    g = np.array([0.0, 0.0, earth.gravity(latitude, height)])
    dv = C_bn @ f_b + g - np.cross(2 * w_ie + rho, v_n)
    return np.array(dp), dv, C_bn @ attitude.skew(w_b) - attitude.skew(w_ie + rho) @ C_bn


def test_F_matches_central_differences_of_the_navigation_equations():
    position, v_n = np.array([0.63, 2.2, 50.0]), np.array([7.0, -8.0, 1.5])
    C_bn = attitude.C_bn_from_rpy(np.array([0.1, -0.2, 2.5]))
    f_b, w_b = np.array([0.5, -0.3, -9.7]), np.array([0.01, -0.02, 0.03])
    dp0, dv0, dC0 = _rates(position, v_n, C_bn, w_b, f_b)

    def derivative(e):
        """The rate of the error state at error e."""
        C = (np.eye(3) - attitude.skew(e[6:9])) @ C_bn
        rates = _rates(position + e[:3], v_n + e[3:6], C, w_b - e[12:15], f_b - e[9:12])
        # phi' from C(q̂) = (I − [phi×]) C: −[phi'×] C = C(q̂)' − (I − [phi×]) C'
        S = -(rates[2] - (np.eye(3) - attitude.skew(e[6:9])) @ dC0) @ C_bn.T
        dphi = 0.5 * np.array([S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]])
        return np.r_[rates[0] - dp0, rates[1] - dv0, dphi, np.zeros(6), -e[15:] / T_C]

    F = inertial.error_dynamics(position, v_n, C_bn, C_bn @ f_b, T_C, slaved=False)
    steps = np.r_[1e-5, 1e-5, 10.0, [1e-2] * 3, [1e-5] * 3, [1e-3] * 3, [1e-5] * 3, [1e-2] * 3]
    for j, step in enumerate(steps):
        e = np.zeros(18)
        e[j] = step
        numeric = (derivative(e) - derivative(-e)) / (2 * step)
        scale = np.abs(F).max(axis=1)
        assert np.all(np.abs(F[:, j] - numeric) <= 2e-6 * scale + 1e-9 * np.abs(numeric)), j
        # The same, relative to the largest entry of the column: small rows count too.
        # The entries of the height column are as small as 1e-13.
        assert F[:, j] == pytest.approx(numeric, rel=1e-4, abs=1e-17 if j == 2 else 1e-12), j


def test_eigenvalues_at_rest_are_schuler_foucault_and_earth_periods():
    latitude = math.radians(36.0)
    g = earth.gravity(latitude, 0.0)
    F = inertial.error_dynamics(
        (latitude, 0.0, 0.0), np.zeros(3), np.eye(3), np.array([0.0, 0.0, -g]), T_C
    )
    keep = [0, 3, 4, 6, 7, 8]
    w = np.sort(np.abs(np.linalg.eigvals(F[np.ix_(keep, keep)]).imag))[::2]
    periods = 2 * math.pi / w / 60
    assert periods[0] / 60 == pytest.approx(23.934, rel=2e-3)
    # Schuler period split by the vertical earth rate.
    R_n, R_t = earth.radii(latitude)
    schuler = math.sqrt(g / math.sqrt(R_n * R_t))
    foucault = earth.RATE * math.sin(latitude)
    expected = 2 * math.pi / np.array([schuler - foucault, schuler + foucault]) / 60
    assert periods[1:] == pytest.approx(expected, rel=2e-3)
    assert periods[1:] == pytest.approx([87.4, 81.6], abs=0.1)


def test_free_vertical_channel_is_unstable():
    g = earth.gravity(0.63, 0.0)
    F = inertial.error_dynamics(
        (0.63, 0.0, 0.0), np.zeros(3), np.eye(3), np.array([0, 0, -g]), T_C, slaved=False
    )
    growth = math.exp(np.linalg.eigvals(F).real.max() * 7200.0) / 2
    assert 1e5 < growth < 1e6


def test_mechanisation_of_errorless_increments_stays_on_the_trajectory():
    path = trajectories.Trajectory(duration=1800.0)
    track, latitude, longitude, v_n, _ = _fly(path, inertial.SensorErrors(0, 0, 0, 0), np.zeros(6))
    R_n, R_t = earth.radii(latitude[0])
    assert np.abs(track[:, 0] - latitude).max() * R_n < 0.5
    assert np.abs(track[:, 1] - longitude).max() * R_t < 0.5
    assert np.abs(track[:, 2:4] - v_n[:, :2]).max() < 2e-3


def _fly(path, errors, bias, rate=100):
    latitude, longitude, v_n, heading = path.states()
    theta, dv = inertial.sensor_increments(path, errors, np.random.default_rng(3), bias, rate=rate)
    q = np.array([math.cos(heading[0] / 2), 0.0, 0.0, math.sin(heading[0] / 2)])
    start = np.array([latitude[0], longitude[0], 0.0])
    track = inertial.mechanise(start, v_n[0], q, theta, dv, 1.0)
    return track, latitude, longitude, v_n, heading


@pytest.fixture(scope="module")
def two_hours():
    """Two noisy hours at 100 Hz, integrated by python-ins and by this package."""
    path, errors = trajectories.Trajectory(), inertial.SensorErrors()
    bias = np.array([8e-4, -9e-4, 3e-4, 2e-7, -2e-7, 1e-7])
    rotation, velocity = path.increments()
    noise = np.random.default_rng(3).standard_normal((len(rotation), 6))
    rotation = rotation + bias[3:] / 100 + errors.gyro_noise / 10 * noise[:, 3:]
    velocity = velocity + bias[:3] / 100 + errors.accelerometer_noise / 10 * noise[:, :3]
    latitude, longitude, v_n, heading = path.states()
    names = ["lat", "lon", "alt", "VN", "VE", "VD", "roll", "pitch", "heading"]
    start = [math.degrees(latitude[0]), math.degrees(longitude[0]), 0.0, *v_n[0], 0.0, 0.0]
    pva = pd.Series([*start, math.degrees(heading[0])], index=names, name=0.0)
    columns = ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    before = np.hstack([rotation[:1], velocity[:1]])
    readings = np.vstack([before, np.hstack([rotation, velocity])])
    imu = pd.DataFrame(readings, columns=columns, index=np.arange(len(readings)) / 100)
    increments = pyins.strapdown.compute_increments_from_imu(imu, "increment")
    with warnings.catch_warnings():
        # Their use of an argument that pandas 3 deprecates.
        warnings.filterwarnings("ignore", "The copy keyword is deprecated")
        theirs = pyins.strapdown.Integrator(pva, with_altitude=False).integrate(increments)
    theta, dv = inertial.preintegrate(rotation, velocity, 1)
    q = np.array([math.cos(heading[0] / 2), 0.0, 0.0, math.sin(heading[0] / 2)])
    position = np.array([latitude[0], longitude[0], 0.0])
    track = inertial.mechanise(position, v_n[0], q, theta, dv, 0.01)
    assert track.shape == (len(theta) + 1, 8)
    slow_theta, slow_dv = inertial.preintegrate(rotation, velocity, 100)
    slow = inertial.mechanise(position, v_n[0], q, slow_theta, slow_dv, 1.0)
    return theirs, track, slow, path


def test_strapdown_agrees_with_python_ins_over_two_hours(two_hours):
    theirs, track, _, path = two_hours
    scale = np.array([*earth.radii(path.latitude)])
    drift = (track[::100, 0] - path.states()[0]) * scale[0]
    assert np.abs(drift).max() > 1000  # otherwise nothing is tested
    positions = np.radians(theirs[["lat", "lon"]].to_numpy())
    assert np.abs((track[:, :2] - positions) * scale).max() < 0.1
    assert np.abs(track[:, 2:4] - theirs[["VN", "VE"]].to_numpy()).max() < 1e-4
    yaw = 2 * np.arctan2(track[:, 7], track[:, 4])
    difference = np.degrees(yaw) - theirs["heading"].to_numpy()
    assert np.abs((difference + 180) % 360 - 180).max() < 1e-5


def test_one_second_increments_serve_as_well_as_hundredths(two_hours):
    _, track, slow, path = two_hours
    fast = track[::100]
    R_n, R_t = earth.radii(path.latitude)
    drift = np.hypot((fast[:, 0] - path.states()[0]) * R_n, (fast[:, 1] - path.states()[1]) * R_t)
    apart = np.hypot((fast[:, 0] - slow[:, 0]) * R_n, (fast[:, 1] - slow[:, 1]) * R_t)
    assert math.sqrt(np.mean(apart**2)) < 3e-3 * math.sqrt(np.mean(drift**2))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_preintegration_under_coning_matches_fine_integration(axis):
    # Body rate that turns in its own plane while the specific force turns too.
    # One second before it, so that the first correction has a neighbour.
    t = (np.arange(-20000, 20000) + 0.5) / 20000
    w = np.stack([np.cos(6 * t), np.sin(6 * t), 0.3 + 0 * t], axis=1) * 0.4 / 20000
    f = np.stack([np.sin(5 * t), 2 + 0 * t, -9.8 + np.cos(4 * t)], axis=1) / 20000
    # Only about the third axis does coning rectify: each takes its turn.
    w, f = np.roll(w, axis, axis=1), np.roll(f, axis, axis=1)
    C, total = np.eye(3), np.zeros(3)
    for k in range(20000, 40000):
        total = total + C @ attitude.exp_so3(0.5 * w[k]) @ f[k]
        C = C @ attitude.exp_so3(w[k])
    fast = [part.reshape(200, 200, 3).sum(axis=1) for part in (w, f)]
    theta, dv = inertial.preintegrate(*fast, 100)
    assert dv[1] == pytest.approx(total, abs=2e-6)
    assert attitude.exp_so3(theta[1]) == pytest.approx(C, abs=2e-6)


def test_trajectory_truth_is_consistent():
    path = trajectories.Trajectory()
    latitude, longitude, v_n, heading = path.states()
    R_n, R_t = earth.radii(latitude[0])
    assert np.hypot(v_n[:, 0], v_n[:, 1]) == pytest.approx(path.speed, rel=1e-12)
    # First leg east, then north: counter-clockwise.
    assert heading[100] == pytest.approx(math.pi / 2)
    assert heading[2700] == pytest.approx(0.0, abs=1e-9)
    north = (latitude - latitude[0]) * R_n
    assert north.max() == pytest.approx(path._leg, rel=3e-3)
    assert abs(north[-1]) < 1.0
    assert abs(longitude[-1] - longitude[0]) * R_t < 100.0
    rotation, _ = path.increments()
    # Over one lap the body turns by −360 degrees besides the earth and transport rates.
    down = rotation[:, 2].sum()
    rates = [
        -earth.RATE * math.sin(L) + earth.transport_rate(L, 0.0, v)[2]
        for L, v in zip(latitude[:-1], v_n[:-1], strict=True)
    ]
    assert down - sum(rates) == pytest.approx(-2 * math.pi, abs=1e-5)


def test_the_force_felt_is_that_of_the_motion_around_the_turning_earth():
    """From positions alone: fixed to the earth, differentiated twice, less gravity."""
    a, e2 = 6378137.0, 6.69437999014e-3
    dt, speed, turn = 0.5, 30.0, 2e-3
    latitude, longitude = np.full(5, 0.6), np.full(5, 0.3)
    for step, k in ((dt / 50, 2), (-dt / 50, 2)):  # by small steps to both sides of the middle
        L, lo, h = 0.6, 0.3, 0.7
        for n in range(1, 101):
            half = h + 0.5 * turn * step
            R_n, R_t = earth.radii(L)
            L += step * speed * math.cos(half) / R_n
            lo += step * speed * math.sin(half) / (R_t * math.cos(L))
            h += turn * step
            if n % 50 == 0:
                at = k + (1 if step > 0 else -1) * n // 50
                latitude[at], longitude[at] = L, lo
    w = a / np.sqrt(1 - e2 * np.sin(latitude) ** 2)
    r = np.stack([
        w * np.cos(latitude) * np.cos(longitude),
        w * np.cos(latitude) * np.sin(longitude),
        w * (1 - e2) * np.sin(latitude),
    ])  # fmt: skip
    velocity = (-r[:, 4] + 8 * r[:, 3] - 8 * r[:, 1] + r[:, 0]) / (12 * dt)
    second = (-r[:, 4] + 16 * r[:, 3] - 30 * r[:, 2] + 16 * r[:, 1] - r[:, 0]) / (12 * dt**2)
    force = second + 2 * np.cross([0, 0, earth.RATE], velocity)
    s, c, sl, cl = np.sin(0.6), np.cos(0.6), np.sin(0.3), np.cos(0.3)
    C_ne = np.array([[-s * cl, -s * sl, c], [-sl, cl, 0], [-c * cl, -c * sl, -s]])
    f_n = C_ne @ force - [0, 0, earth.gravity(0.6, 0.0)]
    ch, sh = np.cos(0.7), np.sin(0.7)
    expected = [ch * f_n[0] + sh * f_n[1], -sh * f_n[0] + ch * f_n[1], f_n[2]]
    one = [np.array([x]) for x in (0.6, 0.7, turn)]
    _, f_b = trajectories._felt(*one, speed)
    assert f_b[0] == pytest.approx(expected, abs=2e-6)


@pytest.mark.parametrize("shape", trajectories.SHAPES)
def test_every_shape_keeps_its_speed_and_duration(shape):
    path = trajectories.Trajectory(shape=shape, duration=1200.0, laps=2, sides=5)
    latitude, longitude, v_n, _ = path.states()
    R_n, R_t = earth.radii(latitude[0])
    step = np.hypot(np.diff(latitude) * R_n, np.diff(longitude) * R_t * np.cos(latitude[1:]))
    assert step == pytest.approx(path.speed, rel=5e-3)
    assert v_n.shape == (1201, 3)


def test_impossible_corner_is_one_clear_line():
    with pytest.raises(ParameterError, match=r"corner_radius = 9\d+\.0: must be at most \d+ m"):
        trajectories.Trajectory(corner_radius=99000.0)
    with pytest.raises(ParameterError, match="trajectory = 'zigzag': must be one of 'square'"):
        trajectories.Trajectory(shape="zigzag")


def test_gauss_markov_has_its_variance_and_its_correlation_time():
    noise = np.random.default_rng(1).standard_normal((3000, 4000))
    start = 0.7 * np.random.default_rng(2).standard_normal(4000)
    path = currents.gauss_markov(noise, start, 1.0, 1000.0, 0.7)
    assert np.var(path[::1000]) == pytest.approx(0.49, rel=0.05)
    lag = np.mean(path[1500] * path[2500]) / np.mean(path[1500] ** 2)
    assert lag == pytest.approx(math.exp(-1), abs=4 / math.sqrt(4000))
    assert currents.gauss_markov(noise[:10], np.zeros(4000), 1.0, 1000.0, 0.7)[1] == pytest.approx(
        0.7 * math.sqrt(1 - math.exp(-0.002)) * noise[0], rel=1e-9
    )


def test_measurement_principles():
    speed, frequency = 10.29, 300e3
    shift = currents.doppler_shift(speed, frequency)
    approximate = currents.doppler_speed(shift, frequency)
    # (2) solved for v: Δf / f = 2 v / (v_u − v), so (3) is too large by 1 / (1 − v / v_u).
    assert approximate == pytest.approx(speed / (1 - speed / 1500.0), rel=1e-12)
    assert currents.electromotive_force(2.0, 0.5, 0.1, 0.2) == pytest.approx(0.03)
    C = attitude.C_bn_from_rpy(np.array([0.0, 0.0, math.pi / 2]))
    assert currents.log_velocity(C, [0.0, 5.0, 0.0], [0.0, 1.0, 0.0])[0] == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (
            lambda fast: inertial.preintegrate(fast, fast[:5], 2),
            "velocity = (5, 3): must have the shape (6, 3) (fast intervals, 3)",
        ),
        (lambda fast: inertial.preintegrate(fast, fast, 4), "per_step = 4: must divide 6 fast"),
        (lambda fast: inertial.preintegrate(fast, fast, -1), "per_step = -1: must be an integer"),
        (lambda fast: earth.radii(36.0), "latitude = 36.0: must be a finite number at least -1.5"),
        (lambda fast: attitude.skew(fast), "a = (6, 3): must have the shape (3,)"),
        (lambda fast: inertial.SensorErrors(gyro_noise=-1.0), "gyro_noise = -1.0: must be"),
        (
            lambda fast: inertial.mechanise(fast[0], fast[0], np.zeros(4), fast, fast, 1.0),
            "q = [0.0, 0.0, 0.0, 0.0]: must have the length 1",
        ),
        (
            lambda fast: currents.gauss_markov(fast, fast[0], 1.0, 10.0, np.ones(5)),
            "sigma = (5,): must have the shape (6,) (steps,)",
        ),
    ],
)
def test_what_does_not_fit_is_one_clear_line(call, line):
    with pytest.raises(ParameterError) as caught:
        call(np.zeros((6, 3)))
    assert line in str(caught.value)
