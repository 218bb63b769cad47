"""``lacuna info``: what is in a log, whole or broken."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from config.errors import DataError
from config.schema import Config
from drivers.log import Damage, LogHeader, log_files, read_log, read_metadata
from drivers.log.header import check_format, header_of
from drivers.log.names import session_of
from drivers.tritech.pace import limits
from tools.log_facts import SessionFacts, Values, port_body
from tools.progress import counted


@dataclass(frozen=True, slots=True)
class Session:
    """Files of one session, its header, or why there is none."""

    name: str
    files: list[Path]
    header: LogHeader | None
    trouble: str


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("log", type=Path, nargs="+", help="a log (*.mcap) or a folder of logs")
    parser.add_argument("--json", action="store_true", help="print the facts as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the facts of each session; raises DataError only where nothing at all is readable."""
    found: list[dict[str, Any]] = []
    failures: list[DataError] = []
    for session in sessions(args.log):
        try:
            found.append(facts(session))
        except DataError as error:
            failures.append(error)
    if not found:
        raise failures[0]
    if args.json:
        print(json.dumps({"sessions": found, "unreadable": [str(error) for error in failures]}))
        return 0
    for body in found:
        print("\n".join(_text(body)))
    for failure in failures:
        print(f"not readable: {failure}")
    return 0


def sessions(paths: Sequence[Path]) -> list[Session]:
    """Group the files of ``paths`` by session; raises DataError where none of them holds anything readable."""
    grouped: dict[str, list[Path]] = {}
    headers: dict[str, LogHeader] = {}
    troubles: dict[str, str] = {}
    for path in log_files(paths):
        name = session_of(path)
        try:
            metadata = read_metadata(path)
            name = metadata.get("session", name)
            check_format(metadata, path.name)
            headers.setdefault(name, header_of(metadata, path.name))
        except DataError as error:
            troubles.setdefault(name, str(error))
        grouped.setdefault(name, []).append(path)
    return [Session(name, files, headers.get(name), troubles.get(name, "")) for name, files in grouped.items()]


def facts(session: Session) -> dict[str, Any]:
    """Return everything about a session, for JSON."""
    damage = Damage()
    config = session.header.config if session.header else Config()
    gathered = SessionFacts(config)
    for record in counted(read_log(session.files, damage), "records read"):
        gathered.take(record)
    gathered.finish()
    return {
        "session": session.name,
        "files": [str(path) for path in session.files],
        "trouble": session.trouble or None,
        "versions": session.header.versions if session.header else None,
        "site": config.site.name if session.header else None,
        **_span(gathered),
        "ports": {name: port_body(port, gathered.end_s) for name, port in gathered.ports.items()},
        "sonar": _sonar(gathered, config),
        "heading": _values(gathered.compass.values, "deg") | {"arc_deg": gathered.compass.arc_deg},
        "depth": _values(gathered.depth, "m"),
        "altitude": _values(gathered.altitude, "m"),
        "odometry": _values(gathered.odometry, "m"),
        "clock_pairs": gathered.clock_pairs,
        "events": dict(gathered.events),
        "first_events": gathered.first_events,
        "damage": asdict(damage),
    }


def _span(gathered: SessionFacts) -> dict[str, Any]:
    start = gathered.start
    body = {"records": gathered.records, "duration_s": round(gathered.end_s, 3)}
    return body | {"start_t_ns": start.t_ns if start else None, "start_utc": _iso(start.utc_ns) if start else None}


