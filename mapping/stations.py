"""Stations: scans with their places, kept in order; what is known of the map so far."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from config.schema import Map
from mapping import grid as grids
from mapping.beam import PolarEvidence, polar_evidence
from mapping.compass import wrap
from mapping.refine import Member, refine
from mapping.register import ELSEWHERE_M, Match, Prior, register
from mapping.values import Grid, Pose, Returns, Scan, Station, Status
from mapping.view import View, field_of, points_of, to_map, wall_points

ACCEPT_MARGIN = 8.0
"""Log-posterior over the best pose elsewhere from which a scan counts as placed."""
DOUBT_MARGIN = 3.0
ACCEPT_OVERLAP = 0.35
"""Share of a scan's walls that must lie on known ones."""
ACCEPT_FIT = 0.68
"""Log-posterior per independent point: a scan whose true place is out of reach fits somewhere, but badly."""
GAP_MARGIN, GAP_FIT = 16.0, 1.2
"""The same where neither the scan before nor the one after is placed: pillars repeat, and reach is no bound then."""
TRIES = 6
"""Waiting scans tried again for one new station: it must not take longer as the dive goes on."""
ACCEPT_SD_M = 0.3
FEW_POINTS = 12
"""Scans with fewer wall points cannot be placed, and no map can begin with them."""
ADJUST, ADJUST_WITH = 6, 12
"""So many stations nearest to a new one are adjusted with it, and so many held ones hold them."""
MIN_HEADING_SD_RAD = math.radians(0.5)
LEVEL_M = 0.5
"""Scans whose depths differ by more see other walls: wells taper."""
TAPER = 0.5
"""Largest widening of the walls per metre of depth ..."""
TAPER_STEPS = 4
"""... tried in so many steps to either side."""
LEAST_PARTICLES = 200
ORIGIN_SD_M = 0.01
HINT_SD_M = 0.3
"""Least uncertainty of a pilot's hint."""


@dataclass(frozen=True, slots=True)
class Sight:
    """A scan made ready: what it says of the water around it, and how registration sees it."""

    scan: Scan
    returns: Returns
    evidence: PolarEvidence
    view: View


def sight_of(scan: Scan, returns: Returns, config: Map) -> Sight:
    """Make a scan ready for registration and for the grid."""
    evidence = polar_evidence(scan, returns, math.radians(config.beam_deg), config.cell_m)
    alone = grids.render([(Pose(0.0, 0.0, 0.0), evidence)], config)
    points = points_of(*wall_points(scan.bearing_rad, returns))
    return Sight(scan, returns, evidence, View(points, field_of(alone)))


def shifted(returns: Returns, by_m: float) -> Returns:
    """Move all walls away from the vehicle, as a taper between two depths does about a well's axis."""
    return Returns(np.maximum(returns.range_m + by_m, 0.05), returns.sd_m, np.maximum(returns.free_m + by_m, 0.0))


def best_of(matches: list[Match]) -> Match:
    """Choose among matches of one scan under several assumptions; the margin is over all poses elsewhere."""
    best = max(matches, key=lambda m: m.height)
    poses = [(m.pose, m.height) for m in matches] + [(m.other, m.height - m.margin) for m in matches]
    far = [height for pose, height in poses if _apart(pose, best.pose) > ELSEWHERE_M]
    return replace(best, margin=best.height - max(far, default=-math.inf))


def _apart(a: Pose, b: Pose) -> float:
    return math.hypot(a.x_m - b.x_m, a.y_m - b.y_m)


def _rise(a: Scan, b: Scan) -> float:
    """Difference of two scans' depths; 0 where one was not told."""
    rise = abs(a.depth_m - b.depth_m)
    return 0.0 if math.isnan(rise) else rise


@dataclass(frozen=True, slots=True)
class Hint:
    """The pilot's word on the way since the last station, east and north."""

    dx_m: float
    dy_m: float
    sd_m: float

    def then(self, other: Hint) -> Hint:
        """Join this hint and the one for the way after it."""
        return Hint(self.dx_m + other.dx_m, self.dy_m + other.dy_m, math.hypot(self.sd_m, other.sd_m))


