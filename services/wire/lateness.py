"""Age of the newest message of a sender: from its stamp where clocks are shared, else from arrival.

A constant delay that no shared clock shows cannot be seen by a receiver: a declared bound of it is
added to every age that is used for a stop. What can be seen of it without a shared clock is growth:
:meth:`slopewise.services.wire.sender_clock.SenderClock.lateness`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import NamedTuple

from slopewise.models.errors import ParameterError
from slopewise.services.wire.sender_clock import DRIFT, RECOVERY, STEP, SenderClock

SYNCHRONY = 0.02
"""Shared clocks agree within that, with NTP on one network [s]; added to every age by stamps."""

_REORDERED = 1.0
"""Without a number, a stamp that is earlier by less is of a message that was overtaken [s]."""

_IN_A_ROW = 3
"""Overtaken messages in a row from which on the clock was set back [1]."""

_LATEST_STAMP = 1e11
"""Largest stamp of any clock: one beyond has another unit, or is too coarse [s]."""

SHARED, GROWTH, ARRIVAL = "shared clock", "growth only", "none"
"""What stamps are good for, as the status reports it."""

_BASIS = {SHARED: "stamp", GROWTH: "arrival and growth of delay", ARRIVAL: "arrival"}


class WallTime(NamedTuple):
    """Wall clock at one moment [s]: the latest and the earliest that it may be."""

    latest: float
    earliest: float


class WallClock:
    """Wall time at moments of the monotonic clock.

    For :data:`RECOVERY` seconds after the wall clock was set, each of its settings is possible.
    """

    def __init__(
        self, wall: Callable[[], float] = time.time, monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        """Read the two clocks [s]."""
        self._wall, self._monotonic = wall, monotonic
        self._offset, self._read = wall() - monotonic(), monotonic()
        self._low = self._high = self._offset
        self._set = -math.inf

    def at(self, moment: float) -> WallTime:
        """Wall time at a moment of the monotonic clock [s]."""
        now = self._monotonic()
        offset = self._wall() - now
        # NTP slews by less than ten times the drift of a clock.
        if abs(offset - self._offset) > STEP + 10.0 * DRIFT * (now - self._read):
            self._low, self._high = min(self._low, self._offset), max(self._high, self._offset)
            self._set = now
        self._offset, self._read = offset, now
        if not self.is_recovering(now):
            self._low = self._high = offset
        return WallTime(moment + max(offset, self._high), moment + min(offset, self._low))

    def is_recovering(self, now: float) -> bool:
        """Return True if the clock was set lately; ``now``: monotonic [s]."""
        return now - self._set <= RECOVERY


class Lateness:
    """Age of the newest message of one sender; one thread.

    Attributes:
        stamps: :data:`SHARED`, :data:`GROWTH` or :data:`ARRIVAL`.
        number: number of the newest message; None: it has none.
        repeated: the newest message has the stamp of the one before it.
        stepped: when the sender's clock was last seen to be set, monotonic [s].
    """

    def __init__(
        self,
        max_latency: float,
        wall: WallClock | None = None,
        *,
        uses_stamps: bool = True,
        late: float = 0.0,
    ) -> None:
        """Begin.

        Args:
            max_latency: declared bound of the delay that no shared clock shows [s].
            wall: the clock that stamps are of; None: no clock is shared.
            late: lateness of the sender before this one [s]; not used with a shared clock.
            uses_stamps: False where they do not advance as time does, as in simulations.
        """
        self._max_latency, self._wall, self._uses_stamps = max_latency, wall, uses_stamps
        self._clock = SenderClock(late if wall is None else 0.0)
        self._at, self.late, self._overtaken = -math.inf, 0.0, 0
        self.number: int | None = None
        self.stamps, self.repeated, self.stepped = ARRIVAL, False, -math.inf

    def take(self, stamp: float | None, at: float, number: int | None = None) -> bool:
        """Record a message; False if it is older than the newest one.

        Args:
            stamp: on the sender's clock [s]; None: it has none. at: its arrival, monotonic [s].
            number: counts the messages of the sender; None: they are not numbered.

        Raises:
            ParameterError: the stamp is no time, or later than now by a shared clock.
        """
        stamp, known = stamp if self._uses_stamps else None, 0.0
        if stamp is not None:
            known = self._checked(stamp, at)
            if number is None and 0.0 < self._clock.stamp - stamp < _REORDERED:
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
        self._at, self._overtaken = at, self._overtaken if self.repeated else 0
        self.number = self.number if number is None else number
        return True

    def _checked(self, stamp: float, at: float) -> float:
        """Age by the shared clock, 0 without one [s]."""
        if not abs(stamp) <= _LATEST_STAMP:
            expected = f"a finite time in seconds, {_LATEST_STAMP:g} at most"
            raise ParameterError("stamp", f"{expected}, got {stamp:g}")
        if self._wall is None:
            return 0.0
        wall = self._wall.at(at)
        if stamp > wall.earliest + SYNCHRONY:
            ahead = stamp - wall.earliest
            raise ParameterError(
                "stamp", f"a time that has been, got {ahead:.2f} s later than the clock here"
            )
        return max(wall.latest - stamp, 0.0)

    def age(self, now: float) -> float:
        """Age as far as stamps and arrival show it; inf before the first message [s]."""
        return now - self._at + self.late

    def bound(self, now: float) -> float:
        """Age that is not exceeded, if clocks or delay are as declared [s]."""
        return self.age(now) + self.margin

    @property
    def margin(self) -> float:
        """Part of the bound that no stamp shows [s]."""
        return SYNCHRONY if self.stamps == SHARED else self._max_latency

    def objection(self, now: float, limit: float) -> str:
        """Age and limit as text [s], empty within the limit."""
        age = self.age(now)
        if age <= limit:
            return ""
        basis = "repeated stamp" if self.repeated else _BASIS[self.stamps]
        return f"{age:.2f} s old ({basis}), limit {limit:g} s"
