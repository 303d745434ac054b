"""The pages and figures of a service as a web application; everything may only be read.

``/`` the live page · ``/state``, ``/learned``, ``/map`` what it draws · ``/health`` 200 while plans
can be made · ``/metrics`` for Prometheus.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from threading import Lock
from typing import Any

from prometheus_client import make_wsgi_app

from slopewise.services.dashboard import metrics, view
from slopewise.services.dashboard.board import Board
from slopewise.services.dashboard.token import cookie, knows
from slopewise.services.planning.map_store import MapSnapshot
from slopewise.services.report.page import render
from slopewise.services.report.plan_labels import limit_colours
from slopewise.services.report.relief import relief
from slopewise.services.wire.plan_messages import ServiceStatus

_SCRIPTS = (
    "uPlot.iife.min.js",
    "page.js",
    "painter.js",
    "charts.js",
    "live_map.js",
    "live_finding.js",
    "live.js",
)
_HEADERS = [
    ("Cache-Control", "no-store"),
    ("X-Content-Type-Options", "nosniff"),
    ("X-Frame-Options", "DENY"),
    ("Referrer-Policy", "no-referrer"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
]

_MOST_CELLS = 400
_SHARE = 0.05
"""Of a processor, for drawing maps."""

Start = Callable[[str, list[tuple[str, str]]], Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """Where the site takes things from; all may be asked from any thread."""

    status: Callable[[], ServiceStatus]
    ground: Callable[[], MapSnapshot | None]
    board: Board


class Site:
    """A WSGI application.

    Args:
        source: what to show. hosts: names under which it may be asked, so that no page of somebody
            else reaches it through the browser of a visitor; none: under any.
        token: that everybody who asks has to know; "" for none.
    """

    def __init__(
        self, source: Source, hosts: frozenset[str] = frozenset(), token: str = ""
    ) -> None:
        self._source, self._hosts, self._token = source, hosts, token
        self._metrics = make_wsgi_app(metrics.registry(source.status))
        self._page = self._html().encode()
        self._lock = Lock()
        self._drawn: tuple[int, bytes] = (-1, b"null")
        self._again = 0.0
        self._answers: dict[str, Callable[[], tuple[str, str, bytes]]] = {
            "/": lambda: ("200 OK", "text/html; charset=utf-8", self._page),
            "/state": lambda: _json(view.state(source.status(), source.board)),
            "/learned": lambda: _json(view.learned(source.board)),
            "/map": lambda: ("200 OK", "application/json", self._relief()),
            "/health": self._health,
        }

    def __call__(self, environ: dict[str, Any], start: Start) -> Iterable[bytes]:
        """Answer one request."""
        path = environ.get("PATH_INFO", "/")
        name = environ.get("HTTP_HOST", "").rpartition(":")[0] or environ.get("HTTP_HOST", "")
        if self._hosts and name not in self._hosts:
            status, kind, body = _text("403 Forbidden", "asked under a name that is not ours")
        elif self._token and not knows(environ, self._token):
            status, kind, body = _text("401 Unauthorized", "expected the token of this page")
        elif environ["REQUEST_METHOD"] not in ("GET", "HEAD"):
            status, kind, body = _text("405 Method Not Allowed", "may only be read")
        elif path == "/metrics":
            found: Iterable[bytes] = self._metrics(environ, start)
            return found
        elif (answer := self._answers.get(path)) is None:
            status, kind, body = _text("404 Not Found", "not here")
        else:
            status, kind, body = answer()
        headers = [("Content-Type", kind), ("Content-Length", str(len(body))), *_HEADERS]
        if self._token and path == "/" and status.startswith("200"):
            headers.append(("Set-Cookie", cookie(self._token)))
        start(status, headers)
        return [] if environ["REQUEST_METHOD"] == "HEAD" else [body]

    def _html(self) -> str:
        return render(
            "live.html",
            {},
            title="slopewise live",
            styles=("uPlot.min.css", "page.css", "colours.css", "live.css", "live_finding.css"),
            extra_style=limit_colours(),
            scripts=_SCRIPTS,
            data={},
            asks_server=True,
        )

    def _health(self) -> tuple[str, str, bytes]:
        status = self._source.status()
        # Without ground there is nothing to plan on, and robots are told to brake.
        able = status.map_version > 0
        body = {"able": able, "flags": status.flags, "uptime": status.uptime}
        return _json(body, "200 OK" if able else "503 Service Unavailable")

    def _relief(self) -> bytes:
        """Description and picture of the ground as JSON, drawn once a version.

        Drawing takes the processor from planning, so it may have a small share of it only: where
        the map changes quicker than that, an older picture is shown.
        """
        ground = self._source.ground()
        with self._lock:
            if ground is None:
                return b"null"
            begun = time.thread_time()
            if self._drawn[0] != ground.version and time.monotonic() >= self._again:
                picture, table = relief(ground.elevation_map, _MOST_CELLS)
                told = {"version": ground.version, "picture": picture, **table}
                self._drawn = ground.version, json.dumps(told, allow_nan=False).encode()
                self._again = time.monotonic() + (time.thread_time() - begun) / _SHARE
            return self._drawn[1]


def _json(value: Any, status: str = "200 OK") -> tuple[str, str, bytes]:
    return status, "application/json", json.dumps(value, allow_nan=False).encode()


def _text(status: str, words: str) -> tuple[str, str, bytes]:
    return status, "text/plain; charset=utf-8", f"{words}\n".encode()
