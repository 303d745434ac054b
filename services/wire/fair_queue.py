"""A bounded queue that serves the sender first that used the least time recently.

When the queue is full, the newest entry of the account with most entries is rejected, so that no
sender displaces another. Where only the newest request of a client is of interest, it replaces an
older one that still waits. An entry may have a deadline; :meth:`FairQueue.overdue` returns entries
that were rejected, or whose deadline has come while they waited or were worked on. Each entry is
claimed exactly once, by the worker that answers it or as overdue.
"""

from __future__ import annotations

import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from slopewise.services.wire.fair_share import FairShare

T = TypeVar("T")

_MAX_REJECTED = 1024
"""Rejected entries that wait for their reply [1]; further ones get none, which ends a query."""

_LARGE = 20_000
"""Payload from which an entry is served after smaller ones of the same account [bytes]."""

REPLACED = "replaced by a newer request of this client"
FULL = "too many requests to answer this one in time"


@dataclass(eq=False, slots=True, weakref_slot=True)
class Waiting(Generic[T]):
    """One entry.

    Attributes:
        item: that waits. sender: "" if unknown. size: payload [bytes].
        time_limit: from arrival to deadline [s].
        outranks: it is served before all entries that do not.
        is_driving: a worker reserved for clients that drive may take it.
        is_claimed: it is answered, or will be, by the component that claimed it.
        reason: why it was rejected; "" if it was not. is_invalid: it is not a valid request.
    """

    item: T
    sender: str = ""
    size: int = 0
    time_limit: float = math.inf
    outranks: bool = False
    is_driving: bool = False
    is_claimed: bool = False
    reason: str = ""
    is_invalid: bool = False
    arrived: float = field(default_factory=time.monotonic)

    @property
    def due(self) -> float:
        """Deadline, monotonic clock [s]."""
        return self.arrived + self.time_limit


