"""How far an investigation is, so that whoever waits can be told how long it still takes."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum


class Stage(IntEnum):
    """What is done, with the hundredths of the usual time that it ends at."""

    STOPS = 6
    BASE = 10
    SEARCH = 80
    LEFT = 94
    GAPS = 98
    FINDINGS = 100


class Progress:
    """Tells hundredths as they are reached, each once."""

    def __init__(self, tell: Callable[[int], None]) -> None:
        self._tell, self._told = tell, 0

    def reach(self, hundredths: float) -> None:
        """Everything up to there is done; what is behind already stays told."""
        whole = int(hundredths)
        if whole > self._told:
            self._tell(whole - self._told)
            self._told = whole

    def search(self, share: float) -> None:
        """A share of the search is done."""
        self.reach(Stage.BASE + share * (Stage.SEARCH - Stage.BASE))
