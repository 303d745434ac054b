"""First contact of a moving body and its wheels with obstacles and unknown ground.

The outline of the body, rows across its underside and the wheels are points that are looked up in
the obstacles of the map at every sample of a course. Nothing here is shared with the planner.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.input_errors import InputErrors, lateral_band
from slopewise.models.vehicle import Vehicle
from slopewise.services.guard.guard_map import HALF_DIAGONAL, SPACING, TILE, map_layers
from slopewise.services.guard.guard_model import GuardScene
from slopewise.services.physics.body import points_of

UNKNOWN, OBSTACLE, EDGE = "ground is unknown", "an obstacle stands", "a step at a wheel lies"
"""Reasons to end a course."""

_OUTWARD = 0.05
"""Speed across the outline over that of the vehicle from which a point moves outward [1]: less
moves the outline of a body 2 m long out by 3 cm."""

_TENTH = 0.1  # step of the curvature by which lateral bands grow [1/m]

_FACET = math.sqrt(2.0)
"""Rise of a facet along the steepest slope across its diagonal, in cells [1]."""

_TOGETHER = 200
"""Tiles that are looked up together at first [1], then twice as many, and so on: most may lie
behind the first contact."""

_ROWS = np.array(((0, 2, 3), (1, 3, 2), (4, 5, 6)))
"""Rows of poses that x, y and underside of points depend on, see :meth:`SweptBody._place`."""


class BodyPoses(NamedTuple):
    """Poses of N courses of S samples, (N, S) each where no other shape is given."""

    x: Floats  # x, y: middle of the wheelbase [m]
    y: Floats
    cos: Floats  # cos, sin: components of the direction of motion [1]
    sin: Floats
    planes: Floats  # (3, N, S) height of the middle of the wheels [m], its rise ahead and left [1]
    turn: Floats  # (N, 1) yaw per distance, left positive [rad/m]
    share: float  # speed of the middle of the wheelbase over that of the fastest wheel [1]
    axis: float  # place abeam of which the centre of turns lies, ahead of the middle [m]


class Contact(NamedTuple):
    """First contact on any of the courses."""

    sample: int  # that must not be reached, S if all may be
    reason: str  # empty if all samples may be reached
    where: tuple[float, float] | None  # its place on the map [m]
    touches: bool = False  # an obstacle is closer at the start than the cells of the map can show


class _Points(NamedTuple):
    """Points of the body, Q in each of U quarters of the T tiles that cover it; some repeat."""

    ahead: Floats  # (U, Q) ahead, left: place in the body [m]
    left: Floats
    normal_ahead: Floats  # (U, Q) outward normal of the outline, 0 within it [1]
    normal_left: Floats
    wheel: Bools  # (U, Q) under a wheel
    main: Bools  # (U, Q) at a rim or the middle of it
    quarters: Ints  # (T, 4) quarters of the tiles, those outside the outline repeat others
    middle_ahead: Floats  # (U,) middle_ahead, middle_left: place of the quarters [m]
    middle_left: Floats
    tiles: Floats  # (3, T, 3) x, y [cells] and underside [m] of their middles from :data:`_ROWS`
    between: Floats  # (2, P) ahead, left: places between outline and the body without errors [m]
    size: tuple[float, float, float]  # front, rear, half width of the body without errors [m]


class SweptBody:
    """A body that reaches so far ahead and behind of mid-wheelbase [m], on N courses.

    Errors of the pose widen and lengthen it.
    """

    def __init__(
        self, scene: GuardScene, poses: BodyPoses, reach: tuple[float, float], *, bare: bool = False
    ) -> None:
        """Planes of the poses may be written until they are asked for; ``bare``: without errors."""
        vehicle, errors = scene.model.vehicle, scene.model.errors
        self._poses, self._clearance = poses, scene.model.shape.clearance
        self._arguments = scene, poses, reach
        self._within: SweptBody | None = None
        self._layers = map_layers(scene.ground, vehicle).obstacles
        cell = self._layers.cell
        self._bare = self._points = _points(vehicle, reach, cell, 0.0, 0.0, 0.0)
        if not bare and (errors.has_band or errors.along_track > 0.0):
            self._points = _points(vehicle, reach, cell, *_bands(vehicle, poses, errors))
        self._in_cells: Floats = np.empty((8, *poses.x.shape), np.float32)
        self._touches = bare

    def first_contact(self, block: slice) -> Contact:
        """First contact at a block of samples; blocks are asked for in their order."""
        self._place(block)
        tiles = self._near_tiles(block)
        if block.start == 0 and not self._touches:
            if 0 in tiles[0][:1] and self._is_touched():
                # What is closer than the next cell is judged by the cells alone, or nothing could
                # leave it.
                self._touches, self._points = True, self._bare
                self._place(block)
                tiles = self._near_tiles(block)
            elif self._is_passed():
                self._within = SweptBody(*self._arguments, bare=True)
        contact = Contact(self._poses.x.shape[1], "", None, self._touches)
        for s, n, u in self._near_quarters(tiles, block.start):
            if (first := self._contact(s, n, u)) is not None:
                contact = first
                break
        if self._within is None:
            return contact
        within = self._within.first_contact(block)
        return min(within, contact._replace(touches=True), key=lambda of: of.sample)

    def _place(self, block: slice) -> None:
        """Write poses (8, N, S): x, y [cells], cos, sin, lowest underside [m], slopes, turn.

        Ground above the underside of the middle strikes the body there; heights are above the datum
        of the layers.
        """
        layers, poses = self._layers, self._poses
        x, y, cos, sin = (of[:, block] for of in poses[:4])
        height, rise, cross_rise = poses.planes[..., block]
        slope = np.hypot(rise, cross_rise)
        # The vertical below the body is longer than the clearance by the slope.
        lowest = height - layers.datum + (self._clearance + layers.noise) * np.sqrt(1.0 + slope**2)
        lowest += (0.5 if self._touches else 1.0) * _FACET * layers.cell * slope
        x, y = (x - layers.origin[0]) / layers.cell, (y - layers.origin[1]) / layers.cell
        rows = x, y, cos, sin, lowest, rise, cross_rise, poses.turn
        for row, values in zip(self._in_cells[..., block], rows, strict=True):
            row[...] = values

    def _is_touched(self) -> bool:
        """Return True if an obstacle is closer to the measured pose than cells can show."""
        layers, points, start = self._layers, self._points, self._in_cells[:, -1, 0]
        ahead, left = points.ahead.ravel(), points.left.ravel()
        x, y = points_of(start[:4], ahead / layers.cell, left / layers.cell)
        struck = layers.heights(x, y, exact=False) > _underside(start, ahead, left)
        return bool((struck | layers.edges(x, y) & points.main.ravel()).any())

    def _is_passed(self) -> bool:
        """Return True if errors widen the outline at the start beyond an obstacle.

        The points of the outline are behind it already, and may move on without meeting it.
        """
        layers, start, (ahead, left) = self._layers, self._in_cells[:, -1, 0], self._points.between
        x, y = points_of(start[:4], ahead / layers.cell, left / layers.cell)
        struck = layers.heights(x, y, exact=True) > _underside(start, ahead, left)
        return bool(struck.any())

    def _contact(self, s: Ints, n: Ints, u: Ints) -> Contact | None:
        """First contact of some quarters, the first samples first."""
        layers, cell, points = self._layers, self._layers.cell, self._points
        some, ahead, left = self._in_cells[:, n, s, None], points.ahead[u], points.left[u]
        x, y = points_of(some[:4], ahead / cell, left / cell)
        top = layers.heights(x, y, exact=self._touches)
        hits = np.array((np.isnan(top), top > _underside(some, ahead, left), layers.edges(x, y)))
        unknown, struck, edge = hits
        edge &= points.wheel[u]
        if not hits.any():
            return None
        self._exempt_start(unknown, struck, some, u)
        if edge.any():
            edge &= ~self._standing_on_edges(s, n, u)
        blocked = hits.any(axis=(0, 2))
        if not blocked.any():
            return None
        k = int(np.argmax(blocked))
        kind, p = divmod(int(np.argmax(hits[:, k])), x.shape[1])
        where = float(layers.origin[0] + cell * x[k, p]), float(layers.origin[1] + cell * y[k, p])
        return Contact(int(s[k]), (UNKNOWN, OBSTACLE, EDGE)[kind], where, self._touches)

    def _standing_on_edges(self, s: Ints, n: Ints, u: Ints) -> Bools:
        """Points (…, Q) that are still at the step at which they are at the start.

        An edge on which a wheel stands already does not hold it there.
        """
        layers, of_all = self._layers, self._in_cells[..., : int(s[-1]) + 1]
        still = np.zeros((len(s), self._points.ahead.shape[1]), np.bool_)
        ahead, left = self._points.ahead / layers.cell, self._points.left / layers.cell
        of, q = np.nonzero(layers.edges(*points_of(of_all[:4, -1, 0, None, None], ahead, left)))
        if len(of):
            on = layers.edges(*points_of(of_all[:4, ..., None], ahead[of, q], left[of, q]))
            on = np.logical_and.accumulate(on, axis=1)
            k, j = np.nonzero(u[:, None] == of)
            still[k, q[j]] = on[n[k], s[k], j]
        return still

    def _near_tiles(self, block: slice) -> tuple[Ints, Ints, Ints]:
        """Samples of a block, courses and tiles, the first samples first.

        Only those near which ground may strike their lowest corner, or is unknown: most of the body
        needs no further look-up.
        """
        poses = self._in_cells[..., block].transpose(0, 2, 1)  # those of a sample together
        matrix = poses[_ROWS]
        matrix[2, 0] -= HALF_DIAGONAL * np.hypot(poses[5], poses[6])
        x, y, lowest = self._points.tiles @ matrix.reshape(3, 3, -1)
        near = self._layers.highest_near(x, y) > lowest
        pose, t = np.divmod(np.flatnonzero(near.T), len(near))
        return *np.divmod(pose, poses.shape[2]), t

    def _near_quarters(
        self, tiles: tuple[Ints, Ints, Ints], start: int
    ) -> Iterator[tuple[Ints, Ints, Ints]]:
        """Samples, courses and quarters of tiles, some at a time, as :meth:`_near_tiles`."""
        layers, points, first, together = self._layers, self._points, 0, _TOGETHER
        while first < len(tiles[0]):
            s, n, t = (of[first : first + together] for of in tiles)
            first, together, s = first + together, 2 * together, s + start
            some, u = self._in_cells[:, n, s, None], points.quarters[t]
            ahead, left = points.middle_ahead[u], points.middle_left[u]
            x, y = points_of(some[:4], ahead / layers.cell, left / layers.cell)
            lowest = _underside(some, ahead, left)
            lowest -= 0.5 * HALF_DIAGONAL * np.hypot(some[5], some[6])
            k, q = np.nonzero(layers.highest_near(x, y, half=True) > lowest)
            if len(k):
                yield s[k], n[k], u[k, q]

    def _exempt_start(self, unknown: Bools, struck: Bools, poses: Floats, u: Ints) -> None:
        """Clear what lies below the body or a cell from it where it stands, unless it moves there.

        Of unknown ground only the leading edge counts as moving there: a sensor often does not see
        the ground next to the vehicle, and what was seen to be an obstacle is one. Farther away,
        where the vehicle may stand by the errors of its pose, unknown ground is as obstacles are.
        """
        points, moved, start = self._points, self._poses, self._in_cells[:, -1, 0]
        cell, front, rear = self._layers.cell, float(points.ahead.max()), -float(points.ahead.min())
        side = float(points.left.max())
        m, p = np.nonzero(unknown | struck)
        at = u[m], p
        ahead, left = points.ahead[at], points.left[at]
        x, y, cos, sin = poses[:4, m, 0]
        moved_by = cell * (x - start[0]), cell * (y - start[1])
        east, north = points_of((*moved_by, cos, sin), ahead, left)
        cos, sin = start[2:4]
        along, across = east * cos + north * sin, north * cos - east * sin
        within, close = (
            (along < ahead_of + cell) & (along > -behind - cell) & (np.abs(across) < half + cell)
            for ahead_of, behind, half in ((front, rear, side), points.size)
        )
        turn, normal = poses[7, m, 0], points.normal_ahead[at]
        outward = normal * (moved.share - turn * left) + points.normal_left[at] * turn * (
            ahead - moved.axis
        )
        leading = (normal > 0.0) & (moved.share > 0.0)
        unknown[m, p] &= ~within | leading | (~close & (outward > _OUTWARD))
        struck[m, p] &= ~within | (outward > _OUTWARD)


def _bands(vehicle: Vehicle, poses: BodyPoses, errors: InputErrors) -> tuple[float, float, float]:
    """Lateral band [m], its growth with the distance from the middle [1], and that ahead [m]."""
    tightest = float(np.abs(poses.turn).max()) / max(poses.share, _TENTH)
    tightest = min(tightest, 2.0 / vehicle.track_width)
    curvature = _TENTH * math.ceil(tightest / _TENTH)  # few bodies, which are stored
    return lateral_band(errors, 0.0, curvature), math.sin(errors.heading), errors.along_track


@lru_cache(maxsize=128)
def _points(
    vehicle: Vehicle,
    reach: tuple[float, float],
    cell: float,
    band: float,
    growth: float,
    ahead: float,
) -> _Points:
    """Wheels, outline and three rows across the underside, at most :data:`SPACING` apart."""
    front, rear = reach[0] + ahead, reach[1]
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
    is_between = np.abs(lateral) < side + band + growth * np.abs(station)
    is_between &= (np.abs(lateral) > side) | (station > reach[0])
    between: Floats = np.stack((station[is_between], lateral[is_between])).astype(np.float32)
    return _by_tiles(points, front, rear, cell, (*reach, side))._replace(between=between)


def _by_tiles(
    points: Floats, front: float, rear: float, cell: float, size: tuple[float, float, float]
) -> _Points:
    """Points (5, P), see :class:`_Points`, by the tiles of their bounding rectangle."""
    side = float(points[1].max())
    columns, rows = (math.ceil(size / TILE - 1e-6) for size in (front + rear, 2.0 * side))
    length, width = 0.5 * (front + rear) / columns, side / rows  # of quarters
    i = np.clip((points[0] + rear) / length, 0, 2 * columns - 1).astype(int)
    j = np.clip((points[1] + side) / width, 0, 2 * rows - 1).astype(int)
    ids, id_of = np.unique(i + 2 * columns * j, return_inverse=True)
    chosen = _rows([np.flatnonzero(id_of == k) for k in range(len(ids))])
    ahead, left, normal_ahead, normal_left, wheel = points[:, chosen]
    j, i = np.divmod(ids, 2 * columns)
    tiles, tile_of = np.unique(i // 2 + columns * (j // 2), return_inverse=True)
    quarters = _rows([np.flatnonzero(tile_of == k) for k in range(len(tiles))])
    middle_ahead: Floats = ((i + 0.5) * length - rear).astype(np.float32)
    middle_left: Floats = ((j + 0.5) * width - side).astype(np.float32)
    j, i = np.divmod(tiles, columns)
    a, b = (2 * i + 1) * length - rear, (2 * j + 1) * width - side
    rows_of = (1.0, a / cell, -b / cell), (1.0, a / cell, b / cell), (1.0, a, b)
    stacked = [np.stack(np.broadcast_arrays(*row), axis=1) for row in rows_of]
    matrix: Floats = np.array(stacked).astype(np.float32)
    of_points = ahead, left, normal_ahead, normal_left, wheel > 0.0, wheel > 1.0
    of_tiles = quarters, middle_ahead, middle_left, matrix
    return _Points(*of_points, *of_tiles, np.empty((2, 0)), size)


def _rows(parts: list[Ints]) -> Ints:
    """The parts as rows of one length; shorter ones repeat."""
    longest = max(map(len, parts))
    return np.array([np.resize(part, longest) for part in parts])


def _underside(poses: Floats, ahead: Floats, left: Floats) -> Floats:
    """Height from which ground strikes points of the body, above the datum of the layers [m]."""
    lowest, rise, cross_rise = poses[4:7]
    underside: Floats = lowest + rise * ahead + cross_rise * left
    return underside
