"""`lacuna emulate`: an emulated vehicle in an emulated site, served on pseudo-terminals or recorded to a file."""

from __future__ import annotations

import argparse
import json
import signal
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from config.errors import LogError, UsageError
from config.schema import Sonar
from drivers.records import Json
from tools.emulator import faults, options
from tools.emulator.dive import Dive, DiveOptions
from tools.emulator.record import record, write_jsonl
from tools.emulator.serve import SPEEDS, Emulation
from tools.emulator.site import SITES
from tools.emulator.truth import truth_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = faults.__doc__
    options.add_arguments(parser)
    parser.add_argument("--speed", type=float, default=1.0, metavar="N", help="times real time (default: 1)")
    parser.add_argument("--folder", type=Path, metavar="DIR", help="where the ports' names go (default: a new folder)")
    parser.add_argument("--truth", type=Path, metavar="FILE", help="write where everything truly was (JSON)")
    parser.add_argument("--record", type=Path, metavar="FILE", help="record a dive in simulated time as JSON lines")
    parser.add_argument("--json", action="store_true", help="tell what happens as JSON lines")


def run(args: argparse.Namespace) -> int:
    """Serve until Ctrl-C or SIGTERM, or record."""
    if not SPEEDS[0] <= args.speed <= SPEEDS[1]:
        raise UsageError(f"--speed must be from {SPEEDS[0]:g} to {SPEEDS[1]:g}")
    chosen = options.dive_options(args)
    return _record(args, chosen) if args.record else _serve(args, chosen)


def _record(args: argparse.Namespace, chosen: DiveOptions) -> int:
    dive = Dive(SITES[args.site](), args.seed, chosen)
    sonar = Sonar.model_validate(options.configured(args)["sonar"])
    count = write_jsonl(record(dive, sonar), args.record)
    if args.truth:
        _write_truth(truth_of(dive), args.truth)
    facts: dict[str, Json] = {"event": "recorded", "pieces": count, "stations": len(dive.vehicle.rests)}
    _say(facts if args.json else f"{args.record}: {count} pieces, {len(dive.vehicle.rests)} stations")
    return 0


def _serve(args: argparse.Namespace, chosen: DiveOptions) -> int:
    with _folder(args.folder) as folder, _stop_signals() as asked:
        emulation = Emulation(folder, args.site, args.seed, args.speed, chosen, _tell_json if args.json else _tell)
        try:
            emulation.serve(lambda: asked.stop)
        finally:
            emulation.close()
            if args.truth:
                _write_truth(emulation.truth(), args.truth)
    return 0


@dataclass(slots=True)
class _Asked:
    stop: bool = False


@contextmanager
def _stop_signals() -> Iterator[_Asked]:
    """Turn SIGINT, SIGTERM and SIGHUP into a flag while the block runs."""
    asked = _Asked()

    def note(_number: int, _frame: FrameType | None) -> None:
        asked.stop = True

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _folder(given: Path | None) -> Iterator[Path]:
    if given is not None:
        yield given
    else:
        with tempfile.TemporaryDirectory(prefix="lacuna-") as made:
            yield Path(made)


def _tell_json(event: dict[str, Json]) -> None:
    _say(event)


def _tell(event: dict[str, Json]) -> None:
    match event["event"]:
        case "ready":
            _say(f"sonar {event['sonar']}\nfeed  {event['feed']}\nwaiting for a host; Ctrl-C ends")
        case "station":
            _say(f"{event['t_s']:8.1f} s  at rest at station {event['station']} of {event['of']} (counted from 0)")
        case "fault":
            _say(f"{event['t_s']:8.1f} s  fault: {event['kind']} ({event['port'] or 'clock'})")
        case _:
            _say(f"{event['t_s']:8.1f} s  done; staying at rest, Ctrl-C ends")


def _say(what: str | dict[str, Json]) -> None:
    print(what if isinstance(what, str) else json.dumps(what), flush=True)


def _write_truth(truth: dict[str, Json], path: Path) -> None:
    """Write the truth whole or not at all; raises LogError where that fails."""
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(json.dumps(truth) + "\n", encoding="ascii")
        part.replace(path)
    except OSError as error:
        raise LogError(f"cannot write {path}: {error.strerror}; choose another file or free some space") from None
