"""Where a map could bar a vehicle at all, whatever its heading: most ground needs no closer look.

Around each block of cells a quadratic surface is taken off. Wheels and body follow planes exactly;
four wheels at one distance from the middle follow a bowl; what a saddle costs is bounded by its
curvature, and all else by the range of what is left. A step is looked for in what is left, too: the
slope of the surface explains the rest of a climb. So the screen never clears a pose that
:mod:`planner.swept.sweep` bars; it may send it one that is free.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter

from models.arrays import Bytes, Floats, Ints, Singles
from planner.ground.elevation_map import ElevationMap
from planner.kernels.compiled import kernel, row_pass
from planner.swept.blocks import Blocks, blocks_of, smoothed
from planner.swept.lanes import PLUS_ZERO
from planner.swept.sizes import SweptSizes
from planner.swept.wheel_sweep import SLOPE_OPEN

UNSEEN, BODY, WHEELS = 1, 2, 4
"""Bits: something in reach is unknown; the body, a wheel may strike."""

_BLOCKS = 6.0
"""Blocks to the wheelbase."""

_FITTED = 1.1
"""The surface is taken off points at this share of the distance to the wheels."""

_ROUNDING = 1e-3  # [m]
_HALF_DIAGONAL = 0.71


class Screen(NamedTuple):
    """Blocks of cells; block [0, 0] begins with the cell ``first_row``, ``first_column``.

    Attributes:
        bits: (rows, columns) what poses with their middle in a block may meet.
        steps: (rows, columns) 1 where a wheel in the block may meet a step.
        east, north: (rows, columns) slope of the ground around a wheel in the block [1].
        seen: (rows, columns) distance from any point of a block within which all is known [m], at
            most the reach of the body.
        first_row, first_column: of the map. cells: along the edge of a block.
    """

    bits: Bytes
    steps: Bytes
    east: Singles
    north: Singles
    seen: Singles
    first_row: int
    first_column: int
    cells: int


class _Bounds(NamedTuple):
    """Numbers of :func:`_look_around`, as float32 [m].

    Attributes:
        fit: distance of the points that a surface is taken off [blocks]; edge: of a block.
        corner: from the middle of a block to that of its outermost cell.
        body_sq, wheel_sq, saddle_sq: squares of the reach of the body and of the wheels; and by
            how much more the saddle counts.
        spread: share of the range that counts for the body. clearance: of the vehicle.
        steepest: climb that is no step, what the slope around leaves open taken off. chord: over
            which. apart: of the climb from the middle of the block at most.
        radius: of the wheel. near: reach of its climb.
    """

    fit: int
    edge: np.float32
    corner: np.float32
    body_sq: np.float32
    wheel_sq: np.float32
    saddle_sq: np.float32
    spread: np.float32
    clearance: np.float32
    steepest: np.float32
    chord: np.float32
    apart: np.float32
    radius: np.float32
    near: np.float32


class _Offsets(NamedTuple):
    """Blocks around a block: (k, 2) rows and columns each, and a length [m] for each of some.

    Attributes:
        body: that body and wheels reach.
        base: in which a wheel's climb or fall may begin or end.
        near, rim: that a wheel feels when it climbs; how far its rim is above them at least.
        hidden, distance: within reach of the body; how far they are at least.
    """

    body: Ints
    base: Ints
    near: Ints
    rim: Singles
    hidden: Ints
    distance: Singles


def screen_of(
    elevation_map: ElevationMap, sizes: SweptSizes, window: tuple[int, int, int, int]
) -> Screen:
    """Look over a part of a map.

    Args:
        elevation_map: ground.
        sizes: of the vehicle.
        window: first row, end row, first column, end column.
    """
    resolution = elevation_map.resolution
    cells = max(round(2.0 * sizes.half_length / _BLOCKS / resolution), 1)
    offsets, bounds = _offsets(sizes, cells, resolution), _bounds(sizes, cells, resolution)
    widest = max(int(np.abs(part).max(initial=0)) for part in (offsets.body, offsets.near))
    pad = 2 + max(widest, bounds.fit)
    rows = math.ceil((window[1] - window[0]) / cells)
    columns = math.ceil((window[3] - window[2]) / cells)
    blocks = blocks_of(
        elevation_map.elevation, window[0] - pad * cells, window[2] - pad * cells, cells,
        (rows + 2 * pad, columns + 2 * pad),
    )  # fmt: skip
    bits, steps = np.empty((2, rows, columns), np.uint8)
    east, north, seen = np.empty((3, rows, columns), np.float32)
    out = Screen(bits, steps, east, north, seen, window[0], window[2], cells)
    _look_around(blocks, pad, offsets, bounds, sizes.reach, out)
    if sizes.fine:
        ring = math.ceil((sizes.wheel_reach + bounds.edge) / bounds.edge)
        bits |= WHEELS * maximum_filter(steps, size=2 * ring + 1)
    return out._replace(bits=bits, steps=steps)


def _around(reach: float, edge: float) -> Floats:
    """(k, 3) rows and columns of blocks whose middle is within reach, and distances [m]."""
    far = math.floor(reach / edge)
    row, column = (part.ravel() for part in np.mgrid[-far : far + 1, -far : far + 1])
    distance = edge * np.hypot(row, column)
    order = np.argsort(distance, kind="stable")
    inside = order[distance[order] <= reach]
    found: Floats = np.column_stack([row, column, distance])[inside]
    return found


def _offsets(sizes: SweptSizes, cells: int, resolution: float) -> _Offsets:
    edge = cells * resolution
    half = _HALF_DIAGONAL * edge
    corner = _HALF_DIAGONAL * (edge - resolution)
    # Facets lean on the cell beside them.
    wheels = sizes.wheel_reach + (sizes.radius + sizes.half_tyre + resolution) * sizes.fine
    body = max(sizes.reach, wheels + resolution * (not sizes.fine)) + half + corner
    # A climb begins or ends at most so far from where the wheel is.
    swept = max(sizes.chord, resolution)
    around = _around(swept + sizes.radius + sizes.half_tyre + 2.0 * half, edge)
    if not sizes.fine:
        around = around[:0]
    # From somewhere in a block to somewhere in another; a tyre is wider than its middle.
    gap = edge * np.hypot(*np.maximum(np.abs(around[:, :2].T) - 1.0, 0.0))
    along = np.sqrt(np.maximum(gap**2 - sizes.half_tyre**2, 0.0))
    away = np.maximum(along - swept, 0.0)
    near, away = around[away < sizes.radius], away[away < sizes.radius]
    hidden = _around(sizes.reach + 2.0 * half, edge)

    def steps(of: Floats) -> Ints:
        return np.ascontiguousarray(of[:, :2]).astype(np.int64)

    return _Offsets(
        steps(_around(body, edge)), steps(around[gap < swept]), steps(near),
        (sizes.radius - np.sqrt(sizes.radius**2 - away**2)).astype(np.float32),
        steps(hidden), (hidden[:, 2] - 2.0 * half).astype(np.float32),
    )  # fmt: skip


def _bounds(sizes: SweptSizes, cells: int, resolution: float) -> _Bounds:
    edge = cells * resolution
    # Weights of the wheels in the height of their plane under the corner of the body.
    u = (max(sizes.front, sizes.rear) + sizes.margin) / sizes.half_length
    v = (sizes.side + sizes.margin) / sizes.half_width
    negative = 0.25 * sum(max(w, 0.0) for w in (u + v - 1.0, u - v - 1.0, v - u - 1.0))
    f = np.float32
    return _Bounds(
        fit=max(round(_FITTED * sizes.wheel_reach / edge), 1),
        edge=f(edge),
        corner=f(_HALF_DIAGONAL * (edge - resolution)),
        body_sq=f(sizes.reach**2),
        wheel_sq=f(sizes.wheel_reach**2),
        saddle_sq=f(abs(sizes.half_length**2 - sizes.half_width**2)),
        spread=f(1.0 + negative),
        clearance=f(sizes.clearance - _ROUNDING),
        steepest=f(sizes.steepest - SLOPE_OPEN * sizes.chord - _ROUNDING),
        chord=f(sizes.chord),
        apart=f(_HALF_DIAGONAL * edge + max(sizes.chord, resolution) + 0.5 * sizes.chord),
        radius=f(sizes.radius if sizes.fine else 0.0),
        near=f(sizes.chord + sizes.radius + sizes.half_tyre + edge),
    )


class _Surface(NamedTuple):
    """Quadratic surfaces taken off along a row of blocks, and what is left; (columns,) each.

    Attributes:
        level, east, north, bend_x, bend_y, warp: coefficients, for lengths in [m].
        highest, lowest: of what is left within reach of the body.
        near, base: highest that a wheel feels, its rim taken off; lowest that it stands on.
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


