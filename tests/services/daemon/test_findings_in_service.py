"""A missing effect, found, proposed, adopted and withdrawn by a running service."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.services.parameter_client import Robot, block, column, send_ground
from tests.services.robot_plant import Surface, Vehicle
from tests.services.service_process import running

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


def examine(robot: Robot) -> dict[str, Any]:
    """Request an examination of the stops; returns the reply once it is done."""
    began = ask(robot, start=True, who="ann")
    assert (began["status"], began["investigating"]) == ("ok", True), began
    until = time.monotonic() + 60.0
    while time.monotonic() < until:
        reply = ask(robot)
        if not reply["investigating"]:
            return reply
        # Planning continues in the meantime.
        assert robot.plan()["status"] == "ok"
        time.sleep(0.1)
    raise AssertionError("it did not end")


def ask(robot: Robot, **fields: Any) -> dict[str, Any]:
    reply = robot.query("discrepancy", fields, "discrepancy_question")
    assert reply is not None
    return reply


def adopt(robot: Robot, offer: str, *, faster: bool = False) -> dict[str, Any]:
    fields = {"offer": offer, "faster": faster, "who": "ann"}
    reply = robot.query("params/adopt", fields, "adopt_offer")
    assert reply is not None
    return reply


def stopping(robot: Robot) -> float:
    """Stopping path from 2 m/s on level ground, by a plan that drives it [m]."""
    plan = robot.plan(2.0)["plans"][0]
    speeds, stops = column(plan, "speed"), column(plan, "stop_distance")
    assert speeds[0] == pytest.approx(2.0)
    return float(stops[0])


def test_a_finding_is_offered_adopted_planned_with_and_taken_back(tmp_path: Path) -> None:
    with running(tmp_path, planning=SETTINGS) as service, service.session() as session:
        check_finding(Robot(service, session))


def check_finding(robot: Robot) -> None:
    send_ground(robot)
    before = stopping(robot)
    few = ask(robot, start=True)
    assert (few["status"], few["offer"]) == ("refused", None)
    assert "at least 12 stored stops, got 0" in few["reason"]
    drive(robot)
    # So that the model file's coefficients are what the finding is compared with in plans.
    assert robot.roll_back(1)["status"] == "ok"
    assert stopping(robot) == pytest.approx(before)
    reply = examine(robot)
    offer = reply["offer"]
    assert offer["verdict"] == "missing_effect", reply["investigation"]
    assert [e["name"] for e in offer["findings"]["effects"]] == ["step_change"]
    assert offer["findings"]["effects"][0]["parameters"]["scale"]["value"] == pytest.approx(
        WEAKER, abs=0.02
    )
    assert offer["valid"]
    assert offer["changes"]
    assert offer["beside_file"]["most"] > offer["beside_file"]["least"] > 0.0
    # Offered is not adopted, and plans say so.
    waiting = f"offer {offer['id']} is not adopted: missing_effect, up to 0.9"
    assert any(flag.startswith(waiting) for flag in robot.plan()["flags"])
    assert stopping(robot) == pytest.approx(before)
    shown = robot.parameters()
    assert shown["offer"]["id"] == offer["id"]
    assert shown["offer"]["model"] == {}
    assert robot.group("effects")["values"] == {}

    assert "the one that there is" in adopt(robot, "another")["reason"]
    done = adopt(robot, offer["id"])
    assert done["status"] == "ok", done
    assert done["durable"]
    group = robot.group("effects")
    assert group["values"]["step_change.scale"] == pytest.approx(WEAKER, abs=0.02)
    assert group["who"] == "ann"
    # Brakes of 0.43 W made 0.3225: v²/2a is a third longer, the dead time's way stays.
    path = 2.0 * 2.0 / (2.0 * 9.80665)
    expected = path * (1.0 / (WEAKER * force(2.0, 0.0)) - 1.0 / force(2.0, 0.0))
    assert stopping(robot) > before + 0.95 * expected
    reply = robot.plan()
    assert not any(flag.startswith("offer") for flag in reply["flags"])
    assert reply["parameters"]["version"] == done["version"]
    assert any("the adopted finding has the effect step_change" in f for f in reply["flags"])
    # Braking is not learned twice.
    assert "not learned" in robot.stop(0.6 * 9.80665)["reason"]

    causes = [h["cause"] for h in robot.parameters("effects", history=10)["history"]]
    assert causes[0].startswith(f"adopted {offer['id']}")
    assert any(c.startswith(f"offered {offer['id']}") for c in causes)
    back = robot.roll_back(1, "effects")
    assert back["status"] == "ok"
    assert stopping(robot) == pytest.approx(before, abs=0.02)
    again = robot.roll_back(done["version"], "effects")
    assert again["status"] == "ok"
    assert stopping(robot) > before + 0.95 * expected
