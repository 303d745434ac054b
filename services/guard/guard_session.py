"""Priority, zenoh session and heartbeat of the two processes of the guard."""

from __future__ import annotations

import logging
import os
import signal
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import zenoh

from slopewise.models.errors import InputError
from slopewise.services.guard.settings import GuardSettings
from slopewise.services.settings.zenoh_session import ZenohSettings, zenoh_config

_log = logging.getLogger("slopewise")

_PRIORITY = 20  # above ordinary processes, below the kernel's threads at 50 [SCHED_RR, 1 … 99]
_CHUNK = 4096  # read in one call [bytes]


@contextmanager
def running(settings: GuardSettings) -> Iterator[tuple[zenoh.Session, threading.Event]]:
    """Session of a process with priority, and an event that a signal to end it sets.

    An InputError if no router answers, or zenoh refuses; a missing priority is logged.
    """
    ours, ended = settings.zenoh, threading.Event()
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(_PRIORITY))
    except (OSError, AttributeError):
        _log.warning("no priority: others on this machine may delay the guard")
    place = ZenohSettings(
        mode=ours.mode, connect=ours.connect, listen=ours.listen, config=ours.config
    )
    try:
        opened = zenoh.open(zenoh_config(place))
    except zenoh.ZError:
        where = ", ".join(ours.connect)
        raise InputError("zenoh", "connect", f"expected a router at {where}, got none") from None
    with opened as session:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: ended.set())
        yield session, ended


class Heartbeat:
    """One end of a pair of sockets: a byte each way, silence for ``stall`` [s] is a fault."""

    def __init__(self, link: socket.socket, stall: float) -> None:
        link.setblocking(False)
        self._link, self._stall = link, stall
        self.gone = False  # the other end is closed: its process has ended
        self.reset()

    def reset(self) -> None:
        """Restart the timeout: the other end has only just begun."""
        self._received = time.monotonic()

    def beat(self) -> None:
        """Send a byte; never blocks."""
        try:
            self._link.send(b".")
        except BlockingIOError:
            pass  # the other end does not read, and will be found silent
        except OSError:
            self.gone = True

    def is_silent(self) -> bool:
        """Return True if the other end has failed."""
        try:
            while self._link.recv(_CHUNK):
                self._received = time.monotonic()
            self.gone = True
        except BlockingIOError:
            pass  # all is read
        except OSError:
            self.gone = True
        return self.gone or time.monotonic() - self._received > self._stall
