"""The graph of stations: what ties one station to another, and the poses that suit all ties together.

A tie tells where one station is in the axes of another, and how surely.  All ties of a piece go into one weighted
least squares, with robust weights that let go of a tie which the others deny; the covariance of every station,
relative to the piece's first, comes from the joint information, so it grows along a chain and shrinks where a loop
closes.  After Lu and Milios 1997; the unknowns are few per station and the ties few, so the equations are sparse.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from mapping.compass import SHARES, waves_of, wrap
from mapping.values import Pose
from mapping.view import from_map, to_map

ROUNDS = 8
SETTLED = 1e-4
"""Metres and radians."""
ROBUST = 3.0
"""Scale of the Cauchy weights of ties and of the compass, in standard deviations."""
LOOSE = 1e-4
"""Information that keeps the equations solvable: 100 m, and as many radians."""

Floats = NDArray[np.float64]


SWAY_RAD = math.radians(0.5)
"""Heading of a scan against that of its walls: a vehicle at rest sways, and a scan has one heading."""
NOISE = 0.25
"""How far a compass strays from its curve, in standard deviations of its error."""
SCALE = 0.01
"""All ranges may be too long or too short by this share, with the speed of sound: no tie between stations tells."""


@dataclass(frozen=True, slots=True)
class Tie:
    """Where station ``other`` is in the axes of station ``one`` (x right, y ahead), and its ``(3, 3)`` information."""

    one: int
    other: int
    pose: Pose
    information: Floats


@dataclass(frozen=True, slots=True)
class Compass:
    """What the compass said at each station, clockwise from its own north, and how far it is to be trusted.

    Its error goes with the heading, by the curve of `mapping.swing`: stations of one heading share it.
    """

    heading_rad: Mapping[int, float]
    sd_rad: float


@dataclass(frozen=True, slots=True)
class Solution:
    """Poses of ``stations`` and their joint covariance ``(3 n, 3 n)`` about the first, over x_m, y_m, heading_rad."""

    stations: tuple[int, ...]
    poses: tuple[Pose, ...]
    covariance: Floats

    def of(self, station: int) -> Floats:
        """Covariance ``(3, 3)`` of one station about the first."""
        at = 3 * self.stations.index(station)
        return self.covariance[at : at + 3, at : at + 3]

    def stated(self, station: int) -> Floats:
        """Covariance ``(3, 3)`` of one station about the first, with what no tie tells: sway, and the scale of all."""
        first, pose = self.poses[0], self.poses[self.stations.index(station)]
        dx, dy = pose.x_m - first.x_m, pose.y_m - first.y_m
        swayed, scaled = np.array([dy, -dx, 1.0]) * SWAY_RAD, np.array([dx, dy, 0.0]) * SCALE
        own = np.diag([0.0, 0.0, SWAY_RAD**2])
        return np.asarray(self.of(station) + np.outer(swayed, swayed) + np.outer(scaled, scaled) + own)

    def between(self, one: int, other: int) -> Floats:
        """Covariance ``(3, 3)`` of the pose of ``other`` in the axes of ``one``."""
        a, b = (self.stations.index(k) for k in (one, other))
        by = np.concatenate(derived(seen_from(self.poses[a], self.poses[b]), self.poses[a]), axis=1)
        at = np.r_[3 * a : 3 * a + 3, 3 * b : 3 * b + 3]
        return np.asarray(by @ self.covariance[np.ix_(at, at)] @ by.T, dtype=np.float64)


def seen_from(one: Pose, other: Pose) -> Pose:
    """Tell a pose of the map in the axes of another."""
    x, y = from_map(one, np.array([[other.x_m, other.y_m]]))[0]
    return Pose(float(x), float(y), wrap(other.heading_rad - one.heading_rad))


def put_at(one: Pose, seen: Pose) -> Pose:
    """Tell in the map a pose that was told in the axes of another."""
    x, y = to_map(one, np.array([[seen.x_m, seen.y_m]]))[0]
    return Pose(float(x), float(y), (one.heading_rad + seen.heading_rad) % (2.0 * math.pi))


def derived(seen: Pose, one: Pose) -> tuple[Floats, Floats]:
    """Derive a pose told in the axes of ``one`` by ``one`` and by itself in the map, ``(3, 3)`` each."""
    c, s = math.cos(one.heading_rad), math.sin(one.heading_rad)
    by_other = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    by_one = -by_other.copy()
    by_one[:2, 2] = (-seen.y_m, seen.x_m)
    return by_one, by_other


def solve(poses: Mapping[int, Pose], ties: Sequence[Tie], compass: Compass) -> Solution:
    """Adjust all poses of a piece to its ties; the first station (in the mapping's order) stays."""
    stations = tuple(poses)
    place = {k: i for i, k in enumerate(stations)}
    at = np.array([[place[tie.one], place[tie.other]] for tie in ties], dtype=np.intp).reshape(-1, 2)
    told = np.array([compass.heading_rad[k] for k in stations])
    start = np.array([[p.x_m, p.y_m, p.heading_rad] for p in poses.values()])
    state, waves = start.copy(), np.zeros(len(SHARES))
    for _ in range(ROUNDS):
        blocks, right = _of_ties(state, at, ties)
        normal, right = _equations(state, blocks, right, (told, waves, compass.sd_rad))
        right[: -len(waves)] += LOOSE * (start - state)[1:].ravel()
        step = splu(normal).solve(right)
        state[1:] += step[: -len(waves)].reshape(-1, 3)
        waves += step[-len(waves) :]
        if np.abs(step).max() < SETTLED:
            break
    normal, _ = _equations(state, *_of_ties(state, at, ties), (told, waves, compass.sd_rad))
    covariance = np.zeros((3 * len(stations), 3 * len(stations)))
    inverse = splu(normal).solve(np.eye(normal.shape[0]))[: -len(waves), : -len(waves)]
    covariance[3:, 3:] = 0.5 * (inverse + inverse.T)
    solved = tuple(Pose(float(x), float(y), float(h) % (2.0 * math.pi)) for x, y, h in state)
    return Solution(stations, solved, covariance)


def _of_ties(state: Floats, at: NDArray[np.intp], ties: Sequence[Tie]) -> tuple[sparse.coo_array, Floats]:
    """Make the part of the ties in the normal equations, ``(3 n, 3 n)``, and their right side."""
    n = 3 * len(state)
    by, off = _linear(state, at, ties)
    information = np.array([tie.information for tie in ties]).reshape(-1, 3, 3)
    squared = np.einsum("ma,mab,mb->m", off, information, off)
    weighed = np.einsum("mai,mab->mib", by, information / (1.0 + squared / ROBUST**2)[:, None, None])
    columns = (3 * at[:, :, None] + np.arange(3)).reshape(-1, 6)
    rows = np.broadcast_to(columns[:, :, None], (len(ties), 6, 6))
    blocks = np.einsum("mib,mbj->mij", weighed, by)
    right = np.zeros(n)
    np.add.at(right, columns, -np.einsum("mib,mb->mi", weighed, off))
    return sparse.coo_array((blocks.ravel(), (rows.ravel(), rows.transpose(0, 2, 1).ravel())), shape=(n, n)), right


def _linear(state: Floats, at: NDArray[np.intp], ties: Sequence[Tie]) -> tuple[Floats, Floats]:
    """Derive all ties by both their stations, ``(m, 3, 6)``, and tell what is left of each, ``(m, 3)``."""
    one, other = state[at[:, 0]], state[at[:, 1]]
    c, s = np.cos(one[:, 2]), np.sin(one[:, 2])
    dx, dy = other[:, 0] - one[:, 0], other[:, 1] - one[:, 1]
    x, y = c * dx - s * dy, s * dx + c * dy
    told = np.array([[t.pose.x_m, t.pose.y_m, t.pose.heading_rad] for t in ties]).reshape(-1, 3)
    off = np.column_stack([x - told[:, 0], y - told[:, 1], _wrapped(other[:, 2] - one[:, 2] - told[:, 2])])
    by = np.zeros((len(ties), 3, 6))
    by[:, 0, 3], by[:, 0, 4], by[:, 1, 3], by[:, 1, 4], by[:, 2, 5] = c, -s, s, c, 1.0
    by[:, :, :3] = -by[:, :, 3:]
    by[:, 0, 2], by[:, 1, 2] = -y, x
    return by, off


def _equations(
    state: Floats, blocks: sparse.coo_array, right: Floats, compass: tuple[Floats, Floats, float]
) -> tuple[sparse.csc_array, Floats]:
    """Add what the compass says; unknown are all stations but the first, and last the waves of the compass's curve."""
    n = len(state)
    told, waves, sd_rad = compass
    by = waves_of(told)
    astray = _wrapped(state[:, 2] - told - by @ waves)
    noise_rad = NOISE * sd_rad
    trust = 1.0 / (noise_rad**2 * (1.0 + (astray / (ROBUST * noise_rad)) ** 2) ** 2)
    known = 1.0 / (sd_rad * np.array(SHARES)) ** 2
    known[0] = LOOSE
    turned, last = 3 * np.arange(n) + 2, 3 * n + np.arange(len(waves))
    weighed = by * trust[:, None]
    right = np.append(right, weighed.T @ astray - known * waves)
    right[turned] -= trust * astray
    rows, cols = np.repeat(turned, len(waves)), np.tile(last, n)
    inner = weighed.T @ by + np.diag(known)
    value = np.concatenate(
        [blocks.data, trust, -weighed.ravel(), -weighed.ravel(), inner.ravel(), np.full(3 * n, LOOSE)]
    )
    row = np.concatenate([blocks.coords[0], turned, rows, cols, np.repeat(last, len(waves)), np.arange(3 * n)])
    col = np.concatenate([blocks.coords[1], turned, cols, rows, np.tile(last, len(waves)), np.arange(3 * n)])
    whole = sparse.csc_array((value, (row, col)), shape=(3 * n + len(waves), 3 * n + len(waves)))
    return sparse.csc_array(whole[3:, 3:]), right[3:]


def _wrapped(angle_rad: Floats) -> Floats:
    return np.asarray((angle_rad + math.pi) % (2.0 * math.pi) - math.pi, dtype=np.float64)


def parts(stations: Sequence[int], ties: Sequence[Tie]) -> list[list[int]]:
    """Divide stations into those that ties connect, each part in order, the parts by their first."""
    root = {k: k for k in stations}

    def of(k: int) -> int:
        while root[k] != k:
            k = root[k]
        return k

    for tie in ties:
        if tie.one in root and tie.other in root:
            a, b = of(tie.one), of(tie.other)
            root[max(a, b)] = min(a, b)
    return [[k for k in stations if of(k) == first] for first in stations if of(first) == first]
