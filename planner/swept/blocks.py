"""A map in blocks of cells: how high and how tilted each is, and whether all of it is known."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bytes, Floats, Singles
from slopewise.planner.kernels.compiled import inlined, kernel
from slopewise.planner.swept.wheel_path import gentler


class Blocks(NamedTuple):
    """Blocks of cells, (rows, columns) each; heights [m] above one level.

    Attributes:
        top, low: highest and lowest cell, NaN where none is known.
        middle: height of a plane in the middle of the block; east, north: its rise across a block.
        above, below: how far facets of cells stick out of the plane, up and down (>= 0).
        hidden: 1 where some cell is unknown.
        facets: (rows of cells, columns of cells, 4) height of each cell, NaN where unknown, its
            rise to the east and to the north over a cell, and nothing: a cell is read at once. The
            outermost cells are unknown, so that whoever looks beyond may take them instead.
        level: height of the map that all heights here are above [m].
    """

    top: Singles
    low: Singles
    middle: Singles
    east: Singles
    north: Singles
    above: Singles
    below: Singles
    hidden: Bytes
    facets: Singles
    level: float


def blocks_of(
    elevation: Floats, first_row: int, first_column: int, cells: int, shape: tuple[int, int]
) -> Blocks:
    """Gather blocks; beyond the map nothing is known.

    Args:
        elevation: (rows, columns) of the map [m].
        first_row, first_column: where the first block begins; may be below 0.
        cells: along the edge of a block. shape: rows and columns of blocks.
    """
    rows, columns = (shape[0] * cells + 2, shape[1] * cells + 2)
    part = np.full((rows, columns), np.nan, np.float32)
    row, column = first_row - 1, first_column - 1
    inside = elevation[max(row, 0) : max(row + rows, 0), max(column, 0) : max(column + columns, 0)]
    level = 0.0
    if inside.size:
        known = inside[np.isfinite(inside)]
        level = float(known[0]) if len(known) else 0.0
        i, j = max(-row, 0), max(-column, 0)
        part[i : i + inside.shape[0], j : j + inside.shape[1]] = inside - level
    facets = np.empty((rows - 2, columns - 2, 4), np.float32)
    _tilt(part, facets)
    top, low, middle, east, north, above, below = np.empty((7, *shape), np.float32)
    hidden = np.empty(shape, np.uint8)
    out = Blocks(top, low, middle, east, north, above, below, hidden, facets, level)
    _gather(cells, out)
    for edge in (facets[0], facets[-1], facets[:, 0], facets[:, -1]):
        edge[:, 0] = np.nan
    return out


@kernel
def _tilt(heights: Singles, facets: Singles) -> None:
    """Facets of heights that have a rim of one cell.

    Each cell is a plane through its own height, with the gentler of the slopes to its neighbours:
    exact on slopes, and a single high cell keeps its full height. Beside unknown ground a cell is
    level. Source: minmod limiter, Roe, Characteristic-based schemes (1986).
    """
    rows, columns, _ = facets.shape
    for i in range(rows):
        south, here, north = heights[i], heights[i + 1], heights[i + 2]
        for j in range(columns):
            height = here[j + 1]
            facets[i, j, 0] = height
            facets[i, j, 1] = gentler(height - here[j], here[j + 2] - height)
            facets[i, j, 2] = gentler(height - south[j + 1], north[j + 1] - height)
            facets[i, j, 3] = np.float32(0.0)


@kernel
def _gather(cells: int, out: Blocks) -> None:
    """Blocks of so many cells.

    The plane of a single cell is its facet; that of several is level with their mean, tilted like
    the mean of their facets.
    """
    rows, columns = out.top.shape
    if cells == 1:
        for r in range(rows):
            for c in range(columns):
                height = out.facets[r, c, 0]
                unknown = height != height
                out.top[r, c] = out.low[r, c] = out.middle[r, c] = height
                out.east[r, c] = height if unknown else out.facets[r, c, 1]
                out.north[r, c] = height if unknown else out.facets[r, c, 2]
                out.above[r, c] = out.below[r, c] = np.float32(0.0)
                out.hidden[r, c] = 1 if unknown else 0
        return
    size = cells * cells
    facets, middle = out.facets, 0.5 * (cells - 1)
    for r in range(rows):
        for c in range(columns):
            top, low, total, tilt_x, tilt_y = -np.inf, np.inf, 0.0, 0.0, 0.0
            known = 0
            for n in range(size):
                i, j = r * cells + n // cells, c * cells + n % cells
                here = facets[i, j, 0]
                if np.isnan(here):
                    continue
                known += 1
                top, low, total = max(top, here), min(low, here), total + here
                tilt_x, tilt_y = tilt_x + facets[i, j, 1], tilt_y + facets[i, j, 2]
            out.hidden[r, c] = 0 if known == size else 1
            if known == 0:
                for part in (out.top, out.low, out.middle, out.east, out.north):
                    part[r, c] = np.float32(np.nan)
                out.above[r, c] = out.below[r, c] = np.float32(0.0)
                continue
            level, tilt_x, tilt_y = total / known, tilt_x / known, tilt_y / known
            above, below = 0.0, 0.0
            for n in range(size):
                i, j = r * cells + n // cells, c * cells + n % cells
                here = facets[i, j, 0]
                if np.isnan(here):
                    continue
                off = here - level - tilt_x * (n % cells - middle) - tilt_y * (n // cells - middle)
                facet = 0.5 * (abs(facets[i, j, 1] - tilt_x) + abs(facets[i, j, 2] - tilt_y))
                above, below = max(above, off + facet), max(below, facet - off)
            out.top[r, c], out.low[r, c], out.middle[r, c] = top, low, level
            out.east[r, c], out.north[r, c] = tilt_x * cells, tilt_y * cells
            out.above[r, c], out.below[r, c] = above, below


@kernel
def smoothed(heights: Singles, beyond: int) -> Singles:
    """Means of 3 x 3 blocks, continued so many blocks into unknown ground; NaN beyond."""
    rows, columns = heights.shape
    out = np.full((rows, columns), np.float32(np.nan))
    for i in range(rows):
        for j in range(columns):
            out[i, j] = _mean_around(heights, i, j)
    for _ in range(beyond - 1):
        hidden = np.argwhere(np.isnan(out))
        found = np.empty(hidden.shape[0], np.float32)
        for n in range(hidden.shape[0]):
            found[n] = _mean_around(out, hidden[n, 0], hidden[n, 1])
        for n in range(hidden.shape[0]):
            out[hidden[n, 0], hidden[n, 1]] = found[n]
    return out


@inlined
def _mean_around(heights: Singles, i: int, j: int) -> float:
    total, known = 0.0, 0
    for k in range(max(i - 1, 0), min(i + 2, heights.shape[0])):
        for m in range(max(j - 1, 0), min(j + 2, heights.shape[1])):
            here = heights[k, m]
            seen = here == here
            total += here if seen else 0.0
            known += 1 if seen else 0
    return total / known if known > 0.0 else np.nan
