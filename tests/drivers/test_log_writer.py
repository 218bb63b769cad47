"""The writer: segments, durability, a disk that fills, and files that other programs open."""

from __future__ import annotations

import errno
import random
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader

from config.errors import LogError
from config.schema import Config, Recording
from drivers.log import Damage, LogHeader, LogWriter, read_header, read_log, write_log
from drivers.log.segment import CHUNK_BYTES, Segment
from drivers.records import Chunk, ClockPair, Event, Record

UTC = 1_700_000_000_000_000_000


def chunk(number: int, size: int = 100, port: str = "sonar") -> Chunk:
    return Chunk(number * 1_000_000, UTC + number * 1_000_000, port, "rx", random.Random(number).randbytes(size))


def writer(folder: Path, **recording: float) -> LogWriter:
    return LogWriter(folder, "dive", Config(recording=Recording.model_validate(recording)), {"lacuna": "0.1.0"})


def test_names_segments_by_session_and_number_and_links_them(tmp_path: Path) -> None:
    log = writer(tmp_path, segment_mib=0.1)
    records = [chunk(n) for n in range(3000)]
    for record in records:
        log.write(record)
    log.sync()
    assert [path.name for path in tmp_path.glob("*.part")] == [log.path.name + ".part"]
    log.close()
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == [f"dive-{n:04d}.mcap" for n in range(1, len(names) + 1)]
    assert len(names) >= 3
    headers = [read_header(tmp_path / name) for name in names]
    assert [header.segment for header in headers] == list(range(1, len(names) + 1))
    assert [header.previous for header in headers] == [None, *names[:-1]]
    assert list(read_log(tmp_path)) == records


def test_begins_a_segment_after_the_minutes_of_its_records(tmp_path: Path) -> None:
    log = writer(tmp_path, segment_min=1)
    for second in (0, 59, 60, 61, 121):
        log.write(ClockPair(5_000_000_000 + second * 1_000_000_000, UTC))
    log.close()
    counts = [len(list(read_log(path))) for path in sorted(tmp_path.iterdir())]
    assert counts == [2, 2, 1]


def test_keeps_the_effective_configuration(tmp_path: Path) -> None:
    config = Config.model_validate({"site": {"name": "keyhole", "water": 1010.5}, "feed": [{"name": "compass"}]})
    LogWriter(tmp_path, "dive", config, {"lacuna": "0.1.0", "python": "3.11"}).close()
    header = read_header(tmp_path)
    assert header == LogHeader(config, {"lacuna": "0.1.0", "python": "3.11"}, "dive")


def test_stock_reader_reads_it_with_its_checks_on(tmp_path: Path) -> None:
    log = writer(tmp_path)
    records: list[Record] = [chunk(1), ClockPair(5, UTC), Event(7, UTC + 7, "mark", {"text": "niche"}), chunk(2)]
    for record in records:
        log.write(record)
        log.flush()
    log.close()
    with log.path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        messages = list(reader.iter_messages(log_time_order=False))
        metadata = {each.name for each in reader.iter_metadata()}
    assert summary is not None
    assert summary.statistics is not None
    assert (summary.statistics.message_count, summary.statistics.chunk_count) == (4, 4)
    assert [channel.topic for _, channel, _ in messages] == ["/raw/sonar/rx", "/clock", "/event", "/raw/sonar/rx"]
    assert [schema.encoding for schema, _, _ in messages if schema] == ["jsonschema", "jsonschema"]
    assert [(m.log_time, m.publish_time) for _, _, m in messages] == [(r.utc_ns, r.t_ns) for r in records]
    assert [m.sequence for _, channel, m in messages if channel.topic == "/raw/sonar/rx"] == [0, 1]
    assert metadata == {"lacuna"}


