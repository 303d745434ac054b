"""Order and delay of messages that senders number and stamp; one rule for maps and observations.

A number that is not above the last one belongs to a duplicate, to a late message, or to a sender
that was restarted without a new ``instance``. The last is assumed after :data:`_MIN_RUN` rising
numbers that differ from recent messages and arrive at the pace of their time stamps, which late
messages do not. :data:`_MIN_RUN_ANY_PACE` rising numbers are accepted with any time stamps, so that
no number, however large, blocks a sender permanently. A number far ahead does not end the sequence
before it: messages that continue that one are accepted as well.

Time stamps are on the sender's clock, which may begin anywhere. A message that took longer than the
quickest one is late by the difference. The ``lead`` of a message is its stamp less its arrival [s].
"""

from __future__ import annotations

import math
import time
from collections import OrderedDict, deque
from collections.abc import Callable
from enum import Enum
from typing import TypeVar

from slopewise.services.wire.recent_warnings import RecentWarnings

_MIN_RUN = 3  # rising numbers after which a restart is assumed [1]: two may be late messages
_MIN_RUN_ANY_PACE = 10  # rising numbers after which it is assumed with any time stamps [1]
_FAR_AHEAD = 2**32  # step that no loss of messages explains [1]: 1.4 years at 100 Hz
_MAX_RUNS = 4  # rising runs that are followed at the same time [1]; bounds memory
_REMEMBERED_COUNT = 64  # messages in which a duplicate is recognised [1]; bounds memory
_MAX_PACE_ERROR = 2.0  # of stamps against arrivals in one run [s]: the jitter of a radio link
_MAX_INTERLEAVED = 8  # messages of the known count between two of a restarted one [1]
_MAX_DELAY = 60.0  # beyond the quickest message; from here a stamp is of a clock set back [s]
_MIN_AGREEING = 5  # consecutive stamps that agree with each other from which a clock was set [1]

MAX_ROBOT_SENDERS = 8
"""Senders of samples that are followed [1]; a robot has one or two."""

K = TypeVar("K")
V = TypeVar("V")


class MessageOrder(Enum):
    """Position of a message among those of its sender."""

    NEW = "new"
    DUPLICATE = "duplicate"
    OLDER = "out of order"
    RESTARTED = "restarted its count"
    FORKED = "uses two counts"

    @property
    def is_accepted(self) -> bool:
        """Return True unless the message is a duplicate or out of order."""
        return self not in (MessageOrder.DUPLICATE, MessageOrder.OLDER)


class SequenceTracker:
    """Numbers of one sender; one thread."""

    def __init__(self, last: int = -1) -> None:
        self.last = last  # number of the last accepted message, -1 before the first
        self._before_leap = -1
        self._runs: OrderedDict[int, tuple[int, float]] = OrderedDict()
        self._accepted_since_run = 0
        self._rising_count, self._rising_last = 0, -1
        self._recent: deque[int] = deque(maxlen=_REMEMBERED_COUNT)

    def classify(self, number: int, content: int, lead: float = 0.0) -> MessageOrder:
        """Order of a message; ``content``: a digest of it, without its time stamp."""
        if self.last < 0 or number > self.last:
            return MessageOrder.NEW
        if number == self.last or hash((number, content)) in self._recent:
            return MessageOrder.DUPLICATE
        if 0 <= self._before_leap < number:
            return MessageOrder.FORKED
        is_restarted = (
            self._extend_run(number, lead) >= _MIN_RUN or self._rising_count >= _MIN_RUN_ANY_PACE
        )
        return MessageOrder.RESTARTED if is_restarted else MessageOrder.OLDER

    def accept(self, number: int, content: int) -> None:
        """Record a message that was used."""
        if number > self.last:
            # A first leap may be forged: the count before it is remembered.
            has_leapt = 0 <= self.last < number - _FAR_AHEAD
            self._before_leap = self.last if has_leapt else self._before_leap
            self._accepted_since_run += 1
        else:
            self._before_leap, self._accepted_since_run, self._rising_count = -1, 0, 0
            self._runs.clear()
        self.last = number
        self._recent.append(hash((number, content)))

    def _extend_run(self, number: int, lead: float) -> int:
        """Length of the rising run that ends with this number."""
        if self._accepted_since_run > _MAX_INTERLEAVED:
            self._runs.clear()
            self._rising_count = 0
        self._accepted_since_run = 0
        is_rising = self._rising_count and number > self._rising_last
        self._rising_count = self._rising_count + 1 if is_rising else 1
        self._rising_last = number
        if number in self._runs:
            return self._runs[number][0]
        extended = [
            end
            for end, (_, run_lead) in self._runs.items()
            if end < number and abs(lead - run_lead) <= _MAX_PACE_ERROR
        ]
        length = 1 + (self._runs.pop(max(extended))[0] if extended else 0)
        self._runs[number] = (length, lead)
        while len(self._runs) > _MAX_RUNS:
            self._runs.popitem(last=False)
        return length


class StampVerdict(Enum):
    """Plausibility of a time stamp."""

    PLAUSIBLE = ""
    FUTURE = "future"
    LATE = "late"
    CLOCK_SET = "clock set"


class StampCheck:
    """Time stamps of one sender against the time that passes here; one thread."""

    def __init__(self) -> None:
        self._quickest = -math.inf
        self._outliers: list[float] = []

    def check(self, lead: float, early: float) -> StampVerdict:
        """Plausibility of a stamp; ``early``: lead over the quickest that is accepted [s].

        One of :data:`_MIN_AGREEING` stamps that agree sets the clock.
        """
        if self._quickest == -math.inf or -_MAX_DELAY <= lead - self._quickest <= early:
            self._quickest = max(self._quickest, lead)
            self._outliers = []
            return StampVerdict.PLAUSIBLE
        if self._outliers and abs(lead - self._outliers[-1]) > early:
            self._outliers = []
        self._outliers.append(lead)
        if len(self._outliers) >= _MIN_AGREEING:
            self._quickest, self._outliers = lead, []
            return StampVerdict.CLOCK_SET
        return StampVerdict.FUTURE if lead > self._quickest else StampVerdict.LATE

    def delay(self, lead: float) -> float:
        """Time by which a message took longer than the quickest one [s]."""
        return max(self._quickest - lead, 0.0) if math.isfinite(self._quickest) else 0.0


class SenderTable(OrderedDict[K, V]):
    """State by sender, bounded: the sender that was silent longest is dropped first."""

    def __init__(self, create: Callable[[], V], capacity: int) -> None:
        super().__init__()
        self._create, self._capacity = create, capacity

    def of(self, sender: K) -> V:
        """State of a sender, which sends now."""
        if sender not in self:
            self[sender] = self._create()
        self.move_to_end(sender)
        while len(self) > self._capacity:
            self.popitem(last=False)
        return self[sender]


def warn_of_order(
    warnings: RecentWarnings, what: str, order: MessageOrder, *, is_used: bool
) -> None:
    """Keep the warnings about a sender's count up to date; ``what``: as in "maps of camera"."""
    backwards = f"{what} count backwards: ignored"
    if order is MessageOrder.OLDER:
        warnings.add(backwards)
    elif is_used and order in (MessageOrder.RESTARTED, MessageOrder.FORKED):
        warnings.clear(backwards)
        warnings.add(f"{what}: the source {order.value}")


def time_since_boot() -> float:
    """Time since the machine was started [s]; unlike the monotonic clock, while it sleeps too."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


def time_asleep() -> float:
    """Time for which this machine has slept since its start, and the monotonic clock stood [s]."""
    return time_since_boot() - time.monotonic()
