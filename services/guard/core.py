"""The guard without transports: its inputs, their ages, and the decision for the base."""

from __future__ import annotations

import math
from collections import Counter, deque
from typing import Any, TypeVar

import numpy as np

from slopewise.models.elevation_map import ElevationMap
from slopewise.services.guard.decide import (
    STILL,
    BaseCommand,
    GuardDecision,
    VehicleMotion,
    decide,
    stop,
)
from slopewise.services.guard.guard_map import map_layers
from slopewise.services.guard.guard_model import GuardModel, GuardScene
from slopewise.services.guard.input_feed import InputFeed
from slopewise.services.guard.overspeed_monitor import OverspeedMonitor
from slopewise.services.guard.pose_jumps import PoseJumps
from slopewise.services.guard.service_parameters import ServiceParameters
from slopewise.services.guard.settings import GuardSettings
from slopewise.services.guard.stop_courses import Pose2d
from slopewise.services.wire.arrival import SenderTable
from slopewise.services.wire.lateness import ARRIVAL, WallClock

_STANDSTILL = 0.05  # speed and yaw rate below which an emergency stop has ended [m/s], [rad/s]

_ROLLING = 0.15
"""Speed from which a vehicle that should hold is moving: above the noise of odometry [m/s]."""

_SAMPLES = 1000  # decisions of which durations and given speeds are stored: 50 s at 20 Hz [1]
_DECEL_SHARE = 0.5  # share of the service deceleration that a base reaches on any slope [1]


_MIN_SPEED, _MIN_YAW_RATE = 0.1, 0.05
"""Speed [m/s] and yaw rate [rad/s] of a base that moves: above the noise of odometry at rest."""

_ROUNDING = 1e-6  # of moments [s]

_MAX_OPERATORS = 1000  # senders of confirmed poses whose numbers are known [1]

T = TypeVar("T")


class PoseAge:
    """Follows the poses of one base; a localisation that fails may repeat one with new stamps."""

    def __init__(self) -> None:
        self._pose: Pose2d | None = None
        self._measured, self._is_frozen = 0.0, False

    def update(self, motion: VehicleMotion, age: float, now: float) -> float:
        """Age of the newest pose [s]; ``age``: that of the message that has it.

        A base that has moved since is not where its pose says, at rest either.
        """
        moves = abs(motion.speed) >= _MIN_SPEED or abs(motion.yaw_rate) >= _MIN_YAW_RATE
        if motion.pose != self._pose or not (moves or self._is_frozen):
            self._pose, self._measured, self._is_frozen = motion.pose, now - age, False
        elif now - age > self._measured + _ROUNDING:
            self._is_frozen = True  # by a newer message with the same pose
        return max(age, now - self._measured)


