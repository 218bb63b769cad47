"""Results by all that they were made from."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import TypeVar

T = TypeVar("T")


class Recent:
    """Results by all that they were made from; those that two passes running did not ask for are forgotten."""

    def __init__(self) -> None:
        self._old: dict[Hashable, object] = {}
        self._new: dict[Hashable, object] = {}

    def begin(self) -> None:
        """Begin a pass."""
        self._old, self._new = self._new, {}

    def recall(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what ``make`` would, which needs nothing but ``key``."""
        if key not in self._new:
            self._new[key] = self._old[key] if key in self._old else make()
        return self._new[key]  # type: ignore[return-value]
