"""MAVLink frames of both versions become headings and depths of one vehicle; what cannot be checked is never read."""

from __future__ import annotations

import ast
import math
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.schema import Feed, Site
from drivers.mavlink import LAYOUTS, Mavlink, crc, mavlink_reader
from tests.drivers.feedframes import attitude, mavlink1, mavlink2, scaled_pressure
from tests.drivers.feedkit import CUTS, assert_any_cut_is_the_same, opinions, plain, run

LINE = Feed(driver="mavlink", surface_mbar=1013.25, max_turn_deg_s=3600)
IDS = {layout.name: number for number, layout in LAYOUTS.items()}


def vectors(shared_data: Path) -> list[tuple[bytes, dict[str, Any]]]:
    """Frames of the file, each with the fields that the packing library wrote beside it."""
    lines = (shared_data / "feeds" / "mavlink2_synthetic.hex").read_text().splitlines()[1:]
    return [
        (bytes.fromhex(frame), ast.literal_eval(said[said.index("{") :]))
        for frame, said in zip(lines[::2], lines[1::2], strict=True)
    ]


@pytest.mark.parametrize("index", range(9))
def test_frames_of_the_reference_library(shared_data: Path, index: int) -> None:
    (frame, said), last = vectors(shared_data)[index], vectors(shared_data)[0][0]
    readings, counters = run(LINE, [(0, frame + last)])
    name = said["mavpackettype"]
    assert counters.frames[name] == (2 if name == "HEARTBEAT" else 1)
    assert (counters.skipped_bytes, counters.bad) == (0, {})
    expected: dict[str, list[tuple[str, float]]] = {
        # Wanted: yaw of -90 degrees is 270; pressure by rho g h with 997 kg/m3 and 9.80665 m/s2.
        "ATTITUDE": [("heading", 270.0)],
        "SCALED_PRESSURE2": [("depth", round((1313.25 - 1013.25) * 100 / (997 * 9.80665), 4))],
    }
    assert [(kind, round(value, 4)) for kind, value in map(plain, readings)] == expected.get(name, [])
    assert [quality for quality, _ in opinions(readings)] == ["good"] * len(readings)


def test_every_vector_is_tested(shared_data: Path) -> None:
    found = vectors(shared_data)
    assert len(found) == 9
    readings, counters = run(LINE, [(0, b"".join(frame for frame, _ in found))])
    assert (len(readings), sum(counters.frames.values()), counters.skipped_bytes) == (2, 9, 0)


def test_the_checksum_is_the_documented_one() -> None:
    # X.25 without its final complement, over "123456789" in the catalogue of checksums, as MCRF4XX: 6F91.
    assert crc(b"12345678", ord("9")) == 0x6F91


@pytest.mark.parametrize(
    ("yaw_rad", "heading_deg"), [(-math.pi, 180.0), (math.pi, 180.0), (0.0, 0.0), (-1e-9, 360.0), (0.5, 28.647890)]
)
def test_yaw_becomes_a_heading(yaw_rad: float, heading_deg: float) -> None:
    (reading,) = run(LINE, [(0, mavlink2(30, attitude(yaw_rad)))])[0]
    assert (plain(reading)[1] - heading_deg + 180) % 360 - 180 == pytest.approx(0, abs=1e-4)


def test_both_versions_and_signed_frames() -> None:
    frames = [
        mavlink1(30, attitude(1.0)),
        mavlink2(30, attitude(1.0)),
        mavlink2(30, attitude(1.0), flags=1, signature=bytes(range(13))),
    ]
    for data in (b"".join(frames), b"".join(frames[::-1])):
        readings, counters = run(LINE, [(0, data)])
        assert [plain(each)[1] for each in readings] == pytest.approx([math.degrees(1.0)] * 3, abs=1e-4)
        assert counters.skipped_bytes == 0


def test_headings_may_come_from_another_message_and_north() -> None:
    data = mavlink2(30, attitude(1.0)) + mavlink2(74, struct.pack("<ffffhH", 0, 0, 0, 0, 270, 50))
    site = Site(declination_deg=3.9)
    for feed, headings in (
        (LINE, [math.degrees(1.0) + 3.9]),
        (LINE.model_copy(update={"heading_from": "vfr_hud"}), [273.9]),
        (LINE.model_copy(update={"heading_from": "vfr_hud", "heading_reference": "true"}), [270.0]),
    ):
        readings, _ = run(feed, [(0, data)], site)
        assert [plain(each)[1] for each in readings] == pytest.approx(headings, abs=1e-4)


def test_depth_comes_from_the_configured_pressure() -> None:
    data = (
        mavlink2(29, scaled_pressure(1009.5))
        + mavlink2(137, scaled_pressure(1313.25))
        + mavlink2(143, scaled_pressure(1111.25))
    )
    for number, gauge_mbar in ((1, -3.75), (2, 300.0), (3, 98.0)):
        (reading,) = run(LINE.model_copy(update={"pressure_message": number}), [(0, data)])[0]
        assert plain(reading)[1] == pytest.approx(gauge_mbar * 100 / (997 * 9.80665), abs=1e-5)


