"""Age of the newest message of a sender: from its stamp where clocks are shared, else from arrival.

Without a shared clock a receiver sees how a delay grows (:meth:`SenderClock.lateness`) and not its
constant part: a declared bound of that is added to every age that decides on a stop. Times are of
the monotonic clock [s] where no other is named.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from slopewise.models.errors import ParameterError

DRIFT = 1e-4
"""Rate at which two clocks drift apart: crystals stay within 100 ppm [s/s].

Lateness that grows more slowly is not seen; what was seen decays at that rate."""

STEP = 0.02  # lead over the quickest message from which a clock was set forward [s]
RECOVERY = 10.0  # time after a step of a clock until ages are certain again [s]
SYNCHRONY = 0.02  # difference of clocks that share NTP on one network; part of every age [s]

_SMOOTHED = 20  # messages over which the interval of a sender is averaged [1]
_IRREGULAR = 1.5  # ratio of an interval to the average that a regular sender does not exceed [1]
_REORDERED = 1.0  # an unnumbered message with a stamp that is earlier by less was overtaken [s]
_IN_A_ROW = 3  # overtaken messages in a row from which the clock was set back [1]
_MAX_STAMP = 1e11  # of any clock; later ones have another unit, or are too coarse [s]

SHARED, GROWTH, ARRIVAL = "shared clock", "growth only", "none"
"""What ages are derived from, as the status reports it."""
_BASIS = {SHARED: "stamp", GROWTH: "arrival and growth of delay", ARRIVAL: "arrival"}


class SenderClock:
    """Lateness of messages by their sender's clock, whose zero is arbitrary."""

    def __init__(self, late: float = 0.0) -> None:
        """Begin; ``late``: lateness of the sender before this one, given up as after a step [s]."""
        self.lead = -math.inf  # sender's clock over the one here, by the quickest message [s]
        self.stamp = -math.inf  # of the newest message, on the sender's clock [s]
        self.steps = 0  # how often that clock was set
        self._at, self._late = 0.0, late
        self._uncertain = self._recovers = self._interval = 0.0
        self._measured = 0  # messages of which the interval is averaged

    @property
    def is_known(self) -> bool:
        """Return True after the first message with a stamp."""
        return math.isfinite(self.stamp)

    def lateness(
        self, stamp: float, at: float, known: float = 0.0, sent: int = 0, *, is_set: bool = False
    ) -> float:
        """Lateness of a message against the quickest one so far, and at least ``known`` [s].

        It is at most that of the message before, plus the time since its arrival. After a step of
        the sender's clock nothing else is known: this bound is returned, and decays over
        :data:`RECOVERY`. A repeated stamp grows later with time.

        ``known``: age by a shared clock, 0 without one [s]; ``sent``: messages since the last one,
        0 where they are not numbered. Messages come in the order in which they were sent.
        """
        passed = max(at - self._at, 0.0) if self.is_known else 0.0
        lead = stamp - at
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
            # By the clock of the receiver, which no sender sets.
            self._measured += 1
            share = 1.0 / min(self._measured, _SMOOTHED)
            self._interval += share * (passed / sent - self._interval)
        # A falling delay delivers the messages in between; a clock that was set ahead does not.
        ahead = stamp - self.stamp - max(passed, _IRREGULAR * sent * self._interval)
        return regular and sent > 0 and self._late > STEP and ahead > STEP


