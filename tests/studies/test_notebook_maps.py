"""Paper 5's whole notebook on maps that are not the default one.

What each file format must give is tested in `test_gravity_files`; here every cell must run on it.
"""

import json
import shutil
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import rasterio
import rasterio.warp
from matplotlib.figure import Figure
from rasterio.transform import Affine

from seanav import runner
from seanav.checks import ParameterError
from seanav.runner import Refused
from seanav.studies.gravity_planning.claims import CLAIMS
from seanav.studies.gravity_planning.scenario import Scenario

CHECKOUT = Path(__file__).resolve().parents[2]
STEM = "5_gravity_planning"
HERE = (-31.2, -120.5)  # far from the default window; 239.5° east for files that count to 360°
SMALL = (
    "runs=12",
    "samples=25",
    "pairs=2",
    "label_pairs=2",
    "bound_expansions=50",
    "epsilon=2.0",
    "noise_mgal=[1.0, 2.0]",
    f"map_latitude_deg={HERE[0]}",
    f"map_longitude_deg={HERE[1]}",
)
STEP = 0.02  # degrees


def anomaly_mgal(east_km, north_km):
    return 25 * np.sin(east_km / 9.0) * np.cos(north_km / 7.0) + 0.1 * east_km


def netcdf(path, form, names, falling, to_360):
    latitude = HERE[0] + STEP * np.arange(-40, 41)
    longitude = HERE[1] + STEP * np.arange(-40, 41)
    values = anomaly_mgal(95.6 * (longitude - HERE[1]), 110.9 * (latitude[:, None] - HERE[0]))
    if falling:
        latitude, values = latitude[::-1], values[::-1]
    with netCDF4.Dataset(path, "w", format=form) as file:
        for name, axis in zip(
            names, (latitude, longitude % 360 if to_360 else longitude), strict=True
        ):
            file.createDimension(name, len(axis))
            file.createVariable(name, "f8", (name,))[:] = axis
        variable = file.createVariable("z", "f4", names)
        variable.units = "mGal"
        variable[:] = values
    return path


def geotiff(path, crs, step, corner, values):
    matrix = Affine(step, 0, corner[0], 0, -step, corner[1])
    rows, columns = values.shape
    options = {"height": rows, "width": columns, "count": 1, "dtype": "float64"}
    with rasterio.open(path, "w", driver="GTiff", crs=crs, transform=matrix, **options) as file:
        file.write(values, 1)
        file.units = ["mGal"]
    return path


def geographic(path):
    rows = STEP * (40 - np.arange(81))[:, None]
    values = anomaly_mgal(-95.6 * rows.T[:, ::1], 110.9 * rows)
    corner = HERE[1] - 40.5 * STEP, HERE[0] + 40.5 * STEP
    return geotiff(path, "EPSG:4326", STEP, corner, values)


def projected(path):
    zone = "EPSG:32710"  # UTM 10 south
    (east,), (north,) = rasterio.warp.transform("EPSG:4326", zone, [HERE[1]], [HERE[0]])
    rows = 2.0 * (40 - np.arange(81))[:, None]
    corner = east - 81e3, north + 81e3
    return geotiff(path, zone, 2e3, corner, anomaly_mgal(-rows.T, rows))


SOURCES = {
    "netcdf4": lambda path: netcdf(path, "NETCDF4", ("lat", "lon"), False, False),
    "netcdf3-falling-360": lambda path: netcdf(
        path, "NETCDF3_CLASSIC", ("latitude", "longitude"), True, True
    ),
    "netcdf4-yx-360": lambda path: netcdf(path, "NETCDF4", ("y", "x"), True, True),
    "geotiff": geographic,
    "geotiff-projected": projected,
    "synthetic": lambda path: "synthetic",
}


@pytest.fixture
def root(tmp_path):
    (tmp_path / "notebooks").mkdir()
    shutil.copy(CHECKOUT / "notebooks" / f"{STEM}.ipynb", tmp_path / "notebooks")
    return tmp_path


def code_cells():
    """Return the sources of the code cells and the defaults of the first one's parameters."""
    book = runner.notebook(CHECKOUT, STEM)
    return [c.source for c in book.cells if c.cell_type == "code"], runner.defaults(book)


