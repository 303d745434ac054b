"""Deadlines of plan requests: no work is begun or continued that would be late."""

from __future__ import annotations

from collections.abc import Callable


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
        """Begin without times."""
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
