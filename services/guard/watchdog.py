"""The watching process: it sends stops in place of the deciding one when that fails.

It imports little and decides nothing. Where both are killed together, or the machine fails,
nothing is sent any more: then the base's own timeout on commands has to act.
"""

from __future__ import annotations

import logging
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import zenoh

from slopewise.services.guard.decide import stop
from slopewise.services.guard.guard_map import read_guard_map
from slopewise.services.guard.guard_model import read_guard_model
from slopewise.services.guard.guard_session import Heartbeat, running
from slopewise.services.guard.settings import GuardSettings, read_guard_settings
from slopewise.services.guard.zenoh_transport import ZenohOutput
from slopewise.services.io.model_file import find_model

_log = logging.getLogger("slopewise")

_RESTART_AFTER = 1.0
"""Time between starts of the worker: one that cannot start must not use the processor [s]."""

_PATIENCE = 3.0  # time for the worker to end; then it is killed [s]


class Watchdog:
    """Starts the worker, watches it, and takes its place when it fails."""

    def __init__(self, settings: GuardSettings, config: Path, session: zenoh.Session) -> None:
        self._settings, self._config = settings, config
        self._output = _output(settings, session)
        self._memory = os.memfd_create("parameters")  # written once a worker has some
        self._start()

    def _start(self) -> None:
        self._begun = time.monotonic()
        self._link, theirs = socket.socketpair()
        command = [sys.executable, "-m", "slopewise.services.guard.worker", str(self._config)]
        handles = theirs.fileno(), self._memory
        self.worker = subprocess.Popen([*command, *map(str, handles)], pass_fds=handles)
        theirs.close()
        self._heartbeat = Heartbeat(self._link, self._settings.timing.stall)

    def run(self, ended: threading.Event) -> None:
        """Watch until an event."""
        period, was_silent = self._settings.timing.period, False
        while not ended.wait(0.5 * period):
            self._heartbeat.beat()
            is_silent = self._heartbeat.is_silent()
            if is_silent:
                self._output.send(stop("the guard does not answer"))
                if not was_silent:
                    _log.warning("the guard does not answer: the base is commanded to stop")
                self._restart_if_ended()
            was_silent = is_silent

    def _restart_if_ended(self) -> None:
        """Restart a worker that has ended; one that hangs gets time to recover."""
        status = self.worker.poll()
        if status is not None and time.monotonic() - self._begun > _RESTART_AFTER:
            _log.warning("the guard ended with status %s, and is restarted", status)
            self._link.close()
            self._start()

    def close(self) -> None:
        """End the worker, and send a final stop."""
        self.worker.terminate()
        try:
            self.worker.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self.worker.kill()
            self.worker.wait()
        self._output.send(stop("the guard is leaving"))


def _output(settings: GuardSettings, session: zenoh.Session) -> Any:
    if not settings.ros.enabled:
        return ZenohOutput(session, settings.zenoh.namespace, "watch")
    from slopewise.services.guard.ros_transport import RosOutput

    return RosOutput(session, settings.ros, f"{settings.ros.node}_watch")


def serve(config: Path, ready: Callable[[str, dict[str, object]], None]) -> None:
    """Guard until a signal asks to end; ``ready`` is called once it runs."""
    settings = read_guard_settings(config)
    # Files that cannot be read are reported before anything moves.
    read_guard_model(find_model(settings.model))
    if settings.map:
        read_guard_map(Path(settings.map))
    with running(settings) as (session, ended):
        watchdog = Watchdog(settings, config, session)
        reaction, guarded = settings.timing.reaction, settings.zenoh.namespace
        text = f"guards {guarded}; any single fault is a stop within {reaction:.2f} s"
        ready(text, {"guards": guarded, "reaction": reaction})
        watchdog.run(ended)
        watchdog.close()