def check(results):
    claims = json.loads((results / "claims.json").read_text(encoding="utf-8"))
    assert list(claims) == [claim.number for claim in CLAIMS]
    assert len(list(results.glob("figure_0*.png"))) == 8


@pytest.mark.parametrize("kind", SOURCES)
def test_every_cell_runs_on(kind, tmp_path, monkeypatch):
    # In this process and with coarse pictures: most of a run's time goes into fine ones.
    def coarse(figure, file, **options):
        if options.get("format") == "png":
            save(figure, file, format="png", dpi=20)

    save = Figure.savefig
    monkeypatch.setattr(Figure, "savefig", coarse)
    monkeypatch.setenv("SEANAV_RESULTS", str(tmp_path / "results"))
    (_, *cells), known = code_cells()
    source = SOURCES[kind](tmp_path / "grid")
    names = known | runner.overrides(known, [*SMALL, f"map_source={source}"])
    for cell in cells:
        exec(cell, names)
    check(tmp_path / "results" / STEM)


def test_strict_run_with_a_grid_file(root):
    source = SOURCES["netcdf4"](root / "grid")
    check(runner.run(root, STEM, words=(*SMALL, f"map_source={source.name}")))
    assert not (root / "paper_figures").exists()


def test_default_centre_gives_way_to_the_middle_of_the_file(tmp_path):
    # Far from the default window; the notebook's printed source and table of parameters say so.
    source = str(SOURCES["netcdf4-yx-360"](tmp_path / "own.nc"))
    chart = Scenario(map_source=source).map()
    assert chart.centre == pytest.approx(HERE, abs=1e-4)
    assert chart.source == (
        "own.nc, z, around its middle, -31.2° N -120.5° E, because it does not reach the default "
        "centre"
    )
    rows = {row[0]: row[1:] for row in Scenario(map_source=source).origins()}
    about = (
        "deg",
        "derived",
        "the middle of your own grid, which does not reach the default centre",
    )
    assert rows["map_source"][0] == "own.nc"
    assert rows["map_latitude_deg"] == (pytest.approx(-31.2), *about)
    assert rows["map_longitude_deg"] == (pytest.approx(-120.5), *about)
    stated = Scenario(map_source=source, map_latitude_deg=-31.1, map_longitude_deg=-120.4)
    assert stated.map().centre == (-31.1, -120.4)
    assert stated.map().source == "own.nc, z"
    assert stated.origins()[1][1] == -31.1


def test_default_centre_stays_where_the_file_covers_it(tmp_path, monkeypatch):
    monkeypatch.setitem(globals(), "HERE", (18.9, 128.1))
    scenario = Scenario(map_source=str(geographic(tmp_path / "own.tif")))
    assert scenario.map().centre == scenario.map_centre == (18.8, 128.0)
    assert scenario.origins()[1][1] == 18.8


def test_one_coordinate_that_is_chosen_is_not_moved(tmp_path):
    source = str(geographic(tmp_path / "own.tif"))
    with pytest.raises(
        ParameterError, match=r"must cover .*; its middle is map_latitude_deg = -31"
    ):
        Scenario(map_source=source, map_latitude_deg=-31.2).map()


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("map_source=none.nc", "map_source = 'none.nc': "),
        ("goal=[101, 9]", "goal = [101, 9]: must lie on the map"),
        ("start_1=[65, 9]", "start_1 = [65, 9]: must differ from goal"),
        (
            "noise_mgal=[0.0, 2.0]",
            "noise_mgal = 0.0: must be a finite number at least 1e-06 and at most",
        ),
        ("user_path_km=[[1, 1], [200, 3]]", "user_path_km = "),
        ("epsilon=-1", "epsilon = -1.0: must be a finite number at least 0 and at most 1e+06"),
    ],
)
def test_bad_input_is_one_line_of_the_first_cell(word, message):
    (_, first, *_), known = code_cells()
    with pytest.raises(ParameterError) as error:
        exec(first, known | runner.overrides(known, [word]))
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


def test_bad_input_leaves_nothing(root):
    with pytest.raises(Refused, match=rf"^{STEM}: map_source = 'none\.nc': [^\n]*$"):
        runner.run(root, STEM, words=("map_source=none.nc",))
    assert not (root / "paper_figures").exists()
    assert (root / "build" / "failed" / f"{STEM}.ipynb").exists()
