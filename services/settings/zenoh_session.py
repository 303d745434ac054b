"""Zenoh's configuration, from the service's settings."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from slopewise.services.io.files import fault
from slopewise.services.settings.tls_files import settle

if TYPE_CHECKING:
    import zenoh

_SLACK = 4
"""Messages beyond this multiple of a limit are dropped by zenoh; up to there they are answered [1]:
an honest sender that is a little too large gets a reason, and memory stays bounded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ZenohSettings:
    """How to meet others. The default listens on loopback only and scouts for no peers."""

    mode: Literal["peer", "client", "router"] = "peer"
    listen: tuple[str, ...] = ("tcp/127.0.0.1:7447",)
    connect: tuple[str, ...] = ()
    multicast: bool = False
    config: str = ""


def zenoh_config(settings: ZenohSettings, max_bytes: int | None = None) -> zenoh.Config:
    """Configuration of a zenoh session; of a service, where far larger messages drop.

    A service uses no shared memory unless a file of zenoh's settings requires it: its requests and
    plans fit the loopback, and the pools at both ends of a connection would count as its memory.
    """
    import zenoh

    try:
        config = zenoh.Config.from_file(settings.config) if settings.config else zenoh.Config()
        config.insert_json5("mode", json.dumps(settings.mode))
        if settings.mode != "client":
            config.insert_json5("listen/endpoints", json.dumps(settings.listen))
        if settings.connect:
            config.insert_json5("connect/endpoints", json.dumps(settings.connect))
        if settings.config:
            listen = () if settings.mode == "client" else settings.listen
            settle(config, Path(settings.config), (*listen, *settings.connect))
        config.insert_json5("scouting/multicast/enabled", json.dumps(settings.multicast))
        if max_bytes is not None:
            if not settings.config:
                config.insert_json5("transport/shared_memory/enabled", "false")
            rule = {
                "flows": ["ingress"],
                "messages": ["put", "query"],
                "key_exprs": ["**"],
                "size_limit": _SLACK * max_bytes,
            }
            config.insert_json5("low_pass_filter", json.dumps([rule]))
    except zenoh.ZError as error:
        raise fault(settings.config or "zenoh", "", f"expected usable settings: {error}") from None
    return config
