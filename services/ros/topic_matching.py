"""Topic matches: nodes at the other end of our topics, or the likely cause why they are missing.

A wrong type hash, domain or namespace is silence at both ends; liveliness tokens reveal it.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import zenoh

from slopewise.services.io.bags import type_hashes
from slopewise.services.ros import conversions as ros
from slopewise.services.ros.conversions import Condition
from slopewise.services.ros.graph import Endpoint, Graph, KeyScheme
from slopewise.services.ros.naming import NO_HASH, NULL_HASH, PUBLISHER, SUBSCRIPTION
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.peer_status import Connections

_log = logging.getLogger("slopewise")

_SHOWN_DIGITS = 15
"""Characters of a type hash that a message shows: the prefix and eight digits [1]."""


@dataclass(frozen=True, slots=True)
class OwnTopic:
    """One of our topics."""

    name: str
    kind: str
    entity: str  # `naming.PUBLISHER` or `SUBSCRIPTION`


@dataclass(frozen=True, slots=True)
class TopicMatch:
    """Nodes at the other end of a topic; without any, the cause as text."""

    topic: OwnTopic
    nodes: tuple[str, ...]
    missing: str = ""


def match_topic(topic: OwnTopic, graph: Graph, schemes: Collection[KeyScheme]) -> TopicMatch:
    """Nodes that receive what we publish, or publish what we subscribe to."""
    publishes = topic.entity == PUBLISHER
    theirs = SUBSCRIPTION if publishes else PUBLISHER
    candidates = [e for e in graph.here() if e.entity == theirs]
    if nodes := {e.node for e in candidates if _matches(e, topic, schemes)}:
        return TopicMatch(topic, tuple(sorted(nodes)))
    verb = "subscribes to" if publishes else "publishes"
    cause = _cause(topic, candidates, graph, schemes)
    return TopicMatch(
        topic, (), f"no node {verb} {topic.name} with our type, {topic.kind}: {cause}"
    )


def _matches(there: Endpoint, topic: OwnTopic, schemes: Collection[KeyScheme]) -> bool:
    if (there.topic, there.kind) != (topic.name, topic.kind) or there.scheme not in schemes:
        return False
    known = type_hashes(topic.kind)
    # A published message has one hash; a received one may have any that is known.
    accepted = known[:1] if topic.entity == PUBLISHER else known
    return there.domain is None or there.type_hash in (*accepted, NO_HASH, NULL_HASH)


def _cause(
    topic: OwnTopic, candidates: list[Endpoint], graph: Graph, schemes: Collection[KeyScheme]
) -> str:
    """Likely cause why no node is at the other end."""
    for there in (e for e in candidates if e.topic == topic.name):
        if there.kind != topic.kind:
            return f"{there.node} has it as {there.kind}"
        if there.scheme not in schemes:
            return f"{there.node} speaks {there.scheme.value}; set ros.distribution to it, or auto"
        return (
            f"{there.node} has it under another hash, {there.type_hash[:_SHOWN_DIGITS]}…, which is "
            "another definition of the type: another version of its package"
        )
    same_type = [e for e in candidates if e.kind == topic.kind]
    base = topic.name.rpartition("/")[2]
    for there in same_type:
        if there.topic.rpartition("/")[2] == base:
            return f"{there.node} has {there.topic} instead: another namespace, or a remapping"
    if topics := sorted({e.topic for e in same_type}):
        return f"others have that type on {', '.join(topics[:3])}"
    visible = graph.all()
    if nodes := {e.node for e in visible if e.domain in (graph.domain, None)}:
        return f"{len(nodes)} nodes are seen, and none of them has the topic"
    if domains := sorted({e.domain for e in visible if e.domain is not None}):
        ids = ", ".join(map(str, domains))
        return f"others are in ROS_DOMAIN_ID {ids}, we are in {graph.domain}"
    return (
        "no node of ROS 2 is seen at all: it runs without rmw_zenoh, at another router, or as a "
        "peer behind a router that does not forward to peers"
    )


class ConnectionWatch:
    """Reports matches that are missing; one thread."""

    def __init__(
        self,
        required: Collection[str],
        service: zenoh.Session | None = None,
        namespace: str = "",
        source: str = "",
    ) -> None:
        """Warn, also on the live page of a service, if a required topic has no counterpart."""
        self._required, self._source = frozenset(required), source
        self._publisher = None
        if service is not None:
            self._publisher = service.declare_publisher(
                f"{namespace}/v1/edge/{source}", congestion_control=zenoh.CongestionControl.DROP
            )
        self._last: dict[str, str] = {}
        self._logged: dict[str, str] = {}

    def check(self, matches: Sequence[TopicMatch], schemes: Collection[KeyScheme]) -> Condition:
        """Condition now; one that lasts is logged once."""
        missing = {m.topic.name: m.missing for m in matches if m.topic.name in self._required}
        for topic, text in missing.items():
            # Two checks have to agree: tokens come one after the there.
            if self._last.get(topic) == text and self._logged.get(topic, "") != text:
                self._logged[topic] = text
                _log.warning("%s", text or f"{topic}: a node is there now")
        self._last = missing
        texts = [text for text in missing.values() if text]
        if self._publisher is not None:
            report = Connections(source=self._source, missing=texts)
            self._publisher.put(**codec.payload_of(report, Format.JSON))
        values = [(m.topic.name, m.missing or ", ".join(m.nodes)) for m in matches]
        values.append(("speaks", "; ".join(scheme.value for scheme in schemes)))
        level, text = (ros.WARN, texts[0]) if texts else (ros.OK, "every topic has a counterpart")
        return Condition("connections", level, text, values)
