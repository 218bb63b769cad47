"""The options of an emulated dive on a command line, for every command that dives."""

from __future__ import annotations

import argparse
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Final

from config.errors import UsageError
from tools.emulator.dive import DiveOptions
from tools.emulator.faults import read_faults
from tools.emulator.feeds import FeedOptions
from tools.emulator.site import SITES
from tools.emulator.vehicle import PILOTS

_LIMITS: Final = {"bias_deg": 180.0, "deviation_deg": 45.0, "drift_m_s": 0.5}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare where to dive, and how vehicle and compass behave."""
    usual = FeedOptions()
    parser.add_argument("--site", choices=sorted(SITES), default="keyhole", help="where to dive (default: keyhole)")
    parser.add_argument("--seed", type=int, default=1, help="of speckle, noise, drift and faults (default: 1)")
    parser.add_argument("--stations", type=int, metavar="K", help="rest at the first K stops only")
    parser.add_argument(
        "--pilot",
        choices=sorted(PILOTS),
        default="steady",
        help="steady rests; restless sways by centimetres; hasty creeps on and leaves after one circle",
    )
    parser.add_argument("--drift-m-s", type=float, default=0.0, metavar="V", help="drift at rest, 20 cm at most")
    parser.add_argument(
        "--bias-deg", type=float, default=usual.bias_deg, metavar="A", help="error of the compass (default: 1)"
    )
    parser.add_argument(
        "--deviation-deg",
        type=float,
        default=usual.deviation_deg,
        metavar="A",
        help="greatest error of the compass that goes with the heading (default: 1.5)",
    )
    parser.add_argument(
        "--faults", type=Path, metavar="FILE", help="what goes wrong, and when: see `lacuna emulate -h`"
    )


def dive_options(args: argparse.Namespace) -> DiveOptions:
    """Return the options of the dive; raises UsageError where they make no sense, and what `read_faults` raises."""
    if args.stations is not None and args.stations < 1:
        raise UsageError("--stations must be 1 or more")
    if args.seed < 0:
        raise UsageError("--seed must not be negative")
    for name, limit in _LIMITS.items():
        value = getattr(args, name)
        least = -limit if name == "bias_deg" else 0.0
        if not isfinite(value) or not least <= value <= limit:
            raise UsageError(f"--{name.replace('_', '-')} must be from {least:g} to {limit:g}")
    return DiveOptions(
        stations=args.stations,
        feed=FeedOptions(bias_deg=args.bias_deg, deviation_deg=args.deviation_deg),
        vehicle=replace(PILOTS[args.pilot], drift_m_s=args.drift_m_s),
        faults=read_faults(args.faults) if args.faults else (),
    )


def words(args: argparse.Namespace) -> list[str]:
    """Return the words that give another command the same options."""
    said = ["--site", args.site, "--seed", str(args.seed), "--pilot", args.pilot]
    said += [f"--{name.replace('_', '-')}={getattr(args, name)}" for name in _LIMITS]
    said += [] if args.stations is None else ["--stations", str(args.stations)]
    return said if args.faults is None else [*said, "--faults", str(args.faults)]
