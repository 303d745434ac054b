"""Zenoh's configuration, from the service's settings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from slopewise.services.io.files import fault
from slopewise.services.settings.service_settings import SizeLimits, ZenohSettings
from slopewise.services.settings.tls_files import settle

if TYPE_CHECKING:
    import zenoh

_SLACK = 4
"""Messages beyond this multiple of a limit are dropped by zenoh; up to there they are answered [1]:
an honest sender that is a little too large gets a reason, and memory stays bounded."""


def zenoh_config(settings: ZenohSettings, sizes: SizeLimits | None = None) -> zenoh.Config:
    """Configuration of a zenoh session.

    Args:
        sizes: limits of a service: far larger messages are dropped by zenoh. A service uses no
            shared memory unless a file of zenoh's settings requires it: its requests and plans fit
            the loopback, and the pools at both ends of a connection would count as its memory.
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
        if sizes is not None:
            if not settings.config:
                config.insert_json5("transport/shared_memory/enabled", "false")
            largest = _SLACK * max(sizes.request_bytes, sizes.map_bytes)
            rule = {
                "flows": ["ingress"],
                "messages": ["put", "query"],
                "key_exprs": ["**"],
                "size_limit": largest,
            }
            config.insert_json5("low_pass_filter", json.dumps([rule]))
    except zenoh.ZError as error:
        raise fault(settings.config or "zenoh", "", f"expected usable settings: {error}") from None
    return config
