"""``lacuna replay``: the same pipeline over recorded logs."""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import Final

from config.errors import DataError, UsageError
from config.load import load_config
from config.schema import Config, Publish
from daemon.pipeline import Pipeline
from daemon.snapshots import Snapshot
from daemon.state import MapState
from drivers.log import Damage, log_files, read_header, read_log, read_metadata
from drivers.records import Json, Record
from tools.onair import OnAir
from tools.outputs import write_outputs
from tools.pace import Pace
from tools.provenance import provenance

_LINE_S: Final = 0.5

Watch = Callable[[Record, list[Snapshot]], None]
"""Called after each record with what became new by it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help="log files of one session, or their folder")
    parser.add_argument("--config", type=Path, metavar="F", help="configuration in place of the log's own")
    parser.add_argument("--speed", type=_speed, metavar="N", help="times the log's pace, or max (the default)")
    parser.add_argument("--publish", action="store_true", help="serve the live topics too, at the log's pace")
    parser.add_argument("-o", "--out", type=Path, metavar="DIR", help="folder of results; needed without --publish")
    parser.add_argument("--json", action="store_true", help="print the report as JSON")


def run(args: argparse.Namespace) -> int:
    """Replay, write the results, say in one line what came out."""
    if args.out is None and not args.publish:
        raise UsageError("replay needs -o DIR for its results, or --publish")
    files = log_files(args.logs)
    config = config_of(files, args.config)
    with ExitStack() as stack:
        watches: list[Watch] = [_Progress().show] if sys.stderr.isatty() else []
        speed = args.speed or (1.0 if args.publish else math.inf)
        if args.publish:
            publish = config.publish if args.config else Publish()
            watches.append(stack.enter_context(OnAir(config, publish, files[0].stem, speed)).take)
        elif math.isfinite(speed):
            watches.append(Pace(speed).wait)
        state, damage = replay(files, config, *watches)
    facts = write_results(args.out, state, config, files, damage) if args.out else {}
    print(json.dumps(facts, sort_keys=True) if args.json else summary(state, damage, args.out))
    return 0


def replay(files: list[Path], config: Config, *watches: Watch) -> tuple[MapState, Damage]:
    """Return the map of ``files`` under ``config``, and what could not be read of them."""
    pipeline, damage = Pipeline(config), Damage()
    for record in read_log(files, damage):
        told = pipeline.push(record)
        for watch in watches:
            watch(record, told)
    pipeline.finish()
    return pipeline.whole, damage


def write_results(folder: Path, state: MapState, config: Config, files: list[Path], damage: Damage) -> dict[str, Json]:
    """Write the folder of results; return what its report says."""
    names = tuple(path.name.removesuffix(".part") for path in files)
    return write_outputs(folder, state, provenance(config, names, asdict(damage)))


def config_of(files: list[Path], given: Path | None) -> Config:
    """Return the configuration to replay with: the given one, else the log's own.

    Raises DataError where the files are of several sessions, or none has a readable header.
    """
    sessions = {metadata["session"] for metadata in map(_metadata, files) if "session" in metadata}
    if len(sessions) > 1:
        names = ", ".join(sorted(sessions))
        raise DataError(f"these logs are of {len(sessions)} sessions ({names}); name the files of one")
    if given is not None:
        return load_config(given)
    for path in files[:-1]:
        try:
            return read_header(path).config
        except DataError:
            continue
    return read_header(files[-1]).config


def summary(state: MapState, damage: Damage, out: Path | None) -> str:
    """Return the line that says what came out."""
    placed = sum(station.status == "placed" for station in state.stations)
    lost = f", {damage.records_missing} records of the log are lost" if damage.records_missing else ""
    where = f"; results in {out}" if out else ""
    return f"{placed} of {len(state.stations)} stations placed, {len(state.filled.holes)} holes filled{lost}{where}"


class _Progress:
    """One line on the terminal that says how far the replay is."""

    def __init__(self) -> None:
        self._first_ns: int | None = None
        self._stations = 0
        self._told_s = 0.0

    def show(self, record: Record, told: list[Snapshot]) -> None:
        """Count, and rewrite the line now and then."""
        self._first_ns = record.t_ns if self._first_ns is None else self._first_ns
        self._stations += sum(each.topic == "station" for each in told)
        if time.monotonic() - self._told_s >= _LINE_S:
            self._told_s = time.monotonic()
            minutes, seconds = divmod((record.t_ns - self._first_ns) // 1_000_000_000, 60)
            line = f"\rreplaying: {minutes:3d}:{seconds:02d} of the log, {self._stations} scans "
            print(line, end="\r", file=sys.stderr, flush=True)


def _metadata(path: Path) -> dict[str, str]:
    try:
        return read_metadata(path)
    except DataError:
        return {}


def _speed(text: str) -> float:
    if text == "max":
        return math.inf
    try:
        speed = float(text)
    except ValueError:
        speed = 0.0
    if not 0.0 < speed < math.inf:
        raise argparse.ArgumentTypeError(f"a number above 0 or max, not {text!r}")
    return speed
