"""A disk that takes its time holds nobody up, and one that fails is told."""

from __future__ import annotations

import errno
import os
import threading
import time
from pathlib import Path

import pytest

from config.errors import LogError
from config.schema import Config
from drivers.log import Damage, Follower, LogWriter, read_log
from drivers.log.writer import SYNC_NS
from drivers.records import Chunk


def chunk(t_ns: int) -> Chunk:
    return Chunk(t_ns, 10**18 + t_ns, "sonar", "rx", b"x" * 100)


def wait_until_idle(log: LogWriter) -> None:
    end_s = time.monotonic() + 10.0
    while log._syncer.is_busy:
        assert time.monotonic() < end_s
        time.sleep(0.005)


def test_a_slow_sync_does_not_hold_up_the_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    may_end, calls = threading.Event(), []

    def slow(descriptor: int) -> None:
        calls.append(descriptor)
        assert may_end.wait(10.0)

    monkeypatch.setattr(os, "fdatasync", slow)
    log = LogWriter(tmp_path, "s", Config(), {})
    try:
        for second in range(1, 6):
            log.write(chunk(second * SYNC_NS))
            log.tick((second + 1) * SYNC_NS)
        assert len(list(read_log(tmp_path))) == 5, "all is flushed while the first sync lasts"
        assert log._syncer.is_busy
    finally:
        may_end.set()
    wait_until_idle(log)
    log.tick(10 * SYNC_NS)
    wait_until_idle(log)
    assert len(calls) == 2, "what came meanwhile is synced next"
    log.close()


def test_a_failed_sync_is_told_and_a_new_segment_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    log = LogWriter(tmp_path, "s", Config(), {})
    log.write(chunk(1))
    with monkeypatch.context() as patch:
        patch.setattr(os, "fdatasync", broken)
        log.tick(2 * SYNC_NS)
        wait_until_idle(log)
    with pytest.raises(LogError, match="Input/output"):
        log.tick(2 * SYNC_NS + 1)
    assert not log.is_writing
    log.write(chunk(5 * SYNC_NS))
    log.flush()
    assert log.is_writing
    log.close()
    assert [record.t_ns for record in read_log(tmp_path)] == [1, 5 * SYNC_NS]


def test_the_end_of_a_segment_holds_nobody_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    may_end = threading.Event()
    original = os.fsync

    def slow(descriptor: int) -> None:
        assert may_end.wait(10.0)
        original(descriptor)

    monkeypatch.setattr(os, "fsync", slow)
    config = Config.model_validate({"recording": {"segment_mib": 0.01}})
    log = LogWriter(tmp_path, "s", config, {})
    with Follower(tmp_path, "s") as follower:
        try:
            for number in range(300):
                log.write(chunk(number))
            log.flush()
            assert sorted(path.suffix for path in tmp_path.iterdir()) == [".part"] * 4
            # A reader sees at once that a segment is whole, by the next one.
            seen = [record.t_ns for _ in range(8) for record in follower.poll()]
            assert seen == list(range(300))
        finally:
            may_end.set()
        log.close()
        assert sorted(path.suffix for path in tmp_path.iterdir()) == [".mcap"] * 4
        assert follower.poll() == []
        assert not follower.damage.is_any
    damage = Damage()
    assert [record.t_ns for record in read_log(tmp_path, damage)] == list(range(300))
    assert not damage.is_any


def test_a_segment_that_cannot_get_its_name_is_told_and_stays_readable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    log = LogWriter(tmp_path, "s", Config.model_validate({"recording": {"segment_mib": 0.01}}), {})
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", broken)
        for number in range(110):
            log.write(chunk(number))
        wait_until_idle(log)
    with pytest.raises(LogError, match="Input/output"):
        log.tick(SYNC_NS)
    log.close()
    assert [record.t_ns for record in read_log(tmp_path)] == list(range(110))