class WallClock:
    """Wall clock; for :data:`RECOVERY` after it was set, each of its settings may be right."""

    def __init__(
        self, wall: Callable[[], float] = time.time, monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        self._wall, self._monotonic = wall, monotonic
        self._offset, self._read = wall() - monotonic(), monotonic()
        self._low = self._high = self._offset
        self._set = -math.inf

    def at(self, moment: float) -> tuple[float, float]:
        """Earliest and latest wall time that a moment of the monotonic clock may be [s]."""
        now = self._monotonic()
        offset = self._wall() - now
        # NTP slews by less than ten times the drift of a clock.
        if abs(offset - self._offset) > STEP + 10.0 * DRIFT * (now - self._read):
            self._low, self._high = min(self._low, self._offset), max(self._high, self._offset)
            self._set = now
        self._offset, self._read = offset, now
        if not self.is_recovering(now):
            self._low = self._high = offset
        return moment + min(offset, self._low), moment + max(offset, self._high)

    def is_recovering(self, now: float) -> bool:
        """Return True if the clock was set within :data:`RECOVERY`."""
        return now - self._set <= RECOVERY


class Lateness:
    """Age of the newest message of one sender; one thread."""

    def __init__(
        self,
        max_latency: float,
        wall: WallClock | None = None,
        *,
        uses_stamps: bool = True,
        late: float = 0.0,
    ) -> None:
        """Begin without messages.

        ``max_latency``: declared bound of the delay without a shared clock [s]; ``wall``: the clock
        that stamps are of, None if none is shared; ``late``: lateness of the sender before this one
        [s], not used with a shared clock; ``uses_stamps``: False where stamps do not advance as
        time does, as in simulations.
        """
        self._max_latency, self._wall, self._uses_stamps = max_latency, wall, uses_stamps
        self._clock = SenderClock(late if wall is None else 0.0)
        self._at, self.late, self._overtaken = -math.inf, 0.0, 0
        self.number: int | None = None  # of the newest message
        self.stamps = ARRIVAL
        self.repeated = False  # the newest message has the stamp of the one before it
        self.stepped = -math.inf  # when the sender's clock was last seen to be set

    def take(self, stamp: float | None, at: float, number: int | None = None) -> bool:
        """Record a message that arrived ``at``; False if it is older than the newest one.

        ParameterError: the stamp is no time, or later than now by a shared clock.
        """
        stamp = stamp if self._uses_stamps else None
        known = 0.0 if stamp is None else self._checked(stamp, at)
        if stamp is not None and number is None and 0.0 < self._clock.stamp - stamp < _REORDERED:
            self._overtaken += 1
            return False
        self.repeated = stamp == self._clock.stamp or (stamp is None and self._clock.is_known)
        if stamp is not None:
            steps = self._clock.steps
            sent = 0 if number is None or self.number is None else number - self.number
            is_set = self._overtaken >= _IN_A_ROW
            self.late = self._clock.lateness(stamp, at, known, sent, is_set=is_set)
            self.stamps = GROWTH if self._wall is None else SHARED
            self.stepped = at if self._clock.steps > steps else self.stepped
        elif self.repeated:
            # A sender that omits its stamp may repeat itself.
            self.late = self._clock.lateness(self._clock.stamp, at)
        self._at = at
        self._overtaken = self._overtaken if self.repeated else 0
        self.number = self.number if number is None else number
        return True

    def _checked(self, stamp: float, at: float) -> float:
        """Age of a valid stamp by the shared clock, 0 without one [s]."""
        if not abs(stamp) <= _MAX_STAMP:
            expected = f"a finite time in seconds, {_MAX_STAMP:g} at most"
            raise ParameterError("stamp", f"{expected}, got {stamp:g}")
        if self._wall is None:
            return 0.0
        earliest, latest = self._wall.at(at)
        if stamp > earliest + SYNCHRONY:
            got = f"{stamp - earliest:.2f} s later than the clock here"
            raise ParameterError("stamp", f"a time that has been, got {got}")
        return max(latest - stamp, 0.0)

    def age(self, now: float) -> float:
        """Age by stamps and arrival [s]; inf before the first message."""
        return now - self._at + self.late

    def bound(self, now: float) -> float:
        """Upper bound of the age, where clocks and delay are as declared [s]."""
        return self.age(now) + self.margin

    @property
    def margin(self) -> float:
        """Part of the bound beyond the age [s]."""
        return SYNCHRONY if self.stamps == SHARED else self._max_latency

    def objection(self, now: float, limit: float) -> str:
        """Message with age and limit [s]; empty within the limit."""
        age = self.age(now)
        if age <= limit:
            return ""
        basis = "repeated stamp" if self.repeated else _BASIS[self.stamps]
        return f"{age:.2f} s old ({basis}), limit {limit:g} s"
