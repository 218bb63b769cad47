"""Serial ports: devices, pseudo-terminals, serial servers and datagrams behind one face.

One of the two places below the daemon that may open things; it neither threads nor waits, but for at most
`_WRITE_S` when a line takes no bytes.
"""

from __future__ import annotations

import contextlib
import errno
import io
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol
from urllib.parse import urlsplit

import serial
from serial.tools.list_ports import comports

from config.errors import PortError

_BLOCK: Final = 65536
_WRITE_S: Final = 0.2
_BY_ID: Final = Path("/dev/serial/by-id")


class _Stream(Protocol):
    """What pyserial and `_Datagrams` have in common."""

    def read(self, size: int, /) -> bytes: ...

    def write(self, data: bytes, /) -> int | None: ...

    def fileno(self) -> int: ...

    def close(self) -> None: ...


class _Datagrams:
    """Datagrams sent to an address of this machine, one after the other as a stream; nothing is ever sent back.

    ``udp://:14550`` hears this machine alone.  ``udp://192.168.2.1:14550`` hears whoever reaches that address, and
    ``udp://0.0.0.0:10110`` broadcasts too: that is for the operator to say.
    """

    def __init__(self, url: str) -> None:
        address = urlsplit(url)
        if address.port is None:
            raise ValueError("no port number, as in udp://:14550")
        family, kind, _, _, place = socket.getaddrinfo(
            address.hostname or "127.0.0.1", address.port, type=socket.SOCK_DGRAM
        )[0]
        self._socket = socket.socket(family, kind)
        self._socket.setblocking(False)
        try:
            self._socket.bind(place)
        except OSError:
            self._socket.close()
            raise

    def read(self, size: int) -> bytes:
        data = bytearray()
        with contextlib.suppress(BlockingIOError):
            while len(data) < size:
                data += self._socket.recv(_BLOCK)
        return bytes(data)

    def write(self, data: bytes) -> int | None:
        raise OSError(errno.EOPNOTSUPP, f"datagrams are only listened to; {len(data)} bytes were not sent")

    def fileno(self) -> int:
        return self._socket.fileno()

    def close(self) -> None:
        self._socket.close()


class Port:
    """An open port, for one program alone where the system can say so.

    ``url`` is anything that pyserial opens: a device, ``socket://host:port``, ``rfc2217://host:port``, ``loop://``;
    or ``udp://address:port`` to listen at (without address: to this machine alone).
    Every method raises PortError when the port is lost; open it again then.
    """

    def __init__(self, url: str, baud: int) -> None:
        """Open the port; raise PortError with what to do where it is absent, busy, forbidden or no port."""
        self.url = url
        try:
            self._stream = _Datagrams(url) if url.startswith("udp://") else _open(url, baud)
        except (OSError, ValueError, OverflowError) as error:
            raise PortError(_why_not_open(url, baud, error)) from None

    def read(self) -> bytes:
        """Return what has come, perhaps nothing, without waiting."""
        try:
            return bytes(self._stream.read(_BLOCK))
        except (OSError, TypeError) as error:
            raise PortError(f"{self.url} was lost: {_line(error)}; check plug and cable") from None

    def write(self, data: bytes) -> None:
        """Send ``data`` whole."""
        try:
            self._stream.write(data)
        except serial.SerialTimeoutException:
            raise PortError(f"{self.url} takes no bytes; check the cable and the device's handshake") from None
        except (OSError, TypeError) as error:
            raise PortError(f"{self.url} was lost: {_line(error)}; check plug and cable") from None

    def fileno(self) -> int | None:
        """Return what to wait on, or None for a port that has no such thing (``loop://``)."""
        try:
            return int(self._stream.fileno())
        except (io.UnsupportedOperation, AttributeError):
            return None

    def close(self) -> None:
        """Close the port; closing it again does nothing."""
        with contextlib.suppress(OSError):
            self._stream.close()


def _open(url: str, baud: int) -> _Stream:
    opened = serial.serial_for_url(url, do_not_open=True, timeout=0, write_timeout=_WRITE_S)
    opened.baudrate = baud
    if _is_device(url):
        opened.exclusive = True
    opened.open()
    stream: _Stream = opened
    return stream


@dataclass(frozen=True, slots=True)
class PortInfo:
    """A port of this machine: ``by_id`` stays the same whatever else is plugged in; ``usb`` is vendor:product."""

    device: str
    by_id: str | None
    usb: str | None
    description: str


def list_ports() -> list[PortInfo]:
    """Return the serial ports of this machine, USB adapters first."""
    names = _names_by_device()
    ports = [
        PortInfo(
            device=each.device,
            by_id=names.get(str(Path(each.device).resolve())),
            usb=None if each.vid is None or each.pid is None else f"{each.vid:04x}:{each.pid:04x}",
            description="" if each.description in (None, "n/a") else str(each.description),
        )
        for each in comports()
    ]
    return sorted(ports, key=lambda port: (port.usb is None, port.device))


def _names_by_device() -> dict[str, str]:
    with contextlib.suppress(OSError):
        return {str(link.resolve()): str(link) for link in sorted(_BY_ID.iterdir())}
    return {}


def _is_device(url: str) -> bool:
    return "://" not in url


def _why_not_open(url: str, baud: int, error: Exception) -> str:
    number = error.errno if isinstance(error, OSError) else None
    if url.startswith("udp://"):
        return _why_not_listen(url, number, error)
    if number in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        return f"{url} is not there; plug it in, or choose one that `lacuna ports` lists"
    if number in (errno.EAGAIN, errno.EBUSY):
        return f"{url} is in use; stop the other program (`fuser -v {url}` names it)"
    if number in (errno.EACCES, errno.EPERM):
        return f"{url} may not be opened; add yourself to the group {_group(url)!r} and log in again"
    if number == errno.EISDIR or "Inappropriate ioctl" in str(error):
        return f"{url} is no serial port; choose one that `lacuna ports` lists"
    if isinstance(error, ValueError) and _is_device(url):
        return f"{url} does not take {baud} baud: {_line(error)}; choose another"
    if _is_device(url):
        return f"{url} cannot be opened: {_line(error)}; see `lacuna ports`"
    return f"{url} cannot be opened: {_line(error)}; check the address and that the other end is on"


def _why_not_listen(url: str, number: int | None, error: Exception) -> str:
    if number == errno.EADDRINUSE:
        return f"{url} is in use; stop the other program, or have a second stream sent to another port"
    if number == errno.EADDRNOTAVAIL:
        return f"{url} is no address of this machine; name one that `ip address` lists, or none for this machine alone"
    return f"{url} cannot be listened at: {_line(error)}; write udp://:PORT or udp://ADDRESS:PORT"


def _group(url: str) -> str:
    try:
        return Path(url).group()
    except (OSError, KeyError):
        return "dialout"


def _line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