class FairQueue(Generic[T]):
    """Entries by any number of threads; putting one never blocks.

    Attributes:
        shares: time used by each sender.
    """

    def __init__(self, capacity: int, *, newest_only: bool = False) -> None:
        """Let ``capacity`` entries wait; ``newest_only``: one of each named sender."""
        self._capacity, self._newest_only = capacity, newest_only
        self.shares = FairShare()
        self._waiting: list[Waiting[T]] = []
        self._unanswered: set[Waiting[T]] = set()
        self._rejected: deque[Waiting[T]] = deque()
        self._driving_count = 0
        self._lock = threading.Lock()
        self._arrival = threading.Condition(self._lock)
        self._driving_done = threading.Condition(self._lock)
        self._alarm = threading.Condition(self._lock)
        self._wakes_at = math.inf
        self._is_interrupted = self._is_closed = False

    def __len__(self) -> int:
        """Entries that wait."""
        return len(self._waiting)

    def put(self, entry: Waiting[T]) -> Waiting[T] | None:
        """Let an entry wait; returns the one that is displaced by it, possibly itself."""
        with self._lock:
            if self._is_closed:
                return entry
            displaced, reason = self._older(entry), REPLACED
            self._waiting.append(entry)
            self._unanswered.add(entry)
            if displaced is None and len(self._waiting) > self._capacity:
                displaced, reason = self._surplus(), FULL
            if displaced is not None:
                displaced.reason = reason
                self._waiting.remove(displaced)
                self._unanswered.discard(displaced)
            self._arrival.notify_all()
            if entry.due < self._wakes_at:
                self._alarm.notify()
            return displaced

    def reject(self, entry: Waiting[T]) -> bool:
        """Return an entry as overdue immediately; False if too many are rejected already."""
        with self._lock:
            self._unanswered.discard(entry)
            if self._is_closed or len(self._rejected) >= _MAX_REJECTED:
                return False
            self._rejected.append(entry)
            self._alarm.notify()
            return True

    def take(
        self, *, only_driving: bool = False, timeout: float | None = None
    ) -> Waiting[T] | None:
        """The next entry to work on; None once closed, interrupted, or after a timeout [s].

        ``only_driving``: of clients that drive; the worker calls :meth:`done` afterwards.
        """
        with self._lock:
            self._arrival.wait_for(lambda: self._is_ready(only_driving), timeout)
            self._is_interrupted = False
            eligible = self._eligible(only_driving)
            if self._is_closed or not eligible:
                return None
            entry = min(eligible, key=self._rank_at(time.monotonic()))
            self._begin(entry)
            self._driving_count += only_driving
            return entry

    def interrupt(self) -> None:
        """Let the worker that waits continue without an entry."""
        with self._lock:
            self._is_interrupted = True
            self._arrival.notify_all()

    def take_before(self, entry: Waiting[T]) -> Waiting[T] | None:
        """An entry to answer before one that is being worked on; None without.

        It outranks that one, or its sender used less time.
        """
        with self._lock:
            # The thread reserved for driving clients never works on a longer request in between.
            candidates = [
                q
                for q in self._waiting
                if q.sender != entry.sender and q.is_driving >= entry.is_driving
            ]
            if not candidates or self._is_closed:
                return None
            rank = self._rank_at(time.monotonic())
            first = min(candidates, key=rank)
            if rank(first)[:2] >= rank(entry)[:2]:
                return None
            self._begin(first)
            return first

    def done(self) -> None:
        """End the work on an entry of a driving client."""
        with self._lock:
            self._driving_count -= 1
            self._driving_done.notify_all()

    def yield_to_driving(self, seconds: float) -> None:
        """Wait while an entry of a driving client is being worked on, no longer than this [s]."""
        if self._driving_count:
            with self._lock:
                self._driving_done.wait_for(
                    lambda: self._is_closed or not self._driving_count, seconds
                )

    def claim(self, entry: Waiting[T]) -> bool:
        """Return True to the one component that answers an entry."""
        with self._lock:
            is_first, entry.is_claimed = not entry.is_claimed, True
            self._unanswered.discard(entry)
            return is_first

    def overdue(self, *, block: bool = True) -> list[Waiting[T]] | None:
        """Entries that are rejected or late, claimed; None once closed.

        ``block``: wait until there are any.
        """
        with self._lock:
            while not self._is_closed:
                now = time.monotonic()
                overdue = [*self._rejected, *(q for q in self._unanswered if q.due <= now)]
                if overdue or not block:
                    self._remove(overdue)
                    return overdue
                self._wakes_at = min((q.due for q in self._unanswered), default=math.inf)
                is_idle = math.isinf(self._wakes_at)
                self._alarm.wait(None if is_idle else self._wakes_at - now)
                self._wakes_at = 0.0
            return None

    def close(self) -> list[Waiting[T]]:
        """Release all threads; returns the entries without an answer, claimed."""
        with self._lock:
            self._is_closed = True
            remaining = [*self._rejected, *self._unanswered]
            self._remove(remaining)
            for condition in (self._arrival, self._driving_done, self._alarm):
                condition.notify_all()
            return remaining

    def _begin(self, entry: Waiting[T]) -> None:
        """Remove an entry that a worker takes; without a deadline it cannot become overdue."""
        self._waiting.remove(entry)
        if math.isinf(entry.time_limit):
            self._unanswered.discard(entry)

    def _remove(self, entries: list[Waiting[T]]) -> None:
        removed = set(entries)
        for entry in entries:
            entry.is_claimed = True
        self._unanswered -= removed
        self._waiting = [q for q in self._waiting if q not in removed]
        self._rejected.clear()

    def _is_ready(self, only_driving: bool) -> bool:
        return self._is_closed or self._is_interrupted or bool(self._eligible(only_driving))

    def _eligible(self, only_driving: bool) -> list[Waiting[T]]:
        return [q for q in self._waiting if q.is_driving] if only_driving else self._waiting

    def _rank_at(self, now: float) -> Callable[[Waiting[T]], tuple[bool, float, bool, float]]:
        """Order of service; at one moment, so that entries of one account keep their order."""

        def rank(entry: Waiting[T]) -> tuple[bool, float, bool, float]:
            used = self.shares.used(entry.sender, now)
            return not entry.outranks, used, entry.size > _LARGE, entry.arrived

        return rank

    def _older(self, entry: Waiting[T]) -> Waiting[T] | None:
        """Waiting entry that a newer one of the same client replaces, unless it outranks it."""
        if not (self._newest_only and entry.sender):
            return None
        older = (q for q in self._waiting if q.sender == entry.sender)
        return next((q for q in older if entry.outranks or not q.outranks), None)

    def _surplus(self) -> Waiting[T]:
        """Newest entry of the account with most entries; of equals, of the most time used."""
        accounts = {q: self.shares.account_of(q.sender) for q in self._waiting}
        counts, now = Counter(accounts.values()), time.monotonic()

        def surplus(entry: Waiting[T]) -> tuple[bool, int, float, float]:
            used = self.shares.used(entry.sender, now)
            return not entry.outranks, counts[accounts[entry]], used, entry.arrived

        return max(self._waiting, key=surplus)
