"""Importers: real recordings become logs with all their pings, broken ones with all that is left."""

from __future__ import annotations

import csv
import gzip
import itertools
import json
from pathlib import Path

import pytest

from drivers.decoders import decoders_for
from drivers.keller import read_channel
from drivers.log import read_header, read_log
from drivers.readings import Depth, Heading, Ping, Reading
from drivers.records import Chunk, ClockPair, Event
from drivers.tritech.framing import Deframer, wrap_reply
from drivers.tritech.headdata import HeadData, encode_head_data
from drivers.tritech.ids import MessageId
from tests.drivers.feedframes import keller_reply
from tools import cli
from tools.importers import hub_csv, v4log
from tools.importers.capture import Losses
from tools.importers.table import format_of


def imported(source: Path, target: Path, *options: str) -> Path:
    assert cli.main(["import", str(source), "-o", str(target), *options]) == 0
    return target


def chunks(log: Path, port: str = "sonar", direction: str = "rx") -> list[Chunk]:
    records = [each for each in read_log(log) if isinstance(each, Chunk)]
    return [each for each in records if (each.port, each.direction) == (port, direction)]


def readings(log: Path) -> list[Reading]:
    decoders = decoders_for(read_header(log).config)
    found: list[Reading] = []
    for record in read_log(log):
        if isinstance(record, Chunk) and record.direction == "rx":
            found += decoders[record.port].push(record.t_ns, record.data)
    for decoder in decoders.values():
        found += decoder.finish()
    return found


def pings(log: Path) -> list[Ping]:
    return [each for each in readings(log) if isinstance(each, Ping)]


def ping(bearing: int = 3200) -> bytes:
    return encode_head_data(HeadData(bearing, bytes(range(100)), 33, 32, 2400, 4000, range_scale=100))


def sentence(body: str) -> bytes:
    total = 0
    for byte in body.encode():
        total ^= byte
    return f"${body}*{total:02X}\r\n".encode()


def test_hub_capture_keeps_its_times_and_gives_all_pings(shared_data: Path, tmp_path: Path) -> None:
    log = imported(shared_data / "sonar/udp-hub-2017-11-02.csv", tmp_path / "hub.mcap")
    found = readings(log)
    assert sum(isinstance(each, Ping) for each in found) == 765
    assert sum(isinstance(each, Heading) for each in found) == 588
    assert sum(isinstance(each, Depth) for each in found) == 588
    config = read_header(log).config
    assert [(feed.name, feed.driver, feed.provides) for feed in config.feed] == [("feed", "nmea", ("heading", "depth"))]
    assert (config.sonar.range_m, config.sonar.bins, config.sonar.head_type) == (50.0, 794, "dst")
    received = chunks(log)
    assert (received[0].t_ns, received[0].utc_ns) == (0, 1_509_613_126_723_000_000)
    assert received[1].t_ns == 11_000_000
    raw = (shared_data / "sonar/micron_dst_stream_20171102.bin").read_bytes()
    assert b"".join(each.data for each in received) == raw


def test_v4log_becomes_the_serial_frames_it_was(shared_data: Path, tmp_path: Path) -> None:
    log = imported(shared_data / "sonar/sector-90deg-2005.V4LOG", tmp_path / "v4.mcap")
    received = chunks(log)
    heads = b"".join(each.data for each in received if each.data[10] == MessageId.HEAD_DATA)
    assert heads == (shared_data / "sonar/superseaking_v4log_headdata_reconstructed.bin").read_bytes()
    assert [each.data[10] for each in received[:2]] == [MessageId.VERSION_DATA, MessageId.BB_USER_DATA]
    frames = shared_data / "frames"
    for data, name in zip([each.data for each in received[:2]], ("versiondata", "bbuserdata"), strict=True):
        assert data == bytes.fromhex((frames / f"superseaking_{name}_reconstructed.hex").read_text())
    assert len(pings(log)) == 468
    sonar = read_header(log).config.sonar
    assert (sonar.head_type, sonar.bins, sonar.sector_deg) == ("non-dst", 642, (-45.0, 45.0))
    first = next(each for each in received if each.data[10] == MessageId.HEAD_DATA)
    assert abs(first.utc_ns - 1_116_773_599_890_000_000) < 1_000_000  # 2005-05-22 14:53:19.89