@kernel
def _look_around(
    blocks: Blocks, pad: int, offsets: _Offsets, bounds: _Bounds, reach: float, out: Screen
) -> None:  # fmt: skip
    """Judge every block by the ground around it; arguments as of :func:`screen_of`."""
    rows, columns = out.bits.shape
    mean = smoothed(blocks.middle, bounds.fit + 1)
    room = np.empty((10, columns), np.float32)
    s = _Surface(
        room[0], room[1], room[2], room[3], room[4], room[5], room[6], room[7], room[8], room[9],
    )  # fmt: skip
    m, edge = bounds.fit, bounds.edge
    west, east = slice(pad - m, pad - m + columns), slice(pad + m, pad + m + columns)
    here = slice(pad, pad + columns)
    for r in range(rows):
        i = r + pad
        _fit(mean[i][west], mean[i][here], mean[i][east], np.float32(m) * edge, s)
        _bend(mean[i - m][here], mean[i][here], mean[i + m][here], np.float32(m) * edge, s)
        _warp(
            mean[i - m][west], mean[i - m][east], mean[i + m][west], mean[i + m][east],
            np.float32(m) * edge, s,
        )  # fmt: skip
        room[6], room[7] = -np.float32(np.inf), np.float32(np.inf)
        for n in range(offsets.body.shape[0]):
            k, j = i + offsets.body[n, 0], pad + offsets.body[n, 1]
            x, y = np.float32(j - pad) * edge, np.float32(k - i) * edge
            _range_of(
                blocks.top[k, j : j + columns], blocks.low[k, j : j + columns], x, y, s,
                s.highest, s.lowest,
            )  # fmt: skip
        room[8], room[9] = -np.float32(np.inf), np.float32(np.inf)
        for n in range(offsets.near.shape[0]):
            k, j = i + offsets.near[n, 0], pad + offsets.near[n, 1]
            x, y = np.float32(j - pad) * edge, np.float32(k - i) * edge
            end = j + columns
            _felt(
                blocks.middle[k, j:end], blocks.above[k, j:end], blocks.east[k, j:end],
                blocks.north[k, j:end], x, y, edge, offsets.rim[n], s,
            )  # fmt: skip
        for n in range(offsets.base.shape[0]):
            k, j = i + offsets.base[n, 0], pad + offsets.base[n, 1]
            x, y = np.float32(j - pad) * edge, np.float32(k - i) * edge
            end = j + columns
            _stood_on(
                blocks.middle[k, j:end], blocks.below[k, j:end], blocks.east[k, j:end],
                blocks.north[k, j:end], x, y, edge, s,
            )  # fmt: skip
        _judge_body(s, bounds, out.bits[r])
        out.east[r], out.north[r] = s.east, s.north
        _judge_steps(s, bounds, out.steps[r])
        if offsets.near.shape[0] == 0:
            out.steps[r] = 0
        seen = out.seen[r]
        seen[:] = np.float32(reach)
        for n in range(offsets.hidden.shape[0]):
            k, j = i + offsets.hidden[n, 0], pad + offsets.hidden[n, 1]
            _nearest(blocks.hidden[k, j : j + columns], offsets.distance[n], seen)
        _unseen(seen, np.float32(reach), out.bits[r])


