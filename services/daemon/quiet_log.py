"""A log that nobody fills: what is said again and again is said now and then, with how often."""

from __future__ import annotations

import logging
import time
from collections import OrderedDict

_EVERY = 10.0
_MOST = 256


class NowAndThen(logging.Filter):
    """Lets one record of a kind through in so many seconds; a kind is a line of code."""

    def __init__(self, seconds: float = _EVERY) -> None:
        """Let the first of each through."""
        super().__init__()
        self._seconds = seconds
        self._last: OrderedDict[tuple[str, int], tuple[float, int]] = OrderedDict()

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether to say it; the one that is said tells how many were not."""
        kind, now = (record.pathname, record.lineno), time.monotonic()
        at, left_out = self._last.get(kind, (-self._seconds, 0))
        if now - at < self._seconds:
            self._last[kind] = at, left_out + 1
            return False
        if left_out:
            record.msg, record.args = f"{record.getMessage()} (and {left_out} like it)", ()
        self._last[kind] = now, 0
        while len(self._last) > _MOST:
            self._last.popitem(last=False)
        return True
