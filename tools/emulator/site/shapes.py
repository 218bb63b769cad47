"""Outlines to build sites from, and walls as tools leave them."""

from __future__ import annotations

from math import hypot, radians

import numpy as np

from tools.emulator.site.values import Points, Stop, Wall

Outline = list[tuple[float, float]]


def rock_cut(outline: Outline, rng: np.random.Generator, facet_m: float = 0.22, roughness_m: float = 0.035) -> Wall:
    """Cut a closed outline into facets and move them by correlated noise along the wall's normal.

    ``roughness_m`` is the standard deviation of the wall about its outline; neighbouring facets move together.
    """
    points = _resample(np.array(outline, dtype=np.float64), facet_m)
    noise = rng.normal(size=len(points))
    smooth = np.fft.ifft(np.fft.fft(noise) * np.exp(-((np.fft.fftfreq(len(points)) * 5.0) ** 2))).real
    smooth *= roughness_m / smooth.std()
    along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    return Wall(points + smooth[:, None] * normal)


def _resample(outline: Points, facet_m: float) -> Points:
    """Keep every corner of a closed outline and put points between them, at most ``facet_m`` apart."""
    pieces = []
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        count = max(1, int(np.ceil(hypot(*(end - start)) / facet_m)))
        pieces.append(start + (end - start) * (np.arange(count) / count)[:, None])
    return np.concatenate(pieces)


def oval(
    centre: tuple[float, float], width_m: float, depth_m: float, start_deg: float = 0.0, end_deg: float = 360.0
) -> Outline:
    """Points of an ellipse, clockwise from ``start_deg`` to ``end_deg`` (from north), both ends included."""
    angles = np.radians(np.arange(start_deg, end_deg + 1e-9, 5.0))
    return [(centre[0] + width_m / 2 * np.sin(a), centre[1] + depth_m / 2 * np.cos(a)) for a in angles]


def rectangle(x0: float, y0: float, x1: float, y1: float) -> Outline:
    """Corners of an upright rectangle."""
    return [(x0, y0), (x0, y1), (x1, y1), (x1, y0)]


def stop(
    x_m: float, y_m: float, heading_deg: float, depth_m: float = 1.3, via: tuple[tuple[float, float], ...] = ()
) -> Stop:
    """Return a stop, its heading told in degrees."""
    return Stop(x_m, y_m, depth_m, radians(heading_deg), via)
