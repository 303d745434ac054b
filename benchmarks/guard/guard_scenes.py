"""Random drives behind the guard, with the inputs cut at a moment."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from slopewise.models.input_errors import Tracking
from slopewise.models.parameters import Model
from slopewise.services.guard.core import Guard
from slopewise.services.guard.decide import VehicleMotion
from slopewise.services.guard.guard_model import guard_model

from ..common.scene import shipped
from .message_feeds import STAMPS, MessageFeeds, PoseErrors
from .moving_base import MovingBase, gentle, hills, random_base
from .obstacle_world import EDGE, ObstacleWorld, Swerve, draw_swerve, draw_world

KINDS = ("forest", "pivot", "swerve", "slope")
VEHICLES = ("atv", "husky", "ugv", "long")  # shipped ones, the ugv is steered; with a long tail
CONTACT = 0.1  # speed of the body from which an overlap is a collision [m/s]
_STEP = 0.01  # of the simulation [s]
_FRICTION = 0.6  # of locked wheels, in drives on slopes, where the model states none [1]
# Errors that the model states in half of the drives: those of the example in a model file.
_TRACKING = Tracking(cross_track_std=0.08, cross_track_per_curvature=0.1, heading_std=0.035)
_TRACKING = replace(_TRACKING, along_track_std=0.05, latency=0.1, latency_std=0.02)


@dataclass(frozen=True)
class GuardScene:
    """One drive, drawn from a seed."""

    seed: int
    kind: str  # of :data:`KINDS`
    vehicle: str  # of :data:`VEHICLES`
    stamps: str  # of :data:`STAMPS`
    is_tracked: bool  # with the errors of pose and time that its model states


@dataclass(frozen=True)
class GuardedDrive:
    """Outcome of a drive."""

    scene: GuardScene
    contact: float  # speed of the body at the first overlap [m/s], -1 without one
    what: str  # of the obstacle
    min_load: float  # lowest load of axles and sides over their level static one [1]
    grip: float  # largest share of the friction that was used [1]
    distance: float  # driven [m]
    turned: float  # [rad]
    actions: dict[str, int]
    top_speed: float  # [m/s]
    decision_seconds: np.ndarray  # processor time of each decision [s]

    @property
    def fault(self) -> str:
        """Event that must not happen behind the guard, as text; empty if none did."""
        if self.contact > CONTACT:
            return f"{self.what} at {self.contact:.2f} m/s"
        if self.min_load < 0.0:
            return f"a load of {self.min_load:.2f}"
        return f"{self.grip:.2f} of the friction" if self.grip > 1.0 else ""


def scenes(kind: str, count: int, first: int = 0) -> list[GuardScene]:
    """Every vehicle with every kind of stamps; half of the drives with errors of the pose."""
    names = [name for name in VEHICLES if kind != "pivot" or name != "ugv"]

    def scene(seed: int) -> GuardScene:
        stamps = STAMPS[seed // 4 % len(STAMPS)]
        return GuardScene(seed, kind, names[seed % len(names)], stamps, seed // 32 % 2 == 1)

    return [scene(seed) for seed in range(first, first + count)]


@cache
def vehicle_model(name: str, *, is_tracked: bool, has_friction: bool) -> Model:
    """Model of one vehicle; the same object for the same arguments."""
    model = shipped("atv" if name == "long" else name)
    if name == "long":
        vehicle = replace(model.vehicle, wheelbase=1.6, cg_x=0.9, front_overhang=0.2)
        model = replace(model, vehicle=replace(vehicle, rear_overhang=1.2))
    if has_friction and model.braking.sliding_friction is None:
        model = replace(model, braking=replace(model.braking, sliding_friction=_FRICTION))
    return replace(model, tracking=_TRACKING) if is_tracked else model


class _Reckless:
    """A source of commands that knows no obstacles."""

    def __init__(
        self, rng: np.random.Generator, kind: str, model: Model, world: ObstacleWorld
    ) -> None:
        self._kind, self._rng, self._model, self._world = kind, rng, model, world
        self._until, self._command = 0.0, (0.0, 0.0)

    def command(self, now: float, base: MovingBase) -> tuple[float, float]:
        if now >= self._until:
            self._until = now + float(self._rng.uniform(0.2, 2.0))
            self._command = self._draw(base)
        return self._command

    def _draw(self, base: MovingBase) -> tuple[float, float]:
        rng, limits = self._rng, self._model.limits
        if self._kind == "pivot":
            return 0.0, float(rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 3.0))
        speed = limits.speed * float(rng.uniform(0.125, 1.0))
        if rng.random() < 0.1:
            speed = -0.5 * speed
        rate = float(rng.uniform(-1.0, 1.0)) * limits.lateral_accel / abs(speed)
        if rng.random() < 0.7:
            rate = speed * self._to_an_obstacle(base)
        return speed, min(max(rate, -2.0), 2.0)

    def _to_an_obstacle(self, base: MovingBase) -> float:
        """Curvature of an arc that passes an obstacle ahead within a width of the body [1/m]."""
        ahead, left = base.in_body(self._world.x, self._world.y)
        near = np.flatnonzero((ahead > 1.0) & (np.hypot(ahead, left) < 6.0))
        if len(near) == 0:
            return 0.0
        k = int(self._rng.choice(near))
        aim = float(left[k]) + float(self._rng.uniform(-1.0, 1.0)) * base.vehicle.shape.width
        return 2.0 * aim / (float(ahead[k]) ** 2 + aim**2)


class _Drive:
    """One drive in simulated time."""

    def __init__(self, scene: GuardScene) -> None:
        rng = np.random.default_rng((18, scene.seed, KINDS.index(scene.kind)))
        slope = scene.kind == "slope"
        model = vehicle_model(scene.vehicle, is_tracked=scene.is_tracked, has_friction=slope)
        relief = hills(rng) if slope else gentle()
        self.scene = scene
        self.base = random_base(rng, model, relief, (EDGE / 3.0, 2.0 * EDGE / 3.0))
        swerve = draw_swerve(rng, self.base, model, EDGE) if scene.kind == "swerve" else None
        self.world = draw_world(rng, self.base, scene.kind, swerve)
        self.feeds = MessageFeeds(rng, scene.stamps, swerve)
        self._errors = PoseErrors(rng, model.tracking)
        self._source: Swerve | _Reckless = swerve or _Reckless(rng, scene.kind, model, self.world)
        latency = model.tracking or Tracking()
        late = latency.latency + latency.latency_std * float(rng.standard_normal())
        self._transport = float(rng.uniform(0.0, 0.02)) + max(late, 0.0)
        self._clock = [0.0]
        self.guard: Guard = self.feeds.guard(guard_model(model), self.world, self._clock)
        self._sent: deque[tuple[float, float, float, bool]] = deque()
        self.decision_seconds: list[float] = []

    def step(self, k: int) -> None:
        """Messages, decision and motion of one step."""
        now = self._clock[0] = k * _STEP
        if k % 2 == 0:
            pose = self._errors.measured(self.base, 2 * _STEP)
            odometry = VehicleMotion(pose, self.base.speed, self.base.yaw_rate)
            self.feeds.send("motion", odometry, now)
        if k % 5 == 0:
            self.feeds.send("command", self._source.command(now, self.base), now)
        if k % 5 == 2:
            self.feeds.deliver(self.guard, now)
            begun = time.thread_time()
            decision = self.guard.decision(now)
            self.decision_seconds.append(time.thread_time() - begun)
            self._sent.append((now + self._transport, *decision.command, decision.brake))
        while self._sent and self._sent[0][0] <= now:
            self.base.receive(*self._sent.popleft()[1:], now)
        self.base.step(now, _STEP)


def drive(scene: GuardScene, seconds: float = 10.0) -> GuardedDrive:
    """Drive as commanded behind the guard until the feeds are cut and the base is at rest."""
    it = _Drive(scene)
    base, feeds = it.base, it.feeds
    driven, turned, top, contact, what, load, grip = 0.0, 0.0, 0.0, -1.0, "", 1.0, 0.0
    for k in range(round(seconds / _STEP)):
        it.step(k)
        driven, turned = driven + abs(base.speed) * _STEP, turned + abs(base.yaw_rate) * _STEP
        top = max(top, abs(base.speed))
        if scene.kind == "slope":
            load, grip = min(load, base.min_load()), max(grip, base.grip_used())
        if what := it.world.hit(base):
            contact = base.contact_speed()
            break
        if k * _STEP > feeds.cut + 0.5 and base.contact_speed() < 1e-3 and feeds.cuts.any():
            break
    actions = {name: it.guard.counters[name] for name in ("pass", "slow", "stop")}
    spent = np.array(it.decision_seconds)
    return GuardedDrive(scene, contact, what, load, grip, driven, turned, actions, top, spent)
