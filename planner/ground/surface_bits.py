"""Which terrain classes a vehicle touches along each candidate, as bits of an integer."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.planner.ground.footprint import POINTS, CellFrame, CellPoses, offset, on_grid
from slopewise.planner.kernels.compiled import inlined, kernel, row_pass


@kernel
def surfaces_under_wheels(
    terrain_class: Ints,
    frame: CellFrame,
    x: Floats,
    y: Floats,
    heading_x: Floats,
    heading_y: Floats,
    half: tuple[float, float],
    surfaces: Ints,
) -> None:
    """Collect the classes around the points of the footprint.

    Args:
        terrain_class: (rows, cols) class of each cell.
        frame: of the map.
        x, y, heading_x, heading_y: (N, M) candidates.
        half: length and width of the footprint, halved [m].
        surfaces: (N, M) out, bit c is set where class c is touched.
    """
    stations, candidates = x.shape
    poses = CellPoses(
        np.empty(candidates), np.empty(candidates), np.empty(candidates), np.empty(candidates)
    )
    cell = np.empty(candidates, np.int64)
    east, north = np.empty(candidates, np.int64), np.empty(candidates, np.int64)
    for k in range(stations):
        on_grid(frame, x[k], y[k], heading_x[k], heading_y[k], poses)
        surfaces[k] = 0
        for point in range(POINTS):
            ahead, aside = offset(point, half[0], half[1])
            _corner(terrain_class, poses, ahead, aside, cell, east, north)
            _touch(terrain_class, cell, east, north, surfaces[k])


@row_pass
def _corner(
    terrain_class: Ints,
    poses: CellPoses,
    ahead: float,
    aside: float,
    cell: Ints,
    east: Ints,
    north: Ints,
) -> None:
    """South-west one of the four cells that a point's height is taken from, and the way to others.

    −1 off the map; at its rim the cells beyond are taken to be those before.
    """
    rows, columns = terrain_class.shape
    right, top = columns - 1.0, rows - 1.0
    centre_u, centre_v, ahead_u, ahead_v = poses
    for j in range(cell.shape[0]):
        column = np.floor(centre_u[j] + ahead * ahead_u[j] - aside * ahead_v[j])
        row = np.floor(centre_v[j] + ahead * ahead_v[j] + aside * ahead_u[j])
        inside = (column >= -1.0) & (row >= -1.0) & (column <= right) & (row <= top)
        column = column if inside else 0.0
        row = row if inside else 0.0
        east[j] = 1 if (column >= 0.0) & (column < right) else 0
        north[j] = columns if (row >= 0.0) & (row < top) else 0
        corner = int(max(row, 0.0) * columns + max(column, 0.0))
        cell[j] = corner if inside else -1


@inlined
def _touch(terrain_class: Ints, cell: Ints, east: Ints, north: Ints, surfaces: Ints) -> None:
    """Add the classes of all four cells: no strip is stepped over."""
    flat = terrain_class.reshape(terrain_class.size)
    for j in range(cell.shape[0]):
        if cell[j] >= 0:
            south = np.uint64(cell[j])  # unsigned: no index counts from the end
            beyond = np.uint64(cell[j] + north[j])
            step = np.uint64(east[j])
            bits = (1 << flat[south]) | (1 << flat[south + step])
            surfaces[j] |= bits | (1 << flat[beyond]) | (1 << flat[beyond + step])
