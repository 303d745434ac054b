"""Odometry and commands on their way to the guard: late, repeated, frozen, by a set clock."""

from __future__ import annotations

import heapq
from dataclasses import replace
from typing import Any

import numpy as np

from slopewise.models.input_errors import Tracking
from slopewise.services.guard.core import Guard
from slopewise.services.guard.decide import BaseCommand
from slopewise.services.guard.guard_model import GuardModel
from slopewise.services.guard.settings import GuardSettings, GuardTiming
from slopewise.services.guard.stop_courses import Pose2d
from slopewise.services.wire.lateness import WallClock

from .moving_base import MovingBase
from .obstacle_world import ObstacleWorld, Swerve

# A frozen message has its old stamp, a frozen pose a new one.
_FAULTS = ("duplicate", "frozen message", "frozen pose")
STAMPS = ("prompt", "late", "clock ahead", "clock back", *_FAULTS, "none")

_LATENCY = 0.2  # longest delay without stamps on a shared clock, as declared [s]
_WALL_TIME = 1.7e9  # [s]
_LEAP = 5.0  # by which a clock is set [s]


class PoseErrors:
    """Errors of the measured pose, normal with the standard deviations of ``[tracking]``."""

    def __init__(self, rng: np.random.Generator, tracking: Tracking | None) -> None:
        """Begin; errors change within 0.1 to 10 s."""
        t = tracking or Tracking()
        self._std = np.array([t.along_track_std, t.cross_track_std, t.heading_std])
        self._rng, self._time = rng, float(np.exp(rng.uniform(np.log(0.1), np.log(10.0))))
        self._now = rng.standard_normal(3)

    def measured(self, base: MovingBase, seconds: float) -> Pose2d:
        """Measured pose after a time."""
        share = float(np.exp(-seconds / self._time))
        self._now = share * self._now + np.sqrt(1.0 - share**2) * self._rng.standard_normal(3)
        along, across, turned = self._std * self._now
        cos, sin = np.cos(base.heading), np.sin(base.heading)
        x, y = float(along * cos - across * sin), float(along * sin + across * cos)
        return Pose2d(base.x + x, base.y + y, base.heading + float(turned))


class MessageFeeds:
    """Transport of both kinds of message, drawn at random."""

    def __init__(self, rng: np.random.Generator, stamps: str, swerve: Swerve | None) -> None:
        """Draw delays, the moment of a fault, and when which feed ends."""
        self._rng, self._stamps = rng, stamps
        is_long = stamps == "late" and rng.random() < 0.6
        self.deadline = float(rng.choice([0.2, 0.5, 1.0])) if is_long else _LATENCY
        longest = 2.0 if is_long and rng.random() < 0.3 else self.deadline
        self._delay = float(rng.uniform(0.0, longest)) if stamps != "prompt" else 0.0
        leap = {"clock ahead": _LEAP, "clock back": -_LEAP}.get(stamps, 0.0)
        # Either the clock of the sender is set, or the one that the guard compares stamps with.
        self._is_here = bool(rng.random() < 0.5)
        self._leap, self._at = leap, float(rng.uniform(1.0, 4.0))
        self.is_shared = stamps in ("prompt", "late") or (leap != 0.0 and self._is_here)
        self.cut = float(rng.uniform(1.5, 7.0))
        self.cuts = rng.choice([True, False], 2) if rng.random() < 0.8 else np.array([True, True])
        if swerve is not None:
            self.cut, self.cuts = swerve.cut, np.array([True, True])
        self._waiting: list[tuple[float, int, int, str, Any, float | None]] = []
        self._count = self._order = 0
        self._frozen: tuple[Any, float | None] | None = None

    def _leaped(self, now: float, *, here: bool) -> float:
        return self._leap if self._is_here == here and now >= self._at else 0.0

    def wall_time(self, now: float) -> float:
        """Clock of the guard's machine [s]."""
        return _WALL_TIME + now + self._leaped(now, here=True)

    def send(self, name: str, value: Any, now: float) -> None:
        """Send a message, unless the feed is cut."""
        if now >= self.cut and self.cuts[("motion", "command").index(name)]:
            return
        stamp = None
        if self._stamps != "none":
            stamp = _WALL_TIME + now + self._leaped(now, here=False)
        if name == "motion" and self._stamps.startswith("frozen"):
            if now >= self._at and self._frozen is not None:
                if self._stamps == "frozen pose":
                    value = value._replace(pose=self._frozen[0].pose)
                else:
                    value, stamp = self._frozen
            self._frozen = value, stamp
        self._count += 1
        delay = self._delay if name == "motion" else min(self._delay, _LATENCY)
        self._put(now + delay, self._count, name, value, stamp)
        if self._stamps == "duplicate" and self._rng.random() < 0.5:
            later = now + delay + float(self._rng.uniform(0.0, 0.3))
            self._put(later, self._count, name, value, stamp)

    def _put(self, at: float, number: int, name: str, value: Any, stamp: float | None) -> None:
        self._order += 1
        heapq.heappush(self._waiting, (at, self._order, number, name, value, stamp))

    def deliver(self, guard: Guard, now: float) -> None:
        """Hand over what has arrived."""
        while self._waiting and self._waiting[0][0] <= now:
            at, _, number, name, value, stamp = heapq.heappop(self._waiting)
            if name == "motion":
                guard.move(value, at, "r", number, stamp)
            else:
                guard.commands.take((BaseCommand(*value), number), at, "p", number, stamp)

    def guard(self, model: GuardModel, world: ObstacleWorld, clock: list[float]) -> Guard:
        """A guard whose settings declare these delays."""
        timing = GuardTiming(max_latency=_LATENCY, motion=self.deadline)
        timing = replace(timing, clock="shared" if self.is_shared else "unknown")
        wall = WallClock(lambda: self.wall_time(clock[0]), lambda: clock[0])
        return Guard(GuardSettings(model="", timing=timing), model, world.ground, wall)
