"""The guard without wires: what it heard, how old that is, and what the base is told now."""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from slopewise.services.guard.decide import (
    STILL,
    BaseCommand,
    GuardDecision,
    GuardScene,
    VehicleMotion,
    decide,
    stop,
)
from slopewise.services.guard.feed import Feed
from slopewise.services.guard.ground import GuardGround
from slopewise.services.guard.learned import Learned
from slopewise.services.guard.model_reader import GuardModel
from slopewise.services.guard.obedience import Obedience
from slopewise.services.guard.settings import GuardSettings
from slopewise.services.wire.lateness import WallClock

_STANDS = 0.05  # [m/s]
_ROLLS = 0.15  # [m/s]
_TIMES = 1000


@dataclass(frozen=True, slots=True)
class BaseWord:
    """What the base is told; ``of``: number of the command it answers, 0 of none."""

    decision: GuardDecision
    of: int


@dataclass(frozen=True, slots=True)
class _Clear:
    """A clear distance [m], and the newest motion on its arrival, which was ``age`` old [s]."""

    distance: float
    motion: VehicleMotion | None
    age: float


class Guard:
    """Judges commands; one thread."""

    def __init__(
        self,
        settings: GuardSettings,
        model: GuardModel,
        ground: GuardGround | None,
        wall: WallClock | None = None,
    ) -> None:
        """Nothing heard yet, so nothing may move; ``wall``: the clock here, by default its own."""
        timing, self.settings = settings.timing, settings
        self.counters: Counter[str] = Counter()
        shared = (wall or WallClock()) if timing.clock == "shared" else None
        ages = self.counters, timing.max_latency, shared, timing.clock != "ignored"
        self.commands: Feed[tuple[BaseCommand, int]] = Feed("command", timing.command, *ages)
        self.motions: Feed[VehicleMotion] = Feed("odometry", timing.motion, *ages)
        self.clears: Feed[_Clear] = Feed("clear distance", timing.clear, *ages)
        self.maps: Feed[GuardGround] = Feed("map", timing.map, self.counters)
        if ground is not None:
            self.maps.take(ground, -0.0)
        self.learned = Learned(model, settings.judgement.trust_learned)
        self.seconds: deque[float] = deque(maxlen=_TIMES)
        self.last = ""
        decel = 0.5 * model.decel
        dead = max(s.dead_time for s in model.surfaces.values())
        spare = settings.judgement.disobedience
        self._obedience = Obedience(dead + timing.motion, decel, spare)
        self._latched = ""
        self._given: deque[tuple[float, float]] = deque(maxlen=_TIMES)
        self.learn()

    def learn(self) -> None:
        """Parameters changed."""
        self._tables, self._model = self.learned.tables(), self.learned.limited()

    def forget(self) -> None:
        """What was heard so far may be older than it seems."""
        for feed in self._feeds():
            feed.drop()

    def clear(
        self,
        distance: float,
        now: float,
        sender: str,
        sequence: int | None,
        time: float | None = None,
    ) -> bool:
        """How far the way is known free from where the vehicle was at its stamp [m]."""
        if not (math.isfinite(distance) and distance >= 0.0):
            self.clears.drop(at=now)
            return False
        told = _Clear(distance, self.motions.fresh(now), self.motions.bound(now))
        return self.clears.take(told, now, sender, sequence, time)

    def word(self, now: float, broken: str = "") -> BaseWord:
        """What the base is told now.

        Args:
            now: monotonic clock [s]. broken: what is wrong with the process itself, in words.
        """
        decision, of = self._judge(now, broken)
        motion = self.motions.fresh(now)
        if decision.action == "stop" and motion is not None and abs(motion.speed) > _STANDS:
            # What began as an emergency ends at rest: no stop is broken off and begun anew.
            self._latched = self._latched or decision.reason
        self.counters[decision.action] += 1
        if decision.reason:
            self.last = decision.reason
        self._obedience.told(abs(decision.command.speed), now)
        self._given.append((now, decision.command.speed))
        return BaseWord(decision, of)

    def _judge(self, now: float, broken: str) -> tuple[GuardDecision, int]:
        motion, wanted = self.motions.fresh(now), self.commands.fresh(now)
        of = 0 if wanted is None else wanted[1]
        feeds: tuple[Feed[Any], ...] = (self.motions, self.maps, self.commands)
        missing = [words for feed in feeds if (words := feed.missing(now))]
        ground = self.maps.fresh(now)
        if broken or missing or motion is None or wanted is None or ground is None:
            return stop(broken or missing[0]), of
        if self._latched:
            if abs(motion.speed) > _STANDS:
                return stop(self._latched), of
            self._latched = ""
        late = self.motions.bound(now) + self.settings.timing.transport
        reached = self._reached(now - late, motion)
        distance = self._clear_now(now, motion, reached)
        if distance is None:
            return stop(self.clears.missing(now)), of
        if over := self._obedience.disobeys(abs(motion.speed), now):
            self.counters["disobeyed"] += 1
            return stop(f"the base is {over:.1f} m/s faster than it was told"), of
        scene = GuardScene(self._model, self._tables, ground, distance)
        judgement, timing = self.settings.judgement, self.settings.timing
        decision = decide(
            scene,
            motion,
            wanted[0],
            stands=timing.stands,
            late=late,
            load=judgement.load,
            reached=reached,
        )
        if decision.command == STILL and abs(motion.speed) < _ROLLS:
            decision = decision._replace(brake=True)  # commands can hold no better than that
        return decision, of

    def _reached(self, since: float, motion: VehicleMotion) -> float:
        """Speed that the vehicle may have by now, the largest it was given since then [m/s].

        What was given last before that was in force as well.
        """
        while len(self._given) > 1 and self._given[1][0] <= since:
            self._given.popleft()
        return max((motion.speed, *(speed for _, speed in self._given)), key=abs)

    def _clear_now(self, now: float, motion: VehicleMotion, reached: float) -> float | None:
        """What is left of the clear distance [m]; None where one is awaited and none is there.

        Seen from the measured place: what is driven since then is part of every stop.
        """
        told = self.clears.fresh(now)
        if told is None:
            # One that arrives late, or cannot be used, says that there is a bound.
            is_awaited = self.settings.judgement.awaits_clear or self.clears.is_arriving(now)
            return None if is_awaited else math.inf
        if told.motion is None:
            gone = abs(reached) * self.clears.bound(now)
        else:
            gone = math.dist(told.motion.pose[:2], motion.pose[:2])
            # The distance was measured that much earlier than the place it is counted from.
            speed = max(abs(reached), abs(told.motion.speed))
            gone += speed * max(self.clears.newest.late + self.clears.newest.margin - told.age, 0.0)
        return max(told.distance - gone - self.settings.judgement.reserve, 0.0)

    def ages(self, now: float) -> dict[str, float]:
        """Of what is heard [s], −1 of what never came."""
        aged = {feed.name: feed.age(now) for feed in (*self._feeds(), self.maps)}
        return {name: age if math.isfinite(age) else -1.0 for name, age in aged.items()}

    def stamps(self) -> dict[str, str]:
        """What the stamps of each kind of message show; a kind that never came is not in it."""
        return {feed.name: feed.newest.stamps for feed in self._feeds() if feed.has_messages}

    def _feeds(self) -> tuple[Feed[Any], ...]:
        return self.commands, self.motions, self.clears

    def times(self) -> dict[str, float]:
        """Median and 99th percentile of what a command took [s]."""
        if not self.seconds:
            return {}
        median, late = np.percentile(self.seconds, (50, 99))
        return {"median": float(median), "p99": float(late)}

    def flags(self, now: float) -> list[str]:
        """What is not as it should be."""
        found = [*self.learned.flags(), *(f for feed in self._feeds() for f in feed.flags(now))]
        found += [self.maps.refused] if self.maps.refused else []
        motion = self.motions.fresh(now)
        if self._latched and motion is not None and abs(motion.speed) > _ROLLS:
            found.append("the vehicle moves while it is told to stand")
        return found
