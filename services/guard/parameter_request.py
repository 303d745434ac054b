"""Parameters of the service that a guard begins with: requested, and stored for its successor.

Groups are published when they change; a guard that is started later has to ask for them. A router
answers immediately that there is no service; one that exists and is silent lets a request expire.
"""

from __future__ import annotations

import os
import threading
import time
import zlib
from collections.abc import Callable, Iterable

import msgspec
import zenoh

from slopewise.services.wire.parameter_messages import ParameterGroup

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


class ParameterMemory:
    """Accepted groups in an anonymous file that outlives the process that writes it."""

    def __init__(self, handle: int) -> None:
        self._handle = handle

    def store(self, groups: Iterable[ParameterGroup]) -> None:
        """Replace the content; a process that dies meanwhile leaves a wrong checksum."""
        raw = msgspec.msgpack.encode(list(groups))
        written = zlib.crc32(raw).to_bytes(4, "little") + raw
        os.pwrite(self._handle, written, 0)
        os.ftruncate(self._handle, len(written))

    def load(self) -> list[ParameterGroup] | None:
        """Stored groups; None where they are damaged."""
        written = os.pread(self._handle, os.fstat(self._handle).st_size, 0)
        if written and zlib.crc32(written[4:]).to_bytes(4, "little") != written[:4]:
            return None
        return msgspec.msgpack.decode(written[4:], type=list[ParameterGroup]) if written else []
