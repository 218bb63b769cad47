"""A serial line that carries bytes at its own pace, ten bits to the byte."""

from __future__ import annotations

from collections import deque


class Line:
    """Bytes go in whole and come out one after another, as time passes."""

    def __init__(self, baud: int) -> None:
        self._byte_ns = 10_000_000_000 // baud
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._free_ns = 0

    def send(self, t_ns: int, data: bytes) -> None:
        """Put bytes on the line at ``t_ns``, behind those still on it."""
        if data:
            start = max(t_ns, self._free_ns)
            self._waiting.append((start, data))
            self._free_ns = start + len(data) * self._byte_ns

    def take(self, t_ns: int) -> bytes:
        """Return the bytes that have left the line by ``t_ns`` and were not taken before."""
        out = bytearray()
        while self._waiting:
            start, data = self._waiting.popleft()
            count = max(0, (t_ns - start) // self._byte_ns)
            out += data[:count]
            if count < len(data):
                self._waiting.appendleft((start + count * self._byte_ns, data[count:]))
                break
        return bytes(out)

    def clear(self) -> None:
        """Forget what has not left yet."""
        self._waiting.clear()
        self._free_ns = 0
