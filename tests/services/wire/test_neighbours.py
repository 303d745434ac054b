"""What an edge says of who hears it is a flag of the service, as long as it is fresh."""

from __future__ import annotations

from typing import Any

import pytest

from slopewise.services.wire import codec, neighbours
from slopewise.services.wire.codec import Format
from slopewise.services.wire.neighbours import Connections, Neighbours, peer_flags


class Sample:
    def __init__(self, payload: bytes, encoding: str) -> None:
        self.payload, self.encoding = payload, encoding


def said(told: Neighbours, *missing: str, source: str = "ros") -> None:
    message = Connections(source=source, missing=list(missing))
    encoding = codec.encoding_of(Connections, Format.JSON)
    sample: Any = Sample(codec.encode(message, Format.JSON), encoding)
    told._on_word(sample)


def test_the_last_word_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    told = Neighbours()
    said(told, "nobody subscribes to /speed_limit")
    said(told, "a", "b", source="other")
    assert told.flags() == ["other: a", "other: b", "ros: nobody subscribes to /speed_limit"]
    said(told, source="other")
    assert told.flags() == ["ros: nobody subscribes to /speed_limit"]
    monkeypatch.setattr(neighbours, "_FRESH", -1.0)
    assert told.flags() == []


def test_what_is_no_word_counts_for_nothing() -> None:
    told = Neighbours()
    for payload in (b"", b"{}", b'{"source": "a", "missing": 3}'):
        sample: Any = Sample(payload, Format.JSON.value)
        told._on_word(sample)
    assert told.flags() == []


class Session:
    def __init__(self, routers: int) -> None:
        self.info, self._routers = self, routers

    def routers_zid(self) -> list[int]:
        return list(range(self._routers))


@pytest.mark.parametrize(
    ("mode", "routers", "count"), [("peer", 1, 1), ("peer", 0, 0), ("client", 1, 0)]
)
def test_peers_behind_a_router_are_warned(mode: str, routers: int, count: int) -> None:
    session: Any = Session(routers)
    assert len(peer_flags(session, mode)) == count
