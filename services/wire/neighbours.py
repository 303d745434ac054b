"""What those beside the service tell of themselves: who hears them, and whom they hear."""

from __future__ import annotations

import time
from typing import Any, ClassVar

import zenoh

from slopewise.models.errors import InputError
from slopewise.services.wire import codec
from slopewise.services.wire.messages import Message, Name

_FRESH = 5.0
_MOST = 16
_LARGEST = 100_000


class Connections(Message, frozen=True):
    """Of an edge to another system. ``missing``: what nobody hears or says there, in words."""

    SCHEMA: ClassVar[str] = "connections"

    source: Name
    missing: list[str]


class Neighbours:
    """The newest word of each; zenoh's threads write, any thread reads."""

    def __init__(self) -> None:
        """Nobody yet."""
        self._told: dict[str, tuple[float, list[str]]] = {}

    def declare(self, session: zenoh.Session, namespace: str) -> Any:
        """Listen; what has to be undeclared in the end."""
        return session.declare_subscriber(f"{namespace}/v1/edge/*", self._on_word)

    def _on_word(self, sample: zenoh.Sample) -> None:
        try:
            word = codec.decode(Connections, sample.payload, str(sample.encoding), "edge", _LARGEST)
        except InputError:
            return  # nothing that a plan depends on
        if word.source in self._told or len(self._told) < _MOST:
            self._told[word.source] = (time.monotonic(), word.missing[:_MOST])

    def flags(self) -> list[str]:
        """What is not as it should be, of those who spoke of late."""
        now = time.monotonic()
        return [
            f"{source}: {words}"
            for source, (at, missing) in sorted(self._told.items())
            if now - at <= _FRESH
            for words in missing
        ]


def peer_flags(session: zenoh.Session, mode: str) -> list[str]:
    """Whether a router may keep from us what other peers say.

    Routers forward between clients and others, but, as rmw_zenohd is set up, not between peers.
    """
    if mode != "peer" or not list(session.info.routers_zid()):
        return []
    return [
        "zenoh: this is a peer behind a router, and rmw_zenohd forwards nothing between peers: set "
        'mode = "client"'
    ]
