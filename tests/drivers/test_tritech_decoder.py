"""Pings come out of the head's bytes at the right bearing, with the right length, and never from bad ones."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.schema import Sonar
from drivers.counters import Counters
from drivers.readings import Ping, Reading
from drivers.tritech.decoder import TritechDecoder
from drivers.tritech.headdata import Control, HeadData, HeadStatus, encode_head_data
from drivers.tritech.messages import Alive, HeadInf, encode

PING = HeadData(3200, b"\x00\x7f\xff\n@", 53, 32, 1600, 4800, range_scale=100, gain=105, ad_span=77, ad_low=40)


NETWORK = "socket://peer:1"
BYTE_NS = 10_000_000_000 // 115200


def key(reading: Reading) -> tuple[object, ...]:
    assert isinstance(reading, Ping)
    return reading.t_ns, reading.bearing_rad, reading.bin_m, reading.echoes.tobytes(), reading.head


def decode(pieces: Sequence[tuple[int, bytes]], sonar: Sonar | None = None) -> tuple[list[Ping], Counters]:
    decoder = TritechDecoder(sonar or Sonar(port=NETWORK))
    readings = [reading for t_ns, data in pieces for reading in decoder.push(t_ns, data)]
    readings += decoder.finish()
    return [each for each in readings if isinstance(each, Ping)], decoder.counters


def test_real_stream(shared_data: Path) -> None:
    stream = (shared_data / "sonar" / "micron_dst_stream_20171102.bin").read_bytes()
    pings, counters = decode([(9, stream)], Sonar(sound_speed_m_s=1475.0, port=NETWORK))
    assert counters == Counters({"head_data": 765}, 53, {})
    assert {ping.echoes.shape for ping in pings} == {(794,)}
    first = pings[0]
    # The reply came when the sound had been to the last of 794 bins of 133 intervals, and back.
    assert (first.t_ns, first.echoes[:4].tolist()) == (9 - 794 * 133 * 640, [0x11, 0, 0x1B, 0x39])
    assert first.echoes.dtype == np.uint8
    assert math.degrees(first.bearing_rad) == pytest.approx(360 - 4.6125)
    assert first.bin_m * 794 == pytest.approx(50.0, rel=0.005)
    assert (first.head.range_m, first.head.continuous, first.head.clockwise) == (50.0, False, True)
    assert math.degrees(first.head.left_rad) == pytest.approx(360 - 79.9875)
    assert math.degrees(first.head.right_rad) == pytest.approx(79.9875)
    assert not first.echoes.flags.writeable
    whole = [key(ping) for ping in pings]
    for size in (1, 104, 4096):
        pieces = [(9, stream[i : i + size]) for i in range(0, len(stream), size)]
        again, same = decode(pieces, Sonar(sound_speed_m_s=1475.0, port=NETWORK))
        assert ([key(ping) for ping in again], same) == (whole, counters)


def test_undamaged_pings_of_a_damaged_real_stream(shared_data: Path) -> None:
    stream = (shared_data / "sonar" / "micron_dst_stream_20171102.bin").read_bytes()
    whole = [key(ping) for ping in decode([(0, stream)])[0]]
    generator = random.Random(794)
    for _ in range(3):
        damaged = bytearray(stream)
        hurt = set()
        for _ in range(8):
            at = generator.randrange(24, len(stream) - 40)
            hurt.add((at - 24) // 839)
            damaged[at] = generator.randrange(256)
        cut = generator.randrange(24, len(stream) - 40)
        del damaged[cut : cut + 7]
        hurt |= {(cut - 24) // 839, (cut + 6 - 24) // 839}
        left = [ping for number, ping in enumerate(whole) if number not in hurt]
        found = iter(key(ping) for ping in decode([(0, bytes(damaged))])[0])
        assert all(ping in found for ping in left)


@pytest.mark.parametrize(
    ("mount", "inverted", "position", "bow_deg"),
    [
        (0.0, False, 3200, 0.0),
        (0.0, False, 4800, 90.0),
        (0.0, True, 4800, 270.0),
        (30.0, False, 1600, 300.0),
        (30.0, True, 1600, 120.0),
        (-90.0, False, 4800, 0.0),
        (180.0, False, 0, 0.0),
    ],
)
def test_mounting(mount: float, inverted: bool, position: int, bow_deg: float) -> None:
    data = encode_head_data(replace(PING, bearing=position))
    (ping,), _ = decode([(0, data)], Sonar(mount_deg=mount, inverted=inverted))
    assert math.degrees(ping.bearing_rad) == pytest.approx(bow_deg, abs=1e-9)
    assert 0 <= ping.bearing_rad < math.tau
    assert ping.head.clockwise is not inverted


def test_settings_of_the_head() -> None:
    (ping,), _ = decode([(0, encode_head_data(PING))], Sonar(inverted=True, mount_deg=10.0))
    head = ping.head
    assert (head.range_m, head.gain_pct, head.continuous) == (10.0, 50.0, False)
    assert [math.degrees(each) for each in (head.left_rad, head.right_rad, head.step_rad)] == pytest.approx(
        [280, 100, 1.8]
    )
    assert (head.ad_low_db, head.ad_span_db) == pytest.approx((12.549, 24.157), abs=0.001)
    (ping,), _ = decode([(0, encode_head_data(replace(PING, control=Control(0x2307))))])
    assert (ping.head.continuous, ping.head.left_rad, ping.head.right_rad) == (True, 0.0, 0.0)


@pytest.mark.parametrize(
    ("ping", "reason"),
    [
        (replace(PING, status=HeadStatus(0x11)), "power_lost"),
        (replace(PING, status=HeadStatus(0x12)), "motor_error"),
        (replace(PING, device_type=5), "profiler"),
        (replace(PING, bearing=6400), "bearing"),
        (replace(PING, ad_interval=0), "no_echoes"),
        (replace(PING, bins=b""), "no_echoes"),
    ],
)
def test_unusable_pings_are_counted(ping: HeadData, reason: str) -> None:
    pings, counters = decode([(0, encode_head_data(ping) + encode_head_data(PING))])
    assert (len(pings), counters) == (1, Counters({"head_data": 2}, 0, {reason: 1}))


def test_other_nodes_and_messages_are_only_counted() -> None:
    split = bytearray(encode_head_data(PING))
    split[9] = 1
    line = encode_head_data(PING, head=3) + encode(Alive(HeadInf.CENTRED)) + bytes(split) + b"??"
    assert decode([(0, line)]) == (
        [],
        Counters({"head_data": 2, "alive": 1}, 2, {"other_node": 1, "several_packets": 1}),
    )
    assert decode([]) == ([], Counters())


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_any_pieces_give_the_same(data: st.DataObject) -> None:
    line = b"".join(
        encode_head_data(replace(PING, bearing=bearing)) + noise
        for bearing, noise in data.draw(st.lists(st.tuples(st.integers(0, 6500), st.binary(max_size=9)), max_size=5))
    )
    cuts = sorted(data.draw(st.lists(st.integers(0, len(line)), max_size=6)))
    for sonar, byte_ns in ((Sonar(port=NETWORK), 0), (Sonar(), BYTE_NS)):
        # On a wire each piece is read when its last byte has come, the bytes coming without a pause.
        ends = zip([0, *cuts], [*cuts, len(line)], strict=True)
        whole, counters = decode([(len(line) * byte_ns, line)], sonar)
        for pieces in ([(b * byte_ns, line[a:b]) for a, b in ends], single(line, byte_ns)):
            cut, same = decode(pieces, sonar)
            assert ([key(ping) for ping in cut], same) == ([key(ping) for ping in whole], counters)


def single(line: bytes, byte_ns: int) -> list[tuple[int, bytes]]:
    return [((at + 1) * byte_ns, line[at : at + 1]) for at in range(len(line))]


def test_a_ping_is_dated_when_its_sound_went_out_however_late_it_is_read() -> None:
    reply = encode_head_data(PING)
    sampling_ns = len(PING.bins) * PING.ad_interval * 640
    began_ns = 10**9
    ended_ns = began_ns + len(reply) * BYTE_NS
    # Read in one piece when the line had been silent for 5 ms; and together with what came after it.
    for pieces in ([(ended_ns, reply)], [(ended_ns + 3 * BYTE_NS, reply + b"xyz")], [(1, b"?"), (ended_ns, reply)]):
        (ping,), _ = decode(pieces, Sonar())
        assert ping.t_ns == began_ns - sampling_ns
    # Nothing came before what was read before.
    (ping,), _ = decode([(began_ns + 7, b"?"), (ended_ns, reply)], Sonar())
    assert ping.t_ns == began_ns + 7 - sampling_ns
