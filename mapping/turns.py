"""Beams along the head's rotation: directions unwrapped, legs between reversals, and who looked the same way before."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.readings import Ping
from mapping.compass import wrap

TURN = 2.0 * math.pi
SMOOTH_NS = 500_000_000


@dataclass(frozen=True, slots=True)
class Attitude:
    """What the feeds say of the vehicle at one moment; ``depth_m`` is nan where none does."""

    heading_rad: float
    rate_rad_s: float
    depth_m: float


@dataclass(frozen=True, slots=True)
class Beam:
    """A ping with the attitude of its moment.

    ``number`` counts the beams of a setting; ``turn_rad`` is the direction, unwrapped along the head's rotation;
    ``leg`` grows by one where the head turns round; ``profile`` ``(n,)`` is what ``mapping.rest`` compares.
    """

    number: int
    ping: Ping
    attitude: Attitude
    turn_rad: float
    leg: int
    profile: NDArray[np.float64]

    @property
    def heading_rad(self) -> float:
        """Heading at its moment, unwrapped."""
        return self.attitude.heading_rad


def next_beam(beams: list[Beam], ping: Ping, attitude: Attitude, profile: NDArray[np.float64]) -> Beam:
    """Make the beam that follows those that are there."""
    if not beams:
        return Beam(0, ping, attitude, attitude.heading_rad + ping.bearing_rad, 0, profile)
    last = beams[-1]
    step = wrap(ping.bearing_rad - last.ping.bearing_rad)
    turn = last.turn_rad + step + wrap(attitude.heading_rad - last.heading_rad)
    return Beam(last.number + 1, ping, attitude, turn, last.leg + int(_reverses(beams, step)), profile)


def _reverses(beams: list[Beam], step_rad: float) -> bool:
    """Whether the head turns round; a bearing that is told twice at a limit does not."""
    for later, earlier in zip(reversed(beams[1:]), reversed(beams[:-1]), strict=True):
        before = wrap(later.ping.bearing_rad - earlier.ping.bearing_rad)
        if before:
            return step_rad * before < 0.0
    return False


def partner(beams: list[Beam]) -> int | None:
    """Index of the beam that looked where the last one looks, a turn before or in the sweep before."""
    last = beams[-1]
    turns = np.array([b.turn_rad for b in beams[:-1]])
    legs = np.array([b.leg for b in beams[:-1]])
    away = np.where(legs == last.leg, np.abs(np.abs(turns - last.turn_rad) - TURN), np.inf)
    away = np.where(legs == last.leg - 1, np.abs(turns - last.turn_rad), away)
    if not len(away) or away.min() > 0.75 * last.ping.head.step_rad:
        return None
    return int(np.argmin(away))


def swept_rad(beams: list[Beam], leg: int) -> float:
    """Angle that a leg has swept."""
    turns = [b.turn_rad for b in beams if b.leg == leg]
    return max(turns) - min(turns) if turns else 0.0


def longest_leg(beams: list[Beam]) -> list[Beam]:
    """Beams of the leg that swept most, one turn of it at most."""
    leg = max({b.leg for b in beams}, key=lambda k: swept_rad(beams, k))
    kept = [b for b in beams if b.leg == leg]
    whole = [i for i, b in enumerate(kept) if abs(b.turn_rad - kept[0].turn_rad) >= TURN - 0.5 * step_of(kept)]
    return kept[: whole[0]] if whole else kept


def same_settings(a: Ping, b: Ping) -> bool:
    """Whether two pings can be of one circle."""
    return (a.bin_m, len(a.echoes), a.head.step_rad) == (b.bin_m, len(b.echoes), b.head.step_rad)


def step_of(beams: list[Beam]) -> float:
    """Angle between neighbouring beams: what it was, else what the head was told."""
    moved = np.abs(np.diff([b.turn_rad for b in beams]))
    moved = moved[moved > 1e-6]
    return float(np.median(moved)) if len(moved) else beams[0].ping.head.step_rad


def steady_headings(beams: list[Beam]) -> NDArray[np.float64]:
    """Headings ``(n,)`` averaged over half a second to either side: a compass trembles more than a vehicle at rest."""
    t_ns = np.array([b.ping.t_ns for b in beams], dtype=np.int64)
    total = np.concatenate(([0.0], np.cumsum([b.heading_rad for b in beams])))
    first = np.searchsorted(t_ns, t_ns - SMOOTH_NS, side="left")
    last = np.searchsorted(t_ns, t_ns + SMOOTH_NS, side="right")
    return np.asarray((total[last] - total[first]) / (last - first), dtype=np.float64)
