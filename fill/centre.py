"""Centre lines of walls: their tips, the spurs that are no part of them, and the way along them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

STEPS: Final = ((-1, 0), (0, -1), (0, 1), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1))
_SPUR_ROUNDS: Final = 2


class CentreLines:
    """Centre lines one cell wide, as a set of cells numbered row by row, in a grid whose border is empty."""

    def __init__(self, centre: NDArray[np.bool_]) -> None:
        self._mask = centre.copy()
        self._width = centre.shape[1]
        self._steps = tuple(dr * self._width + dc for dr, dc in STEPS)
        self._cells = set(np.flatnonzero(centre).tolist())

    def mask(self) -> NDArray[np.bool_]:
        """Return the lines as a layer."""
        return self._mask

    def tips(self, of: NDArray[np.bool_]) -> list[int]:
        """Cells of a layer with one neighbour or none, in order."""
        cells = np.flatnonzero(self._mask & of)
        around = np.sum([self._mask.ravel()[cells + step] for step in self._steps], axis=0)
        tips: list[int] = cells[around <= 1].tolist()
        return tips

    def prune(self, half: NDArray[np.float32], of: NDArray[np.bool_]) -> None:
        """Remove spurs of a layer: branches that do not leave the thickness of the wall they stand on."""
        thick = half.ravel()
        longest = int(half.max(initial=0.0)) + 3
        for _ in range(_SPUR_ROUNDS):
            for at in self.tips(of):
                path, branches = self.follow(at, longest)
                if branches and len(path) <= thick[path[-1]] + 1.0:
                    self._cells.difference_update(path[:-1])
                    self._mask.flat[path[:-1]] = False

    def follow(self, at: int, limit: int) -> tuple[list[int], bool]:
        """Walk along a line from its tip: the cells passed, and whether the walk stopped at a branching."""
        path, seen = [at], {at}
        while len(path) < limit:
            ahead = [cell for cell in self._around(path[-1]) if cell not in seen]
            if not ahead:
                return path, False
            if len(ahead) > 1 and not self._touch(ahead):
                return path, True
            seen.update(ahead)
            path.append(ahead[0])
        return path, False

    def places(self, path: Sequence[int] | NDArray[np.int64]) -> NDArray[np.int64]:
        """Return x and y ``(n, 2)`` of cells, without the border."""
        rows, cols = np.divmod(np.asarray(path, np.int64), self._width)
        return np.stack([cols, rows], axis=1) - 1

    def _around(self, at: int) -> list[int]:
        """Neighbours, straight ones first: of two side by side the diagonal one is not a branch."""
        cells = self._cells
        return [at + step for step in self._steps if at + step in cells]

    def _touch(self, cells: list[int]) -> bool:
        """Whether all of these neighbours touch the first: a bend of the line, not a branching."""
        row, col = divmod(cells[0], self._width)
        places = (divmod(cell, self._width) for cell in cells[1:])
        return all(abs(other - row) <= 1 and abs(across - col) <= 1 for other, across in places)
