"""One thing that the guard hears: how old it is, and whether it is new at all."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import Generic, TypeVar

T = TypeVar("T")
_MOST_SENDERS = 16


@dataclass(slots=True)
class Feed(Generic[T]):
    """The newest of one kind, as long as it is fresh.

    Attributes:
        name: in words. deadline: it is void when older [s]. counters: of the guard.
    """

    name: str
    deadline: float
    counters: Counter[str]
    _value: T | None = None
    _at: float = -math.inf
    _last: dict[str, int] = field(default_factory=dict)

    def take(self, value: T, now: float, sender: str = "", sequence: int | None = None) -> bool:
        """Take up something new; False where its number says that it is not.

        A sender whose number goes back has to be silent for the deadline before it is believed
        again: it may have been restarted, or somebody repeats what was once said.
        """
        if sequence is not None:
            last = self._last.get(sender)
            if last is not None and sequence <= last and self.age(now) <= self.deadline:
                self.counters[f"{self.name} repeated or late"] += 1
                return False
            if last is not None and sequence > last + 1:
                self.counters[f"{self.name} lost"] += sequence - last - 1
            self._last[sender] = sequence
            while len(self._last) > _MOST_SENDERS:
                self._last.pop(next(iter(self._last)))
        self._value, self._at = value, now
        self.counters[self.name] += 1
        return True

    def drop(self) -> None:
        """What could not be read takes the place of what was there before it."""
        self._value = None

    def age(self, now: float) -> float:
        """Since the newest came [s]; inf if none did."""
        return now - self._at

    def fresh(self, now: float) -> T | None:
        """The newest, unless it is void."""
        return self._value if self.age(now) <= self.deadline else None

    def missing(self, now: float) -> str:
        """In words why there is nothing, "" where there is."""
        if self.fresh(now) is not None:
            return ""
        if self._value is None:
            return f"no {self.name}"
        return f"{self.name} is {self.age(now):.2f} s old"
