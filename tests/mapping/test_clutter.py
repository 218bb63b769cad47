from __future__ import annotations

from dataclasses import replace

import numpy as np

from config.schema import Map
from mapping.clutter import lasting
from mapping.echoes import VAGUE_SD_M, pick
from tests.mapping.rooms import BIN_M, BINS, TUNNEL
from tests.mapping.test_echoes import scan_of, truth_of


def test_what_goes_on_behind_a_place_is_told_and_an_echo_with_a_shadow_is_not() -> None:
    smooth, floor = np.full((2, BINS), 10.0), np.full(BINS, 10.0)
    smooth[0, 40:] = 60.0
    smooth[1, 40:46] = 60.0
    level = lasting(smooth, floor, BIN_M)
    assert level.shape == smooth.shape
    assert np.all(level[0, 40:] == 50.0)
    assert np.all(level[1] == 0.0)


def test_the_edge_of_what_the_floor_sends_back_along_a_tunnel_is_no_wall() -> None:
    scan = scan_of(TUNNEL)
    truth = truth_of(TUNNEL, scan)
    far, first = np.flatnonzero(truth > 5.0), round(2.0 / BIN_M)
    echoes = scan.echoes.copy()
    echoes[far, first:] = np.maximum(echoes[far, first:], 70)
    returns = pick(replace(scan, echoes=echoes), Map())
    sure = returns.sd_m < VAGUE_SD_M
    assert len(far) > 8
    assert not np.any(sure[far] & (np.abs(returns.range_m[far] - 2.0) < 0.5))
    assert np.mean(np.abs(returns.range_m - truth)[sure] < 0.1) > 0.95


def test_a_wall_behind_that_edge_is_found() -> None:
    scan = scan_of(TUNNEL)
    far, first, wall = np.flatnonzero(truth_of(TUNNEL, scan) > 5.0), round(2.0 / BIN_M), round(3.5 / BIN_M)
    echoes = scan.echoes.copy()
    echoes[far, first:] = np.maximum(echoes[far, first:], 70)
    echoes[far, wall : wall + 5] = 150
    returns = pick(replace(scan, echoes=echoes), Map())
    found = np.abs(returns.range_m[far] - 3.5) < 0.15
    assert np.mean(found) > 0.6
