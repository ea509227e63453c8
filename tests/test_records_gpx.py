"""GPX files of users: what is read, and every refusal is one line."""

import gpxpy.gpx
import numpy as np
import pytest

from seanav.checks import ParameterError
from seanav.records.gpx import read_gpx

POINTS = [(18.55, 127.6), (18.7, 127.95), (18.9, 128.25)]
HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n<gpx version="1.1" creator="by hand">\n'


def points(tag, places):
    return "\n".join(f'<{tag} lat="{a}" lon="{b}"></{tag}>' for a, b in places)


def track(*segments):
    inner = "\n".join(f"<trkseg>\n{points('trkpt', each)}\n</trkseg>" for each in segments)
    return f"<trk>\n<name>ä way</name>\n{inner}\n</trk>\n"


def route(places):
    return f"<rte>\n{points('rtept', places)}\n</rte>\n"


def gpx(*parts, head=HEAD):
    return f"{head}{''.join(parts)}</gpx>\n"


@pytest.fixture
def read(tmp_path):
    def written(text, **options):
        content = text if isinstance(text, bytes) else text.encode()
        (tmp_path / "own.gpx").write_bytes(content)
        return read_gpx("path_file", str(tmp_path / "own.gpx"), **options)

    yield written
    assert [path.name for path in tmp_path.iterdir()] == ["own.gpx"]  # nothing is written


PREFIXED = gpx(route(POINTS)).replace("</", "</g:")
PREFIXED = PREFIXED.replace("<rte", "<g:rte").replace("<gpx", '<g:gpx xmlns:g="u"')

GOOD = {
    "route": gpx(route(POINTS)),
    "track": gpx(track(POINTS)),
    "track of two segments": gpx(track(POINTS[:1], POINTS[1:])),
    "waypoints beside": gpx('<wpt lat="1" lon="2"/>\n', route(POINTS)),
    "an empty track beside": gpx("<trk><name>none</name></trk>", route(POINTS)),
    "byte order mark": b"\xef\xbb\xbf" + gpx(route(POINTS)).encode(),
    "lines of Windows": gpx(route(POINTS)).replace("\n", "\r\n"),
    "GPX 1.0": gpx(route(POINTS)).replace("1.1", "1.0"),
    "namespace": gpx(
        route(POINTS), head='<gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1">'
    ),
    "prefix": PREFIXED,
    "without a declaration": gpx(track(POINTS), head="<gpx>"),
    "commented points": gpx("<!-- <rtept lat='1' lon='2'/>\n -->", route(POINTS)),
}


@pytest.mark.parametrize("kind", GOOD)
def test_points_are_those_of_the_file(kind, read):
    record = read(GOOD[kind])
    assert record.source == "own.gpx"
    np.testing.assert_array_equal(record["latitude_deg"], [a for a, _ in POINTS])
    np.testing.assert_array_equal(record["longitude_deg"], [b for _, b in POINTS])


@pytest.mark.parametrize("kind", GOOD)
def test_rows_are_lines_of_the_file(kind, read):
    text = GOOD[kind]
    lines = (text.decode() if isinstance(text, bytes) else text).splitlines()
    for row, (latitude, _) in zip(read(text).rows, POINTS, strict=True):
        assert f'lat="{latitude}"' in lines[row - 1]


def test_a_file_of_gpxpy_itself_is_read(read):
    made = gpxpy.gpx.GPX()
    made.routes.append(gpxpy.gpx.GPXRoute())
    made.routes[0].points += [gpxpy.gpx.GPXRoutePoint(*place) for place in POINTS]
    np.testing.assert_array_equal(read(made.to_xml())["latitude_deg"], [a for a, _ in POINTS])


def bad(latitude, longitude):
    return gpx(route([POINTS[0], (latitude, longitude)]))


BAD = {
    "two tracks": (gpx(track(POINTS), track(POINTS)), "one track or one route; has 2 tracks and 0"),
    "track and route": (gpx(track(POINTS), route(POINTS)), "has 1 tracks and 1 routes"),
    "two routes": (gpx(route(POINTS), route(POINTS)), "has 0 tracks and 2 routes"),
    "waypoints": (gpx('<wpt lat="1" lon="2"/>' * 3), "has 3 waypoints, which have no order"),
    "nothing in it": (gpx(), "one track or one route; has none with points"),
    "an empty track": (gpx("<trk/>"), "has none with points"),
    "one point": (gpx(route(POINTS[:1])), "at least 2 points, has 1"),
    "not a number": (bad("nan", 1), "row 5: latitude_deg = nan: must be from -90 to 90"),
    "no latitude": (gpx('<rte><rtept lon="2"/></rte>'), "a point has no latitude"),
    "no longitude": (gpx('<rte><rtept lat="2"/></rte>'), "a point has no longitude"),
    "beyond a pole": (bad(128.0, 18.0), "row 5: latitude_deg = 128: must be from -90 to 90"),
    "no longitude of Earth": (bad(18.0, 3600), "row 5: longitude_deg = 3600: must be from -360"),
    "degrees and minutes": (bad("18 33.0", 127), "must be GPX: '18 33.0' must be a number"),
    "a comma": (bad("18,55", 127), "must be GPX: '18,55' must be a number"),
    "cut off": (gpx(route(POINTS))[:-20], "must be GPX: "),
    "a table": ("latitude_deg,longitude_deg\n18.5,128\n", "must be GPX: syntax error"),
    "another document": ("<kml><Placemark/></kml>", "must hold one track or one route"),
    "entities": (
        '<!DOCTYPE gpx [<!ENTITY a "b">]>' + gpx(route(POINTS), head="<gpx>"),
        "must be GPX; it has a document type of its own",
    ),
    "empty": ("", "must not be empty"),
    "no text": (b"\xff\xfe\x00<", "must be text in UTF-8"),
    "another encoding": (gpx(track(POINTS)).encode("latin-1"), "must be text in UTF-8; byte"),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_file_is_one_line(kind, read, tmp_path):
    text, message = BAD[kind]
    with pytest.raises(ParameterError) as error:
        read(text)
    said = str(error.value)
    assert said.startswith("path_file = '")
    assert message in said
    assert "\n" not in said
    assert len(said) < 300


def test_fewest_points_can_be_asked_for(read):
    with pytest.raises(ParameterError, match="at least 4 points, has 3"):
        read(gpx(route(POINTS)), least=4)


@pytest.mark.parametrize(("name", "why"), [("none.gpx", "there is none"), ("", "is a folder")])
def test_a_missing_file_is_one_line(name, why, tmp_path):
    with pytest.raises(ParameterError, match=why):
        read_gpx("path_file", str(tmp_path / name))


def test_too_large_a_file_is_not_read(read, monkeypatch):
    monkeypatch.setattr("seanav.records.gpx.MOST_BYTES", 2**10)
    with pytest.raises(ParameterError, match="must be a file of at most"):
        read(gpx(track(POINTS * 100)))
