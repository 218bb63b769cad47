"""``lacuna bench``: the figures that the README states, measured anew."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict
from itertools import product
from pathlib import Path
from typing import Final

from config.errors import UsageError
from config.schema import Map
from tools.bench import (
    acquisition,
    beams,
    circles,
    dives,
    fill_large,
    fill_times,
    holes,
    holes_causes,
    holes_maps,
    holes_paper,
    holes_prior,
    holes_table,
    stations,
    tank,
    truth,
)
from tools.emulator.site import SITES
from tools.emulator.vehicle import PILOTS

Row = dict[str, str | int | float]

_BENCHES: Final = ("tank", "truth", "stations", "acquisition", "fill", "holes")
_ON_DATA: Final = ("tank", "stations", "holes")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("benches", nargs="*", metavar="BENCH", help=f"which of {', '.join(_BENCHES)} (default: all)")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), metavar="DIR", help="real recordings")
    parser.add_argument("--seeds", type=int, default=2, metavar="N", help="emulated dives per site (default: 2)")
    parser.add_argument("--sites", default="keyhole", metavar="LIST", help="truth: emulated sites (default: keyhole)")
    parser.add_argument("--dives", type=Path, metavar="DIR", help="truth: recorded dives with their truth, instead")
    parser.add_argument("--pilots", default="steady", metavar="LIST", help="truth: how they rest (default: steady)")
    parser.add_argument("--quick", action="store_true", help="acquisition: a short run, for a first look")
    parser.add_argument("--half", choices=("tune", "report"), default="report", help="holes: maps to measure on")
    parser.add_argument("--maps", type=int, default=4, metavar="K", help="holes: damaged pieces per map (default: 4)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="holes: what is lost (default: 1)")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="holes: draw what was filled right and wrong")
    parser.add_argument("--causes", action="store_true", help="holes: also why holes are not closed right, by gap")
    parser.add_argument("--paper-measure", action="store_true", help="holes: also the measure of the paper's table 1")
    parser.add_argument("--fit-prior", type=Path, metavar="DIR", help="holes: fit the prior instead, into this folder")
    parser.add_argument("--json", action="store_true", help="print JSON lines")


def run(args: argparse.Namespace) -> int:
    """Measure and print one line a case; return 1 where a promise is broken."""
    broken: list[str] = []
    if wrong := set(args.benches) - set(_BENCHES):
        raise UsageError(f"there is no bench {', '.join(sorted(wrong))}; choose of {', '.join(_BENCHES)}")
    if unknown := set(args.sites.split(",")) - set(SITES):
        raise UsageError(f"there is no site {', '.join(sorted(unknown))}; choose of {', '.join(sorted(SITES))}")
    if strange := set(args.pilots.split(",")) - set(PILOTS):
        raise UsageError(f"there is no pilot {', '.join(sorted(strange))}; choose of {', '.join(sorted(PILOTS))}")
    for name in args.benches or _BENCHES:
        if name in _ON_DATA and not args.benches and not args.data.is_dir():
            print(f"{name}: left out, no recordings in {args.data} (name their folder with --data)")
            continue
        for row in _measure(name, args):
            print(json.dumps({"bench": name} | row) if args.json else _line(name, row), flush=True)
            broken += [str(row["figure"])] if row.get("holds") == "NO" else []
    if broken:
        print(f"broken promises: {'; '.join(broken)}", file=sys.stderr)
    return 1 if broken else 0


def _measure(name: str, args: argparse.Namespace) -> Iterator[Row]:
    measures: dict[str, Callable[[argparse.Namespace], Iterator[Row]]] = {
        "tank": _tank,
        "truth": _truth,
        "stations": _stations,
        "acquisition": _acquisition,
        "fill": _fill,
        "holes": _holes,
    }
    return measures[name](args)


def _tank(args: argparse.Namespace) -> Iterator[Row]:
    for path in circles.recordings(args.data):
        whole = circles.read_circles(path)
        for count in sorted({1, whole.count}):
            yield {"recording": path.stem, **asdict(tank.measure(whole.first(count)))}
        yield {"recording": path.stem, **asdict(beams.judge_beams(whole.scans, Map()))}


def _truth(args: argparse.Namespace) -> Iterator[Row]:
    if args.dives:
        yield from (asdict(figures) for figures in dives.measure(args.dives))
        return
    for pilot, seed in product(args.pilots.split(","), range(1, args.seeds + 1)):
        for site in args.sites.split(","):
            yield asdict(truth.measure(site, seed, pilot))


def _stations(args: argparse.Namespace) -> Iterator[Row]:
    for figures in stations.measure(args.data):
        yield asdict(figures)


def _acquisition(args: argparse.Namespace) -> Iterator[Row]:
    for figure in acquisition.measure(acquisition.QUICK if args.quick else acquisition.FULL):
        yield figure.row()


def _fill(args: argparse.Namespace) -> Iterator[Row]:
    for figure in (*fill_times.measure(args.seed), *fill_large.measure(args.seed)):
        yield figure.row()


def _holes(args: argparse.Namespace) -> Iterator[Row]:
    if args.maps < 1 or args.seed < 0:
        raise UsageError("--maps must be at least 1 and --seed at least 0")
    if args.fit_prior:
        seeds = range(args.seed, args.seed + args.seeds)
        yield from holes_prior.fit_prior(args.data, seeds, args.maps, args.fit_prior)
        return
    options = holes.HoleOptions(args.data, args.half, args.seed, args.maps, args.pictures)
    yield from holes.measure(options)
    if args.causes:
        yield from holes_causes.measure_causes(holes.damaged_half(options))
    if args.paper_measure:
        yield from holes_paper.measure_as_paper(holes_maps.sources(args.data, args.half), args.seed)


def _line(name: str, row: Row) -> str:
    if name == "holes":
        return holes_table.line(row)
    return f"{name}: " + ", ".join(f"{key} {value}" for key, value in row.items())