class Guard:
    """Decides on commands; one thread."""

    def __init__(
        self,
        settings: GuardSettings,
        model: GuardModel,
        ground: ElevationMap | None,
        wall: WallClock | None = None,
    ) -> None:
        """Begin without inputs, so that no command passes; ``wall``: clock of this machine."""
        timing, self.settings = settings.timing, settings
        self.counters: Counter[str] = Counter()
        shared = (wall or WallClock()) if timing.clock == "shared" else None
        ages = self.counters, timing.max_latency, shared, timing.clock != "ignored"
        self.commands: InputFeed[tuple[BaseCommand, int]]
        self.commands = InputFeed("command", timing.command, *ages)
        self.motions: InputFeed[VehicleMotion] = InputFeed("odometry", timing.motion, *ages)
        self.clears: InputFeed[float] = InputFeed("clear distance", timing.clear, *ages)
        self.maps: InputFeed[ElevationMap] = InputFeed("map", timing.map, self.counters)
        if ground is not None:
            map_layers(ground, model.vehicle)  # here rather than in the first decision
            self.maps.take(ground, -0.0)
        rules = settings.judgement
        self.learned = ServiceParameters(model, rules.trust_learned, rules.awaits_parameters)
        self.seconds: deque[float] = deque(maxlen=_SAMPLES)
        self.held_up = 0.0  # by which the map may be older than its arrival here shows [s]
        self.last = ""
        dead = self._dead_time = float(model.tables[0].dead_time.max())
        self._overspeed = OverspeedMonitor(
            dead + timing.motion, _DECEL_SHARE * model.promised.limits.decel, rules.disobedience
        )
        self._pose_age = PoseAge()
        self._jumps = PoseJumps(model, rules.jump, timing.motion)
        self._stood: float | None = None  # stamp of odometry since which it stands after a jump [s]
        self._confirmed = SenderTable[str, int](lambda: -1, _MAX_OPERATORS)  # highest numbers
        self._latched = ""
        self._given: deque[tuple[float, BaseCommand]] = deque(maxlen=_SAMPLES)
        self._speeds: deque[tuple[float, float]] = deque(maxlen=_SAMPLES)  # of odometry [m/s]
        self.learn()

    def learn(self) -> None:
        """Use the parameters in :attr:`learned`."""
        self._model = self.learned.in_use()

    def forget(self, held_up: float) -> None:
        """Discard all inputs but the map: all may be older than they seem by a time [s]."""
        for feed in self._feeds():
            feed.drop()
        self.held_up += held_up

    def clear(
        self,
        distance: float,
        now: float,
        sender: str,
        sequence: int | None,
        time: float | None = None,
    ) -> bool:
        """Record a clear distance from where the vehicle was at its stamp [m]."""
        if not (math.isfinite(distance) and distance >= 0.0):
            self.clears.drop(at=now)
            return False
        return self.clears.take(distance, now, sender, sequence, time)

    def move(
        self,
        motion: VehicleMotion,
        now: float,
        sender: str,
        sequence: int | None,
        time: float | None = None,
    ) -> bool:
        """Record odometry, and whether the base can have moved there."""
        is_new = self.motions.take(motion, now, sender, sequence, time)
        if is_new:
            self._speeds.append((now, motion.speed))
            newest, turning = self.motions.newest, 0.0
            if not motion.yaw_rate:
                since = now - newest.bound(now) - self._dead_time
                turning = max((abs(c.yaw_rate) for c in self._given_since(since)), default=0.0)
            margin = newest.margin if newest.stamps == ARRIVAL else 0.0
            self._jumps.update(motion, now, newest.late, margin, turning)
            if self._jumps.fault and self._jumps.rest_begin in (None, now):
                self._stood = time
        return is_new

    def confirm(
        self, pose: Pose2d, now: float, sender: str, sequence: int | None, time: float | None = None
    ) -> bool:
        """Continue after a jump from the pose that an operator confirms, of a base at rest.

        One that was recorded does not count again: its number is not above the last one of
        its sender, accepted or not, or its stamp is from before that rest.
        """
        objection = ""
        if sequence is not None:
            last = self._confirmed.of(sender)
            if sequence <= last:
                objection = f"its number is {sequence}, expected one above {last}"
            self._confirmed[sender] = max(sequence, last)
        if time is not None and self._stood is not None and time <= self._stood:
            objection = "it is from before the base stood here"
        objection = objection or self.motions.missing(now) or self.motions.conflict(now)
        objection = objection or self._jumps.confirm(pose, now)
        outcome = f"was refused: {objection}" if objection else "is the reference now"
        self.motions.record("confirmed pose", now, f"the pose confirmed by {sender} {outcome}")
        return not objection

    def decision(self, now: float, fault: str = "") -> GuardDecision:
        """Decision for the base; ``fault``: of the process itself, as text."""
        command, number = self.commands.fresh(now) or (None, 0)
        decision = self._decide(now, command, fault)._replace(of=number)
        motion = self.motions.fresh(now)
        if decision.action == "stop" and motion is not None and _moves(motion, _STANDSTILL):
            # An emergency stop ends at rest: it is not interrupted and restarted.
            self._latched = self._latched or decision.reason
        self.counters[decision.action] += 1
        if decision.reason:
            self.last = decision.reason
        self._overspeed.set_limit(abs(decision.command.speed), now)
        self._given.append((now, decision.command))
        return decision

    def _decide(self, now: float, command: BaseCommand | None, fault: str) -> GuardDecision:
        motion, ground = self.motions.fresh(now), self.maps.fresh(now + self.held_up)
        since = self.motions.newest.bound(now)
        # Before any stop: a pose may freeze while the base brakes.
        age = since if motion is None else self._pose_age.update(motion, since, now)
        reasons = self.motions.missing(now), self.maps.missing(now + self.held_up)
        missing = [reason for reason in (*reasons, self.commands.missing(now)) if reason]
        missing += [self.learned.waits] if self.learned.waits else []
        if fault or missing or motion is None or command is None or ground is None:
            return stop(fault or missing[0])
        if wrong := self.motions.conflict(now) or self._jumps.fault:
            return stop(wrong)
        if self._latched:
            if _moves(motion, _STANDSTILL):
                return stop(self._latched)
            self._latched = ""
        timing = self.settings.timing
        if (unchanged := age - since) > timing.motion:
            return stop(f"the base moves, and its pose has not changed for {unchanged:.2f} s")
        late = age + timing.transport
        reached = self._reached(now - late, motion)
        distance = self._clear_now(now, since, motion)
        if distance is None:
            return stop(self.clears.missing(now))
        if excess := self._overspeed.overspeed(abs(motion.speed), now):
            self.counters["disobeyed"] += 1
            return stop(f"the base is {excess:.1f} m/s faster than commanded")
        decision = decide(
            GuardScene(self._model, ground, distance),
            motion,
            command,
            hold_time=timing.stands,
            late=late,
            load=self.settings.judgement.load,
            reached=reached,
            before=self._given_since(now - late - self._dead_time),
        )
        if decision.command == STILL and abs(motion.speed) < _ROLLING:
            decision = decision._replace(brake=True)  # commands cannot hold better than that
        return decision

    def _reached(self, since: float, motion: VehicleMotion) -> float:
        """Speed that the vehicle may have by now: the largest given since then [m/s]."""
        return max((motion.speed, *(c.speed for c in self._given_since(since))), key=abs)

    def _given_since(self, since: float) -> tuple[BaseCommand, ...]:
        """Commands since then; the last one given before that was in force as well."""
        return _values_since(self._given, since)

    def _clear_now(self, now: float, since: float, motion: VehicleMotion) -> float | None:
        """Rest of the clear distance [m]; None where one is required and none is fresh.

        From the position measured ``since`` a time [s]: what was driven from then on is part of
        every stop, what was driven before is at most that time at the highest speed.
        """
        clear = self.clears.fresh(now)
        if clear is None:
            # One that arrives late, or cannot be used, shows that there is a bound.
            is_required = self.settings.judgement.awaits_clear or self.clears.is_arriving(now)
            return None if is_required else math.inf
        bound = self.clears.newest.bound(now)
        given = abs(self._reached(now - bound - self._dead_time, motion))
        # A vehicle that slows down was faster before, also than its commands since.
        measured = map(abs, _values_since(self._speeds, now - bound))
        driven = max((given, *measured)) * max(bound - since, 0.0)
        return max(clear - driven - self.settings.judgement.reserve, 0.0)

    def ages(self, now: float) -> dict[str, float]:
        """Age of each input [s], −1 of one that never came."""
        ages = {feed.name: feed.newest.age(now) for feed in self._feeds()}
        ages[self.maps.name] = self.maps.newest.age(now + self.held_up)
        return {name: age if math.isfinite(age) else -1.0 for name, age in ages.items()}

    def stamps(self) -> dict[str, str]:
        """Use of the stamps of each input that came."""
        return {feed.name: feed.newest.stamps for feed in self._feeds() if feed.has_messages}

    def _feeds(self) -> tuple[InputFeed[Any], ...]:
        return self.commands, self.motions, self.clears

    def times(self) -> dict[str, float]:
        """Median and 99th percentile of the duration of a decision [s]."""
        if not self.seconds:
            return {}
        median, late = np.percentile(self.seconds, (50, 99))
        return {"median": float(median), "p99": float(late)}

    def warnings(self, now: float) -> list[str]:
        """Active faults, human-readable."""
        texts = self.learned.warnings()
        for feed in self._feeds():
            texts += feed.warnings(now)
        texts += [text for text in (self.maps.rejection, self._jumps.fault) if text]
        motion = self.motions.fresh(now)
        if self._latched and motion is not None and abs(motion.speed) > _ROLLING:
            texts.append("the vehicle moves while it is commanded to stand")
        return texts


def _values_since(history: deque[tuple[float, T]], since: float) -> tuple[T, ...]:
    """Values since then, the newest first, and the last one before that."""
    recent = []
    for at, value in reversed(history):
        recent.append(value)
        if at <= since:
            break
    return tuple(recent)


def _moves(motion: VehicleMotion, more_than: float) -> bool:
    """Return True if the base drives [m/s] or turns [rad/s] faster than that."""
    return max(abs(motion.speed), abs(motion.yaw_rate)) > more_than
