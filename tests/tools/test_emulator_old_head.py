"""The emulated head that is not DST, the wire that both sides share, and the instrument on the auxiliary port."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from config.schema import Sonar
from drivers.readings import Ping
from drivers.tritech.commands import HeadCommand, ReBoot, SendBBUser, SendData, encode_command
from drivers.tritech.decoder import TritechDecoder
from drivers.tritech.framing import Deframer
from drivers.tritech.headdata import Control, HeadData, HeadStatus, decode_head_data
from drivers.tritech.messages import Alive, AuxData, BBUserData, FpgaCalData, FpgaVersionData
from drivers.tritech.settings import gains, head_command
from tests.tools.head_bench import MS, Bench, ramp
from tools.emulator.dive import Dive, DiveOptions
from tools.emulator.head import Head, HeadOptions
from tools.emulator.line import Line
from tools.emulator.record import record
from tools.emulator.site import SITES
from tools.emulator.sweep import Sweep
from tools.emulator.vehicle import VehicleOptions

OLD = HeadOptions(dst=False)
SONAR = Sonar(head_type="non-dst", bins=100, dual_channel=True)
COMMAND = head_command(SONAR)
SECTOR = replace(COMMAND.parameters, control=Control(0x230D), left_limit=2400, right_limit=4000, step=64)


def real_replies(shared_data: Path) -> list[HeadData]:
    data = (shared_data / "sonar" / "superseaking_v4log_headdata_reconstructed.bin").read_bytes()
    return [decode_head_data(frame) for frame in Deframer().push(0, data)]


def test_sector_sweeps_as_a_real_seaking_did(shared_data: Path) -> None:
    real = real_replies(shared_data)
    wanted = [(each.bearing, each.sweep, Control.SCAN_RIGHT in each.control) for each in real]
    sweep = Sweep(dst=False)
    sweep.limit(SECTOR)
    sweep.bearing, sweep.clockwise = wanted[0][0], wanted[0][2]
    beams = [sweep.next(SECTOR) for _ in wanted]
    assert [(beam.bearing, beam.sweep, beam.clockwise) for beam in beams] == wanted


def test_replies_are_of_the_family_of_real_ones(shared_data: Path) -> None:
    real = real_replies(shared_data)[0]
    low = replace(COMMAND.parameters, control=Control(0x2309))
    bench = Bench(OLD).ready(low)
    data = bench.pings(1)[0][1]
    assert (data.device_type, data.transmit_word, data.slope) == (real.device_type, real.transmit_word, real.slope)
    assert data.status == real.status
    assert Control.CHANNEL_2 not in data.control


def test_greeting_has_no_logic_of_a_dst_head() -> None:
    bench = Bench(OLD)
    bench.run(5.0)
    bench.send(SendBBUser())
    said = [message for _, message in bench.run(0.5) if not isinstance(message, Alive)]
    assert [type(message) for message in said] == [BBUserData]
    assert not [message for message in said if isinstance(message, FpgaCalData | FpgaVersionData)]
    assert isinstance(said[0], BBUserData)
    assert not said[0].is_dst


@pytest.mark.parametrize(("right", "step"), [(True, 32), (False, -32)])
def test_it_goes_round_the_way_it_is_told(right: bool, step: int) -> None:
    control = (
        COMMAND.parameters.control | Control.SCAN_RIGHT if right else COMMAND.parameters.control & ~Control.SCAN_RIGHT
    )
    bench = Bench(OLD)
    bench.run(5.0)
    bench.send(HeadCommand(replace(COMMAND.parameters, control=control), gains(SONAR)))
    bearings = np.array([data.bearing for _, data in bench.pings(205)])
    assert bearings[0] == 3200
    assert set(np.diff(bearings) % 6400) == {step % 6400}


def test_it_samples_800_bins_and_no_more() -> None:
    bench = Bench(OLD)
    bench.run(5.0)
    bench.send(HeadCommand(replace(COMMAND.parameters, bins=801)))
    assert bench.head.settings is None
    bench.send(HeadCommand(replace(COMMAND.parameters, bins=800)))
    assert bench.head.settings is not None


def test_whole_dives_are_made_with_it_half_duplex() -> None:
    options = HeadOptions(dst=False, replies_per_request=1, aux_hz=1.0)
    dive = Dive(SITES["pool"](), 1, DiveOptions(stations=1, head=options, vehicle=VehicleOptions(rest_pings=60)))
    decoder = TritechDecoder(SONAR)
    sent = [
        (piece.t_ns, piece.data) for piece in record(dive, SONAR) if (piece.port, piece.direction) == ("sonar", "rx")
    ]
    pings = [each for t_ns, data in sent for each in decoder.push(t_ns, data) if isinstance(each, Ping)]
    assert len(pings) >= 60
    assert decoder.counters.frames["aux_data"] >= 3


def test_a_request_during_a_reply_spoils_both() -> None:
    bench = Bench(HeadOptions(replies_per_request=1)).ready()
    bench.pings(1)
    bench.run(0.5)
    bench.send(SendData())
    bench.t_ns += 31 * MS  # the sound has come back and the reply is on the wire
    bench.head.tick(bench.t_ns)
    assert bench.head.pings == 3
    bench.head.push(bench.t_ns, encode_command(SendData()))
    deframer, got = Deframer(), []
    for _ in range(200):
        bench.t_ns += 5 * MS
        got += deframer.push(bench.t_ns, bench.head.tick(bench.t_ns))
    got += deframer.expire(bench.t_ns + 1000 * MS)
    assert bench.head.pings == 3, "the request was not understood"
    frames = [decode_head_data(frame) for frame in got if frame.message_id == 2]
    clean = bytes(each % 256 for each in range(len(ramp_bins(bench.head))))
    assert all(frame.bins != clean for frame in frames), "nor was the reply whole"


def ramp_bins(head: Head) -> bytes:
    assert head.settings is not None
    return bytes(head.settings.bins)


def test_bytes_collide_only_where_they_meet() -> None:
    line = Line(10_000)  # one byte a millisecond
    line.send(0, b"\xff\x0f\xf0\xff\xff")
    assert line.take(1 * MS) == b"\xff"
    assert line.collide(2 * MS, b"\x3c\xaa\x55\x77") == b"\x30\xaa\x55\x77"
    assert line.take(20 * MS) == b"\x0f\x30\xaa\x55"
    assert line.collide(30 * MS, b"quiet") == b"quiet"


def test_an_instrument_speaks_between_replies() -> None:
    head = Head(ramp, HeadOptions(aux_hz=5.0), aux=lambda t_ns: f"{t_ns / 1e9:.3f}m\r\n".encode())
    bench = Bench()
    bench.head = head
    bench.ready()
    for _ in range(10):
        bench.send(SendData())
    heard = [message for _, message in bench.run(2.0)]
    aux = [message for message in heard if isinstance(message, AuxData)]
    assert 9 <= len(aux) <= 11
    assert aux[0].data.endswith(b"m\r\n")
    assert len([message for message in heard if isinstance(message, HeadData)]) >= 8


def test_power_and_motor_tell_until_the_head_is_set_again() -> None:
    towards: list[float] = []

    def note(sounding: object) -> np.ndarray[tuple[int], np.dtype[np.uint8]]:
        towards.append(sounding.bearing_rad)  # type: ignore[attr-defined]
        return np.zeros(100, dtype=np.uint8)

    bench = Bench()
    bench.head = Head(note)
    bench.ready(COMMAND.parameters)
    assert bench.pings(1)[0][1].status == HeadStatus.FULL_RANGE_8_BIT
    bench.head.fail(HeadStatus.POWER_LOST)
    bench.head.fail(HeadStatus.MOTOR_ERROR, 320)
    data = bench.pings(8)[-1][1]
    assert data.status == HeadStatus.FULL_RANGE_8_BIT | HeadStatus.POWER_LOST | HeadStatus.MOTOR_ERROR
    turned = np.diff(np.unwrap(towards))
    assert np.degrees(turned).max() == pytest.approx(1.8 + 18.0)
    bench.send(HeadCommand(COMMAND.parameters))
    assert bench.pings(8)[-1][1].status == HeadStatus.FULL_RANGE_8_BIT
    bench.head.fail(HeadStatus.POWER_LOST)
    bench.send(ReBoot())
    bench.ready(COMMAND.parameters)
    assert bench.pings(1)[0][1].status == HeadStatus.FULL_RANGE_8_BIT
