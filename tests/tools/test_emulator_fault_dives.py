"""Whole dives on which something goes wrong: what the host sees, and that it comes through."""

from __future__ import annotations

import json
import os
import time
from math import degrees
from pathlib import Path

import numpy as np
import pytest

from config.schema import Feed, Sonar
from config.schema import Site as SiteSection
from drivers.decoders import feed_decoder
from drivers.readings import Depth, Heading, Ping, Reading
from drivers.tritech.decoder import TritechDecoder
from drivers.tritech.framing import Deframer
from drivers.tritech.headdata import HeadStatus, decode_head_data
from drivers.tritech.messages import Alive, HeadInf, decode
from tests.tools.silence import Silence
from tools.cli import main
from tools.emulator.dive import Dive, DiveOptions
from tools.emulator.faults import Fault
from tools.emulator.record import Piece, record
from tools.emulator.serve import Emulation
from tools.emulator.site import SITES
from tools.emulator.truth import truth_of
from tools.emulator.vehicle import VehicleOptions

S = 1_000_000_000
SONAR = Sonar(bins=100, range_m=5.0)
REST = VehicleOptions(rest_pings=300)
AT_S = 8.0


@pytest.fixture(autouse=True)
def silence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tools.emulator.dive.EchoModel", Silence)


def fault(kind: str, **more: object) -> Fault:
    return Fault.model_validate({"kind": kind, "at_s": AT_S, **more})


def dive_with(*faults: Fault, seed: int = 1) -> tuple[Dive, list[Piece]]:
    dive = Dive(SITES["pool"](), seed, DiveOptions(stations=1, vehicle=REST, faults=faults))
    return dive, list(record(dive, SONAR))


def said(pieces: list[Piece], port: str = "sonar") -> list[Piece]:
    return [piece for piece in pieces if (piece.port, piece.direction) == (port, "rx")]


def pings(pieces: list[Piece]) -> tuple[list[Ping], TritechDecoder]:
    decoder = TritechDecoder(SONAR)
    readings = [reading for piece in said(pieces) for reading in decoder.push(piece.t_ns, piece.data)]
    return [reading for reading in readings if isinstance(reading, Ping)], decoder


def begun_ns(dive: Dive) -> int:
    return dive.spells[0].from_ns


@pytest.mark.parametrize(
    ("kind", "more", "least_gap_s", "most_gap_s"),
    [
        ("hangup", {"for_s": 3.0}, 3.0, 5.0),
        ("stall", {"for_s": 1.5}, 1.4, 2.5),  # what was held up is dated one after the other, as lines carry it
        ("half_frame", {}, 0.0, 2.5),
        ("garbage", {"count": 3000}, 0.25, 2.5),
        ("drop", {"rate": 0.01, "for_s": 4.0}, 0.0, 4.0),
        ("double", {"rate": 0.01, "for_s": 4.0}, 0.0, 4.0),
        ("flip", {"rate": 0.01, "for_s": 4.0}, 0.0, 6.0),
        ("baud", {"baud": 38400, "for_s": 2.0}, 2.0, 5.0),
        ("power_cut", {"for_s": 1.0}, 5.0, 12.0),
        ("power_loss", {}, 0.0, 3.0),
        ("motor_error", {}, 0.0, 3.0),
    ],
)
def test_the_host_comes_through(kind: str, more: dict[str, object], least_gap_s: float, most_gap_s: float) -> None:
    port = {} if kind.startswith(("power", "motor")) else {"port": "sonar"}
    dive, pieces = dive_with(fault(kind, **port, **more))
    assert dive.done
    got, _ = pings(pieces)
    times = np.array([ping.t_ns for ping in got])
    after = times[times > begun_ns(dive) - S]
    gap_s = np.diff(after).max() / S
    assert least_gap_s <= gap_s <= most_gap_s
    assert len(after) > 100, "and goes on"
    assert dive_with(fault(kind, **port, **more))[1] == pieces, "a failure can be had again"


