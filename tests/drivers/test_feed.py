"""What all feeds have in common: corrections of headings, pressure to depth, the tare, quality, dates on the wire."""

from __future__ import annotations

import math
from collections.abc import Iterable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.schema import Config, Feed, Site
from drivers.decoders import decoders_for, feed_decoder, heed
from drivers.deviation import Deviation
from drivers.hydrostatics import depth_m, surface_of
from drivers.nmea_lines import xor
from drivers.quality import JumpGate, Opinion, Tally, worst
from drivers.readings import Altitude, Depth, Heading, is_usable
from drivers.records import Event
from drivers.wire import Arrivals
from tests.drivers.feedkit import CUTS, assert_any_cut_is_the_same, opinions, plain, run

NETWORK = "socket://peer:1"


def line(body: str) -> bytes:
    return f"${body}*{xor(body.encode()):02X}\r\n".encode()


def every_second(bodies: Iterable[str]) -> list[tuple[int, bytes]]:
    return [(second * 1_000_000_000, line(body)) for second, body in enumerate(bodies)]


def headings(feed: Feed, *bodies: str, site: Site | None = None) -> list[float]:
    return [plain(each)[1] for each in run(feed, every_second(bodies), site)[0]]


@pytest.mark.parametrize(
    ("heading", "added"),
    [(0, 1.2), (45, 0.3), (22.5, 0.75), (200, -2.0), (280, -0.4), (320, 0.4), (359.9, 1.198), (360, 1.2), (-40, 0.4)],
)
def test_deviation_is_interpolated_on_the_circle(heading: float, added: float) -> None:
    table = Deviation([(200, -2.0), (0, 1.2), (45, 0.3)])
    assert table.at(heading) == pytest.approx(added)


def test_deviation_tables_of_no_and_one_heading() -> None:
    assert Deviation([]).at(77) == 0.0
    assert {Deviation([(90, 1.5)]).at(heading) for heading in (0, 90, 359)} == {1.5}


def test_deviation_mount_and_declination_are_applied_once_each() -> None:
    feed = Feed(port=NETWORK, deviation_deg=((100.0, 2.0), (280.0, -2.0)), mount_deg=10.0)
    site = Site(declination_deg=3.9)
    assert headings(feed, "HCHDM,100.0,M", "HEHDT,100.0,T", "HCHDM,10.0,M", site=site) == [95.9, 90.0, 3.9]
    assert headings(feed.model_copy(update={"heading_reference": "true"}), "HCHDM,100.0,M", site=site) == [90.0]
    assert headings(feed.model_copy(update={"heading_reference": "magnetic"}), "HEHDT,100.0,T", site=site) == [95.9]


def test_a_variation_in_a_sentence_may_be_left_alone() -> None:
    feed = Feed(port=NETWORK, variation="site")
    assert headings(feed, "HCHDG,100.0,,,10.0,E", site=Site(declination_deg=3.9)) == [103.9]


def test_of_two_talkers_one_may_be_chosen() -> None:
    feed = Feed(port=NETWORK, talker="HC")
    readings, counters = run(feed, every_second(["HCHDM,100.0,M", "HEHDM,200.0,M", "PTNTHPR,101.0,N,1.0,N,1.0,N"]))
    assert [plain(each)[1] for each in readings] == [100.0, 101.0]
    assert counters.frames == {"HDM": 1, "other": 1, "PTNTHPR": 1}


@pytest.mark.parametrize(
    ("unit", "body", "heading"),
    [
        ("bam16", "PTNTHPR,14223,N,169,N,-43,N", 78.129272),
        ("mil", "PTNTHPR,1600,N,10,N,-10,N", 90.0),
        ("mil", "C1600P0.2R-18.3", 90.0),
        ("deg", "PTNTHTM,85,N,1,N,0,N,75,2618", 85.0),
        ("bam16", "PTNTHTM,16384.0,N,1,N,0,N,75,2618", 90.0),
    ],
)
def test_units_of_angles(unit: str, body: str, heading: float) -> None:
    assert headings(Feed.model_validate({"port": NETWORK, "angle_unit": unit}), body) == [heading]


