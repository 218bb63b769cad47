"""Tables for people and spreadsheets: fills, holes and poses as CSV bytes."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence

from fill.values import Filled
from mapping.values import Station

FILLS_HEADER = ("row", "col", "certainty", "hole")
HOLES_HEADER = (
    "hole", "certainty", "gap_m", "cells", "curve", "x1_m", "y1_m", "x2_m", "y2_m", "why", "parents",
    "beyond_learnt",
)  # fmt: skip
POSES_HEADER = (
    "station",
    "t_ns",
    "x_m",
    "y_m",
    "heading_deg",
    "depth_m",
    "sd_x_m",
    "sd_y_m",
    "cov_xy_m2",
    "sd_heading_deg",
    "status",
    "piece",
)


def fills_csv(filled: Filled) -> bytes:
    """Every filled cell; row 0 is the top row of ``filled.pgm``."""
    top = filled.grid.state.shape[0] - 1
    return _csv(
        FILLS_HEADER,
        (
            (top - int(row), int(col), f"{certainty:.4f}", hole.index)
            for hole in filled.holes
            for (row, col), certainty in zip(hole.cells, hole.certainty, strict=True)
        ),
    )


def holes_csv(filled: Filled) -> bytes:
    """Every hole: its certainty, its ends, the holes it goes on from, whether it is beyond what was learnt."""
    return _csv(
        HOLES_HEADER,
        (
            (
                hole.index, f"{hole.hole_certainty:.4f}", f"{hole.gap_m:.3f}", len(hole.cells), hole.curve,
                *(f"{value:.3f}" for value in hole.ends_m.ravel()), hole.why,
                " ".join(str(parent) for parent in hole.parents), int(hole.beyond_learnt),
            )
            for hole in filled.holes
        ),
    )  # fmt: skip


def poses_csv(stations: Iterable[Station]) -> bytes:
    """Every station in the order of the scans; ``t_ns`` is where its scan began, ``nan`` what is not known."""
    return _csv(POSES_HEADER, (_pose_row(station) for station in stations))


def _pose_row(station: Station) -> tuple[object, ...]:
    pose, covariance = station.pose, station.covariance
    sds = [math.sqrt(max(float(covariance[axis, axis]), 0.0)) for axis in range(3)]
    return (
        station.scan.index,
        station.scan.t_start_ns,
        f"{pose.x_m:.4f}",
        f"{pose.y_m:.4f}",
        f"{math.degrees(pose.heading_rad) % 360.0:.3f}",
        f"{station.scan.depth_m:.3f}",
        f"{sds[0]:.4f}",
        f"{sds[1]:.4f}",
        f"{float(covariance[0, 1]):.6f}",
        f"{math.degrees(sds[2]):.3f}",
        station.status,
        station.piece,
    )


def _csv(header: Sequence[str], rows: Iterable[Sequence[object]]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue().encode()
