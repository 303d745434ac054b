"""Where a map could bar a vehicle at all, whatever its heading: most ground needs no closer look.

Around each block of cells a quadratic surface is taken off. Wheels and body follow planes exactly;
four wheels at one distance from the middle follow a bowl; what a saddle costs is bounded by its
curvature, and all else by the range of what is left. A step is looked for in what is left, too: the
slope of the surface explains the rest of a climb. So the screen may send a pose that is free to
:mod:`planner.swept.sweep`, and clears none that it bars, but for climbs within a few millimetres of
what is barred: the sweep counts a little less of a step and of the slope around it, for what a map
does not show (``cleared`` of :class:`planner.swept.sizes.SweptSizes`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from models.arrays import Bytes, Ints, Singles
from planner.ground.elevation_map import ElevationMap
from planner.kernels.compiled import kernel
from planner.swept.blocks import Blocks, blocks_of, smoothed
from planner.swept.screen_reach import ScreenBounds, ScreenOffsets, bounds_of, cells_of, offsets_of
from planner.swept.sizes import SweptSizes
from planner.swept.surfaces import FacetRow, Surface, bend, felt, fit, range_of, stood_on, warp
from planner.swept.tyre_profile import Facets
from planner.swept.verdicts import judge_body, judge_relief, nearest, unseen


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
    """Blocks that are gathered, with `pad` of them around, and a screen to be filled.

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

    def part(self, here: tuple[slice, slice], around: tuple[slice, slice]) -> Unjudged:
        """Some rows and columns of the screen, which lie so among the blocks."""
        b, out = self.blocks, self.out
        return self._replace(
            blocks=b._replace(
                top=b.top[around], low=b.low[around], middle=b.middle[around],
                east=b.east[around], north=b.north[around], above=b.above[around],
                below=b.below[around], hidden=b.hidden[around],
            ),
            mean=self.mean[around],
            out=out._replace(
                bits=out.bits[here], relief=out.relief[here], lift=out.lift[here],
                east=out.east[here], north=out.north[here], seen=out.seen[here],
            ),
        )  # fmt: skip


def screen_of(
    elevation_map: ElevationMap, sizes: SweptSizes, window: tuple[int, int, int, int]
) -> Screen:
    """Look over a part of a map.

    Args:
        elevation_map: ground.
        sizes: of the vehicle.
        window: first row, end row, first column, end column.
    """
    unfinished = unjudged(elevation_map, sizes, window)
    look_over(unfinished)
    return unfinished.out


def look_over(unfinished: Unjudged) -> None:
    """Judge every block of a screen."""
    _look_around(*unfinished)


def unjudged(
    elevation_map: ElevationMap, sizes: SweptSizes, window: tuple[int, int, int, int]
) -> Unjudged:
    """Gather the blocks of a part of a map; arguments as of :func:`screen_of`."""
    resolution = elevation_map.resolution
    cells = cells_of(sizes, resolution)
    offsets, bounds = offsets_of(sizes, cells, resolution), bounds_of(sizes, cells, resolution)
    widest = max(int(np.abs(part).max(initial=0)) for part in (offsets.body, offsets.near))
    pad = 2 + max(widest, bounds.fit)
    rows = math.ceil((window[1] - window[0]) / cells)
    columns = math.ceil((window[3] - window[2]) / cells)
    first_row, first_column = window[0] - pad * cells, window[2] - pad * cells
    blocks = blocks_of(
        elevation_map.elevation, first_row, first_column, cells,
        (rows + 2 * pad, columns + 2 * pad),
    )  # fmt: skip
    bits = np.empty((rows, columns), np.uint8)
    relief, lift, east, north, seen = np.empty((5, rows, columns), np.float32)
    x, y = elevation_map.origin
    facets = Facets(
        blocks.facets, x + first_column * resolution, y + first_row * resolution, 1.0 / resolution,
        blocks.level,
    )  # fmt: skip
    out = Screen(
        bits, relief, lift, east, north, seen, x + (window[2] - 0.5) * resolution,
        y + (window[0] - 0.5) * resolution, 1.0 / (cells * resolution),
        bounds.cleared, facets,
    )  # fmt: skip
    mean = smoothed(blocks.middle, bounds.fit + 1)
    return Unjudged(blocks, mean, pad, offsets, bounds, sizes.reach, out)


