from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.schema import Map
from mapping.compass import wrap
from mapping.graph import put_at, seen_from
from mapping.pieces import Pieces
from mapping.telling import largest, outlines, told
from mapping.values import Pose, Station
from mapping.verdict import origin
from mapping.view import to_map
from tests.mapping.rooms import KEYHOLE
from tests.mapping.test_pieces import BEAM, DOUBT, STAYS, sights_of


def test_north_is_what_the_compass_said_at_the_first_station_of_the_map_however_its_piece_began() -> None:
    sights = sights_of(KEYHOLE, STAYS[:2])
    true = [Pose(stay.x_m, stay.y_m, stay.heading_rad) for stay in STAYS[:2]]
    pieces = Pieces(math.radians(4.0), BEAM)
    astray = replace(true[0], heading_rad=true[0].heading_rad + math.radians(14.0))
    pieces.begin(0, sights[0], astray)
    pieces.grow(1, sights[1], 0, put_at(astray, seen_from(*true)), DOUBT)
    judged = [origin(sight.scan, Map()) for sight in sights]
    stations = told(pieces, judged, {}, largest(pieces, ()), Map())
    off = [wrap(station.pose.heading_rad - station.scan.heading_rad) for station in stations]
    assert np.degrees(off) == pytest.approx([0.0, 0.0], abs=2.0)
    assert (stations[0].pose.x_m, stations[0].pose.y_m) == (0.0, 0.0)


def of_piece(index: int, piece: int, pose: Pose) -> Station:
    scan = replace(sights_of(KEYHOLE, STAYS[:1])[0].scan, index=index)
    return replace(origin(scan, Map()), pose=pose, piece=piece)


def test_walls_are_shown_of_scans_that_hold_together_but_float_where_their_piece_is_told_to_lie() -> None:
    seen = np.array([[0.0, 2.0], [1.0, 0.0]])
    pose = Pose(3.0, -1.0, math.radians(90.0))
    stations = [of_piece(k, piece, pose) for k, piece in enumerate([0, 0, 3, 3, 4])]
    shown = outlines(stations, [seen] * 5)
    assert [(each.scan, each.piece) for each in shown] == [(2, 3), (3, 3)]
    np.testing.assert_allclose(shown[0].xy_m, to_map(pose, seen), atol=1e-6)
    np.testing.assert_allclose(shown[0].xy_m, [[5.0, -1.0], [3.0, -2.0]], atol=1e-6)
    without = [*stations[:3], replace(stations[3], status="dropped"), stations[4]]
    assert outlines(without, [seen] * 5) == ()
