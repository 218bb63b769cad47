"""Real maps to knock holes into: which there are, which half each belongs to, and pieces of them.

A map's half hangs on nothing but its name, so that it never changes sides: methods may be tuned on one half and are
reported on the other.  The salt is the first with which all maps that ``fill.prior`` was learnt on fall into the tune
half and at least six others into the report half.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from config.errors import DataError, InputError
from mapping.values import FREE, OCCUPIED, UNKNOWN
from tools.maps import read_map

PRIOR_SAW: Final = frozenset(
    {"nav2_map_labtech", "dmro_mapjuly", "building_31", "aces", "fhw", "infinite-corridor", "willow-2010-02-18-0.10"}
)
"""Maps that the prior of certainties was learnt on: figures on these are flattered."""
_SALT: Final = "720/"
_SIDE: Final = 236  # cells of a piece without its margin
_MARGIN: Final = 2  # cells never seen about a piece: no map of ours ends at a wall
_TRIES: Final = 40
_FEWEST: Final = 150  # wall cells
_DEPTH: Final = 3.0  # cells into the rock that a sonar tells of; some maps paint all ground as wall
_OCCUPIED_FROM: Final = 0.65
_FREE_TO: Final = 0.35


@dataclass(frozen=True, slots=True)
class Source:
    """A real map by its file; ``name`` is the file's, without ending."""

    name: str
    path: Path

    @property
    def half(self) -> str:
        """Return ``tune`` or ``report``."""
        return ("tune", "report")[hashlib.sha256((_SALT + self.name).encode()).digest()[0] % 2]


def sources(data: Path, half: str) -> list[Source]:
    """Find the maps of one half in the folder of recordings, by name.  Raises InputError where there is none."""
    paths = [*data.glob("maps/*/*.yaml"), *data.glob("grids/*.npz")]
    found = [Source(path.stem, path) for path in sorted(paths, key=lambda path: (path.stem, path.suffix))]
    if not (kept := [each for each in found if each.half == half]):
        raise InputError(f"no maps of the {half} half in {data}; name the folder of recordings with --data")
    return kept


def read_state(path: Path) -> NDArray[np.uint8]:
    """State layer of a map_server map or of an array ``p_occ``.  Raises InputError or DataError."""
    if path.suffix != ".npz":
        return sounded(read_map(path).grid.state)
    try:
        with np.load(path, allow_pickle=False) as arrays:
            probability = arrays["p_occ"].astype(np.float64)
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}; give the folder of recordings") from error
    except (KeyError, ValueError) as error:
        raise DataError(f"{path} is not a grid of probabilities: {error}") from error
    state = np.full(probability.shape, UNKNOWN, np.uint8)
    state[probability < _FREE_TO] = FREE
    state[probability > _OCCUPIED_FROM] = OCCUPIED
    return sounded(state)


def sounded(state: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return ``state`` with the rock forgotten that lies deeper than a sonar tells of."""
    deep = ndimage.distance_transform_edt(np.pad(state == OCCUPIED, 1, constant_values=True))[1:-1, 1:-1] > _DEPTH
    return np.where(deep, UNKNOWN, state).astype(np.uint8)


def pieces(state: NDArray[np.uint8], count: int, random: np.random.Generator) -> list[NDArray[np.uint8]]:
    """Cut up to ``count`` pieces of at most 240 by 240 cells out of a map, each about a random cell of wall."""
    walls = np.argwhere(state == OCCUPIED)
    cut: list[NDArray[np.uint8]] = []
    for _ in range(_TRIES if len(walls) else 0):
        if len(cut) == count:
            break
        place = walls[random.integers(len(walls))] - _SIDE // 2
        row, col = np.clip(place, 0, np.maximum(np.array(state.shape) - _SIDE, 0)).tolist()
        piece = np.ascontiguousarray(state[row : row + _SIDE, col : col + _SIDE])
        if np.count_nonzero(piece == OCCUPIED) >= _FEWEST:
            cut.append(np.pad(piece, _MARGIN, constant_values=UNKNOWN))
    return cut
