"""What a crash left as ``.part`` is made whole beside it, and reads as it did."""

from __future__ import annotations

import errno
import random
from pathlib import Path

import pytest
from mcap.reader import make_reader

from config.errors import DataError, LogError
from config.schema import Config
from drivers.log import Damage, LogWriter, make_whole, read_header, read_log, unfinished
from drivers.log.segment import Segment
from drivers.records import Chunk, Record


def chunks(first: int, count: int) -> list[Record]:
    return [Chunk(n, 10**18 + n, "sonar", "rx", random.Random(n).randbytes(2000)) for n in range(first, first + count)]


def crashed(folder: Path, session: str, cut: int = 0) -> Path:
    """Leave two segments: the first whole, the second as a crash leaves it, ``cut`` bytes short."""
    config = Config.model_validate({"recording": {"segment_mib": 0.05}})
    log = LogWriter(folder, session, config, {"lacuna": "test"})
    for record in chunks(0, 40):
        log.write(record)
    log.sync()
    assert log._segment is not None
    log._segment.abandon()
    (part,) = folder.glob(f"{session}-*.part")
    data = part.read_bytes()
    part.write_bytes(data[: len(data) - cut])
    return part


@pytest.mark.parametrize("cut", [0, 100])
def test_the_folder_reads_as_it_did(tmp_path: Path, cut: int) -> None:
    part = crashed(tmp_path, "dive", cut)
    bytes_before, before = part.read_bytes(), Damage()
    records = list(read_log(tmp_path, before))
    made = make_whole(part)
    assert (made.path, part.read_bytes()) == (part.with_suffix(""), bytes_before)
    after = Damage()
    assert list(read_log(tmp_path, after)) == records
    assert after.records_missing == before.records_missing
    assert made.records == len(list(read_log(made.path)))
    header = read_header(made.path)
    assert (header.session, header.segment, header.previous) == ("dive", 2, "dive-0001.mcap")
    with made.path.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == made.records
    assert unfinished(tmp_path, "other") == []
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "dive-0001.mcap",
        "dive-0002.mcap",
        "dive-0002.mcap.part",
    ]


def test_a_hole_in_the_middle_is_told_once(tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    log = LogWriter(folder, "dive", Config(), {})
    for number, record in enumerate(chunks(0, 100)):
        log.write(record)
        if number % 10 == 9:
            log.sync()
    assert log._segment is not None
    log._segment.abandon()
    (part,) = folder.iterdir()
    data = bytearray(part.read_bytes())
    data[len(data) // 2] ^= 1
    part.write_bytes(data)
    made = make_whole(part)
    assert (made.records, made.damage.chunks_skipped) == (90, 1)
    again = Damage()
    assert len(list(read_log(folder, again))) == 90
    assert (again.records_missing, again.chunks_skipped) == (10, 0)


def test_what_is_being_written_is_left_alone(tmp_path: Path) -> None:
    part = crashed(tmp_path, "old")
    with LogWriter(tmp_path, "new", Config(), {}):
        assert unfinished(tmp_path, "mine") == [part]
        assert unfinished(tmp_path, "old") == []
    assert unfinished(tmp_path, "mine") == [part]


def test_what_cannot_be_saved_is_left_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "empty-0001.mcap.part").write_bytes(b"")
    (tmp_path / "noise-0001.mcap.part").write_bytes(b"\x00" * 1000)
    for part in unfinished(tmp_path, "x"):
        with pytest.raises(DataError):
            make_whole(part)
    part = crashed(tmp_path, "dive")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Segment, "write_chunk", full)
        with pytest.raises(LogError, match="full"):
            make_whole(part)
    assert not part.with_suffix("").exists()
    assert not (tmp_path / ".salvage").exists()
    # An attempt that was killed is cleared away by the next.
    (tmp_path / ".salvage").mkdir()
    (tmp_path / ".salvage" / "dive-0002.mcap.part").write_bytes(b"half")
    assert make_whole(part).path.exists()
    assert not (tmp_path / ".salvage").exists()
