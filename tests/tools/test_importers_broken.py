"""Importers and broken captures: what is left of them is kept, and what is none is refused in one line."""

from __future__ import annotations

import gzip
import json
import random
import struct
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.tools.test_importers import imported, ping, pings
from tools import cli
from tools.importers import json_lines, v4log
from tools.importers.capture import Captured, Losses
from tools.importers.table import FORMATS


def test_broken_lines_are_counted_and_the_rest_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / "x.jsonl"
    good = json.dumps({"t_ns": 5, "port": "sonar", "dir": "rx", "hex": ping().hex()})
    source.write_text(f'{good}\n{{"t_ns": 6, "port": "sonar"\nnull\n{good}\n' + good.replace('"rx"', '"up"'))
    log = imported(source, tmp_path / "x.mcap", "--json")
    body = json.loads(capsys.readouterr().out)
    assert (body["not_readable"], body["first_not_readable"]) == (3, "line 2 is not a piece of a capture")
    assert len(pings(log)) == 2
    assert body["ports"][0]["pings"] == 2


def test_gzip_that_breaks_off_gives_what_is_before(tmp_path: Path) -> None:
    lines = [json.dumps({"t_ns": n, "port": "s", "dir": "rx", "hex": ping(n % 6400).hex()}) for n in range(2000)]
    packed = gzip.compress("\n".join(lines).encode())
    (tmp_path / "x.jsonl.gz").write_bytes(packed[: len(packed) // 2])
    found = len(pings(imported(tmp_path / "x.jsonl.gz", tmp_path / "x.mcap")))
    assert 100 < found < 1900


def test_v4log_that_breaks_off_gives_what_is_before(shared_data: Path, tmp_path: Path) -> None:
    whole = (shared_data / "sonar/sector-90deg-2005.V4LOG").read_bytes()
    (tmp_path / "cut.V4LOG").write_bytes(whole[:200_000])
    assert len(pings(imported(tmp_path / "cut.V4LOG", tmp_path / "x.mcap"))) == (200_000 - 61_435) // 688
    packed = gzip.compress(whole)
    (tmp_path / "cut.gz").write_bytes(packed[: len(packed) * 3 // 4])
    assert 100 < len(pings(imported(tmp_path / "cut.gz", tmp_path / "y.mcap"))) < 468


def test_every_bad_input_is_one_line_with_its_exit_code(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty").touch()
    (tmp_path / "noise").write_bytes(random.Random(1).randbytes(4000))
    (tmp_path / "gz").write_bytes(b"\x1f\x8b" + random.Random(1).randbytes(400))
    (tmp_path / "v4").write_bytes(v4log.MAGIC)
    (tmp_path / "mcap").write_bytes(b"\x89MCAP0\r\n")
    (tmp_path / "good").write_bytes(ping())
    (tmp_path / "there.mcap").write_bytes(b"mine")
    cases: dict[tuple[str, ...], int] = {
        ("absent",): 66,
        (".",): 66,
        ("empty",): 65,
        ("noise",): 65,
        ("gz",): 65,
        ("v4",): 65,
        ("mcap",): 65,
        ("noise", "--format", "jsonl"): 65,
        ("good", "--port", "nobody=nmea"): 64,
        ("good", "--port", "serial=morse"): 64,
        ("good", "--port", "serial"): 64,
        ("good", "--start", "yesterday"): 64,
        ("good", "--baud", "1"): 64,
        ("good", "--format", "wav"): 64,
        ("good", "--config", "absent.toml"): 66,
    }
    for (name, *options), code in cases.items():
        words = ["import", str(tmp_path / name), "-o", str(tmp_path / "out.mcap"), *options]
        assert cli.main(words) == code, words
        error = capsys.readouterr().err
        assert error.startswith("lacuna: ")
        assert error.count("\n") == 1
    assert cli.main(["import", str(tmp_path / "good"), "-o", str(tmp_path / "there.mcap")]) == 74
    assert (tmp_path / "there.mcap").read_bytes() == b"mine"
    assert not list(tmp_path.glob("out.mcap*"))


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=400), st.sampled_from(sorted(FORMATS)), st.booleans())
def test_no_importer_fails_on_any_bytes(
    tmp_path_factory: pytest.TempPathFactory, data: bytes, name: str, head: bool
) -> None:
    path = tmp_path_factory.mktemp("fuzz") / "x"
    start = {"v4log": v4log.MAGIC.ljust(32) + struct.pack("<8I", 16, 80, 64, 3, 300, 350, 350, 360), "jsonl": b"{"}
    path.write_bytes(start.get(name, b"") * head + data)
    try:
        found = list(FORMATS[name].read(path, 115200, Losses()))
    except Exception as error:  # noqa: BLE001 - whatever it is, it must be one of ours
        assert type(error).__module__ == "config.errors"  # noqa: PT017
        return
    assert all(isinstance(each, Captured) for each in found)


def test_a_line_without_end_does_not_fill_the_memory(tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(
        b'{"t_ns": 1, ' + b" " * (9 << 20) + b"\n" + b'{"t_ns":1,"port":"a","dir":"rx","hex":"00"}'
    )
    losses = Losses()
    assert [each.data for each in json_lines.read(tmp_path / "x", 0, losses)] == [b"\0"]
    assert losses.pieces >= 1
