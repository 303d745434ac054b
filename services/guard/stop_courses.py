"""Courses that a vehicle may take until it stands, the ground on them, and where each must end.

A stop may hold the turn of the command, straighten the wheels at any moment, or begin while the
turn of the command before is still in force. Courses of constant curvature between the extremes
cover the ground of all of these. Lengths are those of the wheel that moves farthest, so that a turn
on the spot is a course like any other.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.vehicle import Vehicle
from slopewise.services.guard.guard_map import classes_at, wheel_heights
from slopewise.services.guard.guard_model import BrakeTable, GuardScene
from slopewise.services.guard.obstacle_layers import SPACING
from slopewise.services.guard.swept_contact import BodyPoses, Contact, first_contact
from slopewise.services.physics.body import plane_of, wheel_places
from slopewise.services.physics.surfaces import possible_surfaces

_HEADINGS = 0.2
"""Angle between neighbouring courses where they end [rad]: their bodies overlap by far, and at the
corner of a body 1.2 m wide the nearest is 6 cm from each course between them."""

_MANY = 600
"""Samples from which the outermost courses and the command's are tried first, and all of them only
as far as those go [1]: obstacles are often near, and fewer samples take no less time."""

_MARGIN = 1.1
"""Length of courses over the longest stop on the outermost ones and on the command's [1]: between
them the ground may be a little steeper."""

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


class _Fan(NamedTuple):
    """Inputs that all courses of a decision share."""

    scene: GuardScene
    pose: Pose2d
    course: Course
    axis: float  # see :class:`slopewise.services.guard.swept_contact.BodyPoses` [m]
    step: float  # distance of samples, of the fastest wheel [m]


def courses_ahead(
    scene: GuardScene,
    pose: Pose2d,
    course: Course,
    length: float,
    stop_on: Callable[[StopCourses], float] = lambda _: math.inf,
) -> StopCourses:
    """Sample the ground along all courses for ``length`` of the fastest wheel [m].

    ``stop_on``: longest stop on some courses [m], inf where it does not end. What lies farther
    ahead, or behind what ends the outermost courses or the command's, is not sampled.
    """
    model, turn = scene.model, _turns(course, length * (course.high - course.low))
    shape, heading = model.shape, model.errors.heading
    axis = -model.turn_axis if course.forward else model.turn_axis
    corner = math.hypot(max(shape.front, shape.rear) + abs(axis), 0.5 * shape.width)
    step = SPACING / (course.share + corner * float(np.abs(turn).max()))
    station = step * np.arange(math.ceil(length / step) + 1, dtype=np.float64)
    on, errors = _Fan(scene, pose, course, axis, step), np.zeros((len(turn), 1))
    if heading > 0.0 and course.share > 0.0:
        # A heading error leads aside, the farther the longer the stop is.
        turn = np.concatenate(((course.low, course.high), turn))
        errors = np.concatenate(([[-heading], [heading]], errors))
    if len(turn) * len(station) > _MANY:
        ends = _turns(course, 0.0)
        few = _along(on, ends, station, np.zeros((len(ends), 1)))
        length = min(length, _MARGIN * stop_on(few))
        station = station[: min(math.ceil(length / step), few.end.sample) + 1]
    return _along(on, turn, station, errors)


def _along(on: _Fan, turn: Floats, station: Floats, heading_error: Floats) -> StopCourses:
    """Ground on courses of some turns (N,) at stations (S,), up to the first contact.

    ``heading_error``: of the start of each course (N, 1), 0 for the last one [rad].
    """
    (model, ground, _), vehicle, share = on.scene, on.scene.model.vehicle, on.course.share
    x, y, yaw = _poses(on, turn[:, None], station, heading_error)
    cos, sin = np.cos(yaw), np.sin(yaw)
    wheels, felt = wheel_places(vehicle, (x, y, cos, sin)), wheel_heights(ground, vehicle)
    under = classes_at(ground, *wheels)
    may_be = possible_surfaces(model.promised.braking.terrain, ground.class_names)
    limits = _slope_limits(model.tables[0], may_be)
    z = felt.at(*wheels)
    height, rise, cross_rise = _extended(z, vehicle, share * on.step)
    steep = _too_steep(limits, rise, cross_rise, under)
    if steep.any():  # it may be the edge of a crack that tyres bridge
        x_steep, y_steep = (of[:, steep] for of in wheels)
        z[:, steep] = felt.contact(x_steep, y_steep, yaw[steep])
        height, rise, cross_rise = _extended(z, vehicle, share * on.step)
        steep = _too_steep(limits, rise, cross_rise, under)
    poses = BodyPoses(x, y, cos, sin, height, rise, cross_rise, turn[:, None], share, on.axis)
    end = _end(on, poses, steep)
    # What lies behind the end does not matter to stops before it.
    last = len(turn) - 1
    chosen = sorted({int(np.argmin(turn)), last // 2, int(np.argmax(turn)), last})
    some = (..., chosen, None, slice(end.sample + 1))
    grade, roll = np.arctan(rise[some]), np.arctan(cross_rise[some])
    # Classes are few: counting them takes less than sorting.
    counts = np.bincount(under[..., : end.sample + 1].ravel(), minlength=len(may_be))
    return StopCourses(
        step=on.step,
        share=share,
        turn=turn[chosen, None, None],
        grade=grade,
        roll=roll,
        vertical_curvature=_vertical_curvature(grade, share, on.step, vehicle.wheelbase),
        x=x[some],
        y=y[some],
        yaw=yaw[some],
        under=under[some],
        may_be=may_be,
        possible=np.flatnonzero(may_be[counts > 0].any(axis=0)),
        end=end,
    )


def _end(on: _Fan, poses: BodyPoses, steep: Bools) -> Contact:
    """First contact, or the first sample that is too steep (N, S) on any course."""
    model = on.scene.model
    front, rear = model.shape.front, model.shape.rear
    reach = (front, rear) if on.course.forward else (rear, front)
    end = first_contact(model, on.scene.ground, poses, reach)
    k = int(np.argmax(steep.any(axis=0)))
    if not steep[:, k].any() or k >= end.sample:
        return end
    where = float(poses.x[-1, k]), float(poses.y[-1, k])
    return end._replace(sample=k, reason=STEEP, where=where)


def _turns(course: Course, span: float) -> Floats:
    """Turns of courses (N,) that end within a span [rad], that of the command among them."""
    ends = course.low, course.high, course.commanded
    if course.share == 0.0 or course.low == course.high:
        return np.array(sorted(set(ends)))  # slower turns on the spot end within faster ones
    count = min(max(math.ceil(span / _HEADINGS), 1), _MAX_COURSES)
    between = np.linspace(course.low, course.high, count + 1)
    return between if course.commanded in ends[:2] else np.append(between, course.commanded)


def _poses(
    on: _Fan, turn: Floats, station: Floats, heading_error: Floats
) -> tuple[Floats, Floats, Floats]:
    """x, y [m], direction of motion [rad], (N, S) each; the point at the axis moves straight on."""
    start = on.pose.heading + heading_error + (0.0 if on.course.forward else math.pi)
    yaw = start + turn * station
    # A chord of the circle lies in the mean direction, shorter than the arc by the factor sinc.
    chord = on.course.share * station * np.sinc(0.5 * turn * station / np.pi)
    mean = start + 0.5 * turn * station
    x = on.pose.x + chord * np.cos(mean) + (np.cos(start) - np.cos(yaw)) * on.axis
    y = on.pose.y + chord * np.sin(mean) + (np.sin(start) - np.sin(yaw)) * on.axis
    return x, y, yaw


def _extended(z: Floats, vehicle: Vehicle, step: float) -> tuple[Floats, Floats, Floats]:
    """Mean height [m] and slopes ahead and to the left [1], (N, S), of wheels at heights (4, N, S).

    Where these are unknown the first known plane of the course is continued, 0 without one.
    """
    height, (rise, cross_rise) = z.mean(axis=0), plane_of(z, vehicle)
    known = np.isfinite(rise)
    if known.all():
        return height, rise, cross_rise
    n, first = np.arange(len(known)), np.argmax(known, axis=1)
    start = np.nan_to_num(np.array((height, rise, cross_rise))[:, n, first])[..., None]
    rise, cross_rise = np.where(known, rise, start[1]), np.where(known, cross_rise, start[2])
    further = np.arange(known.shape[1]) - first[:, None]
    return np.where(known, height, start[0] + step * rise * further), rise, cross_rise


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


def _slope_limits(table: BrakeTable, may_be: Bools) -> tuple[Floats, Floats]:
    """(2, C) min and max of rise and cross rise that each class was trained on."""
    low = np.array((table.grade_min, table.roll_min))[:, None]
    high = np.array((table.grade_max, table.roll_max))[:, None]
    lows, highs = np.where(may_be, low, -np.inf), np.where(may_be, high, np.inf)
    return np.tan(lows.max(axis=2)), np.tan(highs.min(axis=2))


def _too_steep(
    limits: tuple[Floats, Floats], rise: Floats, cross_rise: Floats, under: Ints
) -> Bools:
    """Samples (N, S) that are steeper than a surface under a wheel was trained on."""
    steep: Bools = np.zeros(rise.shape, np.bool_)
    for slope, lowest, highest in zip((rise, cross_rise), *limits, strict=True):
        steep |= slope < lowest[under].max(axis=0)
        steep |= slope > highest[under].min(axis=0)
    return steep
