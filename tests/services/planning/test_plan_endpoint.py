from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from slopewise.services.planning.plan_endpoint import PlanEndpoint
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.plan_messages import Path, PlanReply, PlanRequest


class SessionStub:
    def __init__(self) -> None:
        self.callbacks: dict[str, Callable[[Any], None]] = {}

    def declare_queryable(self, key: str, callback: Callable[[Any], None], complete: bool) -> None:
        self.callbacks[key] = callback


class PlansStub:
    """Plans without planning; ``snapshot`` is the map."""

    snapshot = None

    def answer(self, request: PlanRequest, *_: object, **__: object) -> PlanReply:
        return PlanReply(status="ok", reason="", sequence=request.sequence, service="s")

    def forget(self, client: str) -> None:
        raise AssertionError(f"the plan of {client!r} is lost")


class ClosingQuery:
    """A query that zenoh closes while another thread answers it; see `drop` in zenoh-python."""

    key_expr = "slopewise/robot/v1/plan"

    def __init__(self, message: PlanRequest, written: Format) -> None:
        self._contents = codec.payload_of(message, written)
        self._callback_thread = threading.current_thread()
        self.parameters: dict[str, str] = {}
        self.replied = threading.Event()
        self.reply_contents: dict[str, Any] = {}

    def _read(self, name: str) -> Any:
        if threading.current_thread() is not self._callback_thread:
            raise RuntimeError("Already mutably borrowed")
        return self._contents[name]

    @property
    def payload(self) -> bytes:
        return self._read("payload")

    @property
    def encoding(self) -> str:
        return self._read("encoding")

    def __enter__(self) -> ClosingQuery:
        return self

    def __exit__(self, *_: object) -> None:
        self.replied.set()

    def reply(self, key: str, **contents: Any) -> None:
        self.reply_contents = contents


def test_a_worker_reads_nothing_of_a_query_that_another_thread_may_close() -> None:
    config, counters, session = ServiceConfig(model="atv"), Counter[str](), SessionStub()
    stub: Any = PlansStub()
    endpoint = PlanEndpoint(config, stub, stub, counters, lambda request, reply: None)
    endpoint.declare(session)
    endpoint.open()
    points = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    request = PlanRequest(speed=1.0, paths=[Path(name="a", points=points)], sequence=5)
    query = ClosingQuery(request, Format.JSON)
    session.callbacks[config.key("plan")](query)
    assert query.replied.wait(20.0)
    endpoint.close()
    contents = query.reply_contents
    assert contents["encoding"] == codec.encoding_of(PlanReply, Format.JSON)
    reply = codec.decode(PlanReply, contents["payload"], contents["encoding"], "plan", 10_000)
    assert (reply.status, reply.sequence) == ("ok", 5), reply.reason
    assert counters["faults"] == 0
