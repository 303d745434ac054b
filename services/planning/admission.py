"""Who waits, who is told busy: a bounded queue in which every question has a deadline."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import Any

_MOST_TURNED_AWAY = 1024
"""Beyond that nobody is left who could say busy in time."""


class PendingQuery:
    """A query from its arrival until somebody answered it."""

    __slots__ = ("arrived", "due", "query", "taken")

    def __init__(self, query: Any, deadline: float) -> None:
        """Arrived now; to be answered within ``deadline`` [s]."""
        self.query = query
        self.arrived = time.monotonic()
        self.due = self.arrived + deadline
        self.taken = False


class Admission:
    """Never blocks whoever brings a question; every question is claimed by exactly one."""

    def __init__(self, capacity: int) -> None:
        """Let so many wait."""
        self._capacity = capacity
        self._waiting: deque[PendingQuery] = deque()
        self._open: set[PendingQuery] = set()
        self._away: deque[PendingQuery] = deque()
        self._lock = threading.Lock()
        self._work = threading.Condition(self._lock)
        self._alarm = threading.Condition(self._lock)
        self._wakes_at = float("inf")
        self._closed = False

    def __len__(self) -> int:
        """Questions that wait."""
        return len(self._waiting)

    def offer(self, question: PendingQuery) -> bool:
        """Let a question wait, or be told busy; False if there is room for neither."""
        with self._lock:
            if self._closed or len(self._away) >= _MOST_TURNED_AWAY:
                return False
            if len(self._waiting) >= self._capacity:
                self._away.append(question)
                self._alarm.notify()
                return True
            self._waiting.append(question)
            self._open.add(question)
            self._work.notify()
            if question.due < self._wakes_at:
                self._alarm.notify()
            return True

    def take(self) -> PendingQuery | None:
        """The next question to work on; None once closed."""
        with self._lock:
            while not self._waiting and not self._closed:
                self._work.wait()
            return None if self._closed else self._waiting.popleft()

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
                    self._waiting = deque(q for q in self._waiting if q not in gone)
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
            self._waiting.clear()
            self._away.clear()
            self._open.clear()
            self._work.notify_all()
            self._alarm.notify_all()
            return left
