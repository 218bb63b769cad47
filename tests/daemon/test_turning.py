from __future__ import annotations

import pytest

from config.schema import Sonar
from daemon.turning import turning
from drivers.tritech.head import Head
from drivers.tritech.pace import WINDOW, Limits, Pace, limits
from tests.drivers.scripted_head import Line, ScriptedHead

MS = 1_000_000


def test_what_rules_a_ping() -> None:
    assert limits(400, 0.0135, 115200) == Limits(0.0135, 4450 / 115200)
    assert limits(400, 0.0135, 115200, takes_turns=True).ping_s == pytest.approx(0.0135 + 4450 / 115200 + 0.01)
    line, sound = Limits(0.0135, 0.0386), Limits(0.101, 0.0386)
    assert line.ping_s == pytest.approx(0.0486, abs=1e-4)
    assert sound.ping_s == pytest.approx(0.111)
    assert [line.ruling(0.050), sound.ruling(0.115), line.ruling(0.060)] == ["line", "sound", "other"]


def test_the_pace_is_a_mean_that_no_pause_spoils() -> None:
    pace = Pace()
    assert (pace.ping_s, pace.is_full) == (None, False)
    # Pings that are read two at a time still have the mean of their line.
    for number in range(WINDOW + 1):
        pace.ping(number // 2 * 100 * MS)
    assert pace.is_full
    assert pace.ping_s == pytest.approx(0.050)
    pace.ping(60_000 * MS)
    assert (pace.ping_s, pace.is_full) == (None, False)


def test_health_tells_the_time_of_a_turn() -> None:
    sonar = Sonar(bins=50, range_m=10.0, step_deg=1.8)
    assert turning(Head(sonar)) == {"s_per_revolution": None, "limited_by": None}
    line = Line(ScriptedHead(period=25 * MS), sonar).run(10)
    told = turning(line.head)
    assert told["s_per_revolution"] == pytest.approx(200 * 0.025, rel=0.15)
    line.head.stop()
    assert turning(line.head) == {"s_per_revolution": None, "limited_by": None}