def test_raw_capture_takes_its_times_from_the_baud(shared_data: Path, tmp_path: Path) -> None:
    source = shared_data / "sonar/micron_dst_stream_20171102.bin"
    start = "2017-11-02T08:58:46Z"
    log = imported(source, tmp_path / "raw.mcap", "--baud", "57600", "--start", start)
    received = chunks(log)
    assert b"".join(each.data for each in received) == source.read_bytes()
    assert received[-1].t_ns == 641_888 * 10 * 1_000_000_000 // 57600
    assert received[0].utc_ns == 1_509_613_126_000_000_000
    assert len(pings(log)) == 765
    assert read_header(log).config.sonar.baud == 57600
    note = next(each for each in read_log(log) if isinstance(each, Event))
    assert "line's baud" in str(note.fields["text"])


@pytest.mark.parametrize("dive", ["pool", "bell"])
def test_json_lines_keep_both_directions(shared_data: Path, tmp_path: Path, dive: str) -> None:
    source = shared_data / f"dives/{dive}.jsonl.gz"
    log = imported(source, tmp_path / "dive.mcap")
    with gzip.open(source, "rt") as file:
        wanted = [json.loads(line) for line in file]
    records = list(read_log(log))
    got = [each for each in records if isinstance(each, Chunk)]
    assert [(each.t_ns, each.port, each.direction, each.data.hex()) for each in got] == [
        (each["t_ns"], each["port"], each["dir"], each["hex"]) for each in wanted
    ]
    kinds = {type(each) for each in readings(log)}
    assert kinds == {Ping, Heading, Depth}
    pairs = [each for each in records if isinstance(each, ClockPair)]
    steps = [after.t_ns - before.t_ns for before, after in itertools.pairwise(pairs)]
    assert all(5_000_000_000 <= step < 5_200_000_000 for step in steps)
    note = next(each for each in records if isinstance(each, Event))
    assert "begins at the epoch" in str(note.fields["text"])


def test_each_port_is_known_by_its_bytes_whatever_its_name(tmp_path: Path) -> None:
    rows = [("com7", ping()), ("com3", sentence("SDDPT,1.5,0.0")), ("com9", sentence("HCHDM,90.0,M")), ("aux", b"??")]
    source = tmp_path / "x.jsonl"
    lines = [{"t_ns": n, "port": name, "dir": "rx", "hex": data.hex()} for n, (name, data) in enumerate(rows)]
    source.write_text("\n".join(json.dumps(line) for line in lines))
    log = imported(source, tmp_path / "x.mcap")
    config = read_header(log).config
    assert config.sonar.port == "import:com7"
    assert [(feed.name, feed.port, feed.provides) for feed in config.feed] == [
        ("feed", "import:com3", ("depth",)),
        ("feed2", "import:com9", ("heading",)),
    ]
    assert [each.port for each in read_log(log) if isinstance(each, Chunk)] == ["sonar", "feed", "feed2", "other"]


def test_pressure_sensors_are_known_where_their_bytes_say_it(tmp_path: Path) -> None:
    keller = (read_channel(250, 1) + keller_reply(1.1)) * 5
    rows = [("com1", b"0009.996,M,0.000\r\n" * 8), ("com2", keller), ("com3", b"17.3 22.1\r\n" * 8)]
    source = tmp_path / "x.jsonl"
    lines = [{"t_ns": n, "port": name, "dir": "rx", "hex": data.hex()} for n, (name, data) in enumerate(rows)]
    source.write_text("\n".join(json.dumps(line) for line in lines))
    config = read_header(imported(source, tmp_path / "x.mcap")).config
    assert [(feed.port, feed.driver, feed.format) for feed in config.feed] == [
        ("import:com1", "pressure", "text"),
        ("import:com2", "pressure", "keller"),
    ]
    assert (config.feed[0].column, config.feed[0].unit) == (1, "m")


