"""Time that a plan request uses, and the breaks between its candidates."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from slopewise.services.planning.deadline_check import DeadlineError
from slopewise.services.wire.fair_queue import FULL, FairQueue, Waiting

_MAX_BREAK = 0.02
"""Longest break between two candidates for a request of a driving client [s]: its cycle."""

_MIN_TURN = 0.002
"""Own processor time after which senders that used less are served first [s]: one plan."""


class UsageMeter:
    """Called between the candidates of one request, by the thread that answers it."""

    def __init__(
        self,
        queue: FairQueue[Any],
        entry: Waiting[Any],
        answer: Callable[[Waiting[Any]], None] | None,
    ) -> None:
        """Begin now.

        Args:
            queue: of requests. entry: request that is answered.
            answer: answers a request that comes before it; None: it is one of those.
        """
        self._queue, self._entry, self._answer = queue, entry, answer
        self._charged_at = time.thread_time()

    def charge(self) -> None:
        """Charge this thread's time since the last call to the client."""
        now = time.thread_time()
        self._queue.shares.charge(self._entry.sender, now - self._charged_at)
        self._charged_at = now

    def __call__(self) -> None:
        """Stop a request that is late; let requests of driving and of modest clients pass."""
        if self._entry.is_claimed or time.monotonic() > self._entry.due:
            raise DeadlineError(FULL)
        if not self._entry.is_driving:
            self._queue.yield_to_driving(_MAX_BREAK)
        if self._answer is None or time.thread_time() - self._charged_at < _MIN_TURN:
            return
        self.charge()
        first = self._queue.take_before(self._entry)
        if first is not None:
            self._answer(first)
            self._charged_at = time.thread_time()
