"""What an emulated site is made of: walls in plan, floor, ceiling or water surface, and the stops of a dive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Material:
    """How a wall answers.

    ``backscatter_db`` beside the walls of a tiled tank, ``mirror_db`` gained (less than none) at a mirror-like bounce,
    one way; ``corner_db`` of a re-entrant corner beside a wall at normal incidence; ``texture_db`` the standard
    deviation from spot to spot.
    """

    backscatter_db: float
    mirror_db: float
    corner_db: float
    texture_db: float


TILE: Final = Material(backscatter_db=0.0, mirror_db=-5.0, corner_db=8.0, texture_db=3.5)
ROCK: Final = Material(backscatter_db=0.0, mirror_db=-6.5, corner_db=2.0, texture_db=4.5)
PLASTER: Final = Material(backscatter_db=0.0, mirror_db=-5.5, corner_db=6.0, texture_db=3.5)


@dataclass(frozen=True, slots=True)
class Wall:
    """A polyline in plan, ``points_m`` ``(n, 2)`` float64; ``closed`` joins the last point to the first."""

    points_m: Points
    closed: bool = True


@dataclass(frozen=True, slots=True)
class Stop:
    """Where the vehicle rests, and what it passes on the way there (``via_m``, in plan)."""

    x_m: float
    y_m: float
    depth_m: float
    heading_rad: float
    via_m: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Site:
    """A flooded place.

    ``walls`` is the plan at depth ``plan_depth_m``; at other depths it is scaled about ``centre_m`` by
    ``1 + taper_per_m * (depth - plan_depth_m)``, so that a bell widens downwards with a positive taper.  Water reaches
    from ``ceiling_m`` down to ``floor_m``; a ceiling at 0 is the open surface, a deeper one is rock.
    """

    name: str
    walls: tuple[Wall, ...]
    floor_m: float
    stops: tuple[Stop, ...]
    material: Material = ROCK
    taper_per_m: float = 0.0
    plan_depth_m: float = 1.3
    centre_m: tuple[float, float] = (0.0, 0.0)
    ceiling_m: float = 0.0

    @property
    def is_flooded(self) -> bool:
        """Whether the water reaches a ceiling of rock."""
        return self.ceiling_m > 0.0

    def plan_at(self, depth_m: float) -> tuple[Wall, ...]:
        """Return the walls as they stand at a depth."""
        return self.stand(self.walls, depth_m)

    def stand(self, walls: tuple[Wall, ...], depth_m: float) -> tuple[Wall, ...]:
        """Return walls of ``plan_depth_m`` as they stand at a depth."""
        scale = 1.0 + self.taper_per_m * (depth_m - self.plan_depth_m)
        centre = np.array(self.centre_m)
        return tuple(Wall(centre + scale * (wall.points_m - centre), wall.closed) for wall in walls)
