"""``lacuna calibrate``: speed of sound and range offset, from a log that was made in a pool of known size."""

from __future__ import annotations

import argparse
import json
import math
import re
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.errors import DataError
from config.schema import Config
from drivers.decoders import decoders_for
from drivers.log import log_files, read_log
from drivers.readings import Reading, is_usable
from drivers.records import Chunk
from mapping.echoes import VAGUE_SD_M, pick
from mapping.scan import ScanBuilder
from mapping.values import Scan
from tools.bench.beams import fit_room
from tools.bench.rectangle import NEAR_M
from tools.progress import counted
from tools.replay import config_of

LEAST_NEAR: Final = 0.8
"""Share of a circle's sure beams that must lie on the four walls."""
SPEED_SD: Final = 0.04
OFFSET_SD_M: Final = 0.05
"""What is known beforehand: the configured speed within so much of itself, and no offset within so much."""
SCATTER_M: Final = 0.01
"""Least standard deviation of a room's side from one circle ..."""
SHARED_M: Final = 0.004
"""... and of what all circles have in common."""
SPEEDS_M_S: Final = (1350.0, 1650.0)


@dataclass(frozen=True, slots=True)
class Calibration:
    """What to configure, with standard deviations, and how long the room's sides read before.

    ``off_m`` is by how much each side is off afterwards, in the circle in which it is off most.
    """

    circles: int
    sound_speed_m_s: float
    sound_speed_sd_m_s: float
    range_offset_m: float
    range_offset_sd_m: float
    read_m: tuple[float, float]
    off_m: tuple[float, float]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help="log files of one session, or their folder")
    parser.add_argument("--room", type=_room, required=True, metavar="AxB", help="sides of the pool in m, as 4.6x4.4")
    parser.add_argument("--config", type=Path, metavar="F", help="configuration in place of the log's own")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the lines to paste into the configuration.

    Raises DataError where no circle shows the four walls, or the room is no such room.
    """
    files = log_files(args.logs)
    config = config_of(files, args.config)
    sides_m = [sides for scan in scans_of(files, config) if (sides := sides_of(scan, config)) is not None]
    if not sides_m:
        raise DataError("no circle of the log shows four walls; rest for a full turn in sight of all of them")
    found = calibrate(np.array(sides_m), args.room, config.sonar.sound_speed_m_s)
    print(json.dumps(asdict(found)) if args.json else text(found, args.room))
    return 0


def scans_of(files: list[Path], config: Config) -> list[Scan]:
    """Return the circles at rest of a log."""
    scans = ScanBuilder(config.map)
    found = [scan for reading in _readings(files, config) for scan in scans.push(reading)]
    return found + scans.finish()


def _readings(files: list[Path], config: Config) -> Iterator[Reading]:
    decoders = decoders_for(config)
    for record in counted(read_log(files), "records"):
        if isinstance(record, Chunk) and record.direction == "rx" and record.port in decoders:
            yield from filter(is_usable, decoders[record.port].push(record.t_ns, record.data))
    for decoder in decoders.values():
        yield from filter(is_usable, decoder.finish())


def sides_of(scan: Scan, config: Config) -> tuple[float, float] | None:
    """Return the sides in m of the rectangle that a circle sees, without the configured offset, the longer one first.

    None where what it sees is no rectangle.
    """
    returns = pick(scan, config.map.model_copy(update={"range_offset_m": 0.0}))
    sure = returns.sd_m < VAGUE_SD_M
    bearing_rad, range_m = scan.bearing_rad[sure], returns.range_m[sure]
    room = fit_room(bearing_rad, range_m)
    if room is None:
        return None
    points_m = np.stack([range_m * np.sin(bearing_rad), range_m * np.cos(bearing_rad)], axis=1)
    if float(np.mean(room.distance_m(points_m) <= NEAR_M)) < LEAST_NEAR:
        return None
    one_m, other_m = room.sides_m
    return max(one_m, other_m), min(one_m, other_m)


def calibrate(sides_m: NDArray[np.float64], room_m: tuple[float, float], sound_speed_m_s: float) -> Calibration:
    """Solve ``scale * side + 2 * offset = truth`` for both sides of the room; ``sides_m`` is ``(circles, 2)``.

    Scale and offset are told apart by rooms that are longer than wide; in a square one only what is known beforehand
    does, and the standard deviations say so.  Raises DataError where the scale is none that water has.
    """
    count = len(sides_m)
    read_m = np.median(sides_m, axis=0)
    scatter_m = np.maximum(1.4826 * np.median(np.abs(sides_m - read_m), axis=0), SCATTER_M)
    sd_m = np.hypot(scatter_m / math.sqrt(count), SHARED_M)
    truth_m = np.array(sorted(room_m, reverse=True))
    design = np.array([[read_m[0] / sd_m[0], 2.0 / sd_m[0]], [read_m[1] / sd_m[1], 2.0 / sd_m[1]]])
    design = np.concatenate([design, np.diag([1.0 / SPEED_SD, 1.0 / OFFSET_SD_M])])
    covariance = np.linalg.inv(design.T @ design)
    scale, offset_m = covariance @ design.T @ np.array([*(truth_m / sd_m), 1.0 / SPEED_SD, 0.0])
    speed_m_s = float(scale) * sound_speed_m_s
    left_m = scale * read_m + 2.0 * offset_m - truth_m
    if not SPEEDS_M_S[0] <= speed_m_s <= SPEEDS_M_S[1] or np.abs(left_m).max() > NEAR_M:
        raise DataError(
            f"the room reads {read_m[0]:.2f} x {read_m[1]:.2f} m, which no water makes of "
            f"{truth_m[0]:g} x {truth_m[1]:g} m; measure it again"
        )
    sd_scale, sd_offset_m = np.sqrt(np.diag(covariance))
    off_m = np.abs(scale * sides_m + 2.0 * offset_m - truth_m).max(axis=0)
    return Calibration(
        count,
        round(speed_m_s, 1),
        round(float(sd_scale) * sound_speed_m_s, 1),
        round(float(offset_m), 4),
        round(float(sd_offset_m), 4),
        (round(float(read_m[0]), 3), round(float(read_m[1]), 3)),
        (round(float(off_m[0]), 3), round(float(off_m[1]), 3)),
    )


def text(found: Calibration, room_m: tuple[float, float]) -> str:
    """Return lines of TOML."""
    truth = f"{max(room_m):g} x {min(room_m):g} m"
    return "\n".join(
        [
            f"# {found.circles} circles: {truth} read {found.read_m[0]:.2f} x {found.read_m[1]:.2f} m",
            f"# then no circle is off by more than {100 * found.off_m[0]:.1f} x {100 * found.off_m[1]:.1f} cm",
            "[sonar]",
            f"sound_speed_m_s = {found.sound_speed_m_s}  # sd {found.sound_speed_sd_m_s}",
            "[map]",
            f"range_offset_m = {found.range_offset_m}  # sd {found.range_offset_sd_m}",
        ]
    )


def _room(words: str) -> tuple[float, float]:
    match = re.fullmatch(r"(\d+\.?\d*)x(\d+\.?\d*)", words)
    sides = (float(match[1]), float(match[2])) if match else (0.0, 0.0)
    if min(sides) < 1.0:
        raise argparse.ArgumentTypeError(f"two sides of 1 m or more as 4.6x4.4, not {words!r}")
    return sides
