"""Serial ports: devices, pseudo-terminals and serial servers behind one face.

One of the two places below the daemon that may open things; it neither threads nor waits, but for at most
`_WRITE_S` when a line takes no bytes.
"""

from __future__ import annotations

import contextlib
import errno
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import serial
from serial.tools.list_ports import comports

from config.errors import PortError

_BLOCK: Final = 65536
_WRITE_S: Final = 0.2
_BY_ID: Final = Path("/dev/serial/by-id")


class Port:
    """An open port, for one program alone where the system can say so.

    ``url`` is anything that pyserial opens: a device, ``socket://host:port``, ``rfc2217://host:port``, ``loop://``.
    Every method raises PortError when the port is lost; open it again then.
    """

    def __init__(self, url: str, baud: int) -> None:
        """Open the port; raise PortError with what to do where it is absent, busy, forbidden or no port."""
        self.url = url
        try:
            self._serial = serial.serial_for_url(url, do_not_open=True, timeout=0, write_timeout=_WRITE_S)
            self._serial.baudrate = baud
            if _is_device(url):
                self._serial.exclusive = True
            self._serial.open()
        except (OSError, ValueError, OverflowError) as error:
            raise PortError(_why_not_open(url, baud, error)) from None

    def read(self) -> bytes:
        """Return what has come, perhaps nothing, without waiting."""
        try:
            return bytes(self._serial.read(_BLOCK))
        except (OSError, TypeError) as error:
            raise PortError(f"{self.url} was lost: {_line(error)}; check plug and cable") from None

    def write(self, data: bytes) -> None:
        """Send ``data`` whole."""
        try:
            self._serial.write(data)
        except serial.SerialTimeoutException:
            raise PortError(f"{self.url} takes no bytes; check the cable and the device's handshake") from None
        except (OSError, TypeError) as error:
            raise PortError(f"{self.url} was lost: {_line(error)}; check plug and cable") from None

    def fileno(self) -> int | None:
        """Return what to wait on, or None for a port that has no such thing (``loop://``)."""
        try:
            return int(self._serial.fileno())
        except (io.UnsupportedOperation, AttributeError):
            return None

    def close(self) -> None:
        """Close the port; closing it again does nothing."""
        with contextlib.suppress(OSError):
            self._serial.close()


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


def _group(url: str) -> str:
    try:
        return Path(url).group()
    except (OSError, KeyError):
        return "dialout"


def _line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
