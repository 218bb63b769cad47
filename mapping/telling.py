"""What is told of the stations: the largest piece as the map, and every other where, as a guess, it may lie."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from config.schema import Map
from mapping.graph import put_at, seen_from
from mapping.pieces import Pieces
from mapping.values import Outline, Pose, Station
from mapping.verdict import origin
from mapping.view import to_map


@dataclass(frozen=True, slots=True)
class Guess:
    """Where the first scan of a piece may lie: its pose in the axes of a station that came before."""

    base: int
    seen: Pose


def largest(pieces: Pieces, before: Sequence[int]) -> tuple[int, ...]:
    """Choose the piece that is the map: the largest, or of several the one that was the map ``before``."""
    held = set(before)
    return max(pieces.all, key=lambda p: (len(p), len(held & set(p)), -p[0]), default=())


def told(
    pieces: Pieces, judged: Sequence[Station], guesses: Mapping[int, Guess], the_map: tuple[int, ...], config: Map
) -> tuple[Station, ...]:
    """Tell all stations, in the order of their scans."""
    stations = dict(enumerate(judged))
    for piece in sorted(pieces.all, key=lambda p: (p != the_map, p[0])):
        guess = guesses.get(piece[0])
        # A piece that began where it fitted badly has axes as wrong: north is what the compass said at its first.
        at = Pose(0.0, 0.0, judged[piece[0]].scan.heading_rad)
        if piece != the_map and guess is not None and pieces.of(guess.base):
            at = put_at(stations[guess.base].pose, guess.seen)
        number = 0 if piece == the_map else judged[piece[0]].scan.index + 1
        stations.update(_of_piece(pieces, judged, piece, number, at))
        if not number:
            begin = replace(stations[piece[0]], covariance=origin(judged[piece[0]].scan, config).covariance)
            stations[piece[0]] = begin
    return tuple(stations[k] for k in range(len(judged)))


def outlines(stations: Sequence[Station], points_m: Sequence[NDArray[np.float64]]) -> tuple[Outline, ...]:
    """Put the wall points ``(n, 2)`` of scans that hold together, but float, where their piece is told to lie.

    A scan that holds to no other shows nothing: its own place is the guess then, not that of a piece.
    """
    alive = Counter(each.piece for each in stations if each.status != "dropped")
    return tuple(
        Outline(each.scan.index, each.piece, to_map(each.pose, xy_m).astype(np.float32))
        for each, xy_m in zip(stations, points_m, strict=True)
        if each.piece and each.status != "dropped" and alive[each.piece] > 1
    )


def _of_piece(
    pieces: Pieces, judged: Sequence[Station], piece: tuple[int, ...], number: int, at: Pose
) -> dict[int, Station]:
    """Tell the stations of a piece whose first is at a pose."""
    first, solution = pieces.pose(piece[0]), pieces.solution(piece[0])
    if number and len(piece) == 1:
        alone = judged[piece[0]]
        status = "doubtful" if alone.status == "placed" else alone.status
        return {piece[0]: replace(alone, pose=at, status=status, piece=number)}
    stations = {}
    for k in piece:
        pose = put_at(at, seen_from(first, pieces.pose(k)))
        station = replace(judged[k], pose=pose, covariance=solution.stated(k), piece=number)
        if number:
            why = f"fits its piece of {len(piece)} scans, which nothing ties to the map yet; go back to the map"
            station = replace(station, status="unplaced", why=why)
        elif station.status != "placed":
            station = replace(station, status="placed", why="placed with its piece, which other scans tie to the map")
        stations[k] = station
    return stations
