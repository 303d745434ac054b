"""Zenoh's own configuration, made of the service's settings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from slopewise.services.io.files import fault
from slopewise.services.settings.service import Sizes, ZenohSettings
from slopewise.services.settings.tls_files import settle

if TYPE_CHECKING:
    import zenoh

_SLACK = 4
"""Larger than a limit by that much, a message is not even let in; up to there it is answered."""


def zenoh_config(settings: ZenohSettings, sizes: Sizes | None = None) -> zenoh.Config:
    """What zenoh needs of it.

    Args:
        settings: of the session.
        sizes: of a service: what is far too large does not even come in. It takes no shared memory
            unless a file of zenoh's own settings says so: its questions and plans fit the loopback,
            and the pools at both ends of a connection would count as its memory.

    Raises:
        InputError: zenoh refuses it.
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
