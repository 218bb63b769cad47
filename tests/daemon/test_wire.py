from __future__ import annotations

import json
import math

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st

from config.errors import DataError, FrameError
from daemon import mapshots, snapshots
from daemon.snapshots import Snapshot
from daemon.wire import TOPICS, VERSION, decode, encode, numbered
from drivers.readings import HeadSettings, Ping
from drivers.records import Event
from fill.values import Filled, Hole, Mesh
from mapping.values import Grid, Outline, Pose, Scan, Station

HEAD = HeadSettings(10.0, 50.0, 10.0, 25.0, math.radians(1.8), True, 0.0, 0.0, True)
STAMP = (5, 7)


def a_ping(bins: int = 4) -> Ping:
    return Ping(5, math.radians(90), 0.025, np.arange(bins, dtype=np.uint8), HEAD)


def a_grid(rows: int = 3, cols: int = 4) -> Grid:
    log_odds = np.zeros((rows, cols), np.float32)
    log_odds[0, 1], log_odds[2, 3] = 2.0, -2.0
    state = np.zeros((rows, cols), np.uint8)
    state[0, 1], state[2, 3] = 2, 1
    return Grid(0.05, -0.1, 0.2, log_odds, state)


def a_filled() -> Filled:
    grid = a_grid()
    certainty, hole = np.zeros((3, 4), np.float32), np.full((3, 4), -1, np.int32)
    certainty[1, 2], hole[1, 2] = 0.8, 0
    ends = np.array([[0.0, 0.25], [0.05, 0.3]])
    made = Hole(0, np.array([[1, 2]], np.int32), np.array([0.8], np.float32), 0.75, ends, 0.07, "chord", "short")
    return Filled(grid, (made,), certainty, hole, np.array([[1.0, 2.0]]))


def a_station() -> Station:
    flat = np.zeros(1)
    scan = Scan(3, 10, 20, 0.0, math.nan, flat, np.zeros((1, 4), np.uint8), 0.025, 0.03, "full")
    return Station(scan, Pose(1.0, 2.0, -math.pi / 2), np.diag([0.04, 0.09, 0.01]), "placed", 0, math.nan, "sure")


def test_golden_bytes_of_a_ping() -> None:
    frames = encode(snapshots.ping(a_ping(), 7, math.pi, None), 12, "s1")
    assert frames == [
        b"ping",
        b'{"v":"1.0","seq":12,"session":"s1","t_ns":5,"utc_ns":7,"bearing_deg":90.0,"heading_deg":180.0,'
        b'"depth_m":null,"bin_m":0.025,"range_m":0.1,"step_deg":1.8,"gain_pct":50.0,'
        b'"names":"echoes","enc":"raw","dtype":"u1","shape":[4]}',
        b"\x00\x01\x02\x03",
    ]


def test_golden_bytes_of_a_grid() -> None:
    frames = encode(mapshots.grid_key(STAMP, a_grid()), 0, "s1")
    assert frames == [
        b"grid/key",
        b'{"v":"1.0","seq":0,"session":"s1","t_ns":5,"utc_ns":7,"cell_m":0.05,"x0_m":-0.1,"y0_m":0.2,"rows":3,"cols":4,'
        b'"layers":["occupancy","state"],"names":"cells","enc":"raw","dtype":"u1","shape":[2,3,4]}',
        bytes([128, 225, 128, 128] + [128] * 4 + [128, 128, 128, 30] + [0, 2, 0, 0] + [0] * 4 + [0, 0, 0, 1]),
    ]


def test_golden_bytes_of_several_arrays() -> None:
    frames = encode(mapshots.fill(STAMP, a_filled()), 1, "s1")
    header = json.loads(frames[1])
    assert header["names"] == ["row", "col", "certainty", "hole"]
    assert header["dtype"] == ["i4", "i4", "u1", "i4"]
    assert header["enc"] == ["raw"] * 4
    assert header["shape"] == [[1]] * 4
    assert frames[2:] == [b"\x01\0\0\0", b"\x02\0\0\0", b"\xcc", b"\0\0\0\0"]
    assert header["holes"][0]["curve"] == "chord"
    assert header["open_ends_m"] == [[1.0, 2.0]]
    assert header["noise_ends"] == 0


def test_the_other_topics_come_back_as_they_went() -> None:
    surface = Mesh(
        np.eye(3, dtype=np.float32),
        np.array([[0, 1, 2]], np.uint32),
        np.array([0, 1, 2], np.uint8),
        np.array([1.0, 0.5, 0.0], np.float32),
    )
    told = [
        mapshots.stations(STAMP, [a_station()], [Outline(4, 3, np.eye(2, dtype=np.float32))]),
        mapshots.mesh(STAMP, surface),
        snapshots.event(Event(5, 7, "mark", {"text": "stairs"})),
        snapshots.health(5, 7, {"lag_s": 0.5}),
    ]
    for each in told:
        message = decode(encode(each, 3, "s"))
        assert (message.seq, message.session) == (3, "s")
        assert message.snapshot.fields == each.fields
        assert (message.snapshot.t_ns, message.snapshot.utc_ns) == STAMP
        assert list(message.snapshot.arrays) == list(each.arrays)
        for name, array in each.arrays.items():
            np.testing.assert_array_equal(message.snapshot.arrays[name], array)


