"""Connection reports of edges to other systems, and routers that may hide peers."""

from __future__ import annotations

import time
from typing import Any, ClassVar

import zenoh

from slopewise.models.errors import InputError
from slopewise.services.wire import codec
from slopewise.services.wire.plan_messages import Message, Name

_MAX_AGE = 5.0  # age up to which a report is shown [s]: edges report each second
_MAX_REPORTS = 16  # Edges, and entries of each, that are shown [1]; bounds the status
_MAX_BYTES = 100_000  # largest report that is decoded [bytes]


class Connections(Message, frozen=True):
    """Report of an edge. ``missing``: topics without a publisher or subscriber, as text."""

    SCHEMA: ClassVar[str] = "connections"

    source: Name
    missing: list[str]


class PeerStatus:
    """Newest report of each edge; zenoh's threads write, any thread reads."""

    def __init__(self, max_age: float = _MAX_AGE) -> None:
        self._max_age = max_age
        self._reports: dict[str, tuple[float, list[str]]] = {}

    def declare(self, session: zenoh.Session, namespace: str) -> Any:
        """Subscribe; returns the declaration."""
        return session.declare_subscriber(f"{namespace}/v1/edge/*", self.take)

    def take(self, sample: zenoh.Sample) -> None:
        """Store a report; an invalid one is ignored, as no plan depends on it."""
        try:
            encoding = str(sample.encoding)
            report = codec.decode(Connections, sample.payload, encoding, "edge", _MAX_BYTES)
        except InputError:
            return
        if report.source in self._reports or len(self._reports) < _MAX_REPORTS:
            self._reports[report.source] = (time.monotonic(), report.missing[:_MAX_REPORTS])

    def warnings(self) -> list[str]:
        """Missing connections in recent reports."""
        now = time.monotonic()
        return [
            f"{source}: {text}"
            for source, (at, missing) in sorted(self._reports.items())
            if now - at <= self._max_age
            for text in missing
        ]


def router_warnings(session: zenoh.Session, mode: str) -> list[str]:
    """Warning if a router may not forward messages of other peers, as rmw_zenohd does not."""
    if mode != "peer" or not list(session.info.routers_zid()):
        return []
    fact = "this is a peer behind a router, and rmw_zenohd forwards nothing between peers"
    return [f'zenoh: {fact}: set mode = "client"']
