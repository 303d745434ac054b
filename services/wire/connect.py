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


def error_text(error: zenoh.ZError) -> str:
    """Message of zenoh, without positions in its source."""
    return _PLACE.sub("", str(error))


def options(config: ServiceConfig) -> list[str]:
    """Options with which a command on the same machine reaches a service; none by the defaults."""
    settings = config.zenoh
    ends = settings.connect if settings.mode == "client" else settings.listen
    arguments: list[str] = []
    if ends:
        # A service that listens on all interfaces is reached on the loopback.
        end = ends[0].replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:")
        arguments += ["--connect", end] if end not in ZenohSettings().listen else []
        # FILE stands for the operator's own settings with certificates.
        arguments += ["--zenoh", "FILE"] if end.startswith(_ENCRYPTED) else []
    if config.namespace != ServiceConfig(model=config.model).namespace:
        arguments += ["--namespace", config.namespace]
    return arguments


def _listener(endpoint: str) -> str:
    """Description of the listener at an endpoint that is not a reachable service."""
    host, _, port = endpoint.partition("/")[2].partition("?")[0].rpartition(":")
    if not port.isdigit():
        return "none"
    try:
        with socket.create_connection((host.strip("[]"), int(port)), timeout=1.0):
            return "one that does not: certificates and access rules decide"
    except OSError:
        return "none: no process listens there, or not yet; a service compiles when it first starts"


def client_session(connect: str, config: str = "") -> zenoh.Session:
    """A session of a client; ``config``: file with zenoh's own settings, "" for none."""
    settings = ZenohSettings(mode="client", connect=(connect,), config=config)
    try:
        return zenoh.open(zenoh_config(settings))
    except zenoh.ZError:
        expected = f"expected a service at {connect} that lets this client in"
        raise InputError("--connect", "", f"{expected}, got {_listener(connect)}") from None