def test_names_of_transducers() -> None:
    feed = Feed(port=NETWORK, xdr_depth_names=("Tiefe",), xdr_pressure_names=("PRESS",), surface_mbar=1000.0)
    bodies = ["YXXDR,D,1.5,M,TIEFE", "YXXDR,D,1.5,M,DEPTH", "YXXDR,P,1.1,B,PRESS", "YXXDR,P,110000,P,Press"]
    ten_m = round(100 * 100 / (997 * 9.80665), 6)
    assert headings(feed, *bodies, "WIXDR,P,1.0090,B,STNP") == [1.5, ten_m, ten_m]


@pytest.mark.parametrize(
    ("body", "quality", "reason"),
    [
        ("PTNTHPR,85.9,N,-0.9,N,0.8,N", "good", ""),
        ("PTNTHPR,85.9,O,-0.9,N,0.8,N", "suspect", "the compass warns: field high (O)"),
        ("PTNTHTM,71.3,M,-0.4,N,-1.4,N,75.9,2618", "suspect", "the compass warns: field low (M)"),
        ("PTNTHPR,85.9,C,-0.9,N,0.8,N", "bad", "the compass asks to be calibrated (C)"),
        ("PTNTHPR,85.9,L,-0.9,N,0.8,N", "bad", "compass alarm: field low (L)"),
        ("PTNTHPR,85.9,P,-0.9,N,0.8,N", "bad", "compass alarm: field high (P)"),
        ("PTNTHPR,85.9,V,-0.9,N,0.8,N", "bad", "compass alarm: voltage (V)"),
        ("C328.3P28.4R-12.4X55.11Y12.33Z-18.43T22.3E001", "suspect", "the compass reports error word E001"),
        ("HETHS,274.07,E", "suspect", "estimated by the compass (mode E)"),
    ],
)
def test_what_a_compass_says_of_itself(body: str, quality: str, reason: str) -> None:
    readings, _ = run(Feed(port=NETWORK), [(0, line(body))])
    assert opinions(readings) == [(quality, reason)]
    assert is_usable(readings[0]) is (quality != "bad")


def test_a_field_that_is_not_the_earth_s_makes_headings_suspect() -> None:
    feed = Feed(port=NETWORK, field_strength=2618.0, field_tolerance_pct=10.0)
    bodies = [f"PTNTHTM,71.3,N,-0.4,N,-1.4,N,75.9,{strength}" for strength in (2618, 2879, 2881, 2355, 2618)]
    readings, _ = run(feed, every_second(bodies))
    assert [quality for quality, _ in opinions(readings)] == ["good", "good", "suspect", "suspect", "good"]
    assert opinions(readings)[2][1] == "magnetic field 2881, undisturbed 2618"
    pni = [(0, line("C328.3P28.4R-12.4X30.0Y0.0Z-40.0T22.3"))]
    assert opinions(run(feed.model_copy(update={"field_strength": 44.8}), pni)[0])[0][0] == "suspect"
    assert opinions(run(feed.model_copy(update={"field_strength": 50.0}), pni)[0])[0][0] == "good"


def test_what_is_taken_without_a_checksum_is_suspect() -> None:
    feed = Feed(port=NETWORK, checksum="warn")
    data = b"$HCHDM,100.0,M\r\n$HCHDM,100.0,M*00\r\n" + line("HCHDM,100.0,M")
    assert opinions(run(feed, [(0, data)])[0]) == [
        ("suspect", "no checksum"),
        ("suspect", "wrong checksum"),
        ("good", ""),
    ]


def test_a_single_jump_is_bad_and_one_that_stays_is_believed() -> None:
    feed = Feed(port=NETWORK, max_turn_deg_s=30.0, provides=("heading",))
    turned = [10, 20, 200, 40, 350, 200, 201, 202, 203, 10, 11, 230]
    readings, _ = run(feed, every_second(f"HCHDM,{heading:.1f},M" for heading in turned))
    qualities = [quality for quality, _ in opinions(readings)]
    assert qualities == ["good", "good", "bad", "good", "bad", "bad", "bad", "suspect", "good", "bad", "bad", "good"]
    assert opinions(readings)[2][1] == "a jump of 180.0 degrees"
    assert opinions(readings)[7][1] == "a jump of 162.0 degrees that stayed"
    assert [plain(each)[1] for each in readings] == turned  # the value is kept whatever it is worth


