"""Where a map could bar a vehicle at all, whatever its heading: most ground needs no closer look.

Around each block of cells a quadratic surface is taken off. Wheels and body follow planes exactly;
four wheels at one distance from the middle follow a bowl; what a saddle costs is bounded by its
curvature, and all else by the range of what is left. A step is looked for in what is left, too: the
slope of the surface explains the rest of a climb. So the screen may send a pose that is free to
:mod:`slopewise.planner.swept.sweep`, and clears none that it bars, but for climbs within a few
millimetres of what is barred: the sweep counts a little less of a step and of the slope around it,
for what a map does not show (``cleared`` of :class:`slopewise.planner.swept.sizes.SweptSizes`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bytes, Ints, Singles
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.kernels.compiled import kernel
from slopewise.planner.swept.around import Around
from slopewise.planner.swept.blocks import Blocks, blocks_of, smoothed
from slopewise.planner.swept.screen_reach import (
    ScreenBounds,
    ScreenOffsets,
    bounds_of,
    cells_of,
    offsets_of,
)
from slopewise.planner.swept.sizes import SweptSizes
from slopewise.planner.swept.surfaces import (
    FacetRow,
    Surface,
    bend,
    felt,
    fit,
    range_of,
    stood_on,
    warp,
)
from slopewise.planner.swept.tyre_profile import Facets
from slopewise.planner.swept.verdicts import BODY, UNSEEN, judge_body, judge_relief, nearest, unseen


class Screen(NamedTuple):
    """Blocks of cells.

    Attributes:
        bits: (rows, columns) what poses with their middle in a block may meet.
        relief: (rows, columns) how far a wheel may climb or fall around the block, beyond the slope
            there [m]; inf where nobody knows. cleared: so much is no step [m].
        lift: (rows, columns) how far it may stand above the ground under its middle [m], likewise.
        east, north: (rows, columns) slope of the ground around a wheel in the block [1].
        seen: (rows, columns) distance from any point of a block within which all is known [m], at
            most the reach of the body.
        origin_x, origin_y: corner of block [0, 0] [m]. per_metre: blocks in a metre.
        facets: of cells around the blocks.
    """

    bits: Bytes
    relief: Singles
    lift: Singles
    east: Singles
    north: Singles
    seen: Singles
    origin_x: float
    origin_y: float
    per_metre: float
    cleared: np.float32
    facets: Facets


class Unjudged(NamedTuple):
    """Blocks that are gathered, with `pad` of them around, and a screen that is all suspect yet.

    Attributes:
        mean: (rows, columns) height of the ground around each block [m].
    """

    blocks: Blocks
    mean: Singles
    pad: int
    offsets: ScreenOffsets
    bounds: ScreenBounds
    reach: float
    out: Screen


class Judged(NamedTuple):
    """Which blocks of a screen are judged; the others in its window are suspect."""

    around: Around
    screen: Screen


def screen_of(
    elevation_map: ElevationMap, sizes: SweptSizes, around: Around, known: Judged | None = None
) -> Judged:
    """Look over a part of a map.

    Args:
        elevation_map: ground. sizes: of the vehicle.
        around: which of its blocks are judged at least.
        known: of the same map and vehicle; what is judged there already is taken over.
    """
    unfinished = _gathered(elevation_map, sizes, around.window)
    out = unfinished.out
    if known is None:
        _look_around(*unfinished, around.first, around.ends)
        return Judged(around, out)
    _take_over(known, around.window, out)
    before = known.around.within(around)
    _look_around(*unfinished, around.first, before.first)
    _look_around(*unfinished, before.ends, around.ends)
    return Judged(around, out)


def _take_over(known: Judged, window: tuple[int, int, int, int], out: Screen) -> None:
    """What another screen knows of a window of the same map."""
    there = known.around.window
    top, left = max(window[0], there[0]), max(window[2], there[2])
    end, right = min(window[1], there[1]), min(window[3], there[3])
    if top >= end or left >= right:
        return
    old = np.s_[top - there[0] : end - there[0], left - there[2] : right - there[2]]
    new = np.s_[top - window[0] : end - window[0], left - window[2] : right - window[2]]
    for name in ("bits", "relief", "lift", "east", "north", "seen"):
        getattr(out, name)[new] = getattr(known.screen, name)[old]


def _gathered(
    elevation_map: ElevationMap, sizes: SweptSizes, window: tuple[int, int, int, int]
) -> Unjudged:
    """The blocks of a window: first row, end row, first column, end column of the map's blocks."""
    resolution = elevation_map.resolution
    cells = cells_of(sizes, resolution)
    offsets, bounds = offsets_of(sizes, cells, resolution), bounds_of(sizes, cells, resolution)
    widest = max(int(np.abs(part).max(initial=0)) for part in (offsets.body, offsets.near))
    # What continues into unknown ground is the same wherever the window begins.
    pad = 2 + max(widest, 2 * bounds.fit + 1)
    rows, columns = window[1] - window[0], window[3] - window[2]
    first_row, first_column = (window[0] - pad) * cells, (window[2] - pad) * cells
    blocks = blocks_of(
        elevation_map.elevation,
        first_row,
        first_column,
        cells,
        (rows + 2 * pad, columns + 2 * pad),
    )
    bits = np.full((rows, columns), UNSEEN | BODY, np.uint8)
    relief, lift = np.full((2, rows, columns), np.inf, np.float32)
    east, north, seen = np.zeros((3, rows, columns), np.float32)
    x, y = elevation_map.origin
    facets = Facets(
        blocks.facets,
        x + first_column * resolution,
        y + first_row * resolution,
        1.0 / resolution,
        blocks.level,
    )
    out = Screen(
        bits,
        relief,
        lift,
        east,
        north,
        seen,
        x + (window[2] * cells - 0.5) * resolution,
        y + (window[0] * cells - 0.5) * resolution,
        1.0 / (cells * resolution),
        bounds.cleared,
        facets,
    )
    mean = smoothed(blocks.middle, bounds.fit + 1)
    return Unjudged(blocks, mean, pad, offsets, bounds, sizes.sight, out)


