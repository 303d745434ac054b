"""Parameters of the service that a guard begins with.

Groups are published when they change; a guard that is started later has to ask for them. A router
answers immediately that there is no service; one that exists and is silent lets a request expire.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import zenoh

PATIENCE = 3.0
"""Time from the start for which the vehicle stands until a service has answered [s]; a busy one
answers within a second."""

PERIOD = 1.0  # after which a request expires, and between two [s]

WAITING = "waiting for the parameters of the service"
_SILENT = "the service does not answer for its parameters"


class ParameterRequest:
    """Asks for all groups until there is an answer, without waiting for it."""

    def __init__(
        self, session: zenoh.Session, namespace: str, on_reply: Callable[[zenoh.Sample], None]
    ) -> None:
        """Begin; ``on_reply`` receives a reply in one of zenoh's threads."""
        self._session, self._key, self._on_reply = session, f"{namespace}/v1/params", on_reply
        self._begun, self._due = time.monotonic(), -1.0
        self._lock = threading.Lock()
        self._is_pending = False
        self._is_silent = True  # none is absent before the first request has ended
        self.is_answered = False  # set by the reader of the reply

    def ask(self) -> None:
        """Ask again where that is due."""
        now = time.monotonic()
        with self._lock:
            if self.is_answered or self._is_pending or now < self._due:
                return
            self._is_pending, self._due = True, now + PERIOD
        silent: list[bool] = []

        def take(reply: zenoh.Reply) -> None:
            silent.append(True)  # a service exists, with an answer or without one
            if reply.ok is not None:
                self._on_reply(reply.ok)

        def end() -> None:
            with self._lock:
                self._is_pending, self._is_silent = False, bool(silent)

        handler = zenoh.handlers.Callback(take, end)
        self._session.get(self._key, handler=handler, timeout=PERIOD)

    def missing(self, *, is_required: bool) -> tuple[str, str]:
        """Reason to stand, and flag; both "" where none is."""
        with self._lock:
            if self.is_answered or not (self._is_silent or is_required):
                return "", ""
        if is_required or time.monotonic() - self._begun < PATIENCE:
            return WAITING, _SILENT
        return "", _SILENT
