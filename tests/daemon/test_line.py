from __future__ import annotations

import os
from itertools import pairwise
from pathlib import Path

import pytest

from config.errors import PortError
from daemon.line import Line
from drivers.counters import Counters

SECOND_NS = 1_000_000_000


def test_a_port_that_stays_away_is_tried_ever_less_often(tmp_path: Path) -> None:
    line = Line("sonar", str(tmp_path / "ttyUSB0"), 115200)
    with pytest.raises(PortError):
        line.open()
    tries = []
    for t_ns in range(0, 30 * SECOND_NS, SECOND_NS // 20):
        if line.is_due(t_ns):
            assert not line.try_again(t_ns)
            tries.append(t_ns // 1_000_000)
    waits_ms = [later - earlier for earlier, later in pairwise(tries)]
    assert waits_ms[:4] == [200, 400, 800, 1600]
    assert set(waits_ms[4:]) == {1600}


def test_a_port_is_read_lost_and_opened_again(tmp_path: Path) -> None:
    ours, theirs = os.openpty()
    link = tmp_path / "tty"
    link.symlink_to(os.ttyname(theirs))
    line = Line("sonar", str(link), 115200)
    line.open()
    os.close(theirs)
    os.write(ours, b"abc")
    assert line.read(1) == b"abc"
    line.write(b"xy")
    assert os.read(ours, 9) == b"xy"
    os.close(ours)
    with pytest.raises(PortError):
        line.read(2)
    line.drop(2)
    health = line.health(SECOND_NS, Counters({"ping": 2}, 1, {"crc": 1}))
    assert (health["state"], health["lost"], health["rx_bytes"], health["tx_bytes"]) == ("lost", 1, 3, 2)
    assert line.descriptor is None
    assert line.read(3) == b""
    ours, theirs = os.openpty()
    link.unlink()
    link.symlink_to(os.ttyname(theirs))
    assert not line.is_due(3)
    assert line.is_due(SECOND_NS)
    assert line.try_again(SECOND_NS)
    assert line.is_open
    line.close()
    os.close(ours)
    os.close(theirs)
