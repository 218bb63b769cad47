"""What is believed about fills before the site has taught anything."""

from __future__ import annotations

from typing import Final

import numpy as np

from fill.candidates import FEATURES
from fill.certainty import Belief, Logistic

_HOLE: Final = {
    "one": (4.0, 1.0),
    "log gap": (-0.9, 0.5),
    "bend": (-2.0, 1.0),
    "turn": (-0.5, 1.0),
    "offset": (-0.3, 1.0),
    "half": (0.0, 1.0),
    "log support": (0.0, 1.0),
    "wander": (-0.5, 1.0),
    "both free": (-2.0, 1.0),
    "one free": (0.5, 1.0),
    "corner": (0.0, 1.0),
    "side": (-1.0, 1.0),
    "specks": (0.0, 1.0),
    "divides": (0.0, 1.0),
    "both free far": (0.0, 1.0),
    "detour": (0.0, 1.0),
}
_CELL: Final = ((1.0, 0.5), (1.0, 0.2), (-0.3, 0.2))


def prior() -> Belief:
    """Weights and their standard deviations, as models."""
    hole = [_HOLE[name] for name in FEATURES]
    return Belief(_logistic(hole), _logistic(list(_CELL)))


def _logistic(table: list[tuple[float, float]]) -> Logistic:
    weights, sds = np.array(table).T
    return Logistic(weights, np.diag(sds**-2.0))
