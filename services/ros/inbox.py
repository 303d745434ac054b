"""Messages of ROS 2 that wait to be looked at, and what makes them wait."""

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

_MOST_BYTES = 64_000_000
_MOST_WAITING = 100


@dataclass(slots=True)
class Received:
    """A message, not decoded yet. ``at``: monotonic clock [s]; ``attachment``: beside it."""

    raw: bytes
    at: float
    attachment: bytes = b""


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

    def put(self, topic: str, raw: bytes, attachment: bytes = b"") -> None:
        """Keep a message; where there is no room, the oldest makes it."""
        with self.news:
            most = _MOST_WAITING if topic in self.all_of else 1
            waiting = self._waiting.setdefault(topic, deque(maxlen=most))
            self.counters["received"] += 1
            self.counters["replaced"] += len(waiting) == most
            waiting.append(Received(raw, self.clock(), attachment))
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


def keeper(
    inbox: Inbox, name: str, kind: str, known: set[str] | None
) -> Callable[[zenoh.Sample], None]:
    """What puts samples of a topic into the inbox; ``known`` hashes, None where keys have none."""

    def on_sample(sample: zenoh.Sample) -> None:
        type_hash = str(sample.key_expr).rsplit("/", 1)[-1]
        if known is not None and type_hash not in known:
            inbox.refuse(name, f"expected {kind} as defined by {', '.join(sorted(known))}")
            return
        if len(sample.payload) > _MOST_BYTES:
            found = f"got {len(sample.payload)}"
            inbox.refuse(name, f"expected at most {_MOST_BYTES} bytes, {found}")
            return
        # Older releases write what is attached in another way; nothing here depends on it.
        beside = b"" if sample.attachment is None else sample.attachment.to_bytes()
        inbox.put(name, sample.payload.to_bytes(), beside)

    return on_sample


def decoded(inbox: Inbox, topic: str, received: Received, kind: str) -> Any | None:
    """A message out of the inbox; None, counted, if its bytes are not exactly one."""
    try:
        return read_cdr(received.raw, kind, topic, "")
    except InputError as error:
        inbox.refuse(topic, str(error))
        return None
