"""Paper 5 on a user's own path: from the file onto the map, and what is said of it."""

import dataclasses
import shutil
from pathlib import Path

import attrs
import numpy as np
import pytest
import rasterio.warp
from cells import judge
from matplotlib import pyplot as plt

from seanav import runner
from seanav.checks import ParameterError
from seanav.models import gravity, paths
from seanav.runner import Refused
from seanav.studies.gravity_planning import own_data, own_path, run
from seanav.studies.gravity_planning.scenario import Scenario

CENTRE = (18.8, 128.0)  # the default map's
PLACES = [
    (18.55, 127.62),
    (18.71, 127.95),
    (18.93, 128.24),
]  # on it, none of them by itself swapped


@pytest.fixture(scope="module")
def chart():
    """Return a plane: slopes 3 mGal/km east and 1 mGal/km north."""
    north, east = np.mgrid[0:101, 0:101] * 1e3
    return gravity.GravityMap(3e-8 * east + 1e-8 * north, 1000.0, "plane", "analytic", CENTRE)


@pytest.fixture(autouse=True)
def close():
    yield
    plt.close("all")


@pytest.fixture
def read(tmp_path, chart):
    def written(text, *, name="own.csv", chart=chart):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return own_path.read("path_file", str(tmp_path / name), chart)

    return written


def table(header, rows):
    return "\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n"


def gpx(*ways):
    inner = [
        "<trk><trkseg>" + "".join(f'<trkpt lat="{a}" lon="{b}"/>\n' for a, b in way) for way in ways
    ]
    return '<gpx version="1.1">\n' + "".join(f"{one}</trkseg></trk>\n" for one in inner) + "</gpx>"


# ---------------------------------------------------------------- onto the map


def test_kilometres_are_those_of_the_map(read):
    corners = read("north_km,east_km,depth_m\n73,58,100\n60.5,40,100\n9,65,100\n")
    np.testing.assert_allclose(corners, [[58e3, 73e3], [40e3, 60.5e3], [65e3, 9e3]])


def test_degrees_of_the_nodes_are_the_nodes(read, chart):
    latitude, longitude = gravity.square_nodes(CENTRE, 101, 1000.0)
    nodes = [(58, 73), (1, 1), (99, 99), (65, 9)]
    corners = read(
        table("latitude_deg,longitude_deg", [(latitude[n], longitude[e]) for e, n in nodes])
    )
    np.testing.assert_allclose(corners, 1e3 * np.array(nodes), atol=1e-6)


def test_degrees_agree_with_a_projection_of_proj(read):
    # Azimuthal equidistant around the map's centre, WGS 84: an Earth of its own.
    projection = f"+proj=aeqd +lat_0={CENTRE[0]} +lon_0={CENTRE[1]} +ellps=WGS84"
    latitude, longitude = zip(*PLACES, strict=True)
    local = rasterio.warp.transform("EPSG:4326", projection, longitude, latitude)
    corners = read(table("latitude_deg,longitude_deg", PLACES))
    np.testing.assert_allclose(corners, np.transpose(local) + 50e3, atol=250)


@pytest.mark.parametrize("turn", [-360, 0])
def test_longitude_may_be_a_turn_further(turn, read):
    turned = [(a, b + turn) for a, b in PLACES]
    one, other = (read(table("latitude_deg,longitude_deg", x)) for x in (PLACES, turned))
    np.testing.assert_allclose(one, other, atol=1e-5)


def test_a_map_east_of_the_date_line_takes_both_longitudes(read):
    north, east = np.mgrid[0:101, 0:101] * 1e3
    there = gravity.GravityMap(1e-8 * east + north * 0, 1000.0, "", "", (-31.2, -120.5))
    places = [(-31.0, -120.6), (-31.3, -120.3)]
    one = read(table("latitude_deg,longitude_deg", places), chart=there)
    turned = [(a, b % 360) for a, b in places]
    np.testing.assert_allclose(
        one, read(table("latitude_deg,longitude_deg", turned), chart=there), atol=1e-5
    )
    assert one[1, 0] > one[0, 0]
    assert one[1, 1] < one[0, 1]


