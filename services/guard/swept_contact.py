"""First contact of a moving body and its wheels with obstacles and unknown ground.

The outline of the body, rows across its underside and the wheels are points that are looked up in
the obstacles of the map at every sample of a course. Nothing here is shared with the planner.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.input_errors import InputErrors, lateral_band
from slopewise.models.vehicle import Vehicle
from slopewise.services.guard.body_points import ROWS, body_points
from slopewise.services.guard.guard_map import HALF_DIAGONAL, map_layers
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

_SHARES = 0.75, 0.5, 0.25, 0.0
"""Shares of the errors of the pose that are tried next to obstacles [1]."""

_TOGETHER, _MIN_SAMPLES, _TILES = 600, 16, 200
"""Poses whose tiles are looked up together at first, for as many samples at least, and tiles whose
points are [1]: most may lie behind the first contact."""


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


class SweptBody:
    """A body that reaches so far ahead and behind of mid-wheelbase [m], on N courses.

    Errors of the pose widen and lengthen it.
    """

    def __init__(self, scene: GuardScene, poses: BodyPoses, reach: tuple[float, float]) -> None:
        """Planes of the poses may be written until they are asked for."""
        self._poses, self._clearance = poses, scene.model.vehicle.shape.clearance
        self._layers = map_layers(scene.ground, scene.model.vehicle).obstacles
        self._body = scene.model.vehicle, reach, self._layers.cell
        self._bands = _bands(scene.model.vehicle, poses, scene.model.errors)
        self._points = body_points(*self._body, *self._bands)
        self._in_cells: Floats = np.empty((8, *poses.x.shape), np.float32)
        self._touches = False

    def first_contact(self, block: slice) -> Contact:
        """First contact at a block of samples; blocks are asked for in their order."""
        self._place(block)
        if block.start == 0 and self._is_touched():
            # What is closer than the next cell is judged by the cells alone, or nothing could
            # leave it.
            self._touches = True
            self._place(block)
            if (approached := self._approached()) is not None:
                return approached
        first, count = block.start, max(_TOGETHER // len(self._poses.x), _MIN_SAMPLES)
        while first < block.stop:
            tiles = self._near_tiles(slice(first, min(first + count, block.stop)))
            for k in range(0, len(tiles[0]), _TILES):
                if (contact := self._contact(*(of[k : k + _TILES] for of in tiles))) is not None:
                    return contact
            first, count = first + count, 2 * count
        return Contact(self._poses.x.shape[1], "", None, self._touches)

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
        """Return True if an obstacle is closer to the measured pose than cells can show.

        Or than errors of the pose are.
        """
        layers, points, start = self._layers, self._points, self._in_cells[:, -1, 0]
        ahead, left = points.ahead.ravel(), points.left.ravel()
        x, y = points_of(start[:4], ahead / layers.cell, left / layers.cell)
        top, edges = layers.facets(x, y)
        struck = (top > _underside(start, ahead, left)) | (edges & points.main.ravel())
        return bool(struck.any() or self._struck_beyond().any())

    def _struck_beyond(self) -> Bools:
        """Return (P,) True where errors of the pose reach obstacles at the start."""
        ahead, left = self._points.beyond[:2]
        start, cell = self._in_cells[:, -1, 0], self._layers.cell
        x, y = points_of(start[:4], ahead / cell, left / cell)
        struck: Bools = self._layers.cells(x, y) > _underside(start, ahead, left)
        return struck

    def _approached(self) -> Contact | None:
        """An obstacle within the errors of the pose to which the body moves from the start on.

        It may be as close as it can be without an overlap. Otherwise errors are assumed as large as
        they may be, because no obstacle is inside the vehicle.
        """
        struck, poses = self._struck_beyond(), self._poses
        ahead, left, normal_ahead, normal_left = self._points.beyond[2:, struck]
        outward = _outward((ahead, left), (normal_ahead, normal_left), poses, poses.turn)
        if (outward > _OUTWARD).any():
            k = int(np.argmax(outward.max(axis=0)))
            place = self._points.beyond[:2, struck][:, k] / self._layers.cell
            x, y = points_of(self._in_cells[:4, -1, 0], *place)
            return Contact(0, OBSTACLE, self._layers.place(x, y), True)
        for share in _SHARES:
            if not struck.any():
                break
            self._points = body_points(*self._body, *(share * band for band in self._bands))
            struck = self._struck_beyond()
        return None

    def _contact(self, s: Ints, n: Ints, t: Ints) -> Contact | None:
        """First contact of some tiles, the first samples first."""
        layers, cell, points = self._layers, self._layers.cell, self._points
        some, ahead, left = self._in_cells[:, n, s, None], points.ahead[t], points.left[t]
        x, y = points_of(some[:4], ahead / cell, left / cell)
        top, edges = layers.facets(x, y)
        if self._touches:
            top = layers.cells(x, y)
        struck = top > _underside(some, ahead, left)
        hits = np.array((np.isnan(top), struck, edges & points.wheel[t]))
        if hits.any():
            self._exempt_start(hits, some, t)
        blocked = hits.any(axis=(0, 2))
        if not blocked.any():
            return None
        k = int(np.argmax(blocked))
        kind, p = divmod(int(np.argmax(hits[:, k])), x.shape[1])
        reason, where = (UNKNOWN, OBSTACLE, EDGE)[kind], layers.place(x[k, p], y[k, p])
        return Contact(int(s[k]), reason, where, self._touches)

    def _near_tiles(self, block: slice) -> tuple[Ints, Ints, Ints]:
        """Samples of a block, courses and tiles, the first samples first.

        Only those near which ground may strike their lowest corner, or is unknown: most of the body
        needs no further look-up.
        """
        poses = self._in_cells[..., block].transpose(0, 2, 1)  # those of a sample together
        matrix = poses[ROWS]
        matrix[2, 0] -= HALF_DIAGONAL * np.hypot(poses[5], poses[6])
        x, y, lowest = self._points.tiles @ matrix.reshape(3, 3, -1)
        near = self._layers.highest_near(x, y) > lowest
        pose, t = np.divmod(np.flatnonzero(near.T), len(near))
        s, n = np.divmod(pose, poses.shape[2])
        return s + block.start, n, t

    def _exempt_start(self, hits: Bools, poses: Floats, t: Ints) -> None:
        """Clear what lies below the body or a cell from it where it stands, unless it moves there.

        Of unknown ground only the leading edge counts as moving there: a sensor often does not see
        the ground next to the vehicle, and what was seen to be an obstacle is one. Farther away,
        where the vehicle may stand by the errors of its pose, unknown ground is as obstacles are. A
        step on which a wheel stands does not hold it within a cell.
        """
        points, start, layers = self._points, self._in_cells[:, -1, 0], self._layers
        front, rear = float(points.ahead.max()), -float(points.ahead.min())
        side, cell, moved = float(points.left.max()), layers.cell, self._poses
        # What lies farther from the start than two corners of the body stays.
        beyond = 2.0 * math.hypot(max(front, rear), side) / cell + 1.0
        near = np.hypot(poses[0] - start[0], poses[1] - start[1]) < beyond
        m, p = np.nonzero(hits.any(axis=0) & near)
        if len(m) == 0:
            return
        at = t[m], p
        place = ahead, left = points.ahead[at], points.left[at]
        x, y, cos, sin = poses[:4, m, 0]
        moved_by = cell * (x - start[0]), cell * (y - start[1])
        east, north = points_of((*moved_by, cos, sin), ahead, left)
        cos, sin = start[2:4]
        along, across = east * cos + north * sin, north * cos - east * sin
        within, close = (
            (along < ahead_of + cell) & (along > -behind - cell) & (np.abs(across) < half + cell)
            for ahead_of, behind, half in ((front, rear, side), points.size)
        )
        normal = points.normal_ahead[at], points.normal_left[at]
        outward = _outward(place, normal, moved, poses[7, m, 0]) > _OUTWARD
        leading = (normal[0] > 0.0) & (moved.share > 0.0)
        _, on_step = layers.facets(*points_of(start[:4], ahead / cell, left / cell))
        on_step &= np.hypot(along - ahead, across - left) < cell
        hits[:, m, p] &= np.array(
            (~within | leading | (~close & outward), ~within | outward, ~on_step)
        )


def _bands(vehicle: Vehicle, poses: BodyPoses, errors: InputErrors) -> tuple[float, float, float]:
    """Lateral band [m], its growth with the distance from the middle [1], and along [m]."""
    if not errors.has_band:
        return 0.0, 0.0, errors.along_track
    tightest = float(np.abs(poses.turn).max()) / max(poses.share, _TENTH)
    tightest = min(tightest, 2.0 / vehicle.track_width)
    curvature = _TENTH * math.ceil(tightest / _TENTH)  # few bodies, which are stored
    return lateral_band(errors, 0.0, curvature), math.sin(errors.heading), errors.along_track


def _outward(
    place: tuple[Floats, Floats], normal: tuple[Floats, Floats], poses: BodyPoses, turn: Floats
) -> Floats:
    """Speed of points of the body along their normals, over that of the fastest wheel [1]."""
    (ahead, left), (normal_ahead, normal_left) = place, normal
    along = normal_ahead * (poses.share - turn * left)
    outward: Floats = along + normal_left * turn * (ahead - poses.axis)
    return outward


def _underside(poses: Floats, ahead: Floats, left: Floats) -> Floats:
    """Height from which ground strikes points of the body, above the datum of the layers [m]."""
    lowest, rise, cross_rise = poses[4:7]
    underside: Floats = lowest + rise * ahead + cross_rise * left
    return underside
