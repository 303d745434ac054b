"""The robot: its estimate of its motion, pure pursuit, and a PI law on thrust and brakes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slopewise.models.quantity import GRAVITY

from .course import Route
from .quad import QUAD
from .world import TICK, DrivenWorld

_ODOMETRY_NOISE = 0.05  # [m/s] of one reading
_ODOMETRY_SCALE = 0.004  # one standard deviation of a drive's scale error
_ACCELEROMETER_NOISE = 0.3  # [m/s²]
_CORRECTION_TIME = 0.10  # [s] in which odometry corrects the integrated acceleration
_POSITION_NOISE = 0.02  # [m] random walk, one standard deviation
_POSITION_TIME = 2.0  # [s] its time constant
_PITCH_NOISE = 0.003  # [rad]
_PITCH_MOUNT = 0.01  # [rad] one standard deviation of the mount offset


@dataclass(frozen=True, slots=True)
class EstimatedState:
    """The robot's estimate."""

    time: float  # [s]
    x: float  # x, y, yaw: pose of the middle of the wheelbase [m], [rad]
    y: float
    yaw: float
    speed: float  # [m/s]
    pitch: float  # pitch of the body with dive and mount offset, nose down positive [rad]


class Sensors:
    """Estimator, called at every tick; exact without a generator."""

    def __init__(self, world: DrivenWorld, rng: np.random.Generator | None) -> None:
        self._world, self._rng = world, rng
        self._speed = self._last = world.speed
        self._wander = np.zeros(2)
        self._scale = 1.0 if rng is None else 1.0 + _ODOMETRY_SCALE * rng.standard_normal()
        self._mount = 0.0 if rng is None else _PITCH_MOUNT * rng.standard_normal()

    def read(self) -> EstimatedState:
        """Return the estimate; called once every tick."""
        world, rng = self._world, self._rng
        x, y, yaw = world.pose
        if rng is None:
            return EstimatedState(world.time, x, y, yaw, world.speed, world.pitch)
        speed = world.speed
        forward = (speed - self._last) / TICK + _ACCELEROMETER_NOISE * rng.standard_normal()
        self._last = speed
        seen = speed * self._scale + _ODOMETRY_NOISE * rng.standard_normal()
        self._speed += forward * TICK
        self._speed += (seen - self._speed) * TICK / _CORRECTION_TIME
        keep = np.exp(-TICK / _POSITION_TIME)
        self._wander *= keep
        self._wander += _POSITION_NOISE * np.sqrt(1.0 - keep**2) * rng.standard_normal(2)
        pitch = world.pitch + self._mount + _PITCH_NOISE * rng.standard_normal()
        x, y = x + self._wander[0], y + self._wander[1]
        return EstimatedState(world.time, x, y, yaw, self._speed, pitch)


_AHEAD, _AHEAD_TIME = 1.0, 0.35  # [m], [s] preview of the pursuit
_GAIN, _RESET = 3.0, 1.5  # [1/s], [1/s²]
_MAX_WINDUP = 1.0  # [m/s²] of the integrator
_STANDSTILL_SPEED, _BREAKAWAY = 0.05, 0.5  # [m/s], [m/s³] added while it should move and stands
_ROLLING = 0.05  # resistance over the weight, fed forward [1]
_BRAKE = 0.45  # approximate force of full brakes over the weight [1]
_SERVICE_BRAKE = 0.99  # application below the emergency stop [1]


@dataclass(frozen=True, slots=True)
class DriveCommand:
    """Command of a policy."""

    speed: float = 0.0  # now [m/s]
    accel: float = 0.0  # from now on [m/s²]
    stop: bool = False  # full braking until standstill, at any speed


class Tracker:
    """Follows a route at a commanded speed."""

    def __init__(self, route: Route) -> None:
        self._route = route
        self._windup = 0.0

    def actuate(
        self, state: EstimatedState, at: float, command: DriveCommand, since: float, holding: bool
    ) -> tuple[float, float, float]:
        """Thrust [N], brake application 0 … 1, curvature [1/m] at a station, ``since`` a command.

        The speed is held while brake pressure still builds up after the command of a stop.
        """
        curvature = self._pursue(state, at)
        if command.stop and not holding:
            self._windup = 0.0
            return 0.0, 1.0, curvature
        target = max(command.speed + command.accel * since, 0.0)
        error = target - state.speed
        resting = target < 0.02 and command.accel <= 0.0
        windup = self._windup + _RESET * error * TICK
        if abs(state.speed) < _STANDSTILL_SPEED and not resting:
            windup += _BREAKAWAY * TICK
        self._windup = min(max(windup, -_MAX_WINDUP), _MAX_WINDUP)
        accel = command.accel + _GAIN * error + self._windup
        share = accel / GRAVITY - math.sin(state.pitch) + (0.0 if resting else _ROLLING)
        if command.stop:
            return max(share, 0.0) * QUAD.mass * GRAVITY, 1.0, curvature
        if resting:
            self._windup = 0.0
            return 0.0, _SERVICE_BRAKE, curvature
        if share >= 0.0:
            return share * QUAD.mass * GRAVITY, 0.0, curvature
        return 0.0, min(-share / _BRAKE, _SERVICE_BRAKE), curvature

    def _pursue(self, state: EstimatedState, station: float) -> float:
        ahead = _AHEAD + _AHEAD_TIME * max(state.speed, 0.0)
        route, target = self._route, min(station + ahead, self._route.length)
        dx = route.at(target, route.x) - state.x
        dy = route.at(target, route.y) - state.y
        lateral = -math.sin(state.yaw) * dx + math.cos(state.yaw) * dy
        return float(2.0 * lateral / max(dx * dx + dy * dy, 0.1))
