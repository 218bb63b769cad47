"""The follower: polled at any moments, it gives in the end what the reader gives."""

from __future__ import annotations

import random
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.errors import DataError
from config.schema import Config
from drivers.log import Follower, LogHeader, LogWriter, read_log, write_log
from drivers.log.header import signed
from drivers.records import Chunk, ClockPair, Record

SMALL = Config.model_validate({"recording": {"segment_mib": 0.004}})


def chunk(number: int) -> Chunk:
    return Chunk(number, 10**18 + number, "sonar", "rx", random.Random(number).randbytes(150))


def drained(folder: Path, session: str = "dive") -> list[Record]:
    with Follower(folder, session) as follower:
        return drain(follower)


def drain(follower: Follower) -> list[Record]:
    records: list[Record] = []
    while found := follower.poll():
        records += found
    return records


@settings(max_examples=50, deadline=None)
@given(st.lists(st.sampled_from(["write", "write", "write", "flush", "poll", "tick"]), max_size=150))
def test_polled_at_any_moments_it_gives_what_was_written(steps: list[str]) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder, written, seen = Path(name), list[Record](), list[Record]()
        follower = Follower(folder, "dive")
        seen += follower.poll()
        log = LogWriter(folder, "dive", SMALL, {})
        for step in steps:
            if step == "write":
                written.append(chunk(len(written)))
                log.write(written[-1])
            elif step == "poll":
                seen += follower.poll()
                assert seen == written[: len(seen)]
            else:
                log.flush()
                seen += drain(follower) if step == "tick" else []
                assert seen == written if step == "tick" else True
        log.close()
        seen += drain(follower)
        follower.close()
        assert seen == written == list(read_log(folder))
        assert not follower.damage.is_any
        assert drained(folder) == written


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**30), st.lists(st.integers(1, 4000), min_size=1, max_size=40), st.booleans())
def test_bytes_that_arrive_in_any_pieces_and_damaged(place: int, cuts: list[int], hurt: bool) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log = LogWriter(folder, "dive", Config(), {})
        for n in range(60):
            log.write(chunk(n))
            if n % 10 == 9:
                log.flush()
        log.close()
        data = bytearray(log.path.read_bytes())
        if hurt:
            data[place % len(data)] ^= 0x10
        log.path.unlink()
        part = folder / "dive-0001.mcap.part"
        follower, seen, position = Follower(folder, "dive"), list[Record](), 0
        with part.open("wb", buffering=0) as file:
            for cut in cuts:
                file.write(data[position : position + cut])
                position += cut
                seen += follower.poll()
            file.write(data[position:])
        seen += follower.poll()
        part.rename(log.path)
        seen += drain(follower)
        follower.close()
        assert seen == list(read_log(log.path))


def test_starts_at_the_beginning_of_a_session_that_is_under_way(tmp_path: Path) -> None:
    with LogWriter(tmp_path, "dive", SMALL, {}) as log, Follower(tmp_path, "dive") as follower:
        for n in range(200):
            log.write(chunk(n))
        log.flush()
        assert drain(follower) == [chunk(n) for n in range(200)]
        log.write(chunk(200))
        assert follower.poll() == []
        log.flush()
        assert follower.poll() == [chunk(200)]
        follower.close()
        assert follower.poll() == []


def test_catching_up_comes_in_slices(tmp_path: Path) -> None:
    log = LogWriter(tmp_path, "dive", Config(), {})
    for n in range(10_000):
        log.write(chunk(n))
    log.close()
    follower, sizes = Follower(tmp_path, "dive"), list[int]()
    while found := follower.poll():
        sizes.append(len(found))
    assert sum(sizes) == 10_000
    assert max(sizes) < 4000


def test_goes_on_behind_a_segment_that_was_left_unfinished(tmp_path: Path) -> None:
    def segment(number: int, t_ns: int) -> Path:
        path = tmp_path / f"dive-{number:04d}.mcap"
        write_log(path, LogHeader(Config(), {}, "dive", number).metadata(), [ClockPair(t_ns, 0)])
        return path

    first = segment(1, 1)
    first.rename(tmp_path / "dive-0001.mcap.part")
    with (tmp_path / "dive-0001.mcap.part").open("r+b") as file:
        file.truncate(file.seek(0, 2) - 300)
    follower = Follower(tmp_path, "dive")
    assert drain(follower) == [ClockPair(1, 0)]
    segment(3, 3)  # number 2 was never made
    assert drain(follower) == [ClockPair(3, 0)]
    follower.close()
    assert follower.damage.truncated == 1


def test_follows_its_own_session_only(tmp_path: Path) -> None:
    for session in ("dive", "dive-2", "other"):
        log = LogWriter(tmp_path, session, Config(), {})
        log.write(ClockPair(len(session), 0))
        log.close()
    assert drained(tmp_path) == [ClockPair(4, 0)]
    assert drained(tmp_path, "absent") == []
    assert drained(tmp_path / "absent") == []


def test_log_of_a_newer_version_is_refused(tmp_path: Path) -> None:
    metadata = signed(LogHeader(Config(), {}, "a").metadata() | {"format": "9"})
    write_log(tmp_path / "a-0001.mcap", metadata, [ClockPair(1, 1)])
    with Follower(tmp_path, "a") as follower, pytest.raises(DataError, match="update lacuna"):
        follower.poll()
