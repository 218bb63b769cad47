"""Pictures of damaged maps and what was filled in them: what was seen at the left, the verdict at the right."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

from mapping.values import FREE, OCCUPIED
from tools.bench.holes_judge import Proposal
from tools.bench.holes_loss import ELSEWHERE, Damaged
from tools.files import make_folder, replace_file

_SCALE: Final = 4
_GROUND: Final = (205, 205, 205)
_WATER: Final = (255, 255, 255)
_WALL: Final = (0, 0, 0)
_LOST: Final = (255, 150, 0)  # lost and not filled
_RIGHT: Final = (0, 150, 60)
_WRONG: Final = (220, 0, 60)
_FAR: Final = (60, 110, 230)
_GATE: Final = (200, 90, 220)  # line of a true opening


def draw(path: Path, damaged: Damaged, proposal: Proposal) -> None:
    """Write a PNG; north is up.  Raises InputError or LogError where the folder cannot be written to."""
    seen = _states(damaged.seen)
    verdict = _states(damaged.seen)
    lost = (damaged.truth == OCCUPIED) & (damaged.seen != OCCUPIED)
    verdict[lost] = _LOST
    right = ndimage.binary_dilation(damaged.truth == OCCUPIED, np.ones((3, 3), np.int8))
    for loss in damaged.losses:
        if loss.opening:
            verdict[loss.line[:, 0], loss.line[:, 1]] = _GATE
    verdict[proposal.filled & ~right] = _WRONG
    verdict[proposal.filled & right] = _RIGHT
    verdict[proposal.filled & (damaged.owner == ELSEWHERE)] = _FAR
    both = np.flipud(np.concatenate([seen, np.full((len(seen), 2, 3), 128, np.uint8), verdict], axis=1))
    png = io.BytesIO()
    Image.fromarray(np.kron(both, np.ones((_SCALE, _SCALE, 1), np.uint8))).save(png, "PNG")
    make_folder(path.parent)
    replace_file(path, png.getvalue())


def _states(state: NDArray[np.uint8]) -> NDArray[np.uint8]:
    image = np.full((*state.shape, 3), _GROUND, np.uint8)
    image[state == FREE] = _WATER
    image[state == OCCUPIED] = _WALL
    return image
