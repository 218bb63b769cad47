"""The reader: what is damaged is skipped and counted, what is right is all there, and nothing is made up."""

from __future__ import annotations

import random
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.errors import DataError, InputError, LacunaError
from config.schema import Config
from drivers.log import Damage, LogHeader, LogWriter, read_header, read_log, write_log
from drivers.log.header import signed
from drivers.log.scanner import Block, Scanner
from drivers.log.segment import ChannelTable, ChunkBuffer, Segment
from drivers.records import Chunk, ClockPair, Event, Json, Record

TIMES = st.integers(0, 2**63)
NUMBERS = st.integers(-(2**40), 2**40) | st.floats(allow_nan=False, allow_infinity=False)
JSON: st.SearchStrategy[Json] = st.recursive(
    st.none() | st.booleans() | NUMBERS | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)
PORTS = st.sampled_from(["sonar", "feed", "feed_2", "a-b"])
RECORDS: st.SearchStrategy[Record] = st.one_of(
    st.builds(Chunk, TIMES, TIMES, PORTS, st.sampled_from(["rx", "tx"]), st.binary(max_size=300)),
    st.builds(ClockPair, TIMES, TIMES),
    st.builds(Event, TIMES, TIMES, st.text(max_size=8), st.dictionaries(st.text(max_size=5), JSON, max_size=3)),
)
GROUPS = st.lists(st.lists(RECORDS, max_size=6), max_size=6)
"""Records of a log; each group is flushed, so it is a chunk."""


def written(groups: list[list[Record]]) -> bytes:
    """Return the bytes of a closed log with a chunk for each group."""
    with tempfile.TemporaryDirectory() as folder:
        path, table = Path(folder) / "x.mcap", ChannelTable()
        segment = Segment(path, LogHeader(Config(), {"lacuna": "0.1.0"}, "dive").metadata())
        for group in groups:
            buffer = ChunkBuffer()
            for record in group:
                buffer.add(*table.message(record))
            segment.write_chunk(buffer)
        segment.close()
        return path.read_bytes()