@pytest.mark.parametrize("name", ["own.gpx", "own.GPX", "track.xml"])
def test_gpx_and_a_table_give_the_same_path(name, read):
    expected = read(table("latitude_deg,longitude_deg", PLACES))
    np.testing.assert_array_equal(read(gpx(PLACES), name=name), expected)


def test_kilometres_count_where_there_are_both(read):
    text = "latitude_deg,east_km,longitude_deg,north_km\n18.8,10,128,20\n18.9,30,128,40\n"
    np.testing.assert_allclose(read(text), [[10e3, 20e3], [30e3, 40e3]])


def test_a_point_may_be_repeated(chart, tmp_path):
    once, twice = [(58, 73), (40, 60), (65, 9)], [(58, 73), (58, 73), (40, 60), (40, 60), (65, 9)]
    sailed = []
    for number, rows in enumerate((once, twice)):
        file = tmp_path / f"{number}.csv"
        file.write_text(table("east_km,north_km", rows), encoding="utf-8")
        sailed.append(Scenario(path_file=str(file)).user_path(chart))
    np.testing.assert_array_equal(*sailed)
    listed = Scenario(user_path_km=[list(row) for row in once]).user_path(chart)
    np.testing.assert_array_equal(sailed[0], listed)


# ---------------------------------------------------------------- refused

