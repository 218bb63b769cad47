"""Which message tells the grid: the whole of it, or the window that changed since the last one."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from daemon import mapshots
from daemon.mapshots import Stamp
from daemon.snapshots import Snapshot
from mapping.values import Grid

_KEY_NS: Final = 30_000_000_000
_MOST_DELTAS: Final = 8
"""A late joiner is sent the key and all deltas since: these must fit into its queue."""


class GridStream:
    """Remembers what was told last.

    A key goes out first, every 30 s of log time, and where the grid's extent changed; a delta where cells changed.
    """

    def __init__(self) -> None:
        self._layers: NDArray[np.uint8] | None = None
        self._place: tuple[float, float, float] = (0.0, 0.0, 0.0)
        self._key_ns = 0
        self._deltas = 0

    def tell(self, stamp: Stamp, grid: Grid, whole: bool = False) -> list[Snapshot]:
        """Return the message that brings a listener's grid to ``grid``; none where it is there already."""
        before, place = self._layers, (grid.cell_m, grid.x0_m, grid.y0_m)
        is_same_extent = before is not None and place == self._place and before.shape[1:] == grid.state.shape
        is_due = stamp[0] - self._key_ns >= _KEY_NS or self._deltas >= _MOST_DELTAS
        self._layers, self._place = mapshots.layers(grid), place
        if whole or before is None or not is_same_extent or is_due:
            self._key_ns, self._deltas = stamp[0], 0
            return [mapshots.grid_key(stamp, grid)]
        delta = mapshots.grid_delta(stamp, grid, before)
        self._deltas += delta is not None
        return [] if delta is None else [delta]
