from __future__ import annotations

import errno
from pathlib import Path

import pytest

from config.errors import LogError
from config.schema import Config
from daemon.clock import Clock, started
from daemon.recorder import Recorder
from daemon.snapshots import Snapshot
from drivers.log import LogWriter, read_header, read_log
from drivers.log.segment import Segment
from drivers.records import Chunk, ClockPair, Event


def recorder(folder: Path, told: list[Snapshot], low_mib: float = 0.0) -> Recorder:
    return Recorder(LogWriter(folder, "s", Config(), {}), folder, low_mib, Clock(), told.append)


def test_what_happened_is_in_the_log_in_its_order(tmp_path: Path) -> None:
    told: list[Snapshot] = []
    log = recorder(tmp_path, told)
    log.event("started", {"pid": 1})
    log.chunk("sonar", "tx", b"ask")
    log.chunk("sonar", "rx", b"reply")
    log.tick(0)
    log.close()
    started_at, sent, got, pair = read_log(tmp_path)
    assert isinstance(started_at, Event)
    assert isinstance(sent, Chunk)
    assert isinstance(got, Chunk)
    assert isinstance(pair, ClockPair)
    assert (sent.direction, sent.data, got.direction, got.data) == ("tx", b"ask", "rx", b"reply")
    assert started_at.t_ns <= sent.t_ns <= got.t_ns <= pair.t_ns
    assert [(each.topic, each.fields["kind"]) for each in told] == [("event", "started")]


def test_a_disk_that_refuses_is_told_once_and_recording_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[Snapshot] = []
    log = recorder(tmp_path, told)
    log.chunk("sonar", "rx", b"before")
    assert log.start_sync() is None

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Segment, "write_chunk", full)
        log.chunk("sonar", "rx", b"while full")
        now_ns, _ = Clock().now()
        for t_s in range(1, 5):
            log.tick(now_ns + t_s * 2 * 10**9)
        assert "full" in str(log.health()["log"])
    assert [each.fields["kind"] for each in told] == ["disk"]
    log.start_sync()
    log.close()
    states = [each.fields["fields"]["state"] for each in told]  # type: ignore[index, call-overload]
    assert states == ["refused", "writing again"]
    data = [record.data for record in read_log(tmp_path) if isinstance(record, Chunk)]
    assert data == [b"before", b"while full"]


def test_a_low_disk_is_told_once(tmp_path: Path) -> None:
    told: list[Snapshot] = []
    log = recorder(tmp_path, told, low_mib=1e12)
    for t_s in range(0, 30, 6):
        log.tick(t_s * 10**9)
    log.close()
    assert len(told) == 1
    assert log.health()["disk_is_low"] is True


def test_a_session_goes_on_in_its_next_segment(tmp_path: Path) -> None:
    first = LogWriter(tmp_path, "s", Config(), {})
    first.write(ClockPair(1, 1))
    first.sync()  # and then it dies: the segment stays a .part
    with pytest.raises(LogError, match="exists"):
        LogWriter(tmp_path, "s", Config(), {})
    second = LogWriter(tmp_path, "s", Config(), {}, resume=True)
    second.write(ClockPair(2, 2))
    second.close()
    assert list(read_log(tmp_path)) == [ClockPair(1, 1), ClockPair(2, 2)]
    header = read_header(tmp_path / "s-0002.mcap")
    assert (header.segment, header.previous) == (2, "s-0001.mcap")
    first.close()


def test_a_fast_clock_runs_from_its_origin() -> None:
    clock = started(10.0)
    t_ns, utc_ns = clock.now()
    later_t_ns, later_utc_ns = Clock(clock.rate, clock.origin_ns).now()
    assert t_ns <= later_t_ns
    assert utc_ns - clock.origin_ns[1] == t_ns - clock.origin_ns[0]
    assert later_utc_ns - utc_ns == later_t_ns - t_ns
