"""A recorded drive through the moving horizon and the guard: what they would have done, and when.

Each cycle sees what a robot has received by then: the newest map, whole, partial or moving with the
vehicle, the newest path of each topic, and the newest odometry with its age.
"""

from __future__ import annotations

import math
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
from slopewise.planner.horizon.answer import CycleAnswer, HorizonSettings
from slopewise.planner.horizon.horizon import Horizon
from slopewise.services.io.bag_drive import (
    RecordedCommand,
    RecordedPose,
    UnusableMessage,
    drive_events,
)
from slopewise.services.io.model_file import find_model, read_model

_SPEED_TOLERANCE = 0.1
"""A lower limit slows the vehicle only if it is below the recorded speed by more than that [m/s]:
tracking removes smaller errors (`speed_error` of the horizon)."""

_MAX_SILENCE = 1.0
"""Time without odometry after which cycles are only counted [s]: long before, the guard stops.

A replay does not wait longer than that: a step of the recorder's clock may be of decades."""

UNUSABLE = "unusable: "
"""How messages that are not usable are counted: with topic and reason."""

ODOMETRY_OF_ANOTHER_CLOCK = "odometry with stamps of another clock: its age is unknown"
"""How odometry is counted whose age on arrival is taken to be 0."""

GuardDecide = Callable[..., Any]
"""A decision as `slopewise.guard_decision`: with `action`, `command.speed` and `reason`."""


@dataclass(frozen=True, slots=True)
class ReplayCycle:
    """One cycle of the horizon and of the guard."""

    time: float  # since the first message [s]
    pose: RecordedPose
    answer: CycleAnswer
    decision: Any  # of the guard
    plan_seconds: float
    guard_seconds: float
    next_speed: float = math.nan  # recorded one period later [m/s], NaN at the end

    @property
    def limit(self) -> float:
        """Speed of the horizon after one period [m/s]."""
        return 0.0 if self.answer.command.stop else self.answer.command.speed

    @property
    def slows(self) -> bool:
        """True if the driver was faster one period later than the limit."""
        return self.next_speed > self.limit + _SPEED_TOLERANCE


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
    """Replay a recording with grid map, odometry and paths in one frame, `speed_up` times as fast.

    `decide` is the guard. InputError: also where no cycle had map, path and odometry.
    """
    model = read_model(find_model(model_file))
    settings = HorizonSettings()
    result = ReplayResult(model, settings.period)
    replay = _Replay(Horizon(model, settings, uncertainty=Uncertainty()), decide, result, speed_up)
    for at, event in drive_events(bag, topics):
        replay.without_odometry(at)
        result.driven = at
        result.received[replay.take(event)] += 1
        if isinstance(event, RecordedPose):
            replay.with_odometry(at, event)
    if not result.cycles:
        raise InputError(str(bag), "messages", _nothing_planned(result))
    _add_next_speeds(result)
    return result


def _nothing_planned(result: ReplayResult) -> str:
    """The reason that no cycle was planned: what was missing, and the first unusable messages."""
    reasons = [f"{reason}: {n} cycles" for reason, n in result.missing.items()] or ["no odometry"]
    reasons += [kind for kind in result.received if kind.startswith(UNUSABLE)][:3]
    return f"expected map, path and odometry at one time, got none ({'; '.join(reasons)})"


class _Replay:
    """Newest messages at one moment of the recording, and the cycles on them."""

    def __init__(
        self, horizon: Horizon, decide: GuardDecide, result: ReplayResult, speed_up: float
    ) -> None:
        self._horizon, self._decide = horizon, decide
        self._result, self._speed_up = result, speed_up
        self._due, self._begin = 0.0, time.monotonic()
        self._odometry: tuple[float, RecordedPose] | None = None  # the newest, with its arrival
        self._map: ElevationMap | None = None
        self._paths: dict[str, CandidatePath] = {}
        self._command: RecordedCommand | None = None

    def take(self, event: object) -> str:
        """Take a message; returns what it is counted as."""
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
                return f"{UNUSABLE}{event.topic}: {event.reason}"
            case RecordedPose(age_known=False):
                return ODOMETRY_OF_ANOTHER_CLOCK
        return "odometry"

    def with_odometry(self, at: float, pose: RecordedPose) -> None:
        """Odometry that arrives at a time [s]: a cycle on it, if one is due."""
        self._odometry = at, pose
        if at >= self._due:
            self._due = at + self._result.period - 1e-6
            self._cycle_or_missing(at, pose)

    def without_odometry(self, until: float) -> None:
        """The cycles of a robot up to a time [s] since its odometry failed to arrive."""
        period = self._result.period
        while self._odometry is not None and self._due + period < until:
            arrived, pose = self._odometry
            silence, at = self._due - arrived, self._due
            if silence > _MAX_SILENCE:
                cycles = max(math.ceil((until - at) / period) - 1, 1)
                self._result.missing[f"no odometry for {_MAX_SILENCE:g} s"] += cycles
                self._due += cycles * period
                return
            self._due += period
            self._cycle_or_missing(at, replace(pose, age=pose.age + silence))

    def _cycle_or_missing(self, at: float, pose: RecordedPose) -> None:
        """The cycle of a time [s] since the first message, at that time; or what it lacks."""
        self._wait(at)
        result = self._result
        if missing := self.missing():
            result.missing[missing] += 1
            return
        if not result.cycles:
            self.warm_up(pose)
            self._begin = time.monotonic() - at / self._speed_up
        result.cycles.append(self.cycle(at, pose))

    def _wait(self, at: float) -> None:
        """Wait for a time of the recording [s], of a silence as long as cycles continue in it."""
        wait = self._begin + at / self._speed_up - time.monotonic()
        skipped = max(wait - _MAX_SILENCE / self._speed_up, 0.0)
        self._begin -= skipped
        time.sleep(max(wait - skipped, 0.0))

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
        """One cycle of horizon and guard on the newest messages; none may be missing."""
        ground = self._map
        assert ground is not None
        begin = time.perf_counter()
        answer = self._step(pose, ground)
        planned = time.perf_counter()
        command = self._command or RecordedCommand(pose.speed, pose.yaw_rate)
        decision = self._decide(
            self._horizon.model,
            ground,
            (pose.x, pose.y, pose.heading),
            pose.speed,
            (command.speed, command.yaw_rate),
            age=pose.age,
        )
        decided = time.perf_counter()
        return ReplayCycle(at, pose, answer, decision, planned - begin, decided - planned)

    def _step(self, state: RecordedPose, ground: ElevationMap) -> CycleAnswer:
        """A cycle of the horizon without the candidates that cannot be resampled."""
        paths = list(self._paths.values())
        while True:
            try:
                return self._horizon.step(state, paths, ground)
            except ParameterError as error:
                name, count = error.field.partition(".")[0], len(paths)
                paths = [path for path in paths if path.name != name]
                if len(paths) == count:
                    raise


def _add_next_speeds(result: ReplayResult) -> None:
    """Add the recorded speed one period after each cycle, when its limit applies."""
    times = np.array([cycle.time for cycle in result.cycles])
    speeds = np.array([cycle.pose.speed for cycle in result.cycles])
    following = np.interp(times + result.period, times, speeds, right=np.nan)
    result.cycles[:] = [
        replace(cycle, next_speed=speed)
        for cycle, speed in zip(result.cycles, following.tolist(), strict=True)
    ]
