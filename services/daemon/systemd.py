"""Notifications to systemd for a service of ``Type=notify``; ignored without systemd.

Source: sd_notify(3): datagrams to the socket that ``NOTIFY_SOCKET`` names, ``@`` at its beginning
being the abstract namespace.
"""

from __future__ import annotations

import logging
import os
import socket

_log = logging.getLogger("slopewise")

READY = "READY=1"
ALIVE = "WATCHDOG=1"
STOPPING = "STOPPING=1"

_TIMEOUT = 0.1  # longest wait for the socket [s]: the status thread sends, and must not be delayed


def notify_systemd(state: str) -> bool:
    """Send a state; False if it was not received. Never raises: plans do not depend on it."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address:
        return False
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as sender:
            sender.settimeout(_TIMEOUT)
            sender.connect(f"\0{address[1:]}" if address.startswith("@") else address)
            sender.send(state.encode())
    except OSError as error:
        _log.warning("systemd did not receive %s: %s", state, error)
        return False
    return True
