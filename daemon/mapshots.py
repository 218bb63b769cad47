"""Snapshots of the map: stations, grid, fills, surface.  Rows run south to north; see ``daemon.snapshots``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daemon.snapshots import Snapshot, degrees, number
from daemon.swing import compass_facts
from drivers.records import Json
from fill.guide import Goal
from fill.values import Filled, Hole, Mesh
from mapping.values import Grid, Outline, Station

Stamp = tuple[int, int]
"""``(t_ns, utc_ns)`` of the record that made the snapshot."""


def stations(stamp: Stamp, all_stations: Sequence[Station], outlines: Sequence[Outline] = ()) -> Snapshot:
    """Every station, for later ones move earlier ones; ``newest`` is the index of the scan that came last.

    ``compass`` is what the stations say of the compass (``daemon.swing``).  Arrays ``wall_m`` ``(n, 2)`` f4 and
    ``wall_station`` ``(n,)`` i4 are the wall points that floating pieces saw, and which station saw them.
    """
    newest: Json = all_stations[-1].scan.index if all_stations else None
    fields: dict[str, Json] = {"newest": newest, "stations": [_station(each) for each in all_stations]}
    fields["compass"] = compass_facts(all_stations)
    seen = [np.full(len(each.xy_m), each.scan, np.int32) for each in outlines]
    places = [each.xy_m for each in outlines]
    arrays: dict[str, NDArray[Any]] = {
        "wall_m": np.concatenate([np.zeros((0, 2), np.float32), *places]),
        "wall_station": np.concatenate([np.zeros(0, np.int32), *seen]),
    }
    return Snapshot("station", *stamp, fields, arrays)


def layers(grid: Grid) -> NDArray[np.uint8]:
    """Return ``(2, rows, cols)`` uint8: occupancy 0 to 255 for 0 to 1, and state 0 unknown, 1 free, 2 occupied."""
    occupancy = np.rint(255.0 * grid.probability).astype(np.uint8)
    return np.stack([occupancy, grid.state])


def grid_key(stamp: Stamp, grid: Grid) -> Snapshot:
    """Return the whole grid: array ``layers`` ``(2, rows, cols)`` u1."""
    return Snapshot("grid/key", *stamp, {**_place(grid), "layers": ["occupancy", "state"]}, {"cells": layers(grid)})


def grid_delta(stamp: Stamp, grid: Grid, before: NDArray[np.uint8]) -> Snapshot | None:
    """Return the window ``(2, r, c)`` u1 that differs from ``before`` (layers of equal shape); None where none does.

    ``base`` names the message that it applies to; whoever numbers the messages fills it in.
    """
    after = layers(grid)
    rows, cols = np.nonzero((after != before).any(axis=0))
    if not len(rows):
        return None
    row0, col0 = int(rows.min()), int(cols.min())
    window = after[:, row0 : int(rows.max()) + 1, col0 : int(cols.max()) + 1]
    fields: dict[str, Json] = {"base": None, "row0": row0, "col0": col0, **_place(grid)}
    return Snapshot("grid/delta", *stamp, fields, {"cells": window})


def fill(stamp: Stamp, filled: Filled) -> Snapshot:
    """Return n filled cells: arrays ``row`` i4, ``col`` i4, ``certainty`` u1 (255: sure), ``hole`` i4, all ``(n,)``."""
    row, col = np.nonzero(filled.hole >= 0)
    certainty = np.rint(255.0 * filled.certainty[row, col]).astype(np.uint8)
    fields: dict[str, Json] = {
        **_place(filled.grid),
        "holes": [_hole(each) for each in filled.holes],
        "open_ends_m": _points(filled.open_ends_m),
        "noise_ends": filled.noise_ends,
    }
    arrays = {"row": row.astype(np.int32), "col": col.astype(np.int32), "certainty": certainty}
    return Snapshot("fill", *stamp, fields, {**arrays, "hole": filled.hole[row, col]})


def mesh(stamp: Stamp, surface: Mesh) -> Snapshot:
    """Return arrays ``vertices`` ``(n, 3)`` f4, ``triangles`` ``(m, 3)`` u4, ``kind`` ``(n,)`` u1, ``certainty`` u1."""
    certainty = np.rint(255.0 * surface.certainty).astype(np.uint8)
    arrays: dict[str, NDArray[Any]] = {
        "vertices": surface.vertices,
        "triangles": surface.triangles,
        "kind": surface.kind,
    }
    return Snapshot("mesh", *stamp, {"kinds": ["measured", "filled", "assumed"]}, {**arrays, "certainty": certainty})


def guide(stamp: Stamp, goals: Sequence[Goal], open_ends_m: NDArray[np.float64]) -> Snapshot:
    """Return where to station next, best first and each with its reason, and the wall ends that are still open."""
    told: list[Json] = [
        {"x_m": number(goal.x_m), "y_m": number(goal.y_m), "edge_m": number(goal.edge_m), "why": goal.why}
        for goal in goals
    ]
    return Snapshot("guide", *stamp, {"goals": told, "open": _points(open_ends_m)})


def _place(grid: Grid) -> dict[str, Json]:
    rows, cols = grid.state.shape
    return {"cell_m": grid.cell_m, "x0_m": grid.x0_m, "y0_m": grid.y0_m, "rows": rows, "cols": cols}


def _station(station: Station) -> dict[str, Json]:
    deviation = np.sqrt(np.diag(station.covariance))
    return {
        "station": station.scan.index,
        "t_ns": station.scan.t_start_ns,
        "x_m": number(station.pose.x_m),
        "y_m": number(station.pose.y_m),
        "heading_deg": degrees(station.pose.heading_rad % math.tau),
        "depth_m": number(station.scan.depth_m),
        "cov": [[number(float(value), 12) for value in row] for row in station.covariance],
        "sd_x_m": number(float(deviation[0])),
        "sd_y_m": number(float(deviation[1])),
        "sd_heading_deg": degrees(float(deviation[2])),
        "status": station.status,
        "piece": station.piece,
        "margin": number(station.margin),
        "why": station.why,
        "quality": station.scan.quality,
    }


def _hole(hole: Hole) -> dict[str, Json]:
    return {
        "hole": hole.index,
        "certainty": number(hole.hole_certainty),
        "cells": len(hole.cells),
        "gap_m": number(hole.gap_m),
        "curve": hole.curve,
        "why": hole.why,
        "ends_m": _points(hole.ends_m),
        "parents": list(hole.parents),
        "beyond_learnt": hole.beyond_learnt,
    }


def _points(points_m: NDArray[np.float64]) -> Json:
    return [[number(float(value)) for value in point] for point in points_m]
