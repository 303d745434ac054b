"""The deciding process. :mod:`slopewise.services.guard.watchdog` starts and watches it.

One thread takes inputs and answers commands immediately; another reads maps and parameters, see
:mod:`slopewise.services.guard.service_updates`. Run as ``python -m slopewise.services.guard.worker
SETTINGS FD FD``.
"""

from __future__ import annotations

import gc
import logging
import math
import os
import socket
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import zenoh

from slopewise.models.errors import InputError, ParameterError
from slopewise.services.guard.core import Guard
from slopewise.services.guard.decide import GuardDecision, stop
from slopewise.services.guard.guard_map import read_guard_map
from slopewise.services.guard.guard_model import read_guard_model
from slopewise.services.guard.guard_session import Heartbeat, running
from slopewise.services.guard.input_feed import InputFeed
from slopewise.services.guard.service_updates import ServiceUpdates
from slopewise.services.guard.settings import GuardSettings, read_guard_settings
from slopewise.services.guard.zenoh_transport import GuardStatus, ZenohTransport
from slopewise.services.io.model_file import find_model
from slopewise.services.ros.inbox import Inbox, Received
from slopewise.services.wire import codec
from slopewise.services.wire.arrival import time_since_boot
from slopewise.services.wire.codec import Format

if TYPE_CHECKING:
    from slopewise.services.guard.ros_transport import RosTransport

_log = logging.getLogger("slopewise")

_STATUS_PERIOD = 1.0  # time between status messages [s]

_ORPHANED = 10.0
"""Time without a watchdog after which the process ends: until then it sends stops [s]."""

_MIN_DRAINING, _MAX_DRAINING = 0.1, 0.5
"""Limits of the time for which inputs are ignored after the process was held up [s].

They waited in sockets, and are read in less time than they took to come; sockets hold no more.
"""


class Worker:
    """A running guard."""

    def __init__(
        self, settings: GuardSettings, session: zenoh.Session, heartbeat: Heartbeat, memory: int
    ) -> None:
        model = read_guard_model(find_model(settings.model))
        known = read_guard_map(Path(settings.map)) if settings.map else None
        self.guard = Guard(settings, model, known)
        # The worker before this one had parameters of a service: what it has learned is unknown.
        self.guard.learned.required |= os.fstat(memory).st_size > 0
        self._settings, self._heartbeat = settings, heartbeat
        self._transport = _transport(settings, session)
        self._begun = self._reported = time.monotonic()
        self._ignored_until = -math.inf  # arrival until which inputs may have waited [s]
        space = settings.zenoh.namespace
        self._updates = ServiceUpdates(session, space, known, model.vehicle, memory)
        self._status = session.declare_publisher(
            f"{space}/v1/guard/status", congestion_control=zenoh.CongestionControl.DROP
        )

    def run(self, ended: threading.Event) -> None:
        """Decide until an event, or until the watchdog has been gone for some time."""
        self._updates.open()
        timing, due = self._settings.timing, time.monotonic()
        last, orphaned = time_since_boot(), math.inf
        while not ended.is_set():
            received = self._transport.inbox.take(tuple(self._transport.topics), due)
            begun = time.perf_counter()
            last = self._check_held_up(last)
            is_certain = time.monotonic() >= self._ignored_until
            commanded = is_certain and hand_over(self.guard, self._transport, received)
            self._updates.take(self.guard)
            # Once more: the machine may have slept while these were read.
            last, now = self._check_held_up(last), time.monotonic()
            is_silent = self._heartbeat.is_silent()
            if commanded or now >= due:
                due = now + timing.period
                decision = self._decision(now, is_silent)
                last, now = self._check_held_up(last), time.monotonic()
                if now < self._ignored_until:  # while it was decided: its inputs are void
                    decision = self._decision(now, is_silent)
                self._transport.send(decision)
                if commanded:
                    self.guard.seconds.append(time.perf_counter() - begun)
            self._heartbeat.beat()
            if now - self._reported > _STATUS_PERIOD:
                self._report(now)
            orphaned = min(orphaned, now) if self._heartbeat.gone else math.inf
            if now - orphaned > _ORPHANED:
                return

    def close(self) -> None:
        """Send a final stop, and unsubscribe."""
        self._transport.send(stop("the guard is leaving"))
        self._updates.close()
        self._transport.close()

    def _check_held_up(self, last: float) -> float:
        """Time since boot; discard inputs if that is long after the last one [s]."""
        since_boot = time_since_boot()
        if (held_up := since_boot - last) > self._settings.timing.stall:
            # What comes now may have waited as long, and looks new.
            self.guard.forget(held_up)
            self._ignored_until = time.monotonic() + min(max(_MIN_DRAINING, held_up), _MAX_DRAINING)
            is_void = held_up > self.guard.maps.deadline
            self._updates.distrust(self._ignored_until, is_void=is_void)
        return since_boot

    def _decision(self, now: float, is_silent: bool) -> GuardDecision:
        try:
            return self.guard.decision(now, "the watchdog is silent" if is_silent else "")
        except Exception:  # noqa: BLE001 - logged, and a stop: without a decision nothing passes
            _log.exception("no decision on a command")
            self.guard.counters["faults"] += 1
            return stop("fault of the guard, see its log")

    def _report(self, now: float) -> None:
        self._reported = now
        refused = [f"{t}: {reason}" for t, reason in sorted(self._transport.inbox.refused.items())]
        status = GuardStatus(
            uptime=now - self._begun,
            reaction=self._settings.timing.reaction,
            counters=dict(self.guard.counters),
            ages=self.guard.ages(now),
            seconds=self.guard.times(),
            flags=[*self.guard.warnings(now), *refused],
            last=self.guard.last,
            stamps=self.guard.stamps(),
        )
        self._status.put(**codec.payload_of(status, Format.JSON))


