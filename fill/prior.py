"""What is believed about fills before the site has taught anything.

Weights and their standard deviations were fitted to some 800 candidates in holes knocked into six laser and robot
maps of buildings, their true openings among them; other maps were kept for judging.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from fill.candidates import FEATURES
from fill.certainty import Belief, Logistic

_HOLE: Final = {
    "one": (0.52, 0.67),
    "log gap": (0.08, 0.20),
    "bend": (1.17, 0.42),
    "turn": (0.13, 0.28),
    "offset": (-1.73, 0.23),
    "half": (0.70, 0.80),
    "log support": (0.40, 0.14),
    "wander": (-0.62, 0.28),
    "near both": (-0.18, 0.62),
    "near one": (1.40, 0.36),
    "water both": (-1.08, 0.58),
    "water one": (-0.38, 0.37),
    "divides": (0.47, 0.48),
    "water both, divides": (1.35, 0.72),
    "snug": (1.03, 0.56),
    "corner": (0.91, 0.35),
    "side": (-1.57, 0.26),
    "specks": (0.81, 0.67),
    "detour": (-1.08, 0.71),
}
_CELL: Final = ((1.14, 0.24), (0.85, 0.10), (0.04, 0.15))


def prior() -> Belief:
    """Weights and their standard deviations, as models."""
    hole = [_HOLE[name] for name in FEATURES]
    return Belief(_logistic(hole), _logistic(list(_CELL)))


def _logistic(table: list[tuple[float, float]]) -> Logistic:
    weights, sds = np.array(table).T
    return Logistic(weights, np.diag(sds**-2.0))
