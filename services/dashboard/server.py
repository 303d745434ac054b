"""The HTTP server of a service, limited in threads, connections and the size of requests."""

from __future__ import annotations

import ipaddress
import threading
from typing import Any

from slopewise.models.errors import InputError
from slopewise.services.settings.service_settings import PageSettings

_THREADS = 2
"""Threads that answer [1]; planning needs the processors."""

_MAX_CONNECTIONS = 200
"""Open connections [1]: waitress refuses more, and each browser holds a few."""
_IDLE_TIMEOUT, _CLEANUP_INTERVAL = 2, 1
"""Idle connections are closed after that time, checked at that interval [s]: `/health` is answered
however many a client holds open."""

_MAX_BODY, _MAX_HEADER = 1000, 16_000
"""Largest request [B]: the page sends no bodies, and browsers send less than 16 kB of headers."""


class PageServer:
    """Serves an application until it is closed."""

    def __init__(self, settings: PageSettings, application: Any) -> None:
        """Listen from now on; an InputError if the address is in use."""
        from waitress.server import create_server

        try:
            self._server: Any = create_server(
                application,
                host=settings.host,
                port=settings.port,
                threads=_THREADS,
                connection_limit=_MAX_CONNECTIONS,
                channel_timeout=_IDLE_TIMEOUT,
                cleanup_interval=_CLEANUP_INTERVAL,
                max_request_body_size=_MAX_BODY,
                max_request_header_size=_MAX_HEADER,
                ident=None,
            )
        except (OSError, ValueError) as error:
            expected = f"expected a free address, got {settings.host}:{settings.port}: {error}"
            raise InputError("page", "port", expected) from None
        threading.Thread(target=self._server.run, name="page", daemon=True).start()

    def close(self) -> None:
        """Stop listening; requests being answered are completed."""
        # In the server's thread, which waits on these sockets; that may be awake already, and must
        # not close the trigger before it is pulled.
        trigger = self._server.trigger
        with trigger.lock:
            trigger.thunks.append(self._server.close)
            trigger.pull_trigger()


def allowed_hosts(host: str) -> frozenset[str]:
    """Host names that a server on the loopback accepts; empty for any other: it accepts all."""
    try:
        loopback = ipaddress.ip_address(host).is_loopback
    except ValueError:
        loopback = host == "localhost"
    return frozenset({"127.0.0.1", "localhost", "[::1]", host}) if loopback else frozenset()
