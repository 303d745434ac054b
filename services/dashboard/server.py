"""The HTTP server of a service: a few threads, few connections, nobody waited for."""

from __future__ import annotations

import ipaddress
import threading
from typing import Any

from slopewise.models.errors import InputError
from slopewise.services.settings.service_settings import PageSettings

_THREADS = 2
_MOST_CONNECTIONS = 200
_PATIENCE = 2
_LOOKS = 1
"""Connections on which nothing is asked for so long are closed, looked at so often [s]: however
many somebody holds open, whoever asks for `/health` is heard."""

_LARGEST_BODY = 1000
_LARGEST_HEADER = 16_000


class PageServer:
    """Serves an application until it is closed.

    Raises:
        InputError: the address cannot be had, or what serves it is not installed.
    """

    def __init__(self, settings: PageSettings, application: Any) -> None:
        """Listen from now on."""
        from waitress.server import create_server

        try:
            self._server: Any = create_server(
                application,
                host=settings.host,
                port=settings.port,
                threads=_THREADS,
                connection_limit=_MOST_CONNECTIONS,
                channel_timeout=_PATIENCE,
                cleanup_interval=_LOOKS,
                max_request_body_size=_LARGEST_BODY,
                max_request_header_size=_LARGEST_HEADER,
                ident=None,
            )
        except (OSError, ValueError) as error:
            words = f"expected a free address, got {settings.host}:{settings.port}: {error}"
            raise InputError("page", "port", words) from None
        threading.Thread(target=self._server.run, name="page", daemon=True).start()

    def close(self) -> None:
        """Stop listening; whoever is being answered still is."""
        # In the server's own thread: nobody closes what it is waiting on.
        self._server.trigger.pull_trigger(self._server.close)


def own_names(host: str) -> frozenset[str]:
    """Names under which a server on the loopback may be asked; none for one that is open to all."""
    try:
        loopback = ipaddress.ip_address(host).is_loopback
    except ValueError:
        loopback = host == "localhost"
    return frozenset({"127.0.0.1", "localhost", "[::1]", host}) if loopback else frozenset()
