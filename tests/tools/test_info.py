"""``lacuna info``: facts of whole logs, of broken ones, and one line on what is no log."""

from __future__ import annotations

import contextlib
import io
import json
import math
import random
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.schema import Config
from drivers.log import LogHeader, LogWriter, write_log
from drivers.log.header import signed
from drivers.records import Chunk, ClockPair, Event, Record
from drivers.tritech.headdata import HeadData, encode_head_data
from tools import cli
from tools.log_facts import Compass, Turning

CONFIG = Config.model_validate({"site": {"name": "keyhole"}, "feed": [{"name": "compass"}]})
UTC = 1_700_000_000_000_000_000
SECOND = 1_000_000_000


def info(path: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    assert cli.main(["info", str(path), "--json"]) == 0
    body: dict[str, Any] = json.loads(capsys.readouterr().out)
    return body


def dive(folder: Path, session: str = "dive") -> Path:
    """Twenty pings of 18 degrees, one each 0.1 s, a heading and a depth each second, a silence of 5 s in the middle."""
    with LogWriter(folder, session, CONFIG, {"lacuna": "0.1.0"}) as log:
        log.write(ClockPair(0, UTC))
        for n in range(20):
            t_ns = n * SECOND // 10 + (5 * SECOND if n >= 10 else 0)
            data = encode_head_data(HeadData(n * 320, bytes(100), 33, 32, 0, 0, range_scale=100 if n < 10 else 200))
            log.write(Chunk(t_ns, UTC + t_ns, "sonar", "rx", data))
        log.write(Chunk(SECOND, UTC, "compass", "rx", b"$HCHDG,350.0,,,,*44\r\n$SDDPT,1.5,0.0*53\r\n"))
        log.write(Chunk(2 * SECOND, UTC, "compass", "rx", b"$HCHDG,10.0,,,,*73\r\n$SDDPT,2.5,0.0*50\r\n"))
        log.write(Chunk(7 * SECOND, UTC, "sonar", "tx", b"@@@"))
        log.write(Event(7 * SECOND, UTC + 7 * SECOND, "mark", {"text": "niche"}))
    return folder


def test_tells_the_dive(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (body,) = info(dive(tmp_path), capsys)["sessions"]
    assert (body["session"], body["site"], body["versions"]) == ("dive", "keyhole", {"lacuna": "0.1.0"})
    assert (body["start_utc"], body["duration_s"], body["records"]) == ("2023-11-14T22:13:20Z", 7.0, 25)
    sonar = body["ports"]["sonar"]
    assert (sonar["rx"]["chunks"], sonar["rx"]["bytes"], sonar["tx"]["bytes"]) == (20, 20 * 145, 3)
    assert (sonar["rx"]["gaps"], sonar["rx"]["longest_gap_s"], sonar["rx"]["longest_gap_at_s"]) == (1, 5.1, 0.9)
    assert sonar["messages"] == {"head_data": 20}
    assert body["sonar"]["pings"] == 20
    assert body["sonar"]["pings_per_s"] == pytest.approx(10.0)
    assert body["sonar"]["s_per_revolution"] == pytest.approx(2.0)
    assert body["sonar"]["limited_by"] == "other"
    assert [(each["since_s"], each["range_m"]) for each in body["sonar"]["settings"]] == [
        (0.0, 10.0),
        # The reply's first bit, 145 bytes before its end, less the time to the last of 100 bins.
        (pytest.approx(6.0 - 145 * 10 / 115200 - 100 * 33 * 640e-9, abs=0.001), 20.0),
    ]
    assert body["sonar"]["settings_changes"] == 1
    assert body["heading"]["count"] == 2
    assert body["heading"]["arc_deg"] == [350, 10]
    assert (body["depth"]["min_m"], body["depth"]["max_m"], body["depth"]["per_s"]) == (1.5, 2.5, 1.0)
    assert body["events"] == {"mark": 1}
    assert body["clock_pairs"] == 1
    assert set(body["damage"].values()) == {0}


def test_says_the_same_to_people(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["info", str(dive(tmp_path))]) == 0
    text = capsys.readouterr().out
    for words in (
        "session dive: 1 file(s), 25 records",
        "from 2023-11-14T22:13:20Z, 7.0 s",
        "longest gap 5.10 s at 0.9 s",
        "20, 10.00 a second, 2.0 s per revolution",
        "range 20 m",
        "within 350 to 10 deg",
        "1.50 to 2.50 m",
        "mark 1",
        "damage     none",
    ):
        assert words in text


def test_sessions_are_told_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dive(tmp_path, "a")
    dive(tmp_path, "b")
    assert [each["session"] for each in info(tmp_path, capsys)["sessions"]] == ["a", "b"]


def test_unreadable_file_among_others_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (dive(tmp_path) / "z.mcap").write_bytes(b"junk")
    body = info(tmp_path, capsys)
    assert [each["session"] for each in body["sessions"]] == ["dive"]
    assert len(body["unreadable"]) == 1
    assert "z.mcap" in body["unreadable"][0]


def test_broken_log_is_told_with_its_damage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    records: list[Record] = [Chunk(n, UTC, "sonar", "rx", random.Random(n).randbytes(900)) for n in range(1000)]
    path = tmp_path / "x.mcap"
    write_log(path, LogHeader(CONFIG, {}, "x").metadata(), records)
    data = bytearray(path.read_bytes())
    data[300_000:300_100] = bytes(100)
    path.write_bytes(data[:700_000])
    (body,) = info(path, capsys)["sessions"]
    assert body["damage"]["chunks_skipped"] == 2  # the wounded one and the one that was cut
    assert body["damage"]["records_missing"] == 70
    assert body["damage"]["truncated"] == 1
    assert 600 < body["records"] < 760


def test_log_whose_configuration_no_longer_validates_is_told_all_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    metadata = LogHeader(CONFIG, {}, "old").metadata()
    old = signed(metadata | {"config": '{"sonar": {"colour": "red"}}'})
    write_log(tmp_path / "old.mcap", old, [ClockPair(1, UTC)])
    (body,) = info(tmp_path, capsys)["sessions"]
    assert "sonar.colour" in body["trouble"]
    assert body["records"] == 1


def test_every_bad_input_is_one_line_with_its_exit_code(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "noise.mcap").write_bytes(random.Random(0).randbytes(3000))
    (tmp_path / "folder").mkdir()
    newer = signed(LogHeader(CONFIG, {}, "n").metadata() | {"format": "7"})
    write_log(tmp_path / "newer.mcap", newer, [ClockPair(1, 1)])
    for name, code in {"empty.mcap": 65, "noise.mcap": 65, "newer.mcap": 65, "folder": 65, "absent.mcap": 66}.items():
        for command in (["info"], ["info", "--json"], ["salvage", "-o", str(tmp_path / "out.mcap")]):
            assert cli.main([*command, str(tmp_path / name)]) == code
            captured = capsys.readouterr()
            assert captured.out == ""
            assert captured.err.startswith("lacuna: ")
            assert captured.err.count("\n") == 1
    assert not (tmp_path / "out.mcap").exists()


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 2**20), st.binary(max_size=200)), min_size=1, max_size=6), st.booleans())
def test_any_wounds_end_in_facts_or_in_one_line(wounds: list[tuple[int, bytes]], is_json: bool) -> None:
    with tempfile.TemporaryDirectory() as name:
        path = dive(Path(name)) / "dive-0001.mcap"
        data = path.read_bytes()
        for place, patch in wounds:
            at = place % (len(data) + 1)
            data = data[:at] + patch + data[at + (place >> 12) :]
        path.write_bytes(data)
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = cli.main(["info", str(path), *(["--json"] if is_json else [])])
    assert (code, err.getvalue().count("\n")) in ((0, 0), (65, 1))
    assert bool(out.getvalue()) == (code == 0)


@pytest.mark.parametrize(
    ("headings", "arc"),
    [([], None), ([90.2], (90, 90)), ([350, 5, 20], (350, 20)), ([10, 100, 190], (10, 190)), (range(360), (0, 359))],
)
def test_arc_of_headings(headings: list[float], arc: tuple[int, int] | None) -> None:
    compass = Compass()
    for heading in headings:
        compass.take(0.0, math.radians(heading + 0.1))
    assert compass.arc_deg == arc


def test_a_head_that_never_turned_has_no_revolution() -> None:
    turning = Turning()
    assert turning.pings_per_s is None
    assert turning.s_per_revolution is None
