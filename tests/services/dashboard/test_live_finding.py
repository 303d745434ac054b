"""The finding on the live page: its content, its state, and a command line that works."""

from __future__ import annotations

import html
import json
import re
import shlex
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from slopewise.services.dashboard.board import Board, FindingSeen
from slopewise.services.dashboard.server import PageServer, own_names
from slopewise.services.dashboard.site import Site, Source
from slopewise.services.settings.service_settings import PageSettings
from slopewise.services.wire.plan_messages import Parameters, ServiceStatus
from tests.services import browser
from tests.services.command_line import slopewise
from tests.services.daemon.test_findings_in_service import SETTINGS, WEAKER, drive, look
from tests.services.dashboard.test_finding_board import made
from tests.services.parameter_client import Robot, send_ground
from tests.services.service_process import free_port, running

EVIL = "<img src=x onerror=alert(1)>"


@contextmanager
def page_of(board: Board) -> Iterator[str]:
    status = ServiceStatus(
        service="robot",
        uptime=1.0,
        map_version=0,
        map_age=None,
        flags=[],
        counters={},
        parameters=Parameters(version=30, name="atv", fingerprint="f", age=1.0),
        seconds={"median": 0.0, "p99": 0.0},
    )
    port = free_port()
    source = Source(status=lambda: status, ground=lambda: None, board=board)
    server = PageServer(PageSettings(enabled=True, port=port), Site(source, own_names("127.0.0.1")))
    try:
        yield f"http://127.0.0.1:{port}"
    finally:
        server.close()


def panel(shown: str) -> str:
    """The finding's panel as HTML."""
    (section,) = re.findall(r'<div id="finding".*?</section>', shown, re.DOTALL)
    return str(section)


def text(shown: str) -> str:
    """Its text, with | between elements."""
    joined = re.sub(r"</span> <span>", " ", panel(shown))
    read = html.unescape(re.sub(r"<[^>]+>", "|", joined)).replace("\u202f", " ")
    return re.sub(r"\|+", "|", read)


def test_before_there_is_one_a_quiet_line_says_so() -> None:
    with page_of(Board()) as url:
        shown = browser.text_of(url)
    assert text(shown).strip("|\n ") == "Nothing has been found on stored stops."


def test_numbers_are_shown_and_names_stay_text() -> None:
    board = Board()
    parameters = {EVIL: {"value": -0.25, "std": 0.0331, "unit": EVIL}}
    findings = made().findings
    parameters["k"] = {"value": 0.0, "std": 1e-200, "unit": "1"}
    findings["effects"].append({"name": EVIL, "parameters": parameters})
    findings["stop_distance"]["after"] = None
    offer = made(findings=findings, summary=EVIL, cause=EVIL, notes=[EVIL], verdict=EVIL, id=EVIL)
    board.found(FindingSeen(offer=offer, state="refused", words=EVIL, purpose=EVIL, command=EVIL))
    with page_of(board) as url:
        shown = browser.text_of(url, width=390)
    assert EVIL not in shown
    content = text(shown)
    assert content.count(EVIL) == 12
    assert "|brake lag, tau|0.298 ± 0.012 s|" in content
    assert f"−0.250 ± 0.033 {EVIL}|" in content
    assert "|as configured|0.412 m|floor|0.049 m|" in content
    assert "stops change by +0.11 … +0.93 m" in content
    assert "|on|26 stops|" in content
    assert "2001" in content
    # Nothing here changes anything: the panel has neither buttons nor links.
    assert not re.search(r"<(button|a|form|input|select)\b", panel(shown))


def test_findings_of_another_release_have_no_numbers_and_stop_nobody() -> None:
    board = Board()
    offer = made(findings={"effects": "none", "stop_distance": 3})
    board.found(FindingSeen(offer=offer, state="offered", words=""))
    with page_of(board) as url:
        shown = browser.text_of(url)
    assert "brakes that answer late" in text(shown)
    assert "as configured" not in text(shown)


def wait(url: str, state: str) -> dict[str, Any]:
    until = time.monotonic() + 20.0
    while time.monotonic() < until:
        with urllib.request.urlopen(f"{url}/learned", timeout=5.0) as answer:
            finding = json.load(answer)["finding"]
        if finding is not None and finding["state"] == state:
            return dict(finding)
        time.sleep(0.05)
    raise AssertionError(finding)


def test_shown_command_adopts_and_reverts(tmp_path: Path) -> None:
    port = free_port()
    url, page = f"http://127.0.0.1:{port}", f"enabled = true\nport = {port}"
    typed: Callable[[str], Any] = lambda line: slopewise(*shlex.split(line)[1:])  # noqa: E731
    with (
        running(tmp_path, planning=SETTINGS, page=page) as started,
        started.session() as session,
    ):
        robot = Robot(started, session)
        send_ground(robot)
        drive(robot)
        look(robot)
        offered = wait(url, "offered")
        scale = offered["effects"][0]["parameters"]["scale"]
        assert scale["value"] == pytest.approx(WEAKER, abs=0.02)
        assert offered["before"] > 3.0 * offered["after"] > 0.0
        shown = browser.text_of(url)
        assert "effects<span" not in shown
        content = text(shown)
        assert "|offered|waits for an operator|missing effect|" in content
        assert f"step change, scale|{scale['value']:.3f}"[:-1] in content
        assert f"|{offered['command']}|" in content
        done = typed(offered["command"])
        assert done.returncode == 0, done.stderr
        adopted = wait(url, "adopted")
        shown = browser.text_of(url)
        assert 'effects<span class="">valid' in shown
        content = text(shown)
        assert "|adopted|by " in content
        assert f"To take it back, an operator types |{adopted['command']}|" in content
        assert robot.group("effects")["values"]["step_change.scale"] == scale["value"]
        assert typed(adopted["command"]).returncode == 0
        reverted = wait(url, "reverted")
        assert robot.group("effects")["values"] == {}
        assert reverted["command"] == offered["command"]
