"""Warnings of the service from connection reports of edges, and about routers."""

from __future__ import annotations

from typing import Any

import pytest

from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.peer_status import Connections, PeerStatus, router_warnings


class Sample:
    def __init__(self, payload: bytes, encoding: str) -> None:
        self.payload, self.encoding = payload, encoding


def report(status: PeerStatus, *missing: str, source: str = "ros") -> None:
    message = Connections(source=source, missing=list(missing))
    encoding = codec.encoding_of(Connections, Format.JSON)
    sample: Any = Sample(codec.encode(message, Format.JSON), encoding)
    status.take(sample)


def test_the_last_report_of_each_edge_is_shown_while_it_is_recent() -> None:
    status = PeerStatus()
    report(status, "no subscriber of /speed_limit")
    report(status, "a", "b", source="other")
    assert status.warnings() == ["other: a", "other: b", "ros: no subscriber of /speed_limit"]
    report(status, source="other")
    assert status.warnings() == ["ros: no subscriber of /speed_limit"]
    expired = PeerStatus(max_age=-1.0)
    report(expired, "a")
    assert expired.warnings() == []


def test_invalid_reports_are_ignored() -> None:
    status = PeerStatus()
    for payload in (b"", b"{}", b'{"source": "a", "missing": 3}'):
        sample: Any = Sample(payload, Format.JSON.value)
        status.take(sample)
    assert status.warnings() == []


def test_the_number_of_reports_is_bounded() -> None:
    status = PeerStatus()
    for n in range(20):
        report(status, *("x" * 20), source=f"{n}")
    assert len(status.warnings()) == 16 * 16


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
    assert len(router_warnings(session, mode)) == count
