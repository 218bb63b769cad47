"""Stations: scans with their places, kept in order; what is known of the map so far.

What cannot be tied to the map begins a piece of its own, in which scans that fit it are gathered, and which joins the
map when one of its scans can be placed there.  Until then its poses are a guess as a whole, and no evidence.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from config.schema import Map
from mapping import grid as grids
from mapping.chart import LEVEL_M, Chart, Charted, apart_m
from mapping.compass import wrap
from mapping.pieces import Shift, floating, landed
from mapping.prior import Hint, Prior, agreed
from mapping.refine import Member, refine
from mapping.sight import Sight, rise_m
from mapping.values import Grid, Station, Way
from mapping.verdict import judge, nowhere, origin

TRIES = 6
"""Waiting scans tried again for one new station: it must not take longer as the dive goes on."""
FEW_POINTS = 12
"""Scans with fewer wall points cannot be placed, and no map can begin with them."""
ADJUST, ADJUST_WITH = 6, 12
"""So many stations nearest to a new one are adjusted with it, and so many held ones hold them."""
MIN_HEADING_SD_RAD = math.radians(0.5)
WAYS = 3
"""Ways further back than this are not followed."""


class Stations:
    """All scans of a dive with their places; the first that can be read is the origin."""

    def __init__(self, config: Map) -> None:
        self._config = config
        self._canvas = grids.Canvas(config)
        self._stations: list[Station] = []
        self._sights: list[Sight] = []
        self._hints: list[Hint | None] = []
        self._tried: dict[int, int] = {}  # a waiting scan, and how many stations were placed when it was tried last

    @property
    def all(self) -> tuple[Station, ...]:
        """Stations in the order of their scans."""
        return tuple(self._stations)

    def add(self, sight: Sight, hint: Hint | None) -> Station:
        """Place a scan as well as it can be, and try the ones again that could not be placed before."""
        self._sights.append(sight)
        self._hints.append(hint)
        newest = len(self._stations)
        self._stations.append(nowhere(sight.scan, self._config, "not looked at yet"))
        self._stations[newest] = self._place(newest)
        if self._stations[newest].status == "placed":
            self._try_again(newest)
            self._adjust(newest)
        return self._stations[newest]

    def drop(self, index: int) -> bool:
        """Leave the station of a scan's index out of the map; False where there is none."""
        for i, station in enumerate(self._stations):
            if station.scan.index == index:
                self._stations[i] = replace(station, status="dropped", why="left out by the pilot")
                return True
        return False

    def grid(self) -> Grid:
        """Draw the evidence of the placed stations."""
        placed = self._of_piece(0)
        return self._canvas.render([(self._stations[k].pose, self._sights[k].evidence) for k in placed])

    def _of_piece(self, piece: int) -> list[int]:
        """Stations that hold a piece together; of piece 0 those that are placed."""
        told = [k for k, s in enumerate(self._stations) if s.piece == piece and s.status != "dropped"]
        return [k for k in told if (piece or self._stations[k].status == "placed") and self._readable(k)]

    def _readable(self, k: int) -> bool:
        return len(self._sights[k].view.points.xy_m) >= FEW_POINTS

    def _place(self, i: int) -> Station:
        scan, placed = self._sights[i].scan, self._of_piece(0)
        if not self._readable(i):
            points = len(self._sights[i].view.points.xy_m)
            why = f"only {points} wall points in the scan: is there a wall within the range?"
            return nowhere(scan, self._config, why)
        if not placed and scan.quality == "moving":
            return nowhere(scan, self._config, "the vehicle moved during the scan, and no map can begin with it")
        if not placed:
            return origin(scan, self._config)
        station = self._fit(i, placed)
        before = self._stations[i - 1].piece if i else 0
        if before == 0 or not self._of_piece(before):
            return station
        return self._beside(i, station, before)

    def _beside(self, i: int, station: Station, piece: int) -> Station:
        """Tie a scan to the floating piece before it as well: it grows, or, where the map is tied too, it joins."""
        others = self._of_piece(piece)
        tied = self._fit(i, others)
        if tied.status != "placed":
            return station
        first = self._stations[others[0]].covariance
        if station.status == "placed":
            self._join(others, Shift.between(tied, station), first)
            return station
        return floating(tied, piece, first, self._stations[others[-1]].scan.index)

    def _join(self, others: list[int], shift: Shift, first: np.ndarray) -> None:
        """Bring a floating piece into the map, where a station of it has a place in both."""
        for k in others:
            self._stations[k] = landed(self._stations[k], shift, first)

    def _try_again(self, newest: int) -> None:
        """Try waiting scans once more that come just before or after a placed one, outward from the newest."""
        for _ in range(TRIES):
            placed = self._of_piece(0)
            waiting = [i for i in range(newest) if self._stations[i].status in ("doubtful", "unplaced")]
            chained = [i for i in waiting if {i - 1, i + 1} & set(placed) and self._tried.get(i) != len(placed)]
            if not chained:
                return
            i = max(chained)
            self._tried[i] = len(placed)
            if not self._readable(i):
                continue
            again, before = self._fit(i, placed), self._stations[i]
            if again.status == "placed":
                others = [k for k in self._of_piece(before.piece) if k != i]
                self._stations[i] = again
                if others:
                    first = self._stations[min([*others, i])].covariance if min(others) < i else before.covariance
                    self._join(others, Shift.between(before, again), first)

    def _fit(self, i: int, held: list[int]) -> Station:
        """Find the place of a scan among the stations of one piece."""
        sight = self._sights[i]
        chart = Chart([self._charted(k) for k in held if k != i], self._config)
        seeds = [self._config.seed, sight.scan.index]
        prior = self._prior(i, held, chart, np.random.default_rng([*seeds, 1]))
        match = chart.match(sight, prior, np.random.default_rng(seeds))
        chained = any(abs(k - i) == 1 for k in held)
        return judge(sight.scan, match, self._stations[held[0]].piece, prior, chained=chained)

    def _charted(self, k: int) -> Charted:
        return self._stations[k], self._sights[k]

    def _prior(self, i: int, held: list[int], chart: Chart, rng: np.random.Generator) -> Prior:
        """Say where a scan may have been made: within reach of the station nearest to it in time, or in a cloud."""
        near = min((k for k in held if k != i), key=lambda k: (abs(k - i), k > i))
        base, steps = self._stations[near], abs(near - i)
        turned = [wrap(s.pose.heading_rad - s.scan.heading_rad) for s in (self._stations[k] for k in held)]
        heading = self._sights[i].scan.heading_rad + float(np.mean(turned))
        sd = math.radians(self._config.compass_sd_deg)
        hint = self._hints[i]
        if hint is not None and steps == 1 and near < i:
            prior = hint.prior(base.pose.x_m, base.pose.y_m, heading, sd)
        else:
            prior = Prior(base.pose.x_m, base.pose.y_m, self._config.reach_m * min(steps, 3), heading, sd)
        ways = self._ways(near, i)
        return agreed(prior, chart.walk(base, ways, rng) if ways else None)

    def _ways(self, near: int, i: int) -> list[Way]:
        """Ways from a station to another, turned round where it came later; none where one was not seen."""
        between = [self._sights[k].scan.way for k in range(min(near, i) + 1, max(near, i) + 1)]
        seen = [way for way in between if way is not None]
        if len(seen) < len(between) or len(seen) > WAYS:
            return []
        return seen if near < i else [way.back() for way in reversed(seen)]

    def _adjust(self, newest: int) -> None:
        """Adjust the newest station and its neighbours together; those farther away and the origin stay."""
        centre = self._stations[newest].pose
        placed = self._of_piece(0)
        near = sorted(placed, key=lambda k: (apart_m(self._stations[k].pose, centre), k))[:ADJUST_WITH]
        held = {placed[0], *near[ADJUST:]}
        members = [self._member(k, placed, k in held) for k in near]
        for k, pose in zip(near, refine(members), strict=True):
            self._stations[k] = replace(self._stations[k], pose=pose)

    def _member(self, k: int, placed: list[int], held: bool) -> Member:
        station = self._stations[k]
        level = next(j for j in placed if rise_m(station.scan, self._stations[j].scan) <= LEVEL_M)
        sd = max(math.sqrt(float(station.covariance[2, 2])), MIN_HEADING_SD_RAD)
        return Member(station.pose, self._sights[k].view.points, sd, level, held)
