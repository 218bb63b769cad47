"""Messages decode as recorded, encode as recorded, and survive the way there and back."""

from __future__ import annotations

import contextlib
import csv
import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.errors import FrameError
from config.schema import Sonar
from drivers.tritech import commands, messages, units
from drivers.tritech.framing import Deframer, Frame, wrap_reply
from drivers.tritech.headdata import Control, HeadData, HeadStatus, echoes_of
from drivers.tritech.settings import head_command

REGISTRY = commands.HeadParameters(
    control=Control(0x2309),
    head_type=2,
    transmit_1=units.transmit_word(325e3),
    transmit_2=units.transmit_word(675e3),
    receive_1=units.receive_word(325e3),
    receive_2=units.receive_word(675e3),
    pulse_us=units.pulse_us(10.0),
    range_scale=units.range_word(10.0),
    left_limit=1840,
    right_limit=4560,
    ad_span=149,
    ad_low=14,
    gain_1=210,
    gain_2=210,
    slope_1=90,
    slope_2=125,
    motor_time=25,
    step=64,
    ad_interval=33,
    bins=642,
    max_ad_buffer=1000,
    lockout_us=1356,
    major_axis=0,
)
REGISTRY_GAINS = commands.Gains(149, 149, 14, 11, 210, 210)


def recorded(shared_data: Path, name: str) -> bytes:
    return bytes.fromhex((shared_data / "frames" / f"{name}.hex").read_text())


def only_frame(data: bytes) -> Frame:
    deframer = Deframer()
    (frame,) = deframer.push(7, data)
    assert (deframer.skipped, deframer.pending, frame.data) == (0, 0, data)
    return frame


@pytest.mark.parametrize(
    ("name", "command"),
    [
        ("cmd_mtReBoot", commands.ReBoot()),
        ("cmd_mtSendBBUser", commands.SendBBUser()),
        ("cmd_mtSendVersion", commands.SendVersion()),
        ("cmd_mtStopAlives", commands.StopAlives()),
        ("cmd_mtSendData_time0", commands.SendData()),
        ("cmd_mtHeadCommand_reverse_0x0F", commands.Reverse()),
        ("superseaking_headcommand_from_seanet_registry", commands.HeadCommand(REGISTRY, REGISTRY_GAINS)),
    ],
)
def test_commands_are_those_of_tritech(shared_data: Path, name: str, command: commands.Command) -> None:
    data = recorded(shared_data, name)
    assert commands.encode_command(command) == data
    assert commands.decode_command(only_frame(data)) == command


@pytest.mark.parametrize(
    "name", ["sonia_mtHeadCommand_dst_82byte", "sonia_mtHeadCommand_short_0x1E_31byte", "usc_mtHeadCommand_82byte"]
)
def test_other_recorded_head_commands_survive(shared_data: Path, name: str) -> None:
    data = recorded(shared_data, name)
    assert commands.encode_command(commands.decode_command(only_frame(data))) == data


