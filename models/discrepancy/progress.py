"""Progress of an investigation, for an estimate of the remaining time."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum


class Stage(IntEnum):
    """Completed steps, with the hundredths of the typical time that they end at."""

    STOPS = 6
    BASE = 10
    SEARCH = 80
    LEFT = 94
    GAPS = 98
    FINDINGS = 100


class Progress:
    """Reports hundredths when they are reached, each once."""

    def __init__(self, advance: Callable[[int], None]) -> None:
        self._advance, self._reported = advance, 0

    def reach(self, hundredths: float) -> None:
        """All up to there is done; earlier reports stay valid."""
        done = int(hundredths)
        if done > self._reported:
            self._advance(done - self._reported)
            self._reported = done

    def search(self, share: float) -> None:
        """A share of the search is done."""
        self.reach(Stage.BASE + share * (Stage.SEARCH - Stage.BASE))
