"""The guard's zenoh session, and its priority on the machine."""

from __future__ import annotations

import json
import os
from pathlib import Path

import zenoh

from slopewise.models.errors import InputError
from slopewise.services.guard.settings import GuardSettings
from slopewise.services.settings.tls_files import settle

_PRIORITY = 20  # above ordinary processes, below the kernel's own threads at 50 [SCHED_RR, 1 … 99]


def request_realtime_priority() -> bool:
    """Ask for the processor before other processes; return True if it was granted."""
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(_PRIORITY))
    except (OSError, AttributeError):
        return False
    return True


def open_session(settings: GuardSettings) -> zenoh.Session:
    """Connect as the settings require."""
    ours = settings.zenoh
    try:
        config = zenoh.Config.from_file(ours.config) if ours.config else zenoh.Config()
        config.insert_json5("mode", json.dumps(ours.mode))
        if ours.connect:
            config.insert_json5("connect/endpoints", json.dumps(ours.connect))
        if ours.mode == "peer":
            config.insert_json5("listen/endpoints", json.dumps(ours.listen))
        config.insert_json5("scouting/multicast/enabled", "false")
        if ours.config:
            listens = ours.listen if ours.mode == "peer" else ()
            settle(config, Path(ours.config), (*listens, *ours.connect))
        return zenoh.open(config)
    except zenoh.ZError:
        where = ", ".join(ours.connect)
        raise InputError("zenoh", "connect", f"expected a router at {where}, got none") from None
