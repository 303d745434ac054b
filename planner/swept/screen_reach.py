"""Which blocks around a block decide what is met there, and the numbers that judge it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Ints, Singles
from slopewise.planner.swept.sizes import DIAGONAL, SweptSizes
from slopewise.planner.swept.wheel_path import rim_at

_BLOCKS = 6.0
"""Blocks to the wheelbase."""

_FITTED = 1.1
"""The surface is taken off points at this share of the distance to the wheels."""

ROUNDING = 1e-3
"""Taken off every limit of the screen [m]: it works with float32 heights above one of the window,
of which some 16 roundings of 2⁻²⁴ meet in a difference: 1 mm on a relief of 1 km."""

_HALF_DIAGONAL = 0.5 * DIAGONAL
"""Half the diagonal of a square over its edge [1]."""


def cells_of(sizes: SweptSizes, resolution: float) -> int:
    """Cells along the edge of a block."""
    return max(round(2.0 * sizes.half_length / _BLOCKS / resolution), 1)


class ScreenBounds(NamedTuple):
    """Numbers of :func:`slopewise.planner.swept.screen.screen_of`, as float32 [m].

    Attributes:
        fit: distance of the points that a surface is taken off [blocks]; edge: of a block.
        corner: from the middle of a block to that of its outermost cell.
        body_sq, wheel_sq, saddle_sq: squares of the reach of the body and of the wheels; and by
            how much more the saddle counts.
        spread: share of the range that counts for the body. clearance: of the vehicle.
        cleared: climb that is no step, beyond the slope around. chord: over
            which. apart: of the climb from the middle of the block at most.
        radius: of the wheel. near: reach of its climb.
        between: by how much ground between cells is off what bends by 1/m, for body and wheels
            together [m²]; 0 where the margin of the body is more.
    """

    fit: int
    edge: np.float32
    corner: np.float32
    body_sq: np.float32
    wheel_sq: np.float32
    saddle_sq: np.float32
    spread: np.float32
    clearance: np.float32
    cleared: np.float32
    chord: np.float32
    apart: np.float32
    radius: np.float32
    near: np.float32
    between: np.float32


class ScreenOffsets(NamedTuple):
    """Blocks around a block: (k, 2) rows and columns each, and a length [m] for each of some.

    Attributes:
        body: that body and wheels reach.
        base: in which a wheel's climb or fall may begin or end.
        near, rim: that a wheel feels when it climbs; how far its rim is above them at least.
        under: that a wheel may touch where it stands.
        hidden, distance: that have to be known; how far they are at least.
    """

    body: Ints
    base: Ints
    near: Ints
    rim: Singles
    under: Ints
    hidden: Ints
    distance: Singles


def _around(reach: float, edge: float) -> Floats:
    """(k, 3) rows and columns of blocks whose middle is within reach, and distances [m]."""
    far = math.floor(reach / edge)
    row, column = (part.ravel() for part in np.mgrid[-far : far + 1, -far : far + 1])
    distance = edge * np.hypot(row, column)
    order = np.argsort(distance, kind="stable")
    inside = order[distance[order] <= reach]
    found: Floats = np.column_stack([row, column, distance])[inside]
    return found


def offsets_of(sizes: SweptSizes, cells: int, resolution: float) -> ScreenOffsets:
    """Blocks of so many cells that decide, on cells of this size [m]."""
    edge = cells * resolution
    half = _HALF_DIAGONAL * edge
    corner = _HALF_DIAGONAL * (edge - resolution)
    # Facets lean on the cell beside them.
    wheels = sizes.wheel_reach + (sizes.radius + sizes.half_tyre + resolution) * sizes.fine
    # Ground between cells counts where the body ends.
    outline = math.hypot(max(sizes.front, sizes.rear), sizes.side)
    wheels += DIAGONAL * resolution * (not sizes.fine)
    body = max(sizes.reach, outline + DIAGONAL * resolution, wheels) + half + corner
    # A climb begins or ends at most so far from where the wheel is.
    swept = max(sizes.chord, resolution)
    around = _around(swept + sizes.radius + sizes.half_tyre + 2.0 * half, edge)
    if not sizes.fine:
        around = around[:0]
    # From somewhere in a block to somewhere in another; a tyre is wider than its middle.
    gap = edge * np.hypot(*np.maximum(np.abs(around[:, :2].T) - 1.0, 0.0))
    along = np.sqrt(np.maximum(gap**2 - sizes.half_tyre**2, 0.0))
    away = np.maximum(along - swept, 0.0)
    felt, stands = away < sizes.radius, along < sizes.radius
    hidden = _around(sizes.sight + 2.0 * half, edge)

    def steps(of: Floats) -> Ints:
        return np.ascontiguousarray(of[:, :2]).astype(np.int64)

    return ScreenOffsets(
        steps(_around(body, edge)),
        steps(around[gap < swept]),
        steps(around[felt]),
        rim_at(sizes.radius, away[felt]).astype(np.float32),
        steps(around[stands]),
        steps(hidden),
        (hidden[:, 2] - 2.0 * half).astype(np.float32),
    )


def bounds_of(sizes: SweptSizes, cells: int, resolution: float) -> ScreenBounds:
    """What a vehicle is judged by on such blocks."""
    edge = cells * resolution
    # Weights of the wheels in the height of their plane under the corner of the body.
    u = (max(sizes.front, sizes.rear) + sizes.margin) / sizes.half_length
    v = (sizes.side + sizes.margin) / sizes.half_width
    negative = 0.25 * sum(max(w, 0.0) for w in (u + v - 1.0, u - v - 1.0, v - u - 1.0))
    f = np.float32
    return ScreenBounds(
        fit=max(round(_FITTED * sizes.wheel_reach / edge), 1),
        edge=f(edge),
        corner=f(_HALF_DIAGONAL * (edge - resolution)),
        body_sq=f(sizes.reach**2),
        wheel_sq=f(sizes.wheel_reach**2),
        saddle_sq=f(abs(sizes.half_length**2 - sizes.half_width**2)),
        spread=f(1.0 + negative),
        clearance=f(sizes.clearance - ROUNDING),
        cleared=f(sizes.cleared - ROUNDING),
        chord=f(sizes.chord),
        apart=f(_HALF_DIAGONAL * edge + max(sizes.chord, resolution) + 0.5 * sizes.chord),
        radius=f(sizes.radius if sizes.fine else 0.0),
        near=f(sizes.chord + sizes.radius + sizes.half_tyre + edge),
        between=f(0.0 if sizes.fine else 0.5 * resolution**2),
    )
