"""What to do with one command: pass it, slow it, or stop.

A command passes if the vehicle, at the higher of its speed and the one that is wanted, can still
stop after the command has stood for its time: on known ground, before the clear distance, with
enough load on every axle and side. Else it is slowed to the highest speed from which it can; and
where the vehicle as it moves now could hardly stop, the brakes are called at once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.services.guard.arc import ArcAhead, PlanarPose, arc_ahead
from slopewise.services.guard.ground import GuardGround
from slopewise.services.guard.model_reader import GuardModel
from slopewise.services.guard.plain import plainly_fine
from slopewise.services.guard.stops import StopOutcomes, Tables, stops_along

_SPEEDS = 10
_CREEP = 0.05  # [m/s] below which a vehicle counts as standing
_TIGHTEST = 20.0  # [1/m]
_FARTHEST = 80.0  # [m]


class VehicleMotion(NamedTuple):
    """Where the vehicle is and how fast [m/s], forward positive."""

    pose: PlanarPose
    speed: float


class BaseCommand(NamedTuple):
    """What is wanted of the base: speed [m/s], yaw rate [rad/s]."""

    speed: float
    yaw_rate: float


class GuardDecision(NamedTuple):
    """What the base is told.

    Attributes:
        action: `pass`, `slow` or `stop`. command: for the base. brake: as hard as it can, and hold.
        reason: in words, "" where it passes. allowed: highest speed from which it stops [m/s].
    """

    action: str
    command: BaseCommand
    brake: bool
    reason: str
    allowed: float


STILL = BaseCommand(0.0, 0.0)


class GuardScene(NamedTuple):
    """What a decision is made from.

    Attributes:
        model, tables: vehicle, and its surfaces as rows, the first table that of the model file.
        ground: map. clear: how far the way ahead is known free for the middle of the wheelbase [m].
    """

    model: GuardModel
    tables: Tables
    ground: GuardGround
    clear: float


def stop(reason: str, allowed: float = 0.0) -> GuardDecision:
    """Brake, and hold."""
    return GuardDecision("stop", STILL, True, reason, allowed)


def decide(
    scene: GuardScene,
    motion: VehicleMotion,
    command: BaseCommand,
    *,
    stands: float,
    late: float,
    load: float,
    reached: float = 0.0,
) -> GuardDecision:
    """Judge one command.

    Args:
        scene: vehicle and ground. motion: now. command: of whoever plans.
        stands: how long the command may hold until the next, or until somebody stops [s].
        late: age of the motion, and transport time of a word to the base [s].
        load: share of ``min_load`` that is kept in every stop.
        reached: speed to which the vehicle may have accelerated meanwhile [m/s].
    """
    model = scene.model
    if not all(map(math.isfinite, (*motion.pose, motion.speed, *command))):
        return stop("a number in command or motion is none")
    fastest = max(motion.speed, reached, key=abs)
    now, wanted, moving = abs(motion.speed), abs(command.speed), abs(fastest)
    if moving < _CREEP and wanted < _CREEP:
        if abs(command.yaw_rate) < _CREEP:
            return GuardDecision("pass", STILL, True, "", 0.0)  # it stands, and is held
        return _turning_on_the_spot(scene, motion, command)
    forward = command.speed >= 0.0 if moving < _CREEP else fastest >= 0.0
    reverses = moving >= _CREEP and wanted >= _CREEP and (command.speed >= 0.0) != forward
    # The way back is judged once the vehicle stands.
    target = 0.0 if reverses else wanted
    turn = command.yaw_rate / max(now, wanted, _CREEP) * (1.0 if forward else -1.0)
    curvature = min(max(turn, -_TIGHTEST), _TIGHTEST)
    top = max(moving, target)
    way = arc_ahead(
        model,
        scene.tables[0],
        scene.ground,
        motion.pose,
        curvature,
        forward=forward,
        length=_look(model, top, stands + late, scene.clear),
    )
    end = min(scene.clear, max(way.ends - 1, 0) * way.step if way.why else np.inf)
    least, span = load * model.min_load, min(end, way.step * (len(way.grade) - 1))
    if plainly_fine(model, scene.tables, way, top, stands + late, least, span):
        allowed, reason = min(top, _capped(scene, way)), ""
    else:
        speeds = np.append(top * np.arange(1, _SPEEDS + 1) / _SPEEDS, moving)
        held = np.append(np.full(_SPEEDS, stands + late), late)
        stops = stops_along(model, scene.tables, way, speeds, held, least)
        inside = stops.distance <= end
        fine = (inside & stops.loaded & stops.cornering)[:-1]
        bad = _SPEEDS if fine.all() else int(np.argmin(fine))
        allowed = min(0.0 if bad == 0 else float(speeds[bad - 1]), _capped(scene, way))
        if moving >= _CREEP and not inside[-1]:
            return stop(_why(way, scene.clear, end), allowed)
        reason = "" if fine.all() else _cause(stops, bad, way, scene.clear, end)
    given = min(target, allowed)
    rim = given + 0.5 * abs(command.yaw_rate) * model.track
    if rim > model.wheel_speed:
        given *= model.wheel_speed / rim
        reason = reason or "a wheel would be faster than it can"
    if reverses:
        return GuardDecision("slow", STILL, False, "it has to stand before it drives back", allowed)
    if given >= wanted - 1e-9:
        return GuardDecision("pass", command, False, "", allowed)
    reason = reason or "faster than the limits of the model"
    if given < _CREEP and now < _CREEP:
        return stop(reason, allowed)
    share = given / wanted
    return GuardDecision(
        "slow", BaseCommand(share * command.speed, share * command.yaw_rate), False, reason, allowed
    )


def _look(model: GuardModel, speed: float, held: float, clear: float) -> float:
    """How far ahead a stop from a speed may end [m]."""
    weakest = min(s.level * (s.b_b + min(s.m_b, 0.0) * speed) for s in model.surfaces.values())
    slow = 9.8 * max(0.5 * weakest, 0.05)
    dead = max(s.dead_time for s in model.surfaces.values())
    reach = speed * (held + dead) + speed * speed / (2.0 * slow) + 2.0
    return float(min(reach, clear + 1.0, _FARTHEST))


def _capped(scene: GuardScene, way: ArcAhead) -> float:
    """Highest trained speed on the surfaces ahead, and that of the model."""
    return float(min(scene.model.speed, *(scene.tables[0][k, 14] for k in way.kinds)))


def _why(way: ArcAhead, clear: float, end: float) -> str:
    if not np.isfinite(end):
        return "brakes do not stop the vehicle on this slope"
    what = "the clear distance ends" if clear <= end else way.why
    return f"{what} {end:.2f} m ahead"


def _cause(stops: StopOutcomes, bad: int, way: ArcAhead, clear: float, end: float) -> str:
    if not stops.distance[bad] <= end:
        return _why(way, clear, end)
    if not stops.loaded[bad]:
        return "an axle or a side would lose its load"
    return "too fast for this turn"


def _turning_on_the_spot(
    scene: GuardScene, motion: VehicleMotion, command: BaseCommand
) -> GuardDecision:
    """Skid steering: the ground under the vehicle has to be known, as far as corners reach."""
    model = scene.model
    reach = np.hypot(max(model.front, model.rear), 0.5 * model.width)
    around = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    x, y = motion.pose.x + reach * np.cos(around), motion.pose.y + reach * np.sin(around)
    if not np.isfinite(scene.ground.heights(x, y)).all():
        return stop("ground beside the vehicle is unknown")
    most = 2.0 * model.wheel_speed / model.track
    rate = float(np.clip(command.yaw_rate, -most, most))
    return GuardDecision(
        "pass" if rate == command.yaw_rate else "slow", BaseCommand(0.0, rate), False, "", 0
    )