@kernel
def _feel(
    i: int, pad: int, blocks: Blocks, offsets: Ints, rim: Singles, edge: np.float32, s: Surface,
    highest: Singles,
) -> None:  # fmt: skip
    """What a wheel feels around each block of row i, its rim taken off."""
    columns = highest.shape[0]
    for n in range(offsets.shape[0]):
        k, j = i + offsets[n, 0], pad + offsets[n, 1]
        x, y = np.float32(j - pad) * edge, np.float32(k - i) * edge
        end = j + columns
        row = FacetRow(
            blocks.middle[k, j:end], blocks.above[k, j:end], blocks.east[k, j:end],
            blocks.north[k, j:end],
        )  # fmt: skip
        felt(row, x, y, edge, rim[n], s, highest)


@kernel
def _look_around(
    blocks: Blocks, mean: Singles, pad: int, offsets: ScreenOffsets, bounds: ScreenBounds,
    reach: float, out: Screen,
) -> None:  # fmt: skip
    """Judge every block by the ground around it; arguments as of :class:`Unjudged`."""
    rows, columns = out.bits.shape
    room = np.empty((12, columns), np.float32)
    s = Surface(
        room[0], room[1], room[2], room[3], room[4], room[5], room[6], room[7], room[8], room[9],
        room[10], room[11],
    )  # fmt: skip
    m, edge = bounds.fit, bounds.edge
    west, east = slice(pad - m, pad - m + columns), slice(pad + m, pad + m + columns)
    here = slice(pad, pad + columns)
    for r in range(rows):
        i = r + pad
        fit(mean[i][west], mean[i][here], mean[i][east], np.float32(m) * edge, s)
        bend(mean[i - m][here], mean[i][here], mean[i + m][here], np.float32(m) * edge, s)
        warp(
            mean[i - m][west], mean[i - m][east], mean[i + m][west], mean[i + m][east],
            np.float32(m) * edge, s,
        )  # fmt: skip
        room[6], room[7] = -np.float32(np.inf), np.float32(np.inf)
        for n in range(offsets.body.shape[0]):
            k, j = i + offsets.body[n, 0], pad + offsets.body[n, 1]
            x, y = np.float32(j - pad) * edge, np.float32(k - i) * edge
            range_of(
                blocks.top[k, j : j + columns], blocks.low[k, j : j + columns], x, y, s,
                s.highest, s.lowest,
            )  # fmt: skip
            if n == 8:
                # The nearest come first, this block and those beside it; on a map that shows what
                # wheels feel the body reaches farther.
                room[11] = s.lowest
        room[8], room[9], room[10] = -np.float32(np.inf), np.float32(np.inf), -np.float32(np.inf)
        _feel(i, pad, blocks, offsets.near, offsets.rim, edge, s, s.near)
        _feel(i, pad, blocks, offsets.under, offsets.arch, edge, s, s.under)
        for n in range(offsets.base.shape[0]):
            k, j = i + offsets.base[n, 0], pad + offsets.base[n, 1]
            x, y = np.float32(j - pad) * edge, np.float32(k - i) * edge
            end = j + columns
            stood_on(
                FacetRow(
                    blocks.middle[k, j:end], blocks.below[k, j:end], blocks.east[k, j:end],
                    blocks.north[k, j:end],
                ),
                x, y, edge, s,
            )  # fmt: skip
        judge_body(s, bounds, out.bits[r])
        out.east[r], out.north[r] = s.east, s.north
        judge_relief(s, bounds, out.relief[r], out.lift[r])
        if offsets.near.shape[0] == 0:
            out.relief[r], out.lift[r] = np.float32(0.0), np.float32(0.0)
        seen = out.seen[r]
        seen[:] = np.float32(reach)
        for n in range(offsets.hidden.shape[0]):
            k, j = i + offsets.hidden[n, 0], pad + offsets.hidden[n, 1]
            nearest(blocks.hidden[k, j : j + columns], offsets.distance[n], seen)
        unseen(seen, np.float32(reach), out.bits[r])
