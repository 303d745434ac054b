"""A node of ROS 2 on a zenoh session: publishers, subscriptions, and the tokens that show them."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any

import zenoh
from zenoh.ext import HistoryConfig, declare_advanced_subscriber

from models.errors import InputError, ParameterError
from services.io.bags.ros_types import read_cdr, type_hashes, typestore
from services.ros import naming

_MOST_BYTES = 64_000_000
_MOST_WAITING = 100


@dataclass(slots=True)
class Received:
    """A message, not decoded yet. ``at``: monotonic clock [s]."""

    raw: bytes
    at: float


@dataclass
class Inbox:
    """The newest messages of each topic; zenoh's threads fill it, one thread takes from it.

    Attributes:
        counters: what was received, replaced before it was looked at, or refused.
        refused: why, by topic, the last time.
        clock: monotonic [s].
        all_of: topics of which every message counts, up to the last hundred; of others the newest.
    """

    clock: Callable[[], float] = time.monotonic
    counters: Counter[str] = field(default_factory=Counter)
    refused: dict[str, str] = field(default_factory=dict)
    news: threading.Condition = field(default_factory=threading.Condition)
    all_of: set[str] = field(default_factory=set)
    _waiting: dict[str, deque[Received]] = field(default_factory=dict)

    def put(self, topic: str, raw: bytes) -> None:
        """Keep a message; where there is no room, the oldest makes it."""
        with self.news:
            most = _MOST_WAITING if topic in self.all_of else 1
            waiting = self._waiting.setdefault(topic, deque(maxlen=most))
            self.counters["received"] += 1
            self.counters["replaced"] += len(waiting) == most
            waiting.append(Received(raw, self.clock()))
            self.news.notify_all()

    def refuse(self, topic: str, why: str) -> None:
        """Count a message that cannot be used."""
        with self.news:
            self.counters["refused"] += 1
            self.refused[topic] = why

    def take(self, topics: tuple[str, ...], until: float) -> dict[str, list[Received]]:
        """Messages of some topics, newest last; waits for the first one, until then [s]."""
        with self.news:
            while not any(t in self._waiting for t in topics):
                left = until - self.clock()
                if left <= 0.0:
                    return {}
                self.news.wait(left)
            return {t: list(self._waiting.pop(t)) for t in topics if t in self._waiting}


class Publisher:
    """Messages of one type on one topic."""

    def __init__(self, session: zenoh.Session, key: str, kind: str, token: str) -> None:
        """Made by :meth:`Node.publisher`."""
        self._kind, self._gid, self._sequence = kind, naming.gid_of(token), 0
        self._publisher = session.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.DROP, express=True
        )

    def send(self, message: Any) -> None:
        """Send one message."""
        self._sequence += 1
        attachment = naming.Attachment(self._sequence, time.time_ns(), self._gid)
        payload = bytes(typestore().serialize_cdr(message, self._kind))
        self._publisher.put(payload, attachment=attachment.encode())


class Node:
    """A node; a context manager that leaves the session to whoever opened it."""

    def __init__(
        self, session: zenoh.Session, domain: int, namespace: str, name: str,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        """Show a node to others.

        Args:
            session: open. domain: ROS_DOMAIN_ID. namespace: e.g. ``/robot``. name: of the node.
            clock: monotonic [s].
        """
        self.inbox = Inbox(clock)
        self._session, self._namespace = session, namespace
        self._identity = naming.Identity(domain, str(session.info.zid()), namespace, name)
        self._domain, self._entities = domain, 0
        self._declared: list[Any] = [
            session.liveliness().declare_token(self._identity.node_token())
        ]

    def __enter__(self) -> Node:
        """Ready as it is."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        """Disappear from the graph."""
        for declared in reversed(self._declared):
            declared.undeclare()

    def publisher(self, topic: str, kind: str) -> Publisher:
        """Publish messages of a type; ``topic`` may be relative to the namespace."""
        name, type_hash = naming.full_name(self._namespace, topic), type_hashes(kind)[0]
        token = self._show(naming.PUBLISHER, name, kind, type_hash)
        key = naming.topic_key(self._domain, name, kind, type_hash)
        return Publisher(self._session, key, kind, token)

    def subscribe(self, topic: str, kind: str, *, latched: bool = False) -> str:
        """Let messages of a type come into the inbox, under the full name that is returned.

        Of what others publish on the topic under another definition of the type, nothing is taken.

        Args:
            topic: may be relative to the namespace. kind: its type.
            latched: ask for what was published before, as ROS 2 does of publishers that are
                ``transient_local``; others answer nothing.
        """
        name = naming.full_name(self._namespace, topic)
        known = {*type_hashes(kind), naming.NO_HASH}
        self._show(naming.SUBSCRIPTION, name, kind, type_hashes(kind)[0])
        key = naming.topic_key(self._domain, name, kind, "*")
        keep = _keep(self.inbox, name, kind, known)
        if latched:
            history = HistoryConfig(detect_late_publishers=True, max_samples=1)
            late = declare_advanced_subscriber(self._session, key, keep, history=history)
            self._declared.append(late)
        else:
            self._declared.append(self._session.declare_subscriber(key, keep))
        return name

    def _show(self, entity: str, name: str, kind: str, type_hash: str) -> str:
        self._entities += 1
        token = self._identity.token(self._entities, entity, name, kind, type_hash)
        self._declared.append(self._session.liveliness().declare_token(token))
        return token


def _keep(inbox: Inbox, name: str, kind: str, known: set[str]) -> Callable[[zenoh.Sample], None]:
    def on_sample(sample: zenoh.Sample) -> None:
        type_hash = str(sample.key_expr).rsplit("/", 1)[-1]
        if type_hash not in known:
            inbox.refuse(name, f"expected {kind} as defined by {', '.join(sorted(known))}")
            return
        if len(sample.payload) > _MOST_BYTES:
            found = f"got {len(sample.payload)}"
            inbox.refuse(name, f"expected at most {_MOST_BYTES} bytes, {found}")
            return
        try:
            if sample.attachment is not None:
                naming.read_attachment(sample.attachment.to_bytes())
        except ParameterError as error:
            inbox.refuse(name, str(error))
            return
        inbox.put(name, sample.payload.to_bytes())

    return on_sample


def decoded(inbox: Inbox, topic: str, received: Received, kind: str) -> Any | None:
    """A message out of the inbox; None, counted, if its bytes are not exactly one."""
    try:
        return read_cdr(received.raw, kind, topic, "")
    except InputError as error:
        inbox.refuse(topic, str(error))
        return None
