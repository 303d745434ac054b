"""Limits that a command keeps on any ground: speed, speed of rims, lateral acceleration."""

from __future__ import annotations

import math
from collections.abc import Sequence

from slopewise.services.guard.guard_model import GuardModel
from slopewise.services.guard.speed_search import STANDSTILL

TOO_FAST = "faster than the limits of the model"
_RIM, _TURN = "a wheel would be faster than it can", "too fast for this turn"

_TINY = 1e-9  # speed, yaw rate or their product that is divided by at least [m/s], [rad/s], [m/s²]


def arc_limits(
    model: GuardModel,
    command: tuple[float, float],
    moving: float,
    turns: Sequence[tuple[float, float]],
) -> tuple[float, float, str]:
    """Shares of the speed and of the yaw rate of a command that are allowed [1], and the reason.

    A command is slower on the same arc. Lateral acceleration is speed times yaw rate, also while a
    base still has another speed or yaw rate than commanded: it turns no faster than a base may
    that is still as fast as ``moving`` [m/s], and drives no faster than one may that still turns
    as in ``turns``: speeds and yaw rates, its own and those of commands before [m/s], [rad/s]. A
    base at rest turns as fast as its wheels can. Steered wheels keep the curvature of a command, so
    that a base that is still faster turns faster than commanded, and one that gains speed, too.
    """
    speed, rate = map(abs, command)
    steers = model.vehicle.drive == "ackermann"
    by_rim = model.vehicle.max_wheel_speed / max(rim_speed(model, *command), _TINY)
    by_speed = model.speed / max(speed, _TINY)
    turning = max(abs(yaw_rate) for _, yaw_rate in turns)
    by_turn = min(
        math.sqrt(model.lateral / max(speed * rate, _TINY)),
        model.lateral / max(speed * turning, _TINY),
    )
    if steers:
        curvature = max(abs(yaw_rate) / max(abs(v), STANDSTILL) for v, yaw_rate in turns)
        curvature = min(curvature, 2.0 / model.vehicle.track_width)
        by_turn = min(by_turn, math.sqrt(model.lateral / max(curvature, _TINY)) / max(speed, _TINY))
    by_moving = model.lateral / max(moving * rate, _TINY)
    share = min(by_rim, by_speed, by_turn, 1.0)
    if steers and moving > max(share * speed, STANDSTILL):
        by_moving *= share * speed / moving
    reasons = (by_rim, _RIM), (by_speed, TOO_FAST), (min(by_turn, by_moving), _TURN)
    lowest, reason = min(reasons)
    return share, min(share, by_moving), reason if lowest < 1.0 else ""


def rim_speed(model: GuardModel, speed: float, yaw_rate: float) -> float:
    """Speed of the fastest wheel [m/s]."""
    return abs(speed) + 0.5 * abs(yaw_rate) * model.vehicle.track_width


def point_speed(model: GuardModel, speed: float, yaw_rate: float) -> float:
    """Speed of the fastest point of the body, at most [m/s]."""
    shape = model.vehicle.shape
    farthest = max(shape.front, shape.rear) + abs(model.turn_axis)
    return abs(speed) + abs(yaw_rate) * math.hypot(farthest, 0.5 * shape.width)
