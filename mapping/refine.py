"""Stations together: the least squares over pairs of stations that see the same walls.

Each wall point of one station is drawn to the wall of another, along that wall's normal; robust weights let go of
what only one of them saw.  Held stations give the frame; headings stay near what the registration found, because a
round wall does not tell them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mapping.compass import wrap
from mapping.register import POINTS_A_WITNESS, WITNESSES
from mapping.values import Pose
from mapping.view import Points, from_map, to_map

ROUNDS = 6
NEAR_M = 0.3
"""A point farther than this from a wall is not of it."""
SIGMA_M = 0.05
ROBUST_M = 0.1
"""Scale of the Cauchy weights."""
PARALLEL = math.cos(math.radians(30.0))
PAIR_M = 8.0
"""Stations farther apart than this are not compared."""
FEW_PAIRS = 15
"""Fewer common points than this hold nothing."""
SETTLED_M = 1e-3
LOOSE = 1.0
"""Weight of a place, 1 / m2, that keeps the equations solvable."""
FAR_M = 0.25
"""A refinement that moves a station farther than this is no refinement."""


@dataclass(frozen=True, slots=True)
class Member:
    """A station in the adjustment; stations of another level see other walls, a held one does not move."""

    pose: Pose
    points: Points
    heading_sd_rad: float
    level: int
    held: bool


@dataclass(frozen=True, slots=True)
class _Bond:
    """Common points of two stations: residuals ``(m,)`` and their derivatives by both poses ``(m, 3)``."""

    residual: NDArray[np.float64]
    of_one: NDArray[np.float64]
    of_other: NDArray[np.float64]
    weight: NDArray[np.float64]


def refine(members: list[Member]) -> list[Pose]:
    """Adjust the poses of all stations that are not held; unchanged where the adjustment runs away."""
    trees = [cKDTree(m.points.xy_m) for m in members]
    poses = [m.pose for m in members]
    if all(m.held for m in members):
        return poses
    for _ in range(ROUNDS):
        step = _solve(members, trees, poses)
        poses = [
            Pose(p.x_m + float(s[0]), p.y_m + float(s[1]), (p.heading_rad + float(s[2])) % (2.0 * math.pi))
            for p, s in zip(poses, step, strict=True)
        ]
        if np.abs(step).max() < SETTLED_M:
            break
    moved = [math.hypot(p.x_m - m.pose.x_m, p.y_m - m.pose.y_m) for p, m in zip(poses, members, strict=True)]
    return [m.pose for m in members] if max(moved) > FAR_M else poses


def _solve(members: list[Member], trees: Sequence[cKDTree], poses: list[Pose]) -> NDArray[np.float64]:
    """Make one step of Gauss and Newton, ``(n, 3)``, zero for held stations."""
    n = len(members)
    normal, right = np.zeros((n, 3, n, 3)), np.zeros((n, 3))
    for i, j in permutations(range(n), 2):
        bond = _bond(members[i], poses[i], members[j], poses[j], trees[j])
        if bond is None:
            continue
        for a, of_a in ((i, bond.of_one), (j, bond.of_other)):
            right[a] -= of_a.T @ (bond.weight * bond.residual)
            for b, of_b in ((i, bond.of_one), (j, bond.of_other)):
                normal[a, :, b, :] += (of_a * bond.weight[:, None]).T @ of_b
    for i, (member, pose) in enumerate(zip(members, poses, strict=True)):
        trust = 1.0 / member.heading_sd_rad**2
        normal[i, :, i, :] += np.diag([LOOSE, LOOSE, trust])
        right[i, 2] -= wrap(pose.heading_rad - member.pose.heading_rad) * trust
    free = np.flatnonzero(np.repeat([not m.held for m in members], 3))
    step = np.zeros(3 * n)
    step[free] = np.linalg.solve(normal.reshape(3 * n, 3 * n)[np.ix_(free, free)], right.reshape(-1)[free])
    return step.reshape(n, 3)


def _bond(one: Member, pose: Pose, other: Member, other_pose: Pose, tree: cKDTree) -> _Bond | None:
    """Draw the points of one station to the walls of another."""
    apart = math.hypot(pose.x_m - other_pose.x_m, pose.y_m - other_pose.y_m)
    if one.level != other.level or apart > PAIR_M or (one.held and other.held):
        return None
    xy = to_map(pose, one.points.xy_m)
    distance, nearest = tree.query(from_map(other_pose, xy), distance_upper_bound=NEAR_M)
    nearest = np.where(np.isfinite(distance), nearest, 0)
    angle = other.points.normal_rad[nearest] - other_pose.heading_rad
    own = one.points.normal_rad - pose.heading_rad
    common = np.isfinite(distance) & (np.nan_to_num(np.abs(np.cos(angle - own))) > PARALLEL)
    if int(common.sum()) < FEW_PAIRS:
        return None
    p, a = xy[common], angle[common]
    n = np.stack([np.cos(a), np.sin(a)], axis=1)
    wall = to_map(other_pose, other.points.xy_m[nearest[common]])
    residual = ((p - wall) * n).sum(axis=1)
    trust = one.points.trust[common] * other.points.trust[nearest[common]]
    few = min(1.0 / POINTS_A_WITNESS, WITNESSES / max(float(trust.sum()), 1.0))
    weight = few * trust / (SIGMA_M**2 * (1.0 + (residual / ROBUST_M) ** 2))
    return _Bond(residual, _by_pose(p, pose, n), -_by_pose(p, other_pose, n), weight)


def _by_pose(xy: NDArray[np.float64], pose: Pose, n: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derive places along normals by a pose: a turn clockwise moves (x, y) by (y, -x)."""
    dx, dy = xy[:, 0] - pose.x_m, xy[:, 1] - pose.y_m
    return np.column_stack([n, n[:, 0] * dy - n[:, 1] * dx])
