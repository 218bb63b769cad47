"""The emulated head against the protocol, the timing of real heads, and a real head's sweep."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.schema import Sonar
from drivers.tritech.commands import (
    GainCommand,
    Gains,
    HeadCommand,
    ReBoot,
    Reverse,
    SendBBUser,
    SendData,
    SendVersion,
    StopAlives,
    encode_command,
)
from drivers.tritech.headdata import Control, HeadData, echoes_of
from drivers.tritech.messages import Alive, BBUserData, HeadInf, Message, VersionData
from drivers.tritech.settings import head_command
from tests.tools.head_bench import MS, PARAMETERS, Bench, ramp
from tools.emulator.head import Head, HeadOptions
from tools.emulator.sweep import Sweep


def infos(heard: list[tuple[int, Message]]) -> list[int]:
    return [message.info for _, message in heard if isinstance(message, Alive)]


def test_power_up_tells_the_manuals_sequence() -> None:
    bench = Bench()
    told = infos(bench.run(6.0))
    assert list(dict.fromkeys(told)) == [0x5D, 0x4D, 0x4A]
    assert len(told) == 6, "about one a second"
    bench.send(HeadCommand(PARAMETERS))
    assert list(dict.fromkeys(infos(bench.run(3.0)))) == [0xCA, 0x8A]


def test_greeting_is_answered_with_messages_of_the_known_sizes() -> None:
    bench = Bench()
    bench.run(5.0)
    bench.send(SendVersion())
    bench.send(SendBBUser())
    said = [message for _, message in bench.run(0.5) if not isinstance(message, Alive)]
    version, block, *fpga = said
    assert isinstance(version, VersionData)
    assert isinstance(block, BBUserData)
    assert block.valid
    assert block.is_dst
    assert not block.half_duplex
    assert block.serial == version.serial
    assert [type(each).__name__ for each in fpga] == ["FpgaCalData", "FpgaVersionData"]


def test_nothing_comes_from_a_head_without_parameters_or_for_another_node() -> None:
    bench = Bench()
    bench.run(5.0)
    bench.send(SendData())
    assert not [m for _, m in bench.run(2.0) if isinstance(m, HeadData)]
    bench.head.push(bench.t_ns, encode_command(HeadCommand(PARAMETERS), head=3))
    bench.head.push(bench.t_ns, encode_command(SendData(), head=3))
    assert not [m for _, m in bench.run(2.0) if isinstance(m, HeadData)]


@pytest.mark.parametrize("replies", [1, 2])
def test_each_request_has_its_replies(replies: int) -> None:
    bench = Bench(HeadOptions(replies_per_request=replies)).ready()
    bench.send(SendData())
    assert len([m for _, m in bench.run(3.0) if isinstance(m, HeadData)]) == replies
    bench.send(SendBBUser())
    (block,) = [m for _, m in bench.run(0.2) if isinstance(m, BBUserData)]
    assert block.half_duplex == (replies == 1)


def test_alives_stop_while_data_flow_and_come_back() -> None:
    bench = Bench().ready()
    bench.pings(2)
    heard: list[tuple[int, Message]] = []
    for _ in range(60):
        bench.send(SendData())
        heard += bench.run(0.1)
    assert infos(heard) == []
    assert HeadInf.CENTRED in HeadInf(infos(bench.run(5.0))[-1])
    bench.send(StopAlives())
    assert infos(bench.run(4.0)) == []


@pytest.mark.parametrize(
    ("range_m", "bins", "period_ms"), [(10.0, 400, 48.6), (75.0, 400, 111.0), (50.0, 794, 82.8), (2.0, 100, 22.6)]
)
def test_ping_period_is_the_longer_of_sound_and_wire_plus_ten_ms(range_m: float, bins: int, period_ms: float) -> None:
    bench = Bench().ready(head_command(Sonar(range_m=range_m, bins=bins)).parameters)
    for _ in range(4):
        bench.send(SendData())
    times = [t_ns for t_ns, m in bench.run(3.0, step_ns=MS) if isinstance(m, HeadData)]
    assert len(times) == 8
    assert (times[-1] - times[0]) / 7 / MS == pytest.approx(period_ms, abs=1.2)


def test_first_ping_waits_for_the_motor_and_the_next_does_not() -> None:
    bench = Bench().ready()
    bench.run(4.0)
    asked = bench.t_ns
    (first, _), (second, _) = bench.pings(2)
    assert first - asked > 600 * MS
    assert second - first < 60 * MS


def test_continuous_scan_goes_round_by_whole_steps_and_reverses() -> None:
    bench = Bench().ready()
    bearings = [data.bearing for _, data in bench.pings(205)]
    assert bearings[:3] == [3200, 3232, 3264]
    assert set(np.diff(bearings) % 6400) == {32}
    assert bearings[200] == bearings[0]
    bench.send(Reverse())
    later = [data for _, data in bench.pings(12)][-4:]
    assert set(np.diff([data.bearing for data in later]) % 6400) == {6400 - 32}
    assert all(Control.SCAN_RIGHT not in data.control for data in later)


def test_sector_sweeps_as_a_real_head_did(shared_data: Path) -> None:
    with (shared_data / "frames" / "micron_dst_headdata_index.csv").open() as file:
        real = list(csv.DictReader(file))
    wanted = [(int(row["bearing"]), int(row["sweep_code"]), bool(int(row["hdctrl"]) & 4)) for row in real]
    parameters = replace(PARAMETERS, control=Control(0x2309), left_limit=1778, right_limit=4622, step=32)
    sweep = Sweep()
    sweep.bearing = wanted[0][0]
    sweep.limit(parameters)
    beams = [sweep.next(parameters) for _ in wanted]
    assert [(beam.bearing, beam.sweep, beam.clockwise) for beam in beams] == wanted


def test_sector_across_astern_is_swept_from_left_to_right() -> None:
    parameters = replace(PARAMETERS, control=PARAMETERS.control & ~Control.CONTINUOUS, left_limit=5600, right_limit=800)
    bench = Bench().ready(parameters)
    bearings = [data.bearing for _, data in bench.pings(110)]
    assert {5600, 0, 800} <= set(bearings)
    assert not [b for b in bearings if 800 < b < 5600]


def test_change_of_settings_lets_at_most_two_old_replies_through() -> None:
    bench = Bench().ready()
    bench.pings(20)
    new = head_command(Sonar(range_m=5.0, bins=200, step_deg=0.9)).parameters
    bench.send(HeadCommand(new))
    after = [data for _, data in bench.pings(12)]
    old = [data for data in after if data.step == 32]
    assert 1 <= len(old) <= 2
    assert [(data.step, len(data.bins)) for data in after[len(old) :]] == [(16, 200)] * (12 - len(old))


def test_gains_change_alone_or_with_the_block_of_two_channels() -> None:
    gains = Gains(149, 149, 14, 14, 88, 88)
    bench = Bench().ready()
    bench.pings(4)
    bench.send(GainCommand(gains))
    data = bench.pings(6)[-1][1]
    assert (data.gain, data.ad_span, data.ad_low) == (88, 149, 14)
    assert data.ad_interval == PARAMETERS.ad_interval
    both = Bench()
    both.run(5.0)
    both.send(HeadCommand(PARAMETERS, gains))
    assert both.pings(1)[0][1].gain == 88


def test_four_bit_replies_take_half_the_bytes_and_keep_the_levels() -> None:
    narrow = replace(PARAMETERS, control=PARAMETERS.control & ~Control.ADC_8_ON, ad_low=40, ad_span=150)
    data = Bench().ready(narrow).pings(1)[0][1]
    assert len(data.bins) == PARAMETERS.bins // 2
    sent = (np.arange(PARAMETERS.bins) % 256).astype(int)
    inside = (sent > 50) & (sent < 185)
    assert np.abs(echoes_of(data).astype(int) - sent)[inside].max() <= 150 / 15 / 2 + 1


def test_replies_tell_the_settings_in_use() -> None:
    data = Bench().ready().pings(1)[0][1]
    assert Control.ADC_8_ON | Control.CONTINUOUS | Control.RAW | Control.HAS_MOTOR in data.control
    assert (data.ad_interval, data.step, data.gain) == (PARAMETERS.ad_interval, PARAMETERS.step, PARAMETERS.gain_1)
    assert data.device_type == 0x11
    assert data.bins == bytes(i % 256 for i in range(PARAMETERS.bins))


def test_bytes_leave_at_the_pace_of_the_line_in_pieces() -> None:
    bench = Bench().ready()
    bench.pings(2)
    bench.run(1.0)
    for _ in range(4):
        bench.send(SendData())
    sizes = []
    for _ in range(400):
        bench.t_ns += MS
        sizes.append(len(bench.head.tick(bench.t_ns)))
    assert sum(sizes) == 8 * (PARAMETERS.bins + 45)
    assert max(sizes) <= 12, "11.52 bytes a millisecond at 115200 baud"


def test_reboot_forgets_the_settings_and_centres_again() -> None:
    bench = Bench().ready()
    bench.pings(3)
    bench.send(ReBoot())
    told = infos(bench.run(6.0))
    assert told[0] == 0x5D
    assert told[-1] == 0x4A
    assert bench.head.settings is None


def test_settings_that_no_head_can_have_are_passed_over() -> None:
    bench = Bench()
    bench.run(5.0)
    for wrong in (replace(PARAMETERS, bins=0), replace(PARAMETERS, ad_interval=2), replace(PARAMETERS, step=0)):
        bench.send(HeadCommand(wrong))
    assert bench.head.settings is None


@settings(max_examples=40, deadline=None)
@given(st.lists(st.sampled_from(["ask", "set", "gain", "reverse", "version", "noise"]), max_size=12), st.binary())
def test_head_answers_the_same_however_commands_are_cut(words: list[str], noise: bytes) -> None:
    commands: dict[str, bytes] = {
        "ask": encode_command(SendData()),
        "set": encode_command(HeadCommand(replace(PARAMETERS, bins=60))),
        "gain": encode_command(GainCommand(Gains(1, 2, 3, 4, 5, 6))),
        "reverse": encode_command(Reverse()),
        "version": encode_command(SendVersion()),
        "noise": noise,
    }
    said = []
    for cut in (False, True):
        head = Head(ramp, HeadOptions(centring_s=0.1))
        out = b""
        for number, word in enumerate(words):
            t_ns = (number + 1) * 40 * MS
            pieces = [commands[word]] if not cut else [bytes([byte]) for byte in commands[word]]
            for piece in pieces:
                head.push(t_ns, piece)
            out += head.tick(t_ns)
        said.append(out + head.tick(10_000 * MS))
    assert said[0] == said[1]