def test_operator_may_say_what_a_line_is(tmp_path: Path) -> None:
    source = tmp_path / "x.bin"
    source.write_bytes(b"no sentence at all\r\n")
    assert cli.main(["import", str(source), "-o", str(tmp_path / "x.mcap")]) == 65
    log = imported(source, tmp_path / "x.mcap", "--port", "serial=nmea", "--baud", "4800")
    assert [feed.name for feed in read_header(log).config.feed] == ["feed"]
    assert {each.port for each in read_log(log) if isinstance(each, Chunk)} == {"feed"}


def test_configuration_adds_to_what_the_head_tells(tmp_path: Path) -> None:
    (tmp_path / "site.toml").write_text(
        '[site]\nname = "keyhole"\n[sonar]\nsound_speed_m_s = 1500.0\n'
        '[[feed]]\nname = "compass"\nprovides = ["heading"]\n'
    )
    (tmp_path / "x.jsonl").write_text(
        "\n".join(
            json.dumps({"t_ns": n, "port": port, "dir": "rx", "hex": data.hex()})
            for n, (port, data) in enumerate([("a", ping()), ("b", sentence("HCHDM,90.0,M"))])
        )
    )
    log = imported(tmp_path / "x.jsonl", tmp_path / "x.mcap", "--config", str(tmp_path / "site.toml"))
    config = read_header(log).config
    assert (config.site.name, config.sonar.sound_speed_m_s, config.sonar.range_m) == ("keyhole", 1500.0, 10.0)
    assert [(feed.name, feed.provides, feed.port) for feed in config.feed] == [("compass", ("heading",), "import:b")]
    assert {type(each) for each in readings(log)} == {Ping, Heading}


def test_time_that_goes_back_stands_still(tmp_path: Path) -> None:
    source = tmp_path / "x.csv"
    packet = ping().hex(" ").upper()
    times = ("08.58.46.500", "08.58.45.000", "08.58.46.900")
    source.write_text("\n".join(f"2017.11.02 {time};10.0.0.1;4002;{packet}" for time in times))
    got = chunks(imported(source, tmp_path / "x.mcap"))
    assert [each.t_ns for each in got] == [1_500_000_000, 1_500_000_000, 1_900_000_000]
    assert [each.utc_ns % 10**11 // 10**6 for each in got] == [26_500, 25_000, 26_900]


def test_formats_are_told_apart(tmp_path: Path) -> None:
    heads = {
        "v4log": v4log.MAGIC + bytes(12),
        "hub-csv": b"2017.11.02 08.58.46.723;10.3.0.40;4002;0F 11\r\n",
        "jsonl": b'{"port": "sonar", "t_ns": 3, "dir": "rx", "hex": ""}\n',
        "serial": ping(),
    }
    for name, head in heads.items():
        (tmp_path / name).write_bytes(head)
        assert format_of(tmp_path / name) == name
        (tmp_path / f"{name}.gz").write_bytes(gzip.compress(head))
        assert format_of(tmp_path / f"{name}.gz") == name


def test_frames_are_those_of_the_line() -> None:
    whole = wrap_reply(MessageId.VERSION_DATA, bytes(11))
    assert v4log.frame(2, 255, whole[10:-1]) == whole
    assert v4log.frame(2, 255, ping()[10:-1]) == ping()
    assert len(Deframer().push(0, whole + ping())) == 2


def test_hub_lines_agree_with_a_plain_csv_reader(shared_data: Path) -> None:
    source = shared_data / "sonar/udp-hub-2017-11-02.csv"
    with source.open(newline="") as file:
        wanted = [(row[2], bytes.fromhex(row[3])) for row in csv.reader(file, delimiter=";")]
    losses = Losses()
    assert [(each.line, each.data) for each in hub_csv.read(source, 0, losses)] == wanted
    assert losses.pieces == 0
