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
from slopewise.models.recent import Recent
from slopewise.models.vehicle import Vehicle
from slopewise.services.guard.guard_map import SPACING, classes_at, map_layers
from slopewise.services.guard.guard_model import GuardModel, GuardScene
from slopewise.services.guard.swept_contact import BodyPoses, Contact, SweptBody
from slopewise.services.physics.body import plane_of, wheel_places
from slopewise.services.physics.surfaces import possible_surfaces

_HEADINGS = 0.2
"""Angle between neighbouring courses where they end [rad]: their bodies overlap by far, and at the
corner of a body 1.2 m wide the nearest is 6 cm from each course between them."""

_NEAR, _FEW = 16, 128
"""Samples of the first block, and poses of it [1], the more of both: behind the first contact none
is needed, and most contacts are close."""

_GROWTH = 3
"""Samples of a block over those of the one before [1]: of a long course, little is sampled behind a
contact, and a block costs as much as thirty samples of a fan."""

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
    vehicle: Vehicle  # its front leads, in reverse too
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


def courses_ahead(scene: GuardScene, pose: Pose2d, course: Course, length: float) -> StopCourses:
    """Sample the ground along all courses for a length of the fastest wheel [m].

    What lies behind the first contact is not sampled.
    """
    model, share = scene.model, course.share
    turn, errors = _turns(course, length * (course.high - course.low), model.errors.heading)
    shape, axis = model.vehicle.shape, -model.turn_axis if course.forward else model.turn_axis
    corner = math.hypot(max(shape.front, shape.rear) + abs(axis), 0.5 * shape.width)
    step = SPACING / (share + corner * float(np.abs(turn).max()))
    count = math.ceil(length / step) + 1
    station = step * np.arange(count, dtype=np.float64)
    placed, planes = np.empty((5, len(turn), len(station))), np.empty((3, len(turn), len(station)))
    x, y, yaw, cos, sin = placed
    poses = BodyPoses(x, y, cos, sin, planes, turn, share, axis)
    reach = (shape.front, shape.rear) if course.forward else (shape.rear, shape.front)
    ground, body = _WheelPlanes(scene, poses, step), SweptBody(scene, poses, reach)
    known, posed, end = 0, 0, Contact(0, "", None)
    size = max(_NEAR, _FEW // len(turn))
    while known < count and not end.reason:
        block = slice(known, min(known + size, count))
        new = slice(posed, block.stop)
        placed[..., new] = _poses(pose, course, axis, turn, station[new], errors)
        # Where ground is unknown at the start, what is known farther ahead is continued back.
        posed, size = new.stop, _GROWTH * size
        known = ground.sample(block, is_last=block.stop == count)
        if known == 0:
            continue
        block = slice(block.start, known)
        end = body.first_contact(block)
        k = ground.first_steep(block)
        if k < end.sample:
            end = end._replace(sample=k, reason=STEEP, where=(float(x[-1, k]), float(y[-1, k])))
    # What lies behind the end does not matter to stops before it.
    reached = yaw[:, : min(end.sample + 1, count)]
    courses = _outermost(model, poses, reached, ground, step, end)
    return courses if course.forward else courses._replace(vehicle=model.backward)


def _outermost(
    model: GuardModel,
    poses: BodyPoses,
    yaw: Floats,
    ground: _WheelPlanes,
    step: float,
    end: Contact,
) -> StopCourses:
    """Courses for stops, as far as directions of motion yaw (N, S) are given [rad]."""
    last, count = len(yaw) - 1, yaw.shape[1]
    turn, share = poses.turn, poses.share
    chosen = sorted({int(np.argmin(turn)), last // 2, int(np.argmax(turn)), last})
    some = (..., chosen, None, slice(count))
    grade, roll = np.arctan(poses.planes[1][some]), np.arctan(poses.planes[2][some])
    curvature = _vertical_curvature(grade, share, step, model.vehicle.wheelbase)
    under, possible = ground.surfaces(count)
    at = turn[chosen, None], grade, roll, curvature, poses.x[some], poses.y[some], yaw[some]
    under = under[..., chosen, None, :]
    may_be, vehicle = ground.may_be, model.vehicle
    return StopCourses(step, share, vehicle, *at, under, may_be, possible, end)


def _turns(course: Course, span: float, heading: float) -> tuple[Floats, Floats]:
    """Turns of courses that end within a span [rad], the command's last, and heading errors (N, 1).

    ``heading``: error of the heading at the start of two further courses [rad].
    """
    ends = course.low, course.high, course.commanded
    if course.share == 0.0 or course.low == course.high:
        turn = np.array(sorted(set(ends)))  # slower turns on the spot end within faster ones
    else:
        count = min(max(math.ceil(span / _HEADINGS), 1), _MAX_COURSES)
        turn = np.linspace(course.low, course.high, count + 1)
        if course.commanded not in ends[:2]:
            turn = np.append(turn, course.commanded)
    errors = np.zeros_like(turn)
    if heading > 0.0 and course.share > 0.0:
        # A heading error leads aside, the farther the longer the stop is.
        turn = np.concatenate(((course.low, course.high), turn))
        errors = np.concatenate(((-heading, heading), errors))
    return turn[:, None], errors[:, None]


def _poses(
    pose: Pose2d, course: Course, axis: float, turn: Floats, station: Floats, heading_error: Floats
) -> tuple[Floats, ...]:
    """x, y [m], direction of motion [rad], its cos and sin, (N, S) each.

    The point at the axis moves straight on.
    """
    start = pose.heading + heading_error + (0.0 if course.forward else math.pi)
    half = 0.5 * turn * station
    yaw = start + 2.0 * half
    cos, sin = np.cos(yaw), np.sin(yaw)
    # A chord of the circle lies in the mean direction, shorter than the arc by the factor sinc.
    chord, mean = course.share * station * np.sinc(half / np.pi), start + half
    x = pose.x + chord * np.cos(mean) + (np.cos(start) - cos) * axis
    y = pose.y + chord * np.sin(mean) + (np.sin(start) - sin) * axis
    return x, y, yaw, cos, sin


_may_be: Recent[Bools] = Recent(2)  # see :func:`possible_surfaces`


class _WheelPlanes:
    """Planes of the wheels on N courses of S samples, written block by block."""

    def __init__(self, scene: GuardScene, poses: BodyPoses, step: float) -> None:
        model, self._ground = scene.model, scene.ground
        self._vehicle, table = model.vehicle, model.tables[0]
        self._poses, self._planes, self._step = poses, poses.planes, poses.share * step
        self._felt = map_layers(self._ground, self._vehicle).wheels
        surfaces, names = model.promised.braking.terrain, self._ground.class_names
        self.may_be = _may_be.get(lambda: possible_surfaces(surfaces, names), surfaces, names)
        # Rise and cross rise (2, C) that each class was trained on.
        low = np.array((table.grade_min, table.roll_min))[:, None]
        high = np.array((table.grade_max, table.roll_max))[:, None]
        self._lowest = np.tan(np.where(self.may_be, low, -np.inf).max(axis=2))
        self._highest = np.tan(np.where(self.may_be, high, np.inf).min(axis=2))
        self._gentle = self._lowest.max(axis=1), self._highest.min(axis=1)  # of all classes
        self._under: list[Ints] = []

    def sample(self, block: slice, *, is_last: bool) -> int:
        """Write a block of samples, up to the first steep one; the count that is known then.

        0 where ground is unknown at the start, unless the block is the last one.
        """
        x, y, cos, sin = (of[:, block] for of in self._poses[:4])
        wheels = wheel_places(self._vehicle, (x, y, cos, sin))
        z, under = self._felt.at(*wheels), classes_at(self._ground, *wheels)
        self._set(block, z)
        is_unknown = block.start == 0 and bool(np.isnan(self._planes[0, :, 0]).any())
        if is_unknown and not is_last:
            return 0
        steep = self._too_steep(block, under)
        count = int(np.argmax(steep.any(axis=0)))
        if count > 0:  # most contacts come before it
            block, steep = slice(block.start, block.start + count), steep[:, :count]
        elif steep[:, 0].any():  # it may be the edge of a crack that tyres bridge
            x, y = (of[:, steep] for of in wheels)
            z[:, steep] = self._felt.contact(x, y, cos[steep], sin[steep])
            self._set(block, z)
            steep = self._too_steep(block, under)
        if is_unknown:
            np.nan_to_num(self._planes[..., block], copy=False)
        self._under.append(under[..., : steep.shape[1]])
        self._steep = steep
        return int(block.stop)

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
        low, high = slopes.min(axis=(1, 2)), slopes.max(axis=(1, 2))
        if np.all(low >= self._gentle[0]) and np.all(high <= self._gentle[1]):
            return steep
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
