"""A made-up site: a keyhole-shaped cistern with a pillar and two holes, and what a daemon would say of it."""

from __future__ import annotations

import math
import time
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daemon import snapshots
from daemon.snapshots import Snapshot
from drivers.readings import HeadSettings, Ping
from fill.values import ASSUMED, FILLED, MEASURED, Filled, Hole, Mesh
from mapping.values import FREE, OCCUPIED, Grid, Outline, Pose, Scan, Station

CELL_M: Final = 0.05
CORNERS_M: Final = np.array([(-3, -2), (3, -2), (3, 0), (6, 0), (6, 1.2), (3, 1.2), (3, 3), (-1, 3.6), (-3, 2.5)])
PILLAR_M: Final = (0.8, 0.6, 0.35)
GAPS_M: Final = ((4.1, 0.0, 0.45, 0.9), (-2.0, 3.1, 0.4, 0.35))
"""Where the wall was not seen: x, y, half width, certainty of the fill."""
X0_M, Y0_M, ROWS, COLS = -4.0, -3.0, 160, 220
RANGE_M, BINS, STEP_DEG = 8.0, 400, 1.8
PLACES_M: Final = ((0.0, 0.0), (-1.6, 1.2), (1.6, 1.9), (4.6, 0.55))
PIECE_M: Final = ((4.4, 2.4), (5.6, 2.8))
"""Where two scans that hold together are guessed to lie."""
PIECE_WALL_Y_M: Final = 4.2


def walls() -> NDArray[np.float64]:
    """Wall segments (n, 4): x and y of both ends, m."""
    angles = np.linspace(0, math.tau, 25)
    x, y, radius = PILLAR_M
    pillar = np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=1)
    loops = [np.vstack([CORNERS_M, CORNERS_M[:1]]), pillar]
    return np.vstack([np.hstack([loop[:-1], loop[1:]]) for loop in loops]).astype(np.float64)


def beam(x_m: float, y_m: float, direction_rad: float) -> float:
    """Range to the first wall, m."""
    ax, ay, bx, by = walls().T
    dx, dy = math.sin(direction_rad), math.cos(direction_rad)
    ex, ey = bx - ax, by - ay
    cross = dx * ey - dy * ex
    with np.errstate(divide="ignore", invalid="ignore"):
        far = ((ax - x_m) * ey - (ay - y_m) * ex) / cross
        along = ((ax - x_m) * dy - (ay - y_m) * dx) / cross
    far = far[(along >= 0) & (along <= 1) & (far > 0)]
    return float(far.min()) if len(far) else math.inf


def ping(number: int, rng: np.random.Generator, place_m: tuple[float, float] = PLACES_M[0]) -> Snapshot:
    """The beam of this number: the head turns by its step, the vehicle yaws a little."""
    bearing = math.radians(number * STEP_DEG % 360)
    heading = math.radians(42 + 5 * math.sin(number / 60))
    ranges = (np.arange(BINS) + 0.5) * RANGE_M / BINS
    far = beam(*place_m, heading + bearing)
    level = (
        150 * np.exp(-(((ranges - far) / 0.09) ** 2))
        + 40 * np.exp(-ranges / 0.3)
        + 26 * (ranges > far) / (1 + ranges - far)
    )
    echoes = np.clip(level + rng.rayleigh(14, BINS), 0, 255).astype(np.uint8)
    head = HeadSettings(RANGE_M, 45.0, 0.0, 80.0, math.radians(STEP_DEG), True, 0.0, 0.0, True)
    reading = Ping(number * 25_000_000, bearing, RANGE_M / BINS, echoes, head)
    return snapshots.ping(reading, time.time_ns(), heading, 1.37)


