from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.schema import Map
from mapping.compass import wrap
from mapping.graph import put_at, seen_from
from mapping.pieces import Pieces
from mapping.telling import largest, told
from mapping.values import Pose
from mapping.verdict import origin
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
