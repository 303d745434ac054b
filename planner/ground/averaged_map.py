"""A map as wheels feel it: heights averaged over a tyre, without what noise alone would raise.

Everything that plans reads heights of this map: grade, roll, steps, twist, clearance, roughness.
What is averaged where: :mod:`slopewise.models.averaging_windows`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from slopewise.models.averaging_windows import averaging_windows
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.height_noise import EXACT, KNOWN_SHARE, SIGNIFICANCE, noise_of
from slopewise.planner.compiled_core import core

_CACHE_SIZE = 4
"""Maps that are cached [1]: one in use, the next, and those of two comparisons."""


class _Recent(NamedTuple):
    given: ElevationMap
    wheel_radius: float
    averaged: ElevationMap


_recent: tuple[_Recent, ...] = ()
"""Replaced as a whole, never changed: threads need no lock."""


def averaged_map(elevation_map: ElevationMap, wheel_radius: float) -> ElevationMap:
    """The map as wheels feel it, which is the same object each time it is asked for.

    Cells larger than the wheel's radius are not averaged: each is one tyre's ground already.

    Args:
        elevation_map: heights with their error. Without a stated error it is the
            scatter of the heights, at most the error that is assumed.
        wheel_radius: [m].
    """
    global _recent
    for known in _recent:
        # An averaged map is not averaged again.
        if known.wheel_radius == wheel_radius and (
            known.given is elevation_map or known.averaged is elevation_map
        ):
            return known.averaged
    averaged = _averaged(elevation_map, wheel_radius)
    _recent = (_Recent(elevation_map, wheel_radius, averaged), *_recent[: _CACHE_SIZE - 1])
    return averaged


def _averaged(elevation_map: ElevationMap, wheel_radius: float) -> ElevationMap:
    resolution = elevation_map.resolution
    if resolution > wheel_radius:
        return elevation_map
    noise = noise_of(elevation_map)
    if noise <= EXACT:
        return elevation_map
    windows = averaging_windows(resolution, wheel_radius, elevation_map.correlation_length)
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
    return replace(elevation_map, elevation=heights)
