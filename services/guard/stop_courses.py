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
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.surface_names import resolve_class
from slopewise.models.vehicle import Vehicle
from slopewise.services.guard.guard_map import classes_at, wheel_heights
from slopewise.services.guard.guard_model import GuardModel, SurfaceTable
from slopewise.services.guard.obstacle_layers import SPACING
from slopewise.services.guard.swept_contact import BodyPoses, Contact, first_contact

_HEADINGS = 0.2
"""Angle between neighbouring courses where they end [rad]: their bodies overlap by far, and at the
corner of a body 1.2 m wide the nearest is 6 cm from each course between them."""

_MANY = 600
"""Samples from which the first quarter of all courses is tried first [1]: obstacles are often
there, and fewer samples take no less time."""

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
    vertical_curvature: Floats  # change of the grade along the course [1/m]
    x: Floats  # x, y, yaw: middle of the wheelbase [m], direction of motion [rad]
    y: Floats
    yaw: Floats
    # (4, N, S) surface under each wheel as index into the model, -1 for any; (1, N, S) of one class
    under: Ints
    possible: list[int]  # indices of all surfaces that may be under a wheel, with their states
    end: Contact  # what is first in the way of all courses


def courses_ahead(
    model: GuardModel,
    table: SurfaceTable,
    ground: ElevationMap,
    pose: Pose2d,
    turning: Turning,
    length: float,
) -> StopCourses:
    """Sample the ground along all courses for ``length`` of the fastest wheel [m]."""
    turn, axis = _turns(turning, length), -model.turn_axis if turning.forward else model.turn_axis
    corner = math.hypot(
        max(model.shape.front, model.shape.rear) + abs(axis), 0.5 * model.shape.width
    )
    step = SPACING / (turning.share + corner * float(np.abs(turn).max()))
    station = step * np.arange(math.ceil(length / step) + 1, dtype=np.float64)
    on = _Ground(model, table, ground, pose, turning, axis, step)
    if len(turn) * len(station) > _MANY:
        courses = _along(on, turn, station[: len(station) // 4])
        if courses.end.reason:
            return courses
    return _along(on, turn, station)


class _Ground(NamedTuple):
    """Inputs that all courses of a decision share, see :func:`courses_ahead`."""

    model: GuardModel
    table: SurfaceTable
    ground: ElevationMap
    pose: Pose2d
    turning: Turning
    axis: float  # see :class:`slopewise.services.guard.swept_contact.BodyPoses` [m]
    step: float  # distance of samples, of the fastest wheel [m]


def _along(on: _Ground, turn: Floats, station: Floats) -> StopCourses:
    """Ground on courses of some turns (N,) at stations (S,), up to the first contact."""
    vehicle, share = on.model.vehicle, on.turning.share
    x, y, yaw = _poses(on, turn[:, None], station)
    cos, sin = np.cos(yaw), np.sin(yaw)
    front, rear = on.model.shape.front, on.model.shape.rear
    reach = (front, rear) if on.turning.forward else (rear, front)
    felt = wheel_heights(on.ground, vehicle)

    def contact(z: Floats) -> tuple[Floats, Floats, Contact]:
        grade, roll = _tilt(z, vehicle)
        rise, cross_rise = np.tan(grade), np.tan(roll)
        height = _extended(z.mean(axis=0), share * on.step * rise)
        poses = BodyPoses(x, y, cos, sin, height, rise, cross_rise, turn[:, None], share, on.axis)
        return grade, roll, first_contact(vehicle, on.ground, poses, reach, on.model.errors)

    wheels = _wheel_places(vehicle, x, y, cos, sin)
    grade, roll, end = contact(felt.at(*wheels))
    ahead = slice(end.sample + 1)  # what lies behind the end does not matter to stops before it
    under = map_surfaces(on.model, on.ground)[classes_at(on.ground, *wheels)]
    steep = _too_steep(on.table, grade[:, ahead], roll[:, ahead], under[..., ahead])
    if steep.any():  # it may be the edge of a crack that tyres bridge
        grade, roll, end = contact(felt.contact(*wheels, yaw))
        steep = _too_steep(on.table, grade, roll, under)
        k = int(np.argmax(steep))
        if steep[k] and k < end.sample:
            end = end._replace(sample=k, reason=STEEP, where=(float(x[-1, k]), float(y[-1, k])))
        ahead = slice(end.sample + 1)
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
        possible=_possible(on.model, under[..., ahead]),
        end=end,
    )


def _tilt(wheels: Floats, vehicle: Vehicle) -> tuple[Floats, Floats]:
    """Grade and roll (N, S) of heights (4, N, S) under wheels [m, rad]."""
    fl, fr, rl, rr = wheels
    grade = np.arctan2(0.5 * (fl + fr - rl - rr), vehicle.wheelbase)
    roll = np.arctan2(0.5 * (fl - fr + rl - rr), vehicle.track_width)
    return _extended(grade), _extended(roll)


def _wheel_places(
    vehicle: Vehicle, x: Floats, y: Floats, cos: Floats, sin: Floats
) -> tuple[Floats, Floats]:
    """Places of the wheels (4, N, S) [m]: front left, front right, rear left, rear right."""
    half, left = 0.5 * vehicle.wheelbase, 0.5 * vehicle.track_width
    x_body = np.array([half, half, -half, -half])[:, None, None]
    y_body = np.array([left, -left, left, -left])[:, None, None]
    return x + x_body * cos - y_body * sin, y + x_body * sin + y_body * cos


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


def _poses(on: _Ground, turn: Floats, station: Floats) -> tuple[Floats, Floats, Floats]:
    """x, y [m], direction of motion [rad], (N, S) each; the point at the axis moves straight on."""
    start = on.pose.heading + (0.0 if on.turning.forward else math.pi)
    yaw = start + turn * station
    # A chord of the circle lies in the mean direction, shorter than the arc by the factor sinc.
    chord = on.turning.share * station * np.sinc(0.5 * turn * station / np.pi)
    mean = start + 0.5 * turn * station
    x = on.pose.x + chord * np.cos(mean) + (math.cos(start) - np.cos(yaw)) * on.axis
    y = on.pose.y + chord * np.sin(mean) + (math.sin(start) - np.sin(yaw)) * on.axis
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
    """Change of the grade over a wheelbase, (N, S) [1/m]; on the spot nothing curves."""
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
