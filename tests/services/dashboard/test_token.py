"""A page that asks for a word, and files for Prometheus and Grafana that name what there is."""

from __future__ import annotations

import json
import re
import urllib.error
import urllib.request
from pathlib import Path

import pytest

from slopewise.services.dashboard.token import cookie, knows
from tests.services.service_process import free_port, running

CONFIGS = Path(__file__).parents[3] / "configs" / "prometheus"


def status(url: str, **headers: str) -> tuple[int, str, str]:
    request = urllib.request.Request(url, headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=5.0) as got:
            return got.status, got.headers.get("Set-Cookie", ""), got.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, "", error.read().decode()


def test_without_its_token_a_page_shows_nothing(tmp_path: Path) -> None:
    port = free_port()
    (tmp_path / "word").write_text("tell me\n")
    page = f'enabled = true\nport = {port}\ntoken = "word"'
    with running(tmp_path, page=page):
        base = f"http://127.0.0.1:{port}"
        for path in ("/", "/metrics", "/health", "/state"):
            assert status(base + path)[0] == 401
            assert status(base + path, Authorization="Bearer other")[0] == 401
            assert status(base + path, Authorization="Bearer tell me")[0] in (200, 503)
        code, kept, _ = status(f"{base}/?token=tell%20me")
        assert code == 200
        assert "tell" not in kept
        assert status(f"{base}/state", Cookie=kept.partition(";")[0])[0] == 200
        text = status(f"{base}/metrics", Authorization="Bearer tell me")[2]
    # Without a map there is no age of one.
    names = {*re.findall(r"^# TYPE (\w+)", text, re.MULTILINE), "slopewise_map_age_seconds"}
    for file in CONFIGS.iterdir():
        used = set(re.findall(r"(?:slopewise|process)_[a-z_]+", file.read_text()))
        used = {name for name in used if not name.startswith("slopewise_rules")}
        assert used <= names, (file.name, used - names)


@pytest.mark.parametrize("asked", ["", "wörd", "a" * 10_000])
def test_a_wrong_word_is_no_token(asked: str) -> None:
    assert not knows({"HTTP_AUTHORIZATION": f"Bearer {asked}"}, "right")
    assert not knows({"HTTP_COOKIE": f"slopewise={asked}"}, "right")
    assert knows({"HTTP_COOKIE": cookie("right").partition(";")[0]}, "right")


def test_the_dashboard_is_json_and_alerts_have_words() -> None:
    board = json.loads((CONFIGS / "slopewise.dashboard.json").read_text())
    assert len({panel["id"] for panel in board["panels"]}) == len(board["panels"])
    rules = (CONFIGS / "slopewise.rules.yml").read_text()
    assert rules.count("- alert:") == rules.count("summary:")
