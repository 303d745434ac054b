"""A screen of nothing but the ground along some paths: for kernels that run as Python."""

from __future__ import annotations

import math

import numpy as np

from models.arrays import Bools, Floats
from planner.ground.elevation_map import ElevationMap
from planner.swept.screen import Screen, look_over, unjudged
from planner.swept.sizes import SweptSizes
from planner.swept.verdicts import BODY, UNSEEN

_GAP = 9
"""Blocks that are rather judged as well than a row begun anew behind them."""


def screen_along(
    elevation_map: ElevationMap, sizes: SweptSizes, window: tuple[int, int, int, int],
    x: Floats, y: Floats,
) -> tuple[Screen, Bools]:  # fmt: skip
    """The screen of a window around positions [m]; elsewhere every pose has to be looked at.

    Returns:
        The screen, and (rows, columns) which of its blocks were judged.
    """
    unfinished = unjudged(elevation_map, sizes, window)
    screen, pad = unfinished.out, unfinished.pad
    screen.bits.fill(UNSEEN | BODY)
    for part in (screen.relief, screen.lift):
        part.fill(np.inf)
    for part in (screen.east, screen.north, screen.seen):
        part.fill(0.0)
    wanted = blocks_around(screen, sizes, x, y)
    judged = np.zeros_like(wanted)
    for r in np.flatnonzero(wanted.any(axis=1)):
        asked = np.flatnonzero(wanted[r])
        for run in np.split(asked, np.flatnonzero(np.diff(asked) > _GAP) + 1):
            first, end = run[0], run[-1] + 1
            here = np.s_[r : r + 1, first:end]
            look_over(unfinished.part(here, np.s_[r : r + 1 + 2 * pad, first : end + 2 * pad]))
            judged[here] = True
    return screen, judged


def blocks_around(screen: Screen, sizes: SweptSizes, x: Floats, y: Floats) -> Bools:
    """(rows, columns) blocks that poses with their middles at such positions ask about."""
    wanted: Bools = np.zeros(screen.bits.shape, np.bool_)
    far = math.ceil(sizes.wheel_reach * screen.per_metre) + 1
    column = np.clip((x - screen.origin_x) * screen.per_metre, 0, wanted.shape[1] - 1)
    row = np.clip((y - screen.origin_y) * screen.per_metre, 0, wanted.shape[0] - 1)
    middles = np.column_stack([row.ravel(), column.ravel()]).astype(np.int64)
    for i, j in np.unique(middles, axis=0):
        wanted[max(i - far, 0) : i + far + 1, max(j - far, 0) : j + far + 1] = True
    return wanted