def test_chunks_stay_within_64_kib(tmp_path: Path) -> None:
    log = writer(tmp_path)
    records = [chunk(n, size=997) for n in range(500)]
    for record in records:
        log.write(record)
    log.close()
    with log.path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    sizes = [index.uncompressed_size for index in summary.chunk_indexes]
    assert len(sizes) == -(-500 // (CHUNK_BYTES // (997 + 31)))
    assert max(sizes) <= CHUNK_BYTES + 100  # the channel's own record stands in front


def test_tick_decides_by_the_time_it_is_given(tmp_path: Path) -> None:
    log = writer(tmp_path)
    log.write(chunk(0))
    log.tick(99_999_999)
    assert list(read_log(log.path.with_name(log.path.name + ".part"))) == []
    log.tick(100_000_000)
    assert list(read_log(log.path.with_name(log.path.name + ".part"))) == [chunk(0)]
    log.close()


def test_tick_syncs_within_a_second(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[int] = []
    monkeypatch.setattr("os.fdatasync", synced.append)
    log = writer(tmp_path)
    log.write(chunk(0))
    for t_ms in range(0, 900, 50):
        log.tick(t_ms * 1_000_000)
    assert synced == []
    log.tick(1_000_000_000)
    assert len(synced) == 1
    log.tick(5_000_000_000)
    assert len(synced) == 1  # nothing new to sync
    log.close()


def test_refuses_a_session_that_exists(tmp_path: Path) -> None:
    writer(tmp_path).close()
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(LogError, match="choose another session"):
        writer(tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_refuses_a_folder_that_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(LogError, match="cannot write"):
        writer(tmp_path / "file")


@pytest.mark.parametrize(
    ("record", "message"),
    [
        (Chunk(0, 0, "Sonar 1", "rx", b""), "rename the port"),
        (Chunk(0, 0, "sonar", "rx", bytes(2 << 20)), "split them"),
        (ClockPair(-1, 0), "set the clock"),
        (Event(0, 0, "mark", {"x": float("nan")}), "finite"),
    ],
)
def test_refuses_what_no_log_can_hold_and_goes_on(tmp_path: Path, record: Record, message: str) -> None:
    log = writer(tmp_path)
    log.write(chunk(0))
    with pytest.raises(LogError, match=message):
        log.write(record)
    log.write(chunk(1))
    log.close()
    assert list(read_log(tmp_path)) == [chunk(0), chunk(1)]
    assert log.lost_records == 0


def test_closed_log_takes_nothing_and_closes_twice(tmp_path: Path) -> None:
    log = writer(tmp_path)
    log.close()
    log.close()
    with pytest.raises(LogError, match="closed"):
        log.write(chunk(0))


class FullDisk:
    """Lets a number of bytes onto the disk, then half of the next write, then none."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.room = 1 << 40
        original = Segment._put

        def put(segment: Segment, data: bytes) -> None:
            if len(data) <= self.room:
                self.room -= len(data)
                original(segment, data)
                return
            original(segment, data[: self.room // 2])
            self.room = 0
            raise OSError(errno.ENOSPC, "No space left on device")

        monkeypatch.setattr(Segment, "_put", put)


def test_full_disk_says_what_to_do_and_loses_nothing_when_space_returns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = FullDisk(monkeypatch)
    log = writer(tmp_path)
    log.write(chunk(0))
    log.flush()
    disk.room = 60
    log.write(chunk(1))
    with pytest.raises(LogError, match=r"disk is full.*free some space"):
        log.flush()
    log.write(chunk(2))
    with pytest.raises(LogError, match="disk is full"):
        log.tick(10**12)
    log.tick(10**12 + 999_999_999)  # leaves the disk in peace
    with pytest.raises(LogError, match="disk is full"):
        log.tick(10**12 + 1_000_000_000)
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["dive-0001.mcap.part"]
    disk.room = 1 << 40
    log.write(chunk(3))
    log.close()
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["dive-0001.mcap.part", "dive-0002.mcap"]
    assert list(read_log(tmp_path)) == [chunk(n) for n in range(4)]
    assert log.lost_records == 0


def test_long_full_disk_counts_what_it_gives_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    disk = FullDisk(monkeypatch)
    log = writer(tmp_path)
    log.write(chunk(0))
    log.flush()
    disk.room = 0
    refusals = 0
    for n in range(1, 2001):
        try:
            log.write(chunk(n))
        except LogError:
            refusals += 1
    disk.room = 1 << 40
    log.write(chunk(2001))
    log.close()
    damage = Damage()
    read = list(read_log(tmp_path, damage))
    assert refusals >= 2
    assert log.lost_records > 0
    assert read == [chunk(0), *(chunk(n) for n in range(log.lost_records + 1, 2002))]
    assert damage.records_missing == log.lost_records


def test_close_on_a_full_disk_counts_the_last_chunk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    disk = FullDisk(monkeypatch)
    log = writer(tmp_path)
    disk.room = 0
    log.write(chunk(0))
    with pytest.raises(LogError, match="disk is full"):
        log.close()
    assert log.lost_records == 1


def test_one_file_appears_when_it_is_whole(tmp_path: Path) -> None:
    target, metadata = tmp_path / "one.mcap", LogHeader(Config(), {}, "one").metadata()

    def records() -> list[Record]:
        assert not target.exists()
        return [chunk(n, 1000) for n in range(200)]

    assert write_log(target, metadata, records()) == 200
    assert list(read_log(target)) == [chunk(n, 1000) for n in range(200)]
    before = target.read_bytes()
    with pytest.raises(LogError, match="exists"):
        write_log(target, metadata, [])
    assert target.read_bytes() == before


def test_one_file_leaves_nothing_behind_when_it_fails(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="rename the port"):
        write_log(tmp_path / "one.mcap", {}, [chunk(0), chunk(1, port="NO")])
    assert list(tmp_path.iterdir()) == []


SCRIPT = """
import sys
from pathlib import Path
from config.schema import Config
from drivers.log import LogWriter
from drivers.records import Chunk
log = LogWriter(Path(sys.argv[1]), "dive", Config.model_validate({"recording": {"segment_mib": 0.05}}), {})
for n in range(10**9):
    log.write(Chunk(n, n, "sonar", "rx", n.to_bytes(8, "big") * 12))
    if n % 7 == 0:
        log.flush()
        sys.stdout.write(f"{n}\\n")
        sys.stdout.flush()
"""


@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(each, marks=pytest.mark.slow) for each in range(4, 60))])
def test_kill_at_any_moment_keeps_what_was_flushed(tmp_path: Path, seed: int) -> None:
    wait_for = random.Random(seed).randrange(1, 900)
    with subprocess.Popen([sys.executable, "-c", SCRIPT, str(tmp_path)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for _ in range(wait_for):
            process.stdout.readline()
        process.send_signal(signal.SIGKILL)
        flushed = [int(line) for line in process.stdout.read().splitlines(keepends=True) if line.endswith("\n")]
    last = flushed[-1] if flushed else 7 * (wait_for - 1)
    read = list(read_log(tmp_path))
    assert len(read) >= last + 1
    assert read == [Chunk(n, n, "sonar", "rx", n.to_bytes(8, "big") * 12) for n in range(len(read))]
