"""Questions for plans over zenoh: a bounded queue, threads that answer, one that tells the rest.

Zenoh's own threads only put questions in; decoding, planning and replies are done by threads of
this file. What is answered is made in :mod:`services.planning.plan_service`.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from typing import Any

import numpy as np
import zenoh

from models.errors import InputError
from services.planning.admission import Admission, PendingQuery
from services.planning.map_store import MapStore
from services.planning.plan_service import PlanService
from services.settings.service import ServiceConfig
from services.wire import codec, messages
from services.wire.messages import PlanReply, PlanRequest

_log = logging.getLogger("slopewise")

_REMEMBERED = 1000
_PATIENCE = 2.0


class PlanEndpoint:
    """Answers each question before its deadline, if only by "busy"."""

    def __init__(
        self, config: ServiceConfig, plans: PlanService, maps: MapStore, counters: Counter[str],
        planned: Callable[[PlanRequest, PlanReply], None],
    ) -> None:  # fmt: skip
        """Answer with these plans on these maps; `planned` is called after each answer."""
        self._config, self._plans, self._maps = config, plans, maps
        self._counters, self._planned = counters, planned
        self._admission = Admission(config.planning.queue)
        self._seconds: deque[float] = deque(maxlen=_REMEMBERED)
        self._working: dict[str, float] = {}
        self._key = config.key("plan")
        self._threads: list[threading.Thread] = []

    def open(self) -> None:
        """Begin to work."""
        for n, loop in enumerate([self._work] * self._config.planning.workers + [self._turn_away]):
            thread = threading.Thread(target=loop, name=f"{loop.__name__}-{n}", daemon=True)
            thread.start()
            self._threads.append(thread)

    def declare(self, session: zenoh.Session) -> Any:
        """Let questions in; what has to be undeclared in the end."""
        return session.declare_queryable(self._key, self._on_query, complete=True)

    def close(self) -> None:
        """Tell whoever waits that nothing will come."""
        for question in self._admission.close():
            self._say(question, messages.BUSY, "the service is stopping")
        for thread in self._threads:
            thread.join(_PATIENCE)

    def well(self) -> bool:
        """Whether every worker gets on: none is still at a question long since told busy."""
        latest = time.monotonic() - self._config.planning.longest_deadline - _PATIENCE
        return all(began > latest for began in [*self._working.values()])

    def seconds(self) -> dict[str, float]:
        """How long the last answers took."""
        took = np.array(self._seconds or [0.0])
        return {"median": float(np.median(took)), "p99": float(np.percentile(took, 99))}

    def _on_query(self, query: zenoh.Query) -> None:
        """In zenoh's threads."""
        planning = self._config.planning
        try:
            deadline = float(query.parameters.get("deadline") or planning.deadline)
        except ValueError:
            deadline = planning.deadline
        if not deadline > 0.0 or math.isinf(deadline):
            deadline = planning.deadline
        deadline = min(deadline, planning.longest_deadline)
        self._counters["queries"] += 1
        early = min(planning.early, 0.5 * deadline)
        if not self._admission.offer(PendingQuery(query, deadline - early)):
            self._counters["queries_lost"] += 1

    def _work(self) -> None:
        name = threading.current_thread().name
        while (question := self._admission.take()) is not None:
            self._working[name] = time.monotonic()
            try:
                self._answer(question)
            except Exception:  # noqa: BLE001 - logged and counted; the process has to live
                self._counters["faults"] += 1
                _log.exception("a question was not answered as it should be")
                if self._admission.claim(question):
                    self._say(question, messages.ERROR, "fault of the service")
            finally:
                self._working.pop(name, None)

    def _answer(self, question: PendingQuery) -> None:
        begun = time.monotonic()
        query, client = question.query, ""
        encoding = str(query.encoding or "")
        try:
            request = codec.decode(
                PlanRequest, query.payload or b"", encoding, self._key,
                self._config.sizes.request_bytes,
            )  # fmt: skip
            client = request.client
            decoded = time.monotonic()
            reply = self._plans.answer(request, self._maps.ground, self._key)
        except InputError as error:
            self._counters["refused"] += 1
            if self._admission.claim(question):
                self._say(question, messages.ERROR, str(error))
            return
        written = codec.format_of(encoding)
        reply.seconds.update(queued=begun - question.arrived, decode=decoded - begun)
        payload = codec.encode(reply, written)
        if not self._admission.claim(question):
            # It was told busy meanwhile, so it does not drive this.
            if client:
                self._plans.forget(client)
            return
        with query:
            query.reply(self._key, payload, encoding=codec.encoding_of(PlanReply, written))
        self._seconds.append(time.monotonic() - question.arrived)
        self._counters["answered"] += 1
        self._planned(request, reply)
        self._counters["candidates_refused"] += sum(not c.usable for c in reply.ranking)

    def _turn_away(self) -> None:
        while (late := self._admission.late()) is not None:
            for question in late:
                self._counters["busy"] += 1
                self._say(question, messages.BUSY, "too many questions to answer this one in time")

    def _say(self, question: PendingQuery, status: str, reason: str) -> None:
        """An answer without plans, to a question that was claimed."""
        written = codec.format_of(str(question.query.encoding or ""))
        reply = PlanReply(status=status, reason=reason, service=self._config.id)
        try:
            with question.query as query:
                query.reply(
                    self._key, codec.encode(reply, written),
                    encoding=codec.encoding_of(PlanReply, written),
                )  # fmt: skip
        except zenoh.ZError as error:
            self._counters["replies_lost"] += 1
            _log.warning("a reply could not be sent: %s", error)
