"""The process that decides. It is begun by the one that watches it,
:mod:`slopewise.services.guard.watch`.

One thread takes what came and answers a command at once; another reads maps and parameters, see
:mod:`slopewise.services.guard.updates`. Run as ``python -m slopewise.services.guard.worker SETTINGS
FD``.
"""

from __future__ import annotations

import gc
import logging
import signal
import socket
import sys
import threading
import time
from pathlib import Path

import zenoh

from slopewise.services.guard.core import BaseWord, Guard
from slopewise.services.guard.decide import stop
from slopewise.services.guard.ground import read_ground
from slopewise.services.guard.heart import Heart
from slopewise.services.guard.messages import GuardStatus
from slopewise.services.guard.model_reader import read_guard_model
from slopewise.services.guard.session import hurry, open_session
from slopewise.services.guard.settings import GuardSettings, model_path, read_guard_settings
from slopewise.services.guard.updates import Updates
from slopewise.services.guard.zenoh_wire import Wire, ZenohWire
from slopewise.services.ros.inbox import Inbox
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format

_log = logging.getLogger("slopewise")
_STATUS = 1.0
_ORPHAN = 10.0
_RESUMES = 0.1
"""After it was held up, what waited in sockets is let pass for so long [s]."""


class Worker:
    """A running guard."""

    def __init__(self, settings: GuardSettings, session: zenoh.Session, heart: Heart) -> None:
        """Read the model, meet the others."""
        model = read_guard_model(model_path(settings))
        known = read_ground(Path(settings.map)) if settings.map else None
        self.guard = Guard(settings, model, known)
        self._settings, self._session, self._heart = settings, session, heart
        self._wire = _wire(settings, session)
        self._begun = self._told = time.monotonic()
        self._stopped = threading.Event()
        space = settings.zenoh.namespace
        self._updates = Updates(session, space, known)
        self._status = session.declare_publisher(
            f"{space}/v1/guard/status", congestion_control=zenoh.CongestionControl.DROP
        )

    def run(self) -> None:
        """Until told to end, or until nobody watches any more."""
        self._updates.open()
        period, due = self._settings.timing.period, time.monotonic()
        orphaned: float | None = None
        last, deaf = time.monotonic(), 0.0
        while not self._stopped.is_set():
            found = self._wire.inbox.take(self._wire.topics, due)
            begun = time.perf_counter()
            now = time.monotonic()
            if now - last > self._settings.timing.stall:
                # It was held up: what comes now may have waited as long, and looks new.
                self.guard.forget()
                deaf = now + _RESUMES
            commanded = now >= deaf and self._wire.take(self.guard, found)
            self._updates.take(self.guard)
            now = last = time.monotonic()
            silent = self._heart.silent()
            if commanded or now >= due:
                due = now + period
                self._wire.say(self._word(now, silent))
                if commanded:
                    self.guard.seconds.append(time.perf_counter() - begun)
            self._heart.beat()
            if now - self._told > _STATUS:
                self._tell(now)
            orphaned = (orphaned or now) if self._heart.gone else None
            if orphaned is not None and now - orphaned > _ORPHAN:
                return

    def end(self) -> None:
        """Let :meth:`run` return."""
        self._stopped.set()

    def close(self) -> None:
        """Say stop once more, and leave."""
        self._wire.say(BaseWord(stop("the guard is leaving"), 0))
        self._updates.close()
        self._wire.close()

    def _word(self, now: float, silent: bool) -> BaseWord:
        try:
            return self.guard.word(now, "whoever watches the guard is silent" if silent else "")
        except Exception:  # noqa: BLE001 - logged, and a stop: what cannot be judged is not passed
            _log.exception("a command could not be judged")
            self.guard.counters["faults"] += 1
            return BaseWord(stop("fault of the guard, see its log"), 0)

    def _tell(self, now: float) -> None:
        self._told = now
        refused = [f"{t}: {why}" for t, why in sorted(self._wire.inbox.refused.items())]
        status = GuardStatus(
            uptime=now - self._begun,
            reaction=self._settings.timing.reaction,
            counters=dict(self.guard.counters),
            ages=self.guard.ages(now),
            seconds=self.guard.times(),
            flags=[*self.guard.flags(now), *refused],
            last=self.guard.last,
            stamps=self.guard.stamps(),
        )
        encoding = codec.encoding_of(GuardStatus, Format.JSON)
        self._status.put(codec.encode(status, Format.JSON), encoding=encoding)


def _wire(settings: GuardSettings, session: zenoh.Session) -> Wire:
    if not settings.ros.enabled:
        return ZenohWire(session, settings.zenoh.namespace, Inbox())
    from slopewise.services.guard.ros_wire import RosWire

    return RosWire(session, settings.ros)


def main() -> None:
    """Decide until told to end."""
    settings = read_guard_settings(Path(sys.argv[1]))
    link = socket.socket(fileno=int(sys.argv[2]))
    heart = Heart(link, settings.timing.stall)
    if not hurry():
        _log.warning("no priority: others on this machine may delay the guard")
    with open_session(settings) as session:
        worker = Worker(settings, session, heart)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: worker.end())
        gc.collect()
        gc.freeze()
        gc.set_threshold(100_000, 50, 100)  # what is made for a command is freed by counting
        print("ready", flush=True)
        heart.reset()
        worker.run()
        worker.close()


if __name__ == "__main__":
    main()
