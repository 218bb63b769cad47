"""From pressure to depth: hydrostatics of still water, from a surface pressure that is told and never guessed anew."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from config.schema import Site
from config.water import gravity_m_s2

STANDARD_MBAR: Final = 1013.25
"""The standard atmosphere: stands for the surface pressure while nobody has told one, and is marked as assumed."""
_PA_PER_MBAR: Final = 100.0


@dataclass(frozen=True, slots=True)
class Surface:
    """Absolute pressure at the water's surface, and where it is from: a centimetre of depth hangs on each mbar."""

    mbar: float = STANDARD_MBAR
    origin: Literal["configured", "tare", "assumed"] = "assumed"


def surface_of(surface_mbar: float | None) -> Surface:
    """Return the surface pressure of a configuration."""
    return Surface() if surface_mbar is None else Surface(surface_mbar, "configured")


def depth_m(gauge_mbar: float, site: Site) -> float:
    """Return the depth at which the water presses so much more than at its surface.

    The density is taken as constant: within 0.1 % of the equation of state of sea water down to 50 m, and right for
    fresh water, which that equation does not know.
    """
    return gauge_mbar * _PA_PER_MBAR / (site.density_kg_m3 * gravity_m_s2(site))
