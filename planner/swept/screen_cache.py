"""Screens of the last few maps and vehicle sizes: a map is looked over once."""

from __future__ import annotations

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.swept.around import around
from slopewise.planner.swept.screen import Judged, Screen, screen_of
from slopewise.planner.swept.sizes import SweptSizes

_KEPT = 4
"""Maps whose broad phase is kept [1]: one in use, the next, and those of two comparisons."""

_BESIDE = 0.1
"""Share of the candidates' extent by which more is looked over of a map that stays: whoever asks
about it once more will do so again, and from farther along."""

_Key = tuple[ElevationMap, SweptSizes]
_recent: tuple[tuple[_Key, Judged], ...] = ()
"""Replaced as a whole, never changed: threads need no lock."""


def screen_for(elevation_map: ElevationMap, sizes: SweptSizes, x: Floats, y: Floats) -> Screen:
    """The screen of this map, which never changes, around all positions (N, M) [m]."""
    global _recent
    wanted, known = around(elevation_map, sizes, x, y), None
    for (ground, swept), judged in _recent:
        if ground is elevation_map and swept == sizes:
            if judged.around.holds(wanted):
                return judged.screen
            known = known or judged
    if known is not None:
        wanted = around(elevation_map, sizes, x, y, _BESIDE)
    judged = screen_of(elevation_map, sizes, wanted, known)
    _recent = (((elevation_map, sizes), judged), *_recent[: _KEPT - 1])
    return judged.screen