@kernel
def _feel(
    i: int,
    left: int,
    blocks: Blocks,
    offsets: Ints,
    rim: Singles,
    edge: np.float32,
    s: Surface,
    highest: Singles,
) -> None:
    """What a wheel feels around each block of row i from column `left` on, its rim taken off."""
    columns = highest.shape[0]
    for n in range(offsets.shape[0]):
        k, j = i + offsets[n, 0], left + offsets[n, 1]
        x, y = np.float32(j - left) * edge, np.float32(k - i) * edge
        end = j + columns
        row = FacetRow(
            blocks.middle[k, j:end],
            blocks.above[k, j:end],
            blocks.east[k, j:end],
            blocks.north[k, j:end],
        )
        felt(row, x, y, edge, rim[n], s, highest)


@kernel
def _look_around(
    blocks: Blocks,
    mean: Singles,
    pad: int,
    offsets: ScreenOffsets,
    bounds: ScreenBounds,
    reach: float,
    out: Screen,
    first: Ints,
    ends: Ints,
) -> None:
    """Judge blocks by the ground around them; arguments as of :class:`Unjudged`.

    Of each row those from `first` to before `ends`, (rows,) each.
    """
    m, edge = bounds.fit, bounds.edge
    no_rim = np.zeros(offsets.under.shape[0], np.float32)
    for r in range(out.bits.shape[0]):
        columns = ends[r] - first[r]
        if columns <= 0:
            continue
        room = np.empty((12, columns), np.float32)
        s = Surface(
            room[0],
            room[1],
            room[2],
            room[3],
            room[4],
            room[5],
            room[6],
            room[7],
            room[8],
            room[9],
            room[10],
            room[11],
        )
        i, left, done = r + pad, pad + first[r], slice(first[r], ends[r])
        west, east = slice(left - m, left - m + columns), slice(left + m, left + m + columns)
        here = slice(left, left + columns)
        fit(mean[i][west], mean[i][here], mean[i][east], np.float32(m) * edge, s)
        bend(mean[i - m][here], mean[i][here], mean[i + m][here], np.float32(m) * edge, s)
        warp(
            mean[i - m][west],
            mean[i - m][east],
            mean[i + m][west],
            mean[i + m][east],
            np.float32(m) * edge,
            s,
        )
        room[6], room[7] = -np.float32(np.inf), np.float32(np.inf)
        for n in range(offsets.body.shape[0]):
            k, j = i + offsets.body[n, 0], left + offsets.body[n, 1]
            x, y = np.float32(j - left) * edge, np.float32(k - i) * edge
            range_of(
                blocks.top[k, j : j + columns],
                blocks.low[k, j : j + columns],
                x,
                y,
                s,
                s.highest,
                s.lowest,
            )
            if n == 8:
                # The nearest come first, this block and those beside it; on a map that shows what
                # wheels feel the body reaches farther.
                room[11] = s.lowest
        room[8], room[9], room[10] = -np.float32(np.inf), np.float32(np.inf), -np.float32(np.inf)
        _feel(i, left, blocks, offsets.near, offsets.rim, edge, s, s.near)
        # On a slope a wheel touches uphill of its middle, where its rim is no higher: none is off.
        _feel(i, left, blocks, offsets.under, no_rim, edge, s, s.under)
        for n in range(offsets.base.shape[0]):
            k, j = i + offsets.base[n, 0], left + offsets.base[n, 1]
            x, y = np.float32(j - left) * edge, np.float32(k - i) * edge
            end = j + columns
            stood_on(
                FacetRow(
                    blocks.middle[k, j:end],
                    blocks.below[k, j:end],
                    blocks.east[k, j:end],
                    blocks.north[k, j:end],
                ),
                x,
                y,
                edge,
                s,
            )
        judge_body(s, bounds, out.bits[r][done])
        out.east[r][done], out.north[r][done] = s.east, s.north
        judge_relief(s, bounds, out.relief[r][done], out.lift[r][done])
        if offsets.near.shape[0] == 0:
            out.relief[r][done], out.lift[r][done] = np.float32(0.0), np.float32(0.0)
        seen = out.seen[r][done]
        seen[:] = np.float32(reach)
        for n in range(offsets.hidden.shape[0]):
            k, j = i + offsets.hidden[n, 0], left + offsets.hidden[n, 1]
            nearest(blocks.hidden[k, j : j + columns], offsets.distance[n], seen)
        unseen(seen, np.float32(reach), out.bits[r][done])
