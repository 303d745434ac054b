"""Maps and parameters for the guard, read by a separate thread so that none delays a command.

Nothing is dropped unnoticed. Of parameters the newest of each group waits. Maps wait in order, and
after a lost one the ground is unknown until the next whole map; none can be requested.
"""

from __future__ import annotations

import logging
import math
import os
import threading
import time
from collections import Counter, OrderedDict, deque
from typing import TypeAlias

import zenoh

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.vehicle import Vehicle
from slopewise.services.guard.core import Guard
from slopewise.services.guard.guard_map import map_layers
from slopewise.services.guard.parameter_request import ParameterRequest
from slopewise.services.guard.zenoh_transport import format_of
from slopewise.services.wire import codec
from slopewise.services.wire.arrival import SenderTable
from slopewise.services.wire.map_message import apply_update
from slopewise.services.wire.parameter_messages import ParameterGroup, ParameterReply
from slopewise.services.wire.plan_messages import MapUpdate

_log = logging.getLogger("slopewise")

LOST = "a map patch was lost; waiting for a whole map"
"""Reason why there is no ground after a lost patch."""

MAX_WAITING = 32  # map updates that may wait to be read: some seconds of patches [1]

_MAX_GROUPS, _MAX_SOURCES = 64, 64
"""Parameter groups that may wait, and senders of maps whose numbers are known [1]."""

_MAX_BYTES = 256_000_000  # size of an update: a whole map of 32 million cells [bytes]


Parameters: TypeAlias = ParameterGroup | ParameterReply


class KnownMap:
    """Map that its updates result in."""

    def __init__(self, known: ElevationMap | None) -> None:
        # None before the first whole map, and after a lost update until the next one, for a reason
        self.map, self.reason = known, ""
        self.counters: Counter[str] = Counter()  # of updates
        self._last = SenderTable[tuple[str, str], int | None](lambda: None, _MAX_SOURCES)

    def lose(self, count: int = 1, reason: str = LOST) -> None:
        """Discard the map: some updates of it are lost."""
        self.counters["map updates lost"] += count
        self.map, self.reason = None, reason

    def take(self, update: MapUpdate) -> None:
        """Apply an update; a patch before which others may be missing discards the map."""
        sender = update.source, update.instance
        is_known = any(source == update.source for source, _ in self._last)
        last = self._last.of(sender)
        self._last[sender] = update.sequence
        if not update.patch:
            self.map, self.reason = apply_update(update, None), ""
        elif update.sequence == last:
            self.counters["map patches repeated"] += 1
        elif self.reason:
            self.counters["map patches unused"] += 1
        elif last is None and (is_known or update.sequence > 1):
            self.lose()  # at least the one before it
        elif last is not None and update.sequence != last + 1:
            self.lose(max(update.sequence - last - 1, 1))
        else:
            self.map = apply_update(update, self.map)