def test_all_headers_of_the_real_stream(shared_data: Path) -> None:
    frames = Deframer().push(0, (shared_data / "sonar" / "micron_dst_stream_20171102.bin").read_bytes())
    with (shared_data / "frames" / "micron_dst_headdata_index.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(frames) == len(rows) == 765
    for frame, row in zip(frames, rows, strict=True):
        data = messages.decode(frame)
        assert isinstance(data, HeadData)
        assert header_of(data) == {name: int(row[name]) for name in header_of(data)}
        assert messages.encode(data) == frame.data


def header_of(data: HeadData) -> dict[str, int]:
    return {
        "total_byte_count": 31 + len(data.bins),
        "device_type": data.device_type,
        "head_status": int(data.status),
        "sweep_code": data.sweep,
        "hdctrl": int(data.control),
        "range_scale": data.range_scale,
        "txn": data.transmit_word,
        "gain": data.gain,
        "slope": data.slope,
        "ad_span": data.ad_span,
        "ad_low": data.ad_low,
        "heading_offset": data.heading_offset,
        "ad_interval": data.ad_interval,
        "left_lim": data.left_limit,
        "right_lim": data.right_limit,
        "step": data.step,
        "bearing": data.bearing,
        "dbytes": len(data.bins),
    }


@pytest.mark.parametrize(
    ("frame", "header"),
    [
        ("micron_dst_headdata_left_limit_reversal", "micron_dst_headdata_left_limit_reversal"),
        ("superseaking_headdata_first_reconstructed", "superseaking_headdata_first"),
    ],
)
def test_single_recorded_pings(shared_data: Path, frame: str, header: str) -> None:
    data = messages.decode(only_frame(recorded(shared_data, frame)))
    assert isinstance(data, HeadData)
    assert header_of(data) == json.loads((shared_data / "frames" / f"{header}.json").read_text())


def test_recorded_alive_and_version(shared_data: Path) -> None:
    alive = messages.decode(only_frame(recorded(shared_data, "usc_mtAlive")))
    state = messages.HeadInf
    info = state.IN_CENTRE | state.MOTORING | state.MOTOR_ON | state.CLOCKWISE | state.NO_PARAMETERS
    assert alive == messages.Alive(info, time_ms=4266, position=3200, will_send=0x80)
    version = messages.decode(only_frame(recorded(shared_data, "superseaking_versiondata_reconstructed")))
    assert version == messages.VersionData(0x31, 0x11, 0, 45074, 0x2AEB, 2)
    for each, name in ((alive, "usc_mtAlive"), (version, "superseaking_versiondata_reconstructed")):
        assert messages.encode(each) == recorded(shared_data, name)


def test_recorded_user_block(shared_data: Path) -> None:
    data = recorded(shared_data, "superseaking_bbuserdata_reconstructed")
    block = messages.decode(only_frame(data))
    assert isinstance(block, messages.BBUserData)
    assert (block.valid, block.serial, block.is_dst, block.half_duplex) == (True, 186, False, False)
    assert block.frequencies_khz == (325, 675, 325, 675)
    assert messages.encode(block) == data


@pytest.mark.parametrize("dst", [True, False])
@pytest.mark.parametrize("half_duplex", [True, False])
def test_made_user_block(dst: bool, half_duplex: bool) -> None:
    block = messages.user_block(dst=dst, serial=4711, half_duplex=half_duplex)
    assert messages.decode(only_frame(messages.encode(block))) == block
    assert (block.valid, block.serial, block.is_dst, block.half_duplex) == (True, 4711, dst, half_duplex)


BYTE, WORD, LONG = st.integers(0, 255), st.integers(0, 65535), st.integers(0, 2**32 - 1)
REPLIES = st.one_of(
    st.builds(messages.Alive, BYTE.map(messages.HeadInf), LONG, WORD, BYTE),
    st.builds(messages.VersionData, BYTE, BYTE, WORD, LONG, WORD, BYTE),
    st.builds(messages.BBUserData, st.binary(min_size=250, max_size=250) | st.binary(min_size=161, max_size=161)),
    st.builds(messages.AuxData, st.binary(max_size=80)),
    st.builds(messages.FpgaCalData, st.binary(min_size=66, max_size=66)),
    st.builds(messages.FpgaVersionData, st.binary(min_size=14, max_size=14)),
    st.builds(messages.Other, st.sampled_from([0, 3, 5, 7, 13, 15]), st.binary(max_size=50)),
    st.builds(
        HeadData,
        bearing=WORD,
        bins=st.binary(max_size=90),
        ad_interval=WORD,
        step=BYTE,
        left_limit=WORD,
        right_limit=WORD,
        control=WORD.map(Control),
        status=BYTE.map(HeadStatus),
        heading_offset=WORD,
    ),
)


@settings(max_examples=150, deadline=None)
@given(REPLIES, st.integers(1, 254))
def test_messages_survive_encoding(message: messages.Message, node: int) -> None:
    frame = only_frame(messages.encode(message, node))
    assert messages.decode(frame) == message
    assert (frame.source, frame.destination) == (node, 255)


@settings(max_examples=150, deadline=None)
@given(BYTE.filter(lambda value: value not in {20, 21, 22, 41, 42, 70, 71, 72}), st.binary(max_size=120))
def test_any_payload_decodes_or_is_a_frame_error(message_id: int, payload: bytes) -> None:
    frame = Frame(0, wrap_reply(message_id, payload))
    for decode in (messages.decode, commands.decode_command):
        with contextlib.suppress(FrameError):
            assert decode(frame) is not None


def test_head_data_in_several_packets_is_told(shared_data: Path) -> None:
    data = bytearray(recorded(shared_data, "micron_dst_headdata_first"))
    data[9] = 200
    with pytest.raises(FrameError, match="several packets"):
        messages.decode(only_frame(bytes(data)))


def test_fields_that_do_not_fit_are_refused() -> None:
    with pytest.raises(FrameError, match="HeadCommand"):
        commands.encode_command(commands.HeadCommand(replace(REGISTRY, gain_1=300)))
    with pytest.raises(FrameError, match="SendData"):
        commands.encode_command(commands.SendData(2**32))


def test_head_command_of_the_configuration() -> None:
    command = head_command(Sonar(range_m=10, bins=400, sector_deg=(-90, 45), step_deg=0.9, gain_pct=50))
    parameters = command.parameters
    assert (parameters.left_limit, parameters.right_limit, parameters.step) == (1600, 4000, 16)
    assert (parameters.bins, parameters.ad_interval, parameters.gain_1, parameters.head_type) == (400, 53, 105, 0x11)
    assert (int(parameters.control), parameters.range_scale, parameters.pulse_us) == (0x230D, 100, 50)
    assert len(commands.encode_command(command)) == 66
    assert int(head_command(Sonar()).parameters.control) == 0x230F
    old = head_command(Sonar(head_type="non-dst")).parameters
    assert (old.head_type, old.transmit_1, old.receive_2) == (2, 0x02999999, 0x090A3D70)


@pytest.mark.parametrize(("mount", "inverted"), [(0.0, False), (90.0, False), (-30.0, True)])
def test_sector_is_turned_into_the_head(mount: float, inverted: bool) -> None:
    parameters = head_command(Sonar(sector_deg=(-40, 80), mount_deg=mount, inverted=inverted)).parameters
    limits = [math.degrees(units.angle_rad(each)) for each in (parameters.left_limit, parameters.right_limit)]
    wanted = (mount - 80, mount + 40) if inverted else (-40 - mount, 80 - mount)
    assert limits == pytest.approx([each % 360 for each in wanted], abs=0.06)


@pytest.mark.parametrize("range_m", [0.3, 1.0, 2.0, 10.0, 75.0, 300.0])
def test_sampling_reaches_the_range(range_m: float) -> None:
    interval, bins = units.sampling(range_m, 400, 1481.0)
    assert units.MIN_INTERVAL <= interval <= units.MAX_INTERVAL
    assert 1 <= bins <= units.MAX_BINS
    assert bins * units.bin_m(interval, 1481.0) == pytest.approx(range_m, rel=0.05)


def test_units_agree_with_recorded_figures() -> None:
    assert units.bin_m(133, 1475.0) * 794 == pytest.approx(50.0, rel=0.005)
    assert [units.angle_rad(each) for each in (3200, 4800, 0, 1600)] == pytest.approx(
        [0, 1.5708, 3.1416, 4.7124], abs=1e-4
    )
    assert units.angle_units(-1.5707963) == 1600
    assert (units.gain_byte(27.6), units.level_byte(42.4), units.level_byte(10.7)) == (58, 135, 34)
    assert units.frequency_hz(0x05333333) == pytest.approx(650e3, rel=1e-6)
    assert units.labelled_range_m(0x4000 | 100) == pytest.approx(3.048)


def test_four_bit_echoes() -> None:
    data = HeadData(0, b"\x0f\x81", 1, 1, 0, 0, control=Control(0x2304), ad_low=40, ad_span=75)
    assert echoes_of(data).tolist() == [0, 115, 80, 45]
    assert echoes_of(data, high_nibble_first=False).tolist() == [115, 0, 45, 80]
    loud = replace(data, ad_low=250, ad_span=255)
    assert echoes_of(loud).tolist() == [0, 255, 255, 255]
    assert echoes_of(replace(data, control=Control(0x2305))).tolist() == [15, 129]
    assert not echoes_of(data).flags.writeable
