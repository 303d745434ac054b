"""Where the lowest point of a tyre comes to rest: it bridges gaps, and meets edges early.

A tyre in the middle of a cell rests on the highest facet under its rim; of each cell that its
footprint covers, the point nearest to the axle counts. Between cells heights are bilinear. On cells
larger than the wheel's radius, a wheel rests on the bilinear surface.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.vehicle import Vehicle
from slopewise.services.physics.heights import height_of, in_cells

_HEADINGS = 16
"""Headings over half a turn [1]: between two the end of a tyre moves by a tenth of its length."""

_GRAZED = 1e-6  # a cell that the footprint covers by less does not count [m]
_ROUNDED = 1e-9  # distance between points that are one apart from rounding [m]
_INSIDE = 0.5 - 1e-9  # of a cell from its middle [cells]: its edge would be rounded to the next
_CHUNK = 2048  # cells that are worked on together: 10 MB of points


def contact_height(
    heights: ElevationMap, x: Floats, y: Floats, heading: Floats, vehicle: Vehicle, places: int = 1
) -> Floats:
    """(M,) heights of wheels at points with headings [rad]; NaN where the surface is unknown.

    Tyres are set on ``places`` along each edge of a cell, and are linear between them: only from
    two on is one in the middle of a gap an even number of cells wide.
    """
    surface = height_of(heights, x, y)
    known = np.isfinite(surface)
    if heights.resolution > vehicle.wheel_radius or not known.any():
        return surface
    rows, columns = (places * (size - 1) + 1 for size in heights.elevation.shape)
    u, v = (places * at for at in in_cells(heights, x[known], y[known]))
    i, j = np.minimum(v.astype(np.int64), rows - 2), np.minimum(u.astype(np.int64), columns - 2)
    turn = np.rint(heading[known] * (_HEADINGS / np.pi)).astype(np.int64) % _HEADINGS
    cells = [(i + up) * columns + j + right for up in (0, 1) for right in (0, 1)]
    used, which = np.unique(np.array(cells) * _HEADINGS + turn, return_inverse=True)
    at, turns = np.divmod(used, _HEADINGS)
    at_rest = _at_places(heights, np.array(np.divmod(at, columns)), turns, places, vehicle)
    south_west, south_east, north_west, north_east = at_rest[which.reshape(4, -1)]
    p, q = u - j, v - i
    out = surface.copy()
    out[known] = (1.0 - q) * ((1.0 - p) * south_west + p * south_east) + q * (
        (1.0 - p) * north_west + p * north_east
    )
    return out


def _at_places(
    heights: ElevationMap, place: Ints, turn: Ints, places: int, vehicle: Vehicle
) -> Floats:
    """(K,) heights of tyres at (2, K) rows and columns of places, with one of the headings [m]."""
    radius, edge = vehicle.wheel_radius, heights.resolution
    half_length = math.sqrt(radius**2 - max(radius - vehicle.shape.max_step, 0.0) ** 2)
    # Between cells a tyre is as much as a cell wider than in the middle of one.
    half_width = max(0.5 * (vehicle.shape.wheel_width - edge), 0.0)
    highest = np.empty(len(turn))
    cell, beyond = np.divmod(place, places)
    kinds = np.vstack((turn, beyond))
    for kind in np.unique(kinds, axis=1).T:
        (those,) = np.nonzero((kinds == kind[:, None]).all(axis=0))
        s, up, right = _touched(half_length, half_width, edge, places, *kind.tolist())
        drop = radius - np.sqrt(radius**2 - s**2)
        for first in range(0, len(those), _CHUNK):
            part = those[first : first + _CHUNK]
            row, column = cell[0, part, None] + up, cell[1, part, None] + right
            under = np.nan_to_num(_facet_height(heights.elevation, row, column), nan=-np.inf)
            highest[part] = (under - drop).max(axis=1)
    return highest


@lru_cache(maxsize=1024)
def _touched(
    half_length: float,
    half_width: float,
    edge: float,
    places: int,
    heading: int,
    up: int,
    right: int,
) -> tuple[Floats, Floats, Floats]:
    """Of each cell under a tyre its point nearest to the axle, (P,) each.

    The tyre is ``up`` and ``right`` places from the middle of a cell.

    Returns:
        Distances along the tyre [m]; rows and columns from that cell [cells].
    """
    angle = math.pi * heading / _HEADINGS
    along = np.array([math.cos(angle), math.sin(angle)])
    axes = np.array([along, [-along[1], along[0]]])
    sides = np.maximum(np.array([half_length, half_width]) - _GRAZED, _GRAZED)
    reach = math.ceil(float(np.hypot(*sides)) / edge + 1.5)
    place = np.array([right, up]) / places
    points = []
    for row in range(-reach, reach + 1):
        for column in range(-reach, reach + 1):
            middle = edge * (np.array([column, row]) - place)
            around = _overlap(middle, edge, axes, -sides, sides)
            if len(around) == 0:
                continue
            nearest = np.clip(0.0, around[:, 0].min(), around[:, 0].max())
            low, high = np.array([nearest, -sides[1]]), np.array([nearest, sides[1]])
            across = _overlap(middle, edge, axes, low, high)[:, 1]
            s, t = nearest, np.clip(0.0, across.min(), across.max())
            east, north = np.clip((axes.T @ [s, t] - middle) / edge, -_INSIDE, _INSIDE)
            points.append([s, row + north, column + east])
    s, rows, columns = np.array(points).T
    return s, rows, columns


def _overlap(middle: Floats, edge: float, axes: Floats, low: Floats, high: Floats) -> Floats:
    """(V, 2) corners of what a cell and a rectangle have in common, in the rectangle's axes [m].

    They are corners of one inside the other, and crossings of their edges.
    """
    corners = (middle + 0.5 * edge * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])) @ axes.T
    sides = np.roll(corners, -1, axis=0) - corners
    parts = [corners, np.array([[s, t] for s in (low[0], high[0]) for t in (low[1], high[1])])]
    for axis in (0, 1):
        for limit in (low[axis], high[axis]):
            with np.errstate(divide="ignore", invalid="ignore"):
                share = (limit - corners[:, axis]) / sides[:, axis]
                parts.append(corners + share[:, None] * sides)
    points = np.concatenate(parts)
    points = points[np.isfinite(points).all(axis=1)]  # parallel edges do not cross
    from_middle = np.abs(points @ axes - middle)
    inside = np.all((points >= low - _ROUNDED) & (points <= high + _ROUNDED), axis=1)
    inside &= np.all(from_middle <= 0.5 * edge + _ROUNDED, axis=1)
    overlap: Floats = points[inside]
    return overlap


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
