"""Tables of users: what is read is what the file holds, and every refusal is one line."""

import math
import time
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

from seanav.checks import ParameterError
from seanav.records import read_csv

LAYOUTS = (("north_m_s", "east_m_s"), ("speed_m_s", "direction_deg"))
BOUNDS = {
    "north_m_s": (-10, 10),
    "east_m_s": (-10, 10),
    "speed_m_s": (0, 10),
    "direction_deg": (-360, 360),
}
HEAD = "time,north_m_s,east_m_s\n"


def table(*times, head=HEAD, values="0.5,-0.25"):
    return head + "".join(f"{time},{values}\n" for time in times)


@pytest.fixture
def read(tmp_path):
    def written(text, layouts=LAYOUTS, **options):
        content = text if isinstance(text, bytes) else text.encode()
        (tmp_path / "my.csv").write_bytes(content)
        return read_csv("own_file", str(tmp_path / "my.csv"), layouts, bounds=BOUNDS, **options)

    yield written
    assert {path.name for path in tmp_path.iterdir()} <= {"my.csv"}  # nothing is written


# ---------------------------------------------------------------- good ones

TEN = ["0", "10", "25.5"]
ZONED = ["2017-04-06T12:00:00Z", "2017-04-06T12:00:10Z", "2017-04-06T12:00:25.5Z"]
GOOD = {
    "seconds": table(*TEN),
    "seconds since 1970": table(1491480000, 1491480010, 1491480025.5),
    "seconds before zero": table(-10, 0, 15.5),
    "in UTC": table(*ZONED),
    "without a zone": table(*(time[:-1] for time in ZONED)),
    "with a blank": table(*(time.replace("T", " ") for time in ZONED)),
    "an offset": table(*(time.replace("Z", "+02:00") for time in ZONED)),
    "a short offset": table(*(time.replace("Z", "-0730") for time in ZONED)),
    "offsets that change": table(
        "2017-10-29T02:59:55+02:00", "2017-10-29T02:00:05+01:00", "2017-10-29T02:00:20.5+01:00"
    ),
    "byte order mark": b"\xef\xbb\xbf" + table(*TEN).encode(),
    "lines of Windows": table(*TEN).replace("\n", "\r\n"),
    "lines of old": table(*TEN).replace("\n", "\r"),
    "no last line end": table(*TEN).rstrip("\n"),
    "empty lines at the end": table(*TEN) + "\n\n\r\n",
    "spaces": table(*TEN).replace(",", " , "),
    "quoted": "\n".join(
        ",".join(f'"{cell}"' for cell in line.split(",")) for line in table(*TEN).splitlines()
    ),
    "a quoted comma beside": table(*TEN, head=HEAD[:-1] + ",note\n", values='0.5,-0.25,"a, b"'),
    "more columns": table(*TEN, head="time,depth_m,north_m_s,east_m_s\n", values="7,0.5,-0.25"),
    "text beside": table(*TEN, head=HEAD[:-1] + ",flag\n", values="0.5,-0.25,nan"),
    "an empty last column": table(*TEN, head=HEAD[:-1] + ",\n", values="0.5,-0.25,"),
    "another order": "east_m_s,time,north_m_s\n" + "".join(f"-0.25,{t},0.5\n" for t in TEN),
    "exponents": table(*TEN, values="+5e-1,-.25"),
}


@pytest.mark.parametrize("kind", GOOD)
def test_a_good_table_is_read_as_it_stands(kind, read):
    record = read(GOOD[kind])
    np.testing.assert_allclose(record.time, [0, 10, 25.5], atol=1e-6)
    np.testing.assert_array_equal(record["north_m_s"], [0.5] * 3)
    np.testing.assert_array_equal(record["east_m_s"], [-0.25] * 3)
    np.testing.assert_array_equal(record.rows, [2, 3, 4])
    assert list(record.columns) == ["north_m_s", "east_m_s"]
    assert (record.name, record.source, len(record)) == ("own_file", "my.csv", 3)
    assert record.span == pytest.approx(25.5)


