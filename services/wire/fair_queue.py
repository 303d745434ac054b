"""A bounded queue that serves the sender first that used the least time recently.

When the queue is full, the newest entry of the account with most entries is rejected, so that no
sender displaces another. Where only the newest request of a client is of interest, it replaces an
older one that still waits. Entries that were rejected, or whose deadline came while they waited or
were worked on, are overdue. Each entry is claimed exactly once, as overdue or by a worker.

A sender is known by the name in its messages only: zenoh does not report the session of a message.
Names that were never answered share one account, so that a new name for each request gains nothing.
"""

from __future__ import annotations

import math
import threading
import time
from collections import Counter, OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

T = TypeVar("T")

_MAX_REJECTED = 1024  # rejected entries that wait for their reply [1]; others get none, which ends
_LARGE = 20_000  # payload from which an entry follows smaller ones of its account [bytes]
_DECAY_TIME = 5.0  # time in which used time decays to 1/e [s]: some dozens of a robot's cycles
_DRIVING_FROM = 3  # answers after which a client drives [1]: names used for one request have none
_DRIVING_FOR = 10.0  # time since the last answer after which a client is no longer driving [s]
_MAX_NAMES = 256  # accounts with a name [1]; bounds memory; those answered longest ago are closed

REPLACED = "replaced by a newer request of this client"
FULL = "too many requests to answer this one in time"
_NEWCOMERS = "\x00"
"""Account of all names that were never answered; no valid name on the wire."""


@dataclass(slots=True)
class _Account:
    used: float = 0.0  # processor time [s], as of `charged_at`
    answer_count: int = 0
    charged_at: float = field(default_factory=time.monotonic)
    answered_at: float = field(default_factory=time.monotonic)


class FairShare:
    """Processor time that senders used recently, and which clients are driving; any threads."""

    def __init__(self) -> None:
        self._accounts: OrderedDict[str, _Account] = OrderedDict({_NEWCOMERS: _Account()})
        self._lock = threading.Lock()

    def account_of(self, sender: str) -> str:
        """Name of a sender's account."""
        return sender if sender in self._accounts else _NEWCOMERS

    def used(self, sender: str, now: float) -> float:
        """Time that a sender, or those that share its account, used recently [s]; ``now``: [s]."""
        with self._lock:
            account = self._of(sender)
            return account.used * math.exp((account.charged_at - now) / _DECAY_TIME)

    def charge(self, sender: str, seconds: float) -> None:
        """Add time to a sender's account [s]."""
        with self._lock:
            account, now = self._of(sender), time.monotonic()
            decay = math.exp((account.charged_at - now) / _DECAY_TIME)
            account.used, account.charged_at = account.used * decay + seconds, now

    def note_answer(self, sender: str) -> None:
        """Record that a sender was answered in time."""
        with self._lock:
            account = self._accounts.pop(sender, None) or _Account()
            now = time.monotonic()
            is_interrupted = now - account.answered_at > _DRIVING_FOR
            account.answer_count = 1 if is_interrupted else account.answer_count + 1
            account.answered_at = now
            self._accounts[sender] = account
            while len(self._accounts) > _MAX_NAMES:
                self._accounts.pop(next(n for n in self._accounts if n != _NEWCOMERS))

    def is_driving(self, sender: str) -> bool:
        """Return True if a named client was answered several times, and recently."""
        with self._lock:
            account = self._accounts.get(sender) if sender else None
            return (
                account is not None
                and account.answer_count >= _DRIVING_FROM
                and time.monotonic() - account.answered_at < _DRIVING_FOR
            )

    def _of(self, sender: str) -> _Account:
        return self._accounts.get(sender) or self._accounts[_NEWCOMERS]


@dataclass(eq=False, slots=True, weakref_slot=True)
class Waiting(Generic[T]):
    """One entry."""

    item: T  # that waits
    sender: str = ""  # "" if unknown
    size: int = 0  # payload [bytes]
    time_limit: float = math.inf  # from arrival to deadline [s]
    outranks: bool = False  # it is served before all entries that do not
    is_driving: bool = False  # a worker reserved for clients that drive may take it
    is_claimed: bool = False  # it is answered, or will be, by the component that claimed it
    reason: str = ""  # why it was rejected; "" if it was not
    is_invalid: bool = False  # it is not a valid request
    arrived: float = field(default_factory=time.monotonic)

    @property
    def due(self) -> float:
        """Deadline, monotonic clock [s]."""
        return self.arrived + self.time_limit


class FairQueue(Generic[T]):
    """Entries by any number of threads; putting one never blocks."""

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
        self._is_closed = False

    def __len__(self) -> int:
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
        """The next entry to work on; None once closed, or after a timeout [s].

        ``only_driving``: of clients that drive; the worker calls :meth:`done` afterwards.
        """
        with self._lock:
            self._arrival.wait_for(lambda: self._is_closed or self._eligible(only_driving), timeout)
            eligible = self._eligible(only_driving)
            if self._is_closed or not eligible:
                return None
            entry = min(eligible, key=self._rank_at(time.monotonic()))
            self._begin(entry)
            self._driving_count += only_driving
            return entry

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
