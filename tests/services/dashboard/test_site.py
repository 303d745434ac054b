"""The page's server: token, host names, idle connections, files for Prometheus."""

from __future__ import annotations

import contextlib
import json
import re
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from slopewise.models.errors import InputError
from slopewise.services.dashboard.live_state import LiveState
from slopewise.services.dashboard.server import PageServer
from slopewise.services.dashboard.token import cookie, has_valid_token
from slopewise.services.settings.service_settings import PageSettings
from tests.services.dashboard.page_fixtures import get, served

CONFIGS = Path(__file__).parents[3] / "configs" / "prometheus"


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    with served(LiveState()) as url:
        yield url


def test_writing_other_addresses_and_pages_of_other_sites_are_rejected(url: str) -> None:
    for method in ("POST", "PUT", "DELETE"):
        assert get(f"{url}/state", method)[0] == 405
    assert get(f"{url}/../../etc/passwd")[0] == 404
    assert get(f"{url}/state", Host="evil.example:8177")[0] == 403
    assert get(f"{url}/state", Host="localhost:8177")[0] == 200


def test_a_port_in_use_is_an_input_error(url: str) -> None:
    with pytest.raises(InputError, match="expected a free address"):
        PageServer(PageSettings(enabled=True, port=int(url.rpartition(":")[2])), None)


def test_half_open_connections_do_not_block_health(url: str) -> None:
    port, opened = int(url.rpartition(":")[2]), []
    for _ in range(250):
        with contextlib.suppress(OSError):
            connection = socket.create_connection(("127.0.0.1", port), timeout=1.0)
            connection.sendall(b"GET /health HT")
            opened.append(connection)
    assert len(opened) > 50
    status = 0
    for _ in range(4):
        with contextlib.suppress(OSError):
            status = status or get(f"{url}/health")[0]
    assert status == 503, "no map"
    for connection in opened:
        connection.close()


def test_without_its_token_a_page_shows_nothing() -> None:
    with served(LiveState(), token="let me in") as url:
        for path in ("/", "/metrics", "/health", "/state"):
            assert get(url + path)[0] == 401
            assert get(url + path, Authorization="Bearer other")[0] == 401
            assert get(url + path, Authorization="Bearer let me in")[0] in (200, 503)
        code, stored, _ = get(f"{url}/?token=let%20me%20in")
        assert code == 200
        assert "let" not in stored
        assert get(f"{url}/state", Cookie=stored.partition(";")[0])[0] == 200


@pytest.mark.parametrize("shown", ["", "wörd", "a" * 10_000])
def test_a_different_text_is_no_token(shown: str) -> None:
    assert not has_valid_token({"HTTP_AUTHORIZATION": f"Bearer {shown}"}, "right")
    assert not has_valid_token({"HTTP_COOKIE": f"slopewise={shown}"}, "right")
    assert has_valid_token({"HTTP_COOKIE": cookie("right").partition(";")[0]}, "right")


def test_files_for_prometheus_and_grafana_name_metrics_that_exist() -> None:
    with served(LiveState(), map_version=1, map_age=1.0, counters={"queries": 1}) as url:
        text = get(f"{url}/metrics")[2]
    names = set(re.findall(r"^# TYPE (\w+)", text, re.MULTILINE))
    for file in CONFIGS.iterdir():
        used = set(re.findall(r"(?:slopewise|process)_[a-z_]+", file.read_text()))
        used = {name for name in used if not name.startswith("slopewise_rules")}
        assert used <= names, (file.name, used - names)
    board = json.loads((CONFIGS / "slopewise.dashboard.json").read_text())
    assert len({panel["id"] for panel in board["panels"]}) == len(board["panels"])
    rules = (CONFIGS / "slopewise.rules.yml").read_text()
    assert rules.count("- alert:") == rules.count("summary:")