@pytest.mark.parametrize(
    ("first", "later", "start"),
    [
        ("2017-04-06T12:10:00", "2018-01-01", "2017-04-06T12:10:00+00:00"),
        ("2017-04-06 12:10", "2018-01-01", "2017-04-06T12:10:00+00:00"),
        ("2017-04-06", "2018-01-01", "2017-04-06T00:00:00+00:00"),
        ("2017-04-06T12:10:00-07:00", "2018-01-01T00Z", "2017-04-06T19:10:00+00:00"),
        ("2017-04-06T12:10:00+0530", "2018-01-01T00Z", "2017-04-06T06:40:00+00:00"),
        ("7.5", "99", ""),
    ],
)
def test_the_start_is_in_utc(first, later, start, read):
    assert read(table(first, later)).start == start


def test_times_are_those_of_the_calendar(read):
    zone = timedelta(hours=-3.5)
    begin = datetime(2020, 2, 28, 22, 0, tzinfo=UTC)
    steps = np.array([0, 1, 3600, 86400, 2 * 86400, 366 * 86400.0])  # over a leap day
    texts = [
        (begin + timedelta(seconds=s) + zone).strftime("%Y-%m-%dT%H:%M:%S-03:30") for s in steps
    ]
    record = read(table(*texts))
    np.testing.assert_array_equal(record.time, steps)
    assert datetime.fromisoformat(record.start) == begin


def test_the_second_layout_is_read_where_the_first_is_not_whole(read):
    head = "time,north_m_s,speed_m_s,direction_deg\n"
    record = read(table(*TEN, head=head, values="9,1.5,270"))
    assert list(record.columns) == ["speed_m_s", "direction_deg"]
    np.testing.assert_array_equal(record["direction_deg"], [270.0] * 3)


def test_the_first_layout_counts_where_both_are_there(read):
    head = "time,speed_m_s,direction_deg,north_m_s,east_m_s\n"
    assert list(read(table(*TEN, head=head, values="1,2,0.5,0.25")).columns) == list(LAYOUTS[0])


def test_without_times_rows_are_counted(read):
    record = read("x,north_m_s,east_m_s\na,1,2\nb,3,4\n", time=False)
    np.testing.assert_array_equal(record.time, [0, 1])
    np.testing.assert_array_equal(record["east_m_s"], [2, 4])
    assert record.start == ""


def test_what_was_read_cannot_be_changed(read):
    record = read(table(*TEN))
    for values in (record.time, record["north_m_s"], record.rows):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 1


def test_a_gap_is_named_with_its_rows(read):
    record = read(table(0, 10, 20, 81, 82))
    record.check_gaps(61.0)
    with pytest.raises(
        ParameterError,
        match=r"^own_file = 'my\.csv': row 5: 61 s after row 4; gaps may be 60 s long$",
    ):
        record.check_gaps(60.0)


def test_a_sample_is_refused_by_its_row(read):
    error = read(table(*TEN)).refuse(1, "too fast")
    assert str(error) == "own_file = 'my.csv': row 3: too fast"


# ---------------------------------------------------------------- bad ones


def cell(value, row=3):
    """Return a table with one odd value of north_m_s."""
    lines = table(*TEN).splitlines()
    lines[row - 1] = lines[row - 1].replace("0.5", value, 1)
    return "\n".join(lines) + "\n"


