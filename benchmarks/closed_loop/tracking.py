"""A plain tracking controller: pure pursuit, and speed by a PI law on thrust and brakes."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slopewise.models.quantity import GRAVITY
from slopewise.models.vehicle import Vehicle

from .route import Route
from .sensors import EstimatedState
from .world import TICK

_AHEAD, _AHEAD_TIME = 1.0, 0.35  # [m], [s] look-ahead of the pursuit
_GAIN, _RESET = 3.0, 1.5  # [1/s], [1/s²]
_MOST_WINDUP = 1.0  # [m/s²]
_STANDING, _BREAKAWAY = 0.05, 0.5  # [m/s], [m/s³]
_ROLLING = 0.05  # share of the weight that is fed forward
_BRAKE = 0.45  # force of full brakes as share of the weight, roughly


@dataclass(frozen=True, slots=True)
class DriveCommand:
    """What a policy asks for.

    Attributes:
        speed: now [m/s]; accel: from now on [m/s²].
        stop: full brakes until it stands, whatever else.
        reason: why, for people.
    """

    speed: float = 0.0
    accel: float = 0.0
    stop: bool = False
    reason: str = ""


class Tracker:
    """Follows a route at a commanded speed; knows nothing of planning."""

    def __init__(self, route: Route, vehicle: Vehicle) -> None:
        self._route, self._vehicle = route, vehicle
        self._windup = 0.0

    def actuate(
        self,
        state: EstimatedState,
        station: float,
        command: DriveCommand,
        since: float,
        holding: bool,
    ) -> tuple[float, float, float]:
        """Thrust [N], brake application 0 … 1, curvature [1/m].

        Args:
            state: estimate. station: along the route [m].
            command: of the last cycle, given ``since`` seconds ago.
            holding: a stop was commanded and the brakes do not bite yet: the speed is held.
        """
        curvature = self._pursue(state, station)
        if command.stop and not holding:
            self._windup = 0.0
            return 0.0, 1.0, curvature
        wanted = max(command.speed + command.accel * since, 0.0)
        error = wanted - state.speed
        resting = wanted < 0.02 and command.accel <= 0.0
        windup = self._windup + _RESET * error * TICK
        if abs(state.speed) < _STANDING and not resting:
            # It stands and should not: more thrust until it breaks away.
            windup += _BREAKAWAY * TICK
        self._windup = min(max(windup, -_MOST_WINDUP), _MOST_WINDUP)
        accel = command.accel + _GAIN * error + self._windup
        share = accel / GRAVITY - math.sin(state.pitch) + (0.0 if resting else _ROLLING)
        if command.stop:
            return max(share, 0.0) * self._vehicle.mass * GRAVITY, 1.0, curvature
        if resting:
            self._windup = 0.0
            return 0.0, 0.99, curvature
        if share >= 0.0:
            return share * self._vehicle.mass * GRAVITY, 0.0, curvature
        return 0.0, min(-share / _BRAKE, 0.99), curvature

    def _pursue(self, state: EstimatedState, station: float) -> float:
        ahead = _AHEAD + _AHEAD_TIME * max(state.speed, 0.0)
        route, target = self._route, min(station + ahead, self._route.length)
        dx = route.at(target, route.x) - state.x
        dy = route.at(target, route.y) - state.y
        aside = -math.sin(state.yaw) * dx + math.cos(state.yaw) * dy
        return float(2.0 * aside / max(dx * dx + dy * dy, 0.1))
