"""Paper 3 on own logs: identification, the healthy test, and every refusal in one line."""

import attrs
import numpy as np
import pytest
from scipy.stats import binom

from seanav.checks import ParameterError
from seanav.models.nomoto import Ship, zigzag
from seanav.studies.adaptive_fading import figures, own_log
from seanav.studies.adaptive_fading.scenario import PLANES, Scenario

A, B, C, Q, R = 0.85, 0.03, 1e-4, 1e-6, 4e-7  # of a ship that is linear


def linear(seed, samples=2000, grown=1.0, noise=R):
    """Return the log of a ship that Nomoto's model describes exactly."""
    rng = np.random.default_rng(seed)
    rudder = 0.2 * np.sign(np.sin(2 * np.pi * np.arange(samples) / 60.0))
    r = np.zeros(samples)
    push = np.sqrt(Q * grown) * rng.standard_normal(samples)
    for k in range(samples - 1):
        r[k + 1] = A * r[k] + B * rudder[k] + C + push[k]
    z = r + np.sqrt(noise) * rng.standard_normal(samples)
    return own_log.Log("linear", 0.5, rudder, z[:, None])


def exactly(grown=1.0):
    one = np.ones((1, 1))
    return own_log.Model(("r",), A * one, B * one[0], C * one[0], Q * one, R * one, {})


# ---------------------------------------------------------------- identification


def test_the_intervals_of_the_identified_numbers_hold_the_truth():
    # Without noise of the gyro, which least squares takes for a smaller a.
    truth = {"a": A, "K (1/s)": B / (1 - A), "T (s)": -0.5 / np.log(A), "c (rad/s)": C}
    held = dict.fromkeys(truth, 0)
    for seed in range(400):
        found = own_log.identify(linear(seed, 400, noise=1e-14), 400).found
        for name, value in truth.items():
            held[name] += found[name].low <= value <= found[name].high
    low, high = binom.ppf([0.0005, 0.9995], 400, 0.95)
    assert all(low <= count <= high for count in held.values()), held


def test_the_two_noises_are_told_apart():
    by = own_log.identify(linear(1, 200_000), 200_000)
    assert by.R[0, 0] == pytest.approx(R, rel=0.1)
    assert by.Q[0, 0] == pytest.approx(Q, rel=0.1)
    alone = own_log.identify(linear(2, 100_000, noise=1e-14), 100_000)
    assert alone.R[0, 0] < 0.02 * alone.Q[0, 0]


def test_the_fit_is_that_of_numpy():
    own = linear(3, 300)
    found = own_log.identify(own, 300).found
    X = np.stack([own.z[:-1, 0], own.rudder[:-1], np.ones(299)], axis=1)
    expected = np.linalg.solve(X.T @ X, X.T @ own.z[1:, 0])
    assert found["a"].value == pytest.approx(expected[0])
    assert found["K (1/s)"].value == pytest.approx(expected[1] / (1 - expected[0]))
    # The delta method against a small change of the coefficients.
    residual = own.z[1:, 0] - X @ expected
    cov = residual @ residual / 296 * np.linalg.inv(X.T @ X)
    grad = []
    for k in range(3):
        moved = expected.copy()
        moved[k] += 1e-7
        grad.append((moved[1] / (1 - moved[0]) - expected[1] / (1 - expected[0])) / 1e-7)
    assert found["K (1/s)"].se == pytest.approx(np.sqrt(grad @ cov @ grad), rel=1e-4)


# ---------------------------------------------------------------- the test


def test_the_alarm_rate_of_a_right_model_is_nominal():
    scenario = Scenario(log_share=0.1)
    rates = []
    for seed in range(40):
        own = linear(100 + seed)
        track = own_log.filtered(scenario, own, exactly())
        rates.append(own_log.alarms(scenario, track.nis[0], 1).value)
    assert np.mean(rates) == pytest.approx(0.05, abs=3 * np.std(rates) / np.sqrt(40))
    assert np.std(rates) / np.sqrt(40) < 0.002


