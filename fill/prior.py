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
    "one": (1.16, 0.71),
    "log gap": (-0.28, 0.23),
    "bend": (0.83, 0.44),
    "turn": (0.23, 0.31),
    "offset": (-1.61, 0.26),
    "half": (0.38, 0.82),
    "log support": (0.51, 0.15),
    "wander": (-0.47, 0.36),
    "near both": (0.38, 0.68),
    "near one": (1.15, 0.38),
    "water both": (-0.55, 0.64),
    "water one": (0.07, 0.40),
    "divides": (0.27, 0.53),
    "water both, divides": (1.20, 0.77),
    "snug": (0.79, 0.61),
    "corner": (0.75, 0.38),
    "side": (-1.61, 0.30),
    "specks": (0.96, 0.76),
    "detour": (-1.11, 0.74),
}
_CELL: Final = ((1.15, 0.12), (0.79, 0.09), (0.00, 0.15))


def prior() -> Belief:
    """Weights and their standard deviations, as models."""
    hole = [_HOLE[name] for name in FEATURES]
    return Belief(_logistic(hole), _logistic(list(_CELL)))


def _logistic(table: list[tuple[float, float]]) -> Logistic:
    weights, sds = np.array(table).T
    return Logistic(weights, np.diag(sds**-2.0))
