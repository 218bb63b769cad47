"""The real tank: circles of a Micron at rest, encoded as a serial capture and sent through the whole program.

Kept recordings of this kind are arrays (``time_s``, ``angle_deg``, ``bin_m``, ``intensity``); the capture that is
made of them is what the head had sent, so import, decoding, scan, echoes and grid are all in the measurement.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.errors import DataError, InputError
from drivers.tritech.headdata import USUAL_CONTROL, Control, HeadData, encode_head_data
from mapping.values import OCCUPIED, Grid
from tools import import_log, replay
from tools.bench.quiet import run_command
from tools.bench.rectangle import NEAR_M, fit_rectangle
from tools.maps import read_map

AD_INTERVAL: Final = 26
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


def tank_capture(recording: Path, circles: int) -> tuple[bytes, float]:
    """Encode a recording's beams as the frames that a head sends; return them and the sound speed that fits the bins.

    Raises InputError or DataError where the recording is not there or is something else.
    """
    try:
        with np.load(recording, allow_pickle=False) as arrays:
            angle_deg, bin_m, echoes = arrays["angle_deg"], arrays["bin_m"], arrays["intensity"]
    except OSError as error:
        raise InputError(f"cannot read {recording}: {error.strerror}; give the folder of recordings") from error
    except (KeyError, ValueError) as error:
        raise DataError(f"{recording} is not a recording of circles: {error}") from error
    count = min(len(angle_deg), circles * 200)
    spacing_m = float(np.median(bin_m))
    frames = [
        encode_head_data(
            HeadData(
                bearing=round(float(angle_deg[index]) / 360 * _UNITS + _UNITS / 2) % _UNITS,
                bins=echoes[index].astype(np.uint8).tobytes(),
                ad_interval=AD_INTERVAL,
                step=32,
                left_limit=0,
                right_limit=0,
                range_scale=round(spacing_m * echoes.shape[1] * 10),
                control=USUAL_CONTROL | Control.CONTINUOUS,
            )
        )
        for index in range(count)
    ]
    return b"".join(frames), 2 * spacing_m / (AD_INTERVAL * _TICK_S)


def map_tank(recording: Path, folder: Path, circles: int) -> Grid:
    """Import and replay a recording in ``folder``, heading constant, and return the measured map as it was written."""
    capture, sound_speed_m_s = tank_capture(recording, circles)
    folder.mkdir(parents=True, exist_ok=True)
    raw, log, config = folder / "tank.bin", folder / "tank.mcap", folder / "tank.toml"
    raw.write_bytes(capture)
    config.write_text(f'[site]\nname = "tank"\n[sonar]\nrange_m = 5.0\nsound_speed_m_s = {sound_speed_m_s:.3f}\n')
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


def measure(data: Path, circles: int) -> TankFigures:
    """Figures of the first circles of the recording (14 in all) in the folder of recordings ``data``."""
    with tempfile.TemporaryDirectory(prefix="lacuna-tank-") as folder:
        grid = map_tank(data / "sonar" / "micron-tank-14scans.npz", Path(folder), circles)
    return judge_tank(grid, circles)


def _left_of(
    points_m: NDArray[np.float64],
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    inside: NDArray[np.float64],
) -> NDArray[np.bool_]:
    normal = np.array([start[1] - end[1], end[0] - start[0]])
    side = np.sign((inside - start) @ normal)
    return np.asarray(side * ((points_m - start) @ normal) >= 0)