@row_pass
def _fit(west: Singles, here: Singles, east: Singles, distance: np.float32, s: _Surface) -> None:
    per, half, two = np.float32(1.0) / distance, np.float32(0.5), np.float32(2.0)
    for j in range(here.shape[0]):
        s.level[j] = here[j]
        s.east[j] = (east[j] - west[j]) * half * per
        s.bend_x[j] = (east[j] + west[j] - two * here[j]) * per * per


@row_pass
def _bend(south: Singles, here: Singles, north: Singles, distance: np.float32, s: _Surface) -> None:
    per, half, two = np.float32(1.0) / distance, np.float32(0.5), np.float32(2.0)
    for j in range(here.shape[0]):
        s.north[j] = (north[j] - south[j]) * half * per
        s.bend_y[j] = (north[j] + south[j] - two * here[j]) * per * per


@row_pass
def _warp(
    south_west: Singles, south_east: Singles, north_west: Singles, north_east: Singles,
    distance: np.float32, s: _Surface,
) -> None:  # fmt: skip
    share = np.float32(0.25) / (distance * distance)
    for j in range(south_west.shape[0]):
        s.warp[j] = (north_east[j] - north_west[j] - south_east[j] + south_west[j]) * share


@row_pass
def _range_of(
    top: Singles, low: Singles, x: np.float32, y: np.float32, s: _Surface, highest: Singles,
    lowest: Singles,
) -> None:  # fmt: skip
    half = np.float32(0.5)
    xx, yy, xy = half * x * x, half * y * y, x * y
    for j in range(top.shape[0]):
        surface = s.level[j] + s.east[j] * x + s.north[j] * y
        surface += s.bend_x[j] * xx + s.bend_y[j] * yy + s.warp[j] * xy
        above, below, up, down = top[j] - surface, low[j] - surface, highest[j], lowest[j]
        # A comparison with an unknown height is false: what is known decides.
        highest[j] = (above if above > up else up) + PLUS_ZERO
        lowest[j] = (below if below < down else down) + PLUS_ZERO


