"""A missing effect, found, proposed, adopted and withdrawn by a running service.

Its live page shows what it is, its status, and a command line that works.
"""

from __future__ import annotations

import html
import json
import re
import shlex
import time
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slopewise.services.dashboard.live_state import LiveState, ProposalEntry
from tests.services import browser
from tests.services.command_line import Done, here, one_line_of, slopewise
from tests.services.dashboard.page_fixtures import HOSTILE, served
from tests.services.parameter_client import Robot, block, column, send_ground
from tests.services.parameters.parameter_fixtures import proposal
from tests.services.robot_plant import Surface, Vehicle
from tests.services.service_process import free_port, running

SETTINGS = """
[learning]
stops_at_once = 1000  # stops take no time here
refresh = 0.2
[store]
path = "p.sqlite"
[discrepancy]
samples = "stops"
limit = 60.0
"""
WEAKER = 0.75


def force(speed: float, grade: float) -> float:
    """F_b/W of the shipped model file, as printed in it."""
    return (-0.03 * speed - 0.35) * grade + 0.015 * speed + 0.40


def drive(robot: Robot, stops: int = 26, weaker: float = WEAKER, seed: int = 1) -> None:
    """Stops of a vehicle whose brakes get weaker halfway, sample by sample."""
    vehicle = Vehicle(seed=seed)
    for i in range(stops):
        speed, grade = 1.2 + 0.4 * (i % 7), 0.1 * (-1) ** i * (i % 3) / 2
        share = weaker if i >= stops // 2 else 1.0
        surface = Surface(force(speed, grade) * share, 0.0, 0.005)
        _, samples = vehicle.stop(surface, speed, grade)
        samples["grade"] = np.full(samples["t"].size, grade)
        receipt = robot.send(
            "drive",
            robot.fields(columns=list(samples), values=block(np.stack(list(samples.values())))),
        )
        assert receipt["status"] == "taken", receipt


def ask(robot: Robot, **fields: Any) -> dict[str, Any]:
    reply = robot.query("discrepancy", fields, "discrepancy_question")
    assert reply is not None
    return reply


def stopping(robot: Robot) -> float:
    """Stopping path from 2 m/s on level ground, by a plan that drives it [m]."""
    plan = robot.plan(2.0)["plans"][0]
    speeds, stops = column(plan, "speed"), column(plan, "stop_distance")
    assert speeds[0] == pytest.approx(2.0)
    return float(stops[0])


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


def investigate(robot: Robot, *where: str) -> str:
    """Output of `params --investigate`; planning continues meanwhile."""
    with ThreadPoolExecutor(1) as pool:
        asked = pool.submit(slopewise, "params", "--investigate", "--json", *where)
        while not asked.done():
            assert robot.plan()["status"] == "ok"
            time.sleep(0.1)
    return asked.result().stdout


@pytest.mark.nightly  # by day in one process: test_parameter_state.py, discovery, effects_group
def test_a_finding_is_offered_adopted_planned_with_and_reverted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    port = free_port()
    url, page = f"http://127.0.0.1:{port}", f"enabled = true\nport = {port}"
    with running(tmp_path, planning=SETTINGS, page=page) as started, started.session() as session:
        where = ("--connect", started.endpoint, "--namespace", started.namespace)
        check_finding(Robot(started, session), url, where)


def check_finding(robot: Robot, url: str, where: tuple[str, ...]) -> None:
    send_ground(robot)
    before = stopping(robot)
    few = ask(robot, start=True)
    assert (few["status"], few["offer"]) == ("refused", None)
    assert "at least 12 stored stops, got 0" in few["reason"]
    drive(robot)
    # So that the model file's coefficients are what the finding is compared with in plans.
    assert robot.roll_back(1)["status"] == "ok"
    offer = check_offer(robot, url, json.loads(investigate(robot, *where))["offer"], where)
    # Offered is not adopted, and plans say so.
    waiting = f"offer {offer['id']} is not adopted: missing_effect, up to 0.9"
    assert any(flag.startswith(waiting) for flag in robot.plan()["flags"])
    assert stopping(robot) == pytest.approx(before)
    assert robot.group("effects")["values"] == {}
    one_line_of(here("params", "--adopt", "nonsense", *where), "one that there is")

    assert typed(wait(url, "offered")["command"]).returncode == 0
    adopted = wait(url, "adopted")
    scale = offer["findings"]["effects"][0]["parameters"]["scale"]["value"]
    assert robot.group("effects")["values"]["step_change.scale"] == scale
    # Brakes of 0.43 W made 0.3225: v²/2a is a third longer, the dead time's way stays.
    path = 2.0 * 2.0 / (2.0 * 9.80665)
    longer = path * (1.0 / (WEAKER * force(2.0, 0.0)) - 1.0 / force(2.0, 0.0))
    assert stopping(robot) > before + 0.95 * longer
    reply = robot.plan()
    assert not any(flag.startswith("offer") for flag in reply["flags"])
    assert any("the adopted finding has the effect step_change" in f for f in reply["flags"])
    # Braking is not learned twice.
    assert "not learned" in robot.stop(0.6 * 9.80665)["reason"]
    if browser.BROWSER is not None:
        shown = browser.text_of(url)
        assert 'effects<span class="">valid' in shown
        assert "|adopted|by " in text(shown)
        assert f"To take it back, an operator types |{adopted['command']}|" in text(shown)

    history = robot.parameters("effects", history=10)["history"]
    assert history[0]["cause"].startswith(f"adopted {offer['id']}")
    assert any(h["cause"].startswith(f"offered {offer['id']}") for h in history)
    assert typed(adopted["command"]).returncode == 0
    again = wait(url, "offered")["command"]
    assert robot.group("effects")["values"] == {}
    assert stopping(robot) == pytest.approx(before, abs=0.02)
    assert typed(again).returncode == 0
    assert stopping(robot) > before + 0.95 * longer


def check_offer(
    robot: Robot, url: str, offer: dict[str, Any], where: tuple[str, ...]
) -> dict[str, Any]:
    """An offer as its reply, the command line and the page show it."""
    assert offer["verdict"] == "missing_effect"
    (effect,) = offer["findings"]["effects"]
    scale = effect["parameters"]["scale"]["value"]
    assert (effect["name"], scale) == ("step_change", pytest.approx(WEAKER, abs=0.02))
    assert offer["valid"]
    assert offer["changes"]
    assert offer["beside_file"]["most"] > offer["beside_file"]["least"] > 0.0
    assert robot.parameters()["offer"]["id"] == offer["id"]
    assert robot.parameters()["offer"]["model"] == {}
    offered = wait(url, "offered")
    assert offer["id"] in offered["command"]
    assert offered["before"] > 3.0 * offered["after"] > 0.0
    printed = here("params", *where).stdout
    for part in ("missing_effect", "step_change: scale = 0.7", "params --adopt"):
        assert part in printed, printed
    if browser.BROWSER is not None:
        shown = browser.text_of(url)
        assert "effects<span" not in shown
        assert "|offered|waits for an operator|missing effect|" in text(shown)
        assert f"step change, scale|{scale:.3f}"[:-1] in text(shown)
        assert f"|{offered['command']}|" in text(shown)
    return offer


def typed(line: str) -> Done:
    """A command line of the page, as an operator types it."""
    return slopewise(*shlex.split(line)[1:])
