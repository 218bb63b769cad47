"""Rooms made for tests: walls as polygons, and the readings that a vehicle in them would give."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.readings import Depth, Heading, HeadSettings, Ping, Reading

STEP_RAD = math.radians(1.8)
PING_NS = 50_000_000
BIN_M = 0.02
BINS = 400

RECTANGLE = np.array([[-2.0, -3.0], [5.0, -3.0], [5.0, 2.5], [-2.0, 2.5]])
KEYHOLE = np.array(
    [
        *([-2.0, -2.0], [2.0, -2.0], [2.0, 1.0], [0.8, 1.0], [0.8, 4.0]),
        *([3.0, 4.0], [3.0, 6.0], [-0.6, 6.0], [-0.6, 1.0], [-2.0, 1.0]),
    ]
)
TUNNEL = np.array([[-40.0, -0.8], [40.0, -0.8], [40.0, 0.8], [-40.0, 0.8]])


@dataclass(frozen=True, slots=True)
class Stay:
    """Where the vehicle is, and for how many pings; it glides there in ``glide`` pings."""

    x_m: float
    y_m: float
    heading_rad: float
    pings: int
    glide: int = 0
    depth_m: float = 1.0


def settings(step_rad: float = STEP_RAD) -> HeadSettings:
    """Give the settings of a head that turns without end."""
    return HeadSettings(8.0, 50.0, 0.0, 80.0, step_rad, True, 0.0, 0.0, True)


def cast(walls: NDArray[np.float64], x_m: float, y_m: float, direction_rad: float) -> tuple[float, float]:
    """Range of the wall in a direction and the cosine of incidence; infinite where there is none."""
    d = np.array([math.sin(direction_rad), math.cos(direction_rad)])
    a, e = walls, np.roll(walls, -1, axis=0) - walls
    q = a - [x_m, y_m]
    den = d[0] * e[:, 1] - d[1] * e[:, 0]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        t = (q[:, 0] * e[:, 1] - q[:, 1] * e[:, 0]) / den
        u = (q[:, 0] * d[1] - q[:, 1] * d[0]) / den
    hit = np.where((t > 1e-9) & (u >= 0.0) & (u <= 1.0), t, np.inf)
    k = int(np.argmin(hit))
    return float(hit[k]), float(abs(den[k]) / math.hypot(*e[k]))


def echoes_of(range_m: float, cosine: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Profile of one beam: ringing, noise, and a wall whose echo weakens and widens with the incidence."""
    r = (np.arange(BINS) + 0.5) * BIN_M
    level = 20.0 + np.where(r < 0.4, 70.0, 0.0)
    if range_m < BINS * BIN_M:
        width = 0.04 + 0.026 * range_m * math.sqrt(max(1.0 - cosine**2, 0.0))
        level = np.maximum(level, (90.0 + 70.0 * cosine) - 0.5 * 14.0 * ((r - range_m) / width) ** 2)
    return np.clip(level + rng.normal(0.0, 6.0, BINS), 0, 255).astype(np.uint8)


def pings(walls: NDArray[np.float64], stays: list[Stay], rng: np.random.Generator) -> Iterator[Reading]:
    """Give the readings of a dive: a ping every 50 ms, a heading and a depth at 10 Hz."""
    bearing, t_ns, here = 0.0, 0, stays[0]
    for stay in stays:
        for k in range(stay.glide + stay.pings):
            share = min(1.0, (k + 1) / stay.glide) if stay.glide else 1.0
            x, y, h = (a + share * (b - a) for a, b in zip(_place(here), _place(stay), strict=True))
            if k % 2 == 0:
                yield Heading(t_ns, h % (2.0 * math.pi), "compass")
                yield Depth(t_ns, stay.depth_m, "depth")
            range_m, cosine = cast(walls, x, y, h + bearing)
            yield Ping(t_ns, bearing, BIN_M, echoes_of(range_m, cosine, rng), settings())
            bearing = (bearing + STEP_RAD) % (2.0 * math.pi)
            t_ns += PING_NS
        here = stay
    yield Heading(t_ns, here.heading_rad % (2.0 * math.pi), "compass")


def _place(stay: Stay) -> tuple[float, float, float]:
    return stay.x_m, stay.y_m, stay.heading_rad
