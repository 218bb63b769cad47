"""The mesh in its window: what is told where it cannot be, and its colours on a real (virtual) screen."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageGrab

from fill.values import FILLED, MEASURED
from tests.tools.fake_daemon import FakeDaemon
from tests.tools.fake_site import mesh
from tests.tools.live_page import free_port, lacuna
from tools.ply import ply_bytes
from tools.view import measured_only
from tools.window import APT, missing_library


@pytest.fixture
def ply(tmp_path: Path) -> Path:
    path = tmp_path / "mesh.ply"
    path.write_bytes(ply_bytes(mesh()))
    return path


@pytest.fixture(scope="module")
def screen() -> Iterator[str]:
    """The name of a virtual display of its own."""
    if shutil.which("Xvfb") is None:
        pytest.skip("no virtual display on this machine: apt-get install xvfb")
    if find_spec("open3d") is None:
        pytest.skip("no Open3D: pip install 'lacuna[view]'")
    command = ["Xvfb", "-noreset", "-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        assert server.stdout is not None
        yield f":{server.stdout.readline().strip()}"
        server.terminate()


def shares(picture: Image.Image) -> tuple[float, float, float]:
    """Shares of the picture that are orange, stone and blue-grey."""
    pixels: NDArray[np.int_] = np.asarray(picture.convert("RGB")).astype(int)
    red, green, blue = np.moveaxis(pixels, -1, 0)
    orange = red > 1.6 * blue + 40
    stone = (red > blue + 5) & ~orange & (green > 60)
    floor = (blue > red + 12) & (green > 60)
    return float(orange.mean()), float(stone.mean()), float(floor.mean())


def with_open3d(folder: Path, source: str) -> dict[str, str]:
    """Surroundings in which ``import open3d`` runs ``source``."""
    (folder / "open3d.py").write_text(source)
    return {**os.environ, "PYTHONPATH": str(folder)}


def test_measured_only_leaves_out_fills_and_floor() -> None:
    whole = mesh()
    bare = measured_only(whole)
    assert set(bare.kind) == {MEASURED}
    corners = whole.kind[whole.triangles]
    assert len(bare.triangles) == (corners == MEASURED).all(axis=1).sum() < len(whole.triangles)
    kept = whole.triangles[(corners == MEASURED).all(axis=1)]
    np.testing.assert_array_equal(bare.vertices[bare.triangles], whole.vertices[kept])


def test_measured_only_of_nothing_is_nothing() -> None:
    whole = mesh()
    filled = measured_only(
        type(whole)(whole.vertices, whole.triangles, np.full_like(whole.kind, FILLED), whole.certainty)
    )
    assert filled.vertices.shape == (0, 3)
    assert filled.triangles.shape == (0, 3)


@pytest.mark.parametrize(("library", "package"), sorted(APT.items()))
def test_each_system_library_is_told_with_its_package(library: str, package: str) -> None:
    said = missing_library(f"{library}: cannot open shared object file: No such file or directory")
    assert said == f"the 3D window needs the system library {library}; apt-get install {package}"


def test_an_unknown_library_is_told_with_the_way_to_find_it() -> None:
    assert "apt-file search libodd-2.so.7" in missing_library("libodd-2.so.7: cannot open shared object file")
    assert "lacuna dashboard" in missing_library("bad CPU")


def test_a_missing_system_library_ends_in_one_line(tmp_path: Path, ply: Path) -> None:
    source = "raise ImportError('libusb-1.0.so.0: cannot open shared object file: No such file or directory')"
    ended = lacuna("view", str(ply), "--screenshot", str(tmp_path / "a.png"), env=with_open3d(tmp_path, source))
    assert (ended.returncode, ended.stdout) == (78, "")
    assert ended.stderr.endswith("libusb-1.0.so.0; apt-get install libusb-1.0-0\n")
    assert ended.stderr.count("\n") == 1


def test_a_missing_package_is_told_with_its_command(tmp_path: Path, ply: Path) -> None:
    source = "raise ModuleNotFoundError(\"No module named 'open3d'\", name='open3d')"
    ended = lacuna("view", str(ply), "--screenshot", str(tmp_path / "a.png"), env=with_open3d(tmp_path, source))
    assert ended.stderr == "lacuna: the 3D window needs the package 'open3d'; pip install 'lacuna[view]'\n"


def test_a_crash_in_native_code_ends_in_one_line(tmp_path: Path, ply: Path) -> None:
    surroundings = with_open3d(tmp_path, "import os\nos.abort()")
    ended = lacuna("view", str(ply), "--screenshot", str(tmp_path / "a.png"), env=surroundings)
    assert ended.returncode == 78
    assert ended.stderr.count("\n") == 1
    assert f"signal {signal.SIGABRT.value}" in ended.stderr
    assert "lacuna dashboard" in ended.stderr


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("nowhere.ply",), 66, "nowhere.ply"),
        ((__file__,), 65, "mesh.ply"),
        ((__file__, "--connect", "tcp://127.0.0.1:1"), 64, "not both"),
        ((__file__, "--screenshot", "/nowhere/at/all.png"), 66, "/nowhere/at"),
        (("--connect", "5556"), 64, "tcp://"),
    ],
)
def test_wrong_use_is_told_in_one_line(words: tuple[str, ...], code: int, said: str) -> None:
    ended = lacuna("view", *words)
    assert (ended.returncode, ended.stdout) == (code, "")
    assert ended.stderr.count("\n") == 1
    assert said in ended.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="displays are told by X only on Linux")
def test_no_display_is_told_in_one_line(ply: Path) -> None:
    for display in ({}, {"DISPLAY": ":4711"}):
        bare = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
        ended = lacuna("view", str(ply), env={**bare, **display})
        assert ended.returncode == 78
        assert ended.stderr.startswith("lacuna: there is no display here")
        assert ended.stderr.count("\n") == 1


def test_a_picture_shows_the_three_kinds_in_their_colours(ply: Path, screen: str, tmp_path: Path) -> None:
    surroundings = {**os.environ, "DISPLAY": screen}
    whole, bare = tmp_path / "whole.png", tmp_path / "bare.png"
    assert lacuna("view", str(ply), "--screenshot", str(whole), env=surroundings).returncode == 0
    orange, stone, floor = shares(Image.open(whole))
    assert orange > 0.003
    assert stone > 0.05
    assert floor > 0.03
    assert lacuna("view", str(ply), "--screenshot", str(bare), "--measured-only", env=surroundings).returncode == 0
    orange, stone, floor = shares(Image.open(bare))
    assert (orange, floor) == (0, 0)
    assert stone > 0.05


@pytest.mark.slow
def test_the_daemons_mesh_stands_in_the_window_until_ctrl_c(screen: str) -> None:
    daemon = FakeDaemon(free_port())
    command = [sys.executable, "-m", "tools.cli", "view", "--connect", f"tcp://127.0.0.1:{daemon.port}"]
    surroundings = {**os.environ, "DISPLAY": screen}
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=surroundings, start_new_session=True) as view:
        try:
            end = time.monotonic() + 60
            while min(shares(ImageGrab.grab(xdisplay=screen))) < 0.003:
                assert view.poll() is None
                assert time.monotonic() < end, "the mesh is not to be seen"
                time.sleep(0.3)
        finally:
            # As a terminal does: to the command and to its window.
            os.killpg(view.pid, signal.SIGINT)
            complaint = view.communicate(timeout=30)[1]
            daemon.close()
    assert view.returncode == 130
    assert complaint == ""
