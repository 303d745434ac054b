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
    """Asks for all groups until there is an answer, in a separate thread."""

    def __init__(
        self, session: zenoh.Session, namespace: str, on_reply: Callable[[zenoh.Sample], None]
    ) -> None:
        """Begin; ``on_reply`` receives replies in that thread."""
        self._session, self._key, self._on_reply = session, f"{namespace}/v1/params", on_reply
        self._begun = time.monotonic()
        self._is_silent = True  # none is absent before the first request has ended
        self.is_answered = False  # set by the reader of the reply, or to end
        self.thread = threading.Thread(target=self._ask, name="parameters", daemon=True)

    def _ask(self) -> None:
        while not self.is_answered:
            try:
                replies = list(self._session.get(self._key, timeout=PERIOD))
            except zenoh.ZError:
                return  # the session is closed
            self._is_silent = bool(replies)  # a service exists, with an answer or without one
            for reply in replies:
                if reply.ok is not None:
                    self._on_reply(reply.ok)
            time.sleep(PERIOD)

    def missing(self, *, is_required: bool) -> tuple[str, str]:
        """Reason to stand, and flag; both "" where none is."""
        if self.is_answered or not (self._is_silent or is_required):
            return "", ""
        if is_required or time.monotonic() - self._begun < PATIENCE:
            return WAITING, _SILENT
        return "", _SILENT
