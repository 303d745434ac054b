"""Drives toward a wall behind the guard in simulated time, with messages that arrive late.

The plant is Newton alone, it shares no code with the guard: a base that follows speed commands, and
brakes after a dead time as the shipped vehicle's numbers promise, or harder.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from slopewise.services.guard.core import Guard
from slopewise.services.guard.decide import BaseCommand
from tests.services.guard.guard_fixtures import CELL, WALL_TIME, ground_with, guard, motion

BOUND = 0.2  # [s] declared longest delay, the default
CONTACT = 0.05  # [m/s] faster than that, contact is a collision
DELAYS = ("constant", "growing", "jitter", "repeated", "step", "step and growth", "loss")
CLOCKS = ("shared", "unknown", "none")
_STEP = 0.005  # [s] of the plant
_FRONT = 0.88  # [m] of the vehicle, ahead of the middle of its wheelbase


@dataclass
class Plant:
    """A base on level ground; SI."""

    speed: float = 0.0
    x: float = 0.0
    accel: float = 1.0
    slowing: float = 1.5
    dead_time: float = 0.3
    strength: float = 1.0
    given: float = 0.0
    braking_since: float | None = None
    onset_speed: float = 0.0

    def receive(self, speed: float, brake: bool, now: float) -> None:
        self.given = speed
        if brake and self.braking_since is None:
            self.braking_since, self.onset_speed = now, self.speed
        self.braking_since = self.braking_since if brake else None

    def step(self, now: float) -> None:
        before = self.speed
        if self.braking_since is not None:
            if now >= self.braking_since + self.dead_time:
                force = self.strength * (0.40 + 0.015 * max(self.onset_speed, 1.0))
                self.speed = max(self.speed - 9.80665 * force * _STEP, 0.0)
        elif self.given > self.speed:
            self.speed = min(self.speed + self.accel * _STEP, self.given)
        else:
            self.speed = max(self.speed - self.slowing * _STEP, self.given)
        self.x += 0.5 * (before + self.speed) * _STEP


@dataclass
class Line:
    """A transport of one kind of message: its delay, and the stamps of its sender."""

    name: str
    delay: Callable[[float, str], float]
    stamp: Callable[[float], float | None]
    frozen_at: float = np.inf
    lost: tuple[float, float] = (np.inf, np.inf)
    sequence: int = 0
    waiting: list[tuple[float, int, Any, float | None]] = field(default_factory=list)
    last: tuple[Any, float | None] | None = None

    def send(self, content: Any, now: float) -> None:
        if self.lost[0] <= now < self.lost[1]:
            return
        self.sequence += 1
        message = (content, self.stamp(now))
        if now >= self.frozen_at and self.last is not None:
            message = self.last
        self.last = message
        heapq.heappush(self.waiting, (now + self.delay(now, self.name), self.sequence, *message))

    def arrived(self, now: float) -> tuple[float, int, Any, float | None] | None:
        """The one that arrived last, as an inbox keeps it."""
        newest = None
        while self.waiting and self.waiting[0][0] <= now:
            newest = heapq.heappop(self.waiting)
        return newest


@dataclass
class Scene:
    """One drive, drawn from a seed. ``by``: `clear` or `map`, what shows the wall.

    ``slows``: the planner brakes at 1 m/s² for a goal 1.5 m before the wall; else it does not.
    """

    seed: int
    clock: str
    kind: str
    no_delay: bool = False
    slows: bool = False
    max_latency: float = BOUND

    def __post_init__(self) -> None:
        rng = self.rng = np.random.default_rng((7, self.seed))
        self.wall = float(rng.uniform(6.0, 16.0))
        self.by = str(rng.choice(["clear", "map"]))
        self.deadline = float(rng.choice([0.2, 0.5, 1.0]))
        self.at = float(rng.uniform(1.0, 4.0))
        max_delay = BOUND
        if self.kind == "constant" and self.clock == "shared":
            max_delay = 2.0 if rng.random() < 0.3 else self.deadline
        self.base, self.base_of_clear = (float(d) for d in rng.uniform(0.0, max_delay, 2))
        self.rate = float(rng.uniform(0.02, 1.0))
        self.spread = float(rng.uniform(0.0, 0.3))
        self.leap = float(rng.choice([-5.0, 5.0]))
        self.local = bool(rng.random() < 0.5)
        if self.no_delay:
            self.base = self.base_of_clear = 0.002

    def delay(self, now: float, name: str) -> float:
        base = self.base_of_clear if name == "clear" else self.base
        grown = self.rate * max(now - self.at, 0.0)
        if self.kind in ("growing", "step and growth"):
            base += grown
        if self.kind == "jitter":
            max_delay = max(BOUND - base, 0.0) if self.clock == "none" else self.spread
            base += float(self.rng.uniform(0.0, max_delay))
        return min(base, BOUND) if name == "command" else base

    def steps(self, now: float) -> float:
        return self.leap if "step" in self.kind and now >= self.at else 0.0

    def wall_clock(self, now: float) -> float:
        return WALL_TIME + now + (self.steps(now) if self.local else 0.0)

    def stamp(self, now: float) -> float | None:
        if self.clock == "none":
            return None
        stamp = WALL_TIME + now + (0.0 if self.local else self.steps(now))
        return stamp if self.clock == "shared" else stamp - (WALL_TIME - 1e7)


@dataclass
class Outcome:
    """Speed at contact [m/s], −1 without contact; what was driven, and what the guard did."""

    contact: float
    distance: float
    moving_time: float
    actions: list[str]
    flags: set[str]


def _guard(scene: Scene, clock: list[float]) -> Guard:
    known = ground_with(0.0)
    if scene.by == "map":
        scene.wall = CELL * round(scene.wall / CELL)
        known = ground_with(1.5, first=80 + round(scene.wall / CELL))
    return guard(
        clock,
        known,
        wall_time=scene.wall_clock,
        command=1.0,
        motion=scene.deadline,
        clear=max(scene.deadline, 0.5),
        clock="shared" if scene.clock == "shared" else "unknown",
        max_latency=scene.max_latency,
        awaits_clear=scene.by == "clear",
    )


def drive(scene: Scene, seconds: float = 14.0) -> Outcome:
    """Drive at full speed toward the wall."""
    rng = scene.rng
    plant = Plant(
        accel=float(rng.uniform(0.8, 2.5)),
        slowing=float(rng.uniform(0.5, 3.0)),
        dead_time=0.3 * float(rng.uniform(0.8, 1.0)),
        strength=float(rng.uniform(1.0, 1.2)),
    )
    clock = [0.0]
    it = _guard(scene, clock)
    lines = {name: Line(name, scene.delay, scene.stamp) for name in ("motion", "clear", "command")}
    if scene.kind == "repeated":
        lines["motion"].frozen_at = scene.at
    if scene.kind == "loss":
        lines["motion"].lost = scene.at, scene.at + float(rng.uniform(0.3, 3.0))
    transport = float(rng.uniform(0.0, 0.02))
    sent: list[tuple[float, float, bool]] = []
    limit = scene.wall if scene.by == "clear" else scene.wall - 0.5 * CELL - _FRONT
    out = Outcome(-1.0, 0.0, 0.0, [], set())
    requested, still = float(rng.uniform(2.0, 4.0)), 0.0
    for k in range(round(seconds / _STEP)):
        now = clock[0] = k * _STEP
        goal = max(limit - 1.5 - plant.x, 0.0) if scene.slows else np.inf
        _send(lines, k, plant, scene.wall, min(requested, float(np.sqrt(2.0 * goal))))
        if k % 10 == 5:
            _bring(it, lines, scene, now)
            decision = it.decision(now)
            out.actions.append(decision.action)
            out.flags.update(it.warnings(now))
            sent.append((now + transport, decision.command.speed, decision.brake))
        while sent and sent[0][0] <= now:
            _, speed, brake = sent.pop(0)
            plant.receive(speed, brake, now)
        plant.step(now)
        out.moving_time += _STEP * (plant.speed > CONTACT)
        if plant.x > limit and out.contact < 0.0:
            out.contact = plant.speed
        still = still + _STEP if plant.speed < 0.01 else 0.0
        if (out.contact >= 0.0 and plant.speed == 0.0) or (still > 2.0 and now > 3.0):
            break
    out.distance = plant.x
    return out


def _send(lines: dict[str, Line], k: int, plant: Plant, wall: float, requested: float) -> None:
    now = k * _STEP
    if k % 4 == 0:
        lines["motion"].send(motion(plant.speed, plant.x), now)
    if k % 10 == 0:
        lines["clear"].send(max(wall - plant.x, 0.0), now)
        lines["command"].send((BaseCommand(requested, 0.0), 1), now)


def _bring(it: Guard, lines: dict[str, Line], scene: Scene, now: float) -> None:
    feeds: dict[str, Callable[..., Any]] = {"motion": it.move, "command": it.commands.take}
    if scene.by == "clear":
        feeds["clear"] = it.clear
    for name, take in feeds.items():
        if (message := lines[name].arrived(now)) is not None:
            at, sequence, content, time = message
            take(content, at, "r", sequence, time)


def scenes(count: int) -> list[Scene]:
    """Drives that must not end in the wall: every clock with every delay that it covers."""
    kinds = [(clock, kind) for clock in CLOCKS for kind in DELAYS]
    seen = [(c, k) for c, k in kinds if c != "none" or k in ("constant", "jitter", "loss")]
    return [Scene(n, *seen[n % len(seen)]) for n in range(count)]
