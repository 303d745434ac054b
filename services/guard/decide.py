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

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.quantity import MAX_SPEED
from slopewise.models.recent import Recent
from slopewise.models.typed_arguments import typed_arguments
from slopewise.services.guard.arc_limits import TOO_FAST, arc_limits, point_speed, rim_speed
from slopewise.services.guard.guard_model import GuardModel, GuardScene, guard_model
from slopewise.services.guard.settings import GuardJudgement, GuardTiming  # words: ok, key
from slopewise.services.guard.speed_search import (
    CREEP,
    STANDSTILL,
    TOLERANCE,
    SpeedVerdict,
    try_speeds,
)
from slopewise.services.guard.stop_courses import Course, Pose2d


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


_MIN_CURVATURE_SPEED = 0.3  # from which a yaw rate shows how wheels are steered [m/s]

STILL = BaseCommand(0.0, 0.0)  # command of a stopped base [m/s, rad/s]


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
    given = [*motion.pose, motion.speed, motion.yaw_rate, reached]
    if not all(map(math.isfinite, [*given, *command, *(n for of in before for n in of)])):
        return stop("command or odometry contains a value that is not finite")
    fastest = max(motion.speed, reached, key=abs)
    if abs(fastest) > MAX_SPEED:
        return stop(f"odometry has a speed of {fastest:.3g} m/s, which no vehicle has")
    # As it turns now, its wheels may stay steered after the commands before have expired.
    turns = BaseCommand(max(abs(motion.speed), _MIN_CURVATURE_SPEED), motion.yaw_rate), *before
    share, yaw_share, reason = arc_limits(scene.model, command, abs(fastest), turns)
    command = BaseCommand(share * command.speed, yaw_share * command.yaw_rate)
    requested, moving = abs(command.speed), abs(fastest)
    is_still = moving < STANDSTILL
    if is_still and max(requested, abs(command.yaw_rate)) < STANDSTILL:
        return GuardDecision("pass", STILL, True, "")
    forward = command.speed >= 0.0 if is_still else fastest >= 0.0
    # Driving the other way is decided once the vehicle stands.
    reverses = min(moving, requested) >= STANDSTILL and (command.speed >= 0.0) != forward
    followed = turns if scene.model.vehicle.drive == "ackermann" else before
    courses = _courses(scene.model, moving, command, followed, forward=forward, reverses=reverses)
    late += scene.model.errors.latency
    held = hold_time + late
    verdict = SpeedVerdict(math.inf, False, "", None)
    creep = CREEP / max(point_speed(scene.model, *command), TOLERANCE)
    for course in courses:
        checked = try_speeds(scene, motion.pose, course, held, late, load, creep)
        turn = min(verdict.turn, checked.turn)
        verdict = min(verdict, checked, key=lambda of: (not of.brakes, of.allowed))
        verdict = verdict._replace(turn=turn)
        if verdict.brakes or verdict.allowed == 0.0:
            break  # no other course can make it worse
    if verdict.brakes:
        return stop(verdict.reason, verdict.where)
    if reverses:
        return GuardDecision("slow", STILL, False, "it has to stand before it drives back")
    if reason and min(verdict.allowed, verdict.turn) >= 1.0 - TOLERANCE:
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
    if top < STANDSTILL:
        return [_on_the_spot(model, command, before)]
    courses = [_on_an_arc(model, moving, requested, command, before, forward=forward)]
    rim = rim_speed(model, 0.0, command.yaw_rate)
    if model.vehicle.drive == "skid_steer" and max(moving, STANDSTILL) < min(rim, requested):
        # The base may turn at the commanded rate before it has the commanded speed.
        courses.append(_on_the_spot(model, command, ()))
    return courses


def _on_the_spot(
    model: GuardModel, command: BaseCommand, before: tuple[BaseCommand, ...]
) -> Course:
    radius = 0.5 * model.vehicle.track_width
    rates = [c.yaw_rate for c in before if abs(c.yaw_rate) >= STANDSTILL]
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
    # Turns tighter than the command's are as tight as the limit in turns lets a base be, or as
    # steered wheels are, which keep a curvature however fast it still is: at the tightest, an axle
    # turns around its inner wheel.
    steers = model.vehicle.drive == "ackermann"
    limit = 2.0 / model.vehicle.track_width if steers else model.lateral / top**2
    tightest = max(abs(turn), limit)
    rates = [command.yaw_rate, *(c.yaw_rate for c in before)]
    slower = [min(moving, requested)]
    slower += [abs(c.speed) if steers else max(moving, abs(c.speed)) for c in before]
    other_turns = [
        min(max(rate / max(speed, STANDSTILL), -tightest), tightest)
        for rate, speed in zip(rates, slower, strict=True)
    ]
    factor = max(1.0, 0.5 * model.vehicle.track_width * max(map(abs, (turn, *other_turns))))
    ends = (0.0, turn, *other_turns)
    turns = turn / factor, min(ends) / factor, max(ends) / factor
    return Course(1.0 / factor, *turns, forward, factor * requested, factor * moving)


def _limited(
    model: GuardModel, motion: VehicleMotion, command: BaseCommand, verdict: SpeedVerdict
) -> GuardDecision:
    """Command on the same arc, at the allowed speed and yaw rate at most."""
    share, where = min(verdict.allowed, 1.0), verdict.where
    if min(share, verdict.turn) >= 1.0 - TOLERANCE:
        return GuardDecision("pass", command, False, "")
    reason = verdict.reason or TOO_FAST
    if share * rim_speed(model, *command) < STANDSTILL and abs(motion.speed) < STANDSTILL:
        return stop(reason, where)
    limited = BaseCommand(share * command.speed, min(share, verdict.turn) * command.yaw_rate)
    return GuardDecision("slow", limited, False, reason, where=where)


_models: Recent[GuardModel] = Recent(2)


@typed_arguments
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
        pose: x, y of the middle of the wheelbase [m] and heading on the map, of any number of
            turns [rad]: degrees look like turns.
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
        ParameterError: a negative age or clear distance.
    """
    for name, value in (("age", age), ("clear", clear)):
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
