"""Values of the mapping stages: pose, scan, returns, station, grid.

Angles are radians clockwise (see ``drivers.readings``): direction ``a`` from north points to ``(sin a, cos a)`` in
map axes, x east, y north.  A beam of bearing ``b`` from a vehicle of heading ``h`` points to direction ``h + b``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

UNKNOWN: Final = 0
FREE: Final = 1
OCCUPIED: Final = 2


@dataclass(frozen=True, slots=True)
class Pose:
    """Place and heading of the vehicle in the map frame."""

    x_m: float
    y_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class Way:
    """Pings taken under way, from one scan to the next, in the order in which they came.

    ``t_ns`` ``(n,)`` int64, ``direction_rad`` ``(n,)`` float64 each beam's compass direction (heading and bearing),
    ``echoes`` ``(n, n_bins)`` uint8, ``bin_m`` and ``step_rad`` as in the scan that the way led to.
    """

    t_ns: NDArray[np.int64]
    direction_rad: NDArray[np.float64]
    echoes: NDArray[np.uint8]
    bin_m: float
    step_rad: float


@dataclass(frozen=True, slots=True)
class Displacement:
    """Way from one scan to the next as an odometry feed tells it, east and north by the compass; ``sd_m`` of each."""

    dx_m: float
    dy_m: float
    sd_m: float


@dataclass(frozen=True, slots=True)
class Scan:
    """A circle (or a part of one) of pings made at rest.

    ``heading_rad`` is the compass heading of reference, ``bearing_rad`` ``(n,)`` float64 each ping's bearing from that
    heading (the compass's change during the scan is already in it), ``echoes`` ``(n, n_bins)`` uint8.  Beams are in the
    order in which they came.  ``quality`` is ``full`` for a whole circle at rest, ``partial`` for less than a circle,
    ``moving`` where the scan's own beams disagree.  ``depth_m`` is nan where no depth was told.  ``way`` holds the
    pings since the scan before, None where the way was not seen whole; ``moved`` is how far odometry led since then,
    None without it.  Without a compass ``heading_rad`` says nothing.
    """

    index: int
    t_start_ns: int
    t_end_ns: int
    heading_rad: float
    depth_m: float
    bearing_rad: NDArray[np.float64]
    echoes: NDArray[np.uint8]
    bin_m: float
    step_rad: float
    quality: Literal["full", "partial", "moving"]
    way: Way | None = None
    moved: Displacement | None = None
    has_compass: bool = True


@dataclass(frozen=True, slots=True)
class Returns:
    """What the beams of a scan say: where the wall is, or nothing.

    All ``(n,)`` float64 in the order of the scan's beams: ``range_m`` of the wall return, nan where the beam abstains;
    ``sd_m`` its standard deviation; ``free_m`` how far the water was seen to be open (0 where nothing is said).
    """

    range_m: NDArray[np.float64]
    sd_m: NDArray[np.float64]
    free_m: NDArray[np.float64]


Status = Literal["placed", "doubtful", "unplaced", "dropped"]


@dataclass(frozen=True, slots=True)
class Station:
    """A scan with its place in the map, or with the reason why it has none.

    ``covariance`` is ``(3, 3)`` float64 over x_m, y_m, heading_rad, about the first station of the piece.  ``piece``
    numbers what is tied together; piece 0, the largest, is the map, and where another lies is a guess as a whole.
    ``margin`` is the log-posterior of the pose above the best one elsewhere (nan for the first station).  ``why`` is
    one sentence for the pilot.  Only ``placed`` stations are in the evidence.
    """

    scan: Scan
    pose: Pose
    covariance: NDArray[np.float64]
    status: Status
    piece: int
    margin: float
    why: str


@dataclass(frozen=True, slots=True)
class Grid:
    """Evidence: measured, never guessed.

    ``log_odds`` ``(rows, cols)`` float32, 0 where nothing is known; ``state`` ``(rows, cols)`` uint8 of UNKNOWN, FREE,
    OCCUPIED.  Row 0 is the southmost row, column 0 the westmost; ``x0_m``, ``y0_m`` is the south-west corner of cell
    (0, 0), a multiple of ``cell_m``.
    """

    cell_m: float
    x0_m: float
    y0_m: float
    log_odds: NDArray[np.float32]
    state: NDArray[np.uint8]

    @property
    def probability(self) -> NDArray[np.float32]:
        """Occupancy ``(rows, cols)`` float32 in 0 to 1; 0.5 where nothing is known."""
        return (1.0 / (1.0 + np.exp(-self.log_odds))).astype(np.float32)


@dataclass(frozen=True, slots=True)
class Outline:
    """The wall points ``(n, 2)`` float32, m, that a scan of a floating piece saw: as little evidence as its place.

    ``scan`` is its index, ``piece`` its piece's number.
    """

    scan: int
    piece: int
    xy_m: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Level:
    """What scans of another depth than the map's saw of other walls: wells taper.

    ``depth_m`` is their median depth, ``scans`` are their indices.
    """

    depth_m: float
    scans: tuple[int, ...]
    grid: Grid
