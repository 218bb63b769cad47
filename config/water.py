"""Gravity at a site and the speed of sound in its water, by named formulas."""

from __future__ import annotations

import math
from typing import Final

from config.schema import STANDARD_GRAVITY_M_S2, Site

_EQUATOR_M_S2: Final = 9.7803253359
_SOMIGLIANA: Final = 0.00193185265241
_ECCENTRICITY_2: Final = 0.00669437999013
_SEA_PPT: Final = 35.0


def gravity_m_s2(site: Site) -> float:
    """Return gravity: as configured, else from the latitude (Somigliana's formula, WGS 84), else the standard one."""
    if site.gravity_m_s2 is not None:
        return site.gravity_m_s2
    if site.latitude_deg is None:
        return STANDARD_GRAVITY_M_S2
    sin2 = math.sin(math.radians(site.latitude_deg)) ** 2
    return _EQUATOR_M_S2 * (1.0 + _SOMIGLIANA * sin2) / math.sqrt(1.0 - _ECCENTRICITY_2 * sin2)


def sound_speed_m_s(temperature_c: float, salinity_ppt: float, depth_m: float = 0.0) -> float:
    """Return the speed of sound in water after Medwin (1975), for 0 to 35 C, 0 to 45 ppt and 0 to 1000 m."""
    t = temperature_c
    pure = 1449.2 + 4.6 * t - 0.055 * t**2 + 0.00029 * t**3
    return pure + (1.34 - 0.01 * t) * (salinity_ppt - 35.0) + 0.016 * depth_m


def site_sound_speed_m_s(site: Site) -> float | None:
    """Return the speed of sound that the site's temperature and salinity give; None where no temperature is told."""
    if site.temperature_c is None:
        return None
    if site.salinity_ppt is not None:
        return sound_speed_m_s(site.temperature_c, site.salinity_ppt)
    return sound_speed_m_s(site.temperature_c, 0.0 if site.water == "fresh" else _SEA_PPT)
