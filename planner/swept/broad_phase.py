"""Broad phases of the last few maps and vehicle sizes: each is built once for many plans."""

from __future__ import annotations

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.compiled_core import core
from slopewise.planner.swept.sizes import SweptSizes
from slopewise.planner.swept.tube import BandWidth

_CACHED = 4
"""Broad phases that are cached [1]: one in use, the next, and those of two comparisons."""

_MARGIN = 0.1
"""Share of the extent of all candidates by which more is covered of a map that stays: later ones
are farther along."""

_Key = tuple[ElevationMap, SweptSizes, BandWidth | None]
_recent: tuple[tuple[_Key, core.BroadPhase], ...] = ()
"""Replaced as a whole, never changed: threads need no lock."""


def broad_phase_for(
    elevation_map: ElevationMap, sizes: SweptSizes, band: BandWidth | None, x: Floats, y: Floats
) -> core.BroadPhase:
    """The broad phase of the part of a map, which never changes, around positions.

    Args:
        elevation_map: ground.
        sizes: vehicle sizes on it.
        band: how far the vehicle may be off its line, None if it is exactly on it.
        x, y: (N, M) middles of the wheelbase [m]; those beyond the map are taken as on its edge.
    """
    global _recent
    margin = 0.0
    for (ground, *vehicle), grid in _recent:
        if ground is elevation_map and vehicle == [sizes, band]:
            if grid.covers(x, y):
                return grid
            margin = _MARGIN
    heights, resolution = elevation_map.elevation, elevation_map.resolution
    grid = core.BroadPhase(heights, *elevation_map.origin, resolution, sizes, band, x, y, margin)
    _recent = (((elevation_map, sizes, band), grid), *_recent[: _CACHED - 1])
    return grid
