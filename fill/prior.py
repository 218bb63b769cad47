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
    "one": (1.09, 0.70),
    "log gap": (-0.14, 0.21),
    "bend": (1.07, 0.43),
    "turn": (0.01, 0.30),
    "offset": (-1.67, 0.24),
    "half": (0.39, 0.82),
    "log support": (0.44, 0.14),
    "wander": (-0.61, 0.30),
    "near both": (0.12, 0.67),
    "near one": (1.24, 0.38),
    "water both": (-0.58, 0.62),
    "water one": (-0.26, 0.39),
    "divides": (0.43, 0.51),
    "water both, divides": (1.24, 0.76),
    "snug": (1.05, 0.61),
    "corner": (0.85, 0.37),
    "side": (-1.66, 0.28),
    "specks": (1.28, 0.71),
    "detour": (-1.21, 0.71),
}
_CELL: Final = ((1.00, 0.11), (0.83, 0.09), (0.00, 0.14))


def prior() -> Belief:
    """Weights and their standard deviations, as models."""
    hole = [_HOLE[name] for name in FEATURES]
    return Belief(_logistic(hole), _logistic(list(_CELL)))


def _logistic(table: list[tuple[float, float]]) -> Logistic:
    weights, sds = np.array(table).T
    return Logistic(weights, np.diag(sds**-2.0))
