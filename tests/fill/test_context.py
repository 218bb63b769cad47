"""What ways are judged by: each by itself, however many are judged at a time."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from fill.candidates import closer_partners
from fill.closing import open_walls
from fill.context import FEATURES, features
from fill.matching import candidates
from fill.scene import Scene, from_water, look
from fill.ways import Way, across, onto_sides
from mapping.values import FREE, OCCUPIED, UNKNOWN


def torn_room() -> NDArray[np.uint8]:
    state = np.full((60, 90), UNKNOWN, np.uint8)
    state[6:54, 6:84] = OCCUPIED
    state[8:52, 8:82] = FREE
    for row, col in ((7, 30), (52, 50), (30, 7), (20, 83)):
        state[max(row - 4, 0) : row + 5, max(col - 4, 0) : col + 5] = UNKNOWN
    state[24:40, 44] = OCCUPIED
    return state


def drawn(state: NDArray[np.uint8]) -> tuple[list[Way], Scene]:
    walls = open_walls(state == OCCUPIED, state)
    scene = look(walls, state, from_water(state))
    pairs = itertools.combinations(walls.ends, 2)
    ways = [way for a, b in pairs for way in across(a, b, scene).ways]
    return ways + [way for end in walls.ends for way in onto_sides(end, scene, 40.0).ways], scene


def test_what_is_told_of_a_way_does_not_hang_on_the_others() -> None:
    ways, scene = drawn(torn_room())
    closer = closer_partners(ways)
    together = features(ways, scene, closer)
    alone = [features([way], scene, [each]) for way, each in zip(ways, closer, strict=True)]
    assert together.shape == (len(ways), len(FEATURES))
    assert {way.side for way in ways} == {True, False}
    assert np.concatenate(alone).tobytes() == together.tobytes()


def test_of_no_way_nothing_is_told() -> None:
    state = np.full((12, 12), UNKNOWN, np.uint8)
    assert features([], look(open_walls(state == OCCUPIED, state), state, from_water(state)), []).shape[0] == 0
    assert candidates(open_walls(state == OCCUPIED, state), state, 10.0) == []
