"""Logs of NMEA 0183 sentences: what is read, and every refusal is one line."""

import functools
import operator

import numpy as np
import pytest

from seanav.checks import ParameterError
from seanav.records import read_nmea


def signed(body):
    return f"${body}*{functools.reduce(operator.xor, body.encode()):02X}"


def gga(time="120000.00", lat="2200.600000,S", lon="01756.300000,W", quality="1", talker="GP"):
    return signed(f"{talker}GGA,{time},{lat},{lon},{quality},12,0.7,1.0,M,4.0,M,,")


def rmc(time="120000.00", date="010814", status="A", lat="2200.600000,S", lon="01756.300000,W"):
    return signed(f"GPRMC,{time},{status},{lat},{lon},9.1,215.1,{date},,")


VTG = signed("GPVTG,215.11,T,239.79,M,9.1,N,16.9,K,A")
HDT = signed("GPHDT,218.26,T")


@pytest.fixture
def read(tmp_path):
    def written(*lines, end="\n", **options):
        content = b"".join(x if isinstance(x, bytes) else x.encode() + end.encode() for x in lines)
        (tmp_path / "own.nmea").write_bytes(content)
        return read_nmea("track_file", str(tmp_path / "own.nmea"), **options)

    yield written
    assert [path.name for path in tmp_path.iterdir()] == ["own.nmea"]  # nothing is written


def test_degrees_and_minutes_become_signed_degrees(read):
    record = read(gga(), VTG, HDT, gga("120001.50", "0030.000000,N", "17930.000000,E"))
    assert record["latitude_deg"] == pytest.approx([-(22 + 0.6 / 60), 0.5], abs=1e-12)
    assert record["longitude_deg"] == pytest.approx([-(17 + 56.3 / 60), 179.5], abs=1e-12)
    assert record.time.tolist() == [0.0, 1.5]
    assert record.rows.tolist() == [1, 4]
    assert record.start == ""
    assert (record.name, record.source) == ("track_file", "own.nmea")


def test_both_sentences_of_one_time_are_one_fix_and_the_date_is_known(read):
    record = read(gga(), rmc(), gga("120001.00"), rmc("120001.00"), gga("120001.00", talker="GN"))
    assert record.time.tolist() == [0.0, 1.0]
    assert record.start == "2014-08-01T12:00:00+00:00"


def test_midnight_is_no_way_back(read):
    record = read(gga("235959.00"), gga("000001.00"), rmc("000002.00", date="020814"))
    assert record.time.tolist() == [0.0, 2.0, 3.0]
    assert record.start == "2014-08-01T23:59:59+00:00"


@pytest.mark.parametrize(
    "line",
    [
        "",
        VTG,
        "!AIVDM,1,1,,A,14eG;o@034o8sd<L9i:a;WF>062D,0*7D",
        signed("PSXN,23,0.02,-0.76,38.26,0.05"),
        signed("XXQQQ,1,2"),
        gga("120000.50", quality="0"),
        rmc("120000.50", status="V"),
        signed("GPGGA,120000.50,,,,,0,00,,,M,,M,,"),
    ],
)
def test_what_is_no_fix_is_left_out(line, read):
    assert read(gga(), line, gga("120001.00")).time.tolist() == [0.0, 1.0]


def test_what_stands_before_a_sentence_and_a_cut_last_line_are_left_out(read):
    record = read(
        f"2014-08-01T12:00:00Z {gga()}", gga("120001.00"), gga("120002.00")[:30], end="\r\n"
    )
    assert record.time.tolist() == [0.0, 1.0]
    assert record.rows.tolist() == [1, 2]


BAD = {
    "damaged": ([gga(), gga("120001.00").replace("2200", "2201"), gga("120002.00")], "row 2"),
    "wrong checksum": ([gga()[:-2] + "00", gga("120001.00")], "row 1: its checksum"),
    "no sentence": (["time,latitude", gga(), gga("120001.00")], "row 1: must be an NMEA"),
    "a table": (["120000,1,2", "120001,1,2"], "row 1: must be an NMEA"),
    "only a dollar": (["$", gga()], "row 1: must be an NMEA"),
    "backward": ([gga("120001.00"), gga("120000.00")], "row 2: time 43200 s"),
    "backward by an hour": ([gga("120001.00"), gga("110000.00")], "lies before"),
    "no fix": ([VTG, HDT], "at least 2 valid fixes"),
    "one fix": ([gga(), VTG], "at least 2 valid fixes (GGA or RMC), has 1"),
    "only invalid ones": ([gga(quality="0"), rmc("120001.00", status="V")], "has 0"),
    "no latitude": ([gga(lat=","), gga("120001.00")], "row 1: GGA must hold"),
    "no longitude": ([gga(), gga("120001.00", lon=",")], "row 2: GGA must hold"),
    "no hemisphere": ([gga(lat="2200.6,"), gga("120001.00")], "row 1: GGA must hold"),
    "hemisphere of the other": ([gga(lat="2200.6,E"), gga("120001.00")], "row 1: GGA must hold"),
    "no time": ([gga(""), gga("120001.00")], "row 1: GGA must hold"),
    "no such hour": ([gga("250000.00"), gga("120001.00")], "row 1: GGA must hold"),
    "letters": ([gga(lat="22x0.6,S"), gga("120001.00")], "row 1: GGA must hold"),
    "off the earth": ([gga(lat="9500.6,S"), gga("120001.00")], "row 1: position -95.01"),
    "quality in words": ([gga(quality="good"), gga("120001.00")], "row 1: GGA must hold"),
    "an RMC without a place": ([rmc(lat=","), gga("120001.00")], "row 1: RMC must hold"),
    "empty": ([""], "must not be empty"),
    "no text": ([b"\xff\xfe$GPGGA\n"], "must be text"),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_log_is_one_line(kind, read):
    lines, why = BAD[kind]
    with pytest.raises(ParameterError) as error:
        read(*lines)
    said = str(error.value)
    assert why in said
    assert "\n" not in said
    assert said.startswith("track_file = ")


def test_positions_are_those_of_the_sentence_for_any_place(read):
    for latitude, longitude in ((-89.99, 0.001), (0.0001, -179.999), (51.5, 179.5)):
        a, b = abs(latitude), abs(longitude)
        lat = f"{int(a):02d}{60 * (a % 1):09.6f},{'N' if latitude > 0 else 'S'}"
        lon = f"{int(b):03d}{60 * (b % 1):09.6f},{'E' if longitude > 0 else 'W'}"
        record = read(gga(lat=lat, lon=lon), gga("120001.00", lat=lat, lon=lon))
        assert np.allclose(record["latitude_deg"], latitude, atol=2e-8, rtol=0)
        assert np.allclose(record["longitude_deg"], longitude, atol=2e-8, rtol=0)
