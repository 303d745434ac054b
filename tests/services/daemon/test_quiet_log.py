from __future__ import annotations

import logging

from slopewise.services.daemon.log_rate_limit import RateLimitFilter


def said(log: RateLimitFilter, line: int, words: str) -> str | None:
    record = logging.LogRecord("slopewise", logging.INFO, "file.py", line, "%s", (words,), None)
    return record.getMessage() if log.filter(record) else None


def test_what_is_said_again_and_again_is_said_once_and_counted() -> None:
    log = RateLimitFilter(seconds=60.0)
    assert [said(log, 1, str(n)) for n in range(4)] == ["0", None, None, None]
    assert said(log, 2, "another") == "another"
    log._seconds = 0.0
    assert said(log, 1, "later") == "later (and 3 like it)"


def test_it_remembers_no_end_of_lines() -> None:
    log = RateLimitFilter()
    for line in range(1000):
        said(log, line, "x")
    assert len(log._last) <= 256
