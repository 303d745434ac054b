"""A base that follows velocity commands and brakes with the model's force over relief.

It shares no code with the guard: exact arcs, quasi-static loads. Relief is a sum of waves; pose and
slopes are those of the middle of the wheelbase.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from slopewise.models.parameters import Braking, Model
from slopewise.models.vehicle import Vehicle

_GRAVITY = 9.80665  # [m/s²]
_MIN_SPEED = 1e-3  # below it a curvature is not defined [m/s]


@dataclass(frozen=True)
class Relief:
    """Waves a sin(k_x x + k_y y + φ), (W,) each."""

    height: np.ndarray  # a [m]
    east: np.ndarray  # k_x, k_y [rad/m]
    north: np.ndarray
    phase: np.ndarray  # φ [rad]

    def at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Heights at points of any shape [m]."""
        z = np.zeros_like(x)
        for a, p, q, phase in zip(self.height, self.east, self.north, self.phase, strict=True):
            z += a * np.sin(p * x + q * y + phase)
        return z

    def gradient(self, x: float, y: float) -> tuple[float, float]:
        """Rise to the east and to the north at a point [1]."""
        slope = self.height * np.cos(self.east * x + self.north * y + self.phase)
        return float(slope @ self.east), float(slope @ self.north)


def gentle() -> Relief:
    """Waves of 5 cm, with slopes below 2°."""
    return Relief(np.full(2, 0.025), np.full(2, 0.4), np.array([0.3, -0.3]), np.zeros(2))


def hills(rng: np.random.Generator) -> Relief:
    """Waves 8 to 40 m long, of which the steepest ground is 3° to 15°."""
    length, bearing = rng.uniform(8.0, 40.0, 5), rng.uniform(-np.pi, np.pi, 5)
    k, share = 2.0 * np.pi / length, rng.uniform(0.2, 1.0, 5)
    steepest = math.tan(math.radians(float(rng.uniform(3.0, 15.0))))
    # Five waves with random phases are steepest together at about 0.6 of the sum of their slopes.
    height = steepest / 0.6 * share / share.sum() / k
    return Relief(height, k * np.cos(bearing), k * np.sin(bearing), rng.uniform(0.0, 7.0, 5))


