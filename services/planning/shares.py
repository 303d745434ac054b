"""Who has had how much of the planner's time lately, and which clients drive.

A client is known by the name in its questions: zenoh does not say over which session one came.
Names that were never answered share one account, so that a new name for each question gains
nothing; a client that is answered again and again drives, and does not wait for those that do not.
"""

from __future__ import annotations

import math
import threading
import time
from collections import OrderedDict

_FORGETS = 5.0
_DRIVES_FROM = 3
_DRIVES_FOR = 10.0
_MOST_NAMES = 256
NEWCOMERS = "\x00"
"""Account of all names that were never answered; none that comes over the wire."""


class _Account:
    __slots__ = ("answered", "at", "heard", "used")

    def __init__(self) -> None:
        self.used = 0.0
        self.at = self.heard = time.monotonic()
        self.answered = 0


class Shares:
    """Accounts by name; may be asked from several threads."""

    def __init__(self) -> None:
        """Nobody had anything."""
        self._accounts: OrderedDict[str, _Account] = OrderedDict({NEWCOMERS: _Account()})
        self._lock = threading.Lock()

    def used(self, client: str) -> float:
        """Time that a client, or those it shares with, had lately [s]."""
        with self._lock:
            one = self._of(client)
            return one.used * math.exp((one.at - time.monotonic()) / _FORGETS)

    def charge(self, client: str, seconds: float) -> None:
        """A client had so much more time [s]."""
        with self._lock:
            one, now = self._of(client), time.monotonic()
            one.used = one.used * math.exp((one.at - now) / _FORGETS) + seconds
            one.at = now

    def answered(self, client: str) -> None:
        """A client got an answer that it can drive by."""
        with self._lock:
            one = self._accounts.pop(client, None) or _Account()
            now = time.monotonic()
            one.answered = 1 if now - one.heard > _DRIVES_FOR else one.answered + 1
            one.heard = now
            self._accounts[client] = one
            while len(self._accounts) > _MOST_NAMES:
                self._accounts.pop(next(n for n in self._accounts if n != NEWCOMERS))

    def drives(self, client: str) -> bool:
        """Whether a client with a name was answered several times, and just lately."""
        if not client:
            return False
        with self._lock:
            one = self._accounts.get(client)
            return (
                one is not None
                and one.answered >= _DRIVES_FROM
                and time.monotonic() - one.heard < _DRIVES_FOR
            )

    def _of(self, client: str) -> _Account:
        return self._accounts.get(client) or self._accounts[NEWCOMERS]
