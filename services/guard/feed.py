"""One thing that the guard hears: how old it is, and whether it is new at all."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from slopewise.models.errors import ParameterError
from slopewise.services.wire.lateness import ARRIVAL, Lateness, WallClock
from slopewise.services.wire.sender_clock import RECOVERY

T = TypeVar("T")
_MOST_SENDERS = 16
_LATE = 0.5
"""Share of the deadline from which a message that arrives late is reported [1]."""


@dataclass(slots=True)
class Feed(Generic[T]):
    """The newest of one kind, as long as it is fresh.

    Attributes:
        name: for messages. deadline: age beyond which the newest is void [s].
        counters: of the guard. max_latency, wall, uses_stamps: of :class:`Lateness`.
        newest: age of the newest message. has_messages: one was taken since the start.
        refused: why the newest was discarded, as text; empty: it was not, or no reason is known.
    """

    name: str
    deadline: float
    counters: Counter[str]
    max_latency: float = 0.0
    wall: WallClock | None = None
    uses_stamps: bool = True
    newest: Lateness = field(init=False)
    has_messages: bool = False
    refused: str = ""
    _value: T | None = None
    _at: float = -math.inf
    _senders: dict[str, Lateness] = field(default_factory=dict)
    _events: dict[str, tuple[float, str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.newest = self._begin()

    def _begin(self, late: float = 0.0) -> Lateness:
        return Lateness(self.max_latency, self.wall, uses_stamps=self.uses_stamps, late=late)

    def take(
        self,
        value: T,
        now: float,
        sender: str = "",
        sequence: int | None = None,
        time: float | None = None,
    ) -> bool:
        """Record a message; False where its number or its stamp shows that it is not new.

        A sender whose number goes back has to be silent for the deadline before it is accepted
        again: it may have been restarted, or a message of the past is repeated.

        Args:
            value: of the message. now: its arrival, monotonic [s].
            sender, sequence: who numbered it, and how. time: its stamp on the sender's clock [s].
        """
        lateness = self._senders.pop(sender, None) or self._begin(self.newest.late)
        self._senders[sender] = lateness
        while len(self._senders) > _MOST_SENDERS:
            self._senders.pop(next(iter(self._senders)))
        last = lateness.number
        is_old = sequence is not None and last is not None and sequence <= last
        try:
            if (is_old and now - self._at <= self.deadline) or not lateness.take(
                time, now, sequence
            ):
                self.counters[f"{self.name} repeated or late"] += 1
                return False
        except ParameterError as error:
            self.drop(f"{self.name} rejected: stamp: expected {error.expected}", now)
            self._record("refused stamp", now, self.refused)
            return False
        if sequence is not None and last is not None and sequence > last + 1:
            self.counters[f"{self.name} lost"] += sequence - last - 1
        self.newest, self._value, self._at = lateness, value, now
        self.has_messages, self.refused = True, ""
        self.counters[self.name] += 1
        self._notice(lateness, now)
        return True

    def _notice(self, lateness: Lateness, now: float) -> None:
        """Record what the status has to report of the newest message."""
        if lateness.repeated:
            self._record("repeated stamp", now, f"stamps of {self.name} are repeated")
        if lateness.stepped == now:
            self._record("clock step", now, f"the clock that stamps {self.name} was set")
        if self.wall is not None and self.wall.is_recovering(now):
            self._record("wall clock step", now, "the clock of this machine was set")
        if lateness.late > _LATE * self.deadline:
            self._record("late", now, f"{self.name} arrives {lateness.late:.2f} s late")

    def _record(self, kind: str, now: float, text: str) -> None:
        self._events[kind] = now, text
        self.counters[f"{self.name}: {kind}"] += 1

    def flags(self, now: float) -> list[str]:
        """What is wrong with stamps and delay, or was within :data:`RECOVERY`."""
        found = [text for at, text in self._events.values() if now - at <= RECOVERY]
        if self.has_messages and self.newest.stamps == ARRIVAL:
            basis = "has no stamps" if self.uses_stamps else "is used without its stamps"
            found.append(f"{self.name} {basis}: its delay is taken as {self.max_latency:g} s")
        return found

    def drop(self, reason: str = "", at: float = -math.inf) -> None:
        """Discard the newest: a message that came ``at`` [s] and is unusable replaces it."""
        self._value, self.refused, self._at = None, reason, max(self._at, at)

    def age(self, now: float) -> float:
        """Age of the newest, as far as stamps and arrival show it [s]; inf if none came."""
        return self.newest.age(now)

    def bound(self, now: float) -> float:
        """Age of the newest that is not exceeded, if clocks or delay are as declared [s]."""
        return self.newest.bound(now)

    def is_arriving(self, now: float) -> bool:
        """Return True if a message came within the deadline, however late or unusable."""
        return now - self._at <= self.deadline

    def fresh(self, now: float) -> T | None:
        """The newest, unless it is void."""
        return self._value if self.age(now) <= self.deadline else None

    def missing(self, now: float) -> str:
        """Reason why there is no fresh value, "" where there is."""
        if self._value is None:
            return self.refused or f"no {self.name}"
        old = self.newest.objection(now, self.deadline)
        return old and f"{self.name} is {old}"