def test_a_station_for_people() -> None:
    (station,) = json.loads(encode(mapshots.stations(STAMP, [a_station()]), 0, "s")[1])["stations"]
    assert station["heading_deg"] == 270.0
    assert station["sd_x_m"] == 0.2
    assert station["depth_m"] is None
    assert station["margin"] is None


def test_a_delta_is_the_window_that_changed() -> None:
    before, grid = mapshots.layers(a_grid()), a_grid()
    assert mapshots.grid_delta(STAMP, grid, before) is None
    grid.state[1, 1] = grid.state[2, 2] = 2
    delta = mapshots.grid_delta(STAMP, grid, before)
    assert delta is not None
    assert (delta.fields["row0"], delta.fields["col0"]) == (1, 1)
    window = delta.arrays["cells"]
    assert window.shape == (2, 2, 2)
    before[:, 1:3, 1:3] = window
    np.testing.assert_array_equal(before, mapshots.layers(grid))


def test_large_arrays_are_compressed() -> None:
    frames = encode(mapshots.grid_key(STAMP, a_grid(300, 400)), 0, "s")
    assert json.loads(frames[1])["enc"] == "zstd"
    assert len(frames[2]) < 2000
    assert decode(frames).snapshot.arrays["cells"].shape == (2, 300, 400)


def test_an_unknown_field_is_ignored_and_a_newer_major_is_refused() -> None:
    frames = encode(snapshots.ping(a_ping(), 7, None, 1.0), 0, "s")
    newer_minor = [frames[0], frames[1].replace(b'"v":"1.0"', b'"v":"1.9","colour":"red"'), frames[2]]
    assert decode(newer_minor).snapshot.arrays["echoes"].shape == (4,)
    with pytest.raises(DataError, match=r"version 2\.0"):
        decode([frames[0], frames[1].replace(b'"v":"1.0"', b'"v":"2.0"'), frames[2]])


@pytest.mark.parametrize(
    ("was", "becomes"),
    [
        (b'"shape":[4]', b'"shape":[5]'),
        (b'"shape":[4]', b'"shape":[-4]'),
        (b'"shape":[4]', b'"shape":[99999999999]'),
        (b'"shape":[4]', b'"shape":7'),
        (b'"dtype":"u1"', b'"dtype":"O"'),
        (b'"enc":"raw"', b'"enc":"zstd"'),
        (b'"enc":"raw"', b'"enc":"pickle"'),
        (b'"seq":0,', b""),
    ],
)
def test_a_damaged_message_is_refused(was: bytes, becomes: bytes) -> None:
    frames = encode(snapshots.ping(a_ping(), 7, None, 1.0), 0, "s")
    assert was in frames[1]
    with pytest.raises(FrameError):
        decode([frames[0], frames[1].replace(was, becomes), frames[2]])


def test_a_compressed_array_of_another_size_is_not_unpacked() -> None:
    frames = encode(snapshots.ping(a_ping(), 7, None, 1.0), 0, "s")
    bomb = zstandard.ZstdCompressor().compress(bytes(1 << 24))
    with pytest.raises(FrameError, match="another size"):
        decode([frames[0], frames[1].replace(b'"enc":"raw"', b'"enc":"zstd"'), bomb])


@settings(max_examples=200, deadline=None)
@given(st.lists(st.binary(max_size=60), max_size=4))
def test_noise_is_refused_in_one_way(frames: list[bytes]) -> None:
    with pytest.raises((FrameError, DataError)):
        decode(frames)


@pytest.mark.parametrize("header", [b"[]", b"null", b'{"v":[]}', b'{"v":"x"}', b"[" * 100_000])
def test_a_header_that_is_no_header(header: bytes) -> None:
    with pytest.raises(FrameError):
        decode([b"ping", header])


def test_numbering_changes_only_the_number() -> None:
    frames = encode(mapshots.grid_key(STAMP, a_grid()), 0, "")
    message = decode(numbered(frames, 9, "s2", {"topic": "grid/key", "seq": 8}))
    assert (message.seq, message.session) == (9, "s2")
    assert message.snapshot.fields["base"] == {"topic": "grid/key", "seq": 8}
    np.testing.assert_array_equal(message.snapshot.arrays["cells"], mapshots.layers(a_grid()))


def test_no_topic_is_a_prefix_of_another() -> None:
    assert not [(a, b) for a in TOPICS for b in TOPICS if a != b and b.startswith(a)]


def test_an_array_without_a_place_on_the_wire() -> None:
    with pytest.raises(TypeError):
        encode(Snapshot("ping", 0, 0, {}, {"echoes": np.array(["text"])}), 0, "s")


def test_the_version_is_major_and_minor() -> None:
    assert [int(part) for part in VERSION.split(".")] == [1, 0]
