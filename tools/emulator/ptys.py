"""Pseudo-terminals that stand for serial ports: raw, non-blocking, with a stable name in a folder."""

from __future__ import annotations

import fcntl
import os
import pty
import sys
import termios
import tty
from pathlib import Path
from typing import Final

from config.errors import InputError, PortError

_DEAF_NS: Final = 2_000_000_000
_MOST_WAITING: Final = 1 << 20
_HELD: Final = 2048
_SPEEDS: Final = {
    getattr(termios, f"B{baud}"): baud for baud in (4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600)
}


class PtyPort:
    """One serial port: `write` what the device says, `read` what the host sent.

    It outlives hosts that open and close it.  While nobody reads, bytes are lost, as on a wire: what could not be
    handed over for two seconds is dropped, so that the next host hears the present.
    """

    def __init__(self, link: Path, baud: int = 115200) -> None:
        """Open the pair and name the host's side ``link``; raises InputError where the link cannot be made.

        ``baud`` is the device's rate, and the line's until a host sets another.
        """
        self.link = link
        self._baud = baud
        self._device = self._host = -1
        self._waiting = bytearray()
        self._handed_ns = 0
        self.plug_in()

    @property
    def is_there(self) -> bool:
        """Whether the port can be opened, read and written."""
        return self._device >= 0

    def plug_in(self) -> None:
        """Open a new pair under the old name; raises InputError where the link cannot be made."""
        if self.is_there:
            return
        self._device, self._host = pty.openpty()
        # The host's side stays open here as well: its raw mode would be reset at the last close.
        tty.setraw(self._host, termios.TCSANOW)
        self._set_speed()
        os.set_blocking(self._device, False)
        try:
            _link(self.link, os.ttyname(self._host))
        except OSError as error:
            self._close_pair()
            raise InputError(f"cannot make {self.link}: {error.strerror}; choose another folder") from None

    @property
    def host_baud(self) -> int:
        """Rate at which the host listens and speaks; the device's own where it cannot be told."""
        return _SPEEDS.get(termios.tcgetattr(self._host)[5], self._baud) if self.is_there else self._baud

    def unplug(self) -> None:
        """Hang up on the host and take the name away; harmless when repeated."""
        if self.is_there:
            if self.link.is_symlink() and self.link.readlink() == Path(os.ttyname(self._host)):
                self.link.unlink()
            self._close_pair()
            self._waiting.clear()

    def fileno(self) -> int:
        """File descriptor to wait on."""
        return self._device

    def read(self) -> bytes:
        """Return what the host has sent, possibly nothing."""
        if not self.is_there:
            return b""
        try:
            return os.read(self._device, 65536)
        except BlockingIOError:
            return b""

    def write(self, now_ns: int, data: bytes) -> None:
        """Hand bytes to the host; ``now_ns`` is real time, to tell a slow host from none."""
        if not self.is_there:
            return
        if not self._waiting:
            self._handed_ns = now_ns
        self._waiting += data
        if self._waiting and self._hand_over() > 0:
            self._handed_ns = now_ns
        if self._waiting and (now_ns - self._handed_ns > _DEAF_NS or len(self._waiting) > _MOST_WAITING):
            self._waiting.clear()
            termios.tcflush(self._host, termios.TCIFLUSH)

    def _set_speed(self) -> None:
        code = next((code for code, baud in _SPEEDS.items() if baud == self._baud), None)
        if code is not None:
            attributes = termios.tcgetattr(self._host)
            attributes[4] = attributes[5] = code
            termios.tcsetattr(self._host, termios.TCSANOW, attributes)

    def _hand_over(self) -> int:
        # Beyond what the terminal itself holds, the kernel keeps bytes where a flush does not find them.
        room = _HELD - self._unread()
        if room <= 0:
            return 0
        try:
            count = os.write(self._device, self._waiting[:room])
        except BlockingIOError:
            return 0
        del self._waiting[:count]
        return count

    def _unread(self) -> int:
        """Bytes that wait at the host's side for somebody to read them."""
        answer = fcntl.ioctl(self._host, termios.FIONREAD, b"\0\0\0\0")
        return int.from_bytes(answer, sys.byteorder)

    def _close_pair(self) -> None:
        os.close(self._device)
        os.close(self._host)
        self._device = self._host = -1


class FolderLock:
    """Holds a folder for one emulation; a second one in the same folder is refused."""

    def __init__(self, folder: Path) -> None:
        """Make the folder if need be; raises InputError where that fails, PortError where it is taken."""
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        except OSError as error:
            raise InputError(f"cannot use folder {folder}: {error.strerror}; choose another with --folder") from None
        try:
            fcntl.flock(self._handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(self._handle)
            raise PortError(f"{folder} is in use by another emulation; stop that or choose another folder") from None

    def release(self) -> None:
        """Let the folder go."""
        os.close(self._handle)


def _link(link: Path, target: str) -> None:
    """Point a link at a terminal; a stale link of a killed emulation is replaced, any other file is not."""
    if link.is_symlink():
        link.unlink()
    link.symlink_to(target)