def test_the_interval_of_the_alarm_rate_covers():
    scenario, held = Scenario(log_share=0.1), 0
    for seed in range(200):
        track = own_log.filtered(scenario, linear(1000 + seed, 1200), exactly())
        rate = own_log.alarms(scenario, track.nis[0], 1)
        held += rate.low <= 0.05 <= rate.high
    assert binom.ppf(0.0005, 200, 0.95) <= held


def test_the_honest_factor_is_the_one_that_was_hidden():
    scenario = Scenario(log_share=0.1)
    own = linear(7, 20_000, grown=10.0)
    assert own_log.honest(scenario, own, exactly(), "Q") == pytest.approx(10.0, rel=0.15)
    factor = own_log.honest(scenario, own, exactly(), "R")
    track = own_log.filtered(scenario, own, exactly(), R=factor)
    assert own_log.alarms(scenario, track.nis[0], 1).value == pytest.approx(0.05, abs=2e-3)
    assert own_log.filtered(scenario, own, exactly(), Q=10.0).nis.mean() == pytest.approx(
        1, abs=0.05
    )


def test_no_factor_of_R_helps_where_nothing_alarms():
    own = linear(8, 2000)
    still = own_log.Log("still", 0.5, own.rudder, np.zeros_like(own.z))
    quiet = attrs.evolve(Scenario(), log_share=0.1)
    by = own_log.Model(
        ("r",),
        *(np.zeros((1, 1)), np.zeros(1), np.zeros(1)),
        1e-6 * np.eye(1),
        1e-6 * np.eye(1),
        {},
    )
    assert own_log.honest(quiet, still, by, "Q") is None


def test_on_the_built_in_log_a_healthy_ship_alarms_far_too_often():
    scenario = Scenario()
    own = own_log.log(scenario)
    by = own_log.model(scenario, own)
    rows = {row[0].split(" x ")[0]: row[1:] for row in own_log.rows(scenario, own, by)}
    assert rows["OKF"][1] > 4 * scenario.alpha
    assert rows["OKF, Q"][0] == pytest.approx(scenario.alpha, abs=2e-3)
    assert rows["OKF, R"][-2] > 1 > rows["OKF, Q"][-1]
    assert rows["SFF(20)"] == rows["MFF(20)"]  # of one state there is one factor
    first = own_log.split(scenario, own)
    figures.own_log(own, first, own_log.filtered(scenario, own, by).nis[0], 3.84)


# ---------------------------------------------------------------- files


@pytest.fixture
def own(tmp_path):
    def written(header, rows, **changes):
        lines = [",".join(map(str, row)) for row in rows]
        path = tmp_path / "own.csv"
        path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
        scenario = attrs.evolve(Scenario(), log_file=str(path), **changes)
        try:
            return scenario, own_log.log(scenario)
        finally:
            assert list(tmp_path.iterdir()) == [path]  # nothing is written

    return written


def zigzags(samples=400, dt=0.5):
    rudder, rate = zigzag(Ship(0.2, 3.0), np.full(samples, 0.2), dt, np.zeros(samples))
    rate = rate + 1e-4 * np.random.default_rng(1).standard_normal(samples)
    times = np.round(dt * np.arange(samples), 9)
    return [
        *zip(times.tolist(), np.degrees(rudder).tolist(), np.degrees(rate).tolist(), strict=True)
    ]


NOMOTO = "time,rudder_deg,yaw_rate_deg_s"
REMUS = "time,rudder_deg,sway_m_s,yaw_rate_deg_s,heading_deg"


def test_a_good_log_gives_its_ship(own):
    scenario, log = own(NOMOTO, zigzags())
    assert (log.source, log.dt) == ("own.csv", 0.5)
    found = own_log.model(scenario, log).found
    assert found["K (1/s)"].value == pytest.approx(0.2, rel=0.05)
    assert found["T (s)"].value == pytest.approx(3.0, rel=0.05)
    starboard = [(t, -d, r) for t, d, r in zigzags()]  # the rudder counted the other way
    assert own_log.model(*own(NOMOTO, starboard)).found["K (1/s)"].value == pytest.approx(
        -0.2, rel=0.05
    )


