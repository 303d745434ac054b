"""Certificates and keys named in zenoh's settings: found relative to the file that names them.

Zenoh takes them relative to the working directory, and reports a missing one only as an endpoint
that is not free.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from slopewise.services.io.files import fault

if TYPE_CHECKING:
    import zenoh

_TLS = "transport/link/tls"
_FILES = (
    "root_ca_certificate",
    "listen_private_key",
    "listen_certificate",
    "connect_private_key",
    "connect_certificate",
)
_ENCRYPTED = ("tls/", "quic/")


def settle(config: zenoh.Config, source: Path, endpoints: Sequence[str]) -> None:
    """Make certificates absolute, and reject settings that would not protect as stated.

    Args:
        config: configuration read from ``source``; changed in place.
        endpoints: endpoints that the session listens on or connects to.
    """
    tls = json.loads(config.get_json(_TLS))
    for key in _FILES:
        name = tls[key]
        if not name:
            continue
        path = source.parent / name
        field = f"{_TLS}/{key}".replace("/", ".")
        if not path.is_file() or not os.access(path, os.R_OK):
            raise fault(source, field, f"expected a readable file, got none at {path}")
        config.insert_json5(f"{_TLS}/{key}", json.dumps(str(path.resolve())))
    guarded = json.loads(config.get_json("access_control"))
    by_name = any(subject.get("cert_common_names") for subject in guarded.get("subjects") or [])
    if guarded.get("enabled") and by_name and not tls["enable_mtls"]:
        expected = "expected true, as access control uses the names in certificates"
        raise fault(source, f"{_TLS}/enable_mtls".replace("/", "."), expected)
    open_ones = [e for e in endpoints if not e.startswith(_ENCRYPTED)]
    if open_ones and (by_name or tls["listen_certificate"] or tls["root_ca_certificate"]):
        expected = (
            f"expected {' or '.join(_ENCRYPTED)}… as certificates are named, got {open_ones[0]}"
        )
        raise fault(source, "listen or connect", expected)
