"""The options of an emulated dive on a command line, for every command that dives."""

from __future__ import annotations

import argparse
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Final

from config.errors import UsageError
from drivers.records import Json
from tools.emulator.dive import DiveOptions
from tools.emulator.faults import read_faults
from tools.emulator.feeds import FeedOptions
from tools.emulator.head import HeadOptions
from tools.emulator.site import SITES
from tools.emulator.vehicle import PILOTS

_LIMITS: Final = {"bias_deg": 180.0, "deviation_deg": 45.0, "drift_m_s": 0.5, "aux_hz": 20.0}
_BAUDS: Final = (4800, 9600, 19200, 38400, 57600, 115200)
_ODOMETRY_HZ: Final = 5.0
_ODOMETRY_BAUD: Final = 9600
"""A line of 4800 baud has no room for a velocity log beside compass and depth."""


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
        "--odometry", action="store_true", help="a velocity log, which drifts, speaks on the feed's line"
    )
    parser.add_argument("--head", choices=("dst", "non-dst"), default="dst", help="family of the head (default: dst)")
    parser.add_argument("--half-duplex", action="store_true", help="both sides on one wire, one ping a request")
    parser.add_argument("--aux-hz", type=float, default=0.0, metavar="N", help="an echosounder on the head speaks")
    parser.add_argument("--sonar-baud", type=int, choices=_BAUDS, default=115200, help="rate of the head's line")
    parser.add_argument("--feed-baud", type=int, choices=_BAUDS, help="rate of the feed's line (4800, odometry: 9600)")
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
    replies = 1 if args.half_duplex else 2
    hertz = _ODOMETRY_HZ if args.odometry else 0.0
    return DiveOptions(
        stations=args.stations,
        head=HeadOptions(dst=args.head == "dst", baud=args.sonar_baud, replies_per_request=replies, aux_hz=args.aux_hz),
        feed=FeedOptions(
            baud=_feed_baud(args), bias_deg=args.bias_deg, deviation_deg=args.deviation_deg, odometry_hz=hertz
        ),
        vehicle=replace(PILOTS[args.pilot], drift_m_s=args.drift_m_s),
        faults=read_faults(args.faults) if args.faults else (),
    )


def words(args: argparse.Namespace) -> list[str]:
    """Return the words that give another command the same options."""
    said = ["--site", args.site, "--seed", str(args.seed), "--pilot", args.pilot]
    said += [f"--{name.replace('_', '-')}={getattr(args, name)}" for name in _LIMITS]
    said += ["--head", args.head, "--sonar-baud", str(args.sonar_baud), "--feed-baud", str(_feed_baud(args))]
    said += [f"--{name.replace('_', '-')}" for name in ("half_duplex", "odometry") if getattr(args, name)]
    said += [] if args.stations is None else ["--stations", str(args.stations)]
    return said if args.faults is None else [*said, "--faults", str(args.faults)]


def configured(args: argparse.Namespace) -> dict[str, dict[str, Json]]:
    """Return what a configuration must say of the emulated devices: keys of ``sonar`` and of ``feed``."""
    provides: list[Json] = ["heading", "depth", *(["odometry"] if args.odometry else [])]
    return {
        "sonar": {"baud": args.sonar_baud, "head_type": args.head},
        "feed": {"baud": _feed_baud(args), "provides": provides},
    }


def _feed_baud(args: argparse.Namespace) -> int:
    if args.feed_baud is not None:
        return int(args.feed_baud)
    return _ODOMETRY_BAUD if args.odometry else FeedOptions().baud
