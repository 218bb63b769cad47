"""Recorded dives of another emulator, with truth beside them: judged as this one's own dives are.

``NAME.jsonl.gz`` holds what both serial ports brought, ``NAME.truth.json`` where the vehicle rested and the walls.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from config.errors import DataError, InputError
from config.schema import Config, Feed
from config.schema import Site as SiteConfig
from daemon.pipeline import Pipeline
from drivers.records import Chunk
from tools.bench.truth import TruthFigures, judge
from tools.emulator.echoes import Place
from tools.emulator.site import Stop, Wall
from tools.emulator.vehicle import Rest
from tools.importers import json_lines
from tools.importers.capture import Losses

_CAPTURE: Final = ".jsonl.gz"
_TRUTH: Final = ".truth.json"


@dataclass(frozen=True, slots=True)
class Dome:
    """Walls that stand at their widest on the floor: the ``top`` of their width is left at the surface.

    ``walls`` are those at ``floor_m``; in between their width grows with the depth to the ``power``.
    """

    name: str
    walls: tuple[Wall, ...]
    stops: tuple[Stop, ...]
    floor_m: float
    centre_m: tuple[float, float] = (0.0, 0.0)
    top: float = 1.0
    power: float = 1.0

    def stand(self, walls: tuple[Wall, ...], depth_m: float) -> tuple[Wall, ...]:
        """Return walls of the floor as they stand at a depth."""
        scale = self.top + (1.0 - self.top) * min(max(depth_m / self.floor_m, 0.0), 1.0) ** self.power
        centre = np.array(self.centre_m)
        return tuple(Wall(centre + scale * (wall.points_m - centre), wall.closed) for wall in walls)

    def plan_at(self, depth_m: float) -> tuple[Wall, ...]:
        """Return the walls as they stand at a depth."""
        return self.stand(self.walls, depth_m)


@dataclass(frozen=True, slots=True)
class Recorded:
    """A recorded dive as its truth tells it; the rests are numbered as they came."""

    site: Dome
    seed: int
    rests: list[Rest]

    def place_during(self, rest: Rest) -> Place:
        """Return where the vehicle was at a rest, on average."""
        stop = rest.stop
        return Place(stop.x_m, stop.y_m, stop.depth_m, stop.heading_rad)


def measure(folder: Path) -> Iterator[TruthFigures]:
    """Map and judge each recorded dive of a folder; InputError where there is none."""
    captures = sorted(folder.glob(f"*{_CAPTURE}"))
    if not captures:
        raise InputError(f"no dive in {folder}: name a folder of NAME{_CAPTURE} with NAME{_TRUTH} beside it")
    for capture in captures:
        yield _measure(capture, read_truth(capture.with_name(capture.name.removesuffix(_CAPTURE) + _TRUTH)))


def read_truth(path: Path) -> Recorded:
    """Read where a recorded dive truly was; DataError where the file tells nothing of the kind."""
    try:
        body: dict[str, Any] = json.loads(path.read_text())
        stops = tuple(
            Stop(s["x"], s["y"], s["z"], math.radians(s["heading"]) % (2.0 * math.pi)) for s in body["stations"]
        )
        times = [(s["t_arrive_ns"], s["t_leave_ns"]) for s in body["stations"]]
        return Recorded(
            _site(path.name.removesuffix(_TRUTH), body["world"], stops),
            int(body["world"]["seed"]),
            [Rest(k, stop, *at_ns) for k, (stop, at_ns) in enumerate(zip(stops, times, strict=True))],
        )
    except OSError as error:
        raise InputError(f"no truth beside the dive: {path} cannot be read ({error.strerror})") from error
    except (ValueError, KeyError, TypeError) as error:
        raise DataError(
            f"{path} is no truth of a dive ({error}): leave the dive out, or make both files anew"
        ) from error


def _site(name: str, world: dict[str, Any], stops: tuple[Stop, ...]) -> Dome:
    walls = tuple(Wall(np.array(ring["pts"], dtype=np.float64)) for ring in world["rings"])
    tapers = [ring["taper"] for ring in world["rings"] if ring["taper"] is not None]
    if not tapers:
        return Dome(name, walls, stops, world["water_height"])
    one = tapers[0]
    return Dome(name, walls, stops, world["water_height"], (one["cx"], one["cy"]), one["top"], one["power"])


def _measure(capture: Path, dive: Recorded) -> TruthFigures:
    config = Config(site=SiteConfig(name=dive.site.name), feed=(Feed(name="feed"),))
    pipeline = Pipeline(config)
    for piece in json_lines.read(capture, config.sonar.baud, Losses()):
        pipeline.push(Chunk(piece.t_ns, piece.t_ns, piece.line, piece.direction, piece.data))
    pipeline.finish()
    return judge(dive, pipeline.whole, config, "recorded")