def hand_over(
    guard: Guard, transport: ZenohTransport | RosTransport, received: dict[str, list[Received]]
) -> bool:
    """Read messages for the guard, a command with the newest motion; True if one is new."""
    commanded = False
    takers: dict[str, tuple[InputFeed[Any] | None, Callable[..., bool]]] = {
        "motion": (guard.motions, guard.move),
        "clear": (guard.clears, guard.clear),
        "command": (guard.commands, guard.commands.take),
        "confirm": (None, guard.confirm),
    }
    for topic, kind in transport.topics.items():
        feed, take = takers[kind]
        for item in received.get(topic, ()):
            try:
                value, *stamp = transport.read(topic, item)
                commanded |= take(value, item.at, *stamp) and kind == "command"
            except (InputError, ParameterError) as error:
                # An unreadable message makes the one before it void.
                if feed is not None:
                    feed.drop(at=item.at)
                transport.inbox.refuse(topic, str(error))
    return commanded


def _transport(settings: GuardSettings, session: zenoh.Session) -> ZenohTransport | RosTransport:
    if not settings.ros.enabled:
        return ZenohTransport(session, settings.zenoh.namespace, Inbox())
    from slopewise.services.guard.ros_transport import RosTransport

    return RosTransport(session, settings.ros)


def main() -> None:
    """Decide until a signal asks to end."""
    settings = read_guard_settings(Path(sys.argv[1]))
    heartbeat = Heartbeat(socket.socket(fileno=int(sys.argv[2])), settings.timing.stall)
    with running(settings) as (session, ended):
        worker = Worker(settings, session, heartbeat, int(sys.argv[3]))
        gc.collect()
        gc.freeze()
        gc.set_threshold(100_000, 50, 100)  # objects of a decision are freed by counting
        print("ready", flush=True)
        heartbeat.reset()
        worker.run(ended)
        worker.close()


if __name__ == "__main__":
    main()
