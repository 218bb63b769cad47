"""What was heard of walls from one rest, as a picture: how loud a wall is at a place, and how well known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter

from mapping.grain import ALIKE, MOST, Grain
from mapping.path import Floats

CELL_M = 0.05
REACH_M = 3.5
BESIDE_M = 0.25
"""A level holds so far before and behind its wall: where along it a place lies is what counts."""
SMOOTH_CELLS = 0.8
ALONG_M = 0.11
"""Levels are alike over so much wall."""
LEAST_LIKE = 0.1

Images = NDArray[np.float32]


class Pattern:
    """Levels of walls about a rest, and the correlation of what is heard at a place later."""

    def __init__(self, grain: Grain, group: int) -> None:
        of = grain.marks.group == group
        normal = grain.marks.normal_rad[of]
        across = np.stack([np.cos(normal), np.sin(normal)], axis=1)
        off_m = np.arange(-BESIDE_M, BESIDE_M + 1e-9, CELL_M)
        spread = grain.marks.arm_m[of][:, None, :] + off_m[:, None] * across[:, None, :]
        self._side = round(REACH_M / CELL_M)
        inside = np.abs(spread).max(axis=2) < REACH_M - CELL_M
        column, row = (np.floor(spread[..., k][inside] / CELL_M).astype(np.intp) + self._side for k in (0, 1))
        level = np.broadcast_to(grain.level[of][:, None], inside.shape)[inside]
        self._level, self._like = self._drawn(row, column, level)

    def _drawn(self, row: NDArray[np.intp], column: NDArray[np.intp], level: Floats) -> tuple[Images, Images]:
        shape = (2 * self._side, 2 * self._side)
        if not len(level):
            return np.zeros(shape, np.float32).ravel(), np.zeros(shape, np.float32).ravel()
        heard, total = np.zeros(shape), np.zeros(shape)
        np.add.at(heard, (row, column), 1.0)
        np.add.at(total, (row, column), level)
        mean = gaussian_filter(total, SMOOTH_CELLS) / np.maximum(gaussian_filter(heard, SMOOTH_CELLS), 1e-6)
        mean /= max(float(mean[heard > 0.0].std()), 1e-6)
        apart, (rows, columns) = distance_transform_edt(heard == 0.0, return_indices=True)
        like = ALIKE * np.exp(-0.5 * (apart * CELL_M / ALONG_M) ** 2)
        like[like < LEAST_LIKE] = 0.0
        return np.clip(mean[rows, columns], -MOST, MOST).astype(np.float32).ravel(), like.astype(np.float32).ravel()

    def odds(self, level: NDArray[np.float32], x_m: Images, y_m: Images) -> Images:
        """Log-likelihood ratio of levels being of the walls at places from the rest, against being of any others."""
        most = 2 * self._side - 1
        column, row = (np.clip(each / CELL_M + self._side, 0, most).astype(np.int32) for each in (x_m, y_m))
        at = row * np.int32(2 * self._side) + column
        other, like = self._level.take(at), self._like.take(at)
        left = 1.0 - like * like
        off = like * (level * level + other * other) - 2.0 * level * other
        return np.asarray(-0.5 * np.log(left) - 0.5 * like * off / left, dtype=np.float32)