@row_pass
def _felt(
    middle: Singles, above: Singles, east: Singles, north: Singles, x: np.float32, y: np.float32,
    edge: np.float32, rim: np.float32, s: _Surface,
) -> None:  # fmt: skip
    """Highest of what is left in a block, its facets against the slope of the surface there."""
    half = np.float32(0.5)
    xx, yy, xy = half * x * x, half * y * y, x * y
    for j in range(middle.shape[0]):
        surface = s.level[j] + s.east[j] * x + s.north[j] * y
        surface += s.bend_x[j] * xx + s.bend_y[j] * yy + s.warp[j] * xy
        slope_x = s.east[j] + s.bend_x[j] * x + s.warp[j] * y
        slope_y = s.north[j] + s.bend_y[j] * y + s.warp[j] * x
        tilt = half * (abs(east[j] - slope_x * edge) + abs(north[j] - slope_y * edge))
        felt, most = middle[j] + above[j] + tilt - surface - rim, s.near[j]
        s.near[j] = (felt if felt > most else most) + PLUS_ZERO


@row_pass
def _stood_on(
    middle: Singles, below: Singles, east: Singles, north: Singles, x: np.float32, y: np.float32,
    edge: np.float32, s: _Surface,
) -> None:  # fmt: skip
    """Lowest of what is left in a block, its facets against the slope of the surface there."""
    half = np.float32(0.5)
    xx, yy, xy = half * x * x, half * y * y, x * y
    for j in range(middle.shape[0]):
        surface = s.level[j] + s.east[j] * x + s.north[j] * y
        surface += s.bend_x[j] * xx + s.bend_y[j] * yy + s.warp[j] * xy
        slope_x = s.east[j] + s.bend_x[j] * x + s.warp[j] * y
        slope_y = s.north[j] + s.bend_y[j] * y + s.warp[j] * x
        tilt = half * (abs(east[j] - slope_x * edge) + abs(north[j] - slope_y * edge))
        stands, least = middle[j] - below[j] - tilt - surface, s.base[j]
        s.base[j] = (stands if stands < least else least) + PLUS_ZERO


@row_pass
def _judge_body(s: _Surface, b: _Bounds, bits: Bytes) -> None:
    """What the surface costs at most, and the range of what is left, against the clearance."""
    half, one, two = np.float32(0.5), np.float32(1.0), np.float32(2.0)
    reach = np.sqrt(b.body_sq)
    for j in range(bits.shape[0]):
        bowl = half * (s.bend_x[j] + s.bend_y[j])
        across = half * (s.bend_x[j] - s.bend_y[j])
        saddle = np.sqrt(across * across + s.warp[j] * s.warp[j])
        slope = np.sqrt(s.east[j] * s.east[j] + s.north[j] * s.north[j])
        slope += reach * (abs(bowl) + saddle)
        # Heights of a block count at its middle.
        spread = s.highest[j] - s.lowest[j] + two * slope * b.corner
        # On a slope a wheel touches the ground a little uphill.
        lift = b.radius * (np.sqrt(one + slope * slope) - one)
        body = half * (bowl * (b.body_sq - b.wheel_sq) + saddle * (b.body_sq + b.saddle_sq))
        middle = half * (saddle * b.saddle_sq - bowl * b.wheel_sq)
        struck = max(body, middle) + b.spread * (spread + lift)
        # Where nothing could be taken off, nothing is known to be clear.
        clear = (spread >= np.float32(0.0)) & (struck <= b.clearance)
        bits[j] = 0 if clear else BODY


@row_pass
def _judge_steps(s: _Surface, b: _Bounds, steps: Bytes) -> None:
    """The highest climb of a wheel around a block, beyond the slope there, against a step's."""
    half, one = np.float32(0.5), np.float32(1.0)
    for j in range(steps.shape[0]):
        bowl = half * (s.bend_x[j] + s.bend_y[j])
        across = half * (s.bend_x[j] - s.bend_y[j])
        bend = abs(bowl) + np.sqrt(across * across + s.warp[j] * s.warp[j])
        slope = np.sqrt(s.east[j] * s.east[j] + s.north[j] * s.north[j]) + b.near * bend
        # On a slope a wheel touches the ground a little uphill.
        lift = b.radius * (np.sqrt(one + slope * slope) - one)
        # The surface bends within a block, here and there, and on the way to the climb.
        bent = bend * (half * b.edge * b.edge + b.chord * b.apart)
        rise = s.near[j] - s.base[j] + lift + bent
        clear = (s.near[j] > s.base[j]) & (rise <= b.steepest)
        steps[j] = 0 if clear else 1


@row_pass
def _nearest(hidden: Bytes, distance: np.float32, seen: Singles) -> None:
    for j in range(seen.shape[0]):
        here = seen[j]
        there = distance if hidden[j] > 0 else here
        seen[j] = (there if there < here else here) + PLUS_ZERO


@row_pass
def _unseen(seen: Singles, reach: np.float32, bits: Bytes) -> None:
    for j in range(bits.shape[0]):
        bits[j] |= UNSEEN if seen[j] < reach else 0
