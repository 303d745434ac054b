"""Parameters of a running service, by keys and payloads from another process: one test a key."""

from __future__ import annotations

import json
import time
from pathlib import Path

import msgspec
import numpy as np
import pytest
import zenoh

from tests.services.parameter_client import FORMAT, Robot, ground, send_ground
from tests.services.service_process import running, until

G = 9.80665


def as_bytes(robot: Robot) -> bytes:
    """All parameters in use, without their age."""
    groups = robot.parameters()["groups"]
    return json.dumps([{**g, "age": 0.0} for g in groups], sort_keys=True).encode()


def test_weaker_brakes_slow_plans_with_the_second_stop(robot: Robot) -> None:
    before, force = robot.top_speed(), robot.level_force()
    # What the same service was sent before by others is warned of for a while.
    warned_of = robot.plan(0.0, clear=8.0)["flags"]
    assert robot.stop(0.9 * G)["status"] == "taken"
    robot.stop(0.43 * G)
    first = robot.stop(0.12 * G)
    assert (first["status"], first["durable"]) == ("taken", True)
    assert robot.level_force() == pytest.approx(force, abs=0.01), "one outlier"
    second = robot.stop(0.12 * G)
    assert "changed" in second["reason"]
    assert second["version"] == first["version"] + 1
    reply, group = robot.plan(0.0, clear=8.0), robot.group()
    assert reply["parameters"]["version"] == group["version"] == second["version"]
    assert robot.level_force() == pytest.approx(0.12, abs=0.01)
    assert robot.top_speed() < 0.95 * before
    assert set(reply["flags"]) <= set(warned_of)
    assert group["unit"]["m_b"] == "s/m"
    stds = np.sqrt(np.diag(group["covariance"]))
    assert [group["stds"][n] for n in ("m_m", "b_m", "m_b", "b_b")] == pytest.approx(stds)
    assert 0.0 <= group["age"] < 5.0
    assert (group["who"], group["valid"]) == (robot.source, False)
    assert group["cause"].startswith("stop 4: ")
    assert group["fingerprint"] == reply["parameters"]["fingerprint"]


def test_queries_without_payload_are_answered_in_json(robot: Robot, session: zenoh.Session) -> None:
    def read(key: str) -> dict[str, dict]:
        replies = [r.ok for r in session.get(robot.service.key(key), timeout=5.0)]
        assert all(r is not None for r in replies)
        encodings = {str(r.encoding) for r in replies if r is not None}
        assert encodings == {"application/json;slopewise.parameter_reply.v1"}
        return {str(r.key_expr): json.loads(r.payload.to_bytes()) for r in replies if r}

    (fields,) = read("params").values()
    assert fields["status"] == "ok"
    keys = {robot.service.key(f"params/{g['group']}") for g in fields["groups"]}
    assert set(read("params/*")) == keys
    (limits,) = read("params/limits").values()
    assert limits["groups"][0]["values"]["speed"] == 4.0
    (unknown,) = read("params/nonsense").values()
    assert unknown["status"] == "error"
    assert "one of braking" in unknown["reason"]


def test_changes_are_published(robot: Robot, session: zenoh.Session) -> None:
    received: list[zenoh.Sample] = []
    all_of_them: list[zenoh.Sample] = []
    with (
        session.declare_subscriber(robot.service.key("params/*"), received.append),
        session.declare_subscriber(robot.service.key("params"), all_of_them.append),
    ):
        time.sleep(0.3)
        receipt = robot.stop(0.4 * G)
        until(lambda: received and all_of_them)
    groups = json.loads(all_of_them[-1].payload.to_bytes())["groups"]
    assert {"braking", "limits"} <= {group["group"] for group in groups}
    fields = [json.loads(s.payload.to_bytes()) for s in received]
    assert {str(s.key_expr) for s in received} == {robot.service.key("params/braking")}
    assert fields[-1]["version"] == receipt["version"]
    assert fields[-1] == {**robot.group(), "age": fields[-1]["age"]}


def test_malformed_observations_are_answered_counted_and_change_nothing(
    robot: Robot, session: zenoh.Session
) -> None:
    before, counted = as_bytes(robot), robot.status()["counters"].get("stop_malformed", 0)
    for change in ({"deceleration": float("nan")}, {"surface": "a/b"}, {"colour": 1}):
        receipt = robot.send("stop", robot.stop_fields(0.1 * G) | change)
        assert receipt["status"] == "error"
        assert "obs/stop" in receipt["reason"]
        robot.put("stop", robot.stop_fields(0.1 * G) | change)
    time.sleep(0.1)
    assert robot.status()["counters"]["stop_malformed"] == counted + 6
    for payload in (b"", b"\xff" * 50, bytes(1_000_001)):
        for kind in ("stop", "drive", "terrain"):
            key, encoding = robot.service.key(f"obs/{kind}"), FORMAT.format("stop_observation")
            (reply,) = session.get(key, payload=payload, timeout=5.0, encoding=encoding)
            assert msgspec.msgpack.decode(reply.ok.payload.to_bytes())["status"] == "error"
    assert as_bytes(robot) == before


def test_operators_are_answered_while_observations_are_lost(tmp_path: Path) -> None:
    """More observations than wait in the queue; changes precede them, and each read is answered."""
    learning = "[learning]\nqueue = 4\nstops_at_once = 10000"
    with running(tmp_path, planning=learning) as service, service.session() as session:
        robot, reads = Robot(service, session), []
        for n in range(400):
            robot.put("stop", robot.stop_fields(0.43 * G))
            if n % 20 == 0:
                reads.append(session.get(service.key("params"), timeout=20.0))
        assert robot.set("limits", speed=2.0)["status"] == "ok"
        for replies in reads:
            (reply,) = replies
            assert reply.ok is not None
        status = robot.status()
        assert any("observations were lost" in flag for flag in status["flags"])
        assert status["counters"]["observations_lost"] > 0
        assert status["counters"].get("stop_out_of_order", 0) == 0


def test_surfaces_that_the_map_names_are_learned_separately(robot: Robot) -> None:
    base = robot.group("braking")["values"]
    classes = np.zeros((41, 400))
    send_ground(robot, ground(["", "ice"], classes))
    for _ in range(3):
        robot.stop(0.1 * G, surface="ice")
    assert robot.level_force("braking.ice") == pytest.approx(0.1, abs=0.01)
    assert robot.group("braking")["values"] == base, "the map distinguishes surfaces"
    free = robot.top_speed()
    classes[:, 20:] = 1
    send_ground(robot, ground(["", "ice"], classes))
    icy = robot.top_speed()
    assert icy < 0.9 * free
    send_ground(robot, ground(["", "snow"], classes))
    assert robot.top_speed() < icy, "there was no stop on it"
    send_ground(robot)
    robot.stop(0.1 * G, surface="ice")
    assert robot.group("braking")["version"] > 1, "without names the base stands for the ground"
