"""Decision on one command: pass it, limit it, or stop.

A command passes if the vehicle, at the higher of its speed and the commanded one, can still stop
after the command was in force for its hold time: on known ground, before the clear distance, with
enough load on every axle and side. Otherwise it is limited to the highest speed from which this
holds; where the vehicle could not stop from the speed at which it moves now, the brakes are applied
immediately.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.elevation_map import ElevationMap
from slopewise.services.guard.command_arc import CommandArc, Pose2d, arc_ahead
from slopewise.services.guard.guard_map import heights_at
from slopewise.services.guard.guard_model import GuardModel
from slopewise.services.guard.stop_distances import StopOutcomes, Tables, stops_along

_SPEEDS = 10
"""Speeds that are tried up to the highest: a limited command is within a tenth of the best [1]."""

_STANDSTILL = 0.05
"""Speed below which a vehicle stands [m/s], and yaw rate below which it does not turn [rad/s]."""

_MAX_CURVATURE = 20.0
"""Curvature of the tightest arc: within 5 cm a vehicle turns on the spot [1/m]."""

_MAX_LENGTH = 80.0  # length of the longest arc: longer than the stop of any vehicle at 15 m/s [m]

_SLOW_SHARE, _MIN_SLOW = 0.5, 0.05
"""Share of the weakest level force that slopes leave, and the lowest, for the length [1]."""

_SPARE_LENGTH, _PAST_CLEAR = 2.0, 1.0
"""Length of an arc beyond the stop, and beyond the clear distance [m]."""

_TOLERANCE = 1e-9  # speed by which a command may exceed the allowed one: rounding [m/s]


class VehicleMotion(NamedTuple):
    """Pose, and speed along it, forward positive [m/s]."""

    pose: Pose2d
    speed: float


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


STILL = BaseCommand(0.0, 0.0)  # command of a stopped base [m/s, rad/s]


class GuardScene(NamedTuple):
    """Vehicle and ground."""

    model: GuardModel  # worst case of the vehicle
    tables: Tables  # its surfaces, the first table by the model file
    ground: ElevationMap  # map
    # distance to which the path of the middle of the wheelbase is known to be free [m]
    clear: float


def stop(reason: str) -> GuardDecision:
    """Brake, and hold."""
    return GuardDecision("stop", STILL, True, reason)


def decide(
    scene: GuardScene,
    motion: VehicleMotion,
    command: BaseCommand,
    *,
    hold_time: float,
    late: float,
    load: float,
    reached: float = 0.0,
) -> GuardDecision:
    """Decide on one command.

    ``hold_time``: time for which the command may stay in force [s]; ``late``: age of the motion,
    and transport time of a decision to the base [s]; ``load``: share of ``min_load`` that is kept
    in every stop [1]; ``reached``: speed to which the vehicle may have accelerated since the motion
    [m/s].
    """
    if not all(map(math.isfinite, (*motion.pose, motion.speed, *command))):
        return stop("command or odometry contains a value that is not finite")
    fastest = max(motion.speed, reached, key=abs)
    requested, moving = abs(command.speed), abs(fastest)
    if moving < _STANDSTILL and requested < _STANDSTILL:
        if abs(command.yaw_rate) < _STANDSTILL:
            return GuardDecision("pass", STILL, True, "")
        return _turn_on_the_spot(scene, motion, command)
    forward = command.speed >= 0.0 if moving < _STANDSTILL else fastest >= 0.0
    reverses = min(moving, requested) >= _STANDSTILL and (command.speed >= 0.0) != forward
    # Driving the other way is decided once the vehicle stands.
    top = moving if reverses else max(moving, requested)
    arc = _arc(scene, motion, command, top, hold_time + late, forward=forward)
    end = min(scene.clear, max(arc.end - 1, 0) * arc.step if arc.reason else math.inf)
    speeds = np.append(top * np.arange(1, _SPEEDS) / _SPEEDS, (top, moving))
    held = np.append(np.full(_SPEEDS, hold_time + late), late)
    min_load = load * scene.model.min_load
    stops = stops_along(scene.model, scene.tables, arc, speeds, held, min_load)
    inside = stops.distance <= end
    fine = (inside & stops.loaded & stops.cornering)[:-1]
    failed = _SPEEDS if fine.all() else int(np.argmin(fine))
    allowed = min(float(speeds[failed - 1]) if failed else 0.0, _speed_cap(scene, arc))
    if moving >= _STANDSTILL and not inside[-1]:
        return stop(_end_reason(arc, scene.clear, end))
    reason = "" if fine.all() else _stop_reason(stops, failed, arc, scene.clear, end)
    if reverses:
        return GuardDecision("slow", STILL, False, "it has to stand before it drives back")
    return _limited(scene.model, motion, command, allowed, reason)


def _arc(
    scene: GuardScene,
    motion: VehicleMotion,
    command: BaseCommand,
    top: float,
    held: float,
    *,
    forward: bool,
) -> CommandArc:
    """Arc of a command, as far as a stop from the highest speed may reach [m/s], [s]."""
    turn = command.yaw_rate / max(abs(motion.speed), abs(command.speed), _STANDSTILL)
    curvature = min(max(turn if forward else -turn, -_MAX_CURVATURE), _MAX_CURVATURE)
    length = _arc_length(scene, top, held)
    table, ground, pose = scene.tables[0], scene.ground, motion.pose
    return arc_ahead(scene.model, table, ground, pose, curvature, forward=forward, length=length)


def _limited(
    model: GuardModel, motion: VehicleMotion, command: BaseCommand, allowed: float, reason: str
) -> GuardDecision:
    """Command on the same arc, at the allowed speed at most."""
    requested = abs(command.speed)
    given = min(requested, allowed)
    rim = given + 0.5 * abs(command.yaw_rate) * model.vehicle.track_width
    if rim > model.vehicle.max_wheel_speed:
        given *= model.vehicle.max_wheel_speed / rim
        reason = reason or "a wheel would be faster than it can"
    if given >= requested - _TOLERANCE:
        return GuardDecision("pass", command, False, "")
    reason = reason or "faster than the limits of the model"
    if given < _STANDSTILL and abs(motion.speed) < _STANDSTILL:
        return stop(reason)
    share = given / requested
    limited = BaseCommand(share * command.speed, share * command.yaw_rate)
    return GuardDecision("slow", limited, False, reason)


def _arc_length(scene: GuardScene, speed: float, held: float) -> float:
    """Distance within which a stop from a speed ends, where it ends at all [m]."""
    surfaces = scene.model.surfaces.values()
    weakest = min(s.level * (s.b_b + min(s.m_b, 0.0) * speed) for s in surfaces)
    decel = 9.8 * max(_SLOW_SHARE * weakest, _MIN_SLOW)
    dead = max(s.dead_time for s in surfaces)
    reach = speed * (held + dead) + speed * speed / (2.0 * decel) + _SPARE_LENGTH
    return float(min(reach, scene.clear + _PAST_CLEAR, _MAX_LENGTH))


def _speed_cap(scene: GuardScene, arc: CommandArc) -> float:
    """Highest trained speed on the surfaces ahead, and that of the model [m/s]."""
    return float(min(scene.model.speed, scene.tables[0].fastest[arc.possible].min()))


def _end_reason(arc: CommandArc, clear: float, end: float) -> str:
    if not math.isfinite(end):
        return "brakes do not stop the vehicle on this slope"
    return f"{'the clear distance ends' if clear <= end else arc.reason} {end:.2f} m ahead"


def _stop_reason(
    stops: StopOutcomes, failed: int, arc: CommandArc, clear: float, end: float
) -> str:
    if not stops.distance[failed] <= end:
        return _end_reason(arc, clear, end)
    if not stops.loaded[failed]:
        return "an axle or a side would lose its load"
    return "too fast for this turn"


def _turn_on_the_spot(
    scene: GuardScene, motion: VehicleMotion, command: BaseCommand
) -> GuardDecision:
    """Skid steering: ground has to be known as far as the corners reach."""
    vehicle, shape = scene.model.vehicle, scene.model.shape
    reach = np.hypot(max(shape.front, shape.rear), 0.5 * shape.width)
    around = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    x, y = motion.pose.x + reach * np.cos(around), motion.pose.y + reach * np.sin(around)
    if not np.isfinite(heights_at(scene.ground, x, y)).all():
        return stop("ground beside the vehicle is unknown")
    max_rate = 2.0 * vehicle.max_wheel_speed / vehicle.track_width
    rate = min(max(command.yaw_rate, -max_rate), max_rate)
    action = "pass" if rate == command.yaw_rate else "slow"
    return GuardDecision(action, BaseCommand(0.0, rate), False, "")
