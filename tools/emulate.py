"""`lacuna emulate`: an emulated vehicle in an emulated site, served on pseudo-terminals or recorded to a file."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from config.errors import LogError, UsageError
from tools.emulator.dive import Dive, DiveOptions
from tools.emulator.record import record, write_jsonl
from tools.emulator.site import SITES
from tools.emulator.truth import truth_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--site", choices=sorted(SITES), default="keyhole", help="where to dive (default: keyhole)")
    parser.add_argument("--seed", type=int, default=1, help="of speckle, noise and drift (default: 1)")
    parser.add_argument("--stations", type=int, metavar="K", help="rest at the first K stops only")
    parser.add_argument("--truth", type=Path, metavar="FILE", help="write where everything truly was (JSON)")
    parser.add_argument("--record", type=Path, metavar="FILE", help="record a dive in simulated time as JSON lines")


def run(args: argparse.Namespace) -> int:
    """Serve or record."""
    if args.stations is not None and args.stations < 1:
        raise UsageError("--stations must be 1 or more")
    if args.record is None:
        raise UsageError("say where the dive goes: --record FILE")
    dive = Dive(SITES[args.site](), args.seed, DiveOptions(stations=args.stations))
    count = write_jsonl(record(dive), args.record)
    if args.truth:
        write_truth(dive, args.truth)
    print(f"{args.record}: {count} pieces, {len(dive.vehicle.rests)} stations", file=sys.stderr)
    return 0


def write_truth(dive: Dive, path: Path) -> None:
    """Write the truth of a dive; raises LogError where that fails."""
    try:
        path.write_text(json.dumps(truth_of(dive)) + "\n", encoding="ascii")
    except OSError as error:
        raise LogError(f"cannot write {path}: {error.strerror}; choose another file or free some space") from None
