"""Pressure sensors: columns of text and Keller's bus."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.schema import Feed, Site
from drivers.keller import Keller, crc16, initialise, keller_reader, read_channel, read_serial, with_crc
from drivers.polls import Poller
from drivers.pressure import TextReader
from tests.drivers.feedframes import keller_reply, keller_whole_reply
from tests.drivers.feedkit import CUTS, assert_any_cut_is_the_same, opinions, plain, run

TEXT = Feed(driver="pressure", port="/dev/p", surface_mbar=1013.25)
KELLER = TEXT.model_copy(update={"format": "keller"})
M_PER_MBAR = 100 / (997 * 9.80665)


def text(line: str, **knobs: object) -> list[float]:
    readings, _ = run(TEXT.model_copy(update=knobs), [(0, b"\r\n" + line.encode() + b"\r\n")])
    return [plain(each)[1] for each in readings]


@pytest.mark.parametrize(
    ("line", "knobs", "depth_m"),
    [
        ("1113.25", {}, 100 * M_PER_MBAR),
        ("  1113.25 ", {}, 100 * M_PER_MBAR),
        ("0009.996,M", {"unit": "m"}, 9.996),  # Valeport miniIPS, CSV
        ("0009.996,M,0.000", {"unit": "m"}, 9.996),  # its standard line
        ("00/00/00, 00:00:00, 0010.0,0.0,0.00", {"unit": "dbar", "column": 3, "pressure": "gauge"}, 1000 * M_PER_MBAR),
        ("10.351\t21.488\t1506.739", {"unit": "dbar", "pressure": "gauge"}, 1035.1 * M_PER_MBAR),  # uvSVP
        ("10.351 21.488 1506.739", {"unit": "dbar", "pressure": "gauge"}, 1035.1 * M_PER_MBAR),
        ("-0.2;5", {"unit": "kpa", "pressure": "gauge"}, -2 * M_PER_MBAR),
        ("1.11325", {"unit": "bar"}, 100 * M_PER_MBAR),
        ("111325", {"unit": "pa"}, 100 * M_PER_MBAR),
        ("20.0", {"unit": "psi"}, (20 * 68.947573 - 1013.25) * M_PER_MBAR),
        ("10", {"unit": "ft"}, 3.048),
        ("T=17.2,P=1113.25", {}, None),
        ("", {}, None),
        ("1e3", {}, None),
        ("5", {"column": 2}, None),
    ],
)
def test_columns_and_units(line: str, knobs: dict[str, object], depth_m: float | None) -> None:
    assert text(line, **knobs) == ([] if depth_m is None else [pytest.approx(depth_m, abs=1e-5)])


def test_a_line_counts_only_between_two_ends() -> None:
    # 113.25 may be the end of 1113.25, and 11 its beginning.
    readings, counters = run(TEXT, [(0, b"113.25\r\n1113.25\r\n11")])
    assert [plain(each)[1] for each in readings] == pytest.approx([100 * M_PER_MBAR], abs=1e-5)
    assert (counters.frames, counters.skipped_bytes) == ({"line": 1}, 6 + 2)
    reader = TextReader(TEXT)
    assert len(reader.push(0, b"\n1000.0\n10")) == 1
    reader.finish()  # the port was lost
    assert reader.push(0, b"13.0\n") == []
    assert len(reader.push(0, b"1013.0\n")) == 1


def test_endless_lines_and_lines_without_numbers_are_counted() -> None:
    reader = TextReader(TEXT)
    for _ in range(50):
        reader.push(0, b"\n" + b"7" * 300)
        assert len(reader._line or b"") <= 256
    reader.push(0, b"\nready\n")
    assert reader.counters.bad == {"too_long": 50, "field": 1}


def vectors(shared_data: Path) -> dict[str, bytes]:
    lines = (shared_data / "feeds" / "keller_synthetic.txt").read_text().splitlines()[1:]
    return {line[:53].strip(): bytes.fromhex(line[53:]) for line in lines}


@pytest.mark.parametrize(
    ("index", "frames", "bad", "mbar"),
    [
        (0, {"request": 1}, {}, None),  # initialise
        (1, {"other": 1}, {}, None),  # its reply
        (2, {"request": 1}, {}, None),  # read P1
        (3, {"reply": 1}, {}, 1313.2),
        (4, {"request": 1}, {}, None),  # read the temperature
        (5, {"reply": 1}, {}, 19340.0),  # 19.34, taken as bar: nothing in a reply tells what it is
        (6, {"request": 1}, {}, None),
        (7, {"reply": 1}, {}, 300.0),
        (8, {"request": 1}, {}, None),  # set zero: never sent, but heard
        (9, {}, {"exception_32": 1}, None),
        (10, {}, {"exception_2": 1}, None),
    ],
)
def test_frames_on_a_keller_bus(
    shared_data: Path, index: int, frames: dict[str, int], bad: dict[str, int], mbar: float | None
) -> None:
    found = list(vectors(shared_data).values())
    assert len(found) == 11
    gauge = KELLER.model_copy(update={"pressure": "gauge"})
    readings, counters = run(gauge, [(0, found[index])])
    assert (counters.frames, counters.bad, counters.skipped_bytes) == (frames, bad, 0)
    wanted = [] if mbar is None else [pytest.approx(mbar * M_PER_MBAR, abs=1e-3)]
    assert [plain(each)[1] for each in readings] == wanted


def test_a_whole_keller_bus_tells_only_the_channel_that_was_asked_for(shared_data: Path) -> None:
    data = b"".join(vectors(shared_data).values())
    readings, counters = run(KELLER, [(0, data)])
    assert [plain(each)[1] for each in readings] == pytest.approx([(1313.2 - 1013.25) * M_PER_MBAR], abs=1e-3)
    assert counters.frames == {"request": 5, "other": 1, "reply": 1, "other_sensor": 2}
    assert counters.skipped_bytes == 0


def test_checksums_and_requests_are_those_of_the_manual() -> None:
    assert initialise(250) == bytes.fromhex("fa300443")
    assert read_channel(250, 1) == bytes.fromhex("fa4901a1a7")
    assert crc16(b"123456789") == 0x4B37  # the catalogue's check value of CRC-16/MODBUS


def test_what_a_keller_sensor_says_of_itself() -> None:
    data = keller_reply(1.2) + keller_reply(1.2, 0b10) + keller_reply(1.2, 0x80) + keller_reply(1.2, 0b1000)
    readings, _ = run(KELLER, [(0, data + keller_reply(float("nan")))])
    assert [quality for quality, _ in opinions(readings)] == ["good", "bad", "suspect", "good"]
    other = KELLER.model_copy(update={"address": 3})
    assert run(other, [(0, keller_reply(1.2, address=2))])[1].frames == {"other_sensor": 1}


def test_whole_pascals_and_the_serial_number() -> None:
    asked = read_channel(250, 1, whole=True)
    assert asked == with_crc(bytes((250, 74, 1)))
    data = asked + keller_whole_reply(131_325) + keller_whole_reply(-50) + keller_whole_reply(120_000, 0b10)
    readings, counters = run(KELLER, [(0, data)])
    assert counters.frames == {"request": 1, "reply": 3}
    assert plain(readings[0])[1] == pytest.approx(300 * M_PER_MBAR, abs=1e-5)
    assert [quality for quality, _ in opinions(readings)] == ["good", "bad", "bad"]
    # A temperature that another program asked for on the line is not taken for a pressure.
    assert run(KELLER, [(0, read_channel(250, 4, whole=True) + keller_whole_reply(1934))])[0] == []
    keller = Keller(KELLER)
    assert keller.read(read_serial(250)) == ("request", ())
    assert keller.read(with_crc(bytes((1, 69)) + (123_456).to_bytes(4, "big"))) == ("serial", ())
    assert keller.serial == 123_456
    other = Keller(KELLER.model_copy(update={"address": 3}))
    assert other.read(with_crc(bytes((1, 69)) + bytes(4))) == ("other", ())
    assert other.serial is None


def test_a_keller_sensor_is_asked_and_made_ready_again() -> None:
    poller = Poller(KELLER.model_copy(update={"poll": True, "poll_hz": 5.0}))
    sent = [asked for t_ms in range(0, 10_000, 50) if (asked := poller.tick(t_ms * 1_000_000))]
    assert len(sent) == 50
    assert [index for index, asked in enumerate(sent) if asked == initialise(250)] == [0, 22, 44]
    assert set(sent) == {initialise(250), read_serial(250), read_channel(250, 1)}
    whole = Poller(KELLER.model_copy(update={"poll": True, "whole_pascals": True}))
    polled = {whole.tick(t_ms * 1_000_000) for t_ms in range(0, 10_000, 50)}
    assert polled == {b"", initialise(250), read_serial(250), read_channel(250, 1, whole=True)}
    assert Poller(TEXT.model_copy(update={"poll": True})).tick(0) == b""


TEXT_PIECES = st.lists(
    st.sampled_from([b"1013.2\r\n", b"1100,x\n", b"\r", b"11", b"\n"]) | st.binary(max_size=4), max_size=15
).map(b"".join)
KELLER_PIECES = st.lists(
    st.sampled_from(
        [
            keller_reply(1.2),
            keller_whole_reply(120_000),
            read_channel(250, 1),
            read_channel(250, 4),
            b"\xfa\x49",
            b"\x01\xc9",
        ]
    )
    | st.binary(max_size=4),
    max_size=10,
).map(b"".join)


@settings(max_examples=80, deadline=None)
@given(TEXT_PIECES, CUTS)
def test_any_pieces_of_text_give_the_same(data: bytes, cuts: list[int]) -> None:
    assert_any_cut_is_the_same(TEXT, data, cuts)


@settings(max_examples=80, deadline=None)
@given(KELLER_PIECES, CUTS)
def test_any_pieces_of_a_keller_bus_give_the_same(data: bytes, cuts: list[int]) -> None:
    assert_any_cut_is_the_same(KELLER, data, cuts)


@settings(max_examples=50, deadline=None)
@given(st.binary(max_size=3000))
def test_garbage_is_not_kept(data: bytes) -> None:
    reader = keller_reader(KELLER)
    reader.push(0, data)
    assert reader.pending <= 10
    reader.finish()
    assert reader.pending == 0


def test_salt_water_and_latitude_change_the_depth() -> None:
    line = [(0, b"\n2013.25\n")]
    fresh, sea = run(TEXT, line)[0], run(TEXT, line, Site(water="sea", latitude_deg=35.9))[0]
    assert plain(fresh[0])[1] == pytest.approx(10.228, abs=1e-3)
    assert plain(sea[0])[1] == pytest.approx(100_000 / (1025 * 9.7981), abs=1e-3)
