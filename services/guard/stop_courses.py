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
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.surface_names import resolve_class
from slopewise.models.vehicle import Vehicle
from slopewise.services.guard.guard_map import classes_at, wheel_heights
from slopewise.services.guard.guard_model import GuardModel, GuardScene, SurfaceTable
from slopewise.services.guard.obstacle_layers import SPACING
from slopewise.services.guard.swept_contact import BodyPoses, Contact, first_contact
from slopewise.services.physics.body import plane_of, wheel_places

_HEADINGS = 0.2
"""Angle between neighbouring courses where they end [rad]: their bodies overlap by far, and at the
corner of a body 1.2 m wide the nearest is 6 cm from each course between them."""

_MANY = 600
"""Samples from which the first quarter of all courses is tried first, and then only as much as the
stop needs [1]: obstacles are often near, and fewer samples take no less time."""

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


class Turning(NamedTuple):
    """Turn of a command, and the turns that a stop may take [rad] per metre of the fastest wheel.

    Left positive, whatever the direction of motion.
    """  # words: ok

    share: float  # distance of the middle of the wheelbase per metre of that wheel [1]
    commanded: float
    low: float
    high: float
    forward: bool


class StopCourses(NamedTuple):
    """N courses of S samples; arrays are (N, S) where no other shape is given."""

    step: float  # distance of samples, of the fastest wheel [m]
    share: float  # see :class:`Turning`
    turn: Floats  # (N,) left positive [rad/m]
    grade: Floats  # grade, roll: uphill positive along the motion, left side up positive [rad]
    roll: Floats
    vertical_curvature: Floats  # for v² of the fastest wheel, negative over a crest [1/m]
    x: Floats  # x, y, yaw: middle of the wheelbase [m], direction of motion [rad]
    y: Floats
    yaw: Floats
    # (4, N, S) surface under each wheel as index into the model, -1 for any; (1, N, S) of one class
    under: Ints
    possible: list[int]  # indices of all surfaces that may be under a wheel, with their states
    end: Contact  # what is first in the way of all courses


class _Fan(NamedTuple):
    """Inputs that all courses of a decision share."""

    scene: GuardScene
    pose: Pose2d
    turning: Turning
    axis: float  # see :class:`slopewise.services.guard.swept_contact.BodyPoses` [m]
    step: float  # distance of samples, of the fastest wheel [m]


