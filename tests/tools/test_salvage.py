"""``lacuna salvage``: a sound log of what is left, and the original untouched."""

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest
from mcap.reader import make_reader

from config.schema import Config
from drivers.log import Damage, LogHeader, LogWriter, read_header, read_log, write_log
from drivers.log.header import signed
from drivers.records import Chunk, ClockPair, Event, Record
from tools import cli

CONFIG = Config.model_validate({"site": {"name": "keyhole"}})


def records(count: int = 1000) -> list[Record]:
    return [Chunk(n, 10**18 + n, "sonar", "rx", random.Random(n).randbytes(900)) for n in range(count)]


def salvage(source: Path, target: Path, *options: str) -> int:
    return cli.main(["salvage", str(source), "-o", str(target), *options])


def test_saves_what_is_left_of_a_log_without_power(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, target = tmp_path / "x.mcap", tmp_path / "saved.mcap"
    write_log(source, LogHeader(CONFIG, {"lacuna": "0.1.0"}, "dive").metadata(), records())
    data = bytearray(source.read_bytes())
    data[300_000:300_100] = bytes(100)
    source.write_bytes(data[:700_000])
    broken = source.read_bytes()
    assert salvage(source, target, "--json") == 0
    body = json.loads(capsys.readouterr().out)
    assert source.read_bytes() == broken

    left = list(read_log(source))
    damage = Damage()
    *saved, note = read_log(target, damage)
    assert saved == left
    assert damage == Damage()
    assert body["records"] == len(left) + 1
    assert body["lost"]["records_missing"] == 70
    assert isinstance(note, Event)
    assert note.kind == "note"
    assert note.fields["lost"] == body["lost"]
    header = read_header(target)
    assert (header.config, header.versions, header.session) == (CONFIG, {"lacuna": "0.1.0"}, "saved")
    with target.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(left) + 1


def test_joins_the_segments_of_a_session(tmp_path: Path) -> None:
    small = Config.model_validate({"recording": {"segment_mib": 0.1}})
    with LogWriter(tmp_path / "logs", "dive", small, {}) as log:
        for record in records(400):
            log.write(record)
    assert len(list((tmp_path / "logs").iterdir())) > 2
    assert salvage(tmp_path / "logs", tmp_path / "one.mcap") == 0
    assert list(read_log(tmp_path / "one.mcap"))[:-1] == records(400)


def test_refuses_to_mix_sessions_or_to_overwrite(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for session in ("a", "b"):
        write_log(tmp_path / f"{session}.mcap", LogHeader(CONFIG, {}, session).metadata(), [ClockPair(1, 1)])
    assert salvage(tmp_path, tmp_path / "out" / "x.mcap") == 64
    assert "one at a time" in capsys.readouterr().err
    before = (tmp_path / "a.mcap").read_bytes()
    assert salvage(tmp_path / "b.mcap", tmp_path / "a.mcap") == 74
    assert salvage(tmp_path / "a.mcap", tmp_path / "a.mcap") == 74
    assert (tmp_path / "a.mcap").read_bytes() == before
    assert salvage(tmp_path / "a.mcap", tmp_path / "absent" / "x.mcap") == 74
    assert capsys.readouterr().err.count("\n") == 3


def test_lost_header_needs_a_configuration(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / "x.mcap"
    write_log(source, LogHeader(CONFIG, {}, "dive").metadata(), records(50))
    data = source.read_bytes()
    source.write_bytes(data.replace(b"keyhole", b"keyhale"))
    assert salvage(source, tmp_path / "y.mcap") == 65
    assert "--config" in capsys.readouterr().err
    (tmp_path / "c.toml").write_text('[site]\nname = "well"\n')
    assert salvage(source, tmp_path / "y.mcap", "--config", str(tmp_path / "c.toml")) == 0
    assert read_header(tmp_path / "y.mcap").config.site.name == "well"
    assert list(read_log(tmp_path / "y.mcap"))[:-1] == records(50)


def test_header_that_no_longer_validates_is_kept_as_it_is(tmp_path: Path) -> None:
    old = signed(LogHeader(CONFIG, {}, "old").metadata() | {"config": '{"sonar": {"colour": "red"}}'})
    write_log(tmp_path / "x.mcap", old, [ClockPair(1, 1)])
    assert salvage(tmp_path / "x.mcap", tmp_path / "y.mcap") == 0
    assert b'"colour": "red"' in (tmp_path / "y.mcap").read_bytes()
