"""Plan requests over zenoh: a fair queue, threads that answer, and one that replies "busy".

Zenoh's own threads only put requests into the queue; decoding, planning and replies are done by
threads of this module. One of them is reserved for clients that drive: those that were answered
several times recently, and those on the key `plan/drive`, to which access can be restricted.
Answers are made in :mod:`slopewise.services.planning.plan_service`.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import zenoh

from slopewise.models.errors import InputError
from slopewise.services.planning.deadline_check import DeadlineError, UsageMeter
from slopewise.services.planning.map_store import MapStore
from slopewise.services.planning.plan_service import PlanService
from slopewise.services.planning.request_validation import validate_request
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire import codec, plan_messages
from slopewise.services.wire.endpoint import STOP_TIMEOUT, Endpoint, ReceivedQuery
from slopewise.services.wire.fair_queue import FULL, FairQueue, Waiting
from slopewise.services.wire.message_header import read_deadline, read_header
from slopewise.services.wire.plan_messages import PlanReply, PlanRequest

_log = logging.getLogger("slopewise")

_REMEMBERED_COUNT = 1000
"""Answers over which the status reports the time [1]: a minute of one client."""

_MAX_DRIVING_CANDIDATES = 200
"""Candidates up to which the reserved thread answers [1]: more take longer than a cycle."""

_MAX_HEADER_BYTES = 200_000  # payload whose header is read [bytes]: takes zenoh's thread 0.1 ms

PlanQueue = FairQueue[ReceivedQuery]
PlanEntry = Waiting[ReceivedQuery]


class PlanEndpoint:
    """Answers each request before its deadline, with "busy" if necessary."""

    def __init__(
        self,
        config: ServiceConfig,
        plans: PlanService,
        maps: MapStore,
        counters: Counter[str],
        on_planned: Callable[[PlanRequest, PlanReply], None],
    ) -> None:
        """Answer with plans on maps; ``on_planned`` is called after each answer."""
        self._config, self._plans, self._maps = config, plans, maps
        self._counters, self._on_planned = counters, on_planned
        self._queue = PlanQueue(config.planning.queue, newest_only=True)
        self._endpoint = Endpoint(counters, config.sizes.request_bytes)
        self._seconds: deque[float] = deque(maxlen=_REMEMBERED_COUNT)
        self._working_since: dict[str, float] = {}
        self._key = config.key("plan")
        self._threads: list[threading.Thread] = []

    def open(self) -> None:
        workers = [True] + [False] * self._config.planning.workers
        loops: list[Callable[[], None]] = [partial(self._work, driving) for driving in workers]
        for n, loop in enumerate([*loops, self._reply_busy]):
            thread = threading.Thread(target=loop, name=f"plans-{n}", daemon=True)
            thread.start()
            self._threads.append(thread)

    def declare(self, session: zenoh.Session) -> list[Any]:
        """Declare the keys; returns the declarations."""
        outranks = partial(self._on_query, outranks=True)
        return [
            session.declare_queryable(self._key, self._on_query, complete=True),
            session.declare_queryable(self._config.key("plan/drive"), outranks, complete=True),
        ]

    def close(self) -> None:
        """Reply "busy" to all requests that wait, and end the threads."""
        for entry in self._queue.close():
            self._reply_without_plans(entry, plan_messages.BUSY, "the service is stopping")
        for thread in self._threads:
            thread.join(STOP_TIMEOUT)

    def is_alive(self) -> bool:
        """Return True unless a worker is still busy with a request long after its deadline."""
        latest = time.monotonic() - self._config.planning.longest_deadline - STOP_TIMEOUT
        return all(since > latest for since in [*self._working_since.values()])

    def seconds(self) -> dict[str, float]:
        """Median and 99th percentile of the last answers' times [s]."""
        times = np.array(self._seconds or [0.0])
        return {"median": float(np.median(times)), "p99": float(np.percentile(times, 99))}

    def _on_query(self, query: zenoh.Query, *, outranks: bool = False) -> None:
        """Called by zenoh's threads."""
        planning = self._config.planning
        self._counters["queries"] += 1
        received = ReceivedQuery(query, query.payload, str(query.encoding or ""))
        payload = received.payload or b""
        header = read_header(payload, received.encoding, _MAX_HEADER_BYTES)
        entry = PlanEntry(received, header.client, len(payload), outranks=outranks)
        is_short = 0 < len(header.paths) <= _MAX_DRIVING_CANDIDATES
        entry.is_driving = is_short and (outranks or self._queue.shares.is_driving(header.client))
        try:
            limit = read_deadline(query, self._key)
        except InputError as error:
            entry.reason, entry.is_invalid = str(error), True
            self._reject(entry)
            return
        limit = min(planning.deadline if limit is None else limit, planning.longest_deadline)
        entry.time_limit = limit - min(planning.early, 0.5 * limit)
        displaced = self._queue.put(entry)
        if displaced is not None:
            self._reject(displaced)

    def _reject(self, entry: PlanEntry) -> None:
        if not self._queue.reject(entry):
            self._counters["queries_lost"] += 1

    def _work(self, only_driving: bool) -> None:
        name = threading.current_thread().name
        while (entry := self._queue.take(only_driving=only_driving)) is not None:
            self._working_since[name] = time.monotonic()
            try:
                self._attend(entry)
            finally:
                self._working_since.pop(name, None)
                if only_driving:
                    self._queue.done()

    def _attend(self, entry: PlanEntry, *, is_between: bool = False) -> None:
        """Answer a request; ``is_between``: between the candidates of a longer one."""
        between = None if is_between else partial(self._attend, is_between=True)
        try:
            self._answer(entry, UsageMeter(self._queue, entry, between))
        except DeadlineError as late:
            self._counters["given_up"] += 1
            self._give_up(entry, plan_messages.BUSY, str(late))
        except InputError as error:
            self._counters["refused"] += 1
            self._give_up(entry, plan_messages.ERROR, str(error))
        except Exception:  # noqa: BLE001 - logged and counted; the process has to live
            self._counters["faults"] += 1
            _log.exception("plan request rejected: internal error")
            self._give_up(entry, plan_messages.ERROR, "fault of the service")

    def _answer(self, entry: PlanEntry, meter: UsageMeter) -> None:
        started = time.monotonic()
        check = partial(validate_request, sizes=self._config.sizes, key=self._key)
        request = self._endpoint.decode(PlanRequest, entry.item, self._key, check=check)
        entry.sender = request.client
        decoded = time.monotonic()
        try:
            reply = self._plans.answer(
                request,
                self._maps.snapshot,
                self._key,
                check_deadline=meter,
                remaining=entry.due - decoded,
            )
            reply.seconds.update(queued=started - entry.arrived, decode=decoded - started)
            payload = codec.payload_of(reply, codec.format_of(entry.item.encoding))
        except DeadlineError:
            self._plans.forget(request.client)
            raise
        finally:
            meter.charge()
        if not self._queue.claim(entry):
            # Its client received "busy", and will not drive this plan.
            self._plans.forget(request.client)
            return
        if not self._send(entry, payload):
            self._plans.forget(request.client)
            return
        self._queue.shares.note_answer(request.client)
        self._seconds.append(time.monotonic() - entry.arrived)
        self._counters["answered"] += 1
        self._on_planned(request, reply)
        self._counters["candidates_refused"] += sum(not c.usable for c in reply.ranking)

    def _give_up(self, entry: PlanEntry, status: str, reason: str) -> None:
        if self._queue.claim(entry):
            self._reply_without_plans(entry, status, reason)

    def _reply_busy(self) -> None:
        while (overdue := self._queue.overdue()) is not None:
            for entry in overdue:
                self._counters["refused"] += entry.is_invalid
                status = plan_messages.ERROR if entry.is_invalid else plan_messages.BUSY
                self._reply_without_plans(entry, status, entry.reason or FULL)

    def _reply_without_plans(self, entry: PlanEntry, status: str, reason: str) -> None:
        """Reply to a claimed request."""
        self._counters["busy"] += status == plan_messages.BUSY
        reply = PlanReply(status=status, reason=reason, service=self._config.id)
        self._send(entry, codec.payload_of(reply, codec.format_of(entry.item.encoding)))

    def _send(self, entry: PlanEntry, payload: dict[str, Any]) -> bool:
        """Reply to a claimed request and close its query; False if that failed."""
        with entry.item.query as query:
            return self._endpoint.send(query, str(query.key_expr), payload)