def read(data: bytes, damage: Damage | None = None) -> list[Record]:
    """Return the records that are readable in ``data``, none for what is not a log at all."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.mcap"
        path.write_bytes(data)
        try:
            return list(read_log(path, damage))
        except DataError:
            return []


def plain(groups: list[list[Record]]) -> list[Record]:
    return [record for group in groups for record in group]


def noise(seed: int, count: int = 40) -> list[list[Record]]:
    rng = random.Random(seed)
    return [
        [Chunk(n * 100 + k, 10**18 + k, "sonar", "rx", rng.randbytes(rng.randrange(120))) for k in range(9)]
        for n in range(count)
    ]


@settings(max_examples=60, deadline=None)
@given(GROUPS)
def test_reads_back_what_was_written(groups: list[list[Record]]) -> None:
    damage = Damage()
    assert read(written(groups), damage) == plain(groups)
    assert damage == Damage()


@settings(max_examples=60, deadline=None)
@given(GROUPS, st.data())
def test_cut_off_anywhere_is_a_prefix_of_whole_chunks(groups: list[list[Record]], data: st.DataObject) -> None:
    whole = written(groups)
    damage = Damage()
    found = read(whole[: data.draw(st.integers(0, len(whole) - 1))], damage)
    prefixes = [plain(groups[:n]) for n in range(len(groups) + 1)]
    assert found in prefixes
    assert damage.truncated == 1


@settings(max_examples=100, deadline=None)
@given(GROUPS, st.data())
def test_a_flipped_bit_costs_one_chunk_at_most_and_nothing_wrong(
    groups: list[list[Record]], data: st.DataObject
) -> None:
    whole = bytearray(written(groups))
    bit = data.draw(st.integers(0, len(whole) * 8 - 1))
    whole[bit // 8] ^= 1 << bit % 8
    found = read(bytes(whole))
    allowed = [plain(groups)] + [plain(groups[:n] + groups[n + 1 :]) for n in range(len(groups))]
    assert found in allowed


def test_four_hundred_flipped_bits_one_at_a_time() -> None:
    groups = noise(1)
    whole = written(groups)
    rng = random.Random(2)
    lost = []
    for _ in range(400):
        broken = bytearray(whole)
        bit = rng.randrange(len(whole) * 8)
        broken[bit // 8] ^= 1 << bit % 8
        damage = Damage()
        found = read(bytes(broken), damage)
        lost.append(360 - len(found))
        assert set(found) <= set(plain(groups))
        assert damage.records_missing in (0, lost[-1])  # what is lost at the very end leaves no number behind
        assert damage.is_any or lost[-1] == 0
    assert max(lost) == 9


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 10**6), st.lists(st.tuples(st.integers(0, 2**20), st.binary(max_size=400)), max_size=5))
def test_any_number_of_wounds_never_makes_a_wrong_record(seed: int, wounds: list[tuple[int, bytes]]) -> None:
    groups = noise(seed % 5, count=12)
    whole = written(groups)
    for place, patch in wounds:
        at = place % len(whole)
        whole = whole[:at] + patch + whole[at + (place >> 10) % 500 :]
    found = read(whole)
    right = {record: index for index, record in enumerate(plain(groups))}
    order = [right[record] for record in found]  # KeyError: a record that was never written
    assert order == sorted(order)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 4), st.lists(st.integers(1, 3000), min_size=1, max_size=30), st.booleans(), st.integers(0, 2**30))
def test_blocks_do_not_depend_on_how_the_bytes_are_cut(seed: int, cuts: list[int], hurt: bool, place: int) -> None:
    data = bytearray(written(noise(seed, count=8)))
    if hurt:
        at = place % len(data)
        data[at : at + 40] = bytes(40)
    whole_damage, cut_damage = Damage(), Damage()
    whole = scanned([bytes(data)], whole_damage)
    pieces, position = [], 0
    for cut in cuts * (len(data) // sum(cuts) + 1):
        pieces.append(bytes(data[position : position + cut]))
        position += cut
    assert scanned(pieces, cut_damage) == whole
    assert cut_damage == whole_damage


def scanned(pieces: list[bytes], damage: Damage) -> list[Block]:
    scanner = Scanner(damage)
    return [block for piece in pieces for block in scanner.push(piece)] + list(scanner.finish())


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=2000))
def test_noise_holds_nothing(data: bytes) -> None:
    assert read(data) == []
    assert read(b"\x89MCAP0\r\n" + data) == []


def test_a_length_of_gigabytes_is_not_believed() -> None:
    groups = noise(3, count=4)
    whole = bytearray(written(groups))
    first = whole.index(b"\x04\x00\x00\x00zstd") - 37
    whole[first + 1 : first + 9] = (2**62).to_bytes(8, "little")
    damage = Damage()
    assert read(bytes(whole), damage) == plain(groups[1:])
    assert damage.chunks_skipped == 1
    assert damage.records_missing == 9


def test_a_packed_size_of_gigabytes_reserves_nothing() -> None:
    whole = bytearray(written(noise(3, count=2)))
    first = whole.index(b"\x04\x00\x00\x00zstd")
    assert whole[first + 16 : first + 20] == b"\x28\xb5\x2f\xfd"
    whole[first + 20 : first + 29] = b"\xe0" + (2**60).to_bytes(8, "little")
    assert read(bytes(whole)) == plain(noise(3, count=2)[1:])


def test_damage_in_the_middle_is_measured() -> None:
    groups = noise(4, count=20)
    whole = written(groups)
    middle = len(whole) // 2
    damage = Damage()
    found = read(whole[:middle] + bytes(1200) + whole[middle + 1200 :], damage)
    assert 1200 <= damage.bytes_skipped < 5000
    assert damage.chunks_skipped >= 1
    assert damage.records_missing == 180 - len(found) > 0
    assert damage.truncated == 0


def test_both_copies_of_the_header_must_go_before_it_is_lost(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    header = LogHeader(Config(), {"lacuna": "0.1.0"}, "dive")
    write_log(path, header.metadata(), plain(noise(1, count=2)))
    data = bytearray(path.read_bytes())
    first = data.index(b'"cell_m":0.05')
    data[first + 11] ^= 1
    path.write_bytes(data)
    assert read_header(path) == header
    second = data.index(b'"cell_m":0.05')
    data[second + 11] ^= 1
    path.write_bytes(data)
    with pytest.raises(DataError, match="header is damaged"):
        read_header(path)
    assert len(list(read_log(path))) == 18


def test_folder_is_read_in_the_order_of_sessions_and_segments(tmp_path: Path) -> None:
    def log(name: str, number: int) -> None:
        metadata = LogHeader(Config(), {}, name.rsplit("-", 1)[0]).metadata()
        write_log(tmp_path / name, metadata, [ClockPair(number, number)])

    for number, name in [(3, "b-0001.mcap"), (2, "a-10000.mcap"), (1, "a-9999.mcap"), (0, "a-0002.mcap")]:
        log(name, number)
    (tmp_path / "b-0001.mcap").rename(tmp_path / "b-0001.mcap.part")
    (tmp_path / "note.txt").write_text("not a log")
    assert [record.t_ns for record in read_log(tmp_path)] == [0, 1, 2, 3]


def test_part_beside_its_whole_file_is_not_read_twice(tmp_path: Path) -> None:
    write_log(tmp_path / "a-0001.mcap", LogHeader(Config(), {}, "a").metadata(), [ClockPair(1, 1)])
    (tmp_path / "a-0001.mcap.part").write_bytes((tmp_path / "a-0001.mcap").read_bytes())
    assert list(read_log(tmp_path)) == [ClockPair(1, 1)]


def test_unreadable_segment_among_others_is_counted(tmp_path: Path) -> None:
    write_log(tmp_path / "a-0001.mcap", LogHeader(Config(), {}, "a").metadata(), [ClockPair(1, 1)])
    (tmp_path / "a-0002.mcap.part").touch()
    damage = Damage()
    assert list(read_log(tmp_path, damage)) == [ClockPair(1, 1)]
    assert (damage.files_unreadable, damage.truncated) == (1, 1)


def test_header_without_records_is_an_empty_log(tmp_path: Path) -> None:
    damage = Damage()
    with LogWriter(tmp_path, "dive", Config(), {}):
        assert list(read_log(tmp_path, damage)) == []
    assert damage == Damage(truncated=1)


@pytest.mark.parametrize("reader", [lambda path: list(read_log(path)), read_header])
def test_each_bad_input_has_its_error(tmp_path: Path, reader: object) -> None:
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "noise.mcap").write_bytes(random.Random(0).randbytes(5000))
    (tmp_path / "folder").mkdir()
    cases: dict[str, tuple[type[LacunaError], str]] = {
        "missing.mcap": (InputError, "does not exist"),
        "empty.mcap": (DataError, "is empty"),
        "noise.mcap": (DataError, "is not a log of lacuna"),
        "folder": (DataError, "holds no logs"),
    }
    assert callable(reader)
    for name, (kind, message) in cases.items():
        with pytest.raises(kind, match=message) as caught:
            reader(tmp_path / name)
        assert "\n" not in str(caught.value)


def test_log_of_a_newer_version_is_refused_in_one_line(tmp_path: Path) -> None:
    metadata = signed(LogHeader(Config(), {}, "a").metadata() | {"format": "2"})
    write_log(tmp_path / "a.mcap", metadata, [ClockPair(1, 1)])
    for reading in (lambda: read_header(tmp_path / "a.mcap"), lambda: list(read_log(tmp_path / "a.mcap"))):
        with pytest.raises(DataError, match=r"newer lacuna .*update lacuna"):
            reading()


def test_configuration_that_no_longer_validates_names_its_key(tmp_path: Path) -> None:
    old = Config().model_dump_json().replace('"range_m":10.0', '"range_m":-1.0')
    metadata = signed(LogHeader(Config(), {}, "a").metadata() | {"config": old})
    write_log(tmp_path / "a.mcap", metadata, [ClockPair(1, 1)])
    with pytest.raises(DataError, match=r"sonar\.range_m.*--config") as caught:
        read_header(tmp_path / "a.mcap")
    assert "\n" not in str(caught.value)
    assert list(read_log(tmp_path / "a.mcap")) == [ClockPair(1, 1)]
