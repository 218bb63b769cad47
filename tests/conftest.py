"""Fixtures that every test may use."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.schema import Config, Feed, Recording, Site
from drivers.log import LogWriter
from drivers.records import Chunk, ClockPair, Direction, Event

DIVE_UTC_NS = 1_700_000_000_000_000_000
SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real recordings that stands beside the checkout; the test is skipped where it is absent."""
    if not SHARED_DATA.is_dir():
        pytest.skip("no real recordings beside this checkout (../shared/data)")
    return SHARED_DATA


@pytest.fixture(scope="session")
def dive_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the log of an emulated dive of two stations, in several segments, with clock pairs and events."""
    from tools.emulator.dive import Dive, DiveOptions
    from tools.emulator.record import record
    from tools.emulator.site import SITES

    folder = tmp_path_factory.mktemp("dive")
    recording = Recording(segment_min=0.4)
    config = Config(site=Site(name="keyhole"), feed=(Feed(name="feed"),), recording=recording)
    with LogWriter(folder, "dive", config, {"lacuna": "test"}) as log:
        log.write(ClockPair(0, DIVE_UTC_NS))
        log.write(Event(0, DIVE_UTC_NS, "started"))
        end_ns = 0
        for piece in record(Dive(SITES["keyhole"](), 1, DiveOptions(stations=2))):
            end_ns = piece.t_ns
            direction: Direction = "rx" if piece.direction == "rx" else "tx"
            log.write(Chunk(end_ns, DIVE_UTC_NS + end_ns, piece.port, direction, piece.data))
        log.write(Event(end_ns, DIVE_UTC_NS + end_ns, "stopped"))
    return folder
