"""Pieces: stations that are tied to each other, each piece in axes of its own.

What registration found and what common walls say are both ties, relative, so a piece can be moved, or joined to
another, without losing what it knows.  All its ties are adjusted together whenever it grows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.compass import wrap
from mapping.graph import Compass, Solution, Tie, derived, parts, put_at, seen_from, solve
from mapping.refine import Wall, bond, wall_of
from mapping.sight import Sight, rise_m
from mapping.values import Pose

NO_COMPASS_SD_RAD = 1e3
"""A compass that is not there says nothing."""
LEVEL_M = 0.5
"""Scans whose depths differ by more see other walls: wells taper."""
NEIGHBOURS = 8
"""A station is held by the walls it shares with so many of those nearest to it ..."""
PAIR_M = 8.0
"""... no farther away than this."""
SURE_M = 0.15
"""Where two stations lie to each other less surely, their walls may be taken for others."""
STALE_M, STALE_RAD = 0.05, math.radians(1.0)
"""A bond is made anew where its stations moved against each other by so much."""
TRUST = 0.6
"""What the information of common walls is worth: their errors are not independent from pair to pair."""
DOUBT_M, DOUBT_RAD = 0.2, math.radians(3.0)
"""Where registration is less sure than this, common walls are no surer than it; where it is surer, they are more so."""
ROUNDS = 3

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Bond:
    """A pair's walls, compared at ``at``: a tie, or none."""

    at: Pose
    tie: Tie | None


class Pieces:
    """Which scans hold together, and where each is in its piece."""

    def __init__(self, compass_sd_rad: float, beam_rad: float) -> None:
        self._compass_sd_rad, self._beam_rad = compass_sd_rad, beam_rad
        self._sights: dict[int, Sight] = {}
        self._walls: dict[int, Wall] = {}
        self._poses: dict[int, Pose] = {}
        self._found: list[Tie] = []
        self._bonds: dict[tuple[int, int], _Bond] = {}
        self._doubts: dict[int, Floats] = {}
        self._solutions: dict[int, Solution] = {}

    @property
    def all(self) -> list[tuple[int, ...]]:
        """The stations of each piece in the order of their scans; the pieces by their first."""
        return [self._solutions[first].stations for first in sorted(self._solutions)]

    def of(self, i: int) -> tuple[int, ...]:
        """Give the stations of the piece that holds a station; none where it is in no piece."""
        return next((s.stations for s in self._solutions.values() if i in s.stations), ())

    def pose(self, i: int) -> Pose:
        """Give the pose of a station in the axes of its piece."""
        return self._poses[i]

    def sight(self, i: int) -> Sight:
        """Give what a station saw."""
        return self._sights[i]

    def solution(self, i: int) -> Solution:
        """Poses and covariances of the piece that holds a station."""
        return next(s for s in self._solutions.values() if i in s.stations)

    def begin(self, i: int, sight: Sight, pose: Pose) -> None:
        """Begin a piece with a station."""
        self._sights[i], self._walls[i], self._poses[i] = sight, wall_of(sight.view.points, self._beam_rad), pose
        self._settle((i,))

    def grow(self, i: int, sight: Sight, base: int, pose: Pose, covariance: Floats) -> None:
        """Add a station to the piece of ``base``, where registration found it with a ``covariance`` ``(3, 3)``."""
        self._sights[i], self._walls[i], self._poses[i] = sight, wall_of(sight.view.points, self._beam_rad), pose
        self._doubts[i] = covariance
        self._found.append(tie_of(base, self._poses[base], i, pose, covariance))
        self._settle((*self.of(base), i))

    def close(self, one: int, other: int, pose: Pose, covariance: Floats) -> None:
        """Tie two stations, so that their pieces become one; ``pose`` of ``other`` is in the piece of ``one``."""
        held, moved = self.of(one), self.of(other)
        self._found.append(tie_of(one, self._poses[one], other, pose, covariance))
        if moved != held:
            at = self._poses[other]
            for k in moved:
                self._poses[k] = put_at(pose, seen_from(at, self._poses[k]))
        self._settle((*held, *(k for k in moved if k not in held)))

    def drop(self, i: int) -> None:
        """Leave a station out; what only it held together falls apart."""
        rest = [k for k in self.of(i) if k != i]
        self._found = [tie for tie in self._found if i not in (tie.one, tie.other)]
        self._bonds = {pair: known for pair, known in self._bonds.items() if i not in pair}
        for kept in (self._sights, self._walls, self._poses, self._doubts):
            kept.pop(i, None)
        self._solutions = {k: s for k, s in self._solutions.items() if i not in s.stations}
        for part in parts(rest, self._ties(rest)):
            self._settle(part)

    def _settle(self, members: Sequence[int]) -> None:
        """Adjust a piece: what is known first, then with the walls that its stations are found to share."""
        stations = sorted(members)
        heading = {k: self._sights[k].scan.heading_rad for k in stations}
        sd_rad = self._compass_sd_rad if all(self._sights[k].scan.has_compass for k in stations) else NO_COMPASS_SD_RAD
        for _ in range(ROUNDS):
            poses = {k: self._poses[k] for k in stations}
            solution = solve(poses, self._ties(stations), Compass(heading, sd_rad))
            self._poses.update(zip(solution.stations, solution.poses, strict=True))
            if not self._compare(solution):
                break
        self._solutions = {k: s for k, s in self._solutions.items() if not set(stations) & set(s.stations)}
        self._solutions[stations[0]] = solution

    def _ties(self, stations: Sequence[int]) -> list[Tie]:
        inside = set(stations)
        bonds = [self._bonds[pair].tie for pair in sorted(self._bonds) if inside.issuperset(pair)]
        return [t for t in self._found if t.one in inside and t.other in inside] + [t for t in bonds if t is not None]

    def _compare(self, solution: Solution) -> bool:
        """Compare the walls of neighbours that were not, or not as they now lie; tell whether any were."""
        fresh = [pair for pair in self._pairs(solution) if self._is_stale(pair) and _is_sure(solution, *pair)]
        for one, other in fresh:
            at = seen_from(self._poses[one], self._poses[other])
            tie = bond((one, self._walls[one]), (other, self._walls[other]), at)
            self._bonds[one, other] = _Bond(at, None if tie is None else self._sobered(tie))
        return bool(fresh)

    def _pairs(self, solution: Solution) -> list[tuple[int, int]]:
        """Each station with those nearest to it, on its own level."""
        stations = solution.stations
        xy = np.array([[p.x_m, p.y_m] for p in solution.poses])
        apart = np.hypot(*(xy[:, None, :] - xy[None, :, :]).transpose(2, 0, 1))
        pairs = set()
        for row, one in enumerate(stations):
            near = [k for k in np.argsort(apart[row], kind="stable") if k != row and apart[row, k] <= PAIR_M]
            for k in near[:NEIGHBOURS]:
                other = stations[int(k)]
                if rise_m(self._sights[one].scan, self._sights[other].scan) <= LEVEL_M:
                    pairs.add((min(one, other), max(one, other)))
        return sorted(pairs)

    def _is_stale(self, pair: tuple[int, int]) -> bool:
        known = self._bonds.get(pair)
        if known is None:
            return True
        seen = seen_from(*(self._poses[k] for k in pair))
        moved = math.hypot(seen.x_m - known.at.x_m, seen.y_m - known.at.y_m)
        return moved > STALE_M or abs(wrap(seen.heading_rad - known.at.heading_rad)) > STALE_RAD

    def _sobered(self, tie: Tie) -> Tie:
        """Take a bond for no surer than the registration of its later station: walls repeat, and so do roughnesses."""
        information = TRUST * tie.information
        doubt = self._doubts.get(max(tie.one, tie.other))
        if doubt is not None:
            c, s = math.cos(self._poses[tie.one].heading_rad), math.sin(self._poses[tie.one].heading_rad)
            turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            information = limited(information, turn @ doubt @ turn.T)
        return Tie(tie.one, tie.other, tie.pose, information)


