"""Logs of real instruments, read sentence by sentence: every reading and every count as it stands in the golden file.

The logs are those of the gpsd regression tests (sounder, Humminbird, pypilot, True North, B&G); the
golden values were compared once with the bare fields of their sentences.
"""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any, Final

import pytest

from config.schema import Feed, Site
from drivers.readings import Altitude, Depth, Heading, Reading
from tests.drivers.feedkit import opinions, plain, run

GOLDEN: Final = Path(__file__).with_name("golden")
LOGS: Final = {
    "gpsd_sounder.nmea": 2,
    "gpsd_humminbird-M37.nmea": 8,
    "gpsd_pypilot.nmea": 8,
    "gpsd_tnt-revolution.nmea": 4,
    "gpsd_bundg_zeus_9_filtered.nmea": 20,
}
"""Sentences a second, so that their changes have about the time that they had: the logs hold none."""


def row(reading: Reading) -> list[Any]:
    assert isinstance(reading, Heading | Depth | Altitude)
    kind, value = plain(reading)
    return [reading.t_ns // 1_000_000, kind, round(value, 4), reading.source.split(":")[1], reading.quality]


def summary(path: Path) -> dict[str, Any]:
    """Readings and counts of a log whose lines come at an even pace over a network."""
    period_ns = 1_000_000_000 // LOGS[path.name]
    lines = [line for line in path.read_bytes().splitlines(keepends=True) if line[:1] in b"$!"]
    feed = Feed(port="socket://log:1", provides=("heading", "depth", "altitude"))
    readings, counters = run(feed, ((index * period_ns, line) for index, line in enumerate(lines)), Site())
    return {
        "sentences": len(lines),
        "frames": dict(sorted(counters.frames.items())),
        "bad": dict(counters.bad),
        "skipped_bytes": counters.skipped_bytes,
        "reasons": dict(Counter(reason for _, reason in opinions(readings) if reason)),
        "readings": [row(each) for each in readings],
    }


@pytest.mark.parametrize("name", LOGS)
def test_a_real_log_says_what_it_said(shared_data: Path, name: str) -> None:
    golden = json.loads((GOLDEN / f"{Path(name).stem.lower()}.json").read_text())
    assert summary(shared_data / "feeds" / name) == golden
    assert sum(golden["frames"].values()) == golden["sentences"]
