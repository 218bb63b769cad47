"""The real tank: circles of a Micron at rest, encoded as a serial capture and sent through the whole program.

Kept recordings of this kind are arrays (``tools.bench.circles``); the capture that is made of them is what the head
had sent, so import, decoding, scan, echoes and grid are all in the measurement.
"""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.errors import DataError
from drivers.tritech.headdata import USUAL_CONTROL, Control, HeadData, encode_head_data
from mapping.values import OCCUPIED, Grid
from tools import import_log, replay
from tools.bench.circles import Circles
from tools.bench.quiet import run_command
from tools.bench.rectangle import NEAR_M, fit_rectangle
from tools.maps import read_map

_USUAL_SPEED_M_S: Final = 1500.0
"""The head counts time in ticks: so many to a bin as make sound about as fast as it is in water."""
_TICK_S: Final = 640e-9
_UNITS: Final = 6400


@dataclass(frozen=True, slots=True)
class TankFigures:
    """How well the map of a rectangular tank is a rectangle."""

    circles: int
    occupied_cells: int
    share_near_walls: float
    share_inside: float
    share_outside: float
    side_a_m: float
    side_b_m: float


def tank_capture(circles: Circles) -> tuple[bytes, float]:
    """Encode beams as the frames that a head sends; return them and the sound speed that fits the bins."""
    interval = round(2.0 * circles.bin_m / (_USUAL_SPEED_M_S * _TICK_S))
    frames = [
        encode_head_data(
            HeadData(
                bearing=round(bearing_rad / math.tau * _UNITS + _UNITS / 2) % _UNITS,
                bins=echoes.tobytes(),
                ad_interval=interval,
                step=round(_UNITS / circles.beams),
                left_limit=0,
                right_limit=0,
                range_scale=round(circles.bin_m * len(echoes) * 10),
                control=USUAL_CONTROL | Control.CONTINUOUS,
            )
        )
        for bearing_rad, echoes in zip(circles.bearing_rad.tolist(), circles.echoes, strict=True)
    ]
    return b"".join(frames), 2.0 * circles.bin_m / (interval * _TICK_S)


def map_tank(circles: Circles, folder: Path) -> Grid:
    """Import and replay circles in ``folder``, heading constant, and return the measured map as it was written."""
    capture, sound_speed_m_s = tank_capture(circles)
    range_m = circles.bin_m * circles.echoes.shape[1]
    folder.mkdir(parents=True, exist_ok=True)
    raw, log, config = folder / "tank.bin", folder / "tank.mcap", folder / "tank.toml"
    raw.write_bytes(capture)
    sonar = f"[sonar]\nrange_m = {range_m:.1f}\nsound_speed_m_s = {sound_speed_m_s:.3f}\n"
    config.write_text(f'[site]\nname = "tank"\n{sonar}')
    run_command(import_log, [str(raw), "-o", str(log), "--config", str(config)])
    run_command(replay, [str(log), "-o", str(folder / "map")])
    return read_map(folder / "map" / "map.yaml").grid


def judge_tank(grid: Grid, circles: int) -> TankFigures:
    """Fit four walls to the occupied cells and tell where the cells lie."""
    rows, cols = np.nonzero(grid.state == OCCUPIED)
    points_m = np.stack([grid.x0_m + (cols + 0.5) * grid.cell_m, grid.y0_m + (rows + 0.5) * grid.cell_m], axis=1)
    room = fit_rectangle(points_m)
    if room is None:
        raise DataError(f"the map has {len(points_m)} occupied cells: too few for four walls")
    near = room.distance_m(points_m) <= NEAR_M
    corners = room.corners_m()
    inside = np.all(
        [_left_of(points_m, corners[i], corners[(i + 1) % 4], corners.mean(axis=0)) for i in range(4)], axis=0
    )
    side_a_m, side_b_m = room.sides_m
    return TankFigures(
        circles=circles,
        occupied_cells=len(points_m),
        share_near_walls=round(float(near.mean()), 4),
        share_inside=round(float((inside & ~near).mean()), 4),
        share_outside=round(float((~inside & ~near).mean()), 4),
        side_a_m=round(side_a_m, 3),
        side_b_m=round(side_b_m, 3),
    )


def measure(circles: Circles) -> TankFigures:
    """Map circles of a recording and judge the map."""
    with tempfile.TemporaryDirectory(prefix="lacuna-tank-") as folder:
        grid = map_tank(circles, Path(folder))
    return judge_tank(grid, circles.count)


def _left_of(
    points_m: NDArray[np.float64],
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    inside: NDArray[np.float64],
) -> NDArray[np.bool_]:
    normal = np.array([start[1] - end[1], end[0] - start[0]])
    side = np.sign((inside - start) @ normal)
    return np.asarray(side * ((points_m - start) @ normal) >= 0)
