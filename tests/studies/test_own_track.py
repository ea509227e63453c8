"""Paper 2 on own tracks: speeds from fixes, coloured errors, and every refusal in one line."""

import attrs
import numpy as np
import pytest
from scipy.signal import lfilter

from seanav.checks import ParameterError
from seanav.models import earth
from seanav.studies.neural_estimator import figures, own_track, run
from seanav.studies.neural_estimator.scenario import STEP, Scenario

SMALL = Scenario(steps=80, max_epochs=20, hidden=8, reteach_epochs=5)
MOMENTS = STEP * np.arange(100)


@pytest.fixture
def own(tmp_path):
    """Return the track of a table with the given columns."""

    def written(header, rows, scenario=SMALL, reference=None, **changes):
        def file(name, header, rows):
            lines = [",".join(map(str, row)) for row in rows]
            (tmp_path / name).write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
            return str(tmp_path / name)

        changes["track_file"] = file("own.csv", header, rows)
        if reference is not None:
            changes["reference_file"] = file("better.csv", *reference)
        before = sorted(tmp_path.iterdir())
        try:
            return own_track.track(attrs.evolve(scenario, **changes))
        finally:
            assert sorted(tmp_path.iterdir()) == before  # nothing is written

    return written


def straight(speed=(4.0, -3.0), times=MOMENTS):
    return [(t, speed[0] * t, speed[1] * t) for t in times]


# ---------------------------------------------------------------- speeds from fixes


def test_a_straight_track_has_its_speed_everywhere(own):
    found = own("time,north_m,east_m", straight(times=2.0 * np.arange(150)))
    assert found.z.shape == (1, 80, 2)
    assert np.allclose(found.z, [4.0, -3.0], atol=1e-9)
    assert np.allclose(found.truth, [4.0, -3.0], atol=1e-9)
    assert found.source == "own.csv"


def test_degrees_are_metres_by_the_radii_of_the_earth(own):
    latitude, speed = np.radians(-22.0), (2.0, 5.0)
    R_n, R_t = earth.radii(latitude)
    rows = [
        (
            t,
            -22.0 + np.degrees(speed[0] * t / R_n),
            np.degrees(speed[1] * t / R_t / np.cos(latitude)),
        )
        for t in MOMENTS
    ]
    assert np.allclose(own("time,latitude_deg,longitude_deg", rows).z, speed, atol=1e-6)
    # The same across the meridian at which longitudes jump.
    over = [(t, a, (b + 179.999 + 180) % 360 - 180) for t, a, b in rows]
    assert np.allclose(own("time,latitude_deg,longitude_deg", over).z, speed, atol=1e-6)


def test_long_tracks_are_cut_into_windows_and_short_ones_are_one(own):
    rows = [(t, t * t / 1000, 0.0) for t in STEP * np.arange(200)]
    found = own("time,north_m,east_m", rows)
    assert found.z.shape == (2, 80, 2)
    mean = (MOMENTS[1:81] ** 2 - MOMENTS[:80] ** 2) / 1000 / STEP
    assert np.allclose(found.z[0, :, 0], mean)
    assert np.allclose(found.truth, found.z, atol=1e-9)  # parabolas are smooth already
    assert own(
        "time,north_m,east_m", straight(times=STEP * np.arange(81)), attrs.evolve(SMALL, steps=200)
    ).z.shape == (1, 80, 2)


def test_a_reference_is_taken_at_the_same_time(own):
    zone = ("2020-01-01T00:00:00Z", "2019-12-31T22:59:57-01:00")

    def dated(first, rows):
        start = np.datetime64(first[:19])
        return [(f"{start + np.timedelta64(int(t), 's')}{first[19:]}", a, b) for t, a, b in rows]

    rows = [(t, 0.01 * t**2, 0.0) for t in STEP * np.arange(90)]
    earlier = [(t, 0.01 * (t - 3) ** 2 + 7.0, 1.0) for t in STEP * np.arange(95)]
    head = "time,north_m,east_m"
    found = own(head, dated(zone[0], rows), reference=(head, dated(zone[1], earlier)))
    assert np.allclose(found.errors, 0, atol=1e-9)
    assert found.reference == "better.csv"


