"""The path between two rests, by least squares: where the vehicle was at knots in time, so that walls agree.

A path has a state (x, y, error of the compass) at the first rest, at knots in time, and at the second rest.  Wall
points that were seen from it are marks; marks of different times that lie on one wall are bound along its normal.  The
vehicle begins and ends at rest, and nothing is known of its thrust: accelerations are white.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mapping.view import normals

KNOT_S = 0.5
ACCELERATION_M_S2 = 0.25
"""Standard deviation from knot to knot, ``KNOT_S`` apart."""
END_SPEED_M_S = 0.05
REST_M = 0.05
"""A scan is made from a mean place of its rest, and the way begins where the rest ended."""
COMPASS_RAD = math.radians(0.2)
"""The compass's error wanders by this in ``KNOT_S``, with iron nearby ..."""
DEVIATION = 0.07
"""... and by this share of what the vehicle turns on the way: it goes with the heading."""
SWAY_RAD = math.radians(0.5)
"""A scan has one heading, and a vehicle at rest sways."""
SIGMA_M = 0.03
"""Of a mark across its wall ..."""
ROBUST_M = 0.06
"""... with Cauchy weights of this scale."""
BESIDE_M = 0.1
"""A mark farther along the wall than this from the next one has none that it could be bound to."""
SQUARE = 0.5
"""Cosine of the incidence below which marks are drawn too near: they would travel with the vehicle."""
WITNESS = 0.25
"""Power of one mark: neighbours share their errors."""
HERE, THERE = 0, -1

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Marks:
    """Wall points as they were seen: ``arm_m`` ``(n, 2)`` from the vehicle, in axes of the compass.

    ``trust`` and ``normal_rad`` ``(n,)`` as in `mapping.view.Points`.  Each was seen between the states ``state`` and
    ``state + 1`` ``(n,)`` at ``share`` ``(n,)`` of the way from the one to the other.  ``group`` ``(n,)`` tells what
    was seen in one go: ``HERE`` the first rest, ``THERE`` the second one, from 1 on half turns of the way.
    """

    arm_m: Floats
    trust: Floats
    normal_rad: Floats
    state: Ints
    share: Floats
    group: Ints

    def places(self, path: Floats) -> tuple[Floats, Floats]:
        """Places ``(n, 2)`` of the marks along a path ``(states, 3)``, and their turned arms."""
        after = np.minimum(self.state + 1, len(path) - 1)
        at = path[self.state] + self.share[:, None] * (path[after] - path[self.state])
        c, s = np.cos(at[:, 2]), np.sin(at[:, 2])
        x, y = self.arm_m[:, 0], self.arm_m[:, 1]
        arm = np.stack([c * x + s * y, c * y - s * x], axis=1)
        return at[:, :2] + arm, arm

    def along(self, path: Floats) -> Marks:
        """Find the walls' normals anew where marks were seen under way, as they lie along a path."""
        places, _ = self.places(path)
        normal = self.normal_rad.copy()
        for group in range(1, int(self.group.max(initial=0)) + 1):
            of = self.group == group
            normal[of] = normals(places[of])
        return replace(self, normal_rad=normal)


@dataclass(frozen=True, slots=True)
class Bonds:
    """Pairs of marks ``one``, ``other`` ``(m,)`` on one wall, whose normal is ``normal`` ``(m, 2)``.

    ``off_m`` ``(m,)`` is how far the one lies off the other's wall.
    """

    one: Ints
    other: Ints
    normal: Floats
    off_m: Floats


def inertia(seconds: float, knots: int, turned_rad: float) -> Floats:
    """Information ``(3 states, 3 states)`` of how a vehicle moves: rests, accelerations and the compass.

    ``turned_rad`` is how far its headings at the two rests are apart.
    """
    dt = seconds / (knots - 1)
    count = knots + 2
    spread = ACCELERATION_M_S2 * dt**2 * math.sqrt(KNOT_S / dt)
    rows: list[tuple[dict[int, float], float]] = [({k - 1: 1.0, k: -2.0, k + 1: 1.0}, spread) for k in range(2, knots)]
    rows += [({k: -1.0, k + 1: 1.0}, END_SPEED_M_S * dt) for k in (1, knots - 1)]
    rows += [({k: -1.0, k + 1: 1.0}, REST_M) for k in (0, knots)]
    wander = math.hypot(COMPASS_RAD * math.sqrt(dt / KNOT_S), DEVIATION * turned_rad / math.sqrt(knots - 1))
    turns = [({k: -1.0, k + 1: 1.0}, wander if 0 < k < knots else SWAY_RAD) for k in range(count - 1)]
    information = np.zeros((count, 3, count, 3))
    for axis, of_axis in ((0, rows), (1, rows), (2, turns)):
        row = np.zeros((len(of_axis), count))
        for i, (terms, sd) in enumerate(of_axis):
            row[i, list(terms)] = np.array(list(terms.values())) / sd
        information[:, axis, :, axis] = row.T @ row
    return information.reshape(3 * count, 3 * count)


