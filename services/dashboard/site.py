"""The pages and figures of a service as a read-only web application.

``/`` the live page · ``/state``, ``/learned``, ``/map`` its content · ``/health`` 200 while plans
can be made · ``/metrics`` for Prometheus.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from threading import Lock
from typing import Any

from prometheus_client import make_wsgi_app

from slopewise.services.dashboard import prometheus_metrics, view
from slopewise.services.dashboard.live_state import LiveState
from slopewise.services.dashboard.token import cookie, has_valid_token
from slopewise.services.planning.map_store import MapSnapshot
from slopewise.services.report.page import render
from slopewise.services.report.plan_labels import limit_colours
from slopewise.services.report.relief import relief
from slopewise.services.wire.plan_messages import ServiceStatus

_PARTS = ("page", "painter", "charts", "live_map", "live_finding", "live")
_SCRIPTS = ("uPlot.iife.min.js", *(f"{part}.js" for part in _PARTS))
_STYLES = ("uPlot.min.css", "page.css", "colours.css", "live.css", "live_finding.css")
_HEADERS = [
    ("Cache-Control", "no-store"),
    ("X-Content-Type-Options", "nosniff"),
    ("X-Frame-Options", "DENY"),
    ("Referrer-Policy", "no-referrer"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
]

_MAX_CELLS = 400
"""Cells of the map's picture along its longer side [1], as many as the page has pixels for."""

_DRAWING_SHARE = 0.05
"""Share of a processor for drawing maps [1]; planning needs the rest."""

Start = Callable[[str, list[tuple[str, str]]], Any]
Answer = tuple[str, str, bytes]
"""Status, content type and body."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """Content of the site; all may be called from any thread."""

    status: Callable[[], ServiceStatus]
    ground: Callable[[], MapSnapshot | None]
    board: LiveState


class Site:
    """A WSGI application that shows a source, to those who show the token, if there is one.

    Hosts are accepted names, so that pages of other sites do not reach it through a visitor's
    browser; empty: any.
    """

    def __init__(
        self, source: Source, hosts: frozenset[str] = frozenset(), token: str = ""
    ) -> None:
        self._source, self._hosts, self._token = source, hosts, token
        self._metrics = make_wsgi_app(prometheus_metrics.registry(source.status))
        self._page = render(
            "live.html",
            {},
            title="slopewise live",
            styles=_STYLES,
            extra_style=limit_colours(),
            scripts=_SCRIPTS,
            data={},
            asks_server=True,
        ).encode()
        self._lock = Lock()
        self._relief: tuple[int, bytes] = (-1, b"null")
        self._next_drawing = 0.0
        self._answers: dict[str, Callable[[], Answer]] = {
            "/": lambda: ("200 OK", "text/html; charset=utf-8", self._page),
            "/state": lambda: _json(view.state(source.status(), source.board)),
            "/learned": lambda: _json(view.learned(source.board)),
            "/map": lambda: ("200 OK", "application/json", self._map()),
            "/health": self._health,
        }

    def __call__(self, environ: dict[str, Any], start: Start) -> Iterable[bytes]:
        """Answer one request."""
        path = environ.get("PATH_INFO", "/")
        refusal = self._refusal(environ)
        if refusal is None and path == "/metrics":
            metrics: Iterable[bytes] = self._metrics(environ, start)
            return metrics
        missing = partial(_text, "404 Not Found", "no page at this address")
        status, kind, body = refusal or self._answers.get(path, missing)()
        headers = [("Content-Type", kind), ("Content-Length", str(len(body))), *_HEADERS]
        if self._token and path == "/" and status.startswith("200"):
            headers.append(("Set-Cookie", cookie(self._token)))
        start(status, headers)
        return [] if environ["REQUEST_METHOD"] == "HEAD" else [body]

    def _refusal(self, environ: dict[str, Any]) -> Answer | None:
        name = environ.get("HTTP_HOST", "").rpartition(":")[0] or environ.get("HTTP_HOST", "")
        if self._hosts and name not in self._hosts:
            return _text("403 Forbidden", "expected a host name of this service")
        if self._token and not has_valid_token(environ, self._token):
            return _text("401 Unauthorized", "expected the token of this page")
        if environ["REQUEST_METHOD"] not in ("GET", "HEAD"):
            return _text("405 Method Not Allowed", "read-only: expected GET or HEAD")
        return None

    def _health(self) -> Answer:
        status = self._source.status()
        # Without a map there are no plans, and robots brake.
        able = status.map_version > 0
        body = {"able": able, "flags": status.flags, "uptime": status.uptime}
        return _json(body, "200 OK" if able else "503 Service Unavailable")

    def _map(self) -> bytes:
        """Description and picture of the map as JSON, drawn once per version.

        Drawing has a small share of the processor only: where the map changes faster than that,
        an older picture is shown.
        """
        ground = self._source.ground()
        with self._lock:
            if ground is None:
                return b"null"
            begun = time.thread_time()
            if self._relief[0] != ground.version and time.monotonic() >= self._next_drawing:
                picture, table = relief(ground.elevation_map, _MAX_CELLS)
                content = {"version": ground.version, "picture": picture, **table}
                self._relief = ground.version, json.dumps(content, allow_nan=False).encode()
                duration = time.thread_time() - begun
                self._next_drawing = time.monotonic() + duration / _DRAWING_SHARE
            return self._relief[1]


def _json(value: Any, status: str = "200 OK") -> Answer:
    return status, "application/json", json.dumps(value, allow_nan=False).encode()


def _text(status: str, message: str) -> Answer:
    return status, "text/plain; charset=utf-8", f"{message}\n".encode()