def test_the_built_in_track_has_the_noise_of_the_scenario_and_the_correlation_of_differences():
    found = own_track.simulated(Scenario(steps=2000, seed=3))
    assert np.sqrt((found.errors**2).mean()) == pytest.approx(0.3, rel=0.02)
    first, second = (own_track.correlation(found.errors, k) for k in (1, 2))
    assert first.low < -0.5 < first.high  # the exact one of white fixes, (D1)
    assert second.low < 0.0 < second.high
    assert first.se < 0.02


# ---------------------------------------------------------------- coloured errors


def test_yule_and_walker_find_an_autoregression_that_is_one():
    a = np.array([0.5, -0.6, 0.1, 0.05])
    rng = np.random.default_rng(1)
    e = lfilter([1.0], np.r_[1.0, -a], 0.2 * rng.standard_normal((40, 5200, 2)), axis=1)[:, 200:]
    found, variance = own_track.autoregression(own_track.covariances(e))
    assert np.allclose(found, a, atol=0.01)
    assert variance == pytest.approx(0.04, rel=0.02)


def test_the_coloured_filter_is_the_joint_gaussian():
    covariance, q, steps = np.array([0.09, -0.045, -0.01, 0.02, 0.0]), 0.02, 12
    z = np.random.default_rng(2).standard_normal((1, steps, 2))
    a, _ = own_track.autoregression(covariance)
    # Covariance of the errors over the whole track, by the recursion that they obey.
    lags = list(covariance[: len(a)])
    while len(lags) < steps:
        lags.append(float(a @ lags[: -len(a) - 1 : -1]))
    order = np.abs(np.subtract.outer(range(steps), range(steps)))
    assert lags[4] == pytest.approx(covariance[4], abs=1e-12)
    E = np.array(lags)[order] + 1e-6 * covariance[0] * np.eye(steps)
    walk = 100.0 + q * np.minimum.outer(range(1, steps + 1), range(1, steps + 1))
    found = own_track.coloured(z, q, covariance)
    for k in range(1, steps + 1):
        gain = np.linalg.solve(walk[:k, :k] + E[:k, :k], walk[:k, k - 1])
        assert np.allclose(found[0, k - 1], gain @ z[0, :k], atol=1e-7)


def test_with_white_errors_the_coloured_filter_is_the_plain_one():
    covariance = np.array([0.09, 0.0, 0.0, 0.0, 0.0])
    z = np.random.default_rng(4).standard_normal((3, 200, 2))
    mine = attrs.evolve(SMALL, noise=0.3, q=0.01, steps=200)
    plain = run.numerical(mine, z, 0.0)
    assert np.allclose(own_track.coloured(z, 0.01, covariance)[:, 60:], plain[:, 60:], atol=1e-5)


def test_on_the_built_in_track_the_coloured_filter_is_best_and_frozen_is_worst():
    scenario = Scenario(max_epochs=60)
    own = own_track.track(scenario)
    found, q = own_track.estimate(scenario, own)
    assert set(q) == {"KF", "GLS", "intermediate", "coloured KF"}
    rows = {row[0]: row[1:] for row in own_track.rows(scenario, own, found)}
    assert min(rows, key=lambda name: rows[name][0]) == "coloured KF"
    assert rows["coloured KF"][-1] < 1 < rows["frozen"][-2]
    assert rows["KF"][3:] == (1.0, 1.0, 1.0)
    direct = np.sqrt(((found["KF"][::16, 40:] - own.truth[:, 40:]) ** 2).mean())
    assert rows["KF"][0] == pytest.approx(direct)
    assert "frozen worse than the KF" in own_track.about(own, own_track.rows(scenario, own, found))
    figures.own_track(own, found)
    figures.own_errors([own_track.correlation(own.errors, k) for k in (1, 2)], [-0.5, 0.0])


@pytest.mark.parametrize("steps", [80, 81, 300])
def test_every_estimator_runs_on_a_track_of_any_length(steps, own):
    rng = np.random.default_rng(5)
    times = STEP * np.arange(steps + 1)
    rows = [
        (t, 5 * t + a, b)
        for t, (a, b) in zip(times, rng.standard_normal((steps + 1, 2)), strict=True)
    ]
    track = own("time,north_m,east_m", rows)
    found, _ = own_track.estimate(SMALL, track)
    assert all(np.isfinite(x).all() for x in found.values())
    assert all(np.isfinite(row[1:]).all() for row in own_track.rows(SMALL, track, found))


