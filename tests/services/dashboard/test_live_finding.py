"""The finding on the live page: what it is, its status, and a command line that works."""

from __future__ import annotations

import html
import json
import re
import shlex
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from slopewise.services.dashboard.live_state import LiveState, ProposalEntry
from tests.services import browser
from tests.services.command_line import here, one_line_of, slopewise
from tests.services.daemon.test_findings_in_service import SETTINGS, WEAKER, drive
from tests.services.dashboard.page_fixtures import HOSTILE, served
from tests.services.dashboard.test_parameter_state import proposal
from tests.services.parameter_client import Robot, send_ground
from tests.services.service_process import free_port, running


def panel(shown: str) -> str:
    """The finding's panel as HTML."""
    (match,) = re.findall(r'<div id="finding".*?</section>', shown, re.DOTALL)
    return str(match)


def text(shown: str) -> str:
    """Its text."""
    html_text = re.sub(r"</span> <span>", " ", panel(shown))
    read = html.unescape(re.sub(r"<[^>]+>", "|", html_text)).replace("\u202f", " ")
    return re.sub(r"\|+", "|", read)


def test_before_there_is_one_a_quiet_line_says_so() -> None:
    with served(LiveState()) as url:
        shown = browser.text_of(url)
    assert text(shown).strip("|\n ") == "Nothing has been found on stored stops."


def test_numbers_are_shown_and_hostile_texts_stay_text() -> None:
    board = LiveState()
    parameters = {HOSTILE: {"value": -0.25, "std": 0.0331, "unit": HOSTILE}}
    findings = proposal().findings
    parameters["k"] = {"value": 0.0, "std": 1e-200, "unit": "1"}
    findings["effects"].append({"name": HOSTILE, "parameters": parameters})
    findings["stop_distance"]["after"] = None
    texts = dict.fromkeys(("summary", "cause", "verdict", "id"), HOSTILE)
    offer = proposal(findings=findings, notes=[HOSTILE], **texts)
    board.set_proposal(ProposalEntry(offer, "refused", HOSTILE, HOSTILE, HOSTILE))
    with served(board) as url:
        shown = browser.text_of(url, width=390)
    assert HOSTILE not in shown
    panel_text = text(shown)
    assert panel_text.count(HOSTILE) == 12
    for part in (
        "|brake lag, tau|0.298 ± 0.012 s|",
        f"−0.250 ± 0.033 {HOSTILE}|",
        "|as configured|0.412 m|floor|0.049 m|",
        "stops change by +0.11 … +0.93 m",
        "|on|26 stops|",
        "2001",
    ):
        assert part in panel_text
    # Nothing here changes anything: the panel has neither buttons nor links.
    assert not re.search(r"<(button|a|form|input|select)\b", panel(shown))


def test_findings_of_another_release_have_no_numbers_and_stop_nobody() -> None:
    board = LiveState()
    offer = proposal(findings={"effects": "none", "stop_distance": 3})
    board.set_proposal(ProposalEntry(offer=offer, state="offered", message=""))
    with served(board) as url:
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


def test_commands_that_a_running_service_shows_adopt_and_revert(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    port = free_port()
    url, page = f"http://127.0.0.1:{port}", f"enabled = true\nport = {port}"
    typed: Callable[[str], Any] = lambda line: slopewise(*shlex.split(line)[1:])  # noqa: E731
    with running(tmp_path, planning=SETTINGS, page=page) as started, started.session() as session:
        robot = Robot(started, session)
        send_ground(robot)
        drive(robot)
        where = ("--connect", started.endpoint, "--namespace", started.namespace)
        asked = here("params", "--investigate", "--json", *where)
        offered = wait(url, "offered")
        assert json.loads(asked.stdout)["offer"]["id"] in offered["command"]
        printed = here("params", *where).stdout
        for part in ("missing_effect", "step_change: scale = 0.7", "params --adopt"):
            assert part in printed, printed
        one_line_of(here("params", "--adopt", "nonsense", *where), "one that there is")
        scale = offered["effects"][0]["parameters"]["scale"]
        assert scale["value"] == pytest.approx(WEAKER, abs=0.02)
        assert offered["before"] > 3.0 * offered["after"] > 0.0
        shown = browser.text_of(url)
        assert "effects<span" not in shown
        panel_text = text(shown)
        assert "|offered|waits for an operator|missing effect|" in panel_text
        assert f"step change, scale|{scale['value']:.3f}"[:-1] in panel_text
        assert f"|{offered['command']}|" in panel_text
        done = typed(offered["command"])
        assert done.returncode == 0, done.stderr
        adopted = wait(url, "adopted")
        shown = browser.text_of(url)
        assert 'effects<span class="">valid' in shown
        panel_text = text(shown)
        assert "|adopted|by " in panel_text
        assert f"To take it back, an operator types |{adopted['command']}|" in panel_text
        assert robot.group("effects")["values"]["step_change.scale"] == scale["value"]
        assert typed(adopted["command"]).returncode == 0
        reverted = wait(url, "reverted")
        assert robot.group("effects")["values"] == {}
        assert reverted["command"] == offered["command"]
