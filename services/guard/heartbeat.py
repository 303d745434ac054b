"""Liveness of two processes that watch each other: a byte each way, silence is a fault."""

from __future__ import annotations

import contextlib
import socket
import time

_CHUNK = 4096  # bytes that are read in one call [1]


class Heartbeat:
    """One end of a pair of sockets.

    Attributes:
        gone: the other end is closed: its process has ended.
    """

    def __init__(self, link: socket.socket, stall: float) -> None:
        """Watch a link; silence for longer than ``stall`` is a fault [s]."""
        link.setblocking(False)
        self._link, self._stall = link, stall
        self.gone = False
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
        with contextlib.suppress(BlockingIOError):
            while len(self._receive()) == _CHUNK:
                pass
        return self.gone or time.monotonic() - self._received > self._stall

    def _receive(self) -> bytes:
        try:
            data = self._link.recv(_CHUNK)
        except BlockingIOError:
            raise
        except OSError:
            data = b""
        if data:
            self._received = time.monotonic()
        else:
            self.gone = True
        return data
