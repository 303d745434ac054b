"""Messages of ROS 2 that wait to be processed."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import zenoh

from slopewise.models.errors import InputError
from slopewise.services.io.bags import read_cdr

_MAX_BYTES = 64_000_000  # Size of a message: a grid map of 16 million cells [bytes]

_MAX_WAITING = 100
"""Messages of a topic in :attr:`Inbox.all_of` that may wait: a second of /tf at 100 Hz [1]."""


@dataclass(slots=True)
class Received:
    """Message that is not decoded yet; ``at``: arrival, monotonic clock [s]."""

    raw: bytes
    at: float
    attachment: bytes = b""


@dataclass
class Inbox:
    """Newest messages of each topic; zenoh's threads fill it, one thread takes from it.

    Attributes:
        counters: messages that were received, replaced before they were taken, or refused.
        all_of: topics of which every message is kept; of others the newest is.
    """

    clock: Callable[[], float] = time.monotonic  # monotonic clock [s]
    counters: Counter[str] = field(default_factory=Counter)
    refused: dict[str, str] = field(default_factory=dict)
    news: threading.Condition = field(default_factory=threading.Condition)
    all_of: set[str] = field(default_factory=set)
    _waiting: dict[str, deque[Received]] = field(default_factory=dict)

    def put(self, topic: str, raw: bytes, attachment: bytes = b"") -> None:
        """Keep a message; where the topic is full, it replaces the oldest."""
        with self.news:
            capacity = _MAX_WAITING if topic in self.all_of else 1
            waiting = self._waiting.setdefault(topic, deque(maxlen=capacity))
            self.counters["received"] += 1
            self.counters["replaced"] += len(waiting) == capacity
            waiting.append(Received(raw, self.clock(), attachment))
            self.news.notify_all()

    def refuse(self, topic: str, reason: str) -> None:
        """Count a message that cannot be used."""
        with self.news:
            self.counters["refused"] += 1
            self.refused[topic] = reason

    def take(self, topics: tuple[str, ...], until: float) -> dict[str, list[Received]]:
        """Messages of some topics, newest last; waits for the first one, until then [s]."""
        with self.news:
            while not any(t in self._waiting for t in topics):
                remaining = until - self.clock()
                if remaining <= 0.0:
                    return {}
                self.news.wait(remaining)
            return {t: list(self._waiting.pop(t)) for t in topics if t in self._waiting}


def keeper(
    inbox: Inbox, name: str, kind: str, hashes: set[str] | None
) -> Callable[[zenoh.Sample], None]:
    """Callback that keeps samples of a topic under known hashes; None: keys have no hash."""

    def on_sample(sample: zenoh.Sample) -> None:
        type_hash = str(sample.key_expr).rsplit("/", 1)[-1]
        if hashes is not None and type_hash not in hashes:
            inbox.refuse(name, f"expected {kind} as defined by {', '.join(sorted(hashes))}")
        elif (size := len(sample.payload)) > _MAX_BYTES:
            inbox.refuse(name, f"expected at most {_MAX_BYTES} bytes, got {size}")
        else:
            # Older releases encode attachments in another form; they are optional.
            attached = b"" if sample.attachment is None else sample.attachment.to_bytes()
            inbox.put(name, sample.payload.to_bytes(), attached)

    return on_sample


def decoded(inbox: Inbox, topic: str, received: Received, kind: str) -> Any | None:
    """Message from the inbox; None, counted, if its bytes are not exactly one."""
    try:
        return read_cdr(received.raw, kind, topic, "")
    except InputError as error:
        inbox.refuse(topic, str(error))
        return None
