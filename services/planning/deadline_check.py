"""Deadlines of plan requests: no work is begun or continued that would be late."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from slopewise.services.wire.fair_queue import FULL, FairQueue, Waiting

_MAX_BREAK = 0.02  # between two candidates for a request of a driving client [s]: its cycle
_MIN_TURN = 0.002  # own time after which senders that used less are served first [s]: one plan


class DeadlineError(Exception):
    """The answer cannot be ready before its deadline; the message is the reason."""


DeadlineCheck = Callable[[], None]
"""Called between candidates; raises :class:`DeadlineError` where the reply would be late."""


def no_deadline() -> None:
    """Accept any duration."""


class CostEstimator:
    """Recent planning times per candidate.

    The quickest of the last few is used: a machine that was busy once rejects no request.
    """

    _REMEMBERED_COUNT = 8  # recent planning times of which the quickest is used [1]
    _MIN_CANDIDATES = 20  # fewer candidates are dominated by the cost of a request itself [1]
    _SAFE_SHARE = 0.7  # share of the quickest time below which no request is expected to be [1]

    def __init__(self) -> None:
        self._recent: dict[bool, list[float]] = {}

    def record(self, candidates: int, seconds: float, *, named: bool) -> None:
        """Record the planning time of some candidates [s]; few are not representative."""
        if candidates >= self._MIN_CANDIDATES:
            recent = [*self._recent.get(named, []), seconds / candidates]
            self._recent[named] = recent[-self._REMEMBERED_COUNT :]

    def expected(self, candidates: int, *, named: bool) -> float:
        """Lowest expected planning time [s]; 0 while it is unknown."""
        if candidates < self._MIN_CANDIDATES:
            return 0.0
        return self._SAFE_SHARE * candidates * min(self._recent.get(named, [0.0]))

    def check(self, candidates: int, remaining: float, *, named: bool) -> None:
        """Raise DeadlineError if the candidates take longer than the remaining time [s]."""
        expected = self.expected(candidates, named=named)
        if expected > remaining:
            reason = f"{candidates} candidates take about {expected:.2g} s"
            raise DeadlineError(f"{reason}, {max(remaining, 0.0):.2g} s are left")


class UsageMeter:
    """Called between the candidates of one request, by the thread that answers it."""

    def __init__(
        self,
        queue: FairQueue[Any],
        entry: Waiting[Any],
        answer: Callable[[Waiting[Any]], None] | None,
    ) -> None:
        """Begin now; ``answer`` answers a request before it; None: it is one of those."""
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