def test_a_ship_at_rest_without_errors_is_a_track_too(own):
    track = own("time,north_m,east_m", straight((0.0, 0.0)))
    found, _ = own_track.estimate(SMALL, track)
    assert all(np.isfinite(x).all() for x in found.values())


# ---------------------------------------------------------------- refusals

PLANE = "time,north_m,east_m"
BAD = {
    "knots": ("time,speed_kn", [(0, 1)], {}, "must have the columns"),
    "no time": ("north_m,east_m", [(0, 1), (1, 2)], {}, "must have the columns time"),
    "degrees and minutes": (
        "time,latitude_deg,longitude_deg",
        [(0, "22°30'S", 1), (1, 2, 3)],
        {},
        "decimal",
    ),
    "latitude of 95": ("time,latitude_deg,longitude_deg", [(0, 95, 1), (1, 2, 3)], {}, "row 2"),
    "backward": (PLANE, [*straight(times=[0, 3, 2])], {}, "row 4"),
    "twice": (PLANE, straight(times=[0, 3, 3]), {}, "row 4"),
    "gap": (PLANE, straight(times=[0, 3, 6, 60]), {}, "row 5: 54 s after row 4"),
    "short": (PLANE, straight(times=STEP * np.arange(50)), {}, "must last at least 240 s"),
    "long": (PLANE, straight((0, 0), 10.0 * np.arange(6100)), {}, "must last at most 60000 s"),
    "too fast": (PLANE, straight((12.0, 0.0)), {}, "row 3: 12 m/s from the fixes"),
    "outlier": (PLANE, [*straight()[:30], (90.0, 9e3, 0.0), *straight()[31:]], {}, "row 32"),
    "empty cell": (PLANE, [(0, 1, 2), (3, "", 3)], {}, "row 3: north_m"),
    "decimal comma": (PLANE, [(0, '"1,5"', 2), (3, 2, 3)], {}, "decimal point"),
    "kilometres": ("time,north_km,east_km", straight(), {}, "must have the columns"),
    "mixed times": (PLANE, [("2020-01-01T00:00:00Z", 1, 2), (3, 2, 3)], {}, "row 3: time"),
    "local dates": (PLANE, [("03/04/2020", 1, 2), ("04/04/2020", 2, 3)], {}, "ISO 8601"),
    "reference too short": (PLANE, straight(), {"reference": (PLANE, straight()[:70])}, "cover"),
    "reference with dates": (
        PLANE,
        straight(),
        {"reference": (PLANE, [("2020-01-01T00:00:00Z", 0, 0), ("2020-01-01T00:00:05Z", 0, 0)])},
        "both with a date",
    ),
    "reference later": (
        PLANE,
        [(f"2020-01-01T00:{t // 60:02.0f}:{t % 60:02.0f}Z", 0, 0) for t in MOMENTS],
        {
            "reference": (
                PLANE,
                [(f"2020-01-01T00:{t // 60:02.0f}:{t % 60:02.0f}Z", 0, 0) for t in MOMENTS[1:]],
            )
        },
        "cover the time of track_file",
    ),
    "reference too fast": (PLANE, straight(), {"reference": (PLANE, straight((11, 0)))}, "11 m/s"),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_track_is_one_line(kind, own):
    header, rows, more, why = BAD[kind]
    with pytest.raises(ParameterError) as error:
        own(header, rows, **more)
    assert why in str(error.value)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(("track_file = ", "reference_file = "))


def test_what_is_no_file_or_a_reference_alone_is_one_line(tmp_path):
    with pytest.raises(ParameterError, match=r"^track_file = .*existing file"):
        own_track.track(attrs.evolve(SMALL, track_file=str(tmp_path / "none.csv")))
    with pytest.raises(ParameterError, match=r"^reference_file = 'x': must be empty without"):
        own_track.track(attrs.evolve(SMALL, reference_file="x"))
