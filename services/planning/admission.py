"""Who waits, who is told busy: bounded queues in which every question has a deadline.

There are two lanes, each with threads of its own: one for clients that drive, one for the rest.
In each, whoever had least of the planner's time lately comes first.
"""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from enum import Enum
from typing import Any

from slopewise.services.planning.shares import Shares

_MOST_TURNED_AWAY = 1024
"""Beyond that nobody is left who could say busy in time."""

_LARGE = 20_000
"""Questions with more bytes come after smaller ones of the same account."""


class Lane(Enum):
    """Which threads answer a question."""

    DRIVE = "drive"
    REST = "rest"


class PendingQuery:
    """A query from its arrival until somebody answered it.

    Attributes:
        client: who asks, as far as that can be told before the question is decoded; "" for nobody.
        size: of the payload [bytes]. request: the question once it is decoded.
        refusal: why it is no question that can be answered; "" where it is one.
    """

    __slots__ = (
        "arrived",
        "client",
        "due",
        "lane",
        "query",
        "refusal",
        "request",
        "size",
        "taken",
    )

    def __init__(self, query: Any, deadline: float, client: str = "", size: int = 0) -> None:
        """Arrived now; to be answered within ``deadline`` [s]."""
        self.query = query
        self.arrived = time.monotonic()
        self.due = self.arrived + deadline
        self.client, self.size = client, size
        self.lane = Lane.REST
        self.request: Any = None
        self.refusal = ""
        self.taken = False


class Admission:
    """Never blocks whoever brings a question; every question is claimed by exactly one."""

    def __init__(self, capacity: int, shares: Shares | None = None) -> None:
        """Let so many wait in each lane."""
        self._capacity = capacity
        self.shares = shares or Shares()
        self._waiting: dict[Lane, list[PendingQuery]] = {lane: [] for lane in Lane}
        self._open: set[PendingQuery] = set()
        self._away: deque[PendingQuery] = deque()
        self._driving = 0
        self._lock = threading.Lock()
        self._work = threading.Condition(self._lock)
        self._way = threading.Condition(self._lock)
        self._alarm = threading.Condition(self._lock)
        self._wakes_at = float("inf")
        self._closed = False

    def __len__(self) -> int:
        """Questions that wait."""
        return sum(len(waiting) for waiting in self._waiting.values())

    def offer(self, question: PendingQuery, *, reserved: bool = False) -> bool:
        """Let a question wait, or be told busy; False if there is room for neither.

        ``reserved``: it came on the key of the lane for clients that drive.
        """
        drives = reserved or self.shares.drives(question.client)
        question.lane = Lane.DRIVE if drives else Lane.REST
        with self._lock:
            if self._closed:
                return False
            return self._let_in(question)

    def move(self, question: PendingQuery) -> None:
        """Let a question that was taken wait in the other lane: it is more than driving takes."""
        with self._lock:
            question.lane = Lane.REST
            if not question.taken and not self._closed:
                self._let_in(question)

    def turn_away(self, question: PendingQuery) -> None:
        """Let a question be told why it is not answered, if anybody has the time."""
        with self._lock:
            if not self._closed and len(self._away) < _MOST_TURNED_AWAY:
                self._away.append(question)
                self._alarm.notify()

    def _let_in(self, question: PendingQuery) -> bool:
        waiting = self._waiting[question.lane]
        if len(waiting) >= self._capacity:
            question_out = _one_too_many(waiting, question)
            if question_out is not question:
                waiting.remove(question_out)
                waiting.append(question)
                self._open.add(question)
            self._open.discard(question_out)
            if len(self._away) >= _MOST_TURNED_AWAY:
                return False
            self._away.append(question_out)
            self._alarm.notify()
            return True
        waiting.append(question)
        self._open.add(question)
        self._work.notify_all()
        if question.due < self._wakes_at:
            self._alarm.notify()
        return True

    def take(self, lane: Lane = Lane.REST) -> PendingQuery | None:
        """The next question of a lane to work on; None once closed."""
        with self._lock:
            while not self._waiting[lane] and not self._closed:
                self._work.wait()
            if self._closed:
                return None
            if lane is Lane.DRIVE:
                self._driving += 1
            return self._next(lane)

    def _next(self, lane: Lane) -> PendingQuery:
        waiting = self._waiting[lane]
        if len(waiting) == 1:
            return waiting.pop()
        used = {client: self.shares.used(client) for client in {q.client for q in waiting}}
        chosen = min(waiting, key=lambda q: (used[q.client], q.size > _LARGE, q.arrived))
        waiting.remove(chosen)
        return chosen

    def take_smaller(self, question: PendingQuery) -> PendingQuery | None:
        """A question of somebody who had less than whoever is being answered; None without."""
        with self._lock:
            others = [q for q in self._waiting[question.lane] if q.client != question.client]
            if not others or self._closed:
                return None
            had = self.shares.used(question.client)
            found = min(others, key=lambda q: (self.shares.used(q.client), q.arrived))
            if self.shares.used(found.client) >= had:
                return None
            self._waiting[question.lane].remove(found)
            return found

    def done(self, lane: Lane) -> None:
        """A question that was taken is worked on no longer."""
        with self._lock:
            if lane is Lane.DRIVE:
                self._driving -= 1
                self._way.notify_all()

    def give_way(self, seconds: float) -> None:
        """Wait while a client that drives is being answered, at most so long."""
        if not (self._driving or self._waiting[Lane.DRIVE]):
            return
        until = time.monotonic() + seconds
        with self._lock:
            while (self._driving or self._waiting[Lane.DRIVE]) and not self._closed:
                left = until - time.monotonic()
                if left <= 0.0:
                    return
                self._way.wait(left)

    def claim(self, question: PendingQuery) -> bool:
        """Whoever answers first asks; everybody else is told False."""
        with self._lock:
            first = not question.taken
            question.taken = True
            self._open.discard(question)
            return first

    def late(self) -> list[PendingQuery] | None:
        """Questions that have to be told busy now, claimed already; None once closed."""
        with self._lock:
            while not self._closed:
                now = time.monotonic()
                late = [*self._away, *(q for q in self._open if q.due <= now)]
                self._away.clear()
                if late:
                    for question in late:
                        question.taken = True
                    self._open.difference_update(late)
                    gone = set(late)
                    for lane, waiting in self._waiting.items():
                        self._waiting[lane] = [q for q in waiting if q not in gone]
                    return late
                self._wakes_at = min((q.due for q in self._open), default=float("inf"))
                idle = self._wakes_at == float("inf")
                self._alarm.wait(None if idle else self._wakes_at - now)
                self._wakes_at = 0.0
            return None

    def close(self) -> list[PendingQuery]:
        """Let everybody go; the questions that nobody answered."""
        with self._lock:
            self._closed = True
            left = [*self._away, *self._open]
            for question in left:
                question.taken = True
            for waiting in self._waiting.values():
                waiting.clear()
            self._away.clear()
            self._open.clear()
            for condition in (self._work, self._way, self._alarm):
                condition.notify_all()
            return left


def _one_too_many(waiting: list[PendingQuery], question: PendingQuery) -> PendingQuery:
    """Who has to go: the newest of those who ask the most, the newcomer among equals."""
    asking = Counter(q.client for q in waiting)
    most = max(asking.values())
    if asking[question.client] + 1 >= most:
        return question
    return next(q for q in reversed(waiting) if asking[q.client] == most)
