"""Beams held against a rectangular room: how many find its walls, when all must answer and when they may abstain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.errors import DataError
from config.schema import Map
from mapping.echoes import VAGUE_SD_M, answers_m, beams_of, in_order, peaks_along, pick
from mapping.values import Scan
from tools.bench.rectangle import NEAR_M, Rectangle, fit_rectangle

THIN_M: Final = 0.05


@dataclass(frozen=True, slots=True)
class BeamFigures:
    """Shares of the beams: near the walls where all answer; that are sure, and how many of those are near the walls."""

    circles: int
    all_near_walls: float
    sure: float
    sure_near_walls: float


def judge_beams(scans: list[Scan], config: Map) -> BeamFigures:
    """Fit four walls to the sure beams of each circle and tell how many beams are near them."""
    answers, sure, near = [], [], []
    for scan in scans:
        returns = pick(scan, config)
        clear = returns.sd_m < VAGUE_SD_M
        room = fit_room(scan.bearing_rad[clear], returns.range_m[clear])
        if room is None:
            raise DataError(f"circle {scan.index} has {int(clear.sum())} sure beams: too few for four walls")
        answers.append(_is_near(room, scan.bearing_rad, answer_all(scan, config)))
        sure.append(clear)
        near.append(_is_near(room, scan.bearing_rad[clear], returns.range_m[clear]))
    shares = (float(np.concatenate(each).mean()) for each in (answers, sure, near))
    return BeamFigures(len(scans), *(round(share, 4) for share in shares))


def answer_all(scan: Scan, config: Map) -> NDArray[np.float64]:
    """Range ``(n,)`` of every beam, also of those that would abstain."""
    order, closed = in_order(scan)
    beams = beams_of(scan, order, config, closed=closed)
    range_m = np.empty(len(order))
    range_m[order] = answers_m(beams, peaks_along(beams))
    return range_m


def fit_room(bearing_rad: NDArray[np.float64], range_m: NDArray[np.float64]) -> Rectangle | None:
    """Fit four walls to returns, one a square of ``THIN_M``: a wall close by is seen by half of the beams."""
    points_m = _points(bearing_rad, range_m)
    squares = np.unique(np.floor(points_m / THIN_M), axis=0, return_index=True)[1]
    return fit_rectangle(points_m[np.sort(squares)])


def _points(bearing_rad: NDArray[np.float64], range_m: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack([range_m * np.sin(bearing_rad), range_m * np.cos(bearing_rad)], axis=1)


def _is_near(room: Rectangle, bearing_rad: NDArray[np.float64], range_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    return room.distance_m(_points(bearing_rad, range_m)) <= NEAR_M
