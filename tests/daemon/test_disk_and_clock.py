"""A disk that fills up while the acquisition records, and a clock that is set while it does."""

from __future__ import annotations

import errno
import resource
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import daemon.clock
from config.schema import Config, Sonar
from daemon.clock import Clock
from daemon.recorder import Recorder
from daemon.snapshots import Snapshot
from drivers.log import Damage, LogWriter, read_log
from drivers.log.segment import Segment
from drivers.records import Chunk, ClockPair, Event
from tools.bench.acq_rig import Rig
from tools.emulator.head import Head, HeadOptions, Sounding

HOUR_NS = 3_600_000_000_000
UNLIMITED = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)


def silence(sounding: Sounding) -> NDArray[np.uint8]:
    return np.zeros(sounding.bins, dtype=np.uint8)


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    with Rig(tmp_path, {}, Sonar(bins=100)) as made:
        yield made


class Scan:
    """An emulated head that answers the acquisition."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._head = Head(silence, HeadOptions(centring_s=0.2), time.monotonic_ns())

    def run(self, pings: int) -> None:
        """Serve until so many more pings are published."""
        end_s, wanted = time.monotonic() + 30.0, self._rig.told["ping"] + pings
        while self._rig.told["ping"] < wanted:
            assert time.monotonic() < end_s, self._rig.health
            wire, t_ns = self._rig.wires["sonar"], time.monotonic_ns()
            self._head.push(t_ns, wire.read())
            wire.write(self._head.tick(t_ns))
            self._rig.listen(0.003)

    def run_until(self, state: str) -> None:
        """Serve until an event of the disk tells ``state``."""
        for _ in range(500):
            if any(kind == "disk" and fields["state"] == state for _, kind, fields in self._rig.events):
                return
            self.run(1)
        raise AssertionError(f"the disk was never {state}")


def test_a_full_disk_stops_neither_sonar_nor_pings_and_loses_nothing(rig: Rig) -> None:
    scan = Scan(rig.start())
    scan.run(10)
    # As if the disk took no byte more: this process may not write to any file.
    resource.prlimit(rig.pid, resource.RLIMIT_FSIZE, (1, resource.RLIM_INFINITY))
    scan.run_until("refused")
    scan.run(30)
    resource.prlimit(rig.pid, resource.RLIMIT_FSIZE, UNLIMITED)
    scan.run_until("writing again")
    scan.run(10)
    rig.stop()
    told = [fields["state"] for _, kind, fields in rig.events if kind == "disk"]
    assert told == ["refused", "writing again"]
    sent = bytes(rig.wires["sonar"].sent)
    received = rig.received("sonar")
    assert sent.startswith(received), "no wrong byte, and none lost in between"
    assert len(sent) - len(received) < 2000, "but for what came after the end"
    damage = Damage()
    kinds = [each.kind for each in read_log(rig.logs, damage) if isinstance(each, Event)]
    assert (kinds[0], kinds[-1], damage.records_missing) == ("started", "stopped", 0)


def recorder(folder: Path, told: list[Snapshot]) -> Recorder:
    return Recorder(LogWriter(folder, "s", Config(), {}), folder, 0.0, Clock(), told.append)


def test_what_a_full_disk_costs_is_counted_and_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[Snapshot] = []
    log = recorder(tmp_path, told)
    log.chunk("sonar", "rx", b"before")
    log.start_sync()

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Segment, "write_chunk", full)
        for number in range(200):
            log.chunk("sonar", "rx", number.to_bytes(2, "little") * 500)
    assert log.start_sync() is None
    lost = log.health()["log"]
    assert isinstance(lost, dict)
    log.close()
    damage = Damage()
    records = list(read_log(tmp_path, damage))
    again = [each for each in records if isinstance(each, Event) and each.fields["state"] == "writing again"]
    assert [each.fields["lost_records"] for each in again] == [lost["lost_records"]]
    data = [each.data for each in records if isinstance(each, Chunk)]
    assert 0 < len(data) < 201
    missing = lost["lost_records"]
    assert isinstance(missing, int)
    assert damage.records_missing == missing > 100, "none is missing without being counted"
    assert "full" in str([each.fields for each in told])


class SteppedTime:
    """Time as the system tells it, whose UTC is set back by an hour and later forward by two, as NTP may do."""

    def __init__(self) -> None:
        self._count = 0

    def monotonic_ns(self) -> int:
        self._count += 1
        return 10**12 + self._count * 10**8

    def time_ns(self) -> int:
        step_ns = 0 if self._count < 40 else -HOUR_NS if self._count < 80 else HOUR_NS
        return 1_700_000_000 * 10**9 + self._count * 10**8 + step_ns


def test_a_step_of_utc_reorders_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(daemon.clock, "time", SteppedTime())
    log = recorder(tmp_path, [])
    sent = []
    for number in range(120):
        chunk = log.chunk("sonar", "rx", bytes([number]))
        sent.append(chunk.data)
        log.tick(chunk.t_ns)
    log.close()
    records = list(read_log(tmp_path))
    times = [record.t_ns for record in records]
    assert times == sorted(times)
    assert [each.data for each in records if isinstance(each, Chunk)] == sent
    offsets = {(each.utc_ns - each.t_ns) // HOUR_NS for each in records if isinstance(each, ClockPair)}
    assert len(offsets) > 1, "the log tells the step"
