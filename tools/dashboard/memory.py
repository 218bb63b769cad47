"""What the dashboard knows: the newest of each topic, so that a page that opens late shows everything at once."""

from __future__ import annotations

from collections import deque
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from daemon.snapshots import Snapshot
from daemon.wire import Message

EVENTS_KEPT: Final = 200
BEARING_SLOT_DEG: Final = 0.225
"""The finest step of a head: beams closer than this replace each other."""
_NEWEST_ONLY: Final = ("station", "fill", "mesh", "guide", "health")


class Memory:
    """The newest message of each topic, the newest circle of pings, the last events and the grid put together.

    ``waiting_for_grid`` is true while a piece of the grid was missed and no whole grid has come since.
    """

    def __init__(self) -> None:
        self.session: str | None = None
        self.clear()

    def clear(self) -> None:
        """Forget everything, as at a new session."""
        self._newest: dict[str, Message] = {}
        self._pings: dict[int, Message] = {}
        self._events: deque[Message] = deque(maxlen=EVENTS_KEPT)
        self._grid: Message | None = None
        self._cells: NDArray[np.uint8] | None = None
        self.waiting_for_grid = False

    def push(self, message: Message) -> bool:
        """Take in ``message``; return False where it must not be shown (a piece of a grid that is not here)."""
        if message.session != self.session:
            self.clear()
            self.session = message.session
        topic = message.snapshot.topic
        if topic == "ping":
            # Taken out and put in again, so that the order stays the order of arrival.
            self._pings.pop(bearing_slot(message), None)
            self._pings[bearing_slot(message)] = message
        elif topic == "event":
            self._events.append(message)
        elif topic == "grid/key":
            return self._take_key(message)
        elif topic == "grid/delta":
            return self._apply(message)
        elif topic in _NEWEST_ONLY:
            self._newest[topic] = message
        return True

    def everything(self) -> list[Message]:
        """Every message a new page needs, oldest pings and events first."""
        grid = [self.grid] if self.grid is not None else []
        return [*self._newest.values(), *grid, *self._events, *self._pings.values()]

    @property
    def grid(self) -> Message | None:
        """The whole grid as it is now, as one ``grid/key`` message with ``as_of`` naming its last piece."""
        if self._grid is None or self._cells is None:
            return None
        last = self._grid
        fields = {name: value for name, value in last.snapshot.fields.items() if name not in ("base", "row0", "col0")}
        rows, cols = self._cells.shape[1:]
        fields |= {"as_of": {"topic": last.snapshot.topic, "seq": last.seq}, "rows": rows, "cols": cols}
        stamp = (last.snapshot.t_ns, last.snapshot.utc_ns)
        return Message(last.seq, last.session, Snapshot("grid/key", *stamp, fields, {"cells": self._cells.copy()}))

    def _take_key(self, message: Message) -> bool:
        cells = _cells(message)
        if cells is None:
            return False
        self._grid, self._cells, self.waiting_for_grid = message, cells.copy(), False
        return True

    def _apply(self, message: Message) -> bool:
        window = self._window(message)
        if window is None:
            self._grid = self._cells = None
            self.waiting_for_grid = True
            return False
        cells, place = window
        place[:] = cells
        self._grid = message
        return True

    def _window(self, message: Message) -> tuple[NDArray[np.uint8], NDArray[np.uint8]] | None:
        """Return new cells and their place in the grid; None where they do not follow what is here."""
        cells, fields = _cells(message), message.snapshot.fields
        if cells is None or self._grid is None or self._cells is None:
            return None
        if fields.get("base") != {"topic": self._grid.snapshot.topic, "seq": self._grid.seq}:
            return None
        row0, col0 = fields.get("row0"), fields.get("col0")
        if not isinstance(row0, int) or not isinstance(col0, int) or row0 < 0 or col0 < 0:
            return None
        place = self._cells[:, row0 : row0 + cells.shape[1], col0 : col0 + cells.shape[2]]
        return (cells, place) if place.shape == cells.shape else None


def bearing_slot(message: Message) -> int:
    """Return the number of the beam direction of a ping."""
    bearing = message.snapshot.fields.get("bearing_deg")
    return round(float(bearing) / BEARING_SLOT_DEG) if isinstance(bearing, int | float) else -1


def _cells(message: Message) -> NDArray[np.uint8] | None:
    """Layers ``(2, rows, cols)`` of a grid message, None where it holds no such array."""
    array: NDArray[Any] | None = next(iter(message.snapshot.arrays.values()), None)
    if array is None or array.ndim != 3 or array.shape[0] != 2 or array.dtype != np.uint8:
        return None
    return array
