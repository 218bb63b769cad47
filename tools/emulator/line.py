"""A serial line that carries bytes at its own pace, ten bits to the byte."""

from __future__ import annotations

from collections import deque
from typing import Protocol


class Wire(Protocol):
    """What a device needs of its line, sound or faulty."""

    def send(self, t_ns: int, data: bytes) -> None:
        """Put a message on the line at ``t_ns``, behind those still on it."""

    def take(self, t_ns: int) -> bytes:
        """Return the bytes that have left the line by ``t_ns`` and were not taken before."""

    def collide(self, t_ns: int, data: bytes) -> bytes:
        """Let the host speak on the same wire; return what reaches the device."""

    def clear(self) -> None:
        """Forget what has not left yet."""


class Line:
    """Bytes go in whole and come out one after another, as time passes."""

    def __init__(self, baud: int) -> None:
        self.baud = baud
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

    def collide(self, t_ns: int, data: bytes) -> bytes:
        """Let the host speak from ``t_ns`` on while the device may be speaking on the same wire.

        Whichever pulls the wire down wins, so that both hear the conjunction; bytes that meet none pass.
        """
        heard = bytearray(data)
        for place, (start, sent) in enumerate(self._waiting):
            both = bytearray(sent)
            first = (start - t_ns + self._byte_ns // 2) // self._byte_ns
            for index in range(max(0, -first), min(len(sent), len(data) - first)):
                both[index] &= data[first + index]
                heard[first + index] = both[index]
            self._waiting[place] = (start, bytes(both))
        return bytes(heard)

    def clear(self) -> None:
        """Forget what has not left yet."""
        self._waiting.clear()
        self._free_ns = 0
