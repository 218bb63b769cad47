"""Waiting for the disk in a thread of its own.

A card that tidies itself up may hold a sync for seconds, while the kernel keeps a third of a second of a line: whoever
reads ports must not wait for it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor


class Syncer:
    """Does what waits for the disk, in the order in which it was asked for."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix="sync")
        self._pending: deque[Future[None]] = deque()

    @property
    def is_busy(self) -> bool:
        """Whether something is under way or waits."""
        return any(not each.done() for each in self._pending)

    def start(self, work: Callable[[], None]) -> None:
        """Have ``work`` done; the OSError that it may raise comes out of ``check``."""
        self._pending.append(self._pool.submit(work))

    def check(self) -> None:
        """Raise the OSError of the first work that has failed; say nothing of what is under way."""
        while self._pending and self._pending[0].done():
            self._pending.popleft().result()

    def wait(self) -> None:
        """Wait until nothing is under way; raise as ``check`` does."""
        while self._pending:
            self._pending.popleft().result()

    def close(self) -> None:
        """Wait for the end of everything, then do as ``check`` does."""
        self._pool.shutdown()
        self.check()
