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

_TOGETHER = 200
"""Tiles that are looked up together at first [1], then twice as many, and so on: most may lie
behind the first contact."""


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
        self._poses, self._clearance = poses, scene.model.shape.clearance
        self._layers = map_layers(scene.ground, scene.model.vehicle).obstacles
        self._body = scene.model.vehicle, reach, self._layers.cell
        self._bands = _bands(scene.model.vehicle, poses, scene.model.errors)
        self._points = body_points(*self._body, *self._bands)
        self._in_cells: Floats = np.empty((8, *poses.x.shape), np.float32)
        self._touches = False

    def first_contact(self, block: slice) -> Contact:
        """First contact at a block of samples; blocks are asked for in their order."""
        self._place(block)
        tiles = self._near_tiles(block)
        if block.start == 0 and self._is_touched(near=0 in tiles[0][:1]):
            # What is closer than the next cell is judged by the cells alone, or nothing could
            # leave it.
            self._touches = True
            self._place(block)
            if (approached := self._approached()) is not None:
                return approached
            tiles = self._near_tiles(block)
        first, together = 0, _TOGETHER
        while first < len(tiles[0]):
            s, n, t = (of[first : first + together] for of in tiles)
            if (contact := self._contact(s + block.start, n, t)) is not None:
                return contact
            first, together = first + together, 2 * together
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

    def _is_touched(self, *, near: bool) -> bool:
        """Return True if an obstacle is closer to the measured pose than cells can show.

        Or than errors of the pose are. ``near``: ground may strike the outline.
        """
        layers, points, start = self._layers, self._points, self._in_cells[:, -1, 0]
        if near:
            ahead, left = points.ahead.ravel(), points.left.ravel()
            x, y = points_of(start[:4], ahead / layers.cell, left / layers.cell)
            struck = layers.heights(x, y, exact=False) > _underside(start, ahead, left)
            if (struck | layers.edges(x, y) & points.main.ravel()).any():
                return True
        return bool(self._struck_beyond().any())

    def _struck_beyond(self) -> Bools:
        """Return (P,) True where errors of the pose reach obstacles at the start."""
        ahead, left = self._points.beyond[:2]
        start, cell = self._in_cells[:, -1, 0], self._layers.cell
        x, y = points_of(start[:4], ahead / cell, left / cell)
        struck: Bools = self._layers.heights(x, y, exact=True) > _underside(start, ahead, left)
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
            start, cell, (x0, y0) = self._in_cells[:, -1, 0], self._layers.cell, self._layers.origin
            place = self._points.beyond[:2, struck][:, k] / cell
            x, y = points_of(start[:4], *place)
            return Contact(0, OBSTACLE, (float(x0 + cell * x), float(y0 + cell * y)), True)
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
        top = layers.heights(x, y, exact=self._touches)
        hits = np.array((np.isnan(top), top > _underside(some, ahead, left), layers.edges(x, y)))
        unknown, struck, edge = hits
        edge &= points.wheel[t]
        if not hits.any():
            return None
        self._exempt_start(unknown, struck, some, t)
        if edge.any():
            edge &= ~self._standing_on_edges(s, n, t)
        blocked = hits.any(axis=(0, 2))
        if not blocked.any():
            return None
        k = int(np.argmax(blocked))
        kind, p = divmod(int(np.argmax(hits[:, k])), x.shape[1])
        where = float(layers.origin[0] + cell * x[k, p]), float(layers.origin[1] + cell * y[k, p])
        return Contact(int(s[k]), (UNKNOWN, OBSTACLE, EDGE)[kind], where, self._touches)

    def _standing_on_edges(self, s: Ints, n: Ints, t: Ints) -> Bools:
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
            k, j = np.nonzero(t[:, None] == of)
            still[k, q[j]] = on[n[k], s[k], j]
        return still

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
        return *np.divmod(pose, poses.shape[2]), t

    def _exempt_start(self, unknown: Bools, struck: Bools, poses: Floats, t: Ints) -> None:
        """Clear what lies below the body or a cell from it where it stands, unless it moves there.

        Of unknown ground only the leading edge counts as moving there: a sensor often does not see
        the ground next to the vehicle, and what was seen to be an obstacle is one. Farther away,
        where the vehicle may stand by the errors of its pose, unknown ground is as obstacles are.
        """
        points, moved, start = self._points, self._poses, self._in_cells[:, -1, 0]
        cell, front, rear = self._layers.cell, float(points.ahead.max()), -float(points.ahead.min())
        side = float(points.left.max())
        m, p = np.nonzero(unknown | struck)
        at = t[m], p
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
        normal = points.normal_ahead[at], points.normal_left[at]
        outward = _outward((ahead, left), normal, moved, poses[7, m, 0])
        leading = (normal[0] > 0.0) & (moved.share > 0.0)
        unknown[m, p] &= ~within | leading | (~close & (outward > _OUTWARD))
        struck[m, p] &= ~within | (outward > _OUTWARD)


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
