"""Heights of a map: by blocks of cells, and at any point, bilinear between the cell centres."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap


def in_cells(ground: ElevationMap, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """(column, row) of points in cells, from the centre of cell [0, 0]; any shape."""
    x0, y0 = ground.origin
    return (x - x0) / ground.resolution, (y - y0) / ground.resolution


def height_of(ground: ElevationMap, x: Floats, y: Floats) -> Floats:
    """Heights of points of any shape [m]; NaN off the map, and where a cell around is unknown."""
    rows, columns = ground.elevation.shape
    u, v = in_cells(ground, x, y)
    inside = (u >= 0.0) & (v >= 0.0) & (u <= columns - 1) & (v <= rows - 1)
    all_inside = bool(np.all(inside))  # mostly
    if not all_inside:
        u, v = np.where(inside, u, 0.0), np.where(inside, v, 0.0)
    i = np.minimum(v.astype(np.int64), rows - 2)
    j = np.minimum(u.astype(np.int64), columns - 2)
    p, q = u - j, v - i
    z, first = ground.elevation.ravel(), i * columns + j
    south_west, south_east, north_west, north_east = (
        z.take(first + step) for step in (0, 1, columns, columns + 1)
    )
    low = (1.0 - p) * south_west + p * south_east
    high = (1.0 - p) * north_west + p * north_east
    height = (1.0 - q) * low + q * high
    return height if all_inside else np.where(inside, height, np.nan)


def in_blocks(cells: Floats, edge: int, outside: float = np.nan) -> Floats:
    """(rows, edge, columns, edge): cells of square blocks, those off the map as given."""
    pad = [(0, -size % edge) for size in cells.shape]
    padded = np.pad(cells, pad, constant_values=outside)
    rows, columns = (size // edge for size in padded.shape)
    return padded.reshape(rows, edge, columns, edge)