KM = "east_km,north_km"
DEG = "latitude_deg,longitude_deg"
BAD = {
    "metres": (table(KM, [(58000, 73000), (65000, 9000)]), "row 2: .*; are they metres\\?$"),
    "metres named": (table("east_m,north_m", [(1, 2), (3, 4)]), "must have the columns east_km"),
    "off the map": (
        table(KM, [(58, 73), (58, 100.5)]),
        r"row 3: east_km = 58, north_km = 100.5: must lie on the map, 0 … 100 km east and "
        r"0 … 100 km north$",
    ),
    "negative": (table(KM, [(58, 73), (-0.1, 9)]), "row 3: east_km = -0.1"),
    "swapped": (
        table(DEG, [(b, a) for a, b in PLACES]),
        r"row 2: latitude_deg = 127.62, .* latitude 18\.\d+ … 19\.\d+, longitude 127\.\d+ … "
        r"128\.\d+; are latitude and longitude swapped\?$",
    ),
    "far away": (table(DEG, [*PLACES, (54.3, 10.1)]), "row 5: latitude_deg = 54.3, .*128.474$"),
    "beyond a pole": (table(DEG, [*PLACES, (98.0, 128)]), "row 5: latitude_deg = 98, "),
    "no number on Earth": (
        table(DEG, [(18.8, 12800), (18.9, 128)]),
        "row 2: longitude_deg = 12800",
    ),
    "not a number": (
        table(KM, [(58, 73), ("nan", 9)]),
        "row 3: east_km = 'nan': there is no value",
    ),
    "empty cell": (table(KM, [(58, 73), ("", 9)]), "row 3: east_km = '': there is no value"),
    "infinite": (table(KM, [("inf", 73), (1, 9)]), "row 2: east_km = 'inf': must be a finite"),
    "degrees and minutes": (
        table(DEG, [("18 33.0N", "127 57.0E"), (18.9, 128)]),
        "row 2: latitude_deg = '18 33.0N': must be a number; degrees and minutes",
    ),
    "one point": (table(KM, [(58, 73)]), "at least 2 rows below its header, has 1"),
    "no length": (table(KM, [(58, 73)] * 3), "must lead from one place to another; all its"),
    "no header": (
        "58,73\n40,60\n65,9\n",
        "must have the columns east_km, north_km or latitude_deg",
    ),
    "one coordinate": (table("east_km,time", [(58, 1), (40, 2)]), "must have the columns east_km"),
    "semicolons": ("east_km;north_km\n58;73\n40;60\n", "must be separated by commas"),
    "decimal comma": ('east_km,north_km\n"58,5",73\n40,60\n', "row 2: .*decimal point"),
    "two tracks": (gpx(PLACES, PLACES), "one track or one route; has 2 tracks"),
    "track off the map": (gpx([*PLACES, (54.3, 10.1)]), "row 5: latitude_deg = 54.3"),
    "swapped track": (gpx([(b - 90, a) for a, b in PLACES]), "row 2: latitude_deg = 37.62"),
    "empty": ("", "must not be empty"),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_path_is_one_line(kind, read, tmp_path):
    text, message = BAD[kind]
    with pytest.raises(ParameterError, match=f"^path_file = '.*own.csv': .*{message}") as error:
        read(text)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 300
    assert [one.name for one in tmp_path.iterdir()] == ["own.csv"]


def test_degrees_need_a_map_of_a_place(read, chart):
    nowhere = gravity.GravityMap(chart.anomaly, 1000.0, "field", "random")
    with pytest.raises(ParameterError, match="must have the columns east_km, north_km: this map"):
        read(table(DEG, PLACES), chart=nowhere)
    assert len(read(table(KM, [(1, 2), (3, 4)]), chart=nowhere)) == 2


def test_a_path_is_a_list_or_a_file():
    with pytest.raises(ParameterError, match=r"^path_file = 'a.csv': must be empty beside user_pa"):
        Scenario(path_file="a.csv", user_path_km=[[1, 2], [3, 4]])


def test_results_hold_the_name_of_the_file_alone():
    rows = {row[0]: row[1] for row in Scenario(path_file="folders/of/mine/my.gpx").origins()}
    assert rows["path_file"] == "my.gpx"
    rows = {row[0]: row[1] for row in Scenario(map_source="synthetic").origins()}
    assert rows["map_source"] == "synthetic"


# ---------------------------------------------------------------- what it is worth

SMALL = Scenario(runs=60, samples=21, process_noise=0.0)


def test_the_built_in_path_tacks_at_its_amplitude():
    start, goal = np.array([20e3, 80e3]), np.array([60e3, 50e3])
    corners = own_path.zigzag(start, goal, (100e3, 100e3), 7e3)
    np.testing.assert_array_equal(corners[[0, -1]], [start, goal])
    normal = np.array([30e3, 40e3]) / 50e3
    np.testing.assert_allclose(
        (corners - start) @ normal, 7e3 * np.array([0, 1, -1, 1, -1, 1, -1, 0]), atol=1e-6
    )
    along = (corners - start) @ np.array([40e3, -30e3]) / 50e3**2
    np.testing.assert_allclose(along, np.array([0, 1, 3, 5, 7, 9, 11, 12]) / 12)


def test_the_built_in_path_stays_on_the_map(chart):
    scenario = attrs.evolve(SMALL, start_1=(0, 0), goal=(100, 1))
    assert paths.inside(own_data.built_in(scenario, chart), chart.extent)


def test_others_lead_between_the_ends_of_the_own_path(chart):
    own = paths.resample([[10.4e3, 20e3], [30e3, 80e3], [70e3, 50.6e3]], 21)
    found = own_data.ways(SMALL, chart, own)
    assert list(found) == ["Own", "Planned", "Direct"]
    np.testing.assert_allclose(found["Planned"][[0, -1]], [[10e3, 20e3], [70e3, 51e3]])
    np.testing.assert_allclose(found["Direct"][[0, -1]], own[[0, -1]])
    plan = run.plan(SMALL, chart, (10, 20), SMALL.planning_noise_mgal, (70, 51))
    np.testing.assert_array_equal(found["Planned"], run.plan_path(plan, chart, 21))


def test_a_round_trip_is_compared_with_nothing(chart):
    own = paths.resample([[10e3, 20e3], [30e3, 80e3], [10.3e3, 20e3]], 21)
    sailed = own_data.ways(SMALL, chart, own)
    scored = own_data.sail(SMALL, chart, run.draw(SMALL), sailed)
    assert list(scored) == ["Own"]
    assert "no other one" in own_data.verdict(scored)
    (row,) = own_data.rows(SMALL, scored)
    assert row[-3:] == (None, None, None)
    own_data.picture(SMALL, chart, sailed, scored).canvas.draw()


def test_along_a_path_on_a_plane_only_the_axis_of_the_slope_is_learnt(chart):
    own = paths.resample([[10e3, 20e3], [50e3, 50e3]], 21)
    score = own_data.sail(SMALL, chart, run.draw(SMALL), {"Own": own})["Own"]
    rows = own_data.along(SMALL, chart, own, score)
    slope = np.sqrt(10.0)  # mGal/km
    assert len(rows) == 10
    for number, (to, east, north, M, long, short, rmse) in enumerate(rows, start=1):
        assert (to, east, north) == pytest.approx((5.0 * number, 10 + 4 * number, 20 + 3 * number))
        assert M == pytest.approx(slope / 2.0)
        assert long == pytest.approx(1.0)
        assert short == pytest.approx((1 + 2 * number * (slope / 2.0) ** 2) ** -0.5)
        assert rmse == pytest.approx(np.hypot(long, short), rel=0.05)


def test_a_straight_own_path_is_the_direct_one(chart):
    own = paths.resample([[10e3, 20e3], [50e3, 50e3]], 21)
    scored = own_data.sail(SMALL, chart, run.draw(SMALL), own_data.ways(SMALL, chart, own))
    rows = {
        row[0]: dict(zip(own_data.COLUMNS, row, strict=True))
        for row in own_data.rows(SMALL, scored)
    }
    assert rows["Own"]["over_direct"] == pytest.approx(1.0)
    assert rows["Own"]["length_km"] == pytest.approx(50.0)
    assert rows["Own"]["hours"] == pytest.approx(50e3 / 5 / 3600)
    assert rows["Own"]["end_bound_km"] == pytest.approx(np.sqrt(1 + 1 / (1 + 20 * 2.5)))
    assert "as good as the straight line (1" in own_data.verdict(scored)


@pytest.mark.parametrize(("factor", "words"), [(0.5, "better than"), (2.0, "worse than")])
def test_the_verdict_is_that_of_the_ratio(factor, words, chart):
    own = paths.resample([[10e3, 20e3], [50e3, 50e3]], 21)
    scored = own_data.sail(SMALL, chart, run.draw(SMALL), own_data.ways(SMALL, chart, own))
    squared = scored["Direct"].squared * factor**2
    scored["Own"] = dataclasses.replace(scored["Own"], squared=squared)
    assert own_data.verdict(scored).startswith(
        f"The own path is {words} the straight line ({factor:g}"
    )


@pytest.mark.parametrize("factor", [0.98, 1.02])
def test_a_difference_within_the_interval_is_none(factor, chart):
    own = paths.resample([[10e3, 20e3], [50e3, 50e3]], 21)
    scored = own_data.sail(SMALL, chart, run.draw(SMALL), own_data.ways(SMALL, chart, own))
    uneven = factor**2 * np.resize([0.2, 1.8], (SMALL.runs, 1))  # the runs speak for both
    squared = scored["Direct"].squared.mean(axis=0) * uneven
    scored["Own"] = dataclasses.replace(scored["Own"], squared=squared)
    assert own_data.verdict(scored).startswith("The own path is as good as the straight line (")


# ---------------------------------------------------------------- the notebook


def test_every_cell_runs_on_a_path_of_the_user(tmp_path):
    (tmp_path / "secret folder").mkdir()
    file = tmp_path / "secret folder" / "own.gpx"
    file.write_text(gpx(PLACES), encoding="utf-8")
    printed = judge("5_gravity_planning", {"path_file": str(file)}, tmp_path, pictures=0.3)
    assert "path: own.gpx" in printed
    assert "Own      RMSE" in printed  # it was sailed among those of test 1
    for result in (tmp_path / "5_gravity_planning").glob("*.*"):
        if result.suffix in (".csv", ".json"):
            assert "secret" not in result.read_text(encoding="utf-8"), result.name


def test_a_bad_file_is_one_line_of_the_command(tmp_path):
    (tmp_path / "notebooks").mkdir()
    notebook = Path(__file__).resolve().parents[2] / "notebooks" / "5_gravity_planning.ipynb"
    shutil.copy(notebook, tmp_path / "notebooks")
    (tmp_path / "own.csv").write_text(table(KM, [(58, 73), (58, 173)]), encoding="utf-8")
    with pytest.raises(Refused, match=r"path_file = 'own\.csv': row 3: [^\n]*$"):
        runner.run(tmp_path, "5_gravity_planning", words=("path_file=own.csv",))
    assert not (tmp_path / "paper_figures").exists()
