"""A live page served in this process, and requests to it."""

from __future__ import annotations

import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from slopewise.services.dashboard.live_state import LiveState
from slopewise.services.dashboard.server import PageServer, allowed_hosts
from slopewise.services.dashboard.site import Site, Source
from slopewise.services.planning.map_store import MapSnapshot
from slopewise.services.settings.service_settings import PageSettings
from slopewise.services.wire.plan_messages import Parameters, ServiceStatus
from tests.services.service_process import free_port

HOSTILE = "<img src=x onerror=alert(1)>"


def status(**changes: Any) -> ServiceStatus:
    fields: dict[str, Any] = {
        "service": "robot",
        "uptime": 1.0,
        "map_version": 0,
        "map_age": None,
        "flags": [],
        "counters": {},
        "parameters": Parameters(version=30, name="atv", fingerprint="f", age=1.0),
        "seconds": {"median": 0.0, "p99": 0.0},
    }
    return ServiceStatus(**(fields | changes))


@contextmanager
def served(
    page: LiveState, ground: MapSnapshot | None = None, token: str = "", **changes: Any
) -> Iterator[str]:
    port = free_port()
    source = Source(status=lambda: status(**changes), ground=lambda: ground, board=page)
    site = Site(source, allowed_hosts("127.0.0.1"), token)
    server = PageServer(PageSettings(enabled=True, port=port), site)
    try:
        yield f"http://127.0.0.1:{port}"
    finally:
        server.close()


def get(url: str, method: str = "GET", **headers: str) -> tuple[int, str, str]:
    """Status, cookie and body of a reply."""
    request = urllib.request.Request(url, headers=headers, method=method)
    try:
        with urllib.request.urlopen(request, timeout=5.0) as reply:
            return reply.status, reply.headers.get("Set-Cookie", ""), reply.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, "", error.read().decode()