def courses_ahead(
    scene: GuardScene,
    pose: Pose2d,
    turning: Turning,
    length: float,
    stop_on: Callable[[StopCourses], float] | None = None,
) -> StopCourses:
    """Sample the ground along all courses for ``length`` of the fastest wheel [m].

    ``stop_on``: longest stop on some courses [m], inf where it does not end; what lies farther
    ahead is not sampled.
    """
    model, turn = scene.model, _turns(turning, length)
    axis = -model.turn_axis if turning.forward else model.turn_axis
    corner = math.hypot(
        max(model.shape.front, model.shape.rear) + abs(axis), 0.5 * model.shape.width
    )
    step = SPACING / (turning.share + corner * float(np.abs(turn).max()))
    station = step * np.arange(math.ceil(length / step) + 1, dtype=np.float64)
    on = _Fan(scene, pose, turning, axis, step)
    is_long = len(turn) * len(station) > _MANY
    heading, errors = scene.model.errors.heading, np.zeros((len(turn), 1))
    if heading > 0.0 and turning.share > 0.0:
        # A heading error leads aside, the farther the longer the stop is.
        turn = np.concatenate(((turning.low, turning.high), turn))
        errors = np.concatenate(([[-heading], [heading]], errors))
    if is_long:
        courses = _along(on, turn, station[: len(station) // 4], errors)
        if courses.end.reason:
            return courses
    if is_long and stop_on is not None:
        ends = np.array(sorted({turning.low, turning.commanded, turning.high}))
        length = min(length, _MARGIN * stop_on(_along(on, ends, station, is_probe=True)))
        station = station[: math.ceil(length / step) + 1]
    return _along(on, turn, station, errors)


def _along(
    on: _Fan,
    turn: Floats,
    station: Floats,
    heading_error: Floats | float = 0.0,
    *,
    is_probe: bool = False,
) -> StopCourses:
    """Ground on courses of some turns (N,) at stations (S,), up to the first contact.

    ``heading_error``: of the start of each course (N, 1), 0 for the last one [rad].
    A probe has the slopes only, as if there were no contact.
    """
    model, tables, ground, _ = on.scene
    vehicle, share = model.vehicle, on.turning.share
    x, y, yaw = _poses(on, turn[:, None], station, heading_error)
    cos, sin = np.cos(yaw), np.sin(yaw)
    wheels, felt = wheel_places(vehicle, (x, y, cos, sin)), wheel_heights(ground, vehicle)
    under = map_surfaces(model, ground)[classes_at(ground, *wheels)]
    z, end = felt.at(*wheels), Contact(len(station), "", None)
    rise, cross_rise, grade, roll = _slopes(z, vehicle)
    if not is_probe:
        steep = _too_steep(tables[0], grade, roll, under)
        if steep.any():  # it may be the edge of a crack that tyres bridge
            z = felt.contact(*wheels, yaw)
            rise, cross_rise, grade, roll = _slopes(z, vehicle)
            steep = _too_steep(tables[0], grade, roll, under)
        height = _extended(z.mean(axis=0), share * on.step * rise)
        poses = BodyPoses(x, y, cos, sin, height, rise, cross_rise, turn[:, None], share, on.axis)
        end = _end(on, poses, steep)
    ahead = slice(end.sample + 1)  # what lies behind the end does not matter to stops before it
    grade = grade[:, ahead]
    return StopCourses(
        step=on.step,
        share=share,
        turn=turn,
        grade=grade,
        roll=roll[:, ahead],
        vertical_curvature=_vertical_curvature(grade, share, on.step, vehicle.wheelbase),
        x=x[:, ahead],
        y=y[:, ahead],
        yaw=yaw[:, ahead],
        under=under[..., ahead],
        possible=_possible(model, under[..., ahead]),
        end=end,
    )


def _slopes(z: Floats, vehicle: Vehicle) -> tuple[Floats, Floats, Floats, Floats]:
    """Rise ahead and to the left [1], grade and roll [rad], (N, S), of heights under wheels [m]."""
    rise, cross_rise = (_extended(slope) for slope in plane_of(z, vehicle))
    return rise, cross_rise, np.arctan(rise), np.arctan(cross_rise)


def _end(on: _Fan, poses: BodyPoses, steep: Bools) -> Contact:
    """First contact, or the first of the samples (S,) that are too steep."""
    model = on.scene.model
    front, rear = model.shape.front, model.shape.rear
    reach = (front, rear) if on.turning.forward else (rear, front)
    end = first_contact(model.vehicle, on.scene.ground, poses, reach, model.errors)
    k = int(np.argmax(steep))
    if not steep[k] or k >= end.sample:
        return end
    where = float(poses.x[-1, k]), float(poses.y[-1, k])
    return end._replace(sample=k, reason=STEEP, where=where)


def map_surfaces(model: GuardModel, ground: ElevationMap) -> Ints:
    """Index in the model of each surface that the map names; -1 where the model lacks it."""
    names = list(model.surfaces)
    surfaces = [resolve_class(model.named, name) for name in ground.class_names]
    return np.array([-1 if surface is None else names.index(surface) for surface in surfaces])


def _turns(turning: Turning, length: float) -> Floats:
    """Turns of the courses (N,), that of the command among them."""
    ends = turning.low, turning.high, turning.commanded
    if turning.share == 0.0:
        return np.array(sorted(set(ends)))  # slower turns on the spot end within faster ones
    span = (turning.high - turning.low) * length
    count = min(math.ceil(span / _HEADINGS), _MAX_COURSES)
    between = np.linspace(turning.low, turning.high, count + 1)
    return between if turning.commanded in ends[:2] else np.append(between, turning.commanded)


def _poses(
    on: _Fan, turn: Floats, station: Floats, heading_error: Floats | float
) -> tuple[Floats, Floats, Floats]:
    """x, y [m], direction of motion [rad], (N, S) each; the point at the axis moves straight on."""
    start = on.pose.heading + heading_error + (0.0 if on.turning.forward else math.pi)
    yaw = start + turn * station
    # A chord of the circle lies in the mean direction, shorter than the arc by the factor sinc.
    chord = on.turning.share * station * np.sinc(0.5 * turn * station / np.pi)
    mean = start + 0.5 * turn * station
    x = on.pose.x + chord * np.cos(mean) + (np.cos(start) - np.cos(yaw)) * on.axis
    y = on.pose.y + chord * np.sin(mean) + (np.sin(start) - np.sin(yaw)) * on.axis
    return x, y, yaw


def _extended(values: Floats, slope: Floats | None = None) -> Floats:
    """Values with unknown ones replaced by the first known one of each course, along a slope."""
    known = np.isfinite(values)
    if known.all():
        return values
    first = np.argmax(known, axis=1)[:, None]
    value = np.nan_to_num(np.take_along_axis(values, first, axis=1))
    if slope is not None:
        value = value + slope * (np.arange(values.shape[1]) - first)
    return np.where(known, values, value)


def _vertical_curvature(grade: Floats, share: float, step: float, wheelbase: float) -> Floats:
    """Vertical curvature over a wheelbase for v² of the fastest wheel, (N, S) [1/m].

    The middle is slower by the share s of a course, and the grade changes over distances shorter by
    it: s² κ_v = s dθ/ds. On the spot nothing curves.
    """
    change, reach = np.zeros_like(grade), max(round(0.5 * wheelbase / step), 1)
    if grade.shape[1] > 2 * reach:
        rise = grade[:, 2 * reach :] - grade[:, : -2 * reach]
        change[:, reach:-reach] = share / (2.0 * reach * step) * rise
    return change


def _possible(model: GuardModel, under: Ints) -> list[int]:
    # Indices are few: counting them takes less than sorting.
    seen = set(np.flatnonzero(np.bincount(under.ravel() + 1)) - 1)
    if -1 in seen:
        return list(range(len(model.surfaces)))
    return [k for k, of in enumerate(model.governing) if k in seen or of in seen]


def _too_steep(table: SurfaceTable, grade: Floats, roll: Floats, under: Ints) -> Bools:
    """Samples (S,) at which a course is steeper than a surface under a wheel was trained on."""
    steep: Bools = grade < table.grade_min[under].max(axis=0)
    steep |= roll < table.roll_min[under].max(axis=0)
    steep |= grade > table.grade_max[under].min(axis=0)
    steep |= roll > table.roll_max[under].min(axis=0)
    at_any: Bools = np.any(steep, axis=0)
    return at_any
