import japan_geoid
import numpy as np
import pytest

from seanav.checks import ParameterError
from seanav.models import gravity
from seanav.models.gravity import geoid
from seanav.models.gravity.geoid import NORMAL_GRAVITY_MGAL as GAMMA
from seanav.models.gravity.geoid import from_geoid
from seanav.models.gravity.sources import load, synthetic
from seanav.models.units import MGAL

EARTH = 6371e3
# A window like that of the geoid: nodes 1′ apart north, 1.5′ apart east, 7° each way.
NORTH_SPACING, EAST_SPACING, ROWS, COLUMNS = 1845.0, 2635.0, 421, 281


def window():
    north = (np.arange(ROWS) - ROWS // 2) * NORTH_SPACING
    east = (np.arange(COLUMNS) - COLUMNS // 2) * EAST_SPACING
    return np.meshgrid(north, east, indexing="ij")


def test_operator_multiplies_a_periodic_wave_by_its_wavenumber():
    rows, columns = 40, 60
    north, east = np.meshgrid(np.arange(rows) * 1500.0, np.arange(columns) * 1000.0, indexing="ij")
    k_north, k_east = 2 * np.pi * 3 / (rows * 1500.0), 2 * np.pi * 4 / (columns * 1000.0)
    wave = np.sin(k_north * north - k_east * east + 0.3)
    derivative = geoid.vertical_gradient(wave, 1500.0, 1000.0)
    np.testing.assert_allclose(derivative, np.hypot(k_north, k_east) * wave, rtol=0, atol=1e-17)


def test_anomaly_of_a_wave_in_the_middle_of_the_window():
    north, east = window()
    k_north, k_east = 2 * np.pi / 37e3, 2 * np.pi / 53e3
    wave = 0.1 * np.sin(k_north * north + k_east * east)
    anomaly = geoid.anomaly_of_undulation(wave, NORTH_SPACING, EAST_SPACING)
    expected = GAMMA * (np.hypot(k_north, k_east) - 2 / EARTH) * wave
    middle = np.hypot(north, east) < 70e3
    amplitude = GAMMA * np.hypot(k_north, k_east) * 0.1
    assert np.abs(anomaly - expected)[middle].max() < 1e-4 * amplitude


def test_flat_term_of_a_broad_swell():
    # 180 km from crest to crest along the diagonal, where 2/R is 0.9 % of |k|.
    north, east = window()
    wave = np.cos(2 * np.pi * north / 250e3) * np.cos(2 * np.pi * east / 250e3)
    k = np.hypot(2 * np.pi / 250e3, 2 * np.pi / 250e3)
    anomaly = geoid.anomaly_of_undulation(wave, NORTH_SPACING, EAST_SPACING)
    middle = np.hypot(north, east) < 70e3
    share = np.polyfit(wave[middle], anomaly[middle] / (GAMMA * k), 1)[0]
    assert share == pytest.approx(1 - 2 / (EARTH * k), abs=2e-3)
    assert 2 / (EARTH * k) > 8e-3


def test_anomaly_of_a_buried_point_mass():
    # Two opposite masses below each other: T = GM (1/r₁ − 1/r₂), N = T/γ (Bruns), and in the
    # plane Δg = −∂T/∂z − 2T/R. Their field has died away at the edges of the window.
    north, east = window()
    gm, shallow, deep = 6.674e-11 * 1e16, 12e3, 30e3
    gamma = GAMMA * MGAL
    r1, r2 = (np.sqrt(north**2 + east**2 + depth**2) for depth in (shallow, deep))
    potential = gm * (1 / r1 - 1 / r2)
    vertical = gm * (shallow / r1**3 - deep / r2**3)
    expected = (vertical - 2 / EARTH * potential) / MGAL
    anomaly = geoid.anomaly_of_undulation(potential / gamma, NORTH_SPACING, EAST_SPACING)
    middle = np.hypot(north, east) < 70e3
    peak = expected.max()
    assert peak > 300
    # what is left is the level and slope that the trend took
    difference = (anomaly - expected)[middle]
    assert np.ptp(difference) < 2e-3 * peak
    assert abs(difference.mean()) < 5e-3 * peak


def test_taper_leaves_no_step_at_the_edges():
    # Cut off at its crest, this wave would jump by its amplitude from one node to the next.
    north, east = window()
    k = 2 * np.pi / 150e3
    wave = np.cos(k * (north - north[0, 0])) * np.cos(k * (east - east[0, 0]))
    anomaly = geoid.anomaly_of_undulation(wave, NORTH_SPACING, EAST_SPACING)
    assert np.abs(anomaly).max() < 1.1 * GAMMA * np.sqrt(2) * k


def test_padding_is_wide_enough(monkeypatch):
    anomaly = from_geoid(size=301).anomaly_mgal
    monkeypatch.setattr(geoid, "PADDING", 8)
    assert np.abs(anomaly - from_geoid(size=301).anomaly_mgal).max() < 0.01


def test_quadratic_trend_does_not_reach_the_anomaly():
    north, east = window()
    bump = np.exp(-(north**2 + east**2) / (2 * 20e3**2))
    trend = 40 + 3e-5 * east - 2e-5 * north + 1e-11 * (east**2 - 2 * north * east + north**2)
    with_trend, without = (
        geoid.anomaly_of_undulation(n, NORTH_SPACING, EAST_SPACING) for n in (bump + trend, bump)
    )
    np.testing.assert_allclose(with_trend, without, rtol=0, atol=1e-8)


def test_default_map_has_the_range_of_the_papers_map():
    # The paper prints −37.2 … 40.8 mGal for its own, unnamed, region.
    anomaly = from_geoid().anomaly_mgal
    assert anomaly.shape == (101, 101)
    assert anomaly.min() == pytest.approx(-37.2, abs=0.05)
    assert anomaly.max() == pytest.approx(40.9, abs=0.05)


def test_maps_that_overlap_agree_where_they_do():
    # Moved by 20 km the window, its trend and its scale are others, the sea is the same. The
    # level is arbitrary; the gradient is not.
    here = from_geoid(25.0, 150.0)
    east, north = 20e3, -10e3
    centre = tuple(float(a) for a in gravity.local_to_geodetic(east, north, here.centre))
    there = from_geoid(*centre)
    a = here.anomaly_mgal[0:91, 20:101]
    b = there.anomaly_mgal[10:101, 0:81]
    assert a.std() > 5
    assert (a - b).std() < 0.005 * a.std()


def test_map_lies_north_up_and_east_right():
    # Across a trench the anomaly follows the geoid itself, which is asked for by coordinates.
    grid = from_geoid(24.0, 143.0, size=151)
    latitude, longitude = gravity.square_nodes((24.0, 143.0), 151, 1000.0)
    raw = japan_geoid.load_embedded_jpgeo2024().get_heights(*np.meshgrid(longitude, latitude))
    matches = {
        name: np.corrcoef(view.ravel(), raw.ravel())[0, 1]
        for name, view in (
            ("as is", grid.anomaly),
            ("flipped", grid.anomaly[::-1]),
            ("mirrored", grid.anomaly[:, ::-1]),
            ("transposed", grid.anomaly.T),
        )
    }
    assert max(matches, key=matches.get) == "as is"
    assert matches["as is"] > 0.8


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"latitude_deg": 18.4}, r"^map_latitude_deg = 18.4: must be between 18.5 and 46.5"),
        ({"latitude_deg": 46.6}, r"^map_latitude_deg = 46.6: "),
        ({"longitude_deg": 123.4}, r"^map_longitude_deg = 123.4: must be between 123.5 and 156.5"),
        ({"longitude_deg": -128.0}, r"^map_longitude_deg = -128.0: "),
        ({"latitude_deg": "18"}, r"^map_latitude_deg = '18': must be a finite number"),
        ({"longitude_deg": float("nan")}, r"^map_longitude_deg = nan: must be a finite number"),
        ({"size": 601}, r"^map_size = 601: must keep the map within 2.45° of its centre"),
        ({"size": 2}, r"^map_size = 2: must be an integer of at least 3"),
        ({"spacing": 0}, r"^map_spacing = 0: "),
    ],
)
def test_geoid_map_says_what_is_wrong(parameters, message):
    with pytest.raises(ParameterError, match=message) as error:
        load("geoid", **parameters)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("corner", [(18.5, 123.5), (18.5, 156.5), (46.5, 123.5), (46.5, 156.5)])
