"""Connections that are opened and left alone do not blind whoever asks how the service is."""

from __future__ import annotations

import contextlib
import socket
import time
import urllib.error
import urllib.request
from pathlib import Path

from tests.services.service_process import free_port, running


def test_half_open_connections_do_not_blind_health(tmp_path: Path) -> None:
    port = free_port()
    with running(tmp_path, page=f"enabled = true\nport = {port}"):
        held = []
        for _ in range(250):
            with contextlib.suppress(OSError):
                one = socket.create_connection(("127.0.0.1", port), timeout=1.0)
                one.sendall(b"GET /health HT")
                held.append(one)
        assert len(held) > 50
        until, status = time.monotonic() + 8.0, 0
        while status == 0 and time.monotonic() < until:
            try:
                with urllib.request.urlopen(f"http://127.0.0.1:{port}/health", timeout=3.0) as got:
                    status = got.status
            except urllib.error.HTTPError as error:
                status = error.code
            except OSError:
                time.sleep(0.2)
        assert status == 503, "no map has come"
        for one in held:
            one.close()
