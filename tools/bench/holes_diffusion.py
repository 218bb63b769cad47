"""Volumetric diffusion with line of sight (Davis, Marschner, Garr and Levoy 2002), in two dimensions.

A signed field is 1 in water and -1 in the rock behind a wall, known near what was seen; it is blurred and what was
seen is put back, until it has spread over the holes.  Where it changes its sign in unknown cells, wall is filled in.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mapping.values import FREE, OCCUPIED, UNKNOWN
from tools.bench.holes_judge import Proposal

_ROUNDS: Final = 120
_BEHIND: Final = 3.0  # cells behind a wall that are rock
_SPREAD: Final = 1.0
_KNOWN: Final = 0.02  # weight from which the field means something


def diffusion(state: NDArray[np.uint8]) -> Proposal:
    """Fill the holes of a state layer."""
    wall, water = state == OCCUPIED, state == FREE
    if not wall.any() or not water.any():
        return Proposal(np.zeros(state.shape, bool), None)
    to_wall = ndimage.distance_transform_edt(~wall)
    rock = (state == UNKNOWN) & (to_wall <= _BEHIND)
    known = (water | wall | rock).astype(np.float32)
    field = water.astype(np.float32) - rock.astype(np.float32)
    value, weight = field.copy(), known.copy()
    for _ in range(_ROUNDS):
        blurred = ndimage.gaussian_filter(weight, _SPREAD)
        spread = ndimage.gaussian_filter(value * weight, _SPREAD) / np.maximum(blurred, 1e-9)
        value = np.where(known > 0, field, spread).astype(np.float32)
        weight = np.maximum(known, np.minimum(blurred, 1.0)).astype(np.float32)
    inside = np.asarray((value > 0) & (weight > _KNOWN), np.bool_)
    rim = ndimage.binary_dilation(inside, np.ones((3, 3), np.int8)) & (value <= 0) & (weight > _KNOWN)
    return Proposal(np.asarray(rim & (state == UNKNOWN), np.bool_), None)
