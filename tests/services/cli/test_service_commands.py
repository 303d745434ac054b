"""`slopewise query`, `params` and `replay` with a running service."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.services.command_line import here, one_line_of
from tests.services.parameter_client import Robot

G = 9.81
DEAD_TIME, FORCE = 0.3, 0.30
"""The vehicle of the log: brakes with a constant force, a share of its weight, on level ground."""


def call(robot: Robot, *arguments: object) -> Any:
    where = ("--connect", robot.service.endpoint, "--namespace", robot.service.namespace)
    return here(*arguments, *where)


def params(robot: Robot, *arguments: object) -> dict[str, Any]:
    done = call(robot, "params", *arguments, "--timeout", "10", "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)  # type: ignore[no-any-return]


def drive(stops: int, rate: float = 50.0) -> str:
    """A log of stops from several speeds; roll is missing once."""
    rows = ["run,t,v,v_cmd,pitch,roll"]
    t = 0.0
    for k in range(stops):
        speed = 1.5 + 0.5 * (k % 4)
        braking = speed / (G * FORCE)
        for since in np.arange(-1.0, DEAD_TIME + braking + 0.3, 1.0 / rate):
            v = speed - G * FORCE * max(since - DEAD_TIME, 0.0)
            command = speed if since < 0.0 else 0.0
            rows.append(f"1,{t:.4f},{max(v, 0.0):.5f},{command:.3f},0.0,0.0")
            t += 1.0 / rate
    rows[30] = rows[30].rpartition(",")[0] + ","
    return "\n".join(rows) + "\n"


def stopping_distance(speed: float, values: dict[str, float]) -> float:
    """On level ground, by Braking (7), (8), (12); derived independently here."""
    force = values["m_b"] * speed + values["b_b"]
    return speed * DEAD_TIME + speed**2 / (2.0 * G * force)


def test_params_reads_sets_and_restores(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("LOGNAME", "ann")
    robot.stop(0.42 * G)
    version = params(robot)["version"]
    shown = call(robot, "params").stdout
    for part in (f"version {version}", "b_b", "slip_track", "lateral_accel", "accepted ("):
        assert part in shown, shown
    reply = params(robot, "limits", "--set", "speed=1.5", "--set", "accel=0.5")
    assert reply["version"] == version + 1
    (limits,) = [g for g in reply["groups"] if g["group"] == "limits"]
    assert (limits["values"]["speed"], limits["values"]["accel"]) == (1.5, 0.5)
    assert limits["who"] == "ann"
    history = call(robot, "params", "limits", "--history").stdout
    assert "set speed = 1.5, accel = 0.5" in history
    assert "ann" in history
    restored = params(robot, "--rollback", version)
    assert {g["group"]: g["values"] for g in restored["groups"]}["limits"]["speed"] == 4.0
    (last,) = params(robot, "--history", "--most", 1)["history"]
    assert last["cause"] == f"rolled back to version {version}"


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("params", "limits", "--set", "speed=9"), "at most the 4 of the model file"),
        (("params", "nonsense"), "one of braking"),
        (("params", "--rollback", "999"), "version"),
    ],
)
def test_a_rejected_change_is_one_line(
    robot: Robot, world: Path, arguments: tuple[str, ...], expected: str
) -> None:
    one_line_of(call(robot, *arguments), expected)


@pytest.mark.parametrize("arguments", [("params",), ("replay", "few.csv")])
def test_no_reply_is_one_line(robot: Robot, world: Path, arguments: tuple[str, ...]) -> None:
    where = ("--connect", robot.service.endpoint, "--namespace", "absent/here", "--timeout", "0.3")
    one_line_of(here(*arguments, *where), "absent/here/v1/params", "got none")


def test_query_plans_on_the_map_that_it_sends(robot: Robot, world: Path) -> None:
    arguments = ("query", "paths.csv", "--map", "map.npz", "--speed", "1", "--timeout", "20")
    done = call(robot, *arguments, "--json")
    assert done.returncode == 0, done.stderr
    reply = json.loads(done.stdout)
    assert [plan["candidate"] for plan in reply["plans"]]
    assert reply["map_version"] > 0
    assert "reaches [m]" in call(robot, *arguments).stdout


def test_replay_learns_faster_than_the_drive(robot: Robot, tmp_path: Path) -> None:
    log = tmp_path / "drive.csv"
    log.write_text(drive(24))
    done = call(robot, "replay", log, "--speed-up", "inf", "--json")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["took"] < 0.2 * summary["driven"]
    assert summary["version"]["after"] > summary["version"]["before"]
    assert {entry["status"] for entry in summary["receipts"]} == {"taken"}
    schema = json.loads(here("replay", "--json-schema").stdout)
    assert schema["$defs"]["PlayedLog"]["required"] == list(summary)
    braking = summary["learned"]["braking"]
    for speed in (1.5, 3.0):
        true = speed * DEAD_TIME + speed**2 / (2.0 * G * FORCE)
        before, after = (stopping_distance(speed, braking[k]) for k in ("before", "after"))
        assert abs(after - true) < 0.5 * abs(before - true)
        assert after > 0.98 * true


def test_logs_whose_clocks_restart_are_all_accepted(robot: Robot, tmp_path: Path) -> None:
    logs = [tmp_path / name for name in ("first.csv", "second.csv")]
    for log, stops in zip(logs, (3, 4), strict=True):
        log.write_text(drive(stops))
    done = call(robot, "replay", *logs, "--speed-up", "inf", "--json")
    summary = json.loads(done.stdout)
    assert {entry["status"] for entry in summary["receipts"]} == {"taken"}
    batches = sum(entry["batches"] for entry in summary["receipts"])
    assert batches <= summary["driven"] / 0.25 + 10
    assert summary["version"]["after"] >= summary["version"]["before"] + 6


def test_replay_keeps_its_rate(robot: Robot, tmp_path: Path) -> None:
    log = tmp_path / "drive.csv"
    log.write_text(drive(2))
    begin = time.monotonic()
    done = call(robot, "replay", log, "--speed-up", "4")
    took = time.monotonic() - begin
    assert done.returncode == 0, done.stderr
    driven = 2 * (1.3 + DEAD_TIME) + (1.5 + 2.0) / (G * FORCE)
    assert took > 0.25 * driven - 0.3
