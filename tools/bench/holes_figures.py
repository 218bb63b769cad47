"""Figures over many judged losses, each with what chance alone could make of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.logistic import Logistic
from tools.bench.holes_judge import LossVerdict, Verdict

Figures = dict[str, float]

GAPS: Final = (("3-5", 3, 5), ("6-10", 6, 10), ("11-20", 11, 20), ("21-40", 21, 40))
_DRAWS: Final = 400
_BINS: Final = 10
_RANGE: Final = (0.025, 0.975)


def figures(verdicts: Sequence[Verdict], random: np.random.Generator) -> Figures:
    """Every figure of a method; nan where there was nothing to judge."""
    losses = [each for verdict in verdicts for each in verdict.losses]
    holes = [each for each in losses if not each.loss.opening]
    denied = sum(verdict.denied for verdict in verdicts)
    found = _cells(losses, denied)
    low, high = bootstrap(losses, lambda drawn: _cells(drawn, denied)["F1"], random)
    found |= {"F1_low": low, "F1_high": high, "holes": len(holes), "holes_right": _good(holes)}
    low, high = bootstrap(holes, _good, random)
    found |= {"holes_right_low": low, "holes_right_high": high}
    for name, least, most in GAPS:
        found[f"holes_right_{name}"] = _good([each for each in holes if least <= each.loss.gap <= most])
    found |= {
        "left_open": _mean([not each.good and not len(each.right) for each in holes]),
        "filled_wrong": _mean([not each.right.all() for each in holes]),
        "filled_partly": _mean([not each.good and len(each.right) > 0 and bool(each.right.all()) for each in holes]),
    }
    for kind in ("stretch", "shadow"):
        found[f"{kind}_right"] = _good([each for each in holes if each.loss.kind == kind])
    for kind in ("unseen", "seen"):
        gates = [each for each in losses if each.loss.kind == f"opening {kind}"]
        found |= {f"openings_{kind}": len(gates), f"walled_{kind}": _mean([each.walled for each in gates])}
    found |= trust(losses)
    lost = sum(each.lost for each in losses)
    found["far_per_lost"] = sum(verdict.elsewhere for verdict in verdicts) / lost if lost else float("nan")
    found["over_water_per_lost"] = sum(verdict.over_water for verdict in verdicts) / lost if lost else float("nan")
    return found


def trust(losses: Sequence[LossVerdict]) -> Figures:
    """Brier skill against the base rate, expected calibration error over bins of equal mass, and what would mend it.

    ``level`` and ``slope`` are those of a logistic regression of what was right on the log-odds told: 0 and 1 are best.
    """
    right = np.concatenate([each.right for each in losses] or [np.zeros(0, bool)]).astype(np.float64)
    told = np.concatenate([each.certainty for each in losses] or [np.zeros(0)])
    if not len(right) or np.isnan(told).any():
        return {"brier_skill": float("nan"), "ece": float("nan")}
    spread = float(np.mean((right.mean() - right) ** 2))
    skill = 1.0 - float(np.mean((told - right) ** 2)) / spread if spread > 0 else float("nan")
    order = np.argsort(told, kind="stable")
    bins = [part for part in np.array_split(order, _BINS) if len(part)]
    ece = sum(len(part) * abs(float(told[part].mean() - right[part].mean())) for part in bins) / len(right)
    level, slope = _mended(told, right)
    return {"brier_skill": skill, "ece": ece, "level": level, "slope": slope}


def _mended(told: NDArray[np.float64], right: NDArray[np.float64]) -> tuple[float, float]:
    clipped = np.clip(told, 0.01, 0.99)
    features = np.stack([np.ones_like(clipped), np.log(clipped / (1.0 - clipped))], axis=1)
    free = Logistic(np.array([0.0, 1.0]), 1e-3 * np.eye(2))
    level, slope = free.taught(features, right, np.ones_like(right)).weights
    return float(level), float(slope)


def bootstrap(
    losses: Sequence[LossVerdict], figure: Callable[[list[LossVerdict]], float], random: np.random.Generator
) -> tuple[float, float]:
    """Range of 95 per cent of a figure when losses, not cells, are drawn anew: cells of one hole hang together."""
    if not losses:
        return float("nan"), float("nan")
    draws = random.integers(len(losses), size=(_DRAWS, len(losses)))
    values: NDArray[np.float64] = np.array([figure([losses[index] for index in draw]) for draw in draws.tolist()])
    low, high = np.nanquantile(values, _RANGE) if not np.isnan(values).all() else (float("nan"),) * 2
    return float(low), float(high)


def _cells(losses: Sequence[LossVerdict], denied: int) -> Figures:
    """Precision and recall; cells filled over seen water far from any loss are wrong, and count."""
    filled, right = denied + sum(len(each.right) for each in losses), sum(int(each.right.sum()) for each in losses)
    lost, covered = sum(each.lost for each in losses), sum(each.covered for each in losses)
    precision = right / filled if filled else float("nan")
    recall = covered / lost if lost else float("nan")
    both = precision + recall
    return {"P": precision, "R": recall, "F1": 2 * precision * recall / both if both > 0 else 0.0}


def _good(holes: Sequence[LossVerdict]) -> float:
    return _mean([each.good for each in holes])


def _mean(values: Sequence[bool]) -> float:
    return sum(values) / len(values) if values else float("nan")
