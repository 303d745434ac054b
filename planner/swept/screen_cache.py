"""Screens of the last few maps and vehicles: a map is looked over once."""

from __future__ import annotations

import math

import numpy as np

from models.arrays import Bools, Floats
from models.vehicle import Vehicle
from planner.ground.elevation_map import ElevationMap
from planner.kernels.interpreted import is_interpreting
from planner.swept.screen import Screen, screen_of
from planner.swept.screen_along import blocks_around, screen_along
from planner.swept.sizes import SweptSizes

_KEPT = 4

_WHOLE = 40_000
"""Maps of fewer cells are looked over as a whole, larger ones around the candidates."""

_BESIDE = 0.25
"""Share of the candidates' extent by which more is looked over, for those of the next cycle."""

_Key = tuple[ElevationMap, Vehicle]
_Window = tuple[int, int, int, int]
_recent: tuple[tuple[_Key, _Window, Screen], ...] = ()
"""Replaced as a whole, never changed: threads need no lock."""


def screen_for(
    elevation_map: ElevationMap, vehicle: Vehicle, sizes: SweptSizes, x: Floats, y: Floats
) -> Screen:
    """The screen of this map, which never changes, around all positions (N, M) [m]."""
    global _recent
    if is_interpreting():
        return _along(elevation_map, vehicle, sizes, x, y)
    rows, columns = elevation_map.elevation.shape
    window, whole = (0, rows, 0, columns), rows * columns <= _WHOLE
    if not whole:
        window = _window(elevation_map, sizes, x, y, 0.0)
    for (ground, wheeled), seen, screen in _recent:
        if ground is elevation_map and wheeled == vehicle and _holds(seen, window):
            return screen
    if not whole:
        window = _window(elevation_map, sizes, x, y, _BESIDE)
    screen = screen_of(elevation_map, sizes, window)
    _recent = (((elevation_map, vehicle), window, screen), *_recent[: _KEPT - 1])
    return screen


_last: tuple[_Key, Screen, Bools] | None = None
"""Of the latest paths that were planned along while kernels run as Python."""


def _along(
    elevation_map: ElevationMap, vehicle: Vehicle, sizes: SweptSizes, x: Floats, y: Floats
) -> Screen:
    global _last
    if _last is not None:
        (ground, wheeled), screen, judged = _last
        if ground is elevation_map and wheeled == vehicle:
            wanted = blocks_around(screen, sizes, x, y)
            if not np.any(wanted & ~judged):
                return screen
    window = _window(elevation_map, sizes, x, y, 0.0)
    screen, judged = screen_along(elevation_map, sizes, window, x, y)
    _last = ((elevation_map, vehicle), screen, judged)
    return screen


def _window(
    elevation_map: ElevationMap, sizes: SweptSizes, x: Floats, y: Floats, beside: float
) -> _Window:
    """First and end row, first and end column of the cells around all positions on the map."""
    (rows, columns), per = elevation_map.elevation.shape, 1.0 / elevation_map.resolution
    # Wheels are asked for as well, and where a block ends the next one begins.
    around = (sizes.reach + max(sizes.reach, sizes.wheel_look * sizes.fine)) * per

    def span(at: Floats, origin: float, count: int) -> tuple[int, int]:
        low, high = (float(np.clip((v - origin) * per, 0, count - 1)) for v in (at.min(), at.max()))
        more = beside * (high - low) + around
        first = max(math.floor(low - more), 0)
        return first, min(math.ceil(high + more) + 1, count)

    return *span(y, elevation_map.origin[1], rows), *span(x, elevation_map.origin[0], columns)


def _holds(window: _Window, other: _Window) -> bool:
    return (
        window[0] <= other[0]
        and other[1] <= window[1]
        and window[2] <= other[2]
        and other[3] <= window[3]
    )