@dataclass
class MovingBase:
    """State and traits of one base; SI."""

    vehicle: Vehicle
    braking: Braking
    resistance: float  # motion resistance, which holds a rolling vehicle [1]
    relief: Relief
    accel: float  # accel, slowing: following commands [m/s²]
    slowing: float
    response: float  # time constant of the turn [s]
    lag: float  # time constant of the drive [s]
    dead_time: float  # from a stop command to the brakes [s]
    strength: float  # braking force over that of the model [1]
    coasts: bool  # the drive is cut as soon as a stop is commanded
    straightens_after: float  # time in a stop from which the wheels straighten; inf: never [s]
    speed_bias: float = 0.0  # driven minus commanded [m/s]
    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    speed: float = 0.0
    yaw_rate: float = 0.0
    command: tuple[float, float] = (0.0, 0.0)
    target: float = 0.0  # speed that the drive is set to, after its lag [m/s]
    braking_since: float | None = None
    onset: tuple[float, float] = (0.0, 0.0)  # speed and curvature when the stop was commanded
    deceleration: float = field(default=0.0, init=False)  # of the last step, along the motion

    def receive(self, speed: float, yaw_rate: float, brake: bool, now: float) -> None:
        if abs(speed) > _MIN_SPEED:
            speed += math.copysign(self.speed_bias, speed)
        self.command = speed, yaw_rate
        if not brake:
            self.braking_since = None
        elif self.braking_since is None:
            self.braking_since, self.target = now, 0.0
            self.onset = abs(self.speed), self._curvature()

    def _curvature(self) -> float:
        return self.yaw_rate / self.speed if abs(self.speed) > _MIN_SPEED else math.inf

    def step(self, now: float, seconds: float) -> None:
        before = abs(self.speed)
        if self.braking_since is None:
            self._follow(seconds)
        else:
            self._brake(now - self.braking_since, seconds)
        self.deceleration = (before - abs(self.speed)) / seconds
        turn = self.yaw_rate * seconds
        # The rear axle of an Ackermann vehicle moves along the heading.
        ahead = 0.5 * self.vehicle.wheelbase if self.vehicle.drive == "ackermann" else 0.0
        x, y = self.x - ahead * math.cos(self.heading), self.y - ahead * math.sin(self.heading)
        chord = self.speed * seconds * float(np.sinc(0.5 * turn / math.pi))
        x += chord * math.cos(self.heading + 0.5 * turn)
        y += chord * math.sin(self.heading + 0.5 * turn)
        self.heading += turn
        self.x = x + ahead * math.cos(self.heading)
        self.y = y + ahead * math.sin(self.heading)

    def _follow(self, seconds: float) -> None:
        speed, rate = self.command
        self.target += (speed - self.target) * (1.0 - math.exp(-seconds / self.lag))
        change = self.target - self.speed
        grows = abs(self.target) > abs(self.speed) and self.target * self.speed >= 0.0
        max_change = (self.accel if grows else self.slowing) * seconds
        self.speed += min(max(change, -max_change), max_change)
        share = 1.0 - math.exp(-seconds / self.response)
        if self.vehicle.drive == "ackermann":
            # The steering takes the curvature of the command at any speed.
            target = rate / speed if abs(speed) > _MIN_SPEED else 0.0
            now = self._curvature() if abs(self.speed) > 0.01 else target
            self.yaw_rate = self.speed * (now + share * (target - now))
        else:
            self.yaw_rate += share * (rate - self.yaw_rate)

    def _brake(self, since: float, seconds: float) -> None:
        speed, curvature = self.onset
        radius = 0.5 * self.vehicle.track_width
        pivots = math.isinf(curvature) or abs(curvature) * radius > 1.0
        sine = math.sin(self.slopes()[0])
        if since < self.dead_time:
            gain = max(-sine - self.resistance, 0.0) if self.coasts else 0.0
            if abs(self.speed) > _MIN_SPEED:
                self.speed += math.copysign(_GRAVITY * gain * seconds, self.speed)
            self.onset = max(speed, abs(self.speed)), curvature
            if not math.isinf(curvature):
                self.yaw_rate = self.speed * self._held(since, curvature)
            return
        loss = _GRAVITY * (self._force(speed) + (0.0 if pivots else sine)) * seconds
        self.speed = math.copysign(max(abs(self.speed) - max(loss, 0.0), 0.0), self.speed)
        if pivots:
            slower = max(abs(self.yaw_rate) - loss / radius, 0.0)
            self.yaw_rate = math.copysign(slower, self.yaw_rate)
        else:
            self.yaw_rate = self.speed * self._held(since, curvature)

    def _force(self, onset: float) -> float:
        """F_b/W, at most what friction leaves of it where the model has one [1]."""
        b, v, grade = self.braking, max(onset, self.braking.speed_range[0]), self.slopes()[0]
        force = self.strength * ((b.m_m * v + b.b_m) * grade + b.m_b * v + b.b_b)
        if b.sliding_friction is None:
            return force
        normal, across = self._normal_and_across()
        grip = math.sqrt(max((b.sliding_friction * normal) ** 2 - across**2, 0.0))
        if (front := self.vehicle.brake_share) is not None:
            vehicle, mu = self.vehicle, grip / max(normal, 1e-9)
            rear = (1.0 - front) * vehicle.wheelbase + mu * vehicle.cg_z
            grip = min(grip, grip * (vehicle.wheelbase - vehicle.cg_x) / rear)
        return min(force, grip)

    def _held(self, since: float, curvature: float) -> float:
        return curvature * math.exp(-max(since - self.straightens_after, 0.0) / self.response)

    def slopes(self) -> tuple[float, float]:
        """Grade along the motion and roll, left side up [rad]."""
        sign = math.copysign(1.0, self.speed)
        cos, sin = sign * math.cos(self.heading), sign * math.sin(self.heading)
        east, north = self.relief.gradient(self.x, self.y)
        return math.atan(east * cos + north * sin), math.atan(north * cos - east * sin)

    def _normal_and_across(self) -> tuple[float, float]:
        """Normal and lateral force over weight [1]."""
        grade, roll = self.slopes()
        half, dz = 0.5 * self.vehicle.wheelbase, []
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        for s in (half, -half):
            east, north = self.relief.gradient(self.x + s * cos, self.y + s * sin)
            dz.append(east * cos + north * sin)
        crest = min((dz[0] - dz[1]) / (2.0 * half), 0.0)
        normal = math.cos(grade) * math.cos(roll) + crest * self.speed**2 / _GRAVITY
        lateral = abs(self.speed) * self.yaw_rate
        return normal, math.cos(grade) * math.sin(roll) + lateral / _GRAVITY

    def min_load(self) -> float:
        """Lowest load of axles and sides over their level static one, negative: it tips [1]."""
        v, (grade, _) = self.vehicle, self.slopes()
        normal, across = self._normal_and_across()
        pull = v.cg_z * (self.deceleration / _GRAVITY - math.sin(grade))
        behind, ahead = v.cg_x, v.wheelbase - v.cg_x
        if self.speed < 0.0:
            behind, ahead = ahead, behind
        side = normal - 2.0 * v.cg_z / v.track_width * abs(across)
        return min(normal - pull / ahead, normal + pull / behind, side)

    def grip_used(self) -> float:
        """Share of the friction that is used; above 1 the base slides. 0 where none is known [1].

        While the brakes act it is that of the lateral force: locked wheels are in their law.
        """
        mu, (grade, _) = self.braking.sliding_friction, self.slopes()
        if mu is None:
            return 0.0
        normal, across = self._normal_and_across()
        along = self.deceleration / _GRAVITY - math.sin(grade)
        along = along if self.braking_since is None else 0.0
        return math.hypot(along, across) / max(mu * normal, 1e-9)

    def overlaps(self, x: np.ndarray, y: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Which discs the body's rectangle overlaps, (D,)."""
        ahead, left = self.in_body(x, y)
        shape = self.vehicle.shape
        dx = np.maximum(np.maximum(ahead - shape.front, -shape.rear - ahead), 0.0)
        dy = np.maximum(np.abs(left) - 0.5 * shape.width, 0.0)
        return np.asarray(np.hypot(dx, dy) < radius)

    def wheels_in(self, x: np.ndarray, y: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """In which discs the middle of a wheel stands, (D,)."""
        ahead, left = self.in_body(x, y)
        dx = np.abs(ahead) - 0.5 * self.vehicle.wheelbase
        dy = np.abs(left) - 0.5 * self.vehicle.track_width
        return np.asarray(np.hypot(dx, dy) < radius)

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


def random_base(
    rng: np.random.Generator, model: Model, relief: Relief, place: tuple[float, float]
) -> MovingBase:
    """A base that stands somewhere, as weak or as strong as its model says."""
    braking = model.braking
    accel, slowing, response, lag, share, strength = rng.uniform(
        (0.8, 0.5, 0.03, 0.01, 0.8, 1.0), (2.5, 3.0, 0.15, 0.2, 1.0, 1.2)
    ).tolist()
    follows = (accel, slowing, response, lag, braking.dead_time * share, strength)
    return MovingBase(
        *(model.vehicle, braking, model.terrain.motion_resistance, relief, *follows),
        coasts=bool(rng.random() < 0.5),
        straightens_after=float(rng.choice([math.inf, rng.uniform(0.0, braking.dead_time)])),
        speed_bias=braking.speed_error * float(rng.standard_normal()),
        x=float(rng.uniform(*place)),
        y=float(rng.uniform(*place)),
        heading=float(rng.uniform(-np.pi, np.pi)),
    )
