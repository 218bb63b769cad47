"""The host's conversation against the emulated head: what was configured is what the pings then are."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from config.schema import Sonar
from drivers.readings import Ping
from drivers.tritech import commands
from drivers.tritech.decoder import TritechDecoder
from drivers.tritech.framing import Deframer
from drivers.tritech.head import Head
from drivers.tritech.headdata import HeadData, decode_head_data
from drivers.tritech.ids import MessageId
from drivers.tritech.requests import RequestLoop
from drivers.tritech.settings import head_command, matches
from tools.emulator.head import Head as EmulatedHead
from tools.emulator.head import HeadOptions, Sounding

MS = 1_000_000
SECOND = 1000 * MS
LOW_WORD, HIGH_WORD = 0x02999999, 0x05666666


def silence(sounding: Sounding) -> NDArray[np.uint8]:
    return np.zeros(sounding.bins, dtype=np.uint8)


@dataclass
class Water:
    """Both ends of the line and a clock; ``delay_ns`` is the way of a byte, one way, over a slow link."""

    sonar: Sonar
    options: HeadOptions = field(default_factory=HeadOptions)
    delay_ns: int = 0
    step_ns: int = 5 * MS
    t_ns: int = SECOND
    pings: list[Ping] = field(default_factory=list)
    replies: list[HeadData] = field(default_factory=list)
    said: list[commands.Command] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.host = Head(self.sonar)
        self.head = EmulatedHead(silence, self.options, self.t_ns)
        self.decoder = TritechDecoder(self.sonar)
        self._replies, self._said = Deframer(), Deframer()
        self._up: list[tuple[int, bytes]] = []
        self._down: list[tuple[int, bytes]] = []

    def run(self, seconds: float) -> Water:
        end_ns = self.t_ns + int(seconds * SECOND)
        while self.t_ns < end_ns:
            self.t_ns += self.step_ns
            self._down.append((self.t_ns + self.delay_ns, self.head.tick(self.t_ns)))
            data = self._due(self._down)
            self._up.append((self.t_ns + self.delay_ns, self._hear(data)))
            self.head.push(self.t_ns, self._due(self._up))
        return self

    def _hear(self, data: bytes) -> bytes:
        self.pings += [each for each in self.decoder.push(self.t_ns, data) if isinstance(each, Ping)]
        frames = self._replies.push(self.t_ns, data)
        self.replies += [decode_head_data(each) for each in frames if each.message_id == MessageId.HEAD_DATA]
        sent = self.host.push(self.t_ns, data) if data else self.host.tick(self.t_ns)
        self.said += [commands.decode_command(frame) for frame in self._said.push(self.t_ns, sent)]
        return sent

    def _due(self, queue: list[tuple[int, bytes]]) -> bytes:
        data = b"".join(piece for at_ns, piece in queue if at_ns <= self.t_ns)
        queue[:] = [each for each in queue if each[0] > self.t_ns]
        return data

    def count(self, kind: type[commands.Command]) -> int:
        return sum(isinstance(command, kind) for command in self.said)


def signed_deg(angle_rad: float) -> float:
    return math.degrees(math.remainder(angle_rad, math.tau))


def turns_deg(pings: list[Ping]) -> list[float]:
    return [signed_deg(after.bearing_rad - before.bearing_rad) for before, after in pairwise(pings)]


@pytest.mark.parametrize("mount_deg", [0.0, 90.0, -135.0])
@pytest.mark.parametrize("inverted", [False, True])
@pytest.mark.parametrize("reverse", [False, True])
def test_a_full_circle_either_way_however_the_head_is_mounted(mount_deg: float, inverted: bool, reverse: bool) -> None:
    water = Water(Sonar(bins=100, mount_deg=mount_deg, inverted=inverted)).run(8)
    if reverse:
        water.head.push(water.t_ns, commands.encode_command(commands.Reverse()))
        water.run(1)
    water.pings.clear()
    water.run(6)
    assert len(water.pings) > 205
    clockwise = reverse == inverted
    assert turns_deg(water.pings) == pytest.approx([1.8 if clockwise else -1.8] * (len(water.pings) - 1))
    assert {ping.head.clockwise for ping in water.pings} == {clockwise}
    assert all(ping.head.continuous for ping in water.pings)
    # Where the transducer points ahead of the head, the beam points where the head was mounted.
    replies = water.replies[-len(water.pings) :]
    ahead = [ping.bearing_rad for ping, reply in zip(water.pings, replies, strict=True) if reply.bearing == 3200]
    assert ahead
    assert [signed_deg(each) for each in ahead] == pytest.approx([mount_deg] * len(ahead))


@pytest.mark.parametrize(("left", "right"), [(-45.0, 45.0), (30.0, 150.0), (150.0, -150.0)])
@pytest.mark.parametrize("inverted", [False, True])
@pytest.mark.parametrize("mount_deg", [0.0, 60.0])
def test_a_sector_is_swept_both_ways(left: float, right: float, inverted: bool, mount_deg: float) -> None:
    sonar = Sonar(bins=100, sector_deg=(left, right), inverted=inverted, mount_deg=mount_deg)
    water = Water(sonar).run(8)
    water.pings.clear()
    water.run(8)
    from_left = [(math.degrees(ping.bearing_rad) - left) % 360 for ping in water.pings]
    span = (right - left) % 360
    assert min(min(each, 360 - each) for each in from_left) == pytest.approx(0.0, abs=0.06)
    assert max(each for each in from_left if each < 359.9) == pytest.approx(span, abs=0.06)
    assert {ping.head.clockwise for ping in water.pings} == {True, False}
    assert {(round(signed_deg(p.head.left_rad - math.radians(left)), 1), p.head.continuous) for p in water.pings} <= {
        (0.0, False),
        (-0.0, False),
    }


@pytest.mark.parametrize(("channel", "word", "slope"), [("low", LOW_WORD, 90), ("high", HIGH_WORD, 125)])
@pytest.mark.parametrize("dual", [False, True])
def test_heads_with_two_frequencies(channel: str, word: int, slope: int, dual: bool) -> None:
    wanted = {"bins": 100, "head_type": "non-dst", "channel": channel, "dual_channel": dual, "gain_pct": 40.0}
    water = Water(Sonar.model_validate(wanted), HeadOptions(dst=False)).run(10)
    (command,) = [each for each in water.said if isinstance(each, commands.HeadCommand)]
    assert (command.gains is not None) == dual
    assert {(each.transmit_word, each.slope, each.device_type, each.gain) for each in water.replies} == {
        (word, slope, 0x02, 84)
    }
    assert len(water.pings) > 100


@pytest.mark.parametrize("dst", [True, False])
def test_four_bits_to_an_echo_halve_the_time_on_the_line(dst: bool) -> None:
    def ramp(sounding: Sounding) -> NDArray[np.uint8]:
        return (np.arange(sounding.bins) * 255 // sounding.bins).astype(np.uint8)

    sonar = Sonar(bits=4, bins=401, head_type="dst" if dst else "non-dst")
    water = Water(sonar, HeadOptions(dst=dst))
    water.head._listen = ramp
    water.run(10)
    count, start_ns = len(water.pings), water.t_ns
    water.run(10)
    seconds = (water.t_ns - start_ns) / (len(water.pings) - count) / 1e9
    assert seconds <= 1.05 * ((201 + 45) * 10 / 115200 + 0.010)
    assert water.host.limits.ruling(seconds) == "line"
    assert not water.host.settings_differ
    echoes = water.pings[-1].echoes.astype(int)
    assert len(echoes) == 402
    # What lies between least and greatest level comes back within half of one of fifteen steps.
    wanted = np.arange(402) * 255 // 402
    low, span = water.replies[-1].ad_low, water.replies[-1].ad_span
    between = (wanted > low + span / 15) & (wanted < low + span)
    assert np.abs(echoes - wanted)[between].max() <= span / 30 + 1


@pytest.mark.parametrize("dst", [True, False])
def test_half_duplex_is_one_request_then_its_reply(dst: bool) -> None:
    sonar = Sonar(bins=100, head_type="dst" if dst else "non-dst")
    water = Water(sonar, HeadOptions(dst=dst, replies_per_request=1)).run(20)
    assert water.host.user_block is not None
    assert (water.host.user_block.half_duplex, water.host.user_block.is_dst) == (True, dst)
    asked = water.count(commands.SendData)
    assert asked - 1 <= len(water.replies) <= asked
    assert len(water.pings) > 300


CHANGES = [
    ({"range_m": 5.0}, 1, 0),
    ({"step_deg": 0.9}, 1, 0),
    ({"sector_deg": (-30.0, 30.0)}, 1, 0),
    ({"gain_pct": 80.0}, 0, 1),
    ({"gain_pct": 80.0, "range_m": 20.0}, 1, 0),
]


@pytest.mark.parametrize(("change", "heads", "gains"), CHANGES)
@pytest.mark.parametrize("replies", [1, 2])
def test_settings_change_without_a_pause(change: dict[str, object], heads: int, gains: int, replies: int) -> None:
    sonar = Sonar(bins=100)
    water = Water(sonar, HeadOptions(replies_per_request=replies)).run(10)
    before, set_before = len(water.replies), water.count(commands.HeadCommand)
    wanted = Sonar.model_validate(sonar.model_dump() | change)
    water.host.change(wanted)
    water.run(2)
    assert (water.count(commands.HeadCommand) - set_before, water.count(commands.GainCommand)) == (heads, gains)
    new = [reply for reply in water.replies[before:] if reply.gain == round(wanted.gain_pct * 2.1)]
    assert len(new) > 2.0 / 0.06
    assert water.host.state == "scanning"
    assert not water.host.settings_differ
    # Replies with the old settings are few, and no gap is longer than the motor needs.
    settings = head_command(wanted).parameters
    old = [reply for reply in water.replies[before:] if not matches(reply, settings)]
    assert len(old) <= 3


def test_a_head_that_does_not_take_a_gain_is_set_anew() -> None:
    water = Water(Sonar(bins=100)).run(10)
    deaf = water.head.push

    def push(t_ns: int, data: bytes) -> None:
        for frame in Deframer().push(t_ns, data):
            if not isinstance(commands.decode_command(frame), commands.GainCommand):
                deaf(t_ns, frame.data)

    water.head.push = push  # type: ignore[method-assign]
    water.host.change(Sonar(bins=100, gain_pct=90.0))
    water.run(4)
    assert water.count(commands.GainCommand) == 1
    assert water.count(commands.HeadCommand) == 2
    assert water.replies[-1].gain == 189


def test_the_line_is_kept_busy() -> None:
    water = Water(Sonar()).run(10)
    count, start_ns = len(water.pings), water.t_ns
    water.run(10)
    seconds = (water.t_ns - start_ns) / (len(water.pings) - count) / 1e9
    assert seconds <= 1.02 * ((400 + 45) * 10 / 115200 + 0.010)
    assert water.host.limits.ruling(seconds) == "line"
    assert water.host.ping_s == pytest.approx(seconds, rel=0.05)


@pytest.mark.parametrize("round_trip_ms", [60, 140])
def test_a_slow_link_has_one_more_request_under_way_and_no_more(round_trip_ms: int) -> None:
    water = Water(Sonar(), delay_ns=round_trip_ms * MS // 2).run(10)
    water.run(10)
    assert water.host._requests.is_ahead
    count, start_ns = len(water.pings), water.t_ns
    water.run(10)
    seconds = (water.t_ns - start_ns) / (len(water.pings) - count) / 1e9
    assert seconds <= 1.05 * ((400 + 45) * 10 / 115200 + 0.010)
    assert water.host._requests.owed <= 5
    before = len(water.replies)
    water.host.change(Sonar(range_m=5.0))
    water.run(3)
    new = [reply.range_scale == 50 for reply in water.replies[before:]]
    assert new.index(True) <= 7
    assert all(new[new.index(True) :])


def test_a_slow_head_is_not_asked_more_often() -> None:
    water = Water(Sonar(range_m=2.0, bins=100), HeadOptions(baud=19200)).run(20)
    assert not water.host._requests.is_ahead
    ping_s = water.host.ping_s
    assert ping_s is not None
    assert water.host.limits.ruling(ping_s) == "other"
    assert water.host._requests.owed <= 2


def test_a_busy_link_that_gained_nothing_is_asked_ahead_again_later() -> None:
    loop, t_ns = RequestLoop(), 0
    loop.begin(head_command(Sonar()).parameters, 115200)
    ahead: list[bool] = []
    for _ in range(400):
        t_ns += 100 * MS  # twice as slow as the line allows, whatever is asked
        loop.asked(t_ns)
        loop.answered(t_ns)
        ahead.append(loop.is_ahead)
    tries = [at for at, (before, now) in enumerate(pairwise(ahead)) if now and not before]
    assert len(tries) == 2
    assert tries[1] - tries[0] > 250
    assert sum(ahead) < 60
