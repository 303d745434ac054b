"""Which terrain classes a vehicle touches along each candidate, as bits of an integer."""

from __future__ import annotations

import numpy as np

from planner.compiled import Floats, Ints, kernel, row_pass
from planner.footprint import POINTS, offset, on_grid

MAX_CLASSES = 62
"""Surfaces one map can tell apart: a station keeps those under its wheels as bits of an int64."""


@kernel
def surfaces_under_wheels(
    terrain_class: Ints, origin_x: float, origin_y: float, per_metre: float,
    x: Floats, y: Floats, heading_x: Floats, heading_y: Floats,
    half_length: float, half_width: float, surfaces: Ints,
) -> None:  # fmt: skip
    """Collect the classes around the points of the footprint.

    Args:
        terrain_class: (rows, cols) class of each cell.
        origin_x, origin_y: centre of cell [0, 0] [m]; per_metre: cells in a metre.
        x, y, heading_x, heading_y: (N, M) candidates.
        half_length, half_width: of the footprint [m].
        surfaces: (N, M) out, bit c is set where class c is touched.
    """
    stations, candidates = x.shape
    u, v = np.empty(candidates), np.empty(candidates)
    ahead_u, ahead_v = np.empty(candidates), np.empty(candidates)
    for k in range(stations):
        on_grid(
            origin_x, origin_y, per_metre, x[k], y[k], heading_x[k], heading_y[k],
            u, v, ahead_u, ahead_v,
        )  # fmt: skip
        surfaces[k] = 0
        for point in range(POINTS):
            ahead, aside = offset(point, half_length, half_width)
            _touch(terrain_class, u, v, ahead_u, ahead_v, ahead, aside, surfaces[k])


@row_pass
def _touch(
    terrain_class: Ints, centre_u: Floats, centre_v: Floats, ahead_u: Floats, ahead_v: Floats,
    ahead: float, aside: float, surfaces: Ints,
) -> None:  # fmt: skip
    """The four cells that a point's height is taken from: no strip is stepped over."""
    rows, columns = terrain_class.shape
    flat = terrain_class.reshape(terrain_class.size)
    right, top = columns - 1.0, rows - 1.0
    for j in range(surfaces.shape[0]):
        before = surfaces[j]
        column = np.floor(centre_u[j] + ahead * ahead_u[j] - aside * ahead_v[j])
        row = np.floor(centre_v[j] + ahead * ahead_v[j] + aside * ahead_u[j])
        inside = (column >= -1.0) & (row >= -1.0) & (column <= right) & (row <= top)
        column = column if inside else 0.0
        row = row if inside else 0.0
        # At the rim of the map the cells beyond it are taken to be those before it.
        west, east = max(column, 0.0), min(column + 1.0, right)
        south, north = max(row, 0.0) * columns, min(row + 1.0, top) * columns
        bits = 1 << flat[np.uint64(south + west)]
        bits |= 1 << flat[np.uint64(south + east)]
        bits |= 1 << flat[np.uint64(north + west)]
        bits |= 1 << flat[np.uint64(north + east)]
        surfaces[j] = before | bits if inside else before
