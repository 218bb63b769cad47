"""ROS map_server maps: an image and a .yaml beside it, read as evidence and written back.

Row 0 of the image is the northmost row, row 0 of a ``Grid`` the southmost.  Source: ROS wiki, map_server, and the
image loader of nav2_map_server for the modes.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from config.errors import DataError, InputError
from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid
from tools.files import read_bytes, replace_file
from tools.mapyaml import MapDescription, describe, parse_description

MAX_PIXELS: Final = 64_000_000
SHADE_OCCUPIED: Final = 0
SHADE_UNKNOWN: Final = 205
SHADE_FREE: Final = 254
_CERTAIN: Final = 0.02  # probabilities read from grey levels stay this far from 0 and 1


@dataclass(frozen=True, slots=True)
class RosMap:
    """A map as read: its evidence, the name of its image, and the turn of its axes that a ``Grid`` does not carry."""

    grid: Grid
    image: str
    yaw_rad: float


def read_map(path: Path) -> RosMap:
    """Read a map_server map by its .yaml.  Raises InputError (not there) or DataError (not a map)."""
    try:
        described = parse_description(read_bytes(path).decode("utf-8-sig"), path.name)
    except UnicodeDecodeError as error:
        raise DataError(f"{path.name} is not text; give the map's .yaml, not its image") from error
    image = _image_path(path, described)
    grey, opaque = _grey(image)
    if described.mode == "raw":
        probability, known = np.minimum(grey / 100.0, 1.0), opaque & (grey <= 100)
    else:
        probability, known = (grey if described.negate else 255.0 - grey) / 255.0, opaque
    return RosMap(_grid(np.flipud(probability), np.flipud(known), described), image.name, described.yaw_rad)


def write_map(folder: Path, stem: str, grid: Grid, shades: NDArray[np.uint8], yaw_rad: float = 0.0) -> None:
    """Write ``stem``.pgm and ``stem``.yaml; ``shades`` ``(rows, cols)`` has row 0 south.  Raises LogError."""
    rows, cols = shades.shape
    head = f"P5\n# lacuna {stem}\n{cols} {rows}\n255\n".encode()
    described = MapDescription(f"{stem}.pgm", grid.cell_m, grid.x0_m, grid.y0_m, yaw_rad, False, 0.65, 0.196, "trinary")
    replace_file(folder / f"{stem}.pgm", head + np.ascontiguousarray(np.flipud(shades)).tobytes())
    replace_file(folder / f"{stem}.yaml", describe(described).encode())


def state_shades(state: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Grey levels ``(rows, cols)`` uint8 of a state layer, as map_saver writes them."""
    table = np.zeros(256, np.uint8)
    table[[UNKNOWN, FREE, OCCUPIED]] = SHADE_UNKNOWN, SHADE_FREE, SHADE_OCCUPIED
    return table[state]


def _image_path(path: Path, described: MapDescription) -> Path:
    named = path.parent / described.image
    if named.is_file():
        return named
    # Maps are often renamed together while the .yaml keeps the image's old name.
    for suffix in (Path(described.image).suffix, ".pgm", ".png"):
        if suffix and path.with_suffix(suffix).is_file():
            return path.with_suffix(suffix)
    raise InputError(f"{path.name} names the image {described.image}, which is not beside it; copy it there")


def _grey(image: Path) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Grey levels 0 to 255 ``(rows, cols)`` and which pixels are opaque."""
    try:
        with Image.open(io.BytesIO(read_bytes(image))) as opened:
            if opened.width * opened.height > MAX_PIXELS:
                raise DataError(f"{image.name} has more than {MAX_PIXELS} pixels; cut or scale the map")
            return _levels(opened)
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise DataError(f"{image.name} is not a readable image; save the map again as .pgm or .png") from error


def _levels(opened: Image.Image) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    if opened.mode.startswith("I"):  # 16 bits a pixel
        grey = np.asarray(opened, np.float64) * (255.0 / 65535.0)
        return grey, np.ones(grey.shape, bool)
    channels = np.asarray(opened.convert("RGBA"), np.float64)
    return channels[..., :3].mean(axis=2), channels[..., 3] >= 128


def _grid(probability: NDArray[np.float64], known: NDArray[np.bool_], described: MapDescription) -> Grid:
    state = np.full(probability.shape, UNKNOWN, np.uint8)
    state[known & (probability < described.free_thresh)] = FREE
    state[known & (probability > described.occupied_thresh)] = OCCUPIED
    if described.mode == "raw":
        state[known & (probability >= described.occupied_thresh)] = OCCUPIED
        state[known & (probability <= described.free_thresh)] = FREE
    clipped = np.clip(probability, _CERTAIN, 1.0 - _CERTAIN)
    log_odds = np.where(state == UNKNOWN, 0.0, np.log(clipped / (1.0 - clipped))).astype(np.float32)
    return Grid(described.cell_m, described.x0_m, described.y0_m, log_odds, state)
