"""A node of ROS 2 on a zenoh session: publishers, subscriptions, and the tokens that show them."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import zenoh
from zenoh.ext import HistoryConfig, declare_advanced_subscriber

from slopewise.services.io.bags import type_hashes, typestore
from slopewise.services.ros import naming
from slopewise.services.ros.audience import OwnTopic, TopicAudience, audience_of
from slopewise.services.ros.graph import OF_DISTRIBUTION, Graph, Speech
from slopewise.services.ros.inbox import Inbox, keeper


@dataclass(slots=True)
class _Channel:
    """Where one speech has a topic: a publisher of zenoh, and the id of the sender there."""

    publisher: Any
    gid: bytes


class Publisher:
    """Messages of one type on one topic, in every speech that is spoken; one thread at a time."""

    def __init__(self, topic: str, kind: str) -> None:
        """Made by :meth:`Node.publisher`."""
        self.topic, self.kind, self._sequence = topic, kind, 0
        self.channels: dict[Speech, _Channel] = {}

    def send(self, message: Any) -> None:
        """Send one message."""
        self._sequence += 1
        payload = bytes(typestore().serialize_cdr(message, self.kind))
        now = time.time_ns()
        for channel in self.channels.values():
            attachment = naming.Attachment(self._sequence, now, channel.gid)
            channel.publisher.put(payload, attachment=attachment.encode())


@dataclass(frozen=True, slots=True)
class _Subscription:
    topic: str
    kind: str
    latched: bool


class Node:
    """A node; a context manager that leaves the session to whoever opened it."""

    def __init__(
        self,
        session: zenoh.Session,
        domain: int,
        namespace: str,
        name: str,
        clock: Callable[[], float] = time.monotonic,
        distribution: str = "auto",
    ) -> None:
        """Show a node to others.

        Args:
            session: open. domain: ROS_DOMAIN_ID. namespace: e.g. ``/robot``. name: of the node.
            clock: monotonic [s].
            distribution: of the robot, one of :data:`slopewise.services.ros.graph.OF_DISTRIBUTION`;
            with
                ``auto`` keys that :meth:`follow` finds in use are added.
        """
        self.inbox = Inbox(clock)
        self.graph = Graph(session, domain)
        self.speeches = list(OF_DISTRIBUTION[distribution])
        self._follows, self._looked_at = distribution == "auto", -1
        self._session, self._namespace = session, namespace
        self._identity = naming.Identity(domain, str(session.info.zid()), namespace, name)
        self._domain, self._entities = domain, 0
        self._publishers: list[Publisher] = []
        self._subscriptions: list[_Subscription] = []
        self._heard: set[tuple[str, bool]] = set()
        self._declared: list[Any] = [
            session.liveliness().declare_token(self._identity.node_token())
        ]

    def __enter__(self) -> Node:
        """Ready as it is."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Disappear from the graph."""
        for declared in reversed(self._declared):
            declared.undeclare()
        self.graph.close()

    def publisher(self, topic: str, kind: str) -> Publisher:
        """Publish messages of a type; ``topic`` may be relative to the namespace."""
        publisher = Publisher(naming.full_name(self._namespace, topic), kind)
        self._publishers.append(publisher)
        for speech in self.speeches:
            self._publish_in(speech, publisher)
        return publisher

    def subscribe(self, topic: str, kind: str, *, latched: bool = False) -> str:
        """Let messages of a type come into the inbox, under the full name that is returned.

        Of what others publish on the topic under another definition of the type, nothing is taken.

        Args:
            topic: may be relative to the namespace. kind: its type.
            latched: ask for what was published before, as ROS 2 does of publishers that are
                ``transient_local``; others answer nothing.
        """
        wanted = _Subscription(naming.full_name(self._namespace, topic), kind, latched)
        self._subscriptions.append(wanted)
        for speech in self.speeches:
            self._listen_in(speech, wanted)
        return wanted.topic

    def follow(self) -> list[Speech]:
        """Speak and listen in what others do as well; what is new. The thread that sends calls it.

        What was once spoken is spoken on: who is gone for a moment has to hear us when back.
        """
        if not self._follows or self.graph.changes == self._looked_at:
            return []
        self._looked_at, seen = self.graph.changes, self.graph.speeches()
        new = [s for s in Speech if s in seen and s not in self.speeches]
        for speech in new:
            self.speeches.append(speech)
            for publisher in self._publishers:
                self._publish_in(speech, publisher)
            for wanted in self._subscriptions:
                self._listen_in(speech, wanted)
        return new

    def audiences(self) -> list[TopicAudience]:
        """Who is at the other end of each of our topics."""
        lines = [OwnTopic(p.topic, p.kind, naming.PUBLISHER) for p in self._publishers]
        lines += [OwnTopic(s.topic, s.kind, naming.SUBSCRIPTION) for s in self._subscriptions]
        return [audience_of(line, self.graph, self.speeches) for line in lines]

    def _publish_in(self, speech: Speech, publisher: Publisher) -> None:
        topic, kind = publisher.topic, publisher.kind
        type_hash = naming.NO_HASH if speech is Speech.UNHASHED else type_hashes(kind)[0]
        key = naming.topic_key(self._domain, topic, kind, type_hash)
        key = naming.bridged_key(topic) if speech is Speech.BRIDGED else key
        token = self._show(speech, naming.PUBLISHER, topic, kind)
        declared = self._session.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.DROP, express=True
        )
        publisher.channels[speech] = _Channel(declared, naming.gid_of(token))

    def _listen_in(self, speech: Speech, wanted: _Subscription) -> None:
        topic, kind = wanted.topic, wanted.kind
        bridged = speech is Speech.BRIDGED
        if (topic, bridged) in self._heard:
            return  # one subscription takes messages with a hash and without
        self._heard.add((topic, bridged))
        known = None if bridged else {*type_hashes(kind), naming.NO_HASH, naming.NULL_HASH}
        key = naming.topic_key(self._domain, topic, kind, "*")
        key = naming.bridged_key(topic) if bridged else key
        keep = keeper(self.inbox, topic, kind, known)
        self._show(speech, naming.SUBSCRIPTION, topic, kind)
        if wanted.latched:
            history = HistoryConfig(detect_late_publishers=True, max_samples=1)
            late = declare_advanced_subscriber(self._session, key, keep, history=history)
            self._declared.append(late)
        else:
            self._declared.append(self._session.declare_subscriber(key, keep))

    def _show(self, speech: Speech, entity: str, name: str, kind: str) -> str:
        type_hash = type_hashes(kind)[0]
        if speech is Speech.BRIDGED:
            token = self._identity.bridged_token(entity, name, kind, type_hash)
        else:
            self._entities += 1
            shown = naming.NO_HASH if speech is Speech.UNHASHED else type_hash
            token = self._identity.token(self._entities, entity, name, kind, shown)
        self._declared.append(self._session.liveliness().declare_token(token))
        return token
