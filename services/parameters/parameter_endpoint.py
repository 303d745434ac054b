"""Parameters and observations over zenoh: keys, one fair queue, one thread.

An observation arrives as a put, or as a query where its sender needs to know that it was stored:
the receipt is sent once it is on disk. Parameters are read at ``params`` and ``params/GROUP``, set
at ``params/set``, ``params/rollback`` and ``params/adopt``: separate keys, because access is given
by key. ``discrepancy`` returns findings on stored stops, and starts an investigation.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import partial
from typing import Any, NamedTuple, Protocol

import msgspec
import zenoh

from slopewise.services.parameters import replies
from slopewise.services.parameters.parameter_service import REFUSED, ParameterService
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire import codec, observations
from slopewise.services.wire import parameter_messages as messages
from slopewise.services.wire.codec import Format
from slopewise.services.wire.endpoint import STOP_TIMEOUT, Endpoint, Handler
from slopewise.services.wire.fair_queue import FairQueue, Waiting
from slopewise.services.wire.message_header import read_header

_log = logging.getLogger("slopewise")

KINDS: dict[str, type[Any]] = {
    "stop": observations.StopObservation,
    "drive": observations.DriveSamples,
    "terrain": observations.TerrainLabel,
}
CHANGES: dict[str, type[Any]] = {
    "set": messages.SetParameters,
    "rollback": messages.RollBack,
    "adopt": messages.AdoptOffer,
}
PARAMS, DISCREPANCY = "params", "discrepancy"

_TICK = 0.5  # longest time without a tick [s]: labels expire within seconds
_FLAGGED_FOR = 60.0  # time for which lost observations are flagged [s]: many periods of the status
_REST_RATIO, _MAX_REST = 2.0, 0.05
"""Pause after an item while others wait, as a multiple of its processor time [1] and at most that
long [s]: a flood of observations leaves two thirds of a core to planning."""


class _Received(NamedTuple):
    """A message that waits; ``kind``: of :data:`KINDS`, PARAMS or DISCREPANCY."""

    kind: str
    message: Any


class ParameterListener(Protocol):
    """Receives what is learned; called by the learning thread."""

    def recall(self) -> None:
        """Parameters from before the last start can be read."""

    def learned(self, message: messages.ParameterGroup) -> None:
        """A group changed."""

    def show(self) -> None:
        """Anything else may have changed since the last call."""


class ParameterEndpoint:
    """Answers and learns from one message after the other."""

    def __init__(
        self,
        session: zenoh.Session,
        config: ServiceConfig,
        service: ParameterService,
        counters: Counter[str],
        listener: ParameterListener,
    ) -> None:
        """Declare keys and start to work."""
        self._session, self._config, self._service = session, config, service
        self._counters, self._listener = counters, listener
        max_bytes = int(config.learning.observation_bytes)
        self._endpoint = Endpoint(counters, max_bytes)
        self._queue = FairQueue[_Received](config.learning.queue)
        self._alive: dict[str, bool] = {}
        self._alive_lock = threading.Lock()
        self._lost_at = -float("inf")
        self.beat = time.monotonic()  # when the thread last took an item
        self._thread = threading.Thread(target=self._work, name="parameters", daemon=True)
        self._thread.start()
        self._declared = self._declare(session)

    def _declare(self, session: zenoh.Session) -> list[Any]:
        key, on_alive = self._config.key, session.liveliness().declare_subscriber
        put_keys = {kind: f"obs/{kind}" for kind in KINDS}
        query_keys = put_keys | {PARAMS: f"{PARAMS}/**", DISCREPANCY: DISCREPANCY}
        return [
            *(session.declare_subscriber(key(k), self._putter(n)) for n, k in put_keys.items()),
            *(
                session.declare_queryable(key(k), self._putter(n), complete=True)
                for n, k in query_keys.items()
            ),
            *(
                on_alive(key(f"alive/{name}"), self._on_token, history=True)
                for name in self._config.learning.estimators
            ),
        ]

    def close(self) -> None:
        """Undeclare the keys, then close the store."""
        for declared in self._declared:
            declared.undeclare()
        unanswered = self._queue.close()
        self._thread.join(STOP_TIMEOUT)
        if not self._thread.is_alive():
            for waiting in unanswered:
                self._reject(waiting.item, "the service is stopping")
            self._service.close()

    def flags(self) -> list[str]:
        lost = time.monotonic() - self._lost_at < _FLAGGED_FOR
        return ["observations were lost: more came than could be learned from"] if lost else []

    # ------------------------------------------------------------------ zenoh's threads

    def _putter(self, kind: str) -> Callable[[Any], None]:
        is_observation = kind in KINDS

        def put(item: Any) -> None:
            name = str(item.key_expr).removeprefix(f"{self._config.key(PARAMS)}/")
            waiting = Waiting(
                _Received(kind, item),
                sender=self._source_of(item) if is_observation else kind,
                # Access to these keys is given to operators only.
                outranks=kind == PARAMS and name in CHANGES,
            )
            displaced = self._queue.put(waiting)
            if displaced is None:
                return
            if displaced.item.kind in KINDS:
                self._counters["observations_lost"] += 1
                self._lost_at = time.monotonic()
            is_query = isinstance(displaced.item.message, zenoh.Query)
            if is_query and not self._queue.reject(displaced):
                self._counters["queries_lost"] += 1

        return put

    def _source_of(self, item: Any) -> str:
        max_bytes = self._config.learning.observation_bytes
        return read_header(item.payload or b"", str(item.encoding or ""), max_bytes).source

    def _on_token(self, sample: zenoh.Sample) -> None:
        name = str(sample.key_expr).rpartition("/")[2]
        with self._alive_lock:
            # Not part of the queue: tokens are never lost, and only the last one matters.
            self._alive[name] = sample.kind == zenoh.SampleKind.PUT

    # ------------------------------------------------------------------ own thread

    def _work(self) -> None:
        self._listener.recall()
        while True:
            waiting = self._queue.take(timeout=_TICK)
            rejected = self._queue.overdue(block=False)
            if rejected is None:
                if waiting is not None:
                    self._reject(waiting.item, "the service is stopping")
                return
            self.beat = time.monotonic()
            begun = time.thread_time()
            try:
                self._work_once(waiting, rejected)
            except Exception:  # noqa: BLE001 - logged, counted and flagged; plans get slower
                self._counters["faults"] += 1
                _log.exception("the learning thread failed")
                self._service.fault("learning does not work as it should")  # words: ok
            used = time.thread_time() - begun
            if waiting is not None:
                # Charged first, so that a new name pays for its first message.
                self._queue.shares.charge(waiting.sender, used)
                self._queue.shares.note_answer(waiting.sender)
            if len(self._queue):
                time.sleep(min(_REST_RATIO * used, _MAX_REST))

    def _work_once(
        self, waiting: Waiting[_Received] | None, rejected: Sequence[Waiting[_Received]]
    ) -> None:
        with self._alive_lock:
            alive, self._alive = self._alive, {}
        try:
            if waiting is not None and self._queue.claim(waiting):
                self._process(*waiting.item, waiting.arrived)
        finally:  # a message that fails loses neither a token nor another request
            for name, is_alive in alive.items():
                self._service.alive(name, is_alive=is_alive)
            for entry in rejected:
                self._reject(entry.item, "too many requests wait, ask again later")
        self._service.tick()
        self._publish()
        self._listener.show()

    def _reject(self, received: _Received, reason: str) -> None:
        """Reply to a request that was not handled."""
        kind, query = received
        if not isinstance(query, zenoh.Query):
            return
        key, handler = str(query.key_expr), self._handler(kind)
        written = codec.format_of(str(query.encoding or ""), handler.reply_format)
        payload = codec.payload_of(handler.failure(reason), written)
        with query:
            self._endpoint.send(query, self._key_of(kind) if "*" in key else key, payload)

    def _key_of(self, kind: str) -> str:
        return self._config.key(f"obs/{kind}" if kind in KINDS else kind)

    def _process(self, kind: str, item: Any, arrived: float) -> None:
        with item if isinstance(item, zenoh.Query) else nullcontext():
            if kind == PARAMS:
                for key, name in self._names_by_key(item.key_expr).items():
                    self._endpoint.answer(item, key, self._handler(kind, name), self._report_fault)
                return
            key = self._key_of(kind)
            handler = self._handler(kind, key, arrived)
            reply = self._endpoint.answer(item, key, handler, self._report_fault)
            if kind in KINDS and reply.status in (REFUSED, "error"):
                _log.info("%s: %s", key, reply.reason)

    def _names_by_key(self, requested: zenoh.KeyExpr) -> dict[str, str]:
        """Keys to reply on, each with its change or group; a pattern of groups has several."""
        key, base = str(requested), self._config.key(PARAMS)
        if "*" not in key:
            return {key: key.removeprefix(base).removeprefix("/")}
        if requested.intersects(base):
            return {base: ""}
        keys = {f"{base}/{group}": group for group in self._service.learner.state.names()}
        return {key: group for key, group in keys.items() if requested.intersects(key)}

    def _handler(self, kind: str, name: str = "", arrived: float = 0.0) -> Handler[Any, Any]:
        """How a kind is answered; ``name``: key of an observation, or a change or group.

        Replies about parameters are in JSON unless the encoding names MessagePack.
        """
        service = self._service
        if kind in KINDS:
            return Handler(
                KINDS[kind],
                handle=lambda message: service.observe(kind, message, name, arrived),
                failure=partial(service.receipt, "error"),
                name=kind,
                describe=lambda message: f"{kind} {message.sequence} of {message.source}",
            )
        default: msgspec.Struct | None = None
        handle: Callable[..., messages.ParameterReply] = replies.change
        if kind == DISCREPANCY:
            handle, default = replies.findings, messages.DiscrepancyQuestion()
        elif name not in CHANGES:
            handle, default = partial(replies.read, group=name), messages.ParameterQuestion()
        return Handler(
            CHANGES[name] if default is None else type(default),
            handle=partial(handle, service),
            failure=partial(replies.reply_of, service, "error"),
            name=PARAMS,
            default=default,
            reply_format=Format.JSON,
        )

    def _report_fault(self, what: str) -> str:
        """Count and flag a fault of the service with one message; the reason for its sender."""
        self._counters["faults"] += 1
        _log.exception("%s could not be treated", what)
        self._service.note_fault(what)
        return f"{what} could not be treated: fault of the service"

    def _publish(self) -> None:
        """Publish each group that changed, then all; a subscriber that misses one may ask."""
        changed, self._service.changed = self._service.changed, set()
        if not changed:
            return
        reply = replies.read(self._service, messages.ParameterQuestion())
        for message in reply.groups:
            if message.group in changed:
                self._put(f"{PARAMS}/{message.group}", message)
                self._listener.learned(message)
        self._put(PARAMS, reply)

    def _put(self, key: str, message: msgspec.Struct) -> None:
        drop = zenoh.CongestionControl.DROP
        payload = codec.payload_of(message, Format.JSON)
        self._session.put(self._config.key(key), **payload, congestion_control=drop)