def test_depths_that_jump_and_what_a_vehicle_can_do() -> None:
    feed = Feed(port=NETWORK, max_dive_m_s=2.0)
    depths = [0.0, 2.0, 4.4, 40.0, 6.0]
    readings, _ = run(feed, every_second(f"VRDPT,{depth:.1f},0.0" for depth in depths))
    assert [quality for quality, _ in opinions(readings)] == ["good", "good", "good", "bad", "good"]


def test_altitudes_that_jump_and_steps_of_the_floor() -> None:
    feed = Feed(port=NETWORK, provides=("altitude",), dpt="altitude", max_climb_m_s=1.0)
    altitudes = [3.0, 2.5, 4.4, 30.0, 4.0, 12.0, 12.1, 12.0, 12.1]
    readings, _ = run(feed, every_second(f"SDDPT,{altitude:.1f},0.0" for altitude in altitudes))
    qualities = [quality for quality, _ in opinions(readings)]
    assert qualities == ["good", "good", "good", "bad", "good", "bad", "bad", "suspect", "good"]
    assert opinions(readings)[3][1] == "a jump of 25.6 m"


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-1e4, 1e4), max_size=40))
def test_no_series_is_refused_for_ever(values: list[float]) -> None:
    gate = JumpGate(1.0, 0.5, "m")
    for second, value in enumerate(values):
        gate.judge("s", second * 1_000_000_000, value)
    last = [gate.judge("s", (len(values) + i) * 1_000_000_000, 7.0).quality for i in range(4)]
    assert last[-1] == "good"


def test_the_worst_opinion_counts_and_tallies_remember_why() -> None:
    assert worst(Opinion(), Opinion("suspect", "a"), Opinion("bad", "b"), Opinion("bad", "c")) == Opinion("bad", "b")
    tally = Tally()
    for reading in (
        Heading(5, 1.0, "s"),
        Depth(6, 1.0, "s", "suspect", "why"),
        Altitude(7, 1.0, "s", "bad", "no echo"),
    ):
        tally.take(reading)
    assert (tally.counts, tally.last_reason, tally.total) == ({"good": 1, "suspect": 1, "bad": 1}, "no echo", 3)
    assert tally.newest_ns == {"heading": 5, "depth": 6}


@pytest.mark.parametrize(
    ("gauge_dbar", "water", "gravity", "depth"),
    # Two published columns: 1025 kg/m3 and 997 kg/m3 at standard gravity; and 9800 Pa a metre of ArduSub.
    [
        (1, "sea", None, 0.995),
        (10, "sea", None, 9.949),
        (100, "sea", None, 99.485),
        (1, "fresh", None, 1.023),
        (30, "fresh", None, 30.683),
        (100, "fresh", None, 102.278),
        (30, 1000.0, 9.8, 30.612),
        (0, "fresh", None, 0.0),
        (-1, "fresh", None, -1.023),
    ],
)
def test_pressure_becomes_depth(gauge_dbar: float, water: str | float, gravity: float | None, depth: float) -> None:
    site = Site.model_validate({"water": water, "gravity_m_s2": gravity})
    assert depth_m(gauge_dbar * 100, site) == pytest.approx(depth, abs=6e-4)


def test_depths_without_a_tare_are_used_but_suspect() -> None:
    feed = Feed(driver="pressure", port=NETWORK)
    decoder = feed_decoder(feed, Site())
    assert decoder.surface is None
    (reading,) = decoder.push(0, b"\n1113.25\n")
    assert opinions([reading]) == [("suspect", "surface pressure assumed 1013.25 mbar: tare")]
    assert plain(reading)[1] == pytest.approx(1.0228, abs=1e-4)
    assert decoder.surface == surface_of(None)


def test_a_tare_is_taken_from_the_log_and_from_nothing_else() -> None:
    config = Config(feed=(Feed(name="depth", driver="pressure", port=NETWORK, max_dive_m_s=100.0),))
    decoders = decoders_for(config)
    decoder = decoders["depth"]
    decoder.push(0, b"\n")
    before = [each for t in range(5) for each in decoder.push(t * 1_000_000_000, b"990.0\n")]
    assert heed(decoders, Event(0, 0, "tare", {"port": "depth", "surface_mbar": 990.0})) == []
    assert heed(decoders, Event(0, 0, "tare", {"port": "sonar", "surface_mbar": 900.0})) == []
    assert heed(decoders, Event(0, 0, "tare", {"port": "depth", "surface_mbar": "low"})) == []
    (after,) = decoder.push(6_000_000_000, b"1090.0\n")
    assert plain(before[0])[1] == pytest.approx(-23.25 * 100 / (997 * 9.80665), abs=1e-5)
    assert plain(after)[1] == pytest.approx(100 * 100 / (997 * 9.80665), abs=1e-5)
    assert opinions([after]) == [("good", "")]


