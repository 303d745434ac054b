"""A map as wheels feel it: heights averaged over a tyre, without what noise alone would raise.

Everything that plans reads heights of this map: grade, roll, steps, twist, clearance, roughness.
What is averaged where: :mod:`slopewise.models.averaging_windows`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slopewise.models.averaging_windows import averaging_windows
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
    heights = np.empty_like(elevation_map.elevation)
    core.average_heights(
        elevation_map.elevation,
        *windows.wide.taps,
        windows.wide.weights,
        windows.wide.std,
        windows.wide.slopes,
        *windows.narrow.taps,
        windows.narrow.weights,
        windows.narrow.std,
        *windows.taps,
        windows.start,
        windows.variance,
        windows.stride,
        windows.reach,
        noise,
        noise * windows.block_std,
        SIGNIFICANCE,
        KNOWN_SHARE,
        heights,
    )
    averaged = replace(elevation_map, elevation=heights)
    _averaged.put(averaged, averaged, wheel_radius)
    return averaged
