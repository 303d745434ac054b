"""Quadratic surfaces taken off a map around each block of a row, and what is left."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Singles
from slopewise.planner.kernels.compiled import row_pass
from slopewise.planner.swept.lanes import PLUS_ZERO


class Surface(NamedTuple):
    """Quadratic surfaces taken off along a row of blocks, and what is left; (columns,) each.

    Attributes:
        level, east, north, bend_x, bend_y, warp: coefficients, for lengths in [m].
        highest, lowest: of what is left within reach of the body.
        near, base: highest that a wheel feels on its way, its rim taken off; lowest that it stands
            on. under: highest that a wheel may touch where it stands.
        floor: lowest of what is left in this and the next blocks.
    """

    level: Singles
    east: Singles
    north: Singles
    bend_x: Singles
    bend_y: Singles
    warp: Singles
    highest: Singles
    lowest: Singles
    near: Singles
    base: Singles
    under: Singles
    floor: Singles


class FacetRow(NamedTuple):
    """Planes of a row of blocks, and how far facets stick out of them on one side; (columns,)."""

    middle: Singles
    off: Singles
    east: Singles
    north: Singles


@row_pass
def fit(west: Singles, here: Singles, east: Singles, distance: np.float32, s: Surface) -> None:
    """Height, slope and bend across."""
    per, half, two = np.float32(1.0) / distance, np.float32(0.5), np.float32(2.0)
    for j in range(here.shape[0]):
        s.level[j] = here[j]
        s.east[j] = (east[j] - west[j]) * half * per
        s.bend_x[j] = (east[j] + west[j] - two * here[j]) * per * per


@row_pass
def bend(south: Singles, here: Singles, north: Singles, distance: np.float32, s: Surface) -> None:
    """Slope and bend along."""
    per, half, two = np.float32(1.0) / distance, np.float32(0.5), np.float32(2.0)
    for j in range(here.shape[0]):
        s.north[j] = (north[j] - south[j]) * half * per
        s.bend_y[j] = (north[j] + south[j] - two * here[j]) * per * per


@row_pass
def warp(
    south_west: Singles,
    south_east: Singles,
    north_west: Singles,
    north_east: Singles,
    distance: np.float32,
    s: Surface,
) -> None:
    """The bend of both."""
    share = np.float32(0.25) / (distance * distance)
    for j in range(south_west.shape[0]):
        s.warp[j] = (north_east[j] - north_west[j] - south_east[j] + south_west[j]) * share


@row_pass
def _height(s: Surface, j: int, x: np.float32, y: np.float32) -> np.float32:
    """Of the surface of block j, so far to the east and to the north of it [m]."""
    half = np.float32(0.5)
    plane = s.level[j] + s.east[j] * x + s.north[j] * y
    height: np.float32 = plane + (
        s.bend_x[j] * (half * x * x) + s.bend_y[j] * (half * y * y) + s.warp[j] * (x * y)
    )
    return height


@row_pass
def _tilt(
    s: Surface,
    j: int,
    east: np.float32,
    north: np.float32,
    x: np.float32,
    y: np.float32,
    edge: np.float32,
) -> np.float32:
    """How far the corner of a block's plane is off the surface of block j there [m].

    Args:
        s: surfaces. j: block that one was taken off around.
        east, north: rise of the plane across its block [m].
        x, y: of the block from block j, edge: of a block [m].
    """
    half = np.float32(0.5)
    slope_x = s.east[j] + s.bend_x[j] * x + s.warp[j] * y
    slope_y = s.north[j] + s.bend_y[j] * y + s.warp[j] * x
    tilt: np.float32 = half * (abs(east - slope_x * edge) + abs(north - slope_y * edge))
    return tilt


@row_pass
def range_of(
    top: Singles,
    low: Singles,
    x: np.float32,
    y: np.float32,
    s: Surface,
    highest: Singles,
    lowest: Singles,
) -> None:
    """Highest and lowest of what is left."""
    for j in range(top.shape[0]):
        surface = _height(s, j, x, y)
        above, below, up, down = top[j] - surface, low[j] - surface, highest[j], lowest[j]
        # A comparison with an unknown height is false: what is known decides.
        highest[j] = (above if above > up else up) + PLUS_ZERO
        lowest[j] = (below if below < down else down) + PLUS_ZERO


@row_pass
def felt(
    row: FacetRow,
    x: np.float32,
    y: np.float32,
    edge: np.float32,
    rim: np.float32,
    s: Surface,
    highest: Singles,
) -> None:
    """Highest of what is left in a block, its facets against the slope of the surface there."""
    middle, off, east, north = row.middle, row.off, row.east, row.north
    for j in range(middle.shape[0]):
        level, tilt = _height(s, j, x, y), _tilt(s, j, east[j], north[j], x, y, edge)
        felt, most = middle[j] + off[j] + tilt - level - rim, highest[j]
        highest[j] = (felt if felt > most else most) + PLUS_ZERO


@row_pass
def stood_on(row: FacetRow, x: np.float32, y: np.float32, edge: np.float32, s: Surface) -> None:
    """Lowest of what is left in a block, its facets against the slope of the surface there."""
    middle, off, east, north = row.middle, row.off, row.east, row.north
    for j in range(middle.shape[0]):
        level, tilt = _height(s, j, x, y), _tilt(s, j, east[j], north[j], x, y, edge)
        stands, least = middle[j] - off[j] - tilt - level, s.base[j]
        s.base[j] = (stands if stands < least else least) + PLUS_ZERO
