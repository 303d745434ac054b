"""Contact heights by their definition, cell by cell, and slopes of a vehicle on them.

The point of a cell that a tyre may rest on is found by linear programming, where the core clips
polygons.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.ground.height_grid import Footprint

HEADINGS = 16


class Touch(NamedTuple):
    """A cell that a tyre may rest on: offsets of it and in it [cells], rim above its lowest [m]."""

    row: int
    column: int
    u: float
    v: float
    drop: float


@cache
def touched(tyre: Footprint, cell: float, heading: int) -> tuple[Touch, ...]:
    """All cells that a footprint covers, each with its point nearest to the axle."""
    angle = np.pi * heading / HEADINGS
    along = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-along[1], along[0]])
    length, width = (max(size - 1e-6, 1e-6) for size in (tyre.half_length, tyre.half_width))
    reach = int(np.hypot(length, width) / cell) + 2
    out = []
    for row in range(-reach, reach + 1):
        for column in range(-reach, reach + 1):
            low = cell * (np.array([column, row]) - 0.5)
            # x, y, |s|, |t|: as near to the axle as possible, then as near to the wheel's middle.
            rows, bounds = [], []
            for sign in (1.0, -1.0):
                rows += [[*(sign * along), -1.0, 0.0], [*(sign * across), 0.0, -1.0]]
                bounds += [0.0, 0.0]
            limits = [(low[0], low[0] + cell), (low[1], low[1] + cell), (0.0, length), (0.0, width)]
            best = linprog([0.0, 0.0, 1.0, 0.02], rows, bounds, bounds=limits)
            if best.status == 0:
                x, y, s, _ = best.x
                drop = tyre.radius - np.sqrt(tyre.radius**2 - s * s)
                out.append(Touch(row, column, x / cell - column, y / cell - row, drop))
    return tuple(out)


def _gentler(before: float, after: float) -> float:
    if not before * after > 0.0:
        return 0.0
    return before if abs(before) < abs(after) else after


def contact_height(ground: ElevationMap, tyre: Footprint, heading: int, i: int, j: int) -> float:
    """Of a tyre in the middle of a cell [m], NaN where that cell is unknown."""
    z = np.pad(ground.elevation, 1, constant_values=np.nan)
    rows, columns = ground.elevation.shape
    if np.isnan(z[i + 1, j + 1]):
        return np.nan
    highest = -np.inf
    for touch in touched(tyre, ground.resolution, heading):
        row, column = i + touch.row, j + touch.column
        if not (0 <= row < rows and 0 <= column < columns):
            continue
        r, c = row + 1, column + 1
        if np.isnan(z[r, c]):
            continue
        east = _gentler(z[r, c] - z[r, c - 1], z[r, c + 1] - z[r, c])
        north = _gentler(z[r, c] - z[r - 1, c], z[r + 1, c] - z[r, c])
        highest = max(highest, z[r, c] + touch.u * east + touch.v * north - touch.drop)
    return highest


def wheel_height(
    ground: ElevationMap, tyre: Footprint, place: tuple[float, float], yaw: float
) -> float:
    """Bilinear between the contact heights of four cells [m]."""
    heading = round(yaw * HEADINGS / np.pi) % HEADINGS
    u, v = (np.array(place) - ground.origin) / ground.resolution
    j, i = int(np.floor(u)), int(np.floor(v))
    corners = [
        [contact_height(ground, tyre, heading, i + a, j + b) for b in (0, 1)] for a in (0, 1)
    ]
    p, q = u - j, v - i
    return float(np.array([1.0 - q, q]) @ np.array(corners) @ np.array([1.0 - p, p]))
