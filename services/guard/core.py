"""The guard without wires: what it heard, how old that is, and what the base is told now."""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass

import numpy as np

from services.guard.decide import (
    STILL,
    BaseCommand,
    GuardDecision,
    GuardScene,
    VehicleMotion,
    decide,
    stop,
)
from services.guard.feed import Feed
from services.guard.ground import GuardGround
from services.guard.learned import Learned
from services.guard.model_reader import GuardModel
from services.guard.obedience import Obedience
from services.guard.settings import GuardSettings

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
    """A clear distance [m], and where the vehicle was when it was told."""

    distance: float
    motion: VehicleMotion | None


class Guard:
    """Judges commands; one thread."""

    def __init__(
        self, settings: GuardSettings, model: GuardModel, ground: GuardGround | None
    ) -> None:
        """Nothing heard yet, so nothing may move."""
        timing, self.settings = settings.timing, settings
        self.counters: Counter[str] = Counter()
        self.commands: Feed[tuple[BaseCommand, int]] = Feed(
            "command", timing.command, self.counters
        )
        self.motions: Feed[VehicleMotion] = Feed("odometry", timing.motion, self.counters)
        self.clears: Feed[_Clear] = Feed("clear distance", timing.clear, self.counters)
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
        self.learn()

    def learn(self) -> None:
        """Parameters changed."""
        self._tables, self._model = self.learned.tables(), self.learned.limited()

    def forget(self) -> None:
        """What was heard so far may be older than it seems."""
        for feed in (self.commands, self.motions, self.clears):
            feed.drop()

    def clear(self, distance: float, now: float, sender: str, sequence: int | None) -> bool:
        """How far the way is known free from where the vehicle is now [m]."""
        if not (math.isfinite(distance) and distance >= 0.0):
            self.clears.drop()
            return False
        told = _Clear(distance, self.motions.fresh(now))
        return self.clears.take(told, now, sender, sequence)

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
        return BaseWord(decision, of)

    def _judge(self, now: float, broken: str) -> tuple[GuardDecision, int]:
        motion, wanted = self.motions.fresh(now), self.commands.fresh(now)
        of = 0 if wanted is None else wanted[1]
        feeds: tuple[Feed[object], ...] = (self.motions, self.maps, self.commands)  # type: ignore[assignment]
        missing = [words for feed in feeds if (words := feed.missing(now))]
        ground = self.maps.fresh(now)
        if broken or missing or motion is None or wanted is None or ground is None:
            return stop(broken or missing[0]), of
        if self._latched:
            if abs(motion.speed) > _STANDS:
                return stop(self._latched), of
            self._latched = ""
        distance = self._clear_now(now, motion)
        if distance is None:
            return stop(self.clears.missing(now)), of
        if over := self._obedience.disobeys(abs(motion.speed), now):
            self.counters["disobeyed"] += 1
            return stop(f"the base is {over:.1f} m/s faster than it was told"), of
        scene = GuardScene(self._model, self._tables, ground, distance)
        judgement, timing = self.settings.judgement, self.settings.timing
        decision = decide(
            scene, motion, wanted[0], stands=timing.stands, late=self.motions.age(now),
            load=judgement.load,
        )  # fmt: skip
        if decision.command == STILL and abs(motion.speed) < _ROLLS:
            decision = decision._replace(brake=True)  # commands can hold no better than that
        return decision, of

    def _clear_now(self, now: float, motion: VehicleMotion) -> float | None:
        """What is left of the clear distance [m]; None where one is awaited and none is there."""
        told = self.clears.fresh(now)
        if told is None:
            return None if self.settings.judgement.awaits_clear else math.inf
        if told.motion is None:
            gone = abs(motion.speed) * self.clears.age(now)
        else:
            gone = math.dist(told.motion.pose[:2], motion.pose[:2])
        return max(told.distance - gone - self.settings.judgement.reserve, 0.0)

    def ages(self, now: float) -> dict[str, float]:
        """Of what is heard [s], −1 of what never came."""
        feeds = (self.commands, self.motions, self.clears, self.maps)
        aged = {feed.name: feed.age(now) for feed in feeds}
        return {name: age if math.isfinite(age) else -1.0 for name, age in aged.items()}

    def times(self) -> dict[str, float]:
        """Median and 99th percentile of what a command took [s]."""
        if not self.seconds:
            return {}
        median, late = np.percentile(self.seconds, (50, 99))
        return {"median": float(median), "p99": float(late)}

    def flags(self, now: float) -> list[str]:
        """What is not as it should be."""
        found = self.learned.flags()
        motion = self.motions.fresh(now)
        if self._latched and motion is not None and abs(motion.speed) > _ROLLS:
            found.append("the vehicle moves while it is told to stand")
        return found
