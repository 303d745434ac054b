"""Shaded relief of the ground, for pages and scenes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats

# Azimuth clockwise from north [deg], height above the horizon [deg], share of the light [1].
_LIGHTS = ((315.0, 45.0, 0.55), (270.0, 40.0, 0.20), (0.0, 40.0, 0.15), (135.0, 60.0, 0.10))
_STEEP_RISE, _MAX_EXAGGERATION = 0.5, 5.0
"""Rise with which the 95th percentile of slopes is drawn, and largest factor on heights [1]."""
_DARKEST = 56.0
"""Darkest grey of known ground, of 255."""
_LEVEL_TONE, _CONTRAST = 0.84, 1.25
"""Tone of level ground, of 1, and exponent of the light [1]."""


def shade(elevation: Floats, resolution: float) -> NDArray[np.uint8]:
    """Grey and alpha of the relief, light from the north-west.

    Args:
        elevation: (rows, cols) heights [m], row 0 at minimum y, NaN where unknown.
        resolution: edge of a cell [m].

    Returns:
        (rows, cols, 2), north (the last row of the map) on top; alpha 0 where unknown, else 255.
    """
    known = np.isfinite(elevation)
    rise_y, rise_x = _rise(elevation, resolution, 0), _rise(elevation, resolution, 1)
    steep = float(np.percentile(np.hypot(rise_x, rise_y)[known], 95.0)) if known.any() else 0.0
    scale = np.clip(_STEEP_RISE / max(steep, 1e-6), 1.0, _MAX_EXAGGERATION)
    rise_x, rise_y = scale * rise_x, scale * rise_y
    length = np.sqrt(1.0 + rise_x**2 + rise_y**2)
    light = np.zeros_like(length)
    level = 0.0
    for azimuth_deg, height_deg, share in _LIGHTS:
        azimuth, height = np.deg2rad(azimuth_deg), np.deg2rad(height_deg)
        east, north = np.sin(azimuth) * np.cos(height), np.cos(azimuth) * np.cos(height)
        towards = (np.sin(height) - east * rise_x - north * rise_y) / length
        light += share * np.maximum(towards, 0.0)
        level += share * np.sin(height)
    # Level ground becomes a light grey for any set of lights.
    tone = np.clip(_LEVEL_TONE * (light / level) ** _CONTRAST, 0.0, 1.0)
    grey = _DARKEST + (255.0 - _DARKEST) * tone * _height_tone(elevation, known)
    picture = np.zeros((*elevation.shape, 2), np.uint8)
    picture[..., 0] = np.where(known, np.clip(np.rint(grey), 0.0, 255.0), 0.0)
    picture[..., 1] = np.where(known, 255, 0)
    return np.ascontiguousarray(picture[::-1])


def _height_tone(elevation: Floats, known: NDArray[np.bool_]) -> Floats:
    """(rows, cols) factor that draws low ground a little darker than high ground."""
    if not known.any():
        return np.ones_like(elevation)
    low, high = np.percentile(elevation[known], (1.0, 99.0))
    share = np.clip((elevation - low) / max(high - low, 1e-9), 0.0, 1.0)
    result: Floats = np.where(known, 0.88 + 0.12 * share, 1.0)
    return result


def _rise(elevation: Floats, resolution: float, axis: int) -> Floats:
    """Slope along an axis from the known neighbours, 0 where neither is known."""
    step = np.diff(elevation, axis=axis) / resolution
    gap = np.full_like(np.take(elevation, [0], axis=axis), np.nan)
    after = np.concatenate((step, gap), axis=axis)
    before = np.concatenate((gap, step), axis=axis)
    has_after, has_before = np.isfinite(after), np.isfinite(before)
    total = np.where(has_after, after, 0.0) + np.where(has_before, before, 0.0)
    count = has_after.astype(np.float64) + has_before
    result: Floats = np.divide(total, count, out=np.zeros_like(total), where=count > 0.0)
    return result
