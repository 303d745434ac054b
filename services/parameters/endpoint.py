"""Parameters and observations over zenoh: keys, one queue, one thread.

An observation comes as a put, or as a query where its sender wants to know that it was kept: the
receipt comes once it is on disk. Parameters are read at ``params`` and ``params/GROUP``, set at
``params/set``, ``params/rollback`` and ``params/adopt``: keys of their own, so that access can be
given apart. ``discrepancy`` tells what stored stops say, and begins a look at them.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import nullcontext
from typing import Any, NamedTuple, Protocol

import msgspec
import zenoh

from slopewise.services.parameters import replies
from slopewise.services.parameters.parameter_service import REFUSED, ParameterService
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.endpoint import Endpoint, Handler
from slopewise.services.wire.fair_queue import FairQueue, Waiting
from slopewise.services.wire.message_header import read_source
from slopewise.services.wire.observations import (
    DriveSamples,
    ObservationAck,
    StopObservation,
    TerrainLabel,
)
from slopewise.services.wire.parameter_messages import (
    AdoptOffer,
    DiscrepancyQuestion,
    ParameterGroup,
    ParameterQuestion,
    ParameterReply,
    RollBack,
    SetParameters,
)

_log = logging.getLogger("slopewise")

KINDS: dict[str, type[Any]] = {
    "stop": StopObservation,
    "drive": DriveSamples,
    "terrain": TerrainLabel,
}
CHANGES: dict[str, type[Any]] = {
    "set": SetParameters,
    "rollback": RollBack,
    "adopt": AdoptOffer,
}
PARAMS, DISCREPANCY = "params", "discrepancy"
_TICK = 0.5
_PATIENCE = 2.0
_FLAGGED_FOR = 60.0
_REST = 2.0
_LONGEST_REST = 0.05


class _Received(NamedTuple):
    """A message that waits; ``kind``: of :data:`KINDS`, PARAMS or DISCREPANCY."""

    kind: str
    message: Any


class Audience(Protocol):
    """Whoever is shown what is learned; called by the thread that learns."""

    def recall(self) -> None:
        """What was learned before the last start."""

    def learned(self, message: ParameterGroup) -> None:
        """A group changed."""

    def show(self) -> None:
        """Anything else that is new since the last call."""


class ParameterEndpoint:
    """Takes what comes, one after the other; a context manager."""

    def __init__(
        self,
        session: zenoh.Session,
        config: ServiceConfig,
        service: ParameterService,
        counters: Counter[str],
        audience: Audience,
    ) -> None:
        """Declare keys and begin to work."""
        self._session, self._config, self._service = session, config, service
        self._counters = counters
        self._audience = audience
        most = int(config.learning.observation_bytes)
        self._endpoint = Endpoint(counters, most, self._report_fault)
        self._queue = FairQueue[_Received](config.learning.queue)
        self._alive: dict[str, bool] = {}
        self._alive_lock = threading.Lock()
        self._lost_at = -float("inf")
        self.beat = time.monotonic()
        self._thread = threading.Thread(target=self._work, name="parameters", daemon=True)
        self._thread.start()
        self._declared: list[Any] = []
        for kind in KINDS:
            key = config.key(f"obs/{kind}")
            self._declared.append(session.declare_subscriber(key, self._putter(kind)))
            self._declared.append(session.declare_queryable(key, self._putter(kind), complete=True))
        for name, pattern in ((PARAMS, f"{PARAMS}/**"), (DISCREPANCY, DISCREPANCY)):
            key, put = config.key(pattern), self._putter(name)
            self._declared.append(session.declare_queryable(key, put, complete=True))
        for name in config.learning.estimators:
            self._declared.append(
                session.liveliness().declare_subscriber(
                    config.key(f"alive/{name}"), self._on_token, history=True
                )
            )

    def close(self) -> None:
        """Let zenoh go, then the store."""
        for declared in self._declared:
            declared.undeclare()
        unanswered = self._queue.close()
        self._thread.join(_PATIENCE)
        if not self._thread.is_alive():
            for waiting in unanswered:
                self._reject(waiting.item, "the service is stopping")
            self._service.close()

    def flags(self) -> list[str]:
        """What is not as it should be."""
        lost = time.monotonic() - self._lost_at < _FLAGGED_FOR
        return ["observations were lost: more came than could be learned from"] if lost else []

    # ------------------------------------------------------------------ zenoh's threads

    def _putter(self, kind: str) -> Any:
        def put(item: Any) -> None:
            is_observation = kind in KINDS
            name = str(item.key_expr).rpartition("/")[2]
            payload = item.payload or b""
            waiting = Waiting(
                _Received(kind, item),
                sender=read_source(payload, str(item.encoding or "")) if is_observation else kind,
                # Access to these keys is given to operators only.
                outranks=kind == PARAMS and name in CHANGES,
            )
            displaced = self._queue.put(waiting)
            if displaced is None:
                return
            if displaced.item.kind in KINDS:
                self._counters["observations_lost"] += 1
                self._lost_at = time.monotonic()
            if isinstance(displaced.item.message, zenoh.Query):
                self._queue.reject(displaced)
                self._queue.interrupt()

        return put

    def _on_token(self, sample: zenoh.Sample) -> None:
        name = str(sample.key_expr).rpartition("/")[2]
        with self._alive_lock:
            # Whether an estimator lives is never lost, and the last state is used.
            self._alive[name] = sample.kind == zenoh.SampleKind.PUT
        self._queue.interrupt()

    # ------------------------------------------------------------------ own thread

    def _work(self) -> None:
        self._audience.recall()
        while True:
            waiting = self._queue.take(timeout=_TICK)
            rejected = self._queue.overdue(block=False)
            if rejected is None:
                return
            with self._alive_lock:
                alive, self._alive = self._alive, {}
            self.beat = time.monotonic()
            begun = time.thread_time()
            try:
                for name, is_alive in alive.items():
                    self._service.alive(name, is_alive=is_alive)
                for entry in rejected:
                    self._reject(entry.item, "too many requests wait, ask again later")
                if waiting is not None and self._queue.claim(waiting):
                    self._take(waiting.item.kind, waiting.arrived, waiting.item.message)
                    self._queue.shares.note_answer(waiting.sender)
                self._service.tick()
                self._publish()
                self._audience.show()
            except Exception:  # noqa: BLE001 - logged, counted and flagged; plans get slower
                self._counters["faults"] += 1
                _log.exception("parameters were not looked after as they should be")
                self._service.fault("learning does not work as it should")
            used = time.thread_time() - begun
            if waiting is not None:
                self._queue.shares.charge(waiting.sender, used)
            if len(self._queue):
                # Senders of more than can be learned from do not take the time to plan.
                time.sleep(min(_REST * used, _LONGEST_REST))

    def _take(self, kind: str, arrived: float, item: Any) -> None:
        if kind in KINDS:
            self._observe(kind, arrived, item)
            return
        with item:
            (self._answer if kind == PARAMS else self._findings)(item)

    def _reject(self, received: _Received, reason: str) -> None:
        """Reply to a request that was not handled."""
        query, kind = received.message, received.kind
        if not isinstance(query, zenoh.Query):
            return
        asked = str(query.key_expr)
        base = self._config.key(kind if kind in (PARAMS, DISCREPANCY) else f"obs/{kind}")
        is_observation = kind in KINDS
        reply = self._failed(reason) if is_observation else self._error(reason)
        default = Format.MESSAGEPACK if is_observation else Format.JSON
        written = codec.format_of(str(query.encoding or ""), default)
        with query:
            self._endpoint.send(query, base if "*" in asked else asked, reply, written)

    def _error(self, reason: str) -> ParameterReply:
        return replies.reply_of(self._service, self._config.id, "error", reason)

    def _report_fault(self, what: str) -> str:
        """Count and flag a fault of the service with one message; the reason for its sender."""
        self._counters["faults"] += 1
        _log.exception("%s could not be treated", what)
        self._service.note_fault(what)
        return f"{what} could not be treated: fault of the service"

    def _observe(self, kind: str, arrived: float, item: Any) -> None:
        key = self._config.key(f"obs/{kind}")
        observation = Handler(
            KINDS[kind],
            handle=lambda one: self._service.observe(kind, one, key, arrived),
            failure=self._failed,
            name=kind,
            describe=lambda one: f"{kind} {one.sequence} of {one.source}",
        )
        with item if isinstance(item, zenoh.Query) else nullcontext():
            receipt = self._endpoint.answer(item, key, observation)
        if receipt.status in (REFUSED, "error"):
            _log.info("%s: %s", key, receipt.reason)

    def _failed(self, reason: str) -> ObservationAck:
        log = self._service.history
        return ObservationAck(
            status="error", reason=reason, version=log.version, durable=log.durable
        )

    def _findings(self, query: zenoh.Query) -> None:
        request = self._handler(DiscrepancyQuestion, replies.findings, DiscrepancyQuestion())
        self._endpoint.answer(query, self._config.key(DISCREPANCY), request)

    def _answer(self, query: zenoh.Query) -> None:
        asked, base = str(query.key_expr), self._config.key(PARAMS)
        name = asked[len(base) + 1 :] if asked.startswith(f"{base}/") else ""
        if name in CHANGES:
            change = self._handler(CHANGES[name], replies.change)
            self._endpoint.answer(query, asked, change)
        elif "*" not in asked:
            self._read(query, name, asked)
        elif query.key_expr.intersects(base):
            self._read(query, "", base)
        else:
            # A pattern of groups: each answers with its own key.
            for group in self._service.learner.state.names():
                if query.key_expr.intersects(f"{base}/{group}"):
                    self._read(query, group, f"{base}/{group}")

    def _read(self, query: zenoh.Query, group: str, key: str) -> None:
        def read(service: ParameterService, question: ParameterQuestion, name: str) -> Any:
            chosen = msgspec.structs.replace(question, group=group or question.group)
            return replies.read(service, chosen, name)

        request = self._handler(ParameterQuestion, read, ParameterQuestion())
        self._endpoint.answer(query, key, request)

    def _handler(
        self, kind: type[Any], handle: Callable[..., ParameterReply], default: Any = None
    ) -> Handler[Any, ParameterReply]:
        """A request about parameters; who names no format is answered in JSON."""
        return Handler(
            kind,
            handle=lambda request: handle(self._service, request, self._config.id),
            failure=self._error,
            name=PARAMS,
            default=default,
            reply_format=Format.JSON,
        )

    def _publish(self) -> None:
        """Tell each group that changed, then all; whoever is too slow misses it and may ask."""
        changed, self._service.changed = self._service.changed, set()
        if not changed:
            return
        told = replies.read(self._service, ParameterQuestion(), self._config.id)
        for message in told.groups:
            if message.group in changed:
                self._put(f"params/{message.group}", message)
                self._audience.learned(message)
        self._put("params", told)

    def _put(self, key: str, message: msgspec.Struct) -> None:
        self._session.put(
            self._config.key(key),
            codec.encode(message, Format.JSON),
            encoding=codec.encoding_of(type(message), Format.JSON),
            congestion_control=zenoh.CongestionControl.DROP,
        )
