"""The robot's estimate of its motion: odometry, localisation and attitude, with their errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
        return EstimatedState(
            world.time, x + self._wander[0], y + self._wander[1], yaw, self._speed, pitch
        )