def grid() -> tuple[Grid, NDArray[np.bool_], NDArray[np.float64]]:
    """The evidence, the wall cells that were not seen, and their certainty."""
    x = X0_M + (np.arange(COLS) + 0.5) * CELL_M
    y = Y0_M + (np.arange(ROWS) + 0.5) * CELL_M
    xs, ys = np.meshgrid(x, y)
    inside = np.zeros(xs.shape, bool)
    for (ax, ay), (bx, by) in zip(CORNERS_M, np.roll(CORNERS_M, -1, axis=0), strict=True):
        with np.errstate(divide="ignore", invalid="ignore"):
            inside ^= ((ay > ys) != (by > ys)) & (xs < (bx - ax) * (ys - ay) / (by - ay) + ax)
    away = np.hypot(xs - PILLAR_M[0], ys - PILLAR_M[1]) - PILLAR_M[2]
    near = np.full(xs.shape, np.inf)
    for ax, ay, bx, by in walls()[: len(CORNERS_M)]:
        t = np.clip(((xs - ax) * (bx - ax) + (ys - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2), 0, 1)
        near = np.minimum(near, np.hypot(xs - ax - t * (bx - ax), ys - ay - t * (by - ay)))
    wall = (near < 0.055) | (np.abs(away) < 0.055)
    unseen, certainty = np.zeros(xs.shape, bool), np.zeros(xs.shape)
    for gx, gy, half, sure in GAPS_M:
        here = wall & (np.hypot(xs - gx, ys - gy) < half)
        unseen |= here
        certainty[here] = sure * (0.7 + 0.3 * np.hypot(xs - gx, ys - gy)[here] / half)
    state = np.zeros(xs.shape, np.uint8)
    state[inside & (away > 0)] = FREE
    state[wall] = OCCUPIED
    state[unseen] = 0
    odds = np.array([0.0, -2.2, 3.0], np.float32)[state]
    return Grid(CELL_M, X0_M, Y0_M, odds, state), unseen, certainty


def filled(evidence: Grid, unseen: NDArray[np.bool_], certainty: NDArray[np.float64]) -> Filled:
    """Both holes with their certainty."""
    index = np.full(unseen.shape, -1, np.int32)
    holes = []
    for number, (gx, gy, half, sure) in enumerate(GAPS_M):
        rows, cols = np.nonzero(unseen)
        here = np.hypot(X0_M + cols * CELL_M - gx, Y0_M + rows * CELL_M - gy) < half + 0.2
        cells = np.stack([rows[here], cols[here]], axis=1).astype(np.int32)
        index[cells[:, 0], cells[:, 1]] = number
        ends = np.array([[gx - half, gy], [gx + half, gy]])
        why = "both walls are straight and in line" if number == 0 else "the walls meet at an angle nobody has seen"
        holes.append(
            Hole(
                number, cells, certainty[cells[:, 0], cells[:, 1]].astype(np.float32), sure, ends, 2 * half, "line", why
            )
        )
    open_ends = np.array([[6.0, 0.6]])
    return Filled(evidence, tuple(holes), certainty.astype(np.float32), index, open_ends)


def mesh() -> Mesh:
    """Walls from the ceiling (0.2 m) to the floor (2.6 m), and a floor."""
    vertices: list[tuple[float, float, float]] = []
    kinds: list[int] = []
    sure: list[float] = []
    triangles: list[tuple[int, int, int]] = []
    for ax, ay, bx, by in walls():
        steps = max(1, round(math.hypot(bx - ax, by - ay) / 0.2))
        for s in range(steps):
            x, y = np.linspace(ax, bx, steps + 1)[s : s + 2], np.linspace(ay, by, steps + 1)[s : s + 2]
            gap = [g for g in GAPS_M if math.hypot(x.mean() - g[0], y.mean() - g[1]) < g[2]]
            first = len(vertices)
            vertices += [(x[0], y[0], 0.2), (x[1], y[1], 0.2), (x[1], y[1], 2.6), (x[0], y[0], 2.6)]
            kinds += [FILLED if gap else MEASURED] * 4
            sure += [gap[0][3] if gap else 1.0] * 4
            triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    first = len(vertices)
    vertices += [(x, y, 2.6) for x, y in CORNERS_M]
    kinds += [ASSUMED] * len(CORNERS_M)
    sure += [0.4] * len(CORNERS_M)
    fan = [(0, 1, 2), (0, 2, 6), (2, 3, 4), (2, 4, 5), (0, 6, 7), (0, 7, 8), (2, 5, 6)]
    triangles += [(first + a, first + b, first + c) for a, b, c in fan]
    return Mesh(
        np.array(vertices, np.float32),
        np.array(triangles, np.uint32),
        np.array(kinds, np.uint8),
        np.array(sure, np.float32),
    )


def stations() -> list[Station]:
    """Four in the map, of which one is doubtful; one that could not be placed; two of a piece that floats."""
    said = [
        ("placed", 0.0, ""),
        ("placed", 0.06, ""),
        ("placed", 0.09, ""),
        ("doubtful", 0.3, "the corridor looks alike along east"),
    ]
    found = []
    for index, ((x, y), (status, sd, why)) in enumerate(zip(PLACES_M, said, strict=True)):
        cov = np.diag([(sd * 2) ** 2, sd**2, math.radians(2) ** 2])
        cov[0, 1] = cov[1, 0] = 0.6 * sd * sd
        heading = math.radians(42 + 30 * index)
        found.append(Station(_scan(index, heading), Pose(x, y, heading), cov, status, 0, 9.0, why))  # type: ignore[arg-type]
    lost = np.diag([4.0, 4.0, 1.0])
    why = "two places fit equally well, 3.1 m apart along 090°: move nearer to station 2 and scan again"
    found.append(Station(_scan(4), Pose(-2.2, -1.2, 0.0), lost, "unplaced", 5, 0.4, why))
    for index, (x, y) in zip((5, 6), PIECE_M, strict=True):
        why = "fits its piece of 2 scans, which nothing ties to the map yet"
        found.append(Station(_scan(index), Pose(x, y, 1.2), np.diag([0.01, 0.01, 0.001]), "unplaced", 6, 9.0, why))
    return found


def outlines() -> list[Outline]:
    """A straight wall north of the two that float, as the first of them saw it."""
    x_m = np.linspace(4.0, 6.0, 40)
    return [Outline(5, 6, np.stack([x_m, np.full(40, PIECE_WALL_Y_M)], axis=1).astype(np.float32))]


def _scan(index: int, heading_rad: float = 0.7) -> Scan:
    empty = np.zeros(0)
    return Scan(
        index,
        index * 10**10,
        index * 10**10 + 1,
        heading_rad,
        1.37,
        empty,
        np.zeros((0, 0), np.uint8),
        0.02,
        0.03,
        "full",
    )
