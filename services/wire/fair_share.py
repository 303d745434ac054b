"""Processor time that senders used recently, and which clients are driving.

A sender is known by the name in its messages only: zenoh does not report the session of a message.
Names that were never answered share one account, so that a new name for each request gains nothing.
"""

from __future__ import annotations

import math
import threading
import time
from collections import OrderedDict

_DECAY_TIME = 5.0
"""Time in which used time decays to a share of 1/e [s]: some dozens of a robot's cycles."""

_DRIVING_FROM = 3
"""Answers after which a client is driving [1]: names used for one request have none."""

_DRIVING_FOR = 10.0
"""Time since the last answer after which a client is no longer driving [s]."""

_MAX_NAMES = 256
"""Accounts with a name [1]; bounds memory. Those answered longest ago are closed first."""

NEWCOMERS = "\x00"
"""Account of all names that were never answered; no valid name on the wire."""


class _Account:
    __slots__ = ("answer_count", "answered_at", "charged_at", "used")

    def __init__(self) -> None:
        self.used, self.answer_count = 0.0, 0
        self.charged_at = self.answered_at = time.monotonic()


class FairShare:
    """Accounts by name; may be used from several threads."""

    def __init__(self) -> None:
        """Begin with the account of newcomers."""
        self._accounts: OrderedDict[str, _Account] = OrderedDict({NEWCOMERS: _Account()})
        self._lock = threading.Lock()

    def account_of(self, sender: str) -> str:
        """Name of a sender's account."""
        return sender if sender in self._accounts else NEWCOMERS

    def used(self, sender: str, now: float) -> float:
        """Time that a sender, or those that share its account, used recently [s]; ``now``: [s]."""
        with self._lock:
            account = self._of(sender)
            return account.used * math.exp((account.charged_at - now) / _DECAY_TIME)

    def charge(self, sender: str, seconds: float) -> None:
        """Add time to a sender's account [s]."""
        with self._lock:
            account, now = self._of(sender), time.monotonic()
            decay = math.exp((account.charged_at - now) / _DECAY_TIME)
            account.used, account.charged_at = account.used * decay + seconds, now

    def note_answer(self, sender: str) -> None:
        """Record that a sender was answered in time."""
        with self._lock:
            account = self._accounts.pop(sender, None) or _Account()
            now = time.monotonic()
            is_interrupted = now - account.answered_at > _DRIVING_FOR
            account.answer_count = 1 if is_interrupted else account.answer_count + 1
            account.answered_at = now
            self._accounts[sender] = account
            while len(self._accounts) > _MAX_NAMES:
                self._accounts.pop(next(n for n in self._accounts if n != NEWCOMERS))

    def is_driving(self, sender: str) -> bool:
        """Return True if a named client was answered several times, and recently."""
        with self._lock:
            account = self._accounts.get(sender) if sender else None
            return (
                account is not None
                and account.answer_count >= _DRIVING_FROM
                and time.monotonic() - account.answered_at < _DRIVING_FOR
            )

    def _of(self, sender: str) -> _Account:
        return self._accounts.get(sender) or self._accounts[NEWCOMERS]