def bonds_of(marks: Marks, places: Floats, within_m: float) -> Bonds:
    """Bind each mark to the nearest one of every group that saw the same wall at another time."""
    ones, others = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)]
    for group in range(THERE, int(marks.group.max(initial=0)) + 1):
        of, after = np.flatnonzero(marks.group == group), np.flatnonzero(later(marks.group, group))
        if not len(of) or not len(after):
            continue
        distance, near = cKDTree(places[of]).query(places[after], distance_upper_bound=within_m)
        heard = np.flatnonzero(np.isfinite(distance))
        ones.append(after[heard])
        others.append(of[np.asarray(near, dtype=np.intp)[heard]])
    one: Ints = np.concatenate(ones)
    other: Ints = np.concatenate(others)
    angle = marks.normal_rad[other]
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    apart = places[one] - places[other]
    beside = np.abs(apart[:, 0] * normal[:, 1] - apart[:, 1] * normal[:, 0]) < BESIDE_M
    square = np.minimum(_cosine(marks.arm_m[one], normal), _cosine(marks.arm_m[other], normal)) > SQUARE
    told = np.isfinite(angle) & beside & square
    return Bonds(one[told], other[told], normal[told], (apart * normal).sum(axis=1)[told])


def _cosine(arm_m: Floats, normal: Floats) -> Floats:
    """Cosine ``(m,)`` of the incidence at which marks on walls with such normals were seen."""
    along = np.abs((arm_m * normal).sum(axis=1))
    return np.asarray(along / np.maximum(np.hypot(arm_m[:, 0], arm_m[:, 1]), 1e-6), dtype=np.float64)


def later(group: Ints, than: int) -> NDArray[np.bool_]:
    """Tell what is bound to a group: all the way and the other rest to the rests, and to a go those after the next.

    Half a turn later the beams look elsewhere, and where they still meet the marks before, they are of one go.
    """
    if than == THERE:
        return np.asarray(group > HERE)
    if than == HERE:
        return np.asarray((group > HERE) | (group == THERE))
    return np.asarray(group > than + 1)


Pull = Callable[[Floats], tuple[Floats, Floats]]
"""Along a path ``(states, 3)``: what else is told of it, as information ``(3 states, 3 states)`` and its vector."""


def improve(
    path: Floats, marks: Marks, prior: Floats, within_m: float, rounds: int, pull: Pull | None = None
) -> tuple[Floats, Floats]:
    """Make steps of Gauss and Newton; give the path ``(states, 3)`` and the information ``(3 states, 3 states)``."""
    information = prior
    for _ in range(rounds):
        places, arms = marks.places(path)
        bonds = bonds_of(marks, places, within_m)
        trust = marks.trust[bonds.one] * marks.trust[bonds.other]
        weight = WITNESS * trust / (SIGMA_M**2 * (1.0 + (bonds.off_m / ROBUST_M) ** 2))
        rows = derived(marks, arms, bonds, len(path))
        information = prior + (rows * weight[:, None]).T @ rows
        right = prior @ path.ravel() + rows.T @ (weight * bonds.off_m)
        if pull is not None:
            more, by = pull(path)
            information, right = information + more, right + by
        step = np.zeros(path.size)
        step[3:] = np.linalg.solve(information[3:, 3:], right[3:])  # the first rest is the origin
        path = path - step.reshape(path.shape)
    return path, information


def derived(marks: Marks, arms: Floats, bonds: Bonds, states: int) -> Floats:
    """Derive how far bonds are off by the states, ``(m, 3 states)``: a turn clockwise moves (x, y) by (y, -x)."""
    count = len(bonds.one)
    rows = np.zeros((count, states, 3))
    at = np.arange(count)
    for side, sign in ((bonds.one, 1.0), (bonds.other, -1.0)):
        n, arm = bonds.normal, arms[side]
        by = sign * np.column_stack([n, n[:, 0] * arm[:, 1] - n[:, 1] * arm[:, 0]])
        state, share = marks.state[side], marks.share[side][:, None]
        rows[at, state] += (1.0 - share) * by
        rows[at, np.minimum(state + 1, states - 1)] += share * by
    return rows.reshape(count, 3 * states)
