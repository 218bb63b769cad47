"""What is believed about fills before the site has taught anything; the weights come from ``prior_tables``."""

from __future__ import annotations

from typing import Final

import numpy as np

from fill.candidates import FEATURES
from fill.certainty import DESIGN, Belief, Learnt
from fill.logistic import Logistic
from fill.prior_tables import CELL, HOLE, SITE_SD, WHOLE

_SITE: Final = (0.73, 0.64)
"""Level and slope of the log-odds of cells that a site begins with: the weights were learnt on all that could be drawn,
and what is drawn in the end is the better part of it.  Fitted to the fills of the tune half, seeds 1 to 3: ``level``
and ``slope`` of ``lacuna bench holes --half tune --json`` with 0 and 1 here."""
_UNLEARNT: Final = (0.0, -np.inf, np.inf)  # a feature that was not there when the tables were written


def prior() -> Belief:
    """Return the tables as models: a site is at first believed to be like the others."""
    weights, low, high = np.array([CELL.get(name, _UNLEARNT) for name in DESIGN]).T
    site = Logistic(np.array(_SITE), np.diag(np.array(SITE_SD) ** -2.0))
    hole = Logistic(np.array([HOLE.get(name, 0.0) for name in FEATURES]), np.eye(len(FEATURES)))
    return Belief(hole, Learnt(weights, low, high), site, np.array(WHOLE))
