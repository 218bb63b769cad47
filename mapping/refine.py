"""Two stations that see the same walls: where the one is in the axes of the other, from wall point to wall.

Each wall point of one station is drawn to the wall of the other, along that wall's normal, and the other way round;
robust weights let go of what only one of them saw.  The two faces of a thin wall are two walls: a normal points to
where its station stands.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mapping.graph import Tie
from mapping.values import Pose
from mapping.view import Points, from_map, to_map

ROUNDS = 5
NEAR_M = 0.3
"""A point farther than this from a wall is not of it."""
SIGMA_M = 0.05
WITNESSES, POINTS_A_WITNESS = 40.0, 2.5
"""Independent points of two whole scans at most, and how many returns share one error."""
ROBUST_M = 0.1
"""Scale of the Cauchy weights."""
PARALLEL = math.cos(math.radians(30.0))
FEW_PAIRS = 15
"""Fewer common points than this hold nothing."""
SETTLED_M = 1e-3
LOOSE = 1.0
"""Information, 1 / m2, with which a pose stays where nothing holds it."""
CROOKED = 0.03
"""Mean square by which normals of a straight wall err, rad2: so much of what holds across it seems to hold along."""
FAR_M = 0.25
"""A bond that moves a station farther than this is no bond."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Wall:
    """The wall points of a station that have a normal: places ``(n, 2)``, normals towards the station, trust."""

    xy_m: Floats
    normal_rad: Floats
    trust: Floats
    tree: cKDTree


def wall_of(points: Points, beam_rad: float) -> Wall:
    """Make a station's points ready: normals as angles of axes that turn counter-clockwise, towards the station.

    A beam of some width smears a wall that it meets aslant, and hears its nearer edge first: such points count less.
    """
    known = np.isfinite(points.normal_rad)
    xy, normal = points.xy_m[known], points.normal_rad[known]
    across = xy[:, 0] * np.cos(normal) + xy[:, 1] * np.sin(normal)
    along = xy[:, 1] * np.cos(normal) - xy[:, 0] * np.sin(normal)
    smeared = 1.0 / (1.0 + (0.5 * beam_rad * along / SIGMA_M) ** 2)
    return Wall(xy, np.where(across > 0.0, normal - math.pi, normal), points.trust[known] * smeared, cKDTree(xy))


def bond(one: tuple[int, Wall], other: tuple[int, Wall], start: Pose) -> Tie | None:
    """Tie ``other`` to ``one``, beginning where it is thought to be in its axes; None where they share too little."""
    pose, pull = start, LOOSE * np.eye(3)
    for _ in range(ROUNDS):
        common = _common(one[1], other[1], pose)
        if common is None:
            return None
        off = np.array([pose.x_m - start.x_m, pose.y_m - start.y_m, pose.heading_rad - start.heading_rad])
        step = np.linalg.solve(common[0] + pull, common[1] - pull @ off)
        pose = Pose(pose.x_m + float(step[0]), pose.y_m + float(step[1]), pose.heading_rad + float(step[2]))
        if float(np.abs(step).max()) < SETTLED_M:
            break
    common = _common(one[1], other[1], pose)
    if common is None or math.hypot(pose.x_m - start.x_m, pose.y_m - start.y_m) > FAR_M:
        return None
    return Tie(one[0], other[0], pose, _sober(common[0], common[2]))


def _common(one: Wall, other: Wall, pose: Pose) -> tuple[Floats, Floats, float] | None:
    """Make the normal equations of the pose of ``other`` by all common walls; last the weight of the points."""
    there, here = _drawn(to_map(pose, other.xy_m), other.normal_rad - pose.heading_rad, one)
    back, forth = _drawn(from_map(pose, one.xy_m), one.normal_rad + pose.heading_rad, other)
    p = to_map(pose, np.concatenate([other.xy_m[there], other.xy_m[forth]]))
    q = np.concatenate([one.xy_m[here], one.xy_m[back]])
    if len(p) < 2 * FEW_PAIRS:
        return None
    angle = np.concatenate([one.normal_rad[here], other.normal_rad[forth] - pose.heading_rad])
    trust = np.concatenate([one.trust[here] * other.trust[there], one.trust[back] * other.trust[forth]])
    n = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    residual = ((p - q) * n).sum(axis=1)
    few = min(0.5 / POINTS_A_WITNESS, WITNESSES / max(float(trust.sum()), 1.0))
    weight = few * trust / (SIGMA_M**2 * (1.0 + (residual / ROBUST_M) ** 2))
    dx, dy = p[:, 0] - pose.x_m, p[:, 1] - pose.y_m
    by = np.column_stack([n, n[:, 0] * dy - n[:, 1] * dx])  # a turn clockwise moves (x, y) by (y, -x)
    weighed = by * weight[:, None]
    return weighed.T @ by, -weighed.T @ residual, float(weight.sum())


def _drawn(xy_m: Floats, normal_rad: Floats, wall: Wall) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Points that lie on a wall, and the wall's points that they are drawn to, ``(m,)`` indices each."""
    found = wall.tree.query(xy_m, distance_upper_bound=NEAR_M)
    distance, nearest = np.asarray(found[0]), np.asarray(found[1], dtype=np.intp)
    of = np.flatnonzero(np.isfinite(distance))
    same = np.cos(wall.normal_rad[nearest[of]] - normal_rad[of]) > PARALLEL
    return of[same], nearest[of[same]]


def _sober(information: Floats, weight: float) -> Floats:
    """Take away what crooked normals feign: information along a straight wall."""
    less = information - CROOKED * weight * np.diag([1.0, 1.0, 0.0])
    value, vector = np.linalg.eigh(0.5 * (less + less.T))
    return np.asarray(vector @ np.diag(np.maximum(value, 0.0)) @ vector.T, dtype=np.float64)
