"""What diagnostics and log say of who hears us, and whom we hear."""

from __future__ import annotations

import logging
from collections.abc import Collection, Sequence

import zenoh

from slopewise.services.ros import conversions as ros
from slopewise.services.ros.audience import TopicAudience
from slopewise.services.ros.conversions import Condition
from slopewise.services.ros.graph import Speech
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.peer_status import Connections

_log = logging.getLogger("slopewise")


class ConnectionWatch:
    """Tells whenever somebody comes or goes who matters; one thread."""

    def __init__(
        self,
        needed: Collection[str],
        service: zenoh.Session | None = None,
        namespace: str = "",
        source: str = "",
    ) -> None:
        """Warn if nobody is at the other end of topics ``needed``; tell the service as well.

        Args:
            needed: full names. service, namespace: that the live page is of; None: none.
            source: name of the edge.
        """
        self._needed = frozenset(needed)
        self._source = source
        self._publisher = (
            None
            if service is None
            else service.declare_publisher(
                f"{namespace}/v1/edge/{source}", congestion_control=zenoh.CongestionControl.DROP
            )
        )
        self._last: dict[str, str] = {}
        self._told: dict[str, str] = {}

    def look(self, audiences: Sequence[TopicAudience], speeches: Collection[Speech]) -> Condition:
        """The condition now; what lasts goes to the log once."""
        missing = {a.line.topic: a.missing for a in audiences if a.line.topic in self._needed}
        for topic, words in missing.items():
            # Two looks have to agree: tokens come one after the other.
            if self._last.get(topic) == words and self._told.get(topic, "") != words:
                self._told[topic] = words
                _log.warning("%s", words or f"{topic}: somebody is there now")
        self._last = missing
        said = [words for words in missing.values() if words]
        if self._publisher is not None:
            self._publisher.put(
                codec.encode(Connections(source=self._source, missing=said), Format.JSON),
                encoding=codec.encoding_of(Connections, Format.JSON),
            )
        values = [(a.line.topic, a.missing or ", ".join(a.nodes)) for a in audiences]
        values.append(("speaks", "; ".join(s.value for s in speeches)))
        level = ros.WARN if said else ros.OK
        return Condition("connections", level, said[0] if said else "heard, and hearing", values)
