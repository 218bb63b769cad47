"""``lacuna run``: the daemon, until Ctrl-C."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from config.load import load_config
from daemon.supervisor import Supervisor


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("--config", type=Path, metavar="F", help="configuration file; absent: the defaults")
    parser.add_argument("--json", action="store_true", help="print how the run ended as JSON")
    parser.add_argument("--clock-rate", type=float, default=1.0, help=argparse.SUPPRESS)
    parser.add_argument("--map-wait", type=float, default=2.0, metavar="S", help=argparse.SUPPRESS)


def run(args: argparse.Namespace) -> int:
    """Run the daemon; what happens goes to standard error, how it ended to standard output."""
    config = load_config(args.config)
    outcome = Supervisor(config, _say, args.clock_rate, args.map_wait).run()
    facts = {"session": outcome.session, "folder": str(outcome.folder), "map": outcome.map}
    if args.json:
        print(json.dumps(facts))
    else:
        placed, stations = outcome.map.get("placed", 0), outcome.map.get("stations", 0)
        print(f"stopped: {placed} of {stations} stations placed; the log is {outcome.folder}/{outcome.session}-*.mcap")
    return 0


def _say(line: str) -> None:
    print(f"lacuna: {line}", file=sys.stderr, flush=True)