def test_the_papers_vehicle_takes_a_log_of_three_states(own):
    plane = PLANES["steering"]
    Phi, effect = plane.discretise(0.1)
    x, rows = np.zeros(3), []
    rng = np.random.default_rng(2)
    for k in range(600):
        rudder = 0.1 * np.sin(k / 20)
        z = x + 1e-2 * rng.standard_normal(3)
        heading = np.degrees(z[2]) % 360.0  # it jumps at 360, as a compass does
        rows.append((round(0.1 * k, 3), np.degrees(rudder), z[0], np.degrees(z[1]), heading))
        x = Phi @ x + effect * rudder + np.sqrt(1e-5) * rng.standard_normal(3)
    scenario, log = own(REMUS, rows, log_model="remus")
    assert np.abs(np.diff(log.z[:, 2])).max() < 0.2
    by = own_log.model(scenario, log)
    assert by.found == {}
    track = own_log.filtered(scenario, log, by)
    assert own_log.alarms(scenario, track.nis[0], 3).value == pytest.approx(0.05, abs=0.04)
    assert len(own_log.rows(scenario, log, by)) == 7


def changed(k, column, value):
    rows = [list(row) for row in zigzags()]
    rows[k][column] = value
    return rows


BAD = {
    "no rudder": ("time,yaw_rate_deg_s", [(0, 1), (1, 2)], {}, "must have the columns"),
    "radians": (
        "time,rudder_rad,yaw_rate_deg_s",
        [(0, 1, 1), (1, 2, 1)],
        {},
        "multiply by 57.29578",
    ),
    "rate in radians": (
        "time,rudder_deg,yaw_rate_rad_s",
        [(0, 1, 1)],
        {},
        "must be yaw_rate_deg_s",
    ),
    "no time": ("rudder_deg,yaw_rate_deg_s", zigzags(), {}, "must have"),
    "rudder of 95": (NOMOTO, changed(7, 1, 95), {}, "row 9: rudder_deg = 95"),
    "rate of 90": (NOMOTO, changed(7, 2, 90), {}, "row 9: yaw_rate_deg_s = 90"),
    "empty": (NOMOTO, changed(7, 2, ""), {}, "row 9: yaw_rate_deg_s"),
    "not a number": (NOMOTO, changed(7, 2, "nan"), {}, "row 9: yaw_rate_deg_s"),
    "words": (NOMOTO, changed(3, 1, "port 5"), {}, "row 5: rudder_deg"),
    "gap": (NOMOTO, [*zigzags()[:300], *zigzags()[310:]], {}, "row 302: 5.5 s after row 301"),
    "uneven": (NOMOTO, changed(7, 0, 3.6), {}, "steps must be even"),
    "backward": (NOMOTO, changed(7, 0, 2.0), {}, "row 9: time"),
    "twice": (NOMOTO, changed(7, 0, 3.0), {}, "row 9: time"),
    "short": (NOMOTO, zigzags(240), {}, "must have at least 50 samples"),
    "no rest": (NOMOTO, zigzags(1000), {"log_share": 0.9}, "200 in the rest, has 900 and 100"),
    "rudder amidships": (NOMOTO, [(t, 0, r) for t, _, r in zigzags()], {}, "rudder_deg must move"),
    "gyro off": (NOMOTO, [(t, d, 0) for t, d, _ in zigzags()], {}, "yaw_rate_deg_s must move"),
    "noise alone": (
        NOMOTO,
        [(t, d, (-1) ** k) for k, (t, d, _) in enumerate(zigzags())],
        {},
        "not 0 to 1",
    ),
    "two states for three": (NOMOTO, zigzags(), {"log_model": "remus"}, "must have the columns"),
    "too slow for Euler": (
        REMUS,
        [(5 * k, k % 7, 0.1, 0.1, 1) for k in range(500)],
        {"log_model": "remus"},
        "for Euler's rule",
    ),
    "mixed times": (NOMOTO, changed(7, 0, "2020-01-01T00:00:00Z"), {}, "row 9: time"),
    "semicolons": ("time;rudder_deg;yaw_rate_deg_s", [("0;1;2",)], {}, "separated by commas"),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_log_is_one_line(kind, own):
    header, rows, changes, why = BAD[kind]
    with pytest.raises(ParameterError) as error:
        own(header, rows, **changes)
    assert why in str(error.value)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith("log_file = ")
