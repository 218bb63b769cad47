"""``lacuna view``: the mesh in an Open3D window, live or from a file."""

from __future__ import annotations

import argparse
import contextlib
import subprocess
import sys
import tempfile
from collections.abc import Generator, Iterable
from pathlib import Path
from typing import IO, Final

import numpy as np
import zmq

from config.errors import ConfigError, FrameError, InputError, UsageError
from daemon import wire
from fill.values import MEASURED, Mesh
from tools.dashboard.peer import Peer, curve_from, prepare
from tools.ply import parse_ply, ply_bytes
from tools.window import MARK

_HERE: Final = "tcp://127.0.0.1:5556"
_LOOK_S: Final = 0.2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("file", nargs="?", metavar="FILE.ply", help="a mesh of lacuna; absent: the daemon's, live")
    parser.add_argument("--connect", metavar="ADDRESS", help=f"the daemon's snapshots ({_HERE})")
    parser.add_argument("--keys", metavar="DIR", help="folder of CURVE keys for a daemon on another machine")
    parser.add_argument("--screenshot", metavar="F.png", help="save a picture of the first mesh and end")
    parser.add_argument("--measured-only", action="store_true", help="leave out what was filled in or assumed")


def run(args: argparse.Namespace) -> int:
    """Show the mesh until the window is closed or Ctrl-C."""
    if args.file is not None and args.connect is not None:
        raise UsageError("give a file or --connect, not both")
    if args.screenshot is not None and not Path(args.screenshot).absolute().parent.is_dir():
        raise InputError(f"there is no folder {Path(args.screenshot).parent} for the picture; make it first")
    if args.file is not None:
        _show([_read(Path(args.file))], args.screenshot, args.measured_only)
    else:
        with contextlib.closing(_listen(args.connect or _HERE, args.keys)) as live:
            _show(live, args.screenshot, args.measured_only)
    if args.screenshot is not None:
        print(args.screenshot)
    return 0


def measured_only(mesh: Mesh) -> Mesh:
    """Return the mesh without the triangles that touch anything but measured wall."""
    kept = mesh.triangles[(mesh.kind[mesh.triangles] == MEASURED).all(axis=1)]
    used, corners = np.unique(kept, return_inverse=True)
    triangles = corners.reshape(-1, 3).astype(np.uint32)
    return Mesh(mesh.vertices[used], triangles, mesh.kind[used], mesh.certainty[used])


def _read(path: Path) -> Mesh:
    try:
        return parse_ply(path.read_bytes())
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}; give the mesh.ply of a result folder") from None


def _listen(address: str, keys: str | None) -> Generator[Mesh | None, None, None]:
    """Yield the newest mesh when there is a new one, None in between so that the window is looked after."""
    peer = Peer(address, address, curve_from(Path(keys).expanduser()) if keys is not None else None)
    peer.check()
    with zmq.Context() as context, context.socket(zmq.SUB) as socket:
        prepare(socket, peer.curve)
        socket.subscribe("mesh")
        socket.connect(address)
        while True:
            newest = None
            while socket.poll(0 if newest else int(_LOOK_S * 1000)):
                newest = socket.recv_multipart()
            yield _decode(newest) if newest else None


def _decode(frames: list[bytes]) -> Mesh | None:
    """Return the mesh of a message, None where it is damaged; raises DataError where a newer program wrote it."""
    try:
        arrays = wire.decode(frames).snapshot.arrays
        certainty = arrays["certainty"].astype(np.float32) / np.float32(255)
        return Mesh(arrays["vertices"], arrays["triangles"], arrays["kind"], certainty)
    except (FrameError, KeyError):
        return None


def _show(meshes: Iterable[Mesh | None], picture: str | None, bare: bool) -> None:
    command = [sys.executable, "-m", "tools.window", *([str(Path(picture).absolute())] if picture else [])]
    with (
        tempfile.TemporaryFile() as said,
        subprocess.Popen(  # noqa: S603 - our own module, in this interpreter
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=said
        ) as window,
    ):
        try:
            for mesh in meshes:
                if mesh is not None:
                    _send(window, measured_only(mesh) if bare else mesh)
                if window.poll() is not None:
                    break
            window.wait()
        except KeyboardInterrupt:
            window.wait(5)
            raise
        finally:
            window.kill()
        _judge(window.returncode, said)


def _send(window: subprocess.Popen[bytes], mesh: Mesh) -> None:
    data = ply_bytes(mesh)
    try:
        assert window.stdin is not None  # noqa: S101 - it was opened as a pipe
        window.stdin.write(len(data).to_bytes(8, "little") + data)
        window.stdin.flush()
    except BrokenPipeError:
        pass  # the window is closed; why, its end will tell


def _judge(code: int, said: IO[bytes]) -> None:
    """Raise ConfigError where the window did not end well."""
    if code == 0:
        return
    said.seek(0)
    lines = said.read().decode(errors="replace").splitlines()
    known = [line.removeprefix(MARK) for line in lines if line.startswith(MARK)]
    if known:
        raise ConfigError(known[-1])
    reason = f"signal {-code}" if code < 0 else (lines[-1] if lines else f"code {code}")
    raise ConfigError(f"the 3D window broke down ({reason}); renew the graphics driver, or use 'lacuna dashboard'")
