"""Where the lowest point of a tyre comes to rest: it bridges gaps, and meets edges early.

A tyre in the middle of a cell rests on the highest facet under its rim, points of its footprint
taken apart. Between cells heights are bilinear. On cells larger than the wheel's radius, a wheel
rests on the bilinear surface.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.vehicle import Vehicle
from slopewise.services.check.heights import Heights, height_of, in_cells

_HEADINGS = 16
"""Headings over half a turn [1]: between two the end of a tyre moves by a tenth of its length."""

_POINTS_PER_CELL = 6  # along a tyre; across it its edges and its middle
_CHUNK = 2048  # cells that are worked on together: 10 MB of points


def contact_height(
    heights: Heights, x: Floats, y: Floats, heading: Floats, vehicle: Vehicle
) -> Floats:
    """(M,) heights of wheels at points with headings [rad]; NaN where the surface is unknown."""
    surface = height_of(heights, x, y)
    known = np.isfinite(surface)
    if heights.resolution > vehicle.wheel_radius or not known.any():
        return surface
    rows, columns = heights.elevation.shape
    u, v = in_cells(heights, x[known], y[known])
    i, j = np.minimum(v.astype(np.int64), rows - 2), np.minimum(u.astype(np.int64), columns - 2)
    turn = np.rint(heading[known] * (_HEADINGS / np.pi)).astype(np.int64) % _HEADINGS
    cells = [(i + up) * columns + j + right for up in (0, 1) for right in (0, 1)]
    used, which = np.unique(np.array(cells) * _HEADINGS + turn, return_inverse=True)
    at_rest = _at_cells(heights, used // _HEADINGS, used % _HEADINGS, vehicle)
    south_west, south_east, north_west, north_east = at_rest[which.reshape(4, -1)]
    p, q = u - j, v - i
    out = surface.copy()
    out[known] = (1.0 - q) * ((1.0 - p) * south_west + p * south_east) + q * (
        (1.0 - p) * north_west + p * north_east
    )
    return out


def _at_cells(heights: Heights, cells: Ints, turn: Ints, vehicle: Vehicle) -> Floats:
    """(K,) heights of tyres in the middle of known cells, with one of the headings each [m]."""
    columns, radius, edge = heights.elevation.shape[1], vehicle.wheel_radius, heights.resolution
    shape = vehicle.shape
    half_length = np.sqrt(radius**2 - max(radius - shape.max_step, 0.0) ** 2)
    # Between cells a tyre is as much as a cell wider than in the middle of one.
    half_width = max(0.5 * (shape.wheel_width - edge), 0.0)
    count = int(np.ceil(half_length / edge * _POINTS_PER_CELL))
    along, across = np.meshgrid(
        np.linspace(-half_length, half_length, 2 * count + 1),
        half_width * np.linspace(-1.0, 1.0, 2 * int(np.ceil(half_width / edge)) + 1),
    )
    s, t = along.ravel(), across.ravel()
    drop = radius - np.sqrt(radius**2 - s**2)
    highest = np.empty(len(cells))
    for first in range(0, len(cells), _CHUNK):
        part = slice(first, first + _CHUNK)
        angle = (np.pi / _HEADINGS) * turn[part, None]
        row = cells[part, None] // columns + (np.sin(angle) * s + np.cos(angle) * t) / edge
        column = cells[part, None] % columns + (np.cos(angle) * s - np.sin(angle) * t) / edge
        under = np.nan_to_num(_facet_height(heights.elevation, row, column), nan=-np.inf)
        highest[part] = (under - drop).max(axis=1)
    return highest


def _facet_height(z: Floats, row: Floats, column: Floats) -> Floats:
    """Of the plane of the cell at a point, which has the gentler of the slopes to its neighbours.

    A cell is level where its neighbours are both higher, both lower, or one is unknown.
    """
    i, j = np.rint(row).astype(np.int64), np.rint(column).astype(np.int64)

    def cell(up: int, right: int) -> Floats:
        r, c = i + up, j + right
        inside = (r >= 0) & (c >= 0) & (r < z.shape[0]) & (c < z.shape[1])
        return np.where(inside, z[r.clip(0, z.shape[0] - 1), c.clip(0, z.shape[1] - 1)], np.nan)

    here = cell(0, 0)
    slopes = []
    for up, right in ((1, 0), (0, 1)):
        before, after = here - cell(-up, -right), cell(up, right) - here
        gentler = np.where(np.abs(before) < np.abs(after), before, after)
        slopes.append(np.where(before * after > 0.0, gentler, 0.0))
    return here + slopes[0] * (row - i) + slopes[1] * (column - j)
