"""What is believed about fills before the site has taught anything; ``lacuna bench holes --fit-prior`` writes it."""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np

from fill import prior_cells, prior_holes
from fill.candidates import FEATURES
from fill.certainty import DESIGN, Belief, Learnt
from fill.logistic import Logistic
from mapping.trees import planted

_SITE: Final = (0.0, 1.0)
"""Level and slope of the log-odds of cells that a site begins with: as they were learnt, on places left out."""


@cache
def prior() -> Belief:
    """Return the tables as models: a site is at first believed to be like the others."""
    hole = planted(prior_holes.TREES, FEATURES)
    cell = Learnt(planted(prior_cells.TREES, DESIGN), prior_cells.LONGEST)
    site = Logistic(np.array(_SITE), np.diag(np.array(prior_cells.SITE_SD) ** -2.0))
    return Belief(hole, cell, site, np.array(prior_cells.WHOLE))