def test_geoid_map_reaches_the_corners_of_the_coverage(corner):
    assert np.isfinite(from_geoid(*corner).anomaly).all()


def test_values_are_rounded_to_a_millionth_of_a_milligal():
    for grid in (from_geoid(), synthetic()):
        micro = grid.anomaly / MGAL * 1e6
        assert np.abs(micro - np.round(micro)).max() < 1e-6


def test_synthetic_field_has_the_covariance_it_names():
    length, sigma, spacing, size = 4e3, 7.0, 1000.0, 31
    fields = np.array(
        [synthetic(seed, length, sigma, size, spacing).anomaly_mgal for seed in range(400)]
    )

    def products(rows, columns):
        # mean over the map for each seed: independent samples
        a = fields[:, : size - rows, : size - columns]
        return (a * fields[:, rows:, columns:]).mean(axis=(1, 2))

    # the last two: opposite sides of the map know nothing of each other
    for rows, columns in [(0, 0), (3, 0), (0, 3), (4, 4), (0, 8), (30, 0), (0, 30)]:
        samples = products(rows, columns)
        expected = sigma**2 * np.exp(-0.5 * (rows**2 + columns**2) * (spacing / length) ** 2)
        error = samples.std(ddof=1) / np.sqrt(len(samples))
        assert error < 0.08 * sigma**2
        assert abs(samples.mean() - expected) < 4 * error


