"""One input of the guard: its newest value, how old that is, and whether it is new at all."""

from __future__ import annotations

import math
from collections import Counter, OrderedDict
from dataclasses import dataclass, field
from typing import Generic, NamedTuple, TypeVar

from slopewise.models.errors import ParameterError
from slopewise.services.wire.arrival import SenderTable
from slopewise.services.wire.lateness import ARRIVAL, RECOVERY, Lateness, WallClock

T = TypeVar("T")


class _Sender(NamedTuple):
    """One sender: its lateness, and its newest messages by their numbers, with hashed content."""

    lateness: Lateness
    recent: OrderedDict[int, int]

    def is_another(self, sequence: int, content: int) -> bool:
        """Return True for an old number that this sender did not send, or not with that content."""
        last = self.lateness.number or 0
        return self.recent.get(sequence, content) != content or sequence < last - _REMEMBERED


_MAX_SENDERS = 16
"""Senders of one input whose clocks are followed; beyond, the one silent for longest goes [1]."""

_REMEMBERED = 50
"""Messages of a sender in which a repeated one is recognised, and behind which none can have been
overtaken: a second of odometry [1]."""

_LATE = 0.5  # share of the deadline from which a message that arrives late is reported [1]
_CONFLICT = "two senders"  # event


@dataclass(slots=True)
class InputFeed(Generic[T]):
    """Newest value of one input, while it is fresh."""

    name: str  # in messages
    deadline: float  # age beyond which the newest value is void [s]
    counters: Counter[str]  # events, shared with the guard
    max_latency: float = 0.0  # max_latency, wall, uses_stamps: see :class:`Lateness`
    wall: WallClock | None = None
    uses_stamps: bool = True
    newest: Lateness = field(init=False)  # age of the newest message
    has_messages: bool = False  # one was accepted since the start
    rejection: str = ""  # reason why the newest message was discarded, empty if it was not
    _value: T | None = None
    _at: float = -math.inf
    _sender: str = ""
    _senders: SenderTable[str, _Sender] = field(init=False)
    _events: dict[str, tuple[float, str]] = field(default_factory=dict)  # last time and text

    def __post_init__(self) -> None:
        self.newest = self._new_sender()
        # An unknown sender is taken to be as late as the newest one.
        self._senders = SenderTable(
            lambda: _Sender(self._new_sender(self.newest.late), OrderedDict()), _MAX_SENDERS
        )

    def _new_sender(self, late: float = 0.0) -> Lateness:
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
        again: it may have been restarted, or a message of the past is repeated. One that cannot be
        its own is of another sender of the same name.

        ``now``: arrival, monotonic [s]; ``time``: stamp on the sender's clock [s].
        """
        lateness, recent = known = self._senders.of(sender)
        last = lateness.number
        content = 0 if sequence is None else hash((value, time))
        is_old = sequence is not None and last is not None and sequence <= last
        is_recent = now - self._at <= self.deadline
        if sequence is not None and is_old and is_recent and known.is_another(sequence, content):
            self._conflicts(sender, now)
        try:
            if (is_old and is_recent) or not lateness.take(time, now, sequence):
                self.counters[f"{self.name} repeated or late"] += 1
                return False
        except ParameterError as error:
            self.drop(f"{self.name} rejected: stamp: expected {error.expected}", now)
            self.record("refused stamp", now, self.rejection)
            return False
        if sequence is not None and last is not None and sequence > last + 1:
            self.counters[f"{self.name} lost"] += sequence - last - 1
        if self.has_messages and sender != self._sender and is_recent:
            self._conflicts(sender, now)
        if is_old:
            recent.clear()  # it counts from the start again
        if sequence is not None:
            recent[sequence] = content
            if len(recent) > _REMEMBERED:
                recent.popitem(last=False)
        self._sender = sender
        self.newest, self._value, self._at = lateness, value, now
        self.has_messages, self.rejection = True, ""
        self.counters[self.name] += 1
        self._check_clocks(lateness, now)
        return True

    def _conflicts(self, sender: str, now: float) -> None:
        senders = " and ".join(sorted((self._sender, sender)))
        self.record(_CONFLICT, now, f"{self.name} comes from two senders, {senders}")

    def _check_clocks(self, lateness: Lateness, now: float) -> None:
        if lateness.repeated:
            self.record("repeated stamp", now, f"stamps of {self.name} are repeated")
        if lateness.stepped == now:
            self.record("clock step", now, f"the clock that stamps {self.name} was set")
        if self.wall is not None and self.wall.is_recovering(now):
            self.record("wall clock step", now, "the clock of this machine was set")
        if lateness.late > _LATE * self.deadline:
            self.record("late", now, f"{self.name} arrives {lateness.late:.2f} s late")

    def record(self, kind: str, now: float, text: str) -> None:
        """Count an event, and show it among the warnings for :data:`RECOVERY`."""
        self._events[kind] = now, text
        self.counters[f"{self.name}: {kind}"] += 1

    def warnings(self, now: float) -> list[str]:
        """Faults of stamps and delay, now or within :data:`RECOVERY`."""
        texts = [text for at, text in self._events.values() if now - at <= RECOVERY]
        if self.has_messages and self.newest.stamps == ARRIVAL:
            basis = "has no stamps" if self.uses_stamps else "is used without its stamps"
            texts.append(f"{self.name} {basis}: its delay is taken as {self.max_latency:g} s")
        return texts

    def drop(self, reason: str = "", at: float = -math.inf) -> None:
        """Discard the newest value, because of an unusable message that came ``at`` [s]."""
        self._value, self.rejection, self._at = None, reason, max(self._at, at)

    def conflict(self, now: float) -> str:
        """Two senders, as text, until one of them has been silent for the deadline; else ""."""
        at, text = self._events.get(_CONFLICT, (-math.inf, ""))
        return text if now - at <= self.deadline else ""

    def is_arriving(self, now: float) -> bool:
        """Return True if a message came within the deadline, however late or unusable."""
        return now - self._at <= self.deadline

    def fresh(self, now: float) -> T | None:
        """Newest value, unless it is void."""
        return self._value if self.newest.age(now) <= self.deadline else None

    def missing(self, now: float) -> str:
        """Reason why there is no fresh value, "" where there is one."""
        if self._value is None:
            return self.rejection or f"no {self.name}"
        age = self.newest.objection(now, self.deadline)
        return age and f"{self.name} is {age}"
