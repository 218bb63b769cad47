"""Floor plans drawn by chance: closed outside, parted inside, of every turn."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from mapping.values import FREE, OCCUPIED, UNKNOWN
from tools.bench.holes_rooms import drawn_rooms


def test_rooms_are_closed_to_the_outside_and_differ() -> None:
    plans = dict(drawn_rooms(4, np.random.default_rng(2)))
    assert len({plan.tobytes() for plan in plans.values()}) == 4
    for plan in plans.values():
        assert set(np.unique(plan)) == {UNKNOWN, FREE, OCCUPIED}
        parts, _ = ndimage.label(plan != OCCUPIED)
        outside = parts[0, 0]
        assert outside > 0
        assert not np.any(plan[parts == outside] == FREE)


def test_the_same_generator_draws_the_same_rooms() -> None:
    one, two = (list(drawn_rooms(2, np.random.default_rng(7))) for _ in range(2))
    assert all(np.array_equal(a[1], b[1]) for a, b in zip(one, two, strict=True))
