"""``lacuna demo``: an emulated vehicle in an emulated site, the real daemon on it, and the dashboard."""

from __future__ import annotations

import argparse
import json
import math
import signal
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

from config.errors import LacunaError, UsageError
from drivers.log import log_files
from drivers.records import Json
from tools.crew import Crew
from tools.emulator import options
from tools.emulator.serve import SPEEDS
from tools.files import make_folder, replace_file
from tools.replay import config_of, replay, summary, write_results

_DIGESTS: Final = ("poses", "grid", "mesh")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    options.add_arguments(parser)
    parser.add_argument("--speed", type=float, metavar="N", help="times real time (default: 4, headless 8)")
    parser.add_argument("--headless", action="store_true", help="no dashboard: dive, map, write the results, end")
    parser.add_argument("-o", "--out", type=Path, metavar="DIR", help="folder of the log and the results")
    parser.add_argument("--json", action="store_true", help="print the report as JSON (headless)")


def run(args: argparse.Namespace) -> int:
    """Dive until Ctrl-C, or headless until the script is done."""
    if args.headless and args.out is None:
        raise UsageError("demo --headless needs --out DIR for its results")
    speed = args.speed if args.speed is not None else (8.0 if args.headless else 4.0)
    if not SPEEDS[0] <= speed <= SPEEDS[1] or not math.isfinite(speed):
        raise UsageError(f"--speed must be from {SPEEDS[0]:g} to {SPEEDS[1]:g}")
    options.dive_options(args)  # refuses here, on one line, what the emulated vehicle would refuse
    with ExitStack() as stack:
        # Whoever ends the demo with SIGTERM means what Ctrl-C means: the other processes end with it.
        stack.callback(signal.signal, signal.SIGTERM, signal.signal(signal.SIGTERM, signal.default_int_handler))
        scratch = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="lacuna-demo-")))
        folder = args.out.resolve() if args.out else scratch / "logs"
        make_folder(folder)
        crew = stack.enter_context(Crew(scratch, folder, args.site, speed, options.configured(args)))
        crew.start(options.words(args), folder / "truth.json" if args.headless else None)
        return _headless(crew, folder, args.json) if args.headless else _watched(crew, bool(args.out))


def _watched(crew: Crew, is_kept: bool) -> int:
    print(f"the dive is at {crew.open_dashboard()}  (Ctrl-C ends it)", flush=True)
    try:
        for event in crew.events():
            print(_line(event), flush=True)
    except KeyboardInterrupt:
        print()
    outcome = crew.stop()
    if is_kept:
        print(f"the log is {outcome['folder']}/{outcome['session']}-*.mcap; map it with 'lacuna replay'")
    return 0


def _headless(crew: Crew, folder: Path, as_json: bool) -> int:
    for event in crew.events():
        if sys.stderr.isatty():
            print(_line(event), file=sys.stderr, flush=True)
        if event["event"] == "done":
            break
    outcome = crew.stop()
    files = [path for path in log_files([folder]) if path.name.startswith(f"{outcome['session']}-")]
    config = config_of(files, None)
    state, damage = replay(files, config)
    facts = write_results(folder, state, config, files, damage)
    live = _compared(outcome["map"], facts)
    facts["live"] = live
    replace_file(folder / "report.json", (json.dumps(facts, indent=2, sort_keys=True) + "\n").encode())
    print(json.dumps(facts, sort_keys=True) if as_json else summary(state, damage, folder))
    if live["finished"] and not live["equal"]:
        raise LacunaError(f"the live map differs from the replayed one; please report it with {folder}/report.json")
    return 0


def _compared(told: dict[str, Any], facts: dict[str, Json]) -> dict[str, Json]:
    """Compare what the map's process told at its end with the replay of its log."""
    live: dict[str, Json] = {name: told.get(name) for name in _DIGESTS}
    return {"sha256": live, "finished": bool(told.get("is_final")), "equal": live == facts["sha256"]}


def _line(event: dict[str, Any]) -> str:
    if event["event"] == "station":
        return f"{event['t_s']:8.1f} s  at rest at station {event['station'] + 1} of {event['of']}"
    if event["event"] == "fault":
        return f"{event['t_s']:8.1f} s  fault: {event['kind']} ({event['port'] or 'clock'})"
    return f"{event.get('t_s', 0.0):8.1f} s  {event['event']}"
