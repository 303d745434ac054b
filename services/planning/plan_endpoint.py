"""Questions for plans over zenoh: bounded queues, threads that answer, one that tells the rest.

Clients that drive have a thread of their own: it answers those that were answered several times
just lately, and whatever comes on the key `plan/drive`, which access can be given to apart. Zenoh's
own threads only put questions in; decoding, planning and replies are done by threads of this file.
What is answered is made in :mod:`slopewise.services.planning.plan_service`.
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
from slopewise.services.planning import glance
from slopewise.services.planning.admission import Admission, Lane, PendingQuery
from slopewise.services.planning.map_store import MapStore
from slopewise.services.planning.meter import Meter
from slopewise.services.planning.pace import TOO_MANY, TooLateError
from slopewise.services.planning.plan_service import PlanService
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire import codec, messages
from slopewise.services.wire.messages import PlanReply, PlanRequest

_log = logging.getLogger("slopewise")

_REMEMBERED = 1000
_PATIENCE = 2.0
_MOST_WHILE_DRIVING = 200
"""Questions with more candidates are not what a robot asks while it drives."""


class PlanEndpoint:
    """Answers each question before its deadline, if only by "busy"."""

    def __init__(
        self,
        config: ServiceConfig,
        plans: PlanService,
        maps: MapStore,
        counters: Counter[str],
        planned: Callable[[PlanRequest, PlanReply], None],
    ) -> None:
        """Answer with these plans on these maps; `planned` is called after each answer."""
        self._config, self._plans, self._maps = config, plans, maps
        self._counters, self._planned = counters, planned
        self._admission = Admission(config.planning.queue)
        self._shares = self._admission.shares
        self._seconds: deque[float] = deque(maxlen=_REMEMBERED)
        self._working: dict[str, float] = {}
        self._key = config.key("plan")
        self._threads: list[threading.Thread] = []

    def open(self) -> None:
        """Begin to work."""
        lanes = [Lane.DRIVE, *[Lane.REST] * self._config.planning.workers]
        loops: list[Callable[[], None]] = [partial(self._work, lane) for lane in lanes]
        for n, loop in enumerate([*loops, self._turn_away]):
            thread = threading.Thread(target=loop, name=f"plans-{n}", daemon=True)
            thread.start()
            self._threads.append(thread)

    def declare(self, session: zenoh.Session) -> Any:
        """Let questions in; what has to be undeclared in the end."""
        reserved = partial(self._on_query, reserved=True)
        return _Several(
            session.declare_queryable(self._key, self._on_query, complete=True),
            session.declare_queryable(self._config.key("plan/drive"), reserved, complete=True),
        )

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

    def _on_query(self, query: zenoh.Query, *, reserved: bool = False) -> None:
        """In zenoh's threads."""
        planning = self._config.planning
        self._counters["queries"] += 1
        client, size = glance.asking(query)
        try:
            wait = glance.deadline(query, self._key)
        except InputError as error:
            question = PendingQuery(query, planning.early, client, size)
            question.refusal = str(error)
            self._admission.turn_away(question)
            return
        wait = min(planning.deadline if wait is None else wait, planning.longest_deadline)
        early = min(planning.early, 0.5 * wait)
        question = PendingQuery(query, wait - early, client, size)
        if not self._admission.offer(question, reserved=reserved):
            self._counters["queries_lost"] += 1

    def _work(self, lane: Lane) -> None:
        name = threading.current_thread().name
        while (question := self._admission.take(lane)) is not None:
            self._working[name] = time.monotonic()
            try:
                self._attend(question, lane)
            finally:
                self._working.pop(name, None)
                self._admission.done(lane)

    def _attend(self, question: PendingQuery, lane: Lane, *, between: bool = False) -> None:
        """Answer, or say why not; ``between``: while a longer question waits."""

        def smaller(other: PendingQuery) -> None:
            self._attend(other, lane, between=True)

        meter = Meter(self._admission, question, None if between else smaller)
        try:
            self._answer(question, meter)
        except TooLateError as late:
            self._counters["given_up"] += 1
            self._give_up(question, messages.BUSY, str(late))
        except InputError as error:
            self._counters["refused"] += 1
            self._give_up(question, messages.ERROR, str(error))
        except Exception as error:  # noqa: BLE001 - logged and counted; the process has to live
            if question.taken and isinstance(error, zenoh.ZError):
                return  # It was told busy between two lines of this, and is closed since.
            self._counters["faults"] += 1
            _log.exception("a question was not answered as it should be")
            self._give_up(question, messages.ERROR, "fault of the service")

    def _give_up(self, question: PendingQuery, status: str, reason: str) -> None:
        if self._admission.claim(question):
            self._counters["busy"] += status == messages.BUSY
            self._say(question, status, reason)

    def _answer(self, question: PendingQuery, meter: Meter) -> None:
        begun = time.monotonic()
        query = question.query
        encoding = str(query.encoding or "")
        if question.request is None:
            question.request = codec.decode(
                PlanRequest,
                query.payload or b"",
                encoding,
                self._key,
                self._config.sizes.request_bytes,
            )
        request: PlanRequest = question.request
        question.client = request.client
        decoded = time.monotonic()
        if question.lane is Lane.DRIVE and len(request.paths) > _MOST_WHILE_DRIVING:
            self._admission.move(question)
            return
        try:
            reply = self._plans.answer(
                request, self._maps.ground, self._key, pace=meter, left=question.due - decoded
            )
            written = codec.format_of(encoding)
            reply.seconds.update(queued=begun - question.arrived, decode=decoded - begun)
            payload = codec.encode(reply, written)
        except TooLateError:
            if request.client:
                self._plans.forget(request.client)
            raise
        finally:
            meter.charge()
        if not self._admission.claim(question):
            # It was told busy meanwhile, so it does not drive this.
            if request.client:
                self._plans.forget(request.client)
            return
        with query:
            query.reply(query.key_expr, payload, encoding=codec.encoding_of(PlanReply, written))
        self._shares.answered(request.client)
        self._seconds.append(time.monotonic() - question.arrived)
        self._counters["answered"] += 1
        self._planned(request, reply)
        self._counters["candidates_refused"] += sum(not c.usable for c in reply.ranking)

    def _turn_away(self) -> None:
        while (late := self._admission.late()) is not None:
            for question in late:
                if question.refusal:
                    self._counters["refused"] += 1
                    self._say(question, messages.ERROR, question.refusal)
                else:
                    self._counters["busy"] += 1
                    self._say(question, messages.BUSY, TOO_MANY)

    def _say(self, question: PendingQuery, status: str, reason: str) -> None:
        """An answer without plans, to a question that was claimed."""
        written = codec.format_of(str(question.query.encoding or ""))
        reply = PlanReply(status=status, reason=reason, service=self._config.id)
        try:
            with question.query as query:
                query.reply(
                    query.key_expr,
                    codec.encode(reply, written),
                    encoding=codec.encoding_of(PlanReply, written),
                )
        except zenoh.ZError as error:
            self._counters["replies_lost"] += 1
            _log.warning("a reply could not be sent: %s", error)


class _Several:
    """Declarations that are undeclared together."""

    def __init__(self, *declared: Any) -> None:
        self._declared = declared

    def undeclare(self) -> None:
        for one in self._declared:
            one.undeclare()