class ServiceUpdates:
    """Subscriptions to maps and parameters, and their hand-over to the guard."""

    def __init__(
        self,
        session: zenoh.Session,
        namespace: str,
        known: ElevationMap | None,
        vehicle: Vehicle,
        memory: int | None = None,
    ) -> None:
        """Subscribe; :meth:`open` begins to read.

        ``memory``: file that is not empty once parameters were accepted, for the next worker.
        """
        self._memory, self._published = memory, set[str]()
        self._request = ParameterRequest(session, namespace, self._on_parameters)
        self._vehicle = vehicle
        self._known, self._key = KnownMap(known), f"{namespace}/v1/map"
        # With arrival [s]; None: those before it are too old.
        self._maps: deque[tuple[zenoh.Sample | None, float]] = deque()
        # Arrival until which maps may have waited, and until which they waited for too long [s].
        self._certain_from = self._void_until = -math.inf
        self._samples: OrderedDict[str, zenoh.Sample] = OrderedDict()  # of parameters, by key
        self._lost, self._closed = 0, False
        self._news = threading.Condition()
        self._new_groups: list[ParameterGroup] = []
        self._new_map: tuple[ElevationMap | None, str, dict[str, int], float] | None = None
        self._declared = [
            session.declare_subscriber(self._key, self._on_map),
            session.declare_subscriber(f"{namespace}/v1/params/*", self._on_parameters),
        ]
        self._reader = threading.Thread(target=self._read, name="updates", daemon=True)

    def open(self) -> None:
        """Begin to read."""
        self._reader.start()
        self._request.thread.start()

    def close(self) -> None:
        """Discard waiting updates."""
        self._request.is_answered = True
        for declared in self._declared:
            declared.undeclare()
        with self._news:
            self._closed = True
            self._news.notify_all()

    def distrust(self, until: float, *, is_void: bool) -> None:
        """Count maps that come until then as old as the process was held up: they may have waited.

        ``is_void``: that is too old, and the ground is unknown until a whole map comes later [s].
        """
        with self._news:
            self._certain_from = until
            if is_void:
                self._maps.clear()
                self._maps.append((None, until))
                self._void_until = until
                self._news.notify_all()

    def take(self, guard: Guard) -> None:
        """Hand over what is new; called by the deciding thread, never waits for the reader."""
        # First: a reply that is read from here on ends no wait before its groups are in use.
        missing = self._request.missing(is_required=guard.learned.required)
        with self._news:
            groups, self._new_groups = self._new_groups, []
            new_map, self._new_map = self._new_map, None
        if new_map is not None:
            ground, reason, counters, at = new_map
            guard.counters.update({k: n - guard.counters[k] for k, n in counters.items()})
            if ground is None:
                guard.maps.drop(reason)
            else:
                guard.maps.take(ground, at)
                guard.held_up = guard.held_up if at < self._certain_from else 0.0
        for group in groups:
            guard.learned.take(group)
        if groups:
            guard.learn()
            if self._memory is not None:
                os.pwrite(self._memory, b"1", 0)
        guard.learned.waits, guard.learned.silence = missing

    def _on_map(self, sample: zenoh.Sample) -> None:
        with self._news:
            if (now := time.monotonic()) < self._void_until:
                return
            if len(self._maps) >= MAX_WAITING:
                # The newest may be a whole map, which makes those before it obsolete.
                self._lost += len(self._maps)
                self._maps.clear()
            self._maps.append((sample, now))
            self._news.notify_all()

    def _on_parameters(self, sample: zenoh.Sample) -> None:
        with self._news:
            self._samples[str(sample.key_expr)] = sample
            if len(self._samples) > _MAX_GROUPS:
                self._samples.popitem(last=False)
            self._news.notify_all()

    def _has_news(self) -> bool:
        return bool(self._maps or self._samples or self._closed)

    def _read(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(self._has_news)
                if self._closed:
                    return
                samples, self._samples = self._samples, OrderedDict()
                update = self._maps.popleft() if self._maps else None
                lost, self._lost = self._lost, 0
            for key, sample in samples.items():
                self._read_parameters(key, sample)
            if update is not None:
                self._read_map(*update, lost)

    def _read_parameters(self, key: str, sample: zenoh.Sample) -> None:
        """Take a published group, or the groups of a reply: what was published is newer."""
        raw = sample.payload.to_bytes()
        is_reply = key.endswith("/v1/params")
        kind: type[Parameters] = ParameterReply if is_reply else ParameterGroup
        try:
            encoding = codec.encoding_of(kind, format_of(raw))
            message = codec.decode(kind, raw, encoding, key, _MAX_BYTES)
        except Exception as error:  # noqa: BLE001 - logged; maps need this thread
            _log.warning("%s: %s", key, error)
            return
        with self._news:
            if isinstance(message, ParameterGroup):
                self._published.add(message.group)
                self._new_groups.append(message)
            elif message.status == "ok":
                known = self._published
                self._new_groups += [g for g in message.groups if g.group not in known]
                self._request.is_answered = True

    def _read_map(self, sample: zenoh.Sample | None, at: float, lost: int) -> None:
        if lost:
            _log.warning("%s: %d updates were lost: %s", self._key, lost, LOST)
        if lost or sample is None:
            self._known.lose(lost)
        try:
            if sample is not None:
                raw, encoding = sample.payload.to_bytes(), str(sample.encoding)
                self._known.take(codec.decode(MapUpdate, raw, encoding, self._key, _MAX_BYTES))
        except Exception as error:  # noqa: BLE001 - logged, and the ground is unknown
            # Ground that could not be read may differ from the known map.
            _log.warning("%s: %s", self._key, error)
            self._known.lose(reason=self._known.reason)
        known = self._known
        if known.map is not None:
            # Here rather than in the first decision.
            map_layers(known.map, self._vehicle)
        with self._news:
            self._new_map = known.map, known.reason, dict(known.counters), at
