"""Does anybody hear us, and do we hear anybody? If not, the likely cause in words.

A wrong type hash, domain or namespace is silence at both ends; tokens tell it.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from slopewise.services.io.bags import type_hashes
from slopewise.services.ros.graph import Endpoint, Graph, Speech, others_domains
from slopewise.services.ros.naming import NO_HASH, NULL_HASH, PUBLISHER, SUBSCRIPTION

_SHORT = 15


@dataclass(frozen=True, slots=True)
class OwnTopic:
    """One of our topics.

    Attributes:
        topic: with its namespace. kind: its type. ours: `naming.PUBLISHER` or `SUBSCRIPTION`.
    """

    topic: str
    kind: str
    ours: str

    @property
    def theirs(self) -> str:
        """The entity at the other end."""
        return SUBSCRIPTION if self.ours == PUBLISHER else PUBLISHER


@dataclass(frozen=True, slots=True)
class TopicAudience:
    """Who is at the other end of a line: nodes; or nobody, and why in words."""

    line: OwnTopic
    nodes: tuple[str, ...]
    missing: str = ""


def audience_of(line: OwnTopic, graph: Graph, speeches: Collection[Speech]) -> TopicAudience:
    """Who hears what we publish, or publishes what we want to hear.

    Args:
        line: a topic of ours. graph: of others. speeches: in which keys we speak and listen.
    """
    there = [e for e in graph.here() if e.entity == line.theirs]
    matched = [e for e in there if _matches(e, line, speeches)]
    if matched:
        return TopicAudience(line, tuple(sorted({e.node for e in matched})))
    verb = "subscribes to" if line.ours == PUBLISHER else "publishes"
    cause = _cause(line, there, graph, speeches)
    return TopicAudience(
        line, (), f"nobody {verb} {line.topic} with our type, {line.kind}: {cause}"
    )


def _matches(other: Endpoint, line: OwnTopic, speeches: Collection[Speech]) -> bool:
    same = other.topic == line.topic and other.kind == line.kind
    if not same or other.speech not in speeches:
        return False
    known = type_hashes(line.kind)
    # What is published has one hash; what is heard may have any that is known.
    taken = known[:1] if line.ours == PUBLISHER else known
    return other.domain is None or other.type_hash in (*taken, NO_HASH, NULL_HASH)


def _cause(
    line: OwnTopic, there: list[Endpoint], graph: Graph, speeches: Collection[Speech]
) -> str:
    on_topic = [e for e in there if e.topic == line.topic]
    for other in on_topic:
        if other.kind != line.kind:
            return f"{other.node} has it as {other.kind}"
        if other.speech not in speeches:
            return f"{other.node} speaks {other.speech.value}; set ros.distribution to it, or auto"
        return (
            f"{other.node} has it under another hash, {other.type_hash[:_SHORT]}…, which is "
            "another definition of the type: another version of its package"
        )
    base = line.topic.rpartition("/")[2]
    for other in there:
        if other.kind == line.kind and other.topic.rpartition("/")[2] == base:
            return f"{other.node} has {other.topic} instead: another namespace, or a remapping"
    same_type = sorted({e.topic for e in there if e.kind == line.kind})
    if same_type:
        return f"others have that type on {', '.join(same_type[:3])}"
    everybody = graph.all()
    nodes = {e.node for e in everybody if e.domain in (graph.domain, None)}
    if nodes:
        return f"{len(nodes)} nodes are seen, and none of them has the topic"
    if domains := others_domains(everybody, graph.domain):
        there_are = ", ".join(map(str, domains))
        return f"others are in ROS_DOMAIN_ID {there_are}, we are in {graph.domain}"
    return (
        "no node of ROS 2 is seen at all: it runs without rmw_zenoh, at another router, or as a "
        "peer behind a router that does not forward to peers"
    )
