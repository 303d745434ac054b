"""Random scenes behind the guard: forests, pivots and swerves, with the inputs cut at a moment."""

from __future__ import annotations

import heapq
import math
import time
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.services.guard.core import Guard
from slopewise.services.guard.decide import BaseCommand, VehicleMotion
from slopewise.services.guard.guard_model import guard_model
from slopewise.services.guard.settings import GuardSettings, GuardTiming
from slopewise.services.guard.stop_courses import Pose2d
from slopewise.services.wire.lateness import WallClock

from .hard_swerves import Swerve, draw_swerve, obstacle_off_arc, run_without_guard
from .moving_base import MovingBase

KINDS = ("forest", "pivot", "swerve")
STAMPS = ("prompt", "late", "clock step", "repeated", "none")
_HEIGHTS = {"tree": 1.5, "unknown": math.nan, "hole": -0.8}  # of discs on the map [m]
CONTACT = 0.05  # speed of the body from which an overlap is a collision [m/s]

_STEP = 0.01  # of the simulation [s]
_CORRIDOR = 0.3  # free on each side of the run of a swerve that has one obstacle only [m]
_EDGE = 26.0  # of the map [m]
_LATENCY = 0.2  # longest delay without stamps on a shared clock, as declared [s]
_WALL_TIME = 1.7e9  # [s]


@dataclass(frozen=True)
class GuardScene:
    """One drive, drawn from a seed."""

    seed: int
    kind: str  # of :data:`KINDS`
    stamps: str = "prompt"  # of :data:`STAMPS`
    drive: Literal["skid_steer", "ackermann"] = "skid_steer"
    cell: float = 0.1  # of the map [m]


@dataclass(frozen=True)
class GuardedDrive:
    """Outcome of a drive."""

    contact: float  # speed of the body at the first overlap [m/s], -1 without one
    what: str  # of the obstacle
    distance: float  # driven [m]
    turned: float  # [rad]
    actions: dict[str, int]
    top_speed: float  # [m/s]
    decision_seconds: np.ndarray  # processor time of each decision [s]


class _World:
    """Discs on level ground: trees, unknown patches and holes; none where the base stands."""

    def __init__(
        self,
        scene: GuardScene,
        rng: np.random.Generator,
        base: MovingBase,
        swerve: Swerve | None = None,
    ) -> None:
        count = int(rng.integers(20, 100))
        x, y = rng.uniform(1.0, _EDGE - 1.0, (2, count))
        what = rng.choice(["tree", "unknown", "hole"], count, p=(0.7, 0.15, 0.15))
        radius = rng.uniform(np.where(what == "hole", 0.3, 0.08), 0.4)
        if scene.kind == "pivot":
            # Some are where the corners pass.
            near = int(rng.integers(1, 6))
            angle, reach = rng.uniform(0.0, 2.0 * np.pi, near), rng.uniform(0.7, 2.0, near)
            x[:near], y[:near] = base.x + reach * np.cos(angle), base.y + reach * np.sin(angle)
            radius[:near] = np.minimum(radius[:near], 0.3)
        free = ~base.overlaps(x, y, radius + float(rng.uniform(0.02, 0.3)))
        if swerve is not None:
            for state in run_without_guard(base, swerve, brakes=True)[::5]:
                free &= ~state.overlaps(x, y, radius + _CORRIDOR)
            x[0], y[0], radius[0] = obstacle_off_arc(rng, base, swerve)
            what[0], free[0] = "tree", True
        self.x, self.y, self.radius, self.what = x[free], y[free], radius[free], what[free]
        self.ground = ElevationMap(
            elevation=self._heights(scene.cell), resolution=scene.cell, origin=(0.0, 0.0)
        )

    def _heights(self, cell: float) -> np.ndarray:
        north, east = cell * np.indices(2 * (round(_EDGE / cell) + 1,))
        z: np.ndarray = 0.05 * np.sin(0.4 * east) * np.cos(0.3 * north)
        for x, y, radius, what in zip(self.x, self.y, self.radius, self.what, strict=True):
            # Every cell whose square the disc touches.
            dx = np.maximum(np.abs(east - x) - 0.5 * cell, 0.0)
            dy = np.maximum(np.abs(north - y) - 0.5 * cell, 0.0)
            z[np.hypot(dx, dy) <= radius] = _HEIGHTS[str(what)]
        return z

    def hit(self, base: MovingBase) -> str:
        """Obstacle that the body overlaps, or in which a wheel stands."""
        at = self.x, self.y, self.radius
        hit = np.where(self.what == "hole", base.wheels_in(*at), base.overlaps(*at))
        return str(self.what[int(np.argmax(hit))]) if hit.any() else ""


class _Reckless:
    """A source of commands that knows no obstacles."""

    def __init__(
        self,
        scene: GuardScene,
        rng: np.random.Generator,
        model: Model,
        world: _World,
        swerve: Swerve | None,
    ) -> None:
        self._swerve = swerve
        self._kind, self._rng, self._model, self._world = scene.kind, rng, model, world
        self._until, self._command = 0.0, (0.0, 0.0)

    def command(self, now: float, base: MovingBase) -> tuple[float, float]:
        if self._swerve is not None:
            return self._swerve.command(now)
        if now >= self._until:
            self._until = now + float(self._rng.uniform(0.2, 2.0))
            self._command = self._draw(base)
        return self._command

    def _draw(self, base: MovingBase) -> tuple[float, float]:
        rng, lateral = self._rng, self._model.limits.lateral_accel
        if self._kind == "pivot":
            return 0.0, float(rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 3.0))
        speed = float(rng.uniform(0.5, 4.0))
        if rng.random() < 0.1:
            speed = -0.5 * speed
        rate = float(rng.uniform(-1.0, 1.0)) * lateral / abs(speed)
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


