"""``lacuna import``: a foreign recording as a log."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from config.errors import DataError, LogError, UsageError
from config.load import load_config
from config.schema import Config, Feed
from drivers.log import LogHeader, write_log
from drivers.records import Json
from tools.importers.capture import Format, Losses
from tools.importers.convert import Clock, records
from tools.importers.lines import Survey
from tools.importers.ports import DRIVERS, Ports, assign
from tools.importers.table import FORMATS, format_of
from tools.progress import counted

_BAUD: Final = 115200


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("file", type=Path, help="the foreign recording, plain or gzip")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="LOG", help="the log to write (*.mcap)")
    parser.add_argument("--format", choices=FORMATS, help="its format; found from its first bytes where not given")
    parser.add_argument(
        "--port", action="append", default=[], metavar="NAME=DRIVER", help=f"what a line speaks: {', '.join(DRIVERS)}"
    )
    parser.add_argument("--baud", type=int, default=_BAUD, help=f"rate of the sonar's line (default {_BAUD})")
    parser.add_argument("--start", metavar="ISO", help="UTC of the first byte, for example 2017-11-02T08:58:46Z")
    parser.add_argument(
        "--config", type=Path, metavar="F", help="site, sound speed and map settings to keep in the log"
    )
    parser.add_argument("--json", action="store_true", help="print the facts as JSON")


def run(args: argparse.Namespace) -> int:
    """Write the log and say what is in it."""
    if not 300 <= args.baud <= 4_000_000:
        raise UsageError(f"--baud {args.baud}: a line has 300 to 4000000 baud")
    if args.output.exists():
        raise LogError(f"{args.output} exists; choose another name with -o or move it away")
    start_utc_ns, told = _start(args.start), _told(args.port)
    base = load_config(args.config) if args.config is not None else Config()
    name = format_of(args.file, args.format)
    form, losses = FORMATS[name], Losses()
    survey = Survey(counted(form.read(args.file, args.baud, losses), "pieces heard"), args.baud)
    if survey.first is None:
        raise DataError(f"{args.file} holds nothing that is {form.title}; name another --format")
    feed_baud = args.baud if name == "serial" else Feed().baud
    ports = assign(survey, told, base, args.baud, feed_baud)
    clock = Clock(survey.first.t_ns, -survey.earliest_t_ns, start_utc_ns)
    note = _note(args.file, form, ports, losses, dated=start_utc_ns is not None or survey.first.utc_ns is not None)
    header = LogHeader(ports.config, {"lacuna": version("lacuna"), "import": name}, args.output.stem)
    pieces = counted(form.read(args.file, args.baud, Losses()), "pieces written")
    count = write_log(args.output, header.metadata(), records(pieces, ports.names, clock, note))
    _report(args, name, count, survey, ports, losses)
    return 0


def _start(text: str | None) -> int | None:
    if text is None:
        return None
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        raise UsageError(f"--start {text}: not a time; write it as 2017-11-02T08:58:46Z") from None
    time = time if time.tzinfo is not None else time.replace(tzinfo=UTC)
    seconds = time.timestamp()
    if seconds < 0:
        raise UsageError(f"--start {text}: a log begins in 1970 at the earliest")
    return int(seconds) * 1_000_000_000 + time.microsecond * 1000


def _told(options: Sequence[str]) -> dict[str, str]:
    told: dict[str, str] = {}
    for option in options:
        name, equals, driver = option.rpartition("=")
        if not equals or not name or not driver:
            raise UsageError(f"--port {option}: write it as NAME=DRIVER, for example feed=nmea")
        told[name] = driver
    return told


def _note(file: Path, form: Format, ports: Ports, losses: Losses, *, dated: bool) -> dict[str, Json]:
    date = "" if dated else "; the date is unknown, the log begins at the epoch (give --start)"
    return {
        "text": f"imported from {file.name} ({form.title}); {form.clock}{date}",
        "lines": {port: line for line, port in ports.names.items()},
        "not_readable": losses.pieces,
    }


def _report(args: argparse.Namespace, name: str, count: int, survey: Survey, ports: Ports, losses: Losses) -> None:
    lines = [_facts(survey, ports, line) for line in ports.names]
    if args.json:
        body = {"log": str(args.output), "format": name, "records": count, "ports": lines}
        print(json.dumps(body | {"not_readable": losses.pieces, "first_not_readable": losses.first or None}))
        return
    print(f"{args.output}: {count} records from {args.file.name} ({FORMATS[name].title})")
    for facts in lines:
        what = f"{facts['pings']} pings" if facts["driver"] == "tritech" else ", ".join(facts["provides"])
        print(
            f"  {facts['port']}: line {facts['line']}, {facts['driver'] or 'not understood'}; {what or 'no readings'}"
        )
    if losses.pieces:
        print(f"  not readable: {losses.pieces} pieces; first: {losses.first}")


def _facts(survey: Survey, ports: Ports, line: str) -> dict[str, Any]:
    port, probe = ports.names[line], survey.lines[line]
    driver = ports.drivers[port]
    provides = next((feed.provides for feed in ports.config.feed if feed.name == port), ())
    return {
        "port": port,
        "line": line,
        "driver": driver,
        "rx_bytes": probe.rx_bytes,
        "pings": probe.pings if port == "sonar" else 0,
        "provides": list(provides),
    }
