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
from slopewise.services.guard.guard_model import GuardScene
from slopewise.services.guard.swept_contact import BodyPoses, Contact, SweptBody
from slopewise.services.physics.body import plane_of, wheel_places
from slopewise.services.physics.surfaces import possible_surfaces

_HEADINGS = 0.2
"""Angle between neighbouring courses where they end [rad]: their bodies overlap by far, and at the
corner of a body 1.2 m wide the nearest is 6 cm from each course between them."""

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
    """Sample the ground along all courses for a length of the fastest wheel [m]."""
    model, share = scene.model, course.share
    turn, errors = _turns(course, length * (course.high - course.low), model.errors.heading)
    shape, axis = model.vehicle.shape, -model.turn_axis if course.forward else model.turn_axis
    corner = math.hypot(max(shape.front, shape.rear) + abs(axis), 0.5 * shape.width)
    step = SPACING / (share + corner * float(np.abs(turn).max()))
    count = math.ceil(length / step) + 1
    station = step * np.arange(count, dtype=np.float64)
    x, y, yaw, cos, sin = _poses(pose, course, axis, turn, station, errors)
    ground = _wheel_ground(scene, (x, y, cos, sin), share * step)
    poses = BodyPoses(x, y, cos, sin, ground.planes, turn, share, axis)
    reach = (shape.front, shape.rear) if course.forward else (shape.rear, shape.front)
    end = SweptBody(scene, poses, reach).first_contact()
    k = int(np.argmax(ground.steep))
    if ground.steep[k] and k < end.sample:
        end = end._replace(sample=k, reason=STEEP, where=(float(x[-1, k]), float(y[-1, k])))
    # What lies behind the end does not matter to stops before it.
    count = min(end.sample + 1, count)
    # The outermost courses, the middle one and the command's.
    chosen = sorted(
        {int(np.argmin(turn)), (len(turn) - 1) // 2, int(np.argmax(turn)), len(turn) - 1}
    )
    some = (..., chosen, None, slice(count))
    grade, roll = np.arctan(ground.planes[1][some]), np.arctan(ground.planes[2][some])
    curvature = _vertical_curvature(grade, share, step, model.vehicle.wheelbase)
    under = ground.under[..., :count]
    # Classes are few: counting them takes less than sorting.
    classes = np.bincount(under.ravel(), minlength=len(ground.may_be)) > 0
    possible = np.flatnonzero(ground.may_be[classes].any(axis=0))
    vehicle = model.vehicle if course.forward else model.backward
    at = turn[chosen, None], grade, roll, curvature, x[some], y[some], yaw[some]
    under = under[..., chosen, None, :]
    return StopCourses(step, share, vehicle, *at, under, ground.may_be, possible, end)


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


class _WheelGround(NamedTuple):
    """Ground under the wheels on N courses of S samples."""

    planes: Floats  # (3, N, S) see :class:`BodyPoses`
    under: Ints  # (4, N, S) class of the map under each wheel; (1, N, S) of one class
    may_be: Bools  # see :class:`StopCourses`
    steep: Bools  # (S,) steeper on some course than a surface was trained on


def _wheel_ground(scene: GuardScene, pose: tuple[Floats, ...], step: float) -> _WheelGround:
    """Ground under poses x, y, cos and sin, (N, S) each, whose middles are a step apart [m]."""
    vehicle, ground, table = scene.model.vehicle, scene.ground, scene.model.tables[0]
    surfaces, names = scene.model.promised.braking.terrain, ground.class_names
    may_be = _may_be.get(lambda: possible_surfaces(surfaces, names), surfaces, names)
    felt, wheels = map_layers(ground, vehicle).wheels, wheel_places(vehicle, pose)
    z, under = felt.at(*wheels), classes_at(ground, *wheels)
    # Rise and cross rise (2, C) that each class was trained on.
    low = np.array((table.grade_min, table.roll_min))[:, None]
    high = np.array((table.grade_max, table.roll_max))[:, None]
    lowest = np.tan(np.where(may_be, low, -np.inf).max(axis=2))
    highest = np.tan(np.where(may_be, high, np.inf).min(axis=2))

    def sampled() -> tuple[Floats, Bools]:
        planes = _planes(z, vehicle, step)
        steep = np.zeros(z.shape[1:], np.bool_)
        for slope, low, high in zip(planes[1:], lowest, highest, strict=True):
            steep |= slope < low[under].max(axis=0)
            steep |= slope > high[under].min(axis=0)
        return planes, steep

    planes, steep = sampled()
    if steep.any():  # it may be the edge of a crack that tyres bridge
        x, y = (of[:, steep] for of in wheels)
        z[:, steep] = felt.contact(x, y, pose[2][steep], pose[3][steep])
        planes, steep = sampled()
    anywhere: Bools = np.any(steep, axis=0)
    return _WheelGround(np.nan_to_num(planes, copy=False), under, may_be, anywhere)


def _planes(z: Floats, vehicle: Vehicle, step: float) -> Floats:
    """(3, N, S) planes of wheels at heights z (4, N, S); where one is unknown, the first known.

    It is continued ahead and back; NaN where none is known.
    """
    planes: Floats = np.array((z.mean(axis=0), *plane_of(z, vehicle)))
    known = np.isfinite(planes[1])
    if not known.all():
        first = np.argmax(known, axis=1)
        height, rise, cross_rise = planes[:, np.arange(len(known)), first, None]
        height = height + step * rise * (np.arange(known.shape[1]) - first[:, None])
        for of, value in zip(planes, (height, rise, cross_rise), strict=True):
            np.copyto(of, value, where=~known)
    return planes


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