def test_synthetic_field_has_the_gradient_it_promises():
    length, sigma, spacing = 2e3, 5.0, 250.0
    samples = []
    for seed in range(300):
        grid = synthetic(seed, length, sigma, 61, spacing)
        slope = gravity.gradient(grid)[:, 1:-1, 1:-1] / MGAL
        samples.append((slope**2).mean(axis=(1, 2)))
    mean = np.mean(samples, axis=0)
    error = np.std(samples, axis=0, ddof=1) / np.sqrt(len(samples))
    # a central difference has the variance (C(0) − C(2δ)) / 2δ², nearly σ²/ℓ²
    expected = sigma**2 * (1 - np.exp(-2 * (spacing / length) ** 2)) / (2 * spacing**2)
    assert expected == pytest.approx(sigma**2 / length**2, rel=0.02)
    assert np.all(error < 0.02 * expected)
    assert np.all(np.abs(mean - expected) < 4 * error)


def test_synthetic_field_is_its_seed():
    np.testing.assert_array_equal(synthetic(3).anomaly, synthetic(3).anomaly)
    assert not np.allclose(synthetic(3).anomaly, synthetic(4).anomaly)
    # the random numbers of the deviation 28 are those of 14
    np.testing.assert_allclose(
        synthetic(3, standard_deviation_mgal=28.0).anomaly_mgal,
        2 * synthetic(3).anomaly_mgal,
        rtol=0,
        atol=2e-6,
    )


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"seed": -1}, "^map_seed = -1: "),
        ({"correlation_length": 500.0}, "^map_correlation_length = 500.0: .* at least 1000 and"),
        ({"correlation_length": 2e5}, "^map_correlation_length = 200000.0: .* at most 100000$"),
        ({"standard_deviation_mgal": 0.0}, "^map_standard_deviation_mgal = 0.0: .* above 0$"),
        ({"size": 10.5}, "^map_size = 10.5: "),
    ],
)
def test_synthetic_map_says_what_is_wrong(parameters, message):
    with pytest.raises(ParameterError, match=message):
        load("synthetic", **parameters)


def test_load_finds_each_source():
    np.testing.assert_array_equal(
        load("geoid", latitude_deg=25.0, longitude_deg=150.0, size=31).anomaly,
        from_geoid(25.0, 150.0, 31).anomaly,
    )
    np.testing.assert_array_equal(
        load("synthetic", seed=5, correlation_length=6e3, size=31).anomaly,
        synthetic(5, 6e3, size=31).anomaly,
    )
    with pytest.raises(ParameterError, match=r"^map_source = 'geiod': must be 'geoid', "):
        load("geiod")
