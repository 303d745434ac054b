"""Map updates over zenoh: a bounded queue, and one thread that applies them in order."""

from __future__ import annotations

import logging
import threading
from collections import Counter
from typing import Any

import zenoh

from slopewise.models.errors import InputError
from slopewise.services.planning.map_store import MapStore
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire import codec
from slopewise.services.wire.endpoint import STOP_TIMEOUT
from slopewise.services.wire.fair_queue import FairQueue, Waiting
from slopewise.services.wire.message_header import read_header
from slopewise.services.wire.plan_messages import MapUpdate

_log = logging.getLogger("slopewise")

_MAX_WAITING = 16  # map updates that may wait [1]; each may have tens of megabytes


class MapEndpoint:
    """Applies map updates one after the other."""

    def __init__(self, config: ServiceConfig, maps: MapStore, counters: Counter[str]) -> None:
        """Keep ``maps`` up to date."""
        self._maps, self._counters = maps, counters
        self._key, self._max_bytes = config.key("map"), config.sizes.map_bytes
        # All sources share one account: patches of one fit the map of another.
        self._queue: FairQueue[zenoh.Sample] = FairQueue(_MAX_WAITING)
        self._thread = threading.Thread(target=self._work, name="maps", daemon=True)

    def open(self) -> None:
        self._thread.start()

    def declare(self, session: zenoh.Session) -> Any:
        """Subscribe; returns the declaration."""
        return session.declare_subscriber(self._key, self._on_map)

    def close(self) -> None:
        """Stop; waiting updates are discarded."""
        self._queue.close()
        self._thread.join(STOP_TIMEOUT)

    def _on_map(self, sample: zenoh.Sample) -> None:
        """Called by zenoh's threads."""
        if self._queue.put(Waiting(sample)) is not None:
            self._counters["map_updates_lost"] += 1
            self._maps.note_loss()

    def _work(self) -> None:
        while (waiting := self._queue.take()) is not None:
            sample, arrived = waiting.item, waiting.arrived
            try:
                self._apply(sample, arrived)
            except InputError as error:
                self._counters["map_updates_refused"] += 1
                _log.warning("%s", error)
                self._reject(sample, f"{error.field}: {error.expected}".removeprefix(": "))
            except Exception:  # noqa: BLE001 - logged, counted, flagged; the process has to live
                self._counters["faults"] += 1
                _log.exception("map update rejected: internal error")
                self._reject(sample, "fault of the service, see its log")

    def _apply(self, sample: zenoh.Sample, arrived: float) -> None:
        update = codec.decode(
            MapUpdate, sample.payload, str(sample.encoding), self._key, self._max_bytes
        )
        others_wait = len(self._queue) > 0
        is_applied = self._maps.apply(update, self._key, arrived, others_wait=others_wait)
        self._counters["map_updates" if is_applied else "map_updates_ignored"] += 1
        if self._maps.restarts:
            self._counters["map_sources_anew"] = self._maps.restarts  # words: ok

    def _reject(self, sample: zenoh.Sample, reason: str) -> None:
        header = read_header(sample.payload, str(sample.encoding), self._max_bytes)
        self._maps.note_rejection(header.source, reason)
