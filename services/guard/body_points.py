"""Points that stand for a body and its wheels, grouped by tiles that are looked up as a whole."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.vehicle import Vehicle
from slopewise.services.guard.guard_map import SPACING, TILE

_ROUNDING = 1e-4  # of places of the body in single precision [m]

ROWS = np.array(((0, 2, 3), (1, 3, 2), (4, 5, 6)))
"""Rows of poses that x, y and underside of points depend on, see ``SweptBody``."""


class BodyPoints(NamedTuple):
    """Points of the body, Q in each of the T tiles that cover it; some repeat."""

    ahead: Floats  # (T, Q) ahead, left: place in the body [m]
    left: Floats
    normal_ahead: Floats  # (T, Q) outward normal of the outline, 0 within it [1]
    normal_left: Floats
    wheel: Bools  # (T, Q) under a wheel
    main: Bools  # (T, Q) at a rim or the middle of it
    tiles: Floats  # (3, T, 3) x, y [cells] and underside [m] of their middles from :data:`ROWS`
    # (6, P) beyond the body without errors, ahead and left: place, nearest place of that body [m],
    # and direction from there [1]
    beyond: Floats
    size: tuple[float, float, float]  # front, rear, half width of the body without errors [m]


@lru_cache(maxsize=1024)
def body_points(
    vehicle: Vehicle,
    reach: tuple[float, float],
    cell: float,
    band: float,
    growth: float,
    along_track: float,
) -> BodyPoints:
    """Wheels, outline and three rows across the underside, at most :data:`SPACING` apart."""
    front, rear = reach[0] + along_track, reach[1] + along_track
    side, half = 0.5 * vehicle.shape.width, 0.5 * vehicle.wheelbase
    end = side + band + growth * max(front, rear)
    across = np.linspace(-end, end, math.ceil(2.0 * end / SPACING) + 1)
    along = np.linspace(-rear, front, math.ceil((front + rear) / SPACING) + 1)
    tyre = 0.5 * vehicle.shape.wheel_width + band + growth * half
    within = np.linspace(-1.0, 1.0, math.ceil(2.0 * tyre / SPACING) + 1)[1:-1]
    tyres = 0.5 * vehicle.track_width + tyre * np.append((-1.0, 0.0, 1.0), within)
    sides = side + band + growth * np.abs(along)
    tyres = np.concatenate((tyres, -tyres))
    parts: list[tuple[Floats | float, Floats | float, float, float]] = [
        (half, tyres, 0.0, 0.0),
        (-half, tyres, 0.0, 0.0),
        (front, across, 1.0, 0.0),
        (-rear, across, -1.0, 0.0),
        (along, sides, 0.0, 1.0),
        (along, -sides, 0.0, -1.0),
        *((place, across[1:-1], 0.0, 0.0) for place in (half, 0.0, -half)),
    ]
    columns = [np.array(np.broadcast_arrays(*part, np.zeros(1))) for part in parts]
    points: Floats = np.concatenate(columns, axis=1).astype(np.float32)
    points[4, : 2 * len(tyres)] = np.tile(np.arange(len(tyres) // 2) < 3, 4) + 1.0
    station, lateral = np.meshgrid(along, across)
    is_within = np.abs(lateral) < side + band + growth * np.abs(station)
    inside = np.stack((station[is_within], lateral[is_within]))
    places = np.concatenate((points[:2], inside), axis=1)
    nearest = np.clip(places, ((-reach[1],), (-side,)), ((reach[0],), (side,)))
    away = np.hypot(*(places - nearest))
    places, nearest, away = (of[..., away > _ROUNDING] for of in (places, nearest, away))
    of_beyond = np.concatenate((places, nearest, (places - nearest) / away))
    beyond: Floats = of_beyond.astype(np.float32)
    return _by_tiles(points, front, rear, cell, (*reach, side))._replace(beyond=beyond)


def _by_tiles(
    points: Floats, front: float, rear: float, cell: float, size: tuple[float, float, float]
) -> BodyPoints:
    """Points (5, P), see :class:`BodyPoints`, by the tiles of their bounding rectangle."""
    side = float(points[1].max())
    columns, rows = (math.ceil(size / TILE - 1e-6) for size in (front + rear, 2.0 * side))
    length, width = (front + rear) / columns, 2.0 * side / rows
    i = np.clip((points[0] + rear) / length, 0, columns - 1).astype(int)
    j = np.clip((points[1] + side) / width, 0, rows - 1).astype(int)
    tiles, tile_of = np.unique(i + columns * j, return_inverse=True)
    ahead, left, normal_ahead, normal_left, wheel = points[:, _rows(tile_of)]
    j, i = np.divmod(tiles, columns)
    a, b = (i + 0.5) * length - rear, (j + 0.5) * width - side
    rows_of = (1.0, a / cell, -b / cell), (1.0, a / cell, b / cell), (1.0, a, b)
    stacked = [np.stack(np.broadcast_arrays(*row), axis=1) for row in rows_of]
    matrix: Floats = np.array(stacked).astype(np.float32)
    of_points = ahead, left, normal_ahead, normal_left, wheel > 0.0, wheel > 1.0
    return BodyPoints(*of_points, matrix, np.empty((6, 0)), size)


def _rows(id_of: Ints) -> Ints:
    """Indices of each id as rows of one length; shorter ones repeat."""
    counts = np.bincount(id_of)[:, None]
    column = np.arange(counts.max()) % counts
    rows: Ints = np.argsort(id_of, kind="stable")[np.cumsum(counts)[:, None] - counts + column]
    return rows
