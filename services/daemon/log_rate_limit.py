"""A bound of the log's growth: repeated records are counted, and written now and then."""

from __future__ import annotations

import logging
import time
from collections import OrderedDict

_INTERVAL = 10.0  # time between two records from one line of code [s]: some 1 MB a day for each
_MAX_LINES = 256  # lines of code that are remembered [1]; more than the package has log calls


class RateLimitFilter(logging.Filter):
    """Passes one record of each line of code per interval."""

    def __init__(self, interval: float = _INTERVAL) -> None:
        """Pass the first record of each line; ``interval`` [s]."""
        super().__init__()
        self._interval = interval
        self._last: OrderedDict[tuple[str, int], tuple[float, int]] = OrderedDict()

    def __len__(self) -> int:
        """Lines of code that are remembered."""
        return len(self._last)

    def filter(self, record: logging.LogRecord) -> bool:
        """Return True to write the record; it then includes how many were suppressed."""
        line, now = (record.pathname, record.lineno), time.monotonic()
        at, suppressed = self._last.get(line, (-self._interval, 0))
        if now - at < self._interval:
            self._last[line] = at, suppressed + 1
            return False
        if suppressed:
            record.msg, record.args = f"{record.getMessage()} (and {suppressed} like it)", ()
        self._last[line] = now, 0
        while len(self._last) > _MAX_LINES:
            self._last.popitem(last=False)
        return True
