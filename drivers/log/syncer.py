"""Waiting for the disk in a thread of its own.

A card that tidies itself up may hold a sync for seconds, while the kernel keeps a third of a second of a line: whoever
reads ports must not wait for it.
"""

from __future__ import annotations

import os
from concurrent.futures import Future, ThreadPoolExecutor


class Syncer:
    """Brings a file's data to the disk, one call at a time."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix="sync")
        self._pending: Future[None] | None = None

    @property
    def is_busy(self) -> bool:
        """Whether a call is under way."""
        return self._pending is not None and not self._pending.done()

    def start(self, descriptor: int) -> None:
        """Begin to sync; the caller may close ``descriptor`` meanwhile."""
        own = os.dup(descriptor)
        try:
            self._pending = self._pool.submit(_sync, own)
        except RuntimeError:
            os.close(own)
            raise

    def check(self) -> None:
        """Raise the OSError of the last call if that has failed; say nothing while it is under way."""
        if self._pending is None or self.is_busy:
            return
        pending, self._pending = self._pending, None
        pending.result()

    def close(self) -> None:
        """Wait for the end; an error is of no interest any more."""
        self._pending = None
        self._pool.shutdown()


def _sync(descriptor: int) -> None:
    try:
        os.fdatasync(descriptor)
    finally:
        os.close(descriptor)
