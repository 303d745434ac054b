"""Updates of the map over zenoh: a bounded queue, and one thread that takes them up in order."""

from __future__ import annotations

import logging
import threading
import time
from collections import Counter, deque
from typing import Any

import zenoh

from slopewise.models.errors import InputError
from slopewise.services.planning import glance
from slopewise.services.planning.map_store import MapStore
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire import codec
from slopewise.services.wire.messages import MapUpdate

_log = logging.getLogger("slopewise")

_MOST_MAPS = 16
"""Map updates that may wait; one more is lost, counted and flagged."""

_PATIENCE = 2.0


class MapEndpoint:
    """Takes up what comes, one after the other."""

    def __init__(self, config: ServiceConfig, maps: MapStore, counters: Counter[str]) -> None:
        """Keep ``maps`` up to date."""
        self._maps, self._counters = maps, counters
        self._key, self._most = config.key("map"), config.sizes.map_bytes
        self._waiting: deque[tuple[float, zenoh.Sample]] = deque()
        self._news = threading.Condition()
        self._closed = False
        self._thread = threading.Thread(target=self._work, name="maps", daemon=True)

    def open(self) -> None:
        """Begin to work."""
        self._thread.start()

    def declare(self, session: zenoh.Session) -> Any:
        """Let updates in; what has to be undeclared in the end."""
        return session.declare_subscriber(self._key, self._on_map)

    def close(self) -> None:
        """Leave alone what waits."""
        with self._news:
            self._closed = True
            self._news.notify_all()
        self._thread.join(_PATIENCE)

    def _on_map(self, sample: zenoh.Sample) -> None:
        """In zenoh's threads."""
        with self._news:
            if len(self._waiting) < _MOST_MAPS:
                self._waiting.append((time.monotonic(), sample))
                self._news.notify()
                return
        self._counters["map_updates_lost"] += 1
        self._maps.lose()

    def _work(self) -> None:
        while True:
            with self._news:
                while not self._waiting and not self._closed:
                    self._news.wait()
                if self._closed:
                    return
                arrived, sample = self._waiting.popleft()
            try:
                update = codec.decode(
                    MapUpdate, sample.payload, str(sample.encoding), self._key, self._most
                )
                taken = self._maps.take(update, self._key, arrived)
            except InputError as error:
                self._counters["map_updates_refused"] += 1
                _log.warning("%s", error)
                self._refuse(sample, f"{error.field}: {error.expected}".removeprefix(": "))
                continue
            except Exception:  # noqa: BLE001 - logged, counted, flagged; the process has to live
                self._counters["faults"] += 1
                _log.exception("a map update was not taken up")
                self._refuse(sample, "fault of the service, see its log")
                continue
            self._counters["map_updates" if taken else "map_updates_ignored"] += 1
            if self._maps.restarts:
                self._counters["map_sources_anew"] = self._maps.restarts

    def _refuse(self, sample: zenoh.Sample, reason: str) -> None:
        payload, encoding = sample.payload, str(sample.encoding)
        small = len(payload) <= self._most
        self._maps.refuse(glance.source_of(bytes(payload), encoding) if small else "", reason)
