"""A base that follows velocity commands and brakes with the model's force; exact kinematics.

It shares no code with the guard. The pose is that of the middle of the wheelbase.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slopewise.models.vehicle import Vehicle

_GRAVITY = 9.80665  # [m/s²]
_MIN_SPEED = 1e-3  # below it a curvature is not defined [m/s]


@dataclass
class MovingBase:
    """State and traits of one base; SI."""

    vehicle: Vehicle
    accel: float  # accel, slowing: following commands [m/s²]
    slowing: float
    response: float  # time constant of the turn [s]
    dead_time: float  # from a stop command to the brakes [s]
    level_force: float  # level_force, force_per_speed: F_b/W on level ground [1], [s/m]
    force_per_speed: float
    straightens_after: float  # time in a stop from which the wheels straighten; inf: never [s]
    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    speed: float = 0.0
    yaw_rate: float = 0.0
    command: tuple[float, float] = (0.0, 0.0)
    braking_since: float | None = None
    onset: tuple[float, float] = (0.0, 0.0)  # speed and curvature when the stop was commanded

    def receive(self, speed: float, yaw_rate: float, brake: bool, now: float) -> None:
        """Take a command over."""
        self.command = speed, yaw_rate
        if not brake:
            self.braking_since = None
        elif self.braking_since is None:
            self.braking_since = now
            self.onset = abs(self.speed), self._curvature()

    def _curvature(self) -> float:
        return self.yaw_rate / self.speed if abs(self.speed) > _MIN_SPEED else math.inf

    def step(self, now: float, seconds: float) -> None:
        """Move for a time."""
        if self.braking_since is None:
            self._follow(seconds)
        else:
            self._brake(now - self.braking_since, seconds)
        turn = self.yaw_rate * seconds
        ahead = 0.0
        if self.vehicle.drive == "ackermann":
            ahead = 0.5 * self.vehicle.wheelbase  # of the rear axle, which moves along the heading
        x, y = (
            self.x - ahead * math.cos(self.heading),
            self.y - ahead * math.sin(self.heading),
        )
        chord = self.speed * seconds * float(np.sinc(0.5 * turn / math.pi))
        x += chord * math.cos(self.heading + 0.5 * turn)
        y += chord * math.sin(self.heading + 0.5 * turn)
        self.heading += turn
        self.x = x + ahead * math.cos(self.heading)
        self.y = y + ahead * math.sin(self.heading)

    def _follow(self, seconds: float) -> None:
        speed, rate = self.command
        grows = abs(speed) > abs(self.speed) and speed * self.speed >= 0.0
        max_change = (self.accel if grows else self.slowing) * seconds
        self.speed += min(max(speed - self.speed, -max_change), max_change)
        share = 1.0 - math.exp(-seconds / self.response)
        if self.vehicle.drive == "ackermann":
            # The steering takes the curvature of the command at any speed.
            target = rate / speed if abs(speed) > _MIN_SPEED else 0.0
            now = self._curvature() if abs(self.speed) > 0.01 else target
            rate = self.speed * (now + share * (target - now))
            self.yaw_rate = rate
        else:
            self.yaw_rate += share * (rate - self.yaw_rate)

    def _brake(self, since: float, seconds: float) -> None:
        speed, curvature = self.onset
        radius = 0.5 * self.vehicle.track_width
        if since >= self.dead_time:
            rim = max(speed, 1.0)
            loss = _GRAVITY * (self.level_force + self.force_per_speed * rim) * seconds
            self.speed = math.copysign(max(abs(self.speed) - loss, 0.0), self.speed)
            if math.isinf(curvature) or abs(curvature) * radius > 1.0:
                slower = max(abs(self.yaw_rate) - loss / radius, 0.0)
                self.yaw_rate = math.copysign(slower, self.yaw_rate)
                return
            self.yaw_rate = self.speed * self._held(since, curvature)
        elif not math.isinf(curvature):
            self.yaw_rate = self.speed * self._held(since, curvature)

    def _held(self, since: float, curvature: float) -> float:
        late = max(since - self.straightens_after, 0.0)
        return curvature * math.exp(-late / self.response)

    def overlaps(self, x: np.ndarray, y: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Which discs the body's rectangle overlaps, (D,)."""
        ahead, left = self.in_body(x, y)
        shape = self.vehicle.shape
        dx = np.maximum(np.maximum(ahead - shape.front, -shape.rear - ahead), 0.0)
        dy = np.maximum(np.abs(left) - 0.5 * shape.width, 0.0)
        overlapped: np.ndarray = np.hypot(dx, dy) < radius
        return overlapped

    def wheels_in(self, x: np.ndarray, y: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """In which discs the middle of a wheel stands, (D,)."""
        ahead, left = self.in_body(x, y)
        dx = np.abs(ahead) - 0.5 * self.vehicle.wheelbase
        dy = np.abs(left) - 0.5 * self.vehicle.track_width
        inside: np.ndarray = np.hypot(dx, dy) < radius
        return inside

    def in_body(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points ahead of and to the left of the middle of the wheelbase [m]."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        east, north = x - self.x, y - self.y
        return east * cos + north * sin, north * cos - east * sin

    def contact_speed(self) -> float:
        """Speed of the fastest point of the body [m/s]."""
        shape = self.vehicle.shape
        corner = math.hypot(max(shape.front, shape.rear), 0.5 * shape.width)
        return abs(self.speed) + corner * abs(self.yaw_rate)