def test_the_pressure_of_the_last_seconds_is_offered_for_a_tare() -> None:
    decoder = feed_decoder(Feed(driver="pressure", port=NETWORK), Site())
    decoder.push(0, b"\n")
    for second, mbar in enumerate((2000.0, 0.0, 1001.0, 1002.0, 1009.0, 1003.0, 1002.5)):
        decoder.push(second * 1_000_000_000, f"{mbar}\n".encode())
    assert decoder.surface_now(6_000_000_000) == 1002.5
    assert decoder.surface_now(60_000_000_000) is None


def test_a_lost_port_ends_its_message() -> None:
    decoders = decoders_for(Config(feed=(Feed(name="feed", port=NETWORK, checksum="ignore"),)))
    assert decoders["feed"].push(0, b"$HCHDM,1") == []
    heed(decoders, Event(0, 0, "port_lost", {"port": "feed"}))
    assert decoders["feed"].push(1, b"23.4,M\r\n") == []
    assert decoders["feed"].counters.skipped_bytes == 8 + 6


def test_depth_offset_and_impossible_depths() -> None:
    feed = Feed(port=NETWORK, depth_offset_m=0.35)
    assert headings(feed, "VRDPT,2.0,0.0") == [2.35]
    deep = Feed(driver="pressure", port=NETWORK, unit="m")
    (reading,) = run(deep, [(0, b"\n99999\n")])[0]
    assert opinions([reading]) == [("bad", "a depth of 99999 m is not possible")]


def test_a_sentence_is_dated_where_its_first_byte_was_sent() -> None:
    # 19 bytes of 2083333 ns each; the chunk was read when the last one had come.
    feed = Feed(port="/dev/compass")
    data = line("HCHDM,123.4,M")
    (reading,) = run(feed, [(1_000_000_000, data)])[0]
    assert reading.t_ns == 1_000_000_000 - 19 * (10_000_000_000 // 4800)
    (reading,) = run(feed.model_copy(update={"latency_ms": 20.0}), [(1_000_000_000, data)])[0]
    assert reading.t_ns == 1_000_000_000 - 19 * (10_000_000_000 // 4800) - 20_000_000


def test_no_byte_is_dated_before_the_chunk_that_was_read_before() -> None:
    arrivals = Arrivals(1000)
    arrivals.note(10_000, 2)
    arrivals.note(12_000, 4)
    assert [arrivals.at(offset) for offset in range(6)] == [8000, 9000, 10_000, 10_000, 10_000, 11_000]
    arrivals.drop(3)
    assert arrivals.at(5) == 11_000


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.sampled_from(
            [
                line("HCHDM,123.4,M"),
                line("SDDPT,2.0,0.0"),
                line("PTNTHTM,71.3,O,-0.4,N,-1.4,N,75.9,2618"),
                b"!AIVDM,1,1,,A,15M67FC000G?ufbE`FepT@3n00Sa,0*5C\r\n",
                b"$HCH",
                b"\r\n",
            ]
        ),
        max_size=8,
    ).map(b"".join),
    CUTS,
)
def test_sentences_in_any_pieces_give_the_same_dates_too(data: bytes, cuts: list[int]) -> None:
    readings = assert_any_cut_is_the_same(Feed(port="/dev/compass"), data, cuts)
    assert all(math.isfinite(plain(each)[1]) for each in readings)


def test_lines_of_other_ships_are_counted_and_skipped() -> None:
    ship = b"!" + line("AIVDM,1,1,,A,15M67FC000G?ufbE`FepT@3n00Sa,0")[1:]
    readings, counters = run(Feed(port=NETWORK), [(0, ship + line("HCHDM,1.0,M") + ship[:20] + line("HCHDM,2.0,M"))])
    assert [plain(each)[1] for each in readings] == [1.0, 2.0]
    assert counters.frames == {"encapsulated": 1, "HDM": 2}
    assert counters.skipped_bytes == 20
