"""Squares of cells that a scan's beams reach: none in which it says anything may be left out."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mapping.beam import PolarEvidence
from mapping.grid import cells_of
from mapping.tiles import SECTORS, reaches_of
from mapping.values import Pose

CELL_M = 0.05
EVERYWHERE = np.full((SECTORS // 2 + 1, SECTORS), np.inf)


def evidence_of(seed: int, beams: int) -> PolarEvidence:
    """A few narrow beams, each far out or near, and elsewhere nothing."""
    rng = np.random.default_rng(seed)
    table = np.zeros((1200, 250), np.float32)
    for bearing in rng.integers(0, 1200, beams):
        table[bearing, : rng.integers(1, 250)] = -0.9
    return PolarEvidence(table, 0.02)


@given(
    seed=st.integers(0, 10_000),
    beams=st.integers(0, 40),
    x_m=st.floats(-30.0, 30.0),
    y_m=st.floats(-30.0, 30.0),
    heading_rad=st.floats(-math.pi, 3.0 * math.pi),
)
@settings(max_examples=25, deadline=None)
def test_no_cell_is_left_out(seed: int, beams: int, x_m: float, y_m: float, heading_rad: float) -> None:
    pose, evidence = Pose(x_m, y_m, heading_rad), evidence_of(seed, beams)
    found, all_of_them = cells_of(pose, evidence, CELL_M), cells_of(pose, evidence, CELL_M, EVERYWHERE)
    order, other = (np.lexsort((each.col, each.row)) for each in (found, all_of_them))
    for name in ("row", "col", "log_odds"):
        np.testing.assert_array_equal(getattr(found, name)[order], getattr(all_of_them, name)[other])


def test_a_scan_reaches_no_less_far_with_more_sectors_aside() -> None:
    reaches_m = reaches_of(evidence_of(3, 20))
    assert reaches_m.shape == EVERYWHERE.shape
    assert (np.diff(reaches_m, axis=0) >= 0.0).all()
    assert (reaches_m[-1] == reaches_m[-1].max()).all()
    assert 0.0 < reaches_m.max() <= 250 * 0.02
