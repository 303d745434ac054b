"""Warnings of the service from connection reports of edges, and about routers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import zenoh

from slopewise.models.errors import InputError
from slopewise.services.settings.service_settings import ServiceConfig, ZenohSettings
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.connect import client_session, error_text, options
from slopewise.services.wire.peer_status import Connections, PeerStatus, router_warnings
from tests.services.command_line import one_line_of, slopewise
from tests.services.service_process import Running, free_port


def test_a_missing_service_is_reported() -> None:
    with pytest.raises(InputError, match="--connect: expected a service at tcp"):
        client_session(f"tcp/127.0.0.1:{free_port()}")


def test_positions_in_the_source_of_zenoh_are_removed() -> None:
    error = zenoh.ZError("No way [in use at /src/x/tcp.rs:61.] at /src/y/unicast.rs:338.")
    assert error_text(error) == "No way [in use]"


def test_an_address_in_use_is_one_line(service: Running, tmp_path: Path) -> None:
    settings = tmp_path / "second.toml"
    settings.write_text(f'model = "atv"\n[zenoh]\nlisten = ["{service.endpoint}"]\n')
    done = slopewise("serve", "--config", settings, timeout=120.0)
    one_line_of(done, "in use")
    assert ".rs" not in done.stderr


@pytest.mark.parametrize(
    ("namespace", "settings", "expected"),
    [
        ("slopewise/robot", {}, ""),
        ("slopewise/robot", {"listen": ("tcp/0.0.0.0:7447",)}, ""),
        (
            "farm/atv-3",
            {"listen": ("tcp/10.0.0.7:7447",)},
            "--connect tcp/10.0.0.7:7447 --namespace farm/atv-3",
        ),
        (
            "slopewise/robot",
            {"listen": ("tls/[::]:7443",)},
            "--connect tls/[::1]:7443 --zenoh FILE",
        ),
        (
            "slopewise/robot",
            {"mode": "client", "connect": ("tcp/router:7447",)},
            "--connect tcp/router:7447",
        ),
    ],
)
def test_options_reach_the_service(namespace: str, settings: dict[str, Any], expected: str) -> None:
    config = ServiceConfig(model="atv", namespace=namespace, zenoh=ZenohSettings(**settings))
    assert " ".join(options(config)) == expected


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
