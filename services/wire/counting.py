"""Which messages of a source that counts them are new, also after the source began anew.

A number that is not above the last one is a duplicate, comes late, or is of a source that was
started anew without calling itself anew. The last is believed once a few in a row go up, differ
from what was heard lately, and come at the pace of their own time stamps; late ones do not. Ten in
a row are accepted with any time stamps: no number, however huge, silences a source permanently. A
number far ahead does not end the count before it: whoever goes on with that one is heard as well.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from enum import Enum

_IN_A_ROW = 3
"""So many numbers that go up are a count begun anew."""

_IN_A_ROW_ANYHOW = 10
"""So many that go up are one even if its time stamps do not advance as time does."""

_FAR_AHEAD = 2**32
_MOST_BEGUN = 4
_REMEMBERED = 64
_AGREE = 2.0
_BETWEEN = 8
"""So many messages of the known count may come between two of one begun anew."""


class MessageOrder(Enum):
    """What a message is beside those heard before."""

    NEW = "new"
    DUPLICATE = "duplicate"
    OLDER = "out of order"
    ANEW = "counts anew"
    TWICE = "counts twice"

    @property
    def taken(self) -> bool:
        """Whether the message counts."""
        return self not in (MessageOrder.DUPLICATE, MessageOrder.OLDER)


class Count:
    """One source's numbers; one thread.

    Attributes:
        last: number of the last message that counted, -1 before the first.
    """

    def __init__(self, last: int = -1) -> None:
        """Go on after a number."""
        self.last = last
        self._before = -1
        self._begun: OrderedDict[int, tuple[int, float]] = OrderedDict()
        self._since = 0
        self._rising, self._rose_to = 0, -1
        self._heard: deque[int] = deque(maxlen=_REMEMBERED)

    def judge(self, number: int, content: int, lead: float = 0.0) -> MessageOrder:
        """What a message is.

        Args:
            number: of the message. content: a digest of it, without its time stamp.
            lead: its time stamp less its arrival, 0 where it has none [s].
        """
        if self.last < 0 or number > self.last:
            return MessageOrder.NEW
        if number == self.last or hash((number, content)) in self._heard:
            return MessageOrder.DUPLICATE
        if 0 <= self._before < number:
            return MessageOrder.TWICE
        goes_on = self._goes_on(number, lead) >= _IN_A_ROW or self._rising >= _IN_A_ROW_ANYHOW
        return MessageOrder.ANEW if goes_on else MessageOrder.OLDER

    def take(self, number: int, content: int) -> None:
        """A message counted."""
        if number > self.last:
            # A first leap may be a lie: the count before it is remembered.
            leapt = 0 <= self.last < number - _FAR_AHEAD
            self._before = self.last if leapt else self._before
            self._since += 1
        else:
            self._before, self._since, self._rising = -1, 0, 0
            self._begun.clear()
        self.last = number
        self._heard.append(hash((number, content)))

    def _goes_on(self, number: int, lead: float) -> int:
        """How many numbers in a row went up to this one."""
        if self._since > _BETWEEN:
            self._begun.clear()
            self._rising = 0
        self._since = 0
        self._rising = self._rising + 1 if self._rising and number > self._rose_to else 1
        self._rose_to = number
        if number in self._begun:
            return self._begun[number][0]
        before = [
            n for n, (_, other) in self._begun.items() if n < number and abs(lead - other) <= _AGREE
        ]
        count = 1
        if before:
            count += self._begun.pop(max(before))[0]
        self._begun[number] = (count, lead)
        while len(self._begun) > _MOST_BEGUN:
            self._begun.popitem(last=False)
        return count
