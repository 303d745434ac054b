"""Node of ROS 2 on a zenoh session: publishers, subscriptions, and the tokens that show them."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import zenoh
from zenoh.ext import HistoryConfig, declare_advanced_subscriber

from slopewise.services.io.bags import type_hashes, typestore
from slopewise.services.ros import naming
from slopewise.services.ros.graph import OF_DISTRIBUTION, Graph, KeyScheme
from slopewise.services.ros.inbox import Inbox, keeper
from slopewise.services.ros.topic_matching import OwnTopic, TopicMatch, match_topic


class Publisher:
    """Messages of one type on one topic, under every scheme in use; one thread at a time."""

    def __init__(self, topic: str, kind: str) -> None:
        """Made by :meth:`Node.publisher`."""
        self.topic, self.kind, self._sequence = topic, kind, 0
        # publisher of zenoh under each scheme, and the id of the sender there
        self.channels: list[tuple[Any, bytes]] = []

    def send(self, message: Any) -> None:
        self._sequence += 1
        payload = bytes(typestore().serialize_cdr(message, self.kind))
        now = time.time_ns()
        for publisher, gid in self.channels:
            attachment = naming.Attachment(self._sequence, now, gid)
            publisher.put(payload, attachment=attachment.encode())


class _Subscription(NamedTuple):
    topic: str
    kind: str
    latched: bool


class Node:
    """A node; a context manager that does not close its session."""

    def __init__(
        self,
        session: zenoh.Session,
        domain: int,
        namespace: str,
        name: str,
        clock: Callable[[], float] = time.monotonic,
        distribution: str = "auto",
    ) -> None:
        """Declare a node on a monotonic clock [s].

        ``distribution`` is a key of :data:`~slopewise.services.ros.graph.OF_DISTRIBUTION`; with
        ``auto``, schemes that :meth:`follow` finds in use are added.
        """
        self.inbox = Inbox(clock)
        self.graph = Graph(session, domain)
        self.schemes = [OF_DISTRIBUTION[distribution]]
        self._follows, self._checked = distribution == "auto", -1
        self._session, self._namespace = session, namespace
        self._identity = naming.Identity(domain, str(session.info.zid()), namespace, name)
        self._entities = 0
        self._publishers: list[Publisher] = []
        self._subscriptions: list[_Subscription] = []
        self._subscribed: set[tuple[str, bool]] = set()
        token = session.liveliness().declare_token(self._identity.node_token())
        self._declared: list[Any] = [token]

    def __enter__(self) -> Node:
        return self

    def __exit__(self, *_: object) -> None:
        """Disappear from the graph."""
        for declared in reversed(self._declared):
            declared.undeclare()
        self.graph.close()

    def publisher(self, topic: str, kind: str) -> Publisher:
        """Publish messages of a type; ``topic`` may be relative to the namespace."""
        publisher = Publisher(naming.full_name(self._namespace, topic), kind)
        self._publishers.append(publisher)
        for scheme in self.schemes:
            self._publish(scheme, publisher)
        return publisher

    def subscribe(self, topic: str, kind: str, *, latched: bool = False) -> str:
        """Receive messages of a type in the inbox, under the full name that is returned.

        Messages under another definition of the type are refused. ``latched`` asks for what was
        published before, as ROS 2 does of ``transient_local`` publishers; others do not reply.
        """
        wish = _Subscription(naming.full_name(self._namespace, topic), kind, latched)
        self._subscriptions.append(wish)
        for scheme in self.schemes:
            self._listen(scheme, wish)
        return wish.topic

    def follow(self) -> list[KeyScheme]:
        """Add schemes that others use, and return them; called by the thread that sends.

        A scheme stays in use: a robot that is gone for a moment has to receive us when it is back.
        """
        if not self._follows or self.graph.changes == self._checked:
            return []
        self._checked, visible = self.graph.changes, self.graph.schemes()
        new = [scheme for scheme in KeyScheme if scheme in visible and scheme not in self.schemes]
        for scheme in new:
            self.schemes.append(scheme)
            for publisher in self._publishers:
                self._publish(scheme, publisher)
            for subscription in self._subscriptions:
                self._listen(scheme, subscription)
        return new

    def matches(self) -> list[TopicMatch]:
        """Nodes at the other end of each of our topics."""
        topics = [OwnTopic(p.topic, p.kind, naming.PUBLISHER) for p in self._publishers]
        topics += [OwnTopic(s.topic, s.kind, naming.SUBSCRIPTION) for s in self._subscriptions]
        return [match_topic(topic, self.graph, self.schemes) for topic in topics]

    def _publish(self, scheme: KeyScheme, publisher: Publisher) -> None:
        topic, kind = publisher.topic, publisher.kind
        type_hash = naming.NO_HASH if scheme is KeyScheme.UNHASHED else type_hashes(kind)[0]
        token = self._declare_token(scheme, naming.PUBLISHER, topic, kind)
        declared = self._session.declare_publisher(
            self._key(scheme, topic, kind, type_hash),
            congestion_control=zenoh.CongestionControl.DROP,
            express=True,
        )
        publisher.channels.append((declared, naming.gid_of(token)))

    def _listen(self, scheme: KeyScheme, subscription: _Subscription) -> None:
        topic, kind, latched = subscription
        bridged = scheme is KeyScheme.BRIDGED
        if (topic, bridged) in self._subscribed:
            return  # one subscription receives messages with a hash and without
        self._subscribed.add((topic, bridged))
        hashes = None if bridged else {*type_hashes(kind), naming.NO_HASH, naming.NULL_HASH}
        key = self._key(scheme, topic, kind, "*")
        keep = keeper(self.inbox, topic, kind, hashes)
        self._declare_token(scheme, naming.SUBSCRIPTION, topic, kind)
        if latched:
            history = HistoryConfig(detect_late_publishers=True, max_samples=1)
            late = declare_advanced_subscriber(self._session, key, keep, history=history)
            self._declared.append(late)
        else:
            self._declared.append(self._session.declare_subscriber(key, keep))

    def _key(self, scheme: KeyScheme, topic: str, kind: str, type_hash: str) -> str:
        if scheme is KeyScheme.BRIDGED:
            return naming.bridged_key(topic)
        return naming.topic_key(self._identity.domain, topic, kind, type_hash)

    def _declare_token(self, scheme: KeyScheme, entity: str, name: str, kind: str) -> str:
        type_hash = type_hashes(kind)[0]
        if scheme is KeyScheme.BRIDGED:
            token = self._identity.bridged_token(entity, name, kind, type_hash)
        else:
            self._entities += 1
            shown = naming.NO_HASH if scheme is KeyScheme.UNHASHED else type_hash
            token = self._identity.token(self._entities, entity, name, kind, shown)
        self._declared.append(self._session.liveliness().declare_token(token))
        return token
