"""Which part of a map candidates ask about: of each row of blocks those between the outermost.

Candidates fan out or run side by side, so there is little between them that none of them is near.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.kernels.compiled import kernel
from slopewise.planner.swept.screen_reach import cells_of
from slopewise.planner.swept.sizes import SweptSizes


class Around(NamedTuple):
    """Blocks of a map.

    Attributes:
        window: first row, end row, first column, end column of all that is looked at closer.
        first, ends: (rows,) of each row of the window the blocks that are asked about: the first
            column and the one behind the last, counted from the window's first; none where the
            row has none.
    """

    window: tuple[int, int, int, int]
    first: Ints
    ends: Ints

    def holds(self, other: Around) -> bool:
        """Whether all of the other, of the same map and vehicle, is in this one."""
        top, end, left, right = self.window
        if not (
            top <= other.window[0]
            and other.window[1] <= end
            and left <= other.window[2]
            and other.window[3] <= right
        ):
            return False
        rows = slice(other.window[0] - top, other.window[1] - top)
        shift = other.window[2] - left
        first, ends = other.first + shift, other.ends + shift
        held = (self.first[rows] <= first) & (ends <= self.ends[rows])
        return bool(np.all(held | (other.ends <= other.first)))

    def within(self, other: Around) -> Around:
        """What the other, of the same map, asks about and is in this one: one piece of each row.

        Where nothing is, the piece is empty and lies at the end of the other's.
        """
        first, ends = other.ends.copy(), other.ends.copy()
        top, end = max(self.window[0], other.window[0]), min(self.window[1], other.window[1])
        if top < end:
            here = slice(top - other.window[0], end - other.window[0])
            there = slice(top - self.window[0], end - self.window[0])
            shift = self.window[2] - other.window[2]
            low = np.maximum(self.first[there] + shift, other.first[here])
            high = np.minimum(self.ends[there] + shift, other.ends[here])
            both = low < high
            first[here][both], ends[here][both] = low[both], high[both]
        return Around(other.window, first, ends)


def around(
    elevation_map: ElevationMap, sizes: SweptSizes, x: Floats, y: Floats, beside: float = 0.0
) -> Around:
    """What poses with their middles at such positions ask about.

    Args:
        elevation_map: ground. sizes: of the vehicle.
        x, y: (N, M) positions [m]; those beyond the map ask about its edge.
        beside: share of the extent of all positions by which more is taken.
    """
    cells = cells_of(sizes, elevation_map.resolution)
    per = 1.0 / (cells * elevation_map.resolution)
    rows, columns = (-(-n // cells) for n in elevation_map.elevation.shape)
    half = 0.5 / cells  # Heights are those of the middles of cells.
    x_0, y_0 = elevation_map.origin
    v, row, end_row = _blocks(y, y_0, per, half, rows)
    u, column, end_column = _blocks(x, x_0, per, half, columns)
    more = beside * max(end_row - row, end_column - column)
    far = math.ceil(sizes.reach * per + more) + 1
    # The sweep follows wheels to where blocks that are asked about end, and looks ahead there.
    margin = far + math.ceil(max(sizes.reach, sizes.wheel_look * sizes.fine) * per)
    window = (
        max(row - margin, 0),
        min(end_row + margin, rows),
        max(column - margin, 0),
        min(end_column + margin, columns),
    )
    shape = (window[1] - window[0], window[3] - window[2])
    first, ends = _between(v - window[0], u - window[2], far, *shape)
    return Around(window, first, ends)


def _blocks(
    at: Floats, origin: float, per: float, half: float, count: int
) -> tuple[Floats, int, int]:
    """Positions in blocks, the first block that they touch, and the one behind the last."""
    blocks = np.clip((at - origin) * per + half, 0.0, count - 1.0)
    return blocks, int(blocks.min()), int(blocks.max()) + 1


@kernel
def _between(v: Floats, u: Floats, far: int, rows: int, columns: int) -> tuple[Ints, Ints]:
    """Of each row the first block and the one behind the last, so many blocks around positions."""
    left, right = np.full(rows, columns), np.full(rows, -1)
    for k in range(v.shape[0]):
        for j in range(v.shape[1]):
            row, column = int(v[k, j]), int(u[k, j])
            left[row] = min(left[row], column)
            right[row] = max(right[row], column)
    first, ends = np.zeros(rows, np.int64), np.zeros(rows, np.int64)
    for row in range(rows):
        low, high = columns, -1
        for near in range(max(row - far, 0), min(row + far + 1, rows)):
            low, high = min(low, left[near]), max(high, right[near])
        if high >= 0:
            first[row], ends[row] = max(low - far, 0), min(high + far + 1, columns)
    return first, ends