def _iso(utc_ns: int) -> str | None:
    try:
        return datetime.fromtimestamp(utc_ns // 1_000_000_000, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    except (OverflowError, ValueError, OSError):
        return None


def _sonar(gathered: SessionFacts, config: Config) -> dict[str, Any]:
    turning = gathered.turning
    # Of several settings none rules the mean; the first is taken for what the dive was made with.
    rules = None
    if turning.pings_per_s and turning.settings:
        bins, bin_m = turning.settings[0]["bins"], turning.settings[0]["bin_m"]
        sampling_s = 2.0 * bins * bin_m / config.sonar.sound_speed_m_s
        rules = limits(bins * config.sonar.bits // 8, sampling_s, config.sonar.baud).ruling(1.0 / turning.pings_per_s)
    return {
        "pings": turning.pings,
        "pings_per_s": turning.pings_per_s,
        "s_per_revolution": turning.s_per_revolution,
        "limited_by": rules,
        "settings": turning.settings,
        "settings_changes": turning.changes,
    }


def _values(values: Values, unit: str) -> dict[str, Any]:
    body: dict[str, Any] = {"count": values.count, "per_s": values.per_s}
    if values.count:
        body |= {f"min_{unit}": round(values.smallest, 3), f"max_{unit}": round(values.largest, 3)}
    return body


def _text(body: dict[str, Any]) -> Iterator[str]:
    yield f"session {body['session']}: {len(body['files'])} file(s), {body['records']} records"
    if body["trouble"]:
        yield f"  header     {body['trouble']}"
    elif body["versions"] is not None:
        versions = ", ".join(f"{name} {version}" for name, version in body["versions"].items())
        yield f"  written by {versions or 'unknown'}; site {body['site']}"
    if body["records"]:
        yield f"  time       from {body['start_utc'] or 'an unknown date'}, {body['duration_s']:.1f} s"
    for name, port in body["ports"].items():
        yield from _port_text(name, port)
    yield from _sonar_text(body["sonar"])
    yield from _values_text(body)
    if body["events"]:
        yield "  events     " + ", ".join(f"{kind} {count}" for kind, count in sorted(body["events"].items()))
    yield "  damage     " + _damage_text(body["damage"])


def _port_text(name: str, port: dict[str, Any]) -> Iterator[str]:
    for direction in ("rx", "tx"):
        way = port[direction]
        if not way["chunks"]:
            continue
        gap = f", longest gap {way['longest_gap_s']:.2f} s at {way['longest_gap_at_s']:.1f} s" if way["gaps"] else ""
        speed = f" ({way['bytes_per_s']:.0f} B/s)" if way["bytes_per_s"] is not None else ""
        yield f"  {name:<10} {direction} {way['bytes']} bytes in {way['chunks']} pieces{speed}{gap}"
    if "messages" in port:
        kinds = ", ".join(f"{kind} {count}" for kind, count in sorted(port["messages"].items())) or "no messages"
        bad = "".join(f", bad {reason} {count}" for reason, count in sorted(port["bad"].items()))
        yield f"             {kinds}{bad}, {port['skipped_bytes']} bytes skipped"
        doubtful = [f"{count} {name}" for name, count in sorted(port["quality"].items()) if name != "good"]
        if doubtful:
            yield f"             readings: {', '.join(doubtful)}; last because of {port['last_reason']}"


_RULES: Final = {
    None: "",
    "line": ", as fast as the line carries them",
    "sound": ", as fast as sound travels",
    "other": ", slower than line and sound allow",
}


def _sonar_text(sonar: dict[str, Any]) -> Iterator[str]:
    if not sonar["pings"]:
        yield "  pings      none"
        return
    speed = f", {sonar['pings_per_s']:.2f} a second" if sonar["pings_per_s"] else ""
    turn = f", {sonar['s_per_revolution']:.1f} s per revolution" if sonar["s_per_revolution"] else ""
    yield f"  pings      {sonar['pings']}{speed}{turn}{_RULES[sonar['limited_by']]}"
    for each in sonar["settings"][:10]:
        sector = "full circle" if each["sector_deg"] is None else "sector {} to {} deg".format(*each["sector_deg"])
        yield (
            f"  settings   from {each['since_s']:.1f} s: range {each['range_m']:g} m, {each['bins']} bins, "
            f"step {each['step_deg']:g} deg, gain {each['gain_pct']:g} %, {sector}"
        )


def _values_text(body: dict[str, Any]) -> Iterator[str]:
    heading = body["heading"]
    if heading["count"]:
        left, right = heading["arc_deg"]
        yield f"  heading    {heading['count']} readings{_per_s(heading)}, within {left} to {right} deg"
    for name in ("depth", "altitude", "odometry"):
        values = body[name]
        if values["count"]:
            span = f"{values['min_m']:.2f} to {values['max_m']:.2f} m"
            yield f"  {name:<10} {values['count']} readings{_per_s(values)}, {span}"


def _per_s(values: dict[str, Any]) -> str:
    return f" ({values['per_s']:.1f} a second)" if values["per_s"] else ""


def _damage_text(damage: dict[str, int]) -> str:
    words = [f"{name.replace('_', ' ')} {count}" for name, count in damage.items() if count and name != "truncated"]
    if damage["truncated"]:
        words.append(f"{damage['truncated']} file(s) not closed (interrupted, or still being written)")
    return ", ".join(words) or "none"
