"""Relief of an elevation map as a grey picture: light from the north-west, unknown ground clear."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats

# Azimuth clockwise from north [deg], height above the horizon [deg], share of the light.
_LIGHTS = ((315.0, 45.0, 0.55), (270.0, 40.0, 0.20), (0.0, 40.0, 0.15), (135.0, 60.0, 0.10))
_WANTED_SLOPE = 0.5  # rise that the steep parts are drawn with
_MOST_EXAGGERATION = 5.0
_DARKEST = 56.0
_LEVEL = 0.84  # tone of level ground, of 1
_CONTRAST = 1.25


def shade(elevation: Floats, resolution: float) -> NDArray[np.uint8]:
    """Grey and alpha of the relief, north (the last row of the map) on top.

    Args:
        elevation: (rows, cols) heights [m], row 0 at minimum y, NaN where unknown.
        resolution: edge of a cell [m].

    Returns:
        (rows, cols, 2): grey; alpha 0 where unknown, else 255.
    """
    known = np.isfinite(elevation)
    rise_y = _rise(elevation, resolution, 0)
    rise_x = _rise(elevation, resolution, 1)
    steep = float(np.percentile(np.hypot(rise_x, rise_y)[known], 95.0)) if known.any() else 0.0
    scale = np.clip(_WANTED_SLOPE / max(steep, 1e-6), 1.0, _MOST_EXAGGERATION)
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
    # Level ground becomes a light grey, whatever the lights.
    tone = np.clip(_LEVEL * (light / level) ** _CONTRAST, 0.0, 1.0)
    grey = _DARKEST + (255.0 - _DARKEST) * tone * _by_height(elevation, known)
    picture = np.zeros((*elevation.shape, 2), np.uint8)
    picture[..., 0] = np.where(known, np.clip(np.rint(grey), 0.0, 255.0), 0.0)
    picture[..., 1] = np.where(known, 255, 0)
    return np.ascontiguousarray(picture[::-1])


def _by_height(elevation: Floats, known: NDArray[np.bool_]) -> Floats:
    """Low ground a little darker than high ground, (rows, cols)."""
    if not known.any():
        return np.ones_like(elevation)
    low, high = np.percentile(elevation[known], (1.0, 99.0))
    share = np.clip((elevation - low) / max(high - low, 1e-9), 0.0, 1.0)
    result: Floats = np.where(known, 0.88 + 0.12 * share, 1.0)
    return result


def _rise(elevation: Floats, resolution: float, axis: int) -> Floats:
    """Slope along an axis from the known neighbours, 0 where there is none."""
    step = np.diff(elevation, axis=axis) / resolution
    gap = np.full_like(np.take(elevation, [0], axis=axis), np.nan)
    after = np.concatenate((step, gap), axis=axis)
    before = np.concatenate((gap, step), axis=axis)
    has_after, has_before = np.isfinite(after), np.isfinite(before)
    total = np.where(has_after, after, 0.0) + np.where(has_before, before, 0.0)
    count = has_after.astype(np.float64) + has_before
    result: Floats = np.divide(total, count, out=np.zeros_like(total), where=count > 0.0)
    return result


def coarsen(elevation: Floats, most: int) -> tuple[Floats, int]:
    """Averages over square blocks of cells, so that no edge has more than ``most``.

    Returns:
        (rows, cols) heights, NaN where more than half a block is unknown; cells along the edge of
        a block. Blocks begin at row and column 0; the last ones may reach beyond the map.
    """
    factor = -(-max(elevation.shape) // most)
    if factor <= 1:
        return elevation, 1
    rows, columns = elevation.shape
    padded = np.pad(
        elevation, ((0, -rows % factor), (0, -columns % factor)), constant_values=np.nan
    )
    blocks = padded.reshape(padded.shape[0] // factor, factor, -1, factor)
    known = np.isfinite(blocks)
    count = known.sum(axis=(1, 3))
    total = np.where(known, blocks, 0.0).sum(axis=(1, 3))
    inside = np.pad(np.ones_like(elevation), ((0, -rows % factor), (0, -columns % factor)))
    cells = inside.reshape(blocks.shape).sum(axis=(1, 3))
    seen = 2 * count >= cells
    mean = np.divide(total, count, out=np.full(count.shape, np.nan), where=seen & (count > 0))
    return mean, factor
