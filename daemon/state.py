"""The state of the map, whole, as the pipeline holds it and as the files for people are written from it."""

from __future__ import annotations

import hashlib
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fill.values import Filled, Mesh
from mapping.ensemble import Mixture
from mapping.values import Grid, Level, Outline, Station


@dataclass(frozen=True, slots=True)
class MapState:
    """What is known at one moment: stations in the order of their scans, evidence, fills and surface.

    ``outlines`` are the walls of floating pieces.  ``mixture`` is the evidence mixed over the poses, None while the map
    still grows; ``levels`` is what was seen at other depths, where walls are elsewhere, likewise.
    """

    stations: tuple[Station, ...]
    grid: Grid
    filled: Filled
    mesh: Mesh
    outlines: tuple[Outline, ...] = ()
    mixture: Mixture | None = None
    levels: tuple[Level, ...] = ()


def grid_digest(grid: Grid) -> str:
    """SHA-256 (hex) of the evidence: place, size, log-odds and states, little-endian."""
    digest = hashlib.sha256(struct.pack("<3d2q", grid.cell_m, grid.x0_m, grid.y0_m, *grid.state.shape))
    digest.update(_bytes(grid.log_odds, "<f4"))
    digest.update(_bytes(grid.state, "|u1"))
    return digest.hexdigest()


def poses_digest(stations: tuple[Station, ...]) -> str:
    """SHA-256 (hex) of every station's scan time, pose, covariance and status, little-endian."""
    digest = hashlib.sha256()
    for each in stations:
        pose = each.pose
        digest.update(struct.pack("<2q3d", each.scan.index, each.scan.t_start_ns, pose.x_m, pose.y_m, pose.heading_rad))
        digest.update(_bytes(each.covariance, "<f8"))
        digest.update(each.status.encode())
    return digest.hexdigest()


def mesh_digest(mesh: Mesh) -> str:
    """SHA-256 (hex) of vertices, triangles, kinds and certainties, little-endian."""
    digest = hashlib.sha256(struct.pack("<2q", len(mesh.vertices), len(mesh.triangles)))
    for array, layout in ((mesh.vertices, "<f4"), (mesh.triangles, "<u4"), (mesh.kind, "|u1"), (mesh.certainty, "<f4")):
        digest.update(_bytes(array, layout))
    return digest.hexdigest()


def _bytes(array: NDArray[Any], layout: str) -> bytes:
    return np.ascontiguousarray(array, dtype=layout).tobytes()