def test_only_the_autopilot_of_one_vehicle_is_heard() -> None:
    camera, other = mavlink2(30, attitude(2.0), component=100), mavlink2(30, attitude(3.0), system=2)
    data = camera + mavlink2(30, attitude(1.0)) + other + mavlink1(30, attitude(1.5, 2))
    readings, counters = run(LINE, [(0, data)])
    assert [plain(each)[1] for each in readings] == pytest.approx([math.degrees(1.0), math.degrees(1.5)], abs=1e-4)
    assert counters.frames == {"ATTITUDE": 2, "other_system": 2}
    readings, _ = run(LINE.model_copy(update={"system": 2}), [(0, data)])
    assert [plain(each)[1] for each in readings] == pytest.approx([math.degrees(3.0)], abs=1e-4)


def test_a_heartbeat_names_the_vehicle() -> None:
    vehicle = Mavlink(LINE)
    vehicle.read(mavlink2(0, struct.pack("<IBBBBB", 19, 12, 3, 209, 4, 3)))
    assert vehicle.speaker == "system 1: submarine with ArduPilot"


def test_unknown_messages_are_skipped_whole_between_frames() -> None:
    # An unknown message whose payload holds a whole frame: read only where the stream is not followed yet.
    inner = mavlink2(30, attitude(2.0))
    known, unknown = mavlink2(30, attitude(1.0)), mavlink2(9000, inner)
    readings, counters = run(LINE, [(0, known + unknown + known)])
    assert [plain(each)[1] for each in readings] == pytest.approx([math.degrees(1.0)] * 2, abs=1e-4)
    assert counters.frames == {"ATTITUDE": 2, "other": 1}
    assert run(LINE, [(0, unknown[3:] + known)])[1].frames["ATTITUDE"] == 2


def test_a_message_may_have_grown_but_not_beyond_reason() -> None:
    grown, absurd = attitude(1.0).ljust(40, b"x"), attitude(1.0).ljust(60, b"x")
    readings, counters = run(LINE, [(0, mavlink2(30, grown) + mavlink2(30, absurd))])
    assert [plain(each)[1] for each in readings] == pytest.approx([math.degrees(1.0)], abs=1e-4)
    assert counters.skipped_bytes == 12 + 60


@pytest.mark.parametrize("index", [1, 4, 5, 8, 12, 20, 36])
def test_a_damaged_frame_is_refused_and_the_next_one_read(index: int) -> None:
    frame = mavlink2(30, attitude(1.0))
    broken = bytearray(frame)
    broken[index] ^= 0x15
    readings, counters = run(LINE, [(0, bytes(broken) + frame * 2)])
    assert [plain(each)[1] for each in readings] == pytest.approx([math.degrees(1.0)] * 2, abs=1e-4)
    assert counters.skipped_bytes == len(frame)


def test_what_is_no_number_and_a_clock_that_stands() -> None:
    data = (
        mavlink2(30, attitude(math.nan))
        + mavlink2(137, scaled_pressure(math.inf))
        + mavlink2(30, attitude(1.0, 5)) * 2
        + mavlink2(30, attitude(1, 6))
    )
    readings, counters = run(LINE, [(0, data)])
    assert counters.bad == {"field": 2}
    assert opinions(readings) == [
        ("good", ""),
        ("suspect", "stale: the autopilot's clock stands still"),
        ("good", ""),
    ]


def test_the_field_is_watched_through_raw_values() -> None:
    feed = LINE.model_copy(update={"field_strength": 440.0})
    raw = [struct.pack("<QhhhhhhhhhBh", 1, 0, 0, 0, 0, 0, 0, x, -15, 385, 0, 0)[:26] for x in (210, 410)]
    data = mavlink2(27, raw[0]) + mavlink2(30, attitude(1.0, 1)) + mavlink2(27, raw[1]) + mavlink2(30, attitude(1.0, 2))
    assert [quality for quality, _ in opinions(run(feed, [(0, data)])[0])] == ["good", "suspect"]


PIECES = st.lists(
    st.sampled_from(
        [
            mavlink2(30, attitude(1.0)),
            mavlink1(30, attitude(2.0)),
            mavlink2(137, scaled_pressure(1200.0)),
            mavlink2(9000, b"payload"),
            mavlink2(30, attitude(1.0), flags=1, signature=bytes(13)),
            b"\xfd",
            b"\xfe\x1c",
            mavlink2(30, attitude(1.0))[:20],
        ]
    )
    | st.binary(max_size=12),
    max_size=8,
).map(b"".join)


@settings(max_examples=100, deadline=None)
@given(PIECES, CUTS)
def test_any_pieces_give_the_same(data: bytes, cuts: list[int]) -> None:
    assert_any_cut_is_the_same(LINE, data, cuts)


@settings(max_examples=50, deadline=None)
@given(st.binary(max_size=3000))
def test_garbage_is_counted_and_not_kept(data: bytes) -> None:
    reader = mavlink_reader(LINE)
    reader.push(0, data)
    assert reader.pending <= 12 + 255 + 13
    reader.finish()
    assert reader.pending == 0
    assert reader.counters.skipped_bytes == len(data) or reader.counters.frames