def _base(rng: np.random.Generator, model: Model) -> MovingBase:
    """A base that stands in the middle third of the map."""
    braking = model.braking
    return MovingBase(
        vehicle=model.vehicle,
        accel=float(rng.uniform(0.8, 2.5)),
        slowing=float(rng.uniform(0.5, 3.0)),
        response=float(rng.uniform(0.03, 0.15)),
        dead_time=braking.dead_time * float(rng.uniform(0.8, 1.0)),
        level_force=braking.b_b * float(rng.uniform(1.0, 1.2)),
        force_per_speed=braking.m_b,
        straightens_after=float(rng.choice([math.inf, rng.uniform(0.0, braking.dead_time)])),
        x=float(rng.uniform(_EDGE / 3.0, 2.0 * _EDGE / 3.0)),
        y=float(rng.uniform(_EDGE / 3.0, 2.0 * _EDGE / 3.0)),
        heading=float(rng.uniform(-np.pi, np.pi)),
    )


class _Feeds:
    """Odometry and commands on their way to the guard."""

    def __init__(self, scene: GuardScene, rng: np.random.Generator, swerve: Swerve | None) -> None:
        self._stamps = scene.stamps
        longest = 2.0 if scene.stamps == "late" and rng.random() < 0.3 else _LATENCY
        self.delay = float(rng.uniform(0.0, longest)) if scene.stamps != "prompt" else 0.0
        self._leap = float(rng.choice([-5.0, 5.0])) if scene.stamps == "clock step" else 0.0
        self._at = float(rng.uniform(1.0, 4.0))
        self.cut = float(rng.uniform(1.5, 7.0))
        self.cuts = rng.choice([True, False], 2) if rng.random() < 0.8 else np.array([True, True])
        if swerve is not None:
            self.cut, self.cuts = swerve.cut, np.array([True, True])
        self._waiting: list[tuple[float, int, str, Any, float | None]] = []
        self._count = 0
        self._frozen: tuple[Any, float | None] | None = None

    def send(self, name: str, value: Any, now: float) -> None:
        """Send a message, unless the feed is cut."""
        if now >= self.cut and self.cuts[("motion", "command").index(name)]:
            return
        stamp = None
        if self._stamps != "none":
            stamp = _WALL_TIME + now + (self._leap if now >= self._at else 0.0)
        if self._stamps == "repeated" and name == "motion":
            if now >= self._at and self._frozen is not None:
                value, stamp = self._frozen
            self._frozen = value, stamp
        self._count += 1
        delay = self.delay if name == "motion" else min(self.delay, _LATENCY)
        heapq.heappush(self._waiting, (now + delay, self._count, name, value, stamp))

    def deliver(self, guard: Guard, now: float) -> None:
        """Hand over what has arrived."""
        while self._waiting and self._waiting[0][0] <= now:
            at, number, name, value, stamp = heapq.heappop(self._waiting)
            if name == "motion":
                guard.motions.take(value, at, "r", number, stamp)
            else:
                guard.commands.take((BaseCommand(*value), number), at, "p", number, stamp)


def _guard(scene: GuardScene, model: Model, ground: ElevationMap, clock: list[float]) -> Guard:
    is_shared = scene.stamps in ("prompt", "late")
    timing = GuardTiming(clock="shared" if is_shared else "unknown", max_latency=_LATENCY)
    wall = WallClock(lambda: _WALL_TIME + clock[0], lambda: clock[0])
    return Guard(GuardSettings(model="atv", timing=timing), guard_model(model), ground, wall)


def drive(scene: GuardScene, model: Model, seconds: float = 10.0) -> GuardedDrive:
    """Drive as commanded behind the guard until the feeds are cut and the base is at rest."""
    rng = np.random.default_rng((17, scene.seed, KINDS.index(scene.kind)))
    model = replace(model, vehicle=replace(model.vehicle, drive=scene.drive))
    base, clock = _base(rng, model), [0.0]
    swerve = None
    if scene.kind == "swerve":
        swerve = draw_swerve(rng, base, model.limits.lateral_accel, _EDGE)
    world, feeds = _World(scene, rng, base, swerve), _Feeds(scene, rng, swerve)
    source = _Reckless(scene, rng, model, world, swerve)
    guard = _guard(scene, model, world.ground, clock)
    driven, turned, top, contact, what = 0.0, 0.0, 0.0, -1.0, ""
    sent: list[tuple[float, float, float, bool]] = []
    seconds_spent: list[float] = []
    transport = float(rng.uniform(0.0, 0.02))
    for k in range(round(seconds / _STEP)):
        now = clock[0] = k * _STEP
        if k % 2 == 0:
            pose = Pose2d(base.x, base.y, base.heading)
            feeds.send("motion", VehicleMotion(pose, base.speed), now)
        if k % 5 == 0:
            feeds.send("command", source.command(now, base), now)
        if k % 5 == 2:
            feeds.deliver(guard, now)
            begun = time.thread_time()
            decision = guard.decision(now)
            seconds_spent.append(time.thread_time() - begun)
            sent.append((now + transport, *decision.command, decision.brake))
        while sent and sent[0][0] <= now:
            base.receive(*sent.pop(0)[1:], now)
        base.step(now, _STEP)
        driven, turned = driven + abs(base.speed) * _STEP, turned + abs(base.yaw_rate) * _STEP
        top = max(top, abs(base.speed))
        if what := world.hit(base):
            contact = base.contact_speed()
            break
        if now > feeds.cut + 0.5 and base.contact_speed() < 1e-3 and feeds.cuts.any():
            break
    actions = {name: guard.counters[name] for name in ("pass", "slow", "stop")}
    return GuardedDrive(contact, what, driven, turned, actions, top, np.array(seconds_spent))
