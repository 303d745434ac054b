"""Lateness of messages by their sender's clock, whose zero is arbitrary."""

from __future__ import annotations

import math

DRIFT = 1e-4
"""Rate at which two clocks drift apart: crystals stay within 100 ppm [s/s].

Lateness that grows more slowly is not seen, and larger one is forgotten at that rate."""

STEP = 0.02
"""Quicker than the quickest message by more than that, its clock was set forward [s]."""

_SMOOTHED = 20
"""Messages over which the interval of a sender is averaged [1]."""

_IRREGULAR = 1.5
"""Ratio of an interval to the average that a regular sender does not exceed [1]."""

RECOVERY = 10.0
"""Time from a step of a clock until the ages that it left uncertain are certain again [s]."""


class SenderClock:
    """One sender's.

    Attributes:
        lead: how far the sender's clock is ahead of the one here, by the quickest message [s].
        stamp: stamp of the newest message, on the sender's clock [s]. steps: how often it was set.
    """

    def __init__(self, late: float = 0.0) -> None:
        """Begin; ``late``: lateness of the sender before this one, given up as after a step [s]."""
        self.lead = self.stamp = -math.inf
        self.steps = 0
        self._at, self._late = 0.0, late
        self._uncertain = self._recovers = self._interval = 0.0
        self._measured = 0

    @property
    def is_known(self) -> bool:
        """Return True after the first message with a stamp."""
        return math.isfinite(self.stamp)

    def lateness(
        self, stamp: float, at: float, known: float = 0.0, sent: int = 0, *, is_set: bool = False
    ) -> float:
        """How late a message is [s]: what is known of it, and what it is later than the quickest.

        A message is never later than the one before it was on arrival and the time since then.
        After a step of the sender's clock that is all that is known, so it is what is returned; the
        excess is given up over :data:`RECOVERY`. A repeated stamp is not refreshed.

        Args:
            stamp: on the sender's clock [s]; messages come in the order in which they were sent.
            at: arrival, monotonic [s]. known: age by a clock that both share, 0 without one [s].
            sent: messages that were sent since the last one, 0 where they are not numbered.
            is_set: the sender's clock is known to have been set.
        """
        lead, passed = stamp - at, max(at - self._at, 0.0) if self.is_known else 0.0
        if stamp == self.stamp:
            return max(self._late + passed, known)
        recovered = min(self._uncertain, self._recovers * passed)
        self._uncertain -= recovered
        self.lead -= recovered
        if not self.is_known:
            self.lead, self._uncertain = lead + self._late, self._late
            self._recovers = self._late / RECOVERY
        elif is_set or self._is_step(stamp, at, passed, sent):
            latest = self._late + passed
            growth = max(self.lead - (self.stamp - self._at), 0.0)
            self._uncertain += latest - growth
            self._recovers = self._uncertain / RECOVERY
            self.lead, self.steps = lead + latest, self.steps + 1
        self.lead = max(self.lead - DRIFT * passed, lead)
        self.stamp, self._at = stamp, at
        self._late = max(self.lead - lead, known)
        return self._late

    def _is_step(self, stamp: float, at: float, passed: float, sent: int) -> bool:
        """Return True if the stamp goes back, or farther ahead than a shorter delay explains."""
        if stamp < self.stamp or stamp - at > self.lead + STEP + DRIFT * passed:
            return True
        regular = self._measured >= _SMOOTHED
        if sent > 0:
            # By the clock here, which no sender sets.
            self._measured += 1
            share = 1.0 / min(self._measured, _SMOOTHED)
            self._interval += share * (passed / sent - self._interval)
        # A delay that falls brings as many messages; one that skips ahead alone was set ahead.
        ahead = stamp - self.stamp - max(passed, _IRREGULAR * sent * self._interval)
        return regular and sent > 0 and self._late > STEP and ahead > STEP
