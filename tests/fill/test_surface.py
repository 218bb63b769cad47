"""The surface is closed, manifold, at the depths asked for, and says what is measured, filled and assumed."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fill.filler import filled_grid
from fill.surface import extrude
from fill.values import ASSUMED, FILLED, MEASURED, Filled, Hole, Mesh
from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid


def filled_of(state: NDArray[np.uint8], hole: NDArray[np.int32] | None = None) -> Filled:
    grid = Grid(0.1, 3.0, -2.0, np.zeros(state.shape, np.float32), state)
    holes: tuple[Hole, ...] = ()
    if hole is not None:
        certainty = np.full(len(hole), 0.5, np.float32)
        holes = (Hole(0, hole, certainty, 0.5, np.zeros((2, 2)), 0.3, "line", "a test"),)
    return filled_grid(grid, holes, np.zeros((0, 2)))


def room() -> NDArray[np.uint8]:
    state = np.full((30, 40), UNKNOWN, np.uint8)
    state[5:25, 5:35] = OCCUPIED
    state[7:23, 7:33] = FREE
    return state


def edges(mesh: Mesh) -> NDArray[np.int64]:
    corners = mesh.triangles.astype(np.int64)
    return np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])


def assert_closed_and_manifold(mesh: Mesh) -> None:
    """Every edge is run once in each direction: closed, manifold, turned one way."""
    runs = edges(mesh) @ np.array([len(mesh.vertices), 1])
    back = edges(mesh)[:, ::-1] @ np.array([len(mesh.vertices), 1])
    assert len(np.unique(runs)) == len(runs)
    assert np.array_equal(np.sort(runs), np.sort(back))


def volume_m3(mesh: Mesh) -> float:
    places = mesh.vertices.astype(np.float64) * (1, 1, -1)
    a, b, c = (places[mesh.triangles[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def test_a_room_is_closed_and_has_the_depths_asked_for() -> None:
    mesh = extrude(filled_of(room()), 0.5, 2.5)
    assert_closed_and_manifold(mesh)
    assert mesh.vertices[:, 2].min() == pytest.approx(0.5)
    assert mesh.vertices[:, 2].max() == pytest.approx(2.6)
    assert mesh.vertices[:, 0].min() == pytest.approx(3.5, abs=0.06)
    assert mesh.vertices[:, 1].max() == pytest.approx(0.5, abs=0.06)


def test_walls_and_floor_have_their_volume() -> None:
    state = room()
    mesh = extrude(filled_of(state), 0.0, 2.0)
    walls_m2 = np.count_nonzero(state == OCCUPIED) * 0.01
    floor_m2 = np.count_nonzero(state != UNKNOWN) * 0.01
    assert volume_m3(mesh) == pytest.approx(walls_m2 * 2.0 + floor_m2 * 0.1, rel=0.08)


@pytest.mark.parametrize("seed", range(4))
def test_any_grid_gives_a_closed_manifold(seed: int) -> None:
    state = np.random.default_rng(seed).choice(3, (25, 30), p=[0.4, 0.3, 0.3]).astype(np.uint8)
    assert_closed_and_manifold(extrude(filled_of(state), 0.0, 1.0))


def test_kinds_and_certainties_come_from_the_cells() -> None:
    state = room()
    hole = np.array([[row, col] for row in (5, 6) for col in range(15, 20)], np.int32)
    state[5:7, 15:20] = UNKNOWN
    mesh = extrude(filled_of(state, hole), 0.0, 2.0)
    inside = (mesh.vertices[:, 0] > 4.6) & (mesh.vertices[:, 0] < 4.9) & (mesh.vertices[:, 1] < -1.2)
    standing = inside & (mesh.vertices[:, 2] < 1.9)
    assert standing.any()
    assert np.all(mesh.kind[standing] == FILLED)
    assert np.all(mesh.certainty[standing] == 0.5)
    assert np.all(mesh.certainty[mesh.kind == MEASURED] == 1.0)
    assert np.count_nonzero(mesh.kind == ASSUMED) > 500


def test_an_unseen_pocket_within_closed_walls_gets_a_floor_and_a_leak_does_not_spread_it() -> None:
    state = room()
    state[10:15, 10:20] = UNKNOWN
    closed = extrude(filled_of(state), 0.0, 2.0)
    state[5:7, 20:24] = UNKNOWN
    leaking = extrude(filled_of(state), 0.0, 2.0)
    in_pocket = (closed.vertices[:, 0] > 4.1) & (closed.vertices[:, 0] < 4.9)
    in_pocket &= (closed.vertices[:, 1] > -0.9) & (closed.vertices[:, 1] < -0.6)
    assert in_pocket.any()
    assert leaking.vertices[:, 0].min() == pytest.approx(float(closed.vertices[:, 0].min()))
    assert volume_m3(leaking) < volume_m3(closed)


@pytest.mark.parametrize("state", [np.zeros((0, 0), np.uint8), np.zeros((9, 9), np.uint8)])
def test_nothing_gives_an_empty_mesh(state: NDArray[np.uint8]) -> None:
    assert len(extrude(filled_of(state), 0.0, 2.0).vertices) == 0
    assert len(extrude(filled_of(room()), 2.0, 2.0).triangles) == 0
