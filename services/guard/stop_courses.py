"""Courses that a vehicle may take until it stands, the ground on them, and where each must end.

A stop may hold the turn of the command, straighten the wheels at any moment, or begin while the
turn of the command before is still in force. Courses of constant curvature between the extremes
cover the ground of all of these. Lengths are those of the wheel that moves farthest, so that a turn
on the spot is a course like any other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.services.guard.guard_map import SPACING, classes_at, map_layers
from slopewise.services.guard.guard_model import GuardScene
from slopewise.services.guard.swept_contact import BodyPoses, Contact, SweptBody
from slopewise.services.physics.body import plane_of, wheel_places
from slopewise.services.physics.surfaces import possible_surfaces

_HEADINGS = 0.2
"""Angle between neighbouring courses where they end [rad]: their bodies overlap by far, and at the
corner of a body 1.2 m wide the nearest is 6 cm from each course between them."""

_NEAR, _BLOCK = 16, 40
"""Samples of the first block, and of those after it [1]: behind the first contact none is needed,
and most contacts are close."""

_MAX_COURSES = 24  # more than turns of half a revolution need [1]


STEEP = "ground is steeper than the brakes were learned on"
"""Reason to end a course."""


class Pose2d(NamedTuple):
    """Middle of the wheelbase [m] and heading [rad] on the map."""

    x: float
    y: float
    heading: float


class Course(NamedTuple):
    """A command as the motion of the fastest wheel, and the turns that a stop may take.

    Turns are in rad per metre of that wheel, left positive, whatever the direction of motion;
    speeds are of that wheel [m/s].
    """  # words: ok

    share: float  # distance of the middle of the wheelbase per metre of that wheel [1]
    commanded: float  # turn of the command; low, high: the least and the largest of a stop
    low: float
    high: float
    forward: bool
    requested: float = 0.0  # speed that is commanded
    moving: float = 0.0  # speed of the vehicle


class StopCourses(NamedTuple):
    """The outermost courses, one between them and the command's: N of S samples, (N, 1, S) each.

    The slopes of all others lie between. Speeds of stops are along the axis in the middle.
    """

    step: float  # distance of samples, of the fastest wheel [m]
    share: float  # see :class:`Course`
    turn: Floats  # (N, 1, 1) left positive [rad/m]
    grade: Floats  # grade, roll: uphill positive along the motion, left side up positive [rad]
    roll: Floats
    vertical_curvature: Floats  # for v² of the fastest wheel, negative over a crest [1/m]
    x: Floats  # x, y, yaw: middle of the wheelbase [m], direction of motion [rad]
    y: Floats
    yaw: Floats
    under: Ints  # (4, N, 1, S) class of the map under each wheel; (1, N, 1, S) of one class
    may_be: Bools  # (classes, surfaces) see :func:`possible_surfaces`
    possible: Ints  # indices of all surfaces that may be under a wheel on any course
    end: Contact  # what is first in the way of all courses


def courses_ahead(
    scene: GuardScene, pose: Pose2d, course: Course, length: float, longest: float
) -> StopCourses:
    """Sample the ground along all courses for ``length`` of the fastest wheel [m].

    They are as dense as they have to be where they end after ``longest`` [m]. What lies behind the
    first contact is not sampled.
    """
    model, turn = scene.model, _turns(course, longest * (course.high - course.low))
    shape, heading, share = model.shape, model.errors.heading, course.share
    axis = -model.turn_axis if course.forward else model.turn_axis
    corner = math.hypot(max(shape.front, shape.rear) + abs(axis), 0.5 * shape.width)
    step = SPACING / (share + corner * float(np.abs(turn).max()))
    station = step * np.arange(math.ceil(length / step) + 1, dtype=np.float64)
    errors = np.zeros((len(turn), 1))  # of the heading at the start, 0 on the last course [rad]
    if heading > 0.0 and share > 0.0:
        # A heading error leads aside, the farther the longer the stop is.
        turn = np.concatenate(((course.low, course.high), turn))
        errors = np.concatenate(([[-heading], [heading]], errors))
    turn = turn[:, None]
    x, y, yaw = _poses(pose, course, axis, turn, station, errors)
    planes = np.empty((3, *x.shape))
    poses = BodyPoses(x, y, np.cos(yaw), np.sin(yaw), planes, turn, share, axis)
    reach = (shape.front, shape.rear) if course.forward else (shape.rear, shape.front)
    ground, body = _WheelPlanes(scene, poses, step), SweptBody(scene, poses, reach)
    known, count, end = 0, len(station), Contact(len(station), "", None)
    while known < count and not end.reason:
        block = ground.sample(slice(known, min(known + (_BLOCK if known else _NEAR), count)))
        known = block.stop
        end = body.first_contact(block)
        k = ground.first_steep(block)
        if k < end.sample:
            end = end._replace(sample=k, reason=STEEP, where=(float(x[-1, k]), float(y[-1, k])))
    last = len(turn) - 1
    chosen = sorted({int(np.argmin(turn)), last // 2, int(np.argmax(turn)), last})
    # What lies behind the end does not matter to stops before it.
    some = (..., chosen, None, slice(end.sample + 1))
    grade, roll = np.arctan(planes[1][some]), np.arctan(planes[2][some])
    curvature = _vertical_curvature(grade, share, step, model.vehicle.wheelbase)
    under, possible = ground.surfaces(end.sample + 1)
    at = turn[chosen, None], grade, roll, curvature, x[some], y[some], yaw[some]
    return StopCourses(step, share, *at, under[..., chosen, None, :], ground.may_be, possible, end)


def _turns(course: Course, span: float) -> Floats:
    """Turns of courses (N,) that end within a span [rad], that of the command among them."""
    ends = course.low, course.high, course.commanded
    if course.share == 0.0 or course.low == course.high:
        return np.array(sorted(set(ends)))  # slower turns on the spot end within faster ones
    count = min(max(math.ceil(span / _HEADINGS), 1), _MAX_COURSES)
    between = np.linspace(course.low, course.high, count + 1)
    return between if course.commanded in ends[:2] else np.append(between, course.commanded)


def _poses(
    pose: Pose2d, course: Course, axis: float, turn: Floats, station: Floats, heading_error: Floats
) -> tuple[Floats, Floats, Floats]:
    """x, y [m], direction of motion [rad], (N, S) each; the point at the axis moves straight on."""
    start = pose.heading + heading_error + (0.0 if course.forward else math.pi)
    yaw = start + turn * station
    # A chord of the circle lies in the mean direction, shorter than the arc by the factor sinc.
    chord = course.share * station * np.sinc(0.5 * turn * station / np.pi)
    mean = start + 0.5 * turn * station
    x = pose.x + chord * np.cos(mean) + (np.cos(start) - np.cos(yaw)) * axis
    y = pose.y + chord * np.sin(mean) + (np.sin(start) - np.sin(yaw)) * axis
    return x, y, yaw


class _WheelPlanes:
    """Planes of the wheels on N courses of S samples, written block by block."""

    def __init__(self, scene: GuardScene, poses: BodyPoses, step: float) -> None:
        self._vehicle, self._ground, table = (
            scene.model.vehicle,
            scene.ground,
            scene.model.tables[0],
        )
        self._poses, self._planes, self._step = poses, poses.planes, poses.share * step
        self._felt = map_layers(self._ground, self._vehicle).wheels
        self.may_be = possible_surfaces(
            scene.model.promised.braking.terrain, self._ground.class_names
        )
        # Rise and cross rise (2, C) that each class was trained on.
        low = np.array((table.grade_min, table.roll_min))[:, None]
        high = np.array((table.grade_max, table.roll_max))[:, None]
        self._lowest = np.tan(np.where(self.may_be, low, -np.inf).max(axis=2))
        self._highest = np.tan(np.where(self.may_be, high, np.inf).min(axis=2))
        self._under: list[Ints] = []

    def sample(self, block: slice) -> slice:
        """Write a block of samples; the block, longer where ground is unknown at the start."""
        x, y, cos, sin = (of[:, block] for of in self._poses[:4])
        wheels = wheel_places(self._vehicle, (x, y, cos, sin))
        z, under = self._felt.at(*wheels), classes_at(self._ground, *wheels)
        self._set(block, z)
        steep = self._too_steep(block, under)
        if steep.any():  # it may be the edge of a crack that tyres bridge
            x, y = (of[:, steep] for of in wheels)
            z[:, steep] = self._felt.contact(x, y, cos[steep], sin[steep])
            self._set(block, z)
            steep = self._too_steep(block, under)
        count = self._planes.shape[2]
        if block.start == 0 and np.isnan(self._planes[0, :, 0]).any():
            if block.stop < count:
                return self.sample(slice(0, count))  # what is known farther ahead is continued back
            np.nan_to_num(self._planes, copy=False)
        self._under.append(under)
        self._steep = steep
        return block

    def _set(self, block: slice, z: Floats) -> None:
        """Write the planes of wheels at heights z (4, N, B); where one is unknown, the first."""
        part = self._planes[..., block]
        part[0], part[1:] = z.mean(axis=0), plane_of(z, self._vehicle)
        known = np.isfinite(part[1])
        if known.all():
            return
        first = np.argmax(known, axis=1) * (block.start == 0)
        height, rise, cross_rise = self._planes[:, np.arange(len(known)), first, None]
        further = block.start + np.arange(known.shape[1]) - first[:, None]
        height = height + self._step * rise * further
        for of, value in zip(part, (height, rise, cross_rise), strict=True):
            np.copyto(of, value, where=~known)

    def _too_steep(self, block: slice, under: Ints) -> Bools:
        slopes = self._planes[1:, :, block]
        steep: Bools = np.zeros(slopes.shape[1:], np.bool_)
        for slope, lowest, highest in zip(slopes, self._lowest, self._highest, strict=True):
            steep |= slope < lowest[under].max(axis=0)
            steep |= slope > highest[under].min(axis=0)
        return steep

    def first_steep(self, block: slice) -> int:
        """First sample of a block that is steeper than a surface was trained on, S without one."""
        steep = np.flatnonzero(self._steep.any(axis=0))
        return int(block.start + steep[0] if len(steep) else self._planes.shape[2])

    def surfaces(self, count: int) -> tuple[Ints, Ints]:
        """Classes under the wheels (4 or 1, N, count), and all surfaces that they may be."""
        under = np.concatenate(self._under, axis=-1)[..., :count]
        # Classes are few: counting them takes less than sorting.
        counts = np.bincount(under.ravel(), minlength=len(self.may_be))
        return under, np.flatnonzero(self.may_be[counts > 0].any(axis=0))


def _vertical_curvature(grade: Floats, share: float, step: float, wheelbase: float) -> Floats:
    """Vertical curvature over a wheelbase for v² of the fastest wheel, (N, 1, S) [1/m].

    The middle is slower by the share s of a course, and the grade changes over distances shorter by
    it: s² κ_v = s dθ/ds. On the spot nothing curves.
    """
    change, reach = np.zeros_like(grade), max(round(0.5 * wheelbase / step), 1)
    if grade.shape[-1] > 2 * reach:
        rise = grade[..., 2 * reach :] - grade[..., : -2 * reach]
        change[..., reach:-reach] = share / (2.0 * reach * step) * rise
    return change
