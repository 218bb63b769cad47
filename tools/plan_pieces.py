"""Floating pieces on the plan: stations that hold together but that nothing ties to the map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from mapping.values import Outline, Station
from tools import plan_canvas as canvas
from tools.plan_canvas import Frame
from tools.plan_marks import Pen, draw_station

PIECE: Final = (122, 47, 208)
_ROOM_PX: Final = 24
_ROOM_CELLS: Final = 6
_DASH_PX: Final = (8.0, 5.0)


def pieces_of(stations: Sequence[Station]) -> dict[int, list[Station]]:
    """Return the stations of each floating piece of two or more; one alone is a doubtful station."""
    found: dict[int, list[Station]] = {}
    for station in stations:
        if station.piece and station.status != "dropped":
            found.setdefault(station.piece, []).append(station)
    return {number: members for number, members in sorted(found.items()) if len(members) > 1}


def room_for(pieces: dict[int, list[Station]], outlines: Sequence[Outline], cell_m: float) -> NDArray[np.float64]:
    """Return places ``(n, 2)`` of x and y, m, that leave room for the pieces and for what they saw."""
    places = np.array([(s.pose.x_m, s.pose.y_m) for members in pieces.values() for s in members]).reshape(-1, 1, 2)
    corners: NDArray[np.float64] = places + _ROOM_CELLS * cell_m * np.array([(-1, -1), (1, 1)])
    return np.concatenate([corners.reshape(-1, 2), *(each.xy_m for each in outlines)])


def draw_walls(pen: Pen, frame: Frame, outlines: Sequence[Outline]) -> None:
    """Dot the walls that floating pieces saw: no cells, for they are no evidence."""
    size = max(frame.px / 2, 1.5)
    for x_m, y_m in np.concatenate([np.zeros((0, 2)), *(each.xy_m for each in outlines)]):
        x, y = frame.place(x_m, y_m)
        corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
        pen.polygon([(x + size / 2 * dx, y + size / 2 * dy) for dx, dy in corners], PIECE)


def draw_pieces(pen: Pen, frame: Frame, pieces: dict[int, list[Station]]) -> None:
    """Draw each piece in a dashed line of its own colour: where it lies in the map is a guess as a whole."""
    for number, members in pieces.items():
        places = [frame.place(each.pose.x_m, each.pose.y_m) for each in members]
        edge = _outline(np.array(places))
        for width, colour in ((4.0, canvas.PAPER), (2.0, PIECE)):
            draw_dashes(pen, [*edge, edge[0]], colour, width)
        draw_dashes(pen, places, PIECE, 1.2)
        for station, at in zip(members, places, strict=True):
            draw_station(pen, at, station, str(station.scan.index), (canvas.PAPER, PIECE))
        _label(pen, frame, edge, f"piece {number}: not tied yet")


def draw_dashes(pen: Pen, points: Sequence[tuple[float, float]], colour: canvas.Colour, width: float) -> None:
    """Draw a polyline in dashes, which go on round its corners."""
    corners = np.array(points)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    dash, gap = _DASH_PX
    for start in np.arange(0.0, along[-1], dash + gap):
        end = min(start + dash, along[-1])
        at = [start, *along[(along > start) & (along < end)], end]
        pen.line([(float(np.interp(s, along, corners[:, 0])), float(np.interp(s, along, corners[:, 1]))) for s in at],
                 colour, width)  # fmt: skip


def _outline(places: NDArray[np.float64]) -> list[tuple[float, float]]:
    """Return the convex line around all places ``(n, 2)`` at some distance."""
    turn = np.linspace(0.0, math.tau, 24, endpoint=False)
    ring = _ROOM_PX * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = (places[:, None] + ring).reshape(-1, 2)
    return [(float(x), float(y)) for x, y in points[ConvexHull(points).vertices]]


def _label(pen: Pen, frame: Frame, edge: Sequence[tuple[float, float]], words: str) -> None:
    """Write above the outline, or below where there is no room, and within the picture's sides."""
    half = pen.width(words, 13) / 2
    top, bottom = min(edge, key=lambda point: point[1]), max(edge, key=lambda point: point[1])
    x, y = (top[0], top[1] - 9) if top[1] > 20 else (bottom[0], bottom[1] + 9)
    pen.text(min(max(x, half + 4), max(frame.width - half - 4, half + 4)), y, words, 13, anchor="mm", halo=True)
