"""Sentences of real instruments and of manuals become readings; broken ones are counted and never read as data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Literal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.schema import Config, Feed, Quantity, Site
from drivers.counters import Counters
from drivers.decoders import decoders_for, feed_decoder
from drivers.nmea_lines import LONGEST, SentenceReader, xor
from drivers.readings import Heading, Reading
from tests.drivers.feedkit import plain

ALL: tuple[Quantity, ...] = ("heading", "depth", "altitude")


def feed(
    checksum: Literal["require", "warn", "ignore"] = "require",
    dpt: Literal["vehicle_depth", "altitude"] = "vehicle_depth",
    provides: tuple[Quantity, ...] = ALL,
) -> Feed:
    return Feed(port="socket://x", checksum=checksum, dpt=dpt, provides=provides)


def run(
    pieces: Sequence[tuple[int, bytes]], using: Feed | None = None, declination: float = 0.0
) -> tuple[list[Reading], Counters]:
    decoder = feed_decoder(using or feed(), Site(declination_deg=declination))
    readings = [reading for t_ns, data in pieces for reading in decoder.push(t_ns, data)]
    readings += decoder.finish()
    return readings, decoder.counters


def line(body: str) -> bytes:
    return f"${body}*{xor(body.encode()):02X}\r\n".encode()


def said(body: str, using: Feed | None = None, declination: float = 0.0) -> list[tuple[str, float]]:
    """Kind and value (degrees, metres) of each reading of one sentence."""
    readings, _ = run([(0, line(body))], using, declination)
    return [plain(reading) for reading in readings]


@pytest.mark.parametrize(
    ("body", "values"),
    [
        ("SDDBT,8.1,f,2.4,M,1.3,F", [("depth", 2.4)]),
        ("SDDBT,10,f,,M,,F", [("depth", 3.048)]),
        ("SDDBT,,f,,M,2,F", [("depth", 3.6576)]),
        ("IIDBT,,f,,M,,F", []),
        ("SDDPT,2.4,0.3", [("depth", 2.7)]),
        ("SDDPT,2.4,-0.5", [("depth", 2.4)]),
        ("SDDPT,5.3,0.4,", [("depth", 5.7)]),
        ("SDDPT,2.4", [("depth", 2.4)]),
        ("SDDPT,,", []),
        ("VRDPT,3.2,0.0", [("depth", 3.2)]),
        ("SDDBS,8.1,f,2.4,M,1.3,F", [("depth", 2.4)]),
        ("SDDBK,8.1,f,2.4,M,1.3,F", [("depth", 2.4)]),
        ("YXMTW,17.5,C", []),
        ("YXXDR,D,12.34,M,DEPTH", [("depth", 12.34)]),
        ("YXXDR,A,0.3,D,PTCH,D,1.5,M,DEPTH", [("depth", 1.5)]),
        ("YXXDR,P,1.2345,B,DEPTH", []),
        ("WIXDR,P,1.0090,B,STNP", []),
        ("YXXDR,D,,M,DEPTH", []),
        ("HCHDG,98.3,0.0,E,12.6,W", [("heading", 85.7)]),
        ("HCHDG,98.3,1.5,W,3.9,E", [("heading", 100.7)]),
        ("HCHDG,1.0,,,2.0,W", [("heading", 359.0)]),
        ("SDHDG,229.8,,,1.3,E", [("heading", 231.1)]),
        ("HCHDG,,,,,", []),
        ("HCHDM,123.4,M", [("heading", 123.4)]),
        ("HCHDM,,M", []),
        ("HCHDM,360.0,M", [("heading", 0.0)]),
        ("HEHDT,274.07,T", [("heading", 274.07)]),
        ("HCHDT,20.5,T", [("heading", 20.5)]),
        ("HETHS,274.07,A", [("heading", 274.07)]),
        ("HETHS,274.07,V", []),
        ("VWVHW,,T,338.9,M,0.0,N,0.0,K", [("heading", 338.9)]),
        ("VWVHW,10,T,338.9,M,0.0,N,0.0,K", [("heading", 10.0)]),
        ("PTNTHPR,354.9,N,5.2,N,0.2,N", [("heading", 354.9)]),
        ("PTNTHPR,85.9,O,-0.9,N,0.8,N", [("heading", 85.9)]),
        ("PTNTHPR,85.9,P,-0.9,N,0.8,N", [("heading", 85.9)]),
        ("PTNTHTM,71.3,N,-0.4,N,-1.4,N,75.9,2618", [("heading", 71.3)]),
        ("PTNTHTM,14223,N,169,N,-43,N,13641,2454", [("heading", 78.129272)]),
        ("PTNTHTM,169,N,12,N,-43,N,13641,2454", [("heading", 0.928345)]),
        ("PTNTHTM,,N,-2.4,N,10.7,N,59.1,3844", []),
        ("PASHR,085335.000,224.19,T,-01.26,+00.83,+00.00,0.101,0.113,0.267,1,0", [("heading", 224.19)]),
        ("PASHR,POS,2,9,123456.00,5000.0,N,1000.0,E,1.2,0.0,90.0,1.0", []),
        ("PSXN,23,0.30,-0.97,298.57,0.13", [("heading", 298.57)]),
        ("PSXN,20,1,1,1,1", []),
        ("PRDID,-1.31,7.81,47.31", [("heading", 47.31)]),
        ("OHPR,328.3,28.4,-12.4,33.2", [("heading", 328.3)]),
        ("OHPR,78.8,-0.5,-1.4,-0.009,-0.025,0.976", [("heading", 78.8)]),
        ("C320.5P0.2R-18.3T19.0", [("heading", 320.5)]),
        ("C328.3P28.4R-12.4T21.1D21.01", [("heading", 328.3), ("depth", 21.01)]),
        ("C328.3P28.4R-12.4X55.11Y12.33Z-18.43T22.3E001", [("heading", 328.3)]),
        ("PVRND,06/21/2012,10:11:12.3,3.2,123.4,1.0.-2.0", [("depth", 3.2), ("heading", 123.4)]),
        ("GPGLL,5119.881,N,00125.169,E,164326,A,D", []),
        ("", []),
    ],
)
def test_sentences(body: str, values: list[tuple[str, float]]) -> None:
    assert sorted(said(body)) == sorted(values)


@pytest.mark.parametrize("body", ["SDDPT,2.4,0.3", "SDDBT,8.1,f,2.4,M,1.3,F", "SDDBK,,f,2.4,M,,F"])
def test_depth_below_a_transducer_may_be_an_altitude(body: str) -> None:
    assert said(body, feed(dpt="altitude")) == [("altitude", 2.4)]
    assert said(body, feed(dpt="altitude", provides=("heading", "depth"))) == []
    assert said("YXXDR,D,12.34,M,DEPTH", feed(dpt="altitude")) == [("depth", 12.34)]


def test_only_what_the_feed_provides() -> None:
    body = "C328.3P28.4R-12.4T21.1D21.01"
    assert said(body, feed(provides=("depth",))) == [("depth", 21.01)]
    assert said(body, feed(provides=())) == []


@pytest.mark.parametrize(
    ("body", "heading"),
    [
        ("HCHDM,358.0,M", 1.9),
        ("HCHDG,100.0,,,,", 103.9),
        ("HCHDG,100.0,0.0,E,0.0,E", 103.9),
        ("HCHDG,100.0,,,10.0,E", 110.0),
        ("HEHDT,100.0,T", 100.0),
        ("PTNTHTM,71.3,N,-0.4,N,-1.4,N,75.9,2618", 71.3),
        ("PTNTHPR,354.9,N,5.2,N,0.2,N", 358.8),
        ("C320.5P0.2R-18.3T19.0", 324.4),
        ("VWVHW,10,T,6,M,,N,,K", 10.0),
        ("VWVHW,,T,6,M,,N,,K", 9.9),
    ],
)
def test_declination_is_added_once_and_to_magnetic_headings_only(body: str, heading: float) -> None:
    assert said(body, declination=3.9) == [("heading", heading)]


def test_a_variation_holds_for_the_whole_feed() -> None:
    lines = line("HCHDM,100.0,M") + line("HCHDG,100.0,,,10.0,W") + line("HCHDM,100.0,M") + line("HEHDT,90.0,T")
    readings, _ = run([(0, lines)], declination=3.9)
    assert [plain(each)[1] for each in readings] == [103.9, 90.0, 90.0, 90.0]
    assert [each.source for each in readings if isinstance(each, Heading)][:2] == ["feed:HDM", "feed:HDG"]


def test_a_sentence_is_dated_at_its_first_byte() -> None:
    data = b"\r\n" + line("SDDPT,1.0,0.0")
    readings, _ = run([(i * 10, data[i : i + 1]) for i in range(len(data))])
    assert [each.t_ns for each in readings] == [20]


@pytest.mark.parametrize(
    ("data", "rule", "count", "bad"),
    [
        (b"$HCHDM,123.4,M*2d\r\n", "require", 1, {}),
        (b"$HCHDM,123.4,M*2D \n", "require", 1, {}),
        (b"$HCHDM,123.4,M*2E\r\n", "require", 0, {"checksum": 1}),
        (b"$HCHDM,123.4,M*2E\r\n", "warn", 1, {"checksum": 1}),
        (b"$HCHDM,123.4,M*2E\r\n", "ignore", 1, {}),
        (b"$HCHDM,123.4,M*2\r\n", "require", 0, {"checksum": 1}),
        (b"$HCHDM,123.4,M\r\n", "require", 0, {"no_checksum": 1}),
        (b"$HCHDM,123.4,M*\r\n", "warn", 1, {"no_checksum": 1}),
        (b"$HCHDM,123.4,M\r\n", "ignore", 1, {}),
        (b"$ROV,72.4,-1.0,-3.7,341.6,0.0,61.5,2.2,*\r\n", "require", 2, {}),
        (b"$ROV,72.4,-1.0,-3.7,341.6,0.0,61.5,2.2,*00\r\n", "require", 0, {"checksum": 1}),
        (b"$\x00PH\x00M,0 8. ,M*3E\r\n", "ignore", 0, {"garbled": 1}),
        (b"$HCHDM,1e2,M\r\n$HCHDM,nan,M\r\n$HCHDM,6399,M\r\n", "ignore", 0, {"field": 3}),
        (b"$HCHDG,98.3,1.5,,3.9,E\n$SDDPT,-50,\n$PTNTHPR,85,N,1,N,0,N\n", "ignore", 0, {"field": 3}),
    ],
)
def test_checksums(data: bytes, rule: Literal["require", "warn", "ignore"], count: int, bad: dict[str, int]) -> None:
    readings, counters = run([(0, data)], feed(checksum=rule))
    assert (len(readings), dict(counters.bad)) == (count, bad)


def test_garbage_between_sentences() -> None:
    good = line("HCHDM,123.4,M")
    data = b"M,0.0,N,,K*7B\r\n$" + good + good.strip() + good + b"$HCHDM,12" + good + good.strip()
    readings, counters = run([(0, data)])
    assert [plain(each)[1] for each in readings] == [123.4] * 5
    assert (counters.skipped_bytes, dict(counters.frames), dict(counters.bad)) == (13 + 1 + 9, {"HDM": 5}, {})
    assert run([(0, b"$HCHDM,123.4,M")], feed(checksum="ignore"))[0] == []


def test_a_line_without_end_is_dropped() -> None:
    reader = SentenceReader()
    for _ in range(100):
        assert reader.push(0, b"$" + b"9" * 50) == [] or reader.push(0, b"9" * 70) == []
        assert reader._line is None or len(reader._line) <= LONGEST
    endless, counters = run([(0, b"$" + b"7" * 1000 + b"\r\n" + line("HCHDM,1.0,M"))])
    assert (len(endless), counters.skipped_bytes, counters.bad) == (1, 1001, {"too_long": 1})


@pytest.mark.parametrize(
    ("name", "kinds", "first"),
    [
        ("gpsd_sounder.nmea", {"DBT"}, ("depth", 2.3)),
        ("gpsd_humminbird-M37.nmea", {"DPT", "other"}, ("depth", 2.2)),
        ("gpsd_pypilot.nmea", {"HDM", "XDR", "other"}, ("heading", 218.634)),
        ("gpsd_tnt-revolution.nmea", {"PTNTHTM", "XDR"}, ("heading", 78.129272)),
        ("gpsd_bundg_zeus_9_filtered.nmea", {"DBT", "DPT", "HDG", "VHW", "XDR", "other"}, ("depth", 5.7)),
    ],
)
def test_real_instruments(shared_data: Path, name: str, kinds: set[str], first: tuple[str, float]) -> None:
    sentences = [each for each in (shared_data / "feeds" / name).read_bytes().splitlines(True) if each.startswith(b"$")]
    data = b"".join(sentences)
    readings, counters = run([(0, data)])
    assert dict(counters.bad) == {}
    assert sum(counters.frames.values()) == len(sentences)
    assert kinds <= set(counters.frames)
    assert plain(readings[0]) == first
    assert len(readings) >= 7
    assert run([(0, data[i : i + 1]) for i in range(len(data))]) == (readings, counters)


def test_own_vectors(shared_data: Path) -> None:
    lines = (shared_data / "feeds" / "nmea_vectors.txt").read_text().splitlines()
    data = "".join(each.split("\t")[0] + "\r\n" for each in lines if not each.startswith("#"))
    readings, counters = run([(0, data.replace("\\x00", "\0").encode())])
    assert counters.bad == {"checksum": 2, "no_checksum": 1, "garbled": 1}
    # 32 sentences with one value, 4 with two; both depths without or with a wrong sum are left out.
    assert len(readings) == 40


def test_hub_of_a_vehicle(shared_data: Path) -> None:
    rows = (row.split(";") for row in (shared_data / "sonar" / "udp-hub-2017-11-02.csv").read_text().splitlines())
    pieces = [(i, bytes.fromhex(row[3])) for i, row in enumerate(rows) if row[2] == "13102"]
    readings, counters = run(pieces)
    assert counters == Counters({"ROV": 588}, 0, {})
    assert len(readings) == 2 * 588
    assert {plain(each) for each in readings} == {("heading", 72.4), ("heading", 72.3), ("depth", 341.6)}


def test_decoders_of_a_configuration() -> None:
    config = Config(feed=(Feed(name="compass", port="socket://x:1"), Feed(name="sounder")))
    decoders = decoders_for(config)
    assert list(decoders) == ["sonar", "compass", "sounder"]
    (reading,) = decoders["compass"].push(5, line("HCHDM,90.0,M"))
    assert reading == Heading(5, math.pi / 2, "compass:HDM")
    assert decoders["sonar"].push(5, b"xyz") == decoders["sonar"].finish() == []
    assert decoders["sonar"].counters.skipped_bytes == 3


NOISE = st.lists(
    st.sampled_from(
        [b"$", b"*", b"\r", b"\n", b"$SDDPT,1.0,0.0", b"HCHDM,", b"5.5", line("SDDPT,2.0,0.0"), b"\x00", b"\xff"]
    )
    | st.binary(max_size=5),
    max_size=25,
).map(b"".join)


@settings(max_examples=200, deadline=None)
@given(NOISE, st.lists(st.integers(0, 200), max_size=6), st.sampled_from(["require", "warn", "ignore"]))
def test_any_pieces_give_the_same(data: bytes, cuts: list[int], rule: Literal["require", "warn", "ignore"]) -> None:
    edges = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    pieces = [(1, data[a:b]) for a, b in pairwise(edges)]
    whole = run([(1, data)], feed(checksum=rule))
    assert run(pieces, feed(checksum=rule)) == whole
    assert run([(1, data[i : i + 1]) for i in range(len(data))], feed(checksum=rule)) == whole


@settings(max_examples=100, deadline=None)
@given(
    st.text("0123456789.,-+ABCDEHMNPRTVW$", max_size=60),
    st.sampled_from(["HCHDG,", "PTNTHTM,", "YXXDR,", "C1", "PASHR,"]),
)
def test_any_fields_never_raise(text: str, start: str) -> None:
    body = start + text.replace("$", "")
    readings, counters = run([(0, line(body))])
    assert sum(counters.frames.values()) + sum(counters.bad.values()) == 1
    assert all(0 <= each.heading_rad < math.tau for each in readings if isinstance(each, Heading))
