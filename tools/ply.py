"""PLY, binary little-endian: the mesh with colour, class and certainty at every vertex.

Source: G. Turk, "The PLY Polygon File Format" (1994).  ``class`` is 0 measured, 1 filled, 2 assumed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.errors import DataError
from fill.values import ASSUMED, FILLED, MEASURED, Mesh

_VERTEX: Final = np.dtype(
    [
        ("x", "<f4"), ("y", "<f4"), ("z", "<f4"),
        ("red", "u1"), ("green", "u1"), ("blue", "u1"),
        ("class", "u1"), ("certainty", "<f4"),
    ]
)  # fmt: skip
_FACE: Final = np.dtype([("count", "u1"), ("corners", "<u4", (3,))])
_NAMES: Final = {"<f4": "float", "|u1": "uchar"}

STONE: Final = (178, 170, 158)
SURE_FILL: Final = (213, 94, 0)
UNSURE_FILL: Final = (250, 214, 170)
FLOOR: Final = (120, 144, 156)


def ply_bytes(mesh: Mesh, comments: Sequence[str] = ()) -> bytes:
    """Return the mesh as a PLY file's bytes; ``comments`` go into the header, one line each."""
    vertices = np.zeros(len(mesh.vertices), _VERTEX)
    for axis, name in enumerate("xyz"):
        vertices[name] = mesh.vertices[:, axis]
    for channel, name in enumerate(("red", "green", "blue")):
        vertices[name] = colours(mesh)[:, channel]
    vertices["class"], vertices["certainty"] = mesh.kind, mesh.certainty
    faces = np.zeros(len(mesh.triangles), _FACE)
    faces["count"], faces["corners"] = 3, mesh.triangles
    return _header(len(vertices), len(faces), comments) + vertices.tobytes() + faces.tobytes()


def colours(mesh: Mesh) -> NDArray[np.uint8]:
    """Colour ``(n, 3)`` uint8 of each vertex: stone where measured, paler orange the less sure a fill is."""
    result = np.empty((len(mesh.kind), 3), np.uint8)
    result[mesh.kind == MEASURED] = STONE
    result[mesh.kind == ASSUMED] = FLOOR
    filled = mesh.kind == FILLED
    share = mesh.certainty[filled, None].astype(np.float64)
    result[filled] = np.rint(share * np.array(SURE_FILL) + (1.0 - share) * np.array(UNSURE_FILL)).astype(np.uint8)
    return result


def parse_ply(data: bytes) -> Mesh:
    """Read back what ``ply_bytes`` wrote.  Raises DataError on anything else."""
    head, mark, body = data.partition(b"end_header\n")
    counts = [
        int(line.split()[2]) for line in head.splitlines() if line.startswith(b"element ") and line[-1:].isdigit()
    ]
    if not mark or len(counts) != 2 or head + mark != _header(counts[0], counts[1], _comments(head)):
        raise DataError("this is not a mesh.ply of lacuna; make it again with 'lacuna replay'")
    split = counts[0] * _VERTEX.itemsize
    if len(body) != split + counts[1] * _FACE.itemsize:
        raise DataError("the mesh.ply is cut short; make it again with 'lacuna replay'")
    vertices = np.frombuffer(body[:split], _VERTEX)
    faces = np.frombuffer(body[split:], _FACE)
    places = np.stack([vertices[axis] for axis in "xyz"], axis=1)
    corners = faces["corners"].astype(np.uint32)
    return Mesh(places, corners, vertices["class"].copy(), vertices["certainty"].astype(np.float32))


def _comments(head: bytes) -> list[str]:
    return [line[8:].decode("ascii", "replace") for line in head.splitlines() if line.startswith(b"comment ")]


def _header(vertices: int, faces: int, comments: Sequence[str]) -> bytes:
    fields = [f"property {_NAMES[_VERTEX[name].str]} {name}" for name in _VERTEX.names or ()]
    lines = ["ply", "format binary_little_endian 1.0"]
    lines += [f"comment {' '.join(line.split())}" for line in comments]
    lines += [f"element vertex {vertices}", *fields]
    lines += [f"element face {faces}", "property list uchar uint vertex_indices", "end_header"]
    return ("\n".join(lines) + "\n").encode("ascii", "replace")
