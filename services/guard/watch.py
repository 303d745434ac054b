"""The process that watches the one that decides, and says stop in its place when it fails.

It imports next to nothing and judges nothing. Where both are killed at once, or the machine fails,
nothing is sent any more: what is left is the base's own time-out on its commands.
"""

from __future__ import annotations

import logging
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import zenoh

from slopewise.services.guard.core import BaseWord
from slopewise.services.guard.decide import stop
from slopewise.services.guard.ground import read_ground
from slopewise.services.guard.heart import Heart
from slopewise.services.guard.model_reader import read_guard_model
from slopewise.services.guard.session import hurry, open_session
from slopewise.services.guard.settings import GuardSettings, model_path, read_guard_settings
from slopewise.services.guard.zenoh_wire import OutputWire

_log = logging.getLogger("slopewise")
_AGAIN = 1.0
_PATIENCE = 3.0


class Watch:
    """Begins the worker, watches it, and takes its place when it fails."""

    def __init__(self, settings: GuardSettings, config: Path, session: zenoh.Session) -> None:
        """Watch a worker with settings out of a file."""
        self._settings, self._config = settings, config
        self._stopped = threading.Event()
        self._output = _output(settings, session)
        self._begun = -float("inf")
        self._begin()

    def _begin(self) -> None:
        self._begun = time.monotonic()
        ours, theirs = socket.socketpair()
        words = [sys.executable, "-m", "slopewise.services.guard.worker", str(self._config)]
        self.worker = subprocess.Popen([*words, str(theirs.fileno())], pass_fds=(theirs.fileno(),))
        theirs.close()
        self._link = ours
        self._heart = Heart(ours, self._settings.timing.stall)

    def run(self, seconds: float | None = None) -> None:
        """Until told to end, or for so long."""
        period = self._settings.timing.period
        until = float("inf") if seconds is None else time.monotonic() + seconds
        told = False
        while not self._stopped.wait(0.5 * period) and time.monotonic() < until:
            self._heart.beat()
            silent = self._heart.silent()
            if silent:
                self._output.say(BaseWord(stop("the guard does not answer"), 0))
                if not told:
                    _log.warning("the guard does not answer: the base is told to stop")
                self._begin_again()
            told = silent

    def _begin_again(self) -> None:
        """A worker that has ended is begun anew; one that hangs gets time to come back."""
        since = time.monotonic() - self._begun
        if self.worker.poll() is not None and since > _AGAIN:
            _log.warning(
                "the guard ended with status %s, and is begun anew", self.worker.returncode
            )
            self._link.close()
            self._begin()

    def end(self) -> None:
        """Let :meth:`run` return."""
        self._stopped.set()

    def close(self) -> None:
        """End the worker, and say stop once more."""
        self.worker.terminate()
        try:
            self.worker.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self.worker.kill()
            self.worker.wait()
        self._output.say(BaseWord(stop("the guard is leaving"), 0))


def _output(settings: GuardSettings, session: zenoh.Session) -> Any:
    if not settings.ros.enabled:
        return OutputWire(session, settings.zenoh.namespace, "watch")
    from slopewise.services.guard.ros_wire import RosOutput

    return RosOutput(session, settings.ros, f"{settings.ros.node}_watch")


def serve(
    config: Path, seconds: float | None, ready: Callable[[str, dict[str, object]], None]
) -> None:
    """Guard until a signal asks to end, or for so long; once it does, `ready` is told.

    Raises:
        InputError: settings, a file named in them, or nobody is where they point.
    """
    settings = read_guard_settings(config)
    read_guard_model(model_path(settings))  # what cannot be read is said before anything moves
    if settings.map:
        read_ground(Path(settings.map))
    if not hurry():
        _log.warning("no priority: others on this machine may delay the guard")
    with open_session(settings) as session:
        watch = Watch(settings, config, session)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: watch.end())
        reaction = settings.timing.reaction
        guarded = settings.zenoh.namespace
        words = f"guards {guarded}; any single fault is a stop within {reaction:.2f} s"
        ready(words, {"guards": guarded, "reaction": reaction})
        watch.run(seconds)
        watch.close()
