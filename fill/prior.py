"""What is believed about fills before the site has taught anything; the weights come from ``prior_tables``."""

from __future__ import annotations

from typing import Final

import numpy as np

from fill.candidates import FEATURES
from fill.certainty import DESIGN, Belief, Learnt
from fill.logistic import Logistic
from fill.prior_tables import CELL, HOLE, SITE_SD, WHOLE

_UNLEARNT: Final = (0.0, -np.inf, np.inf)  # a feature that was not there when the tables were written


def prior() -> Belief:
    """Return the tables as models: a site is at first believed to be like the others, level 0 and slope 1."""
    weights, low, high = np.array([CELL.get(name, _UNLEARNT) for name in DESIGN]).T
    site = Logistic(np.array([0.0, 1.0]), np.diag(np.array(SITE_SD) ** -2.0))
    hole = Logistic(np.array([HOLE.get(name, 0.0) for name in FEATURES]), np.eye(len(FEATURES)))
    return Belief(hole, Learnt(weights, low, high), site, np.array(WHOLE))
