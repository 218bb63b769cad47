"""Boosted trees: what is written down is what was grown, and a row is judged alike in any company."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mapping.trees import Table, Trees, planted
from tools.bench.holes_trees import Growth, grow, table

NAMES = ("wet", "long", "bent")


def lessons(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Right only where one feature is neither low nor high, which no weighted sum tells."""
    random = np.random.default_rng(1)
    x = random.normal(size=(count, 3))
    return x, (np.abs(x[:, 0]) < 0.67).astype(np.float64)


def grown_and_read(depth: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], Trees]:
    x, right = lessons(800)
    grown = grow(x, right, np.ones(800), Growth(count=40, depth=depth, rate=0.3, ridge=1.0))
    return x, right, grown.log_odds(x), planted(table(grown, NAMES), NAMES)


@pytest.mark.parametrize("depth", [1, 2, 4])
def test_trees_read_from_tables_say_what_was_grown(depth: int) -> None:
    x, _, told, trees = grown_and_read(depth)
    assert np.array_equal(trees.log_odds(x), told)


def test_trees_learn_what_no_weighted_sum_tells() -> None:
    *_, trees = grown_and_read(2)
    x = np.random.default_rng(2).normal(size=(400, 3))
    assert np.mean((trees.chance(x) > 0.5) == (np.abs(x[:, 0]) < 0.67)) > 0.9


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, 799), min_size=1, max_size=20))
def test_a_row_is_judged_alike_in_any_company(chosen: list[int]) -> None:
    x, _, told, trees = grown_and_read(3)
    assert np.array_equal(trees.log_odds(x[chosen]), told[chosen])


def test_no_rows_have_no_chances() -> None:
    *_, trees = grown_and_read(2)
    assert trees.chance(np.zeros((0, 3))).shape == (0,)


def test_a_table_of_a_feature_that_is_not_there_is_refused() -> None:
    with pytest.raises(ValueError, match="not in tuple"):
        planted(Table("deep", "1 1.5", "0 1 0 0 10 20"), NAMES)


def test_growing_twice_gives_the_same_tables() -> None:
    x, right = lessons(300)
    growth = Growth(count=5, depth=2, rate=0.3, ridge=1.0)
    assert table(grow(x, right, np.ones(300), growth), NAMES) == table(grow(x, right, np.ones(300), growth), NAMES)