class Stations:
    """All scans of a dive with their places; the first that can be read is the origin."""

    def __init__(self, config: Map) -> None:
        self._config = config
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
        self._stations.append(self._place(len(self._stations)))
        if self._stations[-1].status == "placed":
            self._try_again(len(self._stations) - 1)
            self._adjust(len(self._stations) - 1)
        return self._stations[-1]

    def drop(self, index: int) -> bool:
        """Leave the station of a scan's index out of the map; False where there is none."""
        for i, station in enumerate(self._stations):
            if station.scan.index == index:
                self._stations[i] = replace(station, status="dropped", why="left out by the pilot")
                return True
        return False

    def grid(self) -> Grid:
        """Draw the evidence of the placed stations."""
        return grids.render(self._evidence(), self._config)

    def _evidence(self) -> list[tuple[Pose, PolarEvidence]]:
        both = zip(self._stations, self._sights, strict=False)
        return [(station.pose, sight.evidence) for station, sight in both if station.status == "placed"]

    def _adjust(self, newest: int) -> None:
        """Adjust the newest station and its neighbours together; those farther away and the origin stay."""
        centre = self._stations[newest].pose
        placed = self._placed()
        near = sorted(placed, key=lambda k: (_apart(self._stations[k].pose, centre), k))[:ADJUST_WITH]
        held = {placed[0], *near[ADJUST:]}
        members = [self._member(k, k in held) for k in near]
        for k, pose in zip(near, refine(members), strict=True):
            self._stations[k] = replace(self._stations[k], pose=pose)

    def _member(self, k: int, held: bool) -> Member:
        station = self._stations[k]
        level = next(j for j in self._placed() if _rise(station.scan, self._stations[j].scan) <= LEVEL_M)
        sd = max(math.sqrt(float(station.covariance[2, 2])), MIN_HEADING_SD_RAD)
        return Member(station.pose, self._sights[k].view.points, sd, level, held)

    def _placed(self) -> list[int]:
        return [k for k, s in enumerate(self._stations) if s.status == "placed"]

    def _try_again(self, newest: int) -> None:
        """Try waiting scans once more that come just before or after a placed one, outward from the newest."""
        for _ in range(TRIES):
            placed = set(self._placed())
            waiting = [i for i in range(newest) if self._stations[i].status in ("doubtful", "unplaced")]
            chained = [i for i in waiting if {i - 1, i + 1} & placed and self._tried.get(i) != len(placed)]
            if not chained:
                return
            i = max(chained)
            self._tried[i] = len(placed)
            again = self._place(i)
            if again.status == "placed":
                self._stations[i] = again

    def _place(self, i: int) -> Station:
        sight = self._sights[i]
        points = len(sight.view.points.xy_m)
        placed = [k for k in self._placed() if k != i]
        if points < FEW_POINTS:
            return self._nowhere(i, f"only {points} wall points in the scan: is there a wall within the range?")
        if not placed:
            if sight.scan.quality == "moving":
                return self._nowhere(i, "the vehicle moved during the scan, and no map can begin with it")
            return self._origin(sight.scan)
        prior = self._prior(i, placed)
        return self._judge(i, self._match(sight, placed, prior))

    def _match(self, sight: Sight, placed: list[int], prior: Prior) -> Match:
        """Register a scan in what the stations at its own level saw; without any, in what the others saw."""
        rng = np.random.default_rng([self._config.seed, sight.scan.index])
        level = [k for k in placed if _rise(sight.scan, self._stations[k].scan) <= LEVEL_M]
        reference = self._reference(level or placed, prior, sight)
        if level:
            return register(sight.view, reference, prior, self._config.particles, rng)
        rise = min(_rise(sight.scan, self._stations[k].scan) for k in placed)
        tapers = np.arange(-TAPER_STEPS, TAPER_STEPS + 1) * (TAPER * rise / TAPER_STEPS)
        views = [sight_of(sight.scan, shifted(sight.returns, float(t)), self._config).view for t in tapers]
        particles = max(LEAST_PARTICLES, self._config.particles // 3)
        return best_of([register(v, reference, prior, particles, rng) for v in views])

    def _origin(self, scan: Scan) -> Station:
        heading_sd = math.radians(self._config.compass_sd_deg) / 4.0
        covariance = np.diag([ORIGIN_SD_M**2, ORIGIN_SD_M**2, heading_sd**2])
        pose = Pose(0.0, 0.0, scan.heading_rad)
        return Station(scan, pose, covariance, "placed", 0, math.nan, "the map begins here")

    def _nowhere(self, i: int, why: str) -> Station:
        scan = self._sights[i].scan
        covariance = np.diag([self._config.reach_m**2, self._config.reach_m**2, math.pi**2])
        return Station(scan, Pose(0.0, 0.0, scan.heading_rad), covariance, "unplaced", i + 1, 0.0, why)

    def _prior(self, i: int, placed: list[int]) -> Prior:
        """Say where a scan may have been made: within reach of the placed station nearest to it in time."""
        near = min(placed, key=lambda k: (abs(k - i), k > i))
        base, steps = self._stations[near].pose, abs(near - i)
        turned = [wrap(s.pose.heading_rad - s.scan.heading_rad) for s in (self._stations[k] for k in placed)]
        heading = self._sights[i].scan.heading_rad + float(np.mean(turned))
        sd = math.radians(self._config.compass_sd_deg)
        hint = self._hints[i]
        if hint is not None and steps == 1 and near < i:
            return Prior(base.x_m + hint.dx_m, base.y_m + hint.dy_m, max(hint.sd_m, HINT_SD_M), heading, sd, True)
        return Prior(base.x_m, base.y_m, self._config.reach_m * min(steps, 3), heading, sd)

    def _reference(self, placed: list[int], prior: Prior, sight: Sight) -> View:
        """Make what the placed stations saw, as far as the scan may have seen it, into one view."""
        evidence = [(self._stations[k].pose, self._sights[k].evidence) for k in placed]
        xy = np.concatenate([to_map(self._stations[k].pose, self._sights[k].view.points.xy_m) for k in placed])
        own = sight.view.points.xy_m
        reach = prior.reach_m * (3.0 if prior.gaussian else 1.0) + float(np.hypot(own[:, 0], own[:, 1]).max()) + 1.0
        trust = np.concatenate([self._sights[k].view.points.trust for k in placed])
        near = np.hypot(xy[:, 0] - prior.x_m, xy[:, 1] - prior.y_m) < reach
        return View(points_of(xy[near], trust[near]), field_of(grids.render(evidence, self._config)))

    def _judge(self, i: int, match: Match) -> Station:
        scan = self._sights[i].scan
        sd_m = math.sqrt(float(np.linalg.eigvalsh(match.covariance[:2, :2])[-1]))
        status: Status = "placed"
        chained = any(abs(k - i) == 1 for k in self._placed())
        margin, fit = (ACCEPT_MARGIN, ACCEPT_FIT) if chained else (GAP_MARGIN, GAP_FIT)
        fits = match.overlap >= ACCEPT_OVERLAP and match.fit >= fit
        if match.margin < margin or not fits or sd_m > ACCEPT_SD_M:
            status = "doubtful" if match.margin >= DOUBT_MARGIN else "unplaced"
        piece = i + 1 if status == "unplaced" else 0
        return Station(scan, match.pose, match.covariance, status, piece, match.margin, _why(status, match, sd_m))


def _why(status: Status, match: Match, sd_m: float) -> str:
    """One sentence for the pilot."""
    fits = f"{match.overlap:.0%} of its walls lie on known ones"
    if status == "placed":
        return f"{fits}, sd {sd_m:.2f} m"
    weak = round(math.degrees(match.weak_rad)) % 180
    if sd_m > ACCEPT_SD_M or match.hold < 0.05:
        return f"could slide along {weak} degrees / {weak + 180} degrees: {fits}; take a scan nearer to the last one"
    if match.overlap < ACCEPT_OVERLAP or match.fit < ACCEPT_FIT:
        return f"fits badly, {fits}: take a scan nearer to the last one"
    return f"fits nearly as well elsewhere: {fits}; take a scan nearer to the last one, or give a hint"