BAD = {
    "empty": ("", "must not be empty"),
    "blanks": (" \n\n", "must not be empty"),
    "commas": (",,\n,,\n", "must not be empty"),
    "zero bytes": (b"PK\x03\x04\x00\x00", "must be text; it holds zero bytes"),
    "UTF-16": (table(*TEN).encode("utf-16"), "must be text in UTF-8; byte 0"),
    "Latin-1": (table(*TEN, head=HEAD[:-1] + ",ä\n").encode("latin-1"), "must be text in UTF-8"),
    "a page": ("<html>\n<body>404</body>\n</html>\n", "must have the columns time, north_m_s"),
    "header only": (HEAD, "must have at least 2 rows below its header, has 0"),
    "one row": (table(0), "must have at least 2 rows below its header, has 1"),
    "no header": ("0,1,2\n1,1,2\n", "must have the columns time, north_m_s, east_m_s or time, sp"),
    "a line above the header": ("# my buoy\n" + table(*TEN), "row 2: must have 1 values as the"),
    "an empty line above": ("\n" + table(*TEN), "row 1: must hold the names of the columns"),
    "a line of units": (
        table("s", *TEN).replace("0.5", "m/s", 1),
        "row 2: north_m_s = 'm/s': must be a finite number",
    ),
    "no time": ("north_m_s,east_m_s\n1,2\n3,4\n", "must have the columns time, north_m_s, ea"),
    "one component": ("time,north_m_s\n0,1\n1,2\n", "must have the columns time, north_m_s, ea"),
    "capitals": (table(*TEN).replace("n", "N", 1), "has 'time', 'North_m_s', 'east_m_s'"),
    "named twice": (
        table(*TEN, head="time,north_m_s,north_m_s,east_m_s\n", values="1,1,2"),
        "must name each column once; twice: 'north_m_s'",
    ),
    "semicolons": (table(*TEN).replace(",", ";"), "must be separated by commas, is by ';' or tabs"),
    "semicolons and decimal commas": (
        table(*TEN).replace(",", ";").replace(".", ","),
        "must be separated by commas, is by ';' or tabs",
    ),
    "tabs": (table(*TEN).replace(",", "\t"), "must be separated by commas"),
    "knots": (
        table(*TEN, head="time,speed_kn,direction_deg\n"),
        "column 'speed_kn' must be speed_m_s: multiply by 0.514444",
    ),
    "centimetres": (
        table(*TEN, head="time,north_cm_s,east_cm_s\n"),
        "column 'north_cm_s' must be north_m_s: divide by 100",
    ),
    "radians": (
        table(*TEN, head="time,speed_m_s,direction_rad\n"),
        "column 'direction_rad' must be direction_deg: multiply by 57.29578",
    ),
    "a value more": (
        table(*TEN) + "30,1,2,3\n",
        "row 5: must have 3 values as the header has, has 4",
    ),
    "a value less": (table(*TEN) + "30,1\n", "row 5: east_m_s = '': there is no value"),
    "an empty line between": (table(*TEN) + "\n" + "30,1,2\n", "row 5: "),
    "an empty cell": (cell(""), "row 3: north_m_s = '': there is no value"),
    "nan": (cell("NaN"), "row 3: north_m_s = 'NaN': there is no value"),
    "a dash": (cell("--"), "row 3: north_m_s = '--': there is no value"),
    "infinite": (cell("-inf"), "row 3: north_m_s = '-inf': must be a finite number"),
    "a fill value": (cell("-9999"), "row 3: north_m_s = -9999: must be from -10 to 10; another"),
    "beyond by a little": (cell("10.01", 4), "row 4: north_m_s = 10.01: must be from -10 to 10"),
    "a word": (cell("calm"), "row 3: north_m_s = 'calm': must be a finite number"),
    "yes": (cell("True"), "row 3: north_m_s = 'True': must be a finite number"),
    "a unit": (cell("0.5 m/s"), "row 3: north_m_s = '0.5 m/s': must be a finite number"),
    "decimal comma": (cell('"0,5"'), "row 3: north_m_s = '0,5': must be a number with a decimal"),
    "degrees and minutes": (cell("54°20.5'N"), "must be decimal degrees, south and west < 0"),
    "a hemisphere": (cell("5.5N"), "must be decimal degrees, south and west < 0"),
    "a long word": (cell("x" * 5000), "row 3: north_m_s = 'xxxxxxxx"),
    "an open quotation": (cell('"0.5'), "row 3: a quotation mark is not closed"),
    "a cell of two lines": (
        table(*TEN, head=HEAD[:-1] + ",note\n", values='1,2,"a\nb"'),
        "must have a line for each row; a quoted cell has two",
    ),
    "back in time": (table(0, 10, 9.5), "row 4: time = '9.5': a time before row 3"),
    "twice the same time": (table(0, 10, 10), "row 4: time = '10': the same time as row 3"),
    "the end of summer time": (
        table("2017-10-29T02:50:00", "2017-10-29T02:00:00"),
        "row 3: time = '2017-10-29T02:00:00': a time before row 2",
    ),
    "zones in some rows": (
        table(ZONED[0], ZONED[1], ZONED[2][:-1]),
        "row 4: time = '2017-04-06T12:00:25.5': must have a time zone in all rows or in none",
    ),
    "seconds, then dates": (table(0, ZONED[0]), "row 3: time = '2017-04-06T12:00:00Z': must be li"),
    "dates, then seconds": (table(ZONED[0], 7), "row 3: time = '7': must be like the first one"),
    "no first time": (table("", 1, 2), "row 2: time = '': there is no time"),
    "no later time": (table(*ZONED, "nan"), "row 5: time = 'nan': there is no time"),
    "days first": (
        table("06/04/2017 12:00", "06/04/2017 13:00"),
        "row 2: time = '06/04/2017 12:00'",
    ),
    "time of day": (table("12:00:00", "12:10:00"), "must be seconds or ISO 8601, such as 2017-04"),
    "no such day": (table("2017-02-28T12:00", "2017-02-30T12:00"), "row 3: time = '2017-02-30T12"),
    "a zone in words": (
        table("2017-04-06 12:00 UTC", "2017-04-06 13:00 UTC"),
        "row 2: time = '2017",
    ),
    "days without dashes": (table(20170406, 20170407), "row 2: time = '20170406': is it a date?"),
    "all without dashes": (table(20170406121000, 20170406122000), "row 2: .*: must be in seconds"),
    "milliseconds": (table(1491480000000, 1491480600000), "row 2: .*: must be in seconds"),
    "endless": (table(0, 1e11), "row 3: time = '100000000000.0': must be in seconds"),
    "infinite time": (table(0, "inf"), "row 3: time = 'inf': must be like the first one"),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_table_is_one_line(kind, read):
    text, message = BAD[kind]
    with pytest.raises(ParameterError) as error:
        read(text)
    said = str(error.value)
    assert said.startswith("own_file = '")
    assert all(part in said for part in message.split(".*")), said
    assert "\n" not in said
    assert len(said) < 330


def test_a_row_that_is_named_is_the_line_of_the_file(read):
    # Whatever the row: the value that is said to stand there does.
    for row in (2, 3, 4):
        text = cell("seven", row)
        with pytest.raises(ParameterError, match=rf"row {row}: north_m_s = 'seven'"):
            read(text)
        assert "seven" in text.splitlines()[row - 1]


def test_fewest_rows_can_be_asked_for(read):
    with pytest.raises(ParameterError, match="must have at least 4 rows below its header, has 3"):
        read(table(*TEN), least=4)


@pytest.mark.parametrize(
    ("path", "why"),
    [
        ("none.csv", "must be the path of an existing file; there is none"),
        ("", "must be the path of an existing file; is a folder"),
        ("a" * 5000, "File name too long"),
        ("a\0b", "there is none"),
        ("\ud800", "there is none"),
    ],
)
def test_what_is_no_file_is_one_line(path, why, tmp_path):
    for place in (path, str(tmp_path / path)):
        with pytest.raises(ParameterError) as error:
            read_csv("own_file", place, LAYOUTS)
        assert why in str(error.value)
        assert "\n" not in str(error.value)


def test_too_large_a_file_is_not_read(read, monkeypatch):
    monkeypatch.setattr("seanav.records.table.MOST_ROWS", 2)
    with pytest.raises(ParameterError, match="must have at most 2 rows"):
        read(table(*TEN))


def test_a_year_of_minutes_is_read_in_seconds(read):
    count = 200_000
    begin = np.datetime64("2017-01-01T00:00:00")
    stamps = np.datetime_as_string(begin + 60 * np.arange(count).astype("timedelta64[s]"))
    started = time.process_time()
    record = read(table(*stamps))
    assert time.process_time() - started < 5.0
    assert record.span == 60.0 * (count - 1)
    assert math.isclose(record["north_m_s"].sum(), 0.5 * count)


ODD = ["0", "1.5", "-3", "7", "", " ", "nan", "inf", '"', '""', '"a,b"', "'", "x", "1e400"]
ODD += ["2017-04-06", "2017-04-06T12:00:00Z", "2017-04-06T12:00:01+25:99", "9" * 50]
ODD += ["\t", "\r", "\n", "é", "\ufeff"]
CELLS = st.sampled_from(ODD)
LINES = st.lists(st.lists(CELLS, max_size=4).map(",".join), max_size=5).map("\n".join)


@seed(0)
@settings(max_examples=500, database=None, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    st.tuples(st.sampled_from(["", HEAD, "time,speed_m_s,direction_deg\r\n"]), LINES | st.text())
)
def test_any_text_is_read_or_refused_in_one_line(read, parts):
    refusal = ""
    try:
        record = read("".join(parts).encode("utf-8", "surrogatepass"))
    except ParameterError as error:
        refusal = str(error)
    assert "\n" not in refusal
    assert len(refusal) < 500
    if not refusal:
        assert (np.diff(record.time) > 0).all()
        assert all(np.isfinite(values).all() for values in record.columns.values())