def tie_of(one: int, at: Pose, other: int, pose: Pose, covariance: Floats) -> Tie:
    """Tie a station to another, of which it is known where it is in the map, and its covariance there."""
    seen = seen_from(at, pose)
    _, by = derived(seen, at)
    information = np.linalg.inv(by @ covariance @ by.T)
    return Tie(one, other, seen, 0.5 * (information + information.T))


def limited(information: Floats, doubt: Floats) -> Floats:
    """Limit an information ``(3, 3)``, in every direction, by the covariance that a registration has."""
    variance, axes = np.linalg.eigh(doubt[:2, :2])
    sharper = np.zeros((3, 3))
    sharper[:2, :2] = axes @ np.diag(np.minimum(np.sqrt(variance) / DOUBT_M, 1.0)) @ axes.T
    sharper[2, 2] = min(math.sqrt(float(doubt[2, 2])) / DOUBT_RAD, 1.0)
    root = np.linalg.cholesky(sharper @ doubt @ sharper)
    value, vector = np.linalg.eigh(root.T @ information @ root)
    back = np.linalg.solve(root.T, vector)
    return np.asarray(back @ np.diag(np.minimum(value, 1.0)) @ back.T, dtype=np.float64)


def sd_m(covariance: Floats) -> float:
    """Largest standard deviation of a place in any direction."""
    return math.sqrt(max(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]), 0.0))


def _is_sure(solution: Solution, one: int, other: int) -> bool:
    return sd_m(solution.between(one, other)) <= SURE_M
