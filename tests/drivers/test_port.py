"""Ports open, carry bytes both ways, and say in one line what is wrong and what to do."""

from __future__ import annotations

import json
import os
import socket
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from config.errors import PortError
from drivers import port as module
from drivers.port import Port, PortInfo, list_ports
from tools.cli import main


@pytest.fixture
def pty() -> Iterator[tuple[int, str]]:
    """Master's descriptor and slave's path of a raw pseudo-terminal."""
    master, slave = os.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    os.close(slave)
    os.close(master)


def read_until(port: Port, count: int) -> bytes:
    data, until = b"", time.monotonic() + 5
    while len(data) < count and time.monotonic() < until:
        data += port.read()
    return data


def test_bytes_go_both_ways_through_a_pseudo_terminal(pty: tuple[int, str]) -> None:
    master, path = pty
    port = Port(path, 115200)
    every = bytes(range(256))
    assert port.read() == b""
    os.write(master, every)
    assert read_until(port, 256) == every
    port.write(every)
    assert os.read(master, 999) == every
    assert os.ttyname(port.fileno() or -1) == path
    port.close()
    port.close()


def test_a_port_is_for_one_program(pty: tuple[int, str]) -> None:
    _, path = pty
    port = Port(path, 4800)
    with pytest.raises(PortError, match=r"is in use; stop the other program"):
        Port(path, 4800)
    port.close()
    Port(path, 4800).close()


def test_a_lost_port_is_told() -> None:
    master, slave = os.openpty()
    port = Port(os.ttyname(slave), 115200)
    os.close(slave)
    os.close(master)
    with pytest.raises(PortError, match=r"was lost: .*; check plug and cable"):
        port.read()
    with pytest.raises(PortError, match=r"was lost"):
        port.write(b"x")
    port.close()
    with pytest.raises(PortError, match=r"was lost"):
        port.read()


def test_a_line_that_takes_no_bytes_is_told(pty: tuple[int, str]) -> None:
    port = Port(pty[1], 115200)
    with pytest.raises(PortError, match=r"takes no bytes"):
        port.write(bytes(1_000_000))
    port.close()


def no_such(_: Path) -> str:
    return "/dev/lacuna-no-such-port"


def plain_file(folder: Path) -> str:
    (folder / "file").write_bytes(b"x")
    return str(folder / "file")


@pytest.mark.parametrize(
    ("url", "message"),
    [
        (no_such, "is not there; plug it in"),
        (plain_file, "is no serial port; choose"),
        (str, "is no serial port; choose"),
        (lambda _: "nonsense://x", "cannot be opened: .*; check the address"),
        (lambda _: "socket://127.0.0.1:1", "cannot be opened: .*; check the address"),
        (lambda _: "socket://", "cannot be opened: .*; check the address"),
        (lambda _: "", "is not there"),
        (lambda _: "udp://192.0.2.1:14550", "is no address of this machine"),
        (lambda _: "udp://:99999", "cannot be listened at: .*; write udp://:PORT"),
        (lambda _: "udp://:", "cannot be listened at: .*; write udp://:PORT"),
    ],
)
def test_what_cannot_be_opened(url: Callable[[Path], str], message: str, tmp_path: Path) -> None:
    with pytest.raises(PortError, match=message) as caught:
        Port(url(tmp_path), 115200)
    assert "\n" not in str(caught.value)


def test_a_forbidden_port_names_the_group(monkeypatch: pytest.MonkeyPatch, pty: tuple[int, str]) -> None:
    def refuse(path: str, flags: int) -> int:
        raise PermissionError(13, "Permission denied")

    group = Path(pty[1]).group()
    monkeypatch.setattr("serial.serialposix.os.open", refuse)
    with pytest.raises(PortError, match=rf"may not be opened; add yourself to the group '{group}'"):
        Port(pty[1], 115200)


def test_serial_server() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = Port(f"socket://127.0.0.1:{server.getsockname()[1]}", 115200)
        peer, _ = server.accept()
        peer.sendall(b"@\n\x00")
        assert read_until(port, 3) == b"@\n\x00"
        port.write(b"abc")
        assert peer.recv(9) == b"abc"
        assert (port.fileno() or -1) > 0
        peer.sendall(b"last")
        peer.close()
        assert read_until(port, 4) == b"last"
        with pytest.raises(PortError, match="was lost"):
            read_until(port, 1)
        port.close()


def test_datagrams_become_one_stream() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", 0))
        free = peer.getsockname()[1]
    port = Port(f"udp://:{free}", 4800)
    assert port.read() == b""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        for piece in (b"$HCHDM,1", b"", b"23.4,M*2D\r\n"):
            peer.sendto(piece, ("127.0.0.1", free))
    assert read_until(port, 19) == b"$HCHDM,123.4,M*2D\r\n"
    assert (port.fileno() or -1) > 0
    with pytest.raises(PortError, match="only listened to"):
        port.write(b"x")
    with pytest.raises(PortError, match="is in use; stop the other program"):
        Port(f"udp://127.0.0.1:{free}", 4800)
    port.close()
    with pytest.raises(PortError, match="was lost"):
        port.read()
    Port(f"udp://localhost:{free}", 4800).close()


def test_loop() -> None:
    port = Port("loop://", 115200)
    assert (port.read(), port.fileno()) == (b"", None)
    port.write(b"round")
    assert port.read() == b"round"
    port.close()


def test_ports_are_listed_by_the_names_that_stay(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "by-id").mkdir()
    for name in ("ttyS0", "ttyUSB0"):
        (tmp_path / name).touch()
    link = tmp_path / "by-id" / "usb-FTDI_1234-if00-port0"
    link.symlink_to(tmp_path / "ttyUSB0")
    found = [
        SimpleNamespace(device=str(tmp_path / "ttyS0"), vid=None, pid=None, description="n/a"),
        SimpleNamespace(device=str(tmp_path / "ttyUSB0"), vid=0x0403, pid=0x6001, description="FT232R USB UART"),
    ]
    monkeypatch.setattr(module, "_BY_ID", tmp_path / "by-id")
    monkeypatch.setattr(module, "comports", lambda: found)
    usb = PortInfo(str(tmp_path / "ttyUSB0"), str(link), "0403:6001", "FT232R USB UART")
    assert list_ports() == [usb, PortInfo(str(tmp_path / "ttyS0"), None, None, "")]
    assert main(["ports", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["ports"][0]["by_id"] == str(link)
    assert main(["ports"]) == 0
    assert capsys.readouterr().out.splitlines()[0].split()[:3] == [str(link), usb.device, "0403:6001"]
    monkeypatch.setattr(module, "comports", list)
    monkeypatch.setattr(module, "_BY_ID", tmp_path / "none")
    assert main(["ports"]) == 0
    assert "no serial ports" in capsys.readouterr().out
