"""Two processes that watch each other: a byte each way, again and again; silence is a fault."""

from __future__ import annotations

import contextlib
import socket
import time


class Heart:
    """One end of a pair of sockets.

    Attributes:
        gone: the other end is closed: its process has ended.
    """

    def __init__(self, link: socket.socket, stall: float) -> None:
        """``stall``: silence for so long is a fault [s]."""
        link.setblocking(False)
        self._link, self._stall = link, stall
        self._heard = time.monotonic()
        self.gone = False

    def beat(self) -> None:
        """Say that this end lives; never waits."""
        try:
            self._link.send(b".")
        except BlockingIOError:
            pass  # the other end does not read, and will be found silent
        except OSError:
            self.gone = True

    def silent(self) -> bool:
        """Whether the other end has failed."""
        with contextlib.suppress(BlockingIOError):
            while data := self._receive():
                self._heard = time.monotonic()
                if len(data) < 4096:
                    break
        return self.gone or time.monotonic() - self._heard > self._stall

    def _receive(self) -> bytes:
        try:
            data = self._link.recv(4096)
        except BlockingIOError:
            raise
        except OSError:
            data = b""
        if not data:
            self.gone = True
        return data

    def reset(self) -> None:
        """Count anew from now: the other end has only just begun."""
        self._heard = time.monotonic()
