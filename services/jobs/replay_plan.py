"""A recorded drive through the moving horizon and the guard: what they would have done, and when.

Each cycle sees what a robot has received by then: the newest map, whole, partial or moving with the
vehicle, the newest path of each topic, and the newest odometry with its age.
"""

from __future__ import annotations

import math
import re
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError, ParameterError
from slopewise.models.parameters import Model
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.horizon.answer import CycleAnswer, HorizonSettings, PlanarState
from slopewise.planner.horizon.horizon import Horizon
from slopewise.services.io.bag_drive import (
    RecordedCommand,
    RecordedPose,
    UnusableMessage,
    drive_events,
)
from slopewise.services.io.model_file import find_model, read_model

_SLOWER = 0.1
"""Below the recorded speed by more than that, the vehicle would have been slowed [m/s]: speed that
tracking removes (`speed_error` of the horizon)."""

_TOGETHER = 0.5  # time between two slow-downs up to which they are one [s]

_SPREAD = (0.5, 0.9, 0.99, 1.0)
"""Quantiles of latencies that are reported [1]."""

GuardDecide = Callable[..., Any]
"""A decision as `slopewise.guard_decision`: with `action`, `command.speed` and `reason`."""


@dataclass(frozen=True, slots=True)
class ReplayCycle:
    """One cycle of the horizon and of the guard."""

    time: float  # since the first message [s]
    pose: RecordedPose
    later: float  # recorded speed one period later [m/s], NaN at the end
    status: str
    reason: str
    limit: float  # speed of the horizon after one period [m/s]
    action: str
    guard_reason: str
    guard_limit: float  # commanded by the guard [m/s]
    plan_seconds: float
    guard_seconds: float

    @property
    def slows(self) -> bool:
        """The driver was faster than the planner would have been."""
        return self.later > self.limit + _SLOWER


@dataclass
class ReplayResult:
    """Cycles of a recording, what was received, and what was missing."""

    model: Model
    period: float
    cycles: list[ReplayCycle] = field(default_factory=list)
    received: Counter[str] = field(default_factory=Counter)
    missing: Counter[str] = field(default_factory=Counter)
    driven: float = 0.0


def replay_plan(
    bag: Path,
    model_file: str,
    decide: GuardDecide,
    *,
    topics: Path | None = None,
    speed_up: float = 1.0,
) -> ReplayResult:
    """Replay a recording with a grid map, odometry and paths in one frame; decide: the guard.

    Seconds of the recording pass `speed_up` times as fast. InputError: also where no cycle had all
    that it needs.
    """
    model = read_model(find_model(model_file))
    settings = HorizonSettings()
    horizon = Horizon(model, settings, uncertainty=Uncertainty())
    result = ReplayResult(model, settings.period)
    replay, due, begin = _Replay(horizon, decide), 0.0, time.monotonic()
    for at, event in drive_events(bag, topics):
        result.driven = at
        result.received[replay.take(event)] += 1
        if not isinstance(event, RecordedPose) or at < due:
            continue
        due = at + settings.period - 1e-6
        time.sleep(max(begin + at / speed_up - time.monotonic(), 0.0))
        if missing := replay.missing():
            result.missing[missing] += 1
            continue
        if not result.cycles:
            replay.warm_up(event)
            begin = time.monotonic() - at / speed_up
        result.cycles.append(replay.cycle(at, event))
    if not result.cycles:
        skipped = ", ".join(f"{reason}: {n} cycles" for reason, n in result.missing.items())
        expected = (
            f"expected map, path and odometry at one time, got none ({skipped or 'no odometry'})"
        )
        raise InputError(str(bag), "messages", expected)
    _add_later_speeds(result)
    return result


class _Replay:
    """Newest messages at one moment of the recording."""

    def __init__(self, horizon: Horizon, decide: GuardDecide) -> None:
        self._horizon, self._decide = horizon, decide
        self._map: ElevationMap | None = None
        self._paths: dict[str, CandidatePath] = {}
        self._command: RecordedCommand | None = None

    def take(self, event: object) -> str:
        """Take a message; the kind of it, in the plural."""
        match event:
            case ElevationMap():
                self._map = event
                return "maps"
            case CandidatePath():
                self._paths[event.name] = event
                return "paths"
            case RecordedCommand():
                self._command = event
                return "commands"
            case UnusableMessage():
                # A path that cannot be used replaces the one before it.
                self._paths.pop(event.topic, None)
                return f"unusable: {event.topic}: {event.reason}"
        return "odometry"

    def missing(self) -> str:
        """Reason why nothing can be planned, empty if it can."""
        if self._map is None:
            return "no map yet"
        return "" if self._paths else "no path yet"

    def warm_up(self, pose: RecordedPose) -> None:
        """One cycle that is not measured: a robot has loaded its code before it drives."""
        self.cycle(0.0, pose)
        self._horizon.forget()

    def cycle(self, at: float, pose: RecordedPose) -> ReplayCycle:
        """Horizon and guard on the newest of everything."""
        assert self._map is not None
        state = PlanarState(
            x=pose.x, y=pose.y, heading=pose.heading, speed=pose.speed, age=pose.age
        )
        begin = time.perf_counter()
        answer = self._step(state)
        planned = time.perf_counter()
        command = self._command or RecordedCommand(pose.speed, pose.yaw_rate)
        decision = self._decide(
            self._horizon.model,
            self._map,
            (pose.x, pose.y, pose.heading),
            pose.speed,
            (command.speed, command.yaw_rate),
            age=pose.age,
        )
        decided = time.perf_counter()
        limit = 0.0 if answer.command.stop else answer.command.speed
        return ReplayCycle(
            at,
            pose,
            math.nan,
            answer.status.value,
            answer.reason,
            limit,
            decision.action,
            decision.reason,
            decision.command.speed,
            planned - begin,
            decided - planned,
        )

    def _step(self, state: PlanarState) -> CycleAnswer:
        assert self._map is not None
        paths = list(self._paths.values())
        while True:
            try:
                return self._horizon.step(state, paths, self._map)
            except ParameterError as error:
                # A candidate that cannot be resampled is one less.
                name = error.field.partition(".")[0]
                left = [path for path in paths if path.name != name]
                if len(left) == len(paths):
                    raise
                paths = left


def _add_later_speeds(result: ReplayResult) -> None:
    """The recorded speed of each cycle one period later, before the horizon's command is due."""
    times = np.array([cycle.time for cycle in result.cycles])
    speeds = np.array([cycle.pose.speed for cycle in result.cycles])
    later = np.interp(times + result.period, times, speeds, right=np.nan)
    result.cycles[:] = [
        replace(cycle, later=float(speed))
        for cycle, speed in zip(result.cycles, later, strict=True)
    ]


def cause(reason: str) -> str:
    """A reason without its numbers, so that equal causes are one."""
    return re.sub(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", "…", reason)


def spread(seconds: list[float]) -> dict[str, float]:
    """Quantiles of durations: name -> value [s]."""
    values = np.quantile(seconds, _SPREAD)
    names = ("median", "p90", "p99", "max")
    return dict(zip(names, map(float, values), strict=True))


def slowed_stretches(cycles: list[ReplayCycle]) -> list[list[ReplayCycle]]:
    """Cycles in which the driver would have been slowed, by stretch."""
    stretches: list[list[ReplayCycle]] = []
    for cycle in cycles:
        if not cycle.slows:
            continue
        if not stretches or cycle.time - stretches[-1][-1].time > _TOGETHER:
            stretches.append([])
        stretches[-1].append(cycle)
    return stretches
