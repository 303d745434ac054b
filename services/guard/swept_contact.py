"""First contact of a moving body and its wheels with obstacles and unknown ground.

The outline of the body, rows across its underside and the wheels are points that are looked up in
the obstacles of the map at every sample of a course. Nothing here is shared with the planner.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import InputErrors, lateral_band
from slopewise.models.vehicle import Vehicle
from slopewise.services.guard.obstacle_layers import SPACING, ObstacleLayers, obstacle_layers

UNKNOWN, OBSTACLE, EDGE = "ground is unknown", "an obstacle stands", "a step at a wheel lies"
"""Reasons to end a course."""

_OUTWARD = 0.05
"""Speed across the outline over that of the vehicle from which a point moves outward [1]: less
moves the outline of a body 2 m long out by 3 cm."""

_TENTH = 0.1  # step of the curvature by which lateral bands grow [1/m]

_WHEELS = 12  # points under the wheels, three across each tyre [1]

_FACET = math.sqrt(2.0)
"""Rise of a facet along the steepest slope across its diagonal, in cells [1]."""


class BodyPoses(NamedTuple):
    """Poses of N courses of S samples, (N, S) each where no other shape is given."""

    x: Floats  # x, y, yaw: middle of the wheelbase [m], direction of motion [rad]
    y: Floats
    yaw: Floats
    height: Floats  # of the ground at the middle of the wheels [m]
    rise: Floats  # slope of the plane of the wheels along the motion [1]
    cross_rise: Floats  # slope of that plane to the left [1]
    turn: Floats  # (N,) yaw per distance, left positive [rad/m]
    share: float  # speed of the middle of the wheelbase over that of the fastest wheel [1]
    axis: float  # place abeam of which the centre of turns lies, ahead of the middle [m]

    def on(self, courses: list[int]) -> BodyPoses:
        """Poses of some courses."""
        arrays = {name: getattr(self, name)[courses] for name in self._fields[:7]}
        return self._replace(**arrays)


class Contact(NamedTuple):
    """First contact on any of the courses."""

    sample: int  # that must not be reached, S if all may be
    reason: str  # empty if all samples may be reached
    where: tuple[float, float] | None  # its place on the map [m]
    touches: bool = False  # an obstacle is closer at the start than the cells of the map can show


class _Points(NamedTuple):
    """P points of the body, (P,) each: first the wheels, then the leading edge."""

    ahead: Floats  # ahead, left: place in the body [m]
    left: Floats
    normal_ahead: Floats  # outward normal of the outline, 0 within it [1]
    normal_left: Floats
    leading: int  # number of points of wheels and leading edge

    def first(self, count: int) -> _Points:
        """First points."""
        arrays = {name: getattr(self, name)[:count] for name in self._fields[:4]}
        return self._replace(**arrays)


def first_contact(
    vehicle: Vehicle,
    ground: ElevationMap,
    poses: BodyPoses,
    reach: tuple[float, float],
    errors: InputErrors,
) -> Contact:
    """First contact of a body that reaches so far ahead and behind of mid-wheelbase [m].

    Errors of the pose widen and lengthen it. The whole body is moved along the outermost courses
    and the last one; along the others, whose bodies lie between, the leading edge and the wheels.
    """
    layers, bare = obstacle_layers(ground, vehicle), _points(vehicle, reach, 0.0, 0.0, 0.0)
    points = bare
    if errors.has_band or errors.along_track > 0.0:
        points = _points(vehicle, reach, *_bands(vehicle, poses, errors))
    count = len(poses.x)
    outer = sorted({0, max(count - 2, 0), count - 1})
    between = [n for n in range(count) if n not in outer]

    def contact(body: _Points, *, exact: bool) -> Contact:
        parts = [(outer, body), (between, body.first(body.leading))]
        contacts = [
            _contact(layers, poses.on(courses), part, vehicle.shape.clearance, exact=exact)
            for courses, part in parts
            if courses
        ]
        return min(contacts)._replace(touches=any(c.touches for c in contacts))

    first = contact(points, exact=False)
    if not first.touches:
        return first
    # What is closer than the next cell is judged by the cells alone, or nothing could leave it.
    return contact(bare, exact=True)._replace(touches=True)


def _bands(vehicle: Vehicle, poses: BodyPoses, errors: InputErrors) -> tuple[float, float, float]:
    """Lateral band [m], its growth with the distance from the middle [1], and that ahead [m]."""
    tightest = float(np.abs(poses.turn).max()) / max(poses.share, _TENTH)
    tightest = min(tightest, 2.0 / vehicle.track_width)
    curvature = _TENTH * math.ceil(tightest / _TENTH)  # few bodies, which are stored
    return lateral_band(errors, 0.0, curvature), math.sin(errors.heading), errors.along_track


@lru_cache(maxsize=64)
def _points(
    vehicle: Vehicle, reach: tuple[float, float], band: float, growth: float, ahead: float
) -> _Points:
    """Wheels, outline and three rows across the underside, at most :data:`SPACING` apart."""
    front, rear = reach[0] + ahead, reach[1]
    side, half = 0.5 * vehicle.shape.width, 0.5 * vehicle.wheelbase
    end = side + band + growth * max(front, rear)
    across = np.linspace(-end, end, math.ceil(2.0 * end / SPACING) + 1)
    along = np.linspace(-rear, front, math.ceil((front + rear) / SPACING) + 1)
    tyre = 0.5 * vehicle.shape.wheel_width + band + growth * half
    tyres = 0.5 * vehicle.track_width + tyre * np.array([-1.0, 0.0, 1.0])
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
    place_and_normal: Floats = np.concatenate(columns, axis=1).astype(np.float32)
    x, y, normal_x, normal_y = place_and_normal[:4]
    return _Points(x, y, normal_x, normal_y, 2 * len(tyres) + len(across))


def _contact(
    layers: ObstacleLayers,
    poses: BodyPoses,
    points: _Points,
    clearance: float,
    *,
    exact: bool,
) -> Contact:
    """First contact on some courses; ``exact``: with cells instead of facets."""
    at = _places(layers, poses, points)
    top = layers.heights(*at, exact=exact)
    unknown = np.isnan(top)
    struck = top > _underside(layers, poses, points, clearance + layers.noise, exact=exact)
    edge = layers.edges(at[0][..., :_WHEELS], at[1][..., :_WHEELS])
    touches = bool(struck[:, 0].any() or edge[:, 0].any())
    if unknown.any() or struck.any():
        _exempt_start(unknown, struck, poses, points, layers.cell)
    # An edge on which a wheel stands already does not hold it there.
    edge &= ~np.logical_and.accumulate(edge, axis=1)
    first: list[Bools] = [np.any(hit, axis=(0, 2)) for hit in (unknown, struck, edge)]
    blocked: Bools = first[0] | first[1] | first[2]
    if not blocked.any():
        return Contact(len(blocked), "", None, touches)
    k = int(np.argmax(blocked))
    kind = next(i for i in range(3) if first[i][k])
    n, p = np.argwhere((unknown, struck, edge)[kind][:, k])[0]
    x, y = (float(o + layers.cell * q[n, k, p]) for o, q in zip(layers.origin, at, strict=True))
    return Contact(k, (UNKNOWN, OBSTACLE, EDGE)[kind], (x, y), touches)


def _places(layers: ObstacleLayers, poses: BodyPoses, points: _Points) -> tuple[Floats, Floats]:
    """Points (N, S, P) on the map, in cells."""
    x, y, cos, sin = (
        of[..., None].astype(np.float32)
        for of in (
            (poses.x - layers.origin[0]) / layers.cell,
            (poses.y - layers.origin[1]) / layers.cell,
            np.cos(poses.yaw) / layers.cell,
            np.sin(poses.yaw) / layers.cell,
        )
    )
    return (
        x + points.ahead * cos - points.left * sin,
        y + points.ahead * sin + points.left * cos,
    )


def _underside(
    layers: ObstacleLayers, poses: BodyPoses, points: _Points, clearance: float, *, exact: bool
) -> Floats:
    """Height (N, S, P) from which ground strikes the body, above the datum of the layers [m]."""
    slope = np.hypot(poses.rise, poses.cross_rise)
    # The vertical below the body is longer than the clearance by the slope.
    lowest = poses.height - layers.datum + clearance * np.sqrt(1.0 + slope**2)
    lowest = lowest + (0.5 if exact else 1.0) * _FACET * layers.cell * slope
    height, rise, cross_rise = (
        of[..., None].astype(np.float32) for of in (lowest, poses.rise, poses.cross_rise)
    )
    underside: Floats = height + rise * points.ahead + cross_rise * points.left
    return underside


def _exempt_start(
    unknown: Bools,
    struck: Bools,
    poses: BodyPoses,
    points: _Points,
    cell: float,
) -> None:
    """Clear what lies below the body or a cell from it where it stands, unless it moves there.

    Of unknown ground only the leading edge counts as moving there: a sensor often does not see the
    ground next to the vehicle, and what was seen to be an obstacle is one.
    """
    front, rear = float(points.ahead.max()), -float(points.ahead.min())
    side = float(points.left.max())
    n, s, p = np.nonzero(unknown | struck)
    ahead, left, yaw = points.ahead[p], points.left[p], poses.yaw[n, s]
    east = poses.x[n, s] + ahead * np.cos(yaw) - left * np.sin(yaw) - poses.x[0, 0]
    north = poses.y[n, s] + ahead * np.sin(yaw) + left * np.cos(yaw) - poses.y[0, 0]
    cos, sin = math.cos(poses.yaw[0, 0]), math.sin(poses.yaw[0, 0])
    along, across = east * cos + north * sin, north * cos - east * sin
    within = (along < front + cell) & (along > -rear - cell) & (np.abs(across) < side + cell)
    turn, normal = poses.turn[n], points.normal_ahead[p]
    outward = normal * (poses.share - turn * left) + points.normal_left[p] * turn * (
        ahead - poses.axis
    )
    leading = (normal > 0.0) & (poses.share > 0.0)
    unknown[n, s, p] &= ~within | leading
    struck[n, s, p] &= ~within | (outward > _OUTWARD)
