"""How commands reach a running service."""

from __future__ import annotations

import re
import socket

import zenoh

from slopewise.models.errors import InputError
from slopewise.services.settings.service_settings import ServiceConfig, ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config

_ENCRYPTED = ("tls/", "quic/", "wss/")
_PLACE = re.compile(r"\s+at \S+\.rs:\d+\.?")


def words_of(error: zenoh.ZError) -> str:
    """What zenoh says, without the places in its own source."""
    return _PLACE.sub("", str(error))


def options(config: ServiceConfig) -> list[str]:
    """Options with which a command on the same machine reaches a service; none by the defaults.

    Where endpoints are encrypted, FILE stands for the operator's own settings with certificates.
    """
    settings = config.zenoh
    ends = settings.connect if settings.mode == "client" else settings.listen
    words: list[str] = []
    if ends:
        # An operator asks on the loopback what listens everywhere.
        end = ends[0].replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:")
        words += ["--connect", end] if end not in ZenohSettings().listen else []
        words += ["--zenoh", "FILE"] if end.startswith(_ENCRYPTED) else []
    if config.namespace != ServiceConfig(model=config.model).namespace:
        words += ["--namespace", config.namespace]
    return words


def _found(endpoint: str) -> str:
    """What is there instead of a service, as far as one can see from outside."""
    host, _, port = endpoint.partition("/")[2].partition("?")[0].rpartition(":")
    if not port.isdigit():
        return "none"
    try:
        with socket.create_connection((host.strip("[]"), int(port)), timeout=1.0):
            return "one that does not: certificates and access rules decide"
    except OSError:
        return "none: nobody listens there, or not yet; a service compiles when it first starts"


def client_session(connect: str, config: str = "") -> zenoh.Session:
    """A session of a client.

    Args:
        connect: endpoint of the service, or of a router. config: zenoh's own settings, such as
            certificates; "" for none.

    Raises:
        InputError: nobody is there, or nobody who lets this client in.
    """
    settings = ZenohSettings(mode="client", connect=(connect,), config=config)
    try:
        return zenoh.open(zenoh_config(settings))
    except zenoh.ZError:
        raise InputError(
            "--connect",
            "",
            f"expected a service at {connect} that lets this client in, got {_found(connect)}",
        ) from None
