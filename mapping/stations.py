"""Stations: scans with their places, kept in order; what is known of the map so far.

A scan grows the piece that it fits.  What fits none begins a piece of its own, which is joined to another when all its
scans together say where it lies.  The largest piece is the map; the places of another are a guess as a whole, and no
evidence.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from config.schema import Map
from mapping.chart import Charts
from mapping.ensemble import DRAWS, Mixture, draw, mix
from mapping.graph import seen_from
from mapping.grid import Canvas, Cells, gather
from mapping.hidden import seen_by
from mapping.hypotheses import ASKED, lies
from mapping.led import along, led
from mapping.levels import levels_of
from mapping.loops import around, closing
from mapping.pieces import Pieces
from mapping.prior import Hint, Prior, agreed
from mapping.register import challenged
from mapping.repeats import Repeats
from mapping.sight import Sight
from mapping.strides import Strides
from mapping.swing import is_turned, swung
from mapping.telling import Guess, largest, outlines, told
from mapping.values import Grid, Level, Outline, Station
from mapping.verdict import judge, nowhere, origin

FEW_POINTS = 12
"""Scans with fewer wall points cannot be placed, and no map can begin with them."""
BACK = 3
"""So many scans back a vehicle is still within reach."""
BAD_FIT = 0.7
"""A scan that fits worse is tried as if its compass were disturbed."""
TRIES = 2
"""Pieces tried again for one new scan: it must not take longer as the dive goes on."""


class Stations:
    """All scans of a dive with their places; the first of the map is the origin."""

    def __init__(self, config: Map) -> None:
        self._config = config
        self._canvas = Canvas(config)
        self._repeats = Repeats()
        self._pieces = Pieces(math.radians(config.compass_sd_deg), math.radians(config.beam_deg))
        self._charts = Charts(self._pieces, config)
        self._strides = Strides(config)
        self._judged: list[Station] = []
        self._sights: list[Sight] = []
        self._hints: list[Hint | None] = []
        self._tried: dict[tuple[int, int], tuple[int, int]] = {}
        self._guesses: dict[int, Guess] = {}
        self._map: tuple[int, ...] = ()
        self._plans: list[list[int]] = []
        self._told: tuple[Station, ...] = ()

    @property
    def all(self) -> tuple[Station, ...]:
        """Stations in the order of their scans."""
        return self._told

    def add(self, sight: Sight, hint: Hint | None) -> Station:
        """Place a scan as well as it can be, and see whether it joins pieces that lay apart."""
        i = len(self._sights)
        self._sights.append(sight)
        self._hints.append(hint)
        self._judged.append(self._place(i))
        self._join()
        self._close(i)
        self._tell()
        return self._told[i]

    def drop(self, index: int) -> bool:
        """Leave the station of a scan's index out of the map; False where there is none."""
        for i, station in enumerate(self._judged):
            if station.scan.index == index:
                self._judged[i] = replace(station, status="dropped", why="left out by the pilot")
                self._pieces.drop(i)
                self._tell()
                return True
        return False

    def grid(self) -> Grid:
        """Draw the evidence of the stations of the map that show the same plan as the first."""
        self._plans = self.plans()
        return self._draw(self._plans[0] if self._plans else ())

    def levels(self) -> tuple[Level, ...]:
        """Draw what other stations of the map saw of other plans, each by itself."""
        scans = [[self._sights[k].scan for k in plan] for plan in self._plans[1:]]
        return tuple(
            Level(float(np.median([s.depth_m for s in told])), tuple(s.index for s in told), self._draw(plan))
            for told, plan in zip(scans, self._plans[1:], strict=True)
        )

    @property
    def outlines(self) -> tuple[Outline, ...]:
        """What the scans of floating pieces saw of walls."""
        return outlines(self._told, [sight.view.points.xy_m for sight in self._sights])

    def mixture(self) -> Mixture:
        """Mix the evidence over the places that the stations may have; this takes long, for a map that is done."""
        plans = self.plans()
        if not plans:
            return mix(self.grid(), [], np.zeros((DRAWS, 0, 3)))
        drawn = self._fresh(plans[0])
        solution = self._pieces.solution(drawn[0])
        at = np.array([solution.stations.index(k) for k in drawn])
        off = draw(solution.covariance, np.random.default_rng([self._config.seed, len(self._sights)]))[:, at]
        poses, cells = [self._told[k].pose for k in drawn], self._shown(drawn)
        return mix(self.grid(), list(zip(poses, cells, strict=True)), off)

    def plans(self) -> list[list[int]]:
        """Sort the stations of the map by the plan that they show: wells taper."""
        cells = [self._cells(k) for k in self._map]
        depths_m = [self._sights[k].scan.depth_m for k in self._map]
        return [[self._map[k] for k in plan] for plan in levels_of(depths_m, cells, self._config)]

    def _draw(self, stations: Sequence[int]) -> Grid:
        return gather(self._shown(self._fresh(stations)), self._config)

    def _shown(self, stations: Sequence[int]) -> list[Cells]:
        """Give what stations say, less what each would say behind walls that all of them show."""
        cells = [self._cells(k) for k in stations]
        return seen_by([self._told[k].pose for k in stations], cells, gather(cells, self._config))

    def _cells(self, station: int) -> Cells:
        return self._canvas.cells(self._told[station].pose, self._sights[station].evidence)

    def _fresh(self, stations: Sequence[int]) -> list[int]:
        """Of stations that show the same speckle from the same place, one: frozen speckle is no second witness."""
        return [
            stations[k] for k in self._repeats.fresh([(self._told[s].pose, self._sights[s].scan) for s in stations])
        ]

    def _place(self, i: int) -> Station:
        """Grow the piece that a scan fits, or begin one with it."""
        sight, config = self._sights[i], self._config
        points = len(sight.view.points.xy_m)
        if points < FEW_POINTS:
            why = f"only {points} wall points in the scan: is there a wall within the range?"
            return nowhere(sight.scan, config, why)
        bases = self._bases(i)
        if not self._pieces.all and sight.scan.quality == "moving":
            return nowhere(sight.scan, config, "the vehicle moved during the scan, and no map can begin with it")
        first: Station | None = None
        for base in bases:
            station = self._fit(i, base)
            if station.status == "placed":
                self._pieces.grow(i, sight, base, station.pose, station.covariance)
                return station
            first = first or station
        self._tried |= {(base, i): (min(len(self._pieces.of(base)), ASKED), 1) for base in bases}
        first = first or origin(sight.scan, config)
        if bases:
            self._guesses[i] = Guess(bases[0], seen_from(self._pieces.pose(bases[0]), first.pose))
        self._pieces.begin(i, sight, first.pose)
        return first

    def _bases(self, i: int) -> list[int]:
        """Name the scan before, and the one that came last of another piece, not long ago."""
        found: list[int] = []
        for k in range(i - 1, max(i - 1 - BACK, -1), -1):
            if self._pieces.of(k) and not any(k in self._pieces.of(base) for base in found):
                found.append(k)
        return found

    def _fit(self, i: int, base: int) -> Station:
        """Find the place of a scan in the piece of another."""
        sight = self._sights[i]
        seeds = [self._config.seed, sight.scan.index, base]
        prior = self._prior(i, base)
        match = along(self._charts.match(sight, base, prior, np.random.default_rng(seeds)), prior)
        if is_turned(match.pose.heading_rad, prior) or (match.fit < BAD_FIT and not prior.is_led):
            anyhow, rng = replace(prior, cloud=None, disturbed=True), np.random.default_rng([*seeds, 2])
            rival = self._charts.rival(sight, base, anyhow, match, rng)
            if rival > match.height:
                match, prior = self._charts.match(sight, base, anyhow, rng), anyhow
            else:
                match = challenged(match, rival)
        piece = 0 if base in self._map else self._sights[base].scan.index + 1
        return judge(sight.scan, match, piece, prior, chained=abs(base - i) == 1)

    def _prior(self, i: int, base: int) -> Prior:
        """Say where a scan may have been made: within reach of another, or in a cloud."""
        at, steps = self._pieces.pose(base), abs(base - i)
        heading, sd = self._heading(i, base)
        hint = self._hint(base, i)
        compass = all(self._sights[k].scan.has_compass for k in (base, i))
        if hint is not None:
            turn_rad = heading - self._sights[i].scan.heading_rad if compass else 0.0
            prior = hint.turned(turn_rad).prior(at.x_m, at.y_m, heading, sd)
        elif (way := self._led(base, i)) is not None:
            prior = way.prior(at.x_m, at.y_m, heading, sd)
        else:
            prior = Prior(at.x_m, at.y_m, self._config.reach_m * min(steps, BACK), heading, sd)
        return agreed(prior, self._strides.cloud(self._sights, base, i, at) if compass else None)

    def _heading(self, i: int, base: int) -> tuple[float, float]:
        """Say what the compass tells of a scan's heading in the axes of a piece, and how surely."""
        scan, piece = self._sights[i].scan, self._pieces.of(base)
        if not (scan.has_compass and self._sights[base].scan.has_compass):
            return self._pieces.pose(base).heading_rad, math.inf
        read = [self._sights[j].scan.heading_rad for j in piece]
        sd = math.radians(self._config.compass_sd_deg)
        swing = swung(read, [self._pieces.pose(j).heading_rad for j in piece], sd)
        add = swing.at(scan.heading_rad)[0]
        if swing.is_disturbed[piece.index(base)]:  # the iron may still be near
            add = self._pieces.pose(base).heading_rad - self._sights[base].scan.heading_rad
        return scan.heading_rad + add, sd

    def _hint(self, base: int, i: int) -> Hint | None:
        """Join what the pilot said of the whole way from one scan to another, turned round where that came later."""
        told = self._hints[min(base, i) + 1 : max(base, i) + 1]
        hints = [hint for hint in told if hint is not None]
        if not hints or len(hints) < len(told):
            return None
        whole = hints[0]
        for hint in hints[1:]:
            whole = whole.then(hint)
        return whole if base < i else Hint(-whole.dx_m, -whole.dy_m, whole.sd_m)

    def _led(self, base: int, i: int) -> Hint | None:
        """Where odometry led from a station to a scan, back where it came later; None where it does not tell well."""
        between = [self._sights[k].scan.moved for k in range(min(base, i) + 1, max(base, i) + 1)]
        turn_rad = self._pieces.pose(base).heading_rad - self._sights[base].scan.heading_rad
        return led(between, turn_rad, back=base > i, reach_m=self._config.reach_m)

    def _join(self) -> None:
        """Join pieces that follow each other in time, where their scans together say how they lie."""
        for _ in range(TRIES):
            pair = self._apart()
            if pair is None:
                return
            self._tried[pair] = self._sizes(pair)
            base, lead = pair if len(self._pieces.of(pair[0])) >= len(self._pieces.of(pair[1])) else pair[::-1]
            if len(self._pieces.of(lead)) == 1:
                tied = self._fit(lead, base)
                if tied.status == "placed":
                    self._pieces.close(base, lead, tied.pose, tied.covariance)
                continue
            seeds = [self._config.seed, *pair, *self._sizes(pair)]
            prior = self._prior(lead, base)
            rng = np.random.default_rng(seeds)
            fit = lies(self._pieces, self._charts, (base, lead), prior, self._config.particles // 2, rng)
            if is_turned(fit.pose.heading_rad, prior):
                anyhow = replace(prior, cloud=None, disturbed=True)
                other = lies(self._pieces, self._charts, (base, lead), anyhow, self._config.particles, rng)
                fit = other if other.height > fit.height else fit
            if fit.is_sure:
                self._pieces.close(base, lead, fit.pose, fit.covariance)

    def _close(self, i: int) -> None:
        """Close the loop that a scan may end, in its piece, or round from the piece before."""
        piece = self._pieces.of(i)
        if not piece:
            return
        loop = closing(self._pieces, self._charts, i, self._config)
        before = [k for k in range(max(piece[0] - BACK, 0), piece[0]) if self._pieces.of(k)]
        if loop is None and before and i > piece[0]:
            prior = self._prior(piece[0], before[-1])
            loop = around(self._pieces, self._charts, (before[-1], piece[0]), i, prior, self._config)
        if loop is not None:
            self._pieces.close(loop.one, loop.other, loop.pose, loop.covariance)

    def _apart(self) -> tuple[int, int] | None:
        """Find the last two scans that follow each other in two pieces which have grown since they were tried."""
        held = [i for i in range(len(self._sights)) if self._pieces.of(i)]
        for one, other in zip(held[-2::-1], held[:0:-1], strict=True):
            if other - one > BACK or other in self._pieces.of(one):
                continue
            if max(self._sizes((one, other))) > 1 and self._tried.get((one, other)) != self._sizes((one, other)):
                return one, other
        return None

    def _sizes(self, pair: tuple[int, int]) -> tuple[int, int]:
        one, other = (min(len(self._pieces.of(k)), ASKED) for k in pair)
        return one, other

    def _tell(self) -> None:
        """Tell all stations: the largest piece is the map, and the first of its stations the origin."""
        self._map = largest(self._pieces, self._map)
        self._told = told(self._pieces, self._judged, self._guesses, self._map, self._config)
