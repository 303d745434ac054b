"""A sender's clock beside the time that passes here; where it begins is all the same."""

from __future__ import annotations

import math

LATE = 60.0
"""So much longer on its way than the quickest one, a message is of a clock set back [s]."""

_JUMPED = 5
"""So many messages in a row that agree with each other are right about a clock."""


class SenderClock:
    """One sender's.

    Attributes:
        lead: of the quickest message: how far the sender's clock is ahead of the one here [s].
    """

    def __init__(self) -> None:
        """Nothing was heard yet."""
        self.lead = -math.inf
        self._doubtful: list[float] = []

    def judge(self, lead: float, early: float) -> str:
        """Why a message cannot be of now; empty if it can, "jumped" if the clock was set.

        Args:
            lead: its time stamp less the time of its arrival [s].
            early: how far the clock may run ahead of the time that passed [s].
        """
        if self.lead == -math.inf or self.lead - LATE <= lead <= self.lead + early:
            self.lead = max(self.lead, lead)
            self._doubtful = []
            return ""
        if self._doubtful and abs(lead - self._doubtful[-1]) > early:
            self._doubtful = []
        self._doubtful.append(lead)
        if len(self._doubtful) >= _JUMPED:
            self.lead, self._doubtful = lead, []
            return "jumped"
        return "future" if lead > self.lead else "late"

    def delay(self, lead: float) -> float:
        """How much longer a message was on its way than the quickest one [s]."""
        return max(self.lead - lead, 0.0) if math.isfinite(self.lead) else 0.0
