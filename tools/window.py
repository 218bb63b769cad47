"""The Open3D window, in a process of its own: a failure of drivers or libraries there ends nothing else.

``python -m tools.window [PICTURE]`` reads meshes from standard input, each as eight bytes of length (little-endian) and
a PLY file's bytes, and shows the newest until it is closed or its input ends: whoever started it is then gone.  With
PICTURE it saves one picture of the first mesh and ends.  What is wrong comes as one line on standard error that begins
with ``MARK``: drivers and libraries write there too.
"""

from __future__ import annotations

import ctypes
import os
import queue
import re
import sys
import threading
import time
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import numpy as np

from fill.values import FILLED, Mesh
from tools.ply import colours, parse_ply

MARK: Final = "lacuna window: "
TITLE: Final = "lacuna: stone is measured, striped orange is filled in (paler: less sure), blue-grey floor is assumed"
APT: Final = {
    "libusb-1.0.so.0": "libusb-1.0-0",
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libgomp.so.1": "libgomp1",
    "libudev.so.1": "libudev1",
    "libidn2.so.0": "libidn2-0",
}
"""Debian's packages of the system libraries that Open3D 0.20 loads."""
_GROUND: Final = (0.07, 0.09, 0.11)
_SEAM: Final = (0.48, 0.21, 0.0)
_FRAME_S: Final = 1 / 30
_SIZE: Final = (1100, 760)


class WindowError(Exception):
    """The window cannot be shown; the message says what to do."""


def main() -> int:
    """Show what comes until the window is closed; return 0, or 1 after telling why not."""
    picture = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    try:
        if picture is None:
            check_display()  # before Open3D, which takes seconds to load
        _show(load(), _arrivals(sys.stdin.fileno()), picture)
    except WindowError as error:
        print(f"{MARK}{error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 0
    return 0


def load() -> ModuleType:
    """Import Open3D; raise WindowError with the command that installs what is missing."""
    try:
        import open3d
    except ModuleNotFoundError as error:
        raise WindowError(f"the 3D window needs the package '{error.name}'; pip install 'lacuna[view]'") from None
    except (ImportError, OSError) as error:
        raise WindowError(missing_library(str(error))) from None
    open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
    loaded: ModuleType = open3d
    return loaded


def check_display() -> None:
    """Raise WindowError where no window could be seen: Open3D would else draw into nowhere, for ever."""
    if sys.platform != "linux" or os.environ.get("WAYLAND_DISPLAY"):
        return
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError as error:
        raise WindowError(missing_library(str(error))) from None
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = x11.XOpenDisplay(None)
    if not display:
        raise WindowError("there is no display here; save a picture with --screenshot, or use 'lacuna dashboard'")
    x11.XCloseDisplay(ctypes.c_void_p(display))


def missing_library(reason: str) -> str:
    """Return the loader's ``reason`` in words, with the command that installs what is missing."""
    found = re.search(r"([\w.+-]+\.so[.\d]*): cannot open shared object", reason)
    if found is None:
        return f"Open3D cannot be loaded ({reason}); use 'lacuna dashboard' instead"
    library = found.group(1)
    package = APT.get(library)
    how = f"apt-get install {package}" if package else f"find its package with: apt-file search {library}"
    return f"the 3D window needs the system library {library}; {how}"


def _arrivals(source: int) -> queue.Queue[Mesh | None]:
    """Meshes as they come, None at the end; a reader of its own keeps the sender from waiting for the window."""
    arrived: queue.Queue[Mesh | None] = queue.Queue()

    def read() -> None:
        try:
            while len(length := _exactly(source, 8)) == 8:
                arrived.put(parse_ply(_exactly(source, int.from_bytes(length, "little"))))
        finally:
            arrived.put(None)

    threading.Thread(target=read, daemon=True).start()
    return arrived


def _exactly(source: int, count: int) -> bytes:
    """``count`` bytes, fewer at the end; unbuffered, for a buffer's lock would be held when the window ends."""
    data = bytearray()
    while len(data) < count and (piece := os.read(source, count - len(data))):
        data += piece
    return bytes(data)


def _show(open3d: ModuleType, arrived: queue.Queue[Mesh | None], picture: Path | None) -> None:
    window = open3d.visualization.Visualizer()
    if not window.create_window(TITLE, *_SIZE, visible=picture is None):
        raise WindowError("no OpenGL window can be opened here; apt-get install libgl1-mesa-dri, or 'lacuna dashboard'")
    options = window.get_render_option()
    options.background_color = np.array(_GROUND)
    options.mesh_show_back_face = True  # walls have no outside: they are seen from both
    first = True
    try:
        while window.poll_events():
            mesh, is_over = _newest(arrived)
            if mesh is not None:
                _draw(open3d, window, mesh, first)
                first = False
            window.update_renderer()
            if picture is not None and not first:
                window.capture_screen_image(str(picture), do_render=True)
                return
            if is_over:
                return
            time.sleep(_FRAME_S)
    finally:
        window.destroy_window()


def _newest(arrived: queue.Queue[Mesh | None]) -> tuple[Mesh | None, bool]:
    """Return the newest mesh that waits, if any, and whether no more will come."""
    mesh = None
    while not arrived.empty():
        following = arrived.get()
        if following is None:
            return mesh, True
        mesh = following
    return mesh, False


def _draw(open3d: ModuleType, window: Any, mesh: Mesh, first: bool) -> None:  # noqa: ANN401 - Open3D has no types
    """Replace what is shown; people keep their point of view but for the first time."""
    window.clear_geometries()
    for shape in shapes(open3d, mesh):
        window.add_geometry(shape, reset_bounding_box=first)
    if first and len(mesh.vertices):
        view = window.get_view_control()
        places = _upright(mesh)
        view.set_lookat((places.min(axis=0) + places.max(axis=0)) / 2)
        view.set_front((-0.45, -0.7, 0.65))
        view.set_up((0.0, 0.0, 1.0))
        view.set_zoom(0.6)


def shapes(open3d: ModuleType, mesh: Mesh) -> list[Any]:
    """Return the surface in its colours, flat-shaded, and the seams of what was filled in."""
    places = _upright(mesh)
    corners = mesh.triangles.astype(np.int32)
    surface = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(places[corners.ravel()]),
        open3d.utility.Vector3iVector(np.arange(corners.size, dtype=np.int32).reshape(-1, 3)),
    )
    tints = colours(mesh)[corners.ravel()].astype(np.float64) / 255.0
    surface.vertex_colors = open3d.utility.Vector3dVector(tints)
    surface.compute_vertex_normals()
    filled = corners[mesh.kind[corners].max(axis=1, initial=0) == FILLED]
    edges = np.concatenate([filled[:, [0, 1]], filled[:, [1, 2]]]).astype(np.int32)
    seams = open3d.geometry.LineSet(open3d.utility.Vector3dVector(places), open3d.utility.Vector2iVector(edges))
    seams.paint_uniform_color(_SEAM)
    return [surface, seams] if len(edges) else [surface]


def _upright(mesh: Mesh) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Vertices with z up, as windows expect it; in the data it points down from the surface."""
    return mesh.vertices.astype(np.float64) * (1.0, 1.0, -1.0)


if __name__ == "__main__":
    sys.exit(main())
