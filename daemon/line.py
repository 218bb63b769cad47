"""A port that comes back by itself after it was lost."""

from __future__ import annotations

import contextlib
from typing import Final

from config.errors import PortError
from drivers.counters import Counters
from drivers.port import Port
from drivers.records import Json

_FIRST_WAIT_NS: Final = 200_000_000
_LONGEST_WAIT_NS: Final = 1_600_000_000


class Line:
    """The port ``name`` at ``url``; times are given, so that waiting costs nobody anything."""

    def __init__(self, name: str, url: str, baud: int) -> None:
        self.name = name
        self.url = url
        self._baud = baud
        self._port: Port | None = None
        self._wait_ns = _FIRST_WAIT_NS
        self._retry_ns = 0
        self._rx_bytes = self._tx_bytes = self._losses = 0
        self._told = (0, 0, 0)
        self._newest_ns: int | None = None

    @property
    def is_open(self) -> bool:
        """Whether the port can be read and written."""
        return self._port is not None

    @property
    def descriptor(self) -> int | None:
        """What to wait on; None where the port is lost or has no such thing."""
        return None if self._port is None else self._port.fileno()

    def open(self) -> None:
        """Open the port; raise PortError where it is absent or busy."""
        self._port = Port(self.url, self._baud)
        self._wait_ns = _FIRST_WAIT_NS

    def is_due(self, t_ns: int) -> bool:
        """Whether a lost port is to be tried again now."""
        return self._port is None and t_ns >= self._retry_ns

    def try_again(self, t_ns: int) -> bool:
        """Try to open a lost port; say whether it worked.

        Each failure doubles the wait, up to 1.6 s: a port is back within 2 s of its return.
        """
        try:
            self.open()
        except PortError:
            self._retry_ns = t_ns + self._wait_ns
            self._wait_ns = min(2 * self._wait_ns, _LONGEST_WAIT_NS)
            return False
        return True

    def read(self, t_ns: int) -> bytes:
        """Return what has come, perhaps nothing; raise PortError where the port is lost."""
        data = b"" if self._port is None else self._port.read()
        if data:
            self._rx_bytes += len(data)
            self._newest_ns = t_ns
        return data

    def write(self, data: bytes) -> None:
        """Send ``data``; raise PortError where the port is lost."""
        if self._port is not None:
            self._port.write(data)
            self._tx_bytes += len(data)

    def drop(self, t_ns: int) -> None:
        """Close the port as lost; it is tried again after a while."""
        self.close()
        self._losses += 1
        self._retry_ns = t_ns + self._wait_ns

    def close(self) -> None:
        """Close the port."""
        port, self._port = self._port, None
        if port is not None:
            with contextlib.suppress(PortError):
                port.close()

    def health(self, t_ns: int, counters: Counters) -> dict[str, Json]:
        """Return the port's line in health; rates are since the call before."""
        before_ns, rx_bytes, tx_bytes = self._told
        self._told = (t_ns, self._rx_bytes, self._tx_bytes)
        passed_s = max((t_ns - before_ns) / 1e9, 1e-3)
        return {
            "state": "open" if self.is_open else "lost",
            "rx_bytes_s": round((self._rx_bytes - rx_bytes) / passed_s, 1),
            "tx_bytes_s": round((self._tx_bytes - tx_bytes) / passed_s, 1),
            "last_s": None if self._newest_ns is None else round((t_ns - self._newest_ns) / 1e9, 2),
            "lost": self._losses,
            "skipped": counters.skipped_bytes,
            "url": self.url,
            "rx_bytes": self._rx_bytes,
            "tx_bytes": self._tx_bytes,
            "frames": dict(counters.frames),
            "bad": dict(counters.bad),
        }
