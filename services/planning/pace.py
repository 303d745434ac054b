"""Between two candidates of a long question: is there still somebody who wants the answer?"""

from __future__ import annotations

from collections.abc import Callable

TOO_MANY = "too many questions to answer this one in time"


class TooLateError(Exception):
    """The answer cannot be there before its deadline; the message says why, in a few words."""


Pace = Callable[[], None]
"""Called between candidates; raises :class:`TooLateError` where going on is of no use."""


def unhurried() -> None:
    """Nobody waits."""


class Costs:
    """How long candidates took lately, so that what cannot be done in time is not begun.

    The quickest of the last few counts: a machine that was busy once turns nobody away.
    """

    _KEPT = 8
    _FEWEST = 20
    _SURE = 0.7

    def __init__(self) -> None:
        """Nothing is known yet."""
        self._lately: dict[bool, list[float]] = {}

    def learn(self, candidates: int, seconds: float, *, named: bool) -> None:
        """So many candidates took so long [s]; few tell nothing of many."""
        if candidates >= self._FEWEST:
            lately = [*self._lately.get(named, []), seconds / candidates]
            self._lately[named] = lately[-self._KEPT :]

    def expected(self, candidates: int, *, named: bool) -> float:
        """What so many candidates will take at the least [s]; 0 while that is not known."""
        if candidates < self._FEWEST:
            return 0.0
        return self._SURE * candidates * min(self._lately.get(named, [0.0]))

    def check(self, candidates: int, left: float, *, named: bool) -> None:
        """Raise TooLateError if so many candidates will take longer than is left [s]."""
        takes = self.expected(candidates, named=named)
        if takes > left:
            words = f"{candidates} candidates take about {takes:.2g} s"
            raise TooLateError(f"{words}, {max(left, 0.0):.2g} s are left")
