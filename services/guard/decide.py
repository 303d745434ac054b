"""Decision on one command: pass it, limit it, or stop.

A command passes if the vehicle, at the higher of its speed and the commanded one, can still stop
after the command was in force for its hold time: on every course that the stop may take, with its
whole body on known ground free of obstacles, before the clear distance, with enough load on every
axle and side. Otherwise it is limited to the highest speed from which this holds; where the vehicle
could not stop from the speed at which it moves now, the brakes are applied immediately.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.models.recent import Recent
from slopewise.services.guard.arc_limits import TOO_FAST, arc_limits, rim_speed
from slopewise.services.guard.guard_model import GuardModel, GuardScene, guard_model
from slopewise.services.guard.settings import GuardJudgement, GuardTiming  # words: ok, key
from slopewise.services.guard.stop_courses import Course, Pose2d, StopCourses, courses_ahead
from slopewise.services.guard.stop_distances import stops_along

_SPEEDS = 10
"""Speeds that are tried up to the highest: a limited command is within a tenth of the best [1]."""

_STANDSTILL = 0.05
"""Speed below which a vehicle stands [m/s], and yaw rate below which it does not turn [rad/s]."""

_CREEP = 0.3
"""Speed of the fastest wheel next to obstacles closer than a cell of the map [m/s]: a stop from it
takes a few centimetres more than the dead time."""

_MAX_SPEED = 1e3  # beyond that of any vehicle [m/s]
_MAX_LENGTH = 80.0  # of the longest course: more than the stop of any vehicle at 15 m/s [m]

_LEVEL_SHARES, _MIN_SLOW = (0.9, 0.5), 0.05
"""Shares of the weakest level force that slopes mostly and at worst leave, and the lowest, for the
length of courses [1]."""

_PAST_STOP, _PAST_CLEAR = 0.5, 1.0
"""Length of a course beyond the stop, and beyond the clear distance [m]."""

_TOLERANCE = 1e-9  # speed by which a command may exceed the allowed one: rounding [m/s]


class VehicleMotion(NamedTuple):
    """Pose, speed along it, forward positive [m/s], and yaw rate, 0 where unknown [rad/s]."""

    pose: Pose2d
    speed: float
    yaw_rate: float = 0.0


class BaseCommand(NamedTuple):
    """Speed [m/s] and yaw rate [rad/s] for the base."""

    speed: float
    yaw_rate: float


class GuardDecision(NamedTuple):
    """Decision on a command."""

    action: str  # `pass`, `slow` or `stop`
    command: BaseCommand  # speed and yaw rate that the base receives
    brake: bool  # brake as hard as possible, and hold
    reason: str  # as text, empty where the command passes
    of: int = 0  # number of the command that it answers, 0 of none
    where: tuple[float, float] | None = None  # place on the map that limits it, if one does [m]


STILL = BaseCommand(0.0, 0.0)  # command of a stopped base [m/s, rad/s]


class _Verdict(NamedTuple):
    """Outcome for one command."""

    allowed: float  # share of the command that is allowed, 1 and more for all of it [1]
    brakes: bool  # the vehicle could not stop from its own speed any more
    reason: str
    where: tuple[float, float] | None
    # share of the yaw rate at which axles and sides keep their load at the vehicle's speed [1]
    turn: float = math.inf


def stop(reason: str, where: tuple[float, float] | None = None) -> GuardDecision:
    """Brake, and hold."""
    return GuardDecision("stop", STILL, True, reason, where=where)


def decide(
    scene: GuardScene,
    motion: VehicleMotion,
    command: BaseCommand,
    *,
    hold_time: float,
    late: float,
    load: float,
    reached: float = 0.0,
    before: tuple[BaseCommand, ...] = (),
) -> GuardDecision:
    """Decide on one command.

    ``hold_time``: time for which the command may stay in force [s]; ``late``: age of the motion,
    and transport time of a decision to the base [s]; ``load``: share of ``min_load`` that is kept
    in every stop [1]; ``reached``: speed to which the vehicle may have accelerated since the motion
    [m/s]; ``before``: commands that the vehicle may still follow.
    """
    if not all(map(math.isfinite, (*motion.pose, motion.speed, *command))):
        return stop("command or odometry contains a value that is not finite")
    fastest = max(motion.speed, reached, key=abs)
    if abs(fastest) > _MAX_SPEED:
        return stop(f"odometry has a speed of {fastest:.3g} m/s, which no vehicle has")
    turning = max(abs(rate) for rate in (motion.yaw_rate, *(c.yaw_rate for c in before[:1])))
    share, yaw_share, reason = arc_limits(scene.model, command, abs(fastest), turning)
    command = BaseCommand(share * command.speed, yaw_share * command.yaw_rate)
    requested, moving = abs(command.speed), abs(fastest)
    is_still = moving < _STANDSTILL
    if is_still and max(requested, abs(command.yaw_rate)) < _STANDSTILL:
        return GuardDecision("pass", STILL, True, "")
    forward = command.speed >= 0.0 if is_still else fastest >= 0.0
    # Driving the other way is decided once the vehicle stands.
    reverses = min(moving, requested) >= _STANDSTILL and (command.speed >= 0.0) != forward
    courses = _courses(scene.model, moving, command, before, forward=forward, reverses=reverses)
    late += scene.model.errors.latency
    held = hold_time + late
    verdict = _Verdict(math.inf, False, "", None)
    for course in courses:
        checked = _checked(scene, motion.pose, course, held, late, load)
        turn = min(verdict.turn, checked.turn)
        verdict = min(verdict, checked, key=lambda of: (not of.brakes, of.allowed))
        verdict = verdict._replace(turn=turn)
        if verdict.brakes or verdict.allowed == 0.0:
            break  # no other course can make it worse
    if verdict.brakes:
        return stop(verdict.reason, verdict.where)
    if reverses:
        return GuardDecision("slow", STILL, False, "it has to stand before it drives back")
    if reason and min(verdict.allowed, verdict.turn) >= 1.0 - _TOLERANCE:
        return GuardDecision("slow", command, False, reason)
    return _limited(scene.model, motion, command, verdict)


def _courses(
    model: GuardModel,
    moving: float,
    command: BaseCommand,
    before: tuple[BaseCommand, ...],
    *,
    forward: bool,
    reverses: bool,
) -> list[Course]:
    """Motions that a command may lead to: on its arc; of a slow base, turning before it drives."""
    requested = 0.0 if reverses else abs(command.speed)
    top = max(moving, requested)
    if top < _STANDSTILL:
        return [_on_the_spot(model, command, before)]
    courses = [_on_an_arc(model, moving, requested, command, before, forward=forward)]
    rim = rim_speed(model, 0.0, command.yaw_rate)
    if model.vehicle.drive == "skid_steer" and max(moving, _STANDSTILL) < min(rim, requested):
        # The base may turn at the commanded rate before it has the commanded speed.
        courses.append(_on_the_spot(model, command, ()))
    return courses


def _on_the_spot(
    model: GuardModel, command: BaseCommand, before: tuple[BaseCommand, ...]
) -> Course:
    radius = 0.5 * model.vehicle.track_width
    rates = [c.yaw_rate for c in before if abs(c.yaw_rate) >= _STANDSTILL]
    moving = radius * max(map(abs, rates), default=0.0)
    turns = [math.copysign(1.0 / radius, rate) for rate in (command.yaw_rate, *rates)]
    requested = radius * abs(command.yaw_rate)
    return Course(0.0, turns[0], min(turns), max(turns), True, requested, moving)


def _on_an_arc(
    model: GuardModel,
    moving: float,
    requested: float,
    command: BaseCommand,
    before: tuple[BaseCommand, ...],
    *,
    forward: bool,
) -> Course:
    """Course between straight on and the turns of this command and of those before it."""
    top = max(moving, requested)
    turn = command.yaw_rate / top
    # Turns tighter than the command's are as tight as the limit in turns lets a base be.
    tightest = max(abs(turn), model.lateral / top**2)
    rates = [command.yaw_rate, *(c.yaw_rate for c in before)]
    slower = [min(moving, requested), *(max(moving, abs(c.speed)) for c in before)]
    other_turns = [
        min(max(rate / max(speed, _STANDSTILL), -tightest), tightest)
        for rate, speed in zip(rates, slower, strict=True)
    ]
    factor = max(1.0, 0.5 * model.vehicle.track_width * max(map(abs, (turn, *other_turns))))
    ends = (0.0, turn, *other_turns)
    turns = turn / factor, min(ends) / factor, max(ends) / factor
    return Course(1.0 / factor, *turns, forward, factor * requested, factor * moving)


def _checked(
    scene: GuardScene, pose: Pose2d, course: Course, held: float, late: float, load: float
) -> _Verdict:
    """Try speeds up to the highest; the last one is that of the vehicle, on its way already."""
    model, share, top = scene.model, course.share, max(course.requested, course.moving)
    clear = scene.clear / share if share else math.inf
    speeds = np.append(top * np.arange(1, _SPEEDS) / _SPEEDS, (top, course.moving))
    times = np.append(np.full(_SPEEDS, held), late)
    min_load = load * model.promised.limits.min_load
    lengths = [_course_length(model, top, held, clear, left) for left in _LEVEL_SHARES]
    for length, ways in zip(lengths, courses_ahead(scene, pose, course, lengths), strict=True):
        stops = stops_along(model, ways, speeds, times, min_load)
        if ways.end.reason or length > clear or stops.distance.max() <= length:
            break
    # Nothing is known of what lies beyond.
    free = max(ways.end.sample - 1, 0) * ways.step
    inside = stops.distance <= min(free, clear)
    fine = (inside & stops.loaded)[:-1]
    failed = _SPEEDS if fine.all() else int(np.argmin(fine))
    turn = math.inf
    if share and not stops.loaded[:-1].all():
        # Lateral acceleration is speed times yaw rate, also of a vehicle that still slows down.
        steady = float(np.append(0.0, speeds)[np.argmin(stops.loaded[:-1])])
        turn = steady * steady / (top * max(course.moving, _TOLERANCE))
    cap = _CREEP if ways.end.touches else math.inf
    if share:
        fastest = model.tables[0].fastest[ways.possible].min()
        cap = min(cap, float(min(model.speed, fastest)) / share)
    allowed = min(float(speeds[failed - 1]) if failed else 0.0, cap)
    brakes = course.moving >= _STANDSTILL and not inside[-1]
    k = _SPEEDS if brakes else failed
    reason, where = "", None
    if brakes or not fine.all():
        reason, where = _reason(ways, bool(inside[k]), free, clear)
    elif ways.end.touches:
        reason = "next to an obstacle it creeps"
    return _Verdict(allowed / max(course.requested, _TOLERANCE), brakes, reason, where, turn)


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


def _course_length(
    model: GuardModel, speed: float, held: float, clear: float, level_share: float
) -> float:
    """Distance in which a stop from a speed ends with a share of the weakest level force [m]."""
    table = model.tables[0]
    weakest = float(np.min(table.level * (table.b_b + np.minimum(table.m_b, 0.0) * speed)))
    decel = GRAVITY * max(level_share * weakest, _MIN_SLOW)
    dead, offset = float(table.dead_time.max()), float(table.offset.max())
    reach = speed * (held + dead) + speed * speed / (2.0 * decel) + offset + _PAST_STOP
    return float(min(reach, clear + _PAST_CLEAR, _MAX_LENGTH))


def _limited(
    model: GuardModel, motion: VehicleMotion, command: BaseCommand, verdict: _Verdict
) -> GuardDecision:
    """Command on the same arc, at the allowed speed and yaw rate at most."""
    share, where = min(verdict.allowed, 1.0), verdict.where
    if min(share, verdict.turn) >= 1.0 - _TOLERANCE:
        return GuardDecision("pass", command, False, "")
    reason = verdict.reason or TOO_FAST
    if share * rim_speed(model, *command) < _STANDSTILL and abs(motion.speed) < _STANDSTILL:
        return stop(reason, where)
    limited = BaseCommand(share * command.speed, min(share, verdict.turn) * command.yaw_rate)
    return GuardDecision("slow", limited, False, reason, where=where)


_models: Recent[GuardModel] = Recent(2)


def guard_decision(
    model: Model,
    elevation_map: ElevationMap,
    pose: tuple[float, float, float],
    speed: float,
    command: tuple[float, float],
    *,
    clear: float = math.inf,
    age: float = 0.0,
    before: Sequence[tuple[float, float]] = (),
) -> GuardDecision:
    """Decide on a velocity command as the running guard does: pass it, limit it, or stop.

    Args:
        model: vehicle, braking, ground and limits.
        elevation_map: ground as known now.
        pose: x, y of the middle of the wheelbase [m] and heading [rad] on the map.
        speed: speed along the heading, negative in reverse [m/s].
        command: speed [m/s] and yaw rate [rad/s], left positive; (0, rate) turns on the spot.
        clear: distance to which the path of the middle of the wheelbase is known to be free [m].
        age: time since pose and speed were measured, with the transport to the base [s].
        before: commands that the base may still follow, the newest first.

    Returns:
        ``action`` (`pass`, `slow` or `stop`), the ``command`` that the base may receive, ``brake``,
        ``reason``, and ``where`` on the map the limiting place is (x, y) [m], None without one.
        Values that are not finite are a stop.

    Raises:
        ParameterError: no numbers, or another count of them; a negative age or clear distance.
    """
    numbers = (("speed", speed), ("age", age), ("clear", clear))
    rows = (("pose", pose, 3), ("command", command, 2), *(("before", c, 2) for c in before))
    shapes = [(n, of, (count,)) for n, of, count in rows] + [(n, of, ()) for n, of in numbers]
    for name, values, shape in shapes:
        if np.shape(values) != shape or np.asarray(values).dtype.kind not in "iuf":
            count = math.prod(shape)
            raise ParameterError(name, f"{count} number{'s' * (count > 1)}, got {values!r}")
    for name, value in numbers[1:]:
        if not value >= 0.0:
            raise ParameterError(name, f"at least 0, got {value!r}")
    worst = _models.get(lambda: guard_model(model), model)
    fastest = max((speed, *(c[0] for c in before)), key=abs)
    return decide(
        GuardScene(worst, elevation_map, clear),
        VehicleMotion(Pose2d(*pose), speed),
        BaseCommand(*command),
        hold_time=GuardTiming().stands,
        late=age,
        load=GuardJudgement().load,
        reached=fastest,
        before=tuple(BaseCommand(*c) for c in before),
    )