def test_a_power_cut_makes_the_head_boot_without_settings() -> None:
    dive, pieces = dive_with(fault("power_cut", for_s=1.0))
    deframer = Deframer()
    heard = [(piece.t_ns, decode(frame)) for piece in said(pieces) for frame in deframer.push(piece.t_ns, piece.data)]
    dark_ns = begun_ns(dive), begun_ns(dive) + S
    assert not [t_ns for t_ns, _ in heard if dark_ns[0] + S // 50 < t_ns < dark_ns[1]]
    alives = [message.info for t_ns, message in heard if isinstance(message, Alive) and t_ns > dark_ns[1]]
    assert alives[0] == 0x5D
    assert HeadInf.NO_PARAMETERS not in alives[-1]


@pytest.mark.parametrize(
    ("kind", "bit"), [("power_loss", HeadStatus.POWER_LOST), ("motor_error", HeadStatus.MOTOR_ERROR)]
)
def test_status_bits_stand_until_the_host_sets_the_head_again(kind: str, bit: HeadStatus) -> None:
    dive, pieces = dive_with(fault(kind))
    deframer = Deframer()
    frames = [(piece.t_ns, frame) for piece in said(pieces) for frame in deframer.push(piece.t_ns, piece.data)]
    flags = [(t_ns, bit in decode_head_data(frame).status) for t_ns, frame in frames if frame.message_id == 2]
    marked = [t_ns for t_ns, is_set in flags if is_set]
    assert 2 <= len(marked) <= 12
    assert begun_ns(dive) <= marked[0] <= marked[-1] <= begun_ns(dive) + S


def feed_readings(*faults: Fault) -> tuple[Dive, list[Reading]]:
    dive, pieces = dive_with(*faults)
    decoder = feed_decoder(Feed(max_turn_deg_s=3600.0, max_dive_m_s=100.0), SiteSection())
    return dive, [reading for piece in said(pieces, "feed") for reading in decoder.push(piece.t_ns, piece.data)]


def test_a_stale_feed_repeats_itself_and_wakes_up() -> None:
    dive, readings = feed_readings(fault("stale", for_s=2.0))
    start = begun_ns(dive)
    for kind in (Heading, Depth):
        rows = [
            (each.t_ns, each.heading_rad if isinstance(each, Heading) else each.depth_m)
            for each in readings
            if isinstance(each, kind) and isinstance(each, Heading | Depth)
        ]
        assert len({value for t_ns, value in rows if start + S < t_ns < start + 2 * S}) == 1
        assert len({value for t_ns, value in rows if t_ns > start + 3 * S}) > 1


def test_a_lying_feed_jumps_and_comes_back() -> None:
    dive, readings = feed_readings(fault("jump", heading_deg=90.0, depth_m=-0.5, for_s=2.0))
    start = begun_ns(dive)
    within = [each for each in readings if start + S < each.t_ns < start + 2 * S]
    later = [each for each in readings if each.t_ns > start + 3 * S]
    turn = [degrees(np.mean([e.heading_rad for e in part if isinstance(e, Heading)])) for part in (within, later)]
    depth = [np.mean([e.depth_m for e in part if isinstance(e, Depth)]) for part in (within, later)]
    assert turn[0] - turn[1] == pytest.approx(90.0, abs=4.0)
    assert depth[0] - depth[1] == pytest.approx(-0.5, abs=0.03)


def test_truth_tells_the_faults_that_came() -> None:
    dive, _ = dive_with(fault("garbage", port="feed"), Fault(kind="stall", port="sonar", at_s=9000.0))
    (told,) = json.loads(json.dumps(truth_of(dive)))["faults"]
    assert told == {"kind": "garbage", "port": "feed", "at_s": AT_S, "from_ns": begun_ns(dive), "to_ns": begun_ns(dive)}


def test_command_records_faults_of_a_script(tmp_path: Path) -> None:
    script, truth = tmp_path / "faults.toml", tmp_path / "truth.json"
    script.write_text('[[fault]]\nkind = "flip"\nport = "feed"\nevery_s = 3.0\nfor_s = 1.0\nrate = 0.05\n')
    words = ["--site", "pool", "--stations", "1", "--record", str(tmp_path / "dive"), "--truth", str(truth)]
    assert main(["emulate", *words, "--faults", str(script)]) == 0
    assert len(json.loads(truth.read_text())["faults"]) >= 2


class Plug:
    """A host that looks at the sonar's name again and again, in the emulation's own loop."""

    def __init__(self, emulation: Emulation) -> None:
        self.seen: list[str] = []
        self._link = emulation.sonar.link
        self._handle: int | None = None
        self._end_s = time.monotonic() + 20.0

    def look(self) -> bool:
        state = "there" if self._link.is_symlink() else "gone"
        if self._handle is None and state == "there":
            self._handle = os.open(self._link, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            os.write(self._handle, b"hello")
        elif self._handle is not None and state == "gone":
            try:
                state = "read nothing" if os.read(self._handle, 99) == b"" else "read"
            except OSError:
                state = "lost"
            os.close(self._handle)
            self._handle = None
        if not self.seen or self.seen[-1] != state:
            self.seen.append(state)
        assert time.monotonic() < self._end_s
        return self.seen.count("there") == 2

    def close(self) -> None:
        if self._handle is not None:
            os.close(self._handle)


def test_a_hang_up_takes_the_port_from_the_host_and_gives_it_back(tmp_path: Path) -> None:
    events: list[dict[str, object]] = []
    options = DiveOptions(faults=(Fault(kind="hangup", port="sonar", at_s=1.0, for_s=2.0),))
    emulation = Emulation(tmp_path, "pool", 1, 20.0, options, lambda event: events.append(dict(event)))
    plug = Plug(emulation)
    try:
        emulation.serve(plug.look)
        assert plug.seen[0] == "there"
        assert plug.seen[-1] == "there"
        assert {"lost", "read nothing"} & set(plug.seen), "the open port told that it was gone"
        assert (tmp_path / "feed").is_symlink(), "the other port stayed"
    finally:
        plug.close()
        emulation.close()
    assert [event["event"] for event in events] == ["ready", "fault"]
    assert (events[1]["kind"], events[1]["port"]) == ("hangup", "sonar")
    assert not list(tmp_path.iterdir())
