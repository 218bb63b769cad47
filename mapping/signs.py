"""What speaks for a pose of a scan and what against it: numbers by which right places are told from wrong ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mapping.likelihood import SIGMA_M, Likelihood
from mapping.modes import Mode, is_elsewhere, pose_of
from mapping.prior import Prior
from mapping.prior_match import TREES
from mapping.trees import Trees, planted
from mapping.view import View, to_map

FACE_M = 0.25
"""Water is looked for so far from a wall, on its either side."""
MOST_BEHIND: Final = 0.15
"""A scan of which more lies on walls whose water is on their other side was made elsewhere; of pieces that were tried
at their true places in two real logs none had more than 0.08."""
MOST: Final = 40.0
"""A lead of more makes nothing surer."""
LEAST_SD_M, LEAST_HEIGHT = 0.02, 3.0
MOST_MOVED_M, USUAL_M = 3.5, 2.2
"""A scan that was made farther away tells no more by that; so far a vehicle usually goes from one to the next."""
SUMS: Final = tuple(
    f"{kind} {where}"
    for kind in ("rough", "plain")
    for where in ("on rough", "on plain", "beside", "in water", "far out in water")
)
SHARES: Final = tuple(f"{way} {share}" for way in ("forth", "back") for share in ("known", "on walls", "in water"))
OWN: Final = ("height", "sd", "hold", "overlap", "behind", "turn", "moved", "fit", "alone", "forth", "back")
AGAINST: Final = ("lead", "second lead", "lead by height", "alone lead")
SIGNS: Final = OWN + AGAINST + SUMS + SHARES + tuple(f"{name}, lead" for name in SUMS + SHARES)
"""Names of the signs, in order; those of a lead are against the best pose elsewhere."""

Floats = NDArray[np.float64]


def signs_of(
    scan: View, reference: View, like: Likelihood, prior: Prior, modes: Sequence[Mode], alone: Likelihood | None
) -> Floats:
    """Tell the signs ``(n, len(SIGNS))`` of modes of one scan in a reference.

    ``alone`` holds the scan against what one station of the reference saw, by itself, where there are several.
    """
    poses = np.array([mode.pose for mode in modes])
    sums, shares, ways = like.signs(poses)
    fit = like.score(poses)
    single = fit if alone is None else alone.score(poses)
    told = np.column_stack([sums, shares])
    rows = []
    for k, mode in enumerate(modes):
        own = [*_own(scan, reference, mode, prior), fit[k], single[k], *ways[k]]
        others = [j for j, other in enumerate(modes) if is_elsewhere(other.pose, mode.pose)]
        rows.append(np.concatenate([own, _against(k, modes, others, single), told[k], told[k] - _best(told, others)]))
    return np.array(rows)


def _own(scan: View, reference: View, mode: Mode, prior: Prior) -> list[float]:
    """Tell what a mode has to show for itself."""
    held = weakest_direction(scan, reference, mode.pose)[1], overlap(scan, reference, mode.pose)
    seen_behind, sd = behind(scan, reference, mode.pose), math.log(max(mode.sd_m, LEAST_SD_M))
    return [mode.height, sd, *held, seen_behind, _turn(mode, prior), _moved_m(mode, prior)]


def _against(k: int, modes: Sequence[Mode], others: Sequence[int], single: Floats) -> list[float]:
    """Tell how far a mode leads before those elsewhere, which are in the order of their heights."""
    own = modes[k]
    leads = [min(own.height - modes[j].height, MOST) for j in others[:2]]
    leads += [MOST] * (2 - len(leads))
    alone = single[k] - max((float(single[j]) for j in others), default=0.0)
    return [*leads, leads[0] / max(abs(own.height), LEAST_HEIGHT), alone]


def _best(told: Floats, others: Sequence[int]) -> Floats:
    return told[others[0]] if others else np.zeros(told.shape[1])


def _turn(mode: Mode, prior: Prior) -> float:
    """Tell how many standard deviations a pose's heading is from the compass, 0 without one."""
    turned = (mode.pose[2] - prior.heading_rad + math.pi) % (2.0 * math.pi) - math.pi
    return abs(float(turned)) / prior.heading_sd_rad


def overlap(scan: View, reference: View, pose: Floats) -> float:
    """Share of the scan's points, by weight, within twice the walls' width of the reference's walls."""
    return float(_near(scan, reference, pose) @ scan.points.weight)


def _near(scan: View, reference: View, pose: Floats) -> Floats:
    xy = to_map(pose_of(pose), scan.points.xy_m)
    distance_m = reference.field.distance_m.ravel().take(reference.field.cells(xy[:, 0], xy[:, 1]))
    return np.asarray(distance_m < 2.0 * SIGMA_M, dtype=np.float64)


def behind(scan: View, reference: View, pose: Floats) -> float:
    """Share of a scan's points that lie on walls of the reference, but with the water on the wrong side of the wall."""
    plain = np.isfinite(scan.points.normal_rad)
    xy, normal = scan.points.xy_m[plain], scan.points.normal_rad[plain]
    ahead = np.stack([np.cos(normal), np.sin(normal)], axis=1)
    ahead *= np.where((xy * ahead).sum(axis=1) > 0.0, -FACE_M, FACE_M)[:, None]  # to where the scan was made
    at, field = pose_of(pose), reference.field
    on, before, after = (field.cells(*to_map(at, xy + off).T) for off in (np.zeros(2), ahead, -ahead))
    free = field.free.ravel()
    wrong = (field.distance_m.ravel().take(on) < 2.0 * SIGMA_M) & free.take(after) & ~free.take(before)
    return float(wrong.sum()) / max(len(plain), 1)


def weakest_direction(scan: View, reference: View, pose: Floats) -> tuple[float, float]:
    """Direction in which the matched walls hold the scan least, and their information there (0 to 0.5)."""
    known = np.isfinite(scan.points.normal_rad)
    weight = np.where(known, _near(scan, reference, pose), 0.0)
    if weight.sum() <= 0.0:
        return 0.0, 0.0
    angle = np.where(known, scan.points.normal_rad, 0.0) - pose[2]  # of axes that turn counter-clockwise
    n = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    information = (n * (weight / weight.sum())[:, None]).T @ n
    value, vector = np.linalg.eigh(information)
    return float(math.atan2(vector[0, 0], vector[1, 0]) % math.pi), float(value[0])


def _moved_m(mode: Mode, prior: Prior) -> float:
    """Tell how far from the middle of its reach a scan was made; where a hint says where, that tells nothing."""
    away_m = math.hypot(mode.pose[0] - prior.x_m, mode.pose[1] - prior.y_m)
    return USUAL_M if prior.gaussian else min(away_m, MOST_MOVED_M)


def odds_of(signs: Floats) -> Floats:
    """Tell the log-odds ``(n,)`` that modes with such signs ``(n, len(SIGNS))`` are right."""
    return _judge().log_odds(signs)


@cache
def _judge() -> Trees:
    return planted(TREES, SIGNS)
