"""``lacuna fill MAP.yaml -o DIR``: hole filling alone, on any ROS map_server map."""

from __future__ import annotations

import argparse
import dataclasses
import json
from pathlib import Path
from typing import Final

from config.load import load_config
from config.schema import Config
from daemon.state import MapState
from drivers.records import Json
from fill.filler import Filler
from fill.surface import extrude
from tools.maps import RosMap, read_map
from tools.outputs import write_outputs
from tools.provenance import Provenance, provenance

_HEIGHT_M: Final = 2.5  # drawn where the configuration names no height; a map of a plane has none


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("map", type=Path, metavar="MAP.yaml", help="the map's description; its image stands beside it")
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="DIR", help="folder for the results")
    parser.add_argument("--config", type=Path, metavar="F", help="configuration; its [fill] and [site] count")
    parser.add_argument("--json", action="store_true", help="print the report as JSON")


def run(args: argparse.Namespace) -> int:
    """Fill the map, write the results, say what was done."""
    config = load_config(args.config)
    read = read_map(args.map)
    state = fill_map(read, config)
    site = config.site.name if args.config else args.map.stem
    facts = write_outputs(args.out, state, _origin(read, args.map, config, site), read.yaw_rad, poses=False)
    print(json.dumps(facts, indent=2, sort_keys=True) if args.json else _summary(state, args.out))
    return 0


def fill_map(read: RosMap, config: Config) -> MapState:
    """Fill the holes of a map and extrude it; there are no stations."""
    filled = Filler(config.fill).update(read.grid)
    mesh = extrude(filled, 0.0, config.site.height_m or _HEIGHT_M)
    return MapState((), read.grid, filled, mesh)


def _origin(read: RosMap, path: Path, config: Config, site: str) -> Provenance:
    damage: dict[str, Json] = {}
    if Path(read.image).stem != path.stem:
        damage["image"] = f"read {read.image}"
    return dataclasses.replace(provenance(config, (path.name,), damage), site=site, north="north: the map's y axis")


def _summary(state: MapState, folder: Path) -> str:
    holes = state.filled.holes
    lines = [f"{len(holes)} holes filled, {len(state.filled.open_ends_m)} ends left open"]
    if state.filled.noise_ends:
        lines.append(f"  {state.filled.noise_ends} ends more are not looked at: no site has so many, they are noise")
    for hole in sorted(holes, key=lambda each: -each.gap_m)[:10]:
        (x0, y0), (x1, y1) = hole.ends_m
        lines.append(f"  hole {hole.index}: ({x0:.2f}, {y0:.2f}) to ({x1:.2f}, {y1:.2f}) m, {hole.why}")
    if len(holes) > 10:
        lines.append(f"  and {len(holes) - 10} smaller ones: holes.csv")
    return "\n".join([*lines, f"results in {folder}"])
