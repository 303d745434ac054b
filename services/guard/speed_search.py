"""Highest speed from which a vehicle stops on every course that a command may lead to."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.quantity import GRAVITY
from slopewise.services.guard.guard_model import GuardModel, GuardScene
from slopewise.services.guard.stop_courses import Course, Pose2d, StopCourses, courses_ahead
from slopewise.services.guard.stop_distances import stops_along

_SPEEDS = 10
"""Speeds that are tried up to the highest: a limited command is within a tenth of the best [1]."""

STANDSTILL = 0.05
"""Speed below which a vehicle stands [m/s], and yaw rate below which it does not turn [rad/s]."""

CREEP = 0.3
"""Speed of the fastest point of the body next to obstacles closer than a cell of the map or errors
of the pose [m/s]: a stop from it takes a few centimetres more than the dead time."""

_MAX_LENGTH = 80.0  # of the longest course: more than the stop of any vehicle at 15 m/s [m]

_LEVEL_SHARE, _MIN_SLOW = 0.5, 0.05
"""Share of the weakest level force that slopes leave at worst, and the lowest, for the length of
courses [1]."""

_PAST_STOP, _PAST_CLEAR = 0.5, 1.0
"""Length of a course beyond the stop, and beyond the clear distance [m]."""

TOLERANCE = 1e-9  # speed by which a command may exceed the allowed one: rounding [m/s]


class SpeedVerdict(NamedTuple):
    """Outcome for one command."""

    allowed: float  # share of the command that is allowed, 1 and more for all of it [1]
    brakes: bool  # the vehicle could not stop from its own speed any more
    reason: str
    where: tuple[float, float] | None
    # share of the yaw rate at which axles and sides keep their load at the vehicle's speed [1]
    turn: float = math.inf


def try_speeds(
    scene: GuardScene,
    pose: Pose2d,
    course: Course,
    held: float,
    late: float,
    load: float,
    creep: float,
) -> SpeedVerdict:
    """Try speeds up to the highest; the last one is that of the vehicle, on its way already.

    ``creep``: share of the command that is allowed next to obstacles [1].
    """
    model, share, top = scene.model, course.share, max(course.requested, course.moving)
    clear = scene.clear / share if share else math.inf
    speeds = np.append(top * np.arange(1, _SPEEDS + 1) / _SPEEDS, course.moving)
    times = np.append(np.full(_SPEEDS, held), late)
    min_load = load * model.promised.limits.min_load
    ways = courses_ahead(scene, pose, course, _course_length(model, top, held, clear))
    stops = stops_along(model, ways, speeds, times, min_load)
    # Nothing is known of what lies beyond.
    free = max(ways.end.sample - 1, 0) * ways.step
    inside = stops.distance <= min(free, clear)
    fine = (inside & stops.loaded)[:-1]
    failed = _SPEEDS if fine.all() else int(np.argmin(fine))
    allowed = float(speeds[failed - 1]) if failed else 0.0
    if share:
        fastest = model.tables[0].fastest[ways.possible].min()
        allowed = min(allowed, float(min(model.speed, fastest)) / share)
    brakes = course.moving >= STANDSTILL and not inside[-1]
    k = _SPEEDS if brakes else failed
    reason, where = "", None
    if brakes or not fine.all():
        reason, where = _reason(ways, bool(inside[k]), free, clear)
    elif ways.end.touches:
        reason = "next to an obstacle it creeps"
    requested = max(course.requested, TOLERANCE)
    allowed /= requested
    if ways.end.touches:
        # The command's points, and the rims in a tighter turn of a command before it.
        allowed = min(allowed, creep, CREEP / requested)
    turn = math.inf
    if share and not stops.loaded[:-1].all():
        # Lateral acceleration is speed times yaw rate, also of a vehicle that still slows down;
        # that of steered wheels, which keep the curvature of the allowed command, is by speed².
        steady = float(np.append(0.0, speeds)[np.argmin(stops.loaded[:-1])])
        moving = max(course.moving, TOLERANCE)
        turn = steady * steady / (top * moving)
        if model.vehicle.drive == "ackermann":
            turn = min(allowed, 1.0) * (steady / moving) ** 2
    return SpeedVerdict(allowed, brakes, reason, where, turn)


def _reason(
    ways: StopCourses, inside: bool, free: float, clear: float
) -> tuple[str, tuple[float, float] | None]:
    """Reason why a speed is too high, and the place of it."""
    if inside:
        return "an axle or a side would lose its load", None
    if not ways.end.reason and free < clear:
        return "brakes do not stop the vehicle on this slope", None
    if clear <= free:
        return f"the clear distance ends {ways.share * clear:.2f} m ahead", None
    if ways.share > 0.0:
        return f"{ways.end.reason} {ways.share * free:.2f} m ahead", ways.end.where
    angle = math.degrees(free * abs(float(ways.turn[0, 0, 0])))
    return f"{ways.end.reason} {angle:.0f}° ahead in the turn", ways.end.where


def _course_length(model: GuardModel, speed: float, held: float, clear: float) -> float:
    """Distance in which a stop from a speed ends with a share of the weakest level force [m]."""
    table = model.tables[0]
    weakest = float(np.min(table.level * (table.b_b + np.minimum(table.m_b, 0.0) * speed)))
    decel = GRAVITY * max(_LEVEL_SHARE * weakest, _MIN_SLOW)
    dead, offset = float(table.dead_time.max()), float(table.offset.max())
    reach = speed * (held + dead) + speed * speed / (2.0 * decel) + offset + _PAST_STOP
    return float(min(reach, clear + _PAST_CLEAR, _MAX_LENGTH))
