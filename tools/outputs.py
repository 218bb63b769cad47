"""The folder of results: every file that ``replay``, ``demo --headless`` and ``fill`` leave.

The same state gives the same bytes: no clock, no machine name and no timing stands in any of them.
"""

from __future__ import annotations

import json
import platform
from collections import Counter
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daemon.state import MapState, grid_digest, mesh_digest, poses_digest
from daemon.swing import compass_facts
from drivers.records import Json
from fill.values import Filled
from mapping.ensemble import Mixture
from mapping.values import FREE, OCCUPIED, Level
from tools.files import make_folder, replace_file
from tools.maps import state_shades, write_map
from tools.plan import draw_plan
from tools.ply import ply_bytes
from tools.provenance import Provenance
from tools.tables import fills_csv, holes_csv, poses_csv

_LIBRARIES: Final = ("numpy", "pillow", "scikit-image", "scipy")
_FILL_DARKEST: Final = 5  # a filled cell is never as black as a measured one, and always occupied to a map_server
_FILL_PALEST: Final = 85


def write_outputs(
    folder: Path, state: MapState, origin: Provenance, yaw_rad: float = 0.0, *, poses: bool = True
) -> dict[str, Json]:
    """Write the results of design section 5 into ``folder`` and return what ``report.json`` says.

    ``yaw_rad`` is the turn of a foreign map's axes, carried over into the .yaml files; a foreign map has no
    ``poses``.  Results of an earlier run are replaced, each file whole.  Raises InputError (no such folder) or
    LogError (the disk is full, or it is read-only).
    """
    make_folder(folder)
    write_map(folder, "map", state.grid, state_shades(state.grid.state), yaw_rad)
    write_levels(folder, state.levels)
    write_map(folder, "filled", state.grid, fill_shades(state.filled), yaw_rad)
    if state.mixture is not None:
        write_map(folder, "certainty", state.grid, mixed_shades(state.mixture), yaw_rad)
    replace_file(folder / "fills.csv", fills_csv(state.filled))
    replace_file(folder / "holes.csv", holes_csv(state.filled))
    if poses:
        replace_file(folder / "poses.csv", poses_csv(state.stations))
    replace_file(folder / "mesh.ply", ply_bytes(state.mesh, (origin.site, origin.line)))
    plan = draw_plan(state.filled, state.stations, origin, state.outlines)
    replace_file(folder / "plan.png", plan.png)
    replace_file(folder / "plan.pgw", plan.world.encode())
    facts = report(state, origin)
    replace_file(folder / "report.json", (json.dumps(facts, indent=2, sort_keys=True) + "\n").encode())
    return facts


def write_levels(folder: Path, levels: Sequence[Level]) -> None:
    """Write the evidence of other depths as ``map-level-2`` and so on; those of an earlier run go."""
    for stale in folder.glob("map-level-*"):
        stale.unlink()
    for number, level in enumerate(levels, 2):
        write_map(folder, f"map-level-{number}", level.grid, state_shades(level.grid.state))


def fill_shades(filled: Filled) -> NDArray[np.uint8]:
    """Grey levels ``(rows, cols)`` of ``filled.pgm``: measured as in ``map.pgm``, fills darker the surer they are."""
    shades = state_shades(filled.grid.state)
    cells = filled.hole >= 0
    span = _FILL_PALEST - _FILL_DARKEST
    shades[cells] = np.rint(_FILL_PALEST - span * filled.certainty[cells].astype(np.float64)).astype(np.uint8)
    return shades


def mixed_shades(mixture: Mixture) -> NDArray[np.uint8]:
    """Grey levels ``(rows, cols)`` of ``certainty.pgm``: the surer a wall wherever the stations are, the darker."""
    return np.asarray(np.rint(255.0 * (1.0 - mixture.probability)), dtype=np.uint8)


def report(state: MapState, origin: Provenance) -> dict[str, Json]:
    """Return the facts of ``report.json``: counts, sizes, versions, digests, damage."""
    return {
        "site": origin.site,
        "north": origin.north,
        "config_hash": origin.config_hash,
        "logs": list(origin.logs),
        "damage": origin.damage,
        "versions": _versions(origin),
        "stations": dict(Counter[str](station.status for station in state.stations)),
        **_piece_facts(state),
        "compass": compass_facts(state.stations),
        "levels": [{"depth_m": round(level.depth_m, 3), "stations": list(level.scans)} for level in state.levels],
        "grid": _grid_facts(state),
        "fills": _fill_facts(state.filled),
        "mesh": {"vertices": len(state.mesh.vertices), "triangles": len(state.mesh.triangles)},
        "sha256": {
            "grid": grid_digest(state.grid),
            "poses": poses_digest(state.stations),
            "mesh": mesh_digest(state.mesh),
        },
    }


def _versions(origin: Provenance) -> dict[str, Json]:
    found: dict[str, Json] = {name: version(name) for name in _LIBRARIES}
    return found | {"lacuna": origin.version, "python": platform.python_version()}


def _grid_facts(state: MapState) -> dict[str, Json]:
    grid = state.grid
    rows, cols = grid.state.shape
    area_m2 = grid.cell_m**2
    return {
        "cell_m": grid.cell_m,
        "origin_m": [grid.x0_m, grid.y0_m],
        "rows": rows,
        "cols": cols,
        "occupied_cells": int(np.count_nonzero(grid.state == OCCUPIED)),
        "free_cells": int(np.count_nonzero(grid.state == FREE)),
        "free_m2": round(float(np.count_nonzero(grid.state == FREE) * area_m2), 4),
    }


def _piece_facts(state: MapState) -> dict[str, Json]:
    """Tell which scans lie in pieces that nothing ties to the map, and how sure the place of its walls is."""
    floating: dict[str, Json] = {}
    held = [station for station in state.stations if station.status != "dropped"]
    for number in sorted({station.piece for station in held} - {0}):
        floating[str(number)] = [station.scan.index for station in held if station.piece == number]
    facts: dict[str, Json] = {"pieces": len({station.piece for station in held}), "floating": floating}
    if state.mixture is not None:
        sd_m = state.mixture.sd_m[state.grid.state == OCCUPIED]
        quantiles = np.percentile(sd_m, [50, 95]) if len(sd_m) else np.zeros(2)
        facts["wall_sd_m"] = {"median": round(float(quantiles[0]), 4), "95": round(float(quantiles[1]), 4)}
    return facts


def _fill_facts(filled: Filled) -> dict[str, Json]:
    cells = filled.hole >= 0
    mean = round(float(filled.certainty[cells].mean()), 4) if cells.any() else None
    return {
        "holes": len(filled.holes),
        "cells": int(np.count_nonzero(cells)),
        "mean_certainty": mean,
        "open_ends": len(filled.open_ends_m),
        "noise_ends": filled.noise_ends,
    }
