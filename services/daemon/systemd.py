"""What systemd wants to hear of a service of ``Type=notify``; without systemd nobody listens.

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


def tell(state: str) -> bool:
    """Send a state; False where nobody listens. Never raises: plans do not depend on it."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address:
        return False
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as sender:
            sender.settimeout(0.1)
            sender.connect(f"\0{address[1:]}" if address.startswith("@") else address)
            sender.send(state.encode())
    except OSError as error:
        _log.warning("systemd could not be told %s: %s", state, error)
        return False
    return True
