"""What is believed about fills before the site has taught anything; the weights come from ``prior_tables``."""

from __future__ import annotations

import numpy as np

from fill.candidates import FEATURES
from fill.certainty import DESIGN, Belief, Learnt
from fill.logistic import Logistic
from fill.prior_tables import CELL, HOLE, SITE_SD, WHOLE


def prior() -> Belief:
    """Return the tables as models: a site is at first believed to be like the others, level 0 and slope 1."""
    weights, low, high = np.array([CELL[name] for name in DESIGN]).T
    site = Logistic(np.array([0.0, 1.0]), np.diag(np.array(SITE_SD) ** -2.0))
    hole = Logistic(np.array([HOLE[name] for name in FEATURES]), np.eye(len(FEATURES)))
    return Belief(hole, Learnt(weights, low, high), site, np.array(WHOLE))
