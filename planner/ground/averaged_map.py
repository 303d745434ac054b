"""A map as wheels feel it: heights averaged over a tyre, without what noise alone would raise.

Everything that plans reads heights of this map: grade, roll, steps, twist, clearance, roughness.
What is averaged where: :mod:`slopewise.models.averaging_windows`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.averaging_windows import AveragingWindows, averaging_windows
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.height_noise import KNOWN_SHARE, SIGNIFICANCE, averaged_noise
from slopewise.models.recent import Recent
from slopewise.planner.compiled_core import core

_averaged: Recent[ElevationMap] = Recent(8)
"""Of four maps, and of what they became: an averaged map is not averaged again."""


def averaged_map(elevation_map: ElevationMap, wheel_radius: float) -> ElevationMap:
    """The map as wheels feel it, which is the same object each time it is asked for.

    Args:
        elevation_map: heights with their error. Without a stated error it is the
            scatter of the heights, at most the error that is assumed.
        wheel_radius: [m].
    """
    return _averaged.get(lambda: _average(elevation_map, wheel_radius), elevation_map, wheel_radius)


def _average(elevation_map: ElevationMap, wheel_radius: float) -> ElevationMap:
    noise = averaged_noise(elevation_map, wheel_radius)
    if noise == 0.0:
        return elevation_map
    windows = averaging_windows(
        elevation_map.resolution, wheel_radius, elevation_map.correlation_length
    )
    heights = _patched(elevation_map.elevation, windows, noise)
    averaged = replace(elevation_map, elevation=heights)
    _averaged.put(averaged, averaged, wheel_radius)
    global _last
    _last = _Last(elevation_map.elevation, windows, noise, heights)
    return averaged


class _Last(NamedTuple):
    """The last map that was averaged: most maps differ from it by a patch."""

    elevation: Floats
    windows: AveragingWindows
    noise: float
    heights: Floats


_last: _Last | None = None
"""Replaced as a whole, so that threads need no lock."""


def _patched(elevation: Floats, windows: AveragingWindows, noise: float) -> Floats:
    """Averaged heights, only around what differs from the last map."""
    last = _last
    if (
        last is None
        or last.windows is not windows
        or last.noise != noise
        or last.elevation.shape != elevation.shape
    ):
        return _average_heights(elevation, windows, noise)
    changed = (elevation != last.elevation) & ~(np.isnan(elevation) & np.isnan(last.elevation))
    rows, columns = (np.flatnonzero(changed.any(axis=axis)) for axis in (1, 0))
    if len(rows) == 0:
        return last.heights
    # A height depends on structure within a disc of it, which depends on cells as far away again.
    # Blocks have to begin where they begin on the whole map.
    stride = windows.stride
    reach = (2 * windows.reach + 1) * stride
    inner, outer = (
        tuple(
            slice(max(n[0] - margin, 0) // stride * stride, n[-1] + margin + 1)
            for n in (rows, columns)
        )
        for margin in (reach, 2 * (reach + stride))
    )
    around = _average_heights(np.ascontiguousarray(elevation[outer]), windows, noise)
    within = tuple(
        slice(i.start - o.start, i.stop - o.start) for i, o in zip(inner, outer, strict=True)
    )
    heights = last.heights.copy()
    heights[inner] = around[within]
    return heights


def _average_heights(elevation: Floats, windows: AveragingWindows, noise: float) -> Floats:
    return core.average_heights(elevation, windows, noise, SIGNIFICANCE, KNOWN_SHARE)
