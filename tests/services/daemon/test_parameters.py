"""Parameters of a running service, by keys and payloads from another process."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import zenoh

from tests.services.parameter_client import FORMAT, Robot, block, ground, send_ground
from tests.services.robot_plant import Surface, Vehicle
from tests.services.service_process import Running, running

G = 9.80665
SETTINGS = (
    '[learning]\nstops_at_once = 10000\nrise = 0.02\nlabel_for = 1.5\n[store]\npath = "p.sqlite"'
)


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    with running(tmp_path_factory.mktemp("parameters"), planning=SETTINGS) as started:
        yield started


@pytest.fixture(scope="module")
def session(service: Running) -> Iterator[zenoh.Session]:
    with service.session() as opened:
        yield opened


@pytest.fixture
def robot(service: Running, session: zenoh.Session, request: Any) -> Iterator[Robot]:
    """A new sender, on parameters as in the model file."""
    sender = Robot(service, session, f"{request.node.name}-{time.monotonic_ns()}"[-100:])
    assert sender.roll_back(1)["status"] == "ok"
    if sender.plan()["map_version"] == 0:
        send_ground(sender)
    yield sender
    sender.set("limits", speed=4.0)


def as_bytes(robot: Robot) -> bytes:
    """All parameters in use, without their age."""
    groups = robot.parameters()["groups"]
    return json.dumps([{**g, "age": 0.0} for g in groups], sort_keys=True).encode()


def test_weaker_brakes_slow_plans_with_the_second_stop(robot: Robot) -> None:
    before, force = robot.top_speed(), robot.level_force()
    assert robot.stop(0.9 * G)["status"] == "taken"
    assert robot.level_force() == pytest.approx(force, abs=1e-3), "one outlier"
    robot.stop(0.43 * G)
    first = robot.stop(0.12 * G)
    assert first["status"] == "taken"
    assert first["durable"]
    assert robot.level_force() == pytest.approx(force, abs=0.01), "one outlier"
    second = robot.stop(0.12 * G)
    assert "changed" in second["reason"]
    assert second["version"] == first["version"] + 1
    reply = robot.plan(0.0, clear=8.0)
    assert reply["parameters"]["version"] == second["version"]
    assert robot.level_force() == pytest.approx(0.12, abs=0.01)
    assert robot.top_speed() < 0.95 * before
    assert reply["flags"] == []


def test_fields_of_a_group(robot: Robot) -> None:
    receipt = robot.stop(0.4 * G)
    group = robot.group()
    assert group["version"] == receipt["version"]
    assert set(group["values"]) == {"m_m", "b_m", "m_b", "b_b", "dead_time"}
    assert group["unit"]["m_b"] == "s/m"
    matrix = np.array(group["covariance"])
    np.testing.assert_allclose(
        [group["stds"][n] for n in ("m_m", "b_m", "m_b", "b_b")], np.sqrt(np.diag(matrix))
    )
    assert 0.0 <= group["age"] < 5.0
    assert group["who"] == robot.source
    assert group["cause"].startswith("stop 1: accepted")
    assert group["fingerprint"] == robot.plan()["parameters"]["fingerprint"]
    assert group["valid"] is False
    reply = robot.parameters()
    assert {g["group"] for g in reply["groups"]} >= {"braking", "terrain", "limits"}
    assert reply["version"] == receipt["version"]


def test_queries_without_payload_are_answered_in_json(robot: Robot, session: zenoh.Session) -> None:
    (reply,) = session.get(robot.service.key("params"), timeout=5.0)
    assert reply.ok is not None
    assert str(reply.ok.encoding) == "application/json;slopewise.parameter_reply.v1"
    fields = json.loads(reply.ok.payload.to_bytes())
    assert fields["status"] == "ok"
    replies = list(session.get(robot.service.key("params/*"), timeout=5.0))
    keys = {str(r.ok.key_expr) for r in replies if r.ok is not None}
    assert keys == {robot.service.key(f"params/{g['group']}") for g in fields["groups"]}
    (limits,) = session.get(robot.service.key("params/limits"), timeout=5.0)
    assert limits.ok is not None
    assert json.loads(limits.ok.payload.to_bytes())["groups"][0]["values"]["speed"] == 4.0
    (unknown,) = session.get(robot.service.key("params/nonsense"), timeout=5.0)
    assert unknown.ok is not None
    fields = json.loads(unknown.ok.payload.to_bytes())
    assert fields["status"] == "error"
    assert "one of braking" in fields["reason"]


def test_changes_are_published(robot: Robot, session: zenoh.Session) -> None:
    received: list[zenoh.Sample] = []
    all_of_them: list[zenoh.Sample] = []
    with (
        session.declare_subscriber(robot.service.key("params/*"), received.append),
        session.declare_subscriber(robot.service.key("params"), all_of_them.append),
    ):
        time.sleep(0.3)
        receipt = robot.stop(0.4 * G)
        until = time.monotonic() + 5.0
        while not (received and all_of_them) and time.monotonic() < until:
            time.sleep(0.01)
    groups = json.loads(all_of_them[-1].payload.to_bytes())["groups"]
    assert {"braking", "limits"} <= {group["group"] for group in groups}
    fields = [json.loads(s.payload.to_bytes()) for s in received]
    assert {str(s.key_expr) for s in received} == {robot.service.key("params/braking")}
    assert fields[-1]["version"] == receipt["version"]
    assert fields[-1] == {**robot.group(), "age": fields[-1]["age"]}


def test_malformed_stops_are_answered_and_counted(robot: Robot) -> None:
    before, counted = as_bytes(robot), robot.status()["counters"].get("stop_malformed", 0)
    for change in ({"deceleration": float("nan")}, {"surface": "a/b"}, {"colour": 1}):
        receipt = robot.send("stop", robot.stop_fields(0.1 * G) | change)
        assert receipt["status"] == "error"
        assert "obs/stop" in receipt["reason"]
        robot.put("stop", robot.stop_fields(0.1 * G) | change)
    time.sleep(0.1)
    assert robot.status()["counters"]["stop_malformed"] == counted + 6
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


def test_oversize_and_noise_are_answered_and_change_nothing(
    robot: Robot, session: zenoh.Session
) -> None:
    before = as_bytes(robot)
    for payload in (b"", b"\xff" * 50, bytes(1_000_001)):
        for kind in ("stop", "drive", "terrain"):
            (reply,) = session.get(
                robot.service.key(f"obs/{kind}"),
                payload=payload,
                timeout=5.0,
                encoding=FORMAT.format("stop_observation"),
            )
            assert reply.ok is not None
            assert msgspec.msgpack.decode(reply.ok.payload.to_bytes())["status"] == "error"
    assert as_bytes(robot) == before


def test_named_surfaces_are_learned_separately(robot: Robot) -> None:
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


def test_labels_of_the_ground_name_stops_and_lower_the_base(robot: Robot) -> None:
    robot.send("terrain", robot.fields(surface="grass", probability=0.5))
    robot.stop(0.43 * G)
    assert "braking.grass" not in names(robot), "the probability is too low"
    robot.send("terrain", robot.fields(surface="grass"))
    robot.stop(0.42 * G)
    assert "braking.grass" in names(robot)
    before = robot.level_force()
    receipt = robot.send("terrain", robot.fields(surface="mud"))
    assert receipt["status"] == "taken"
    assert robot.level_force() < 0.65 * before, "no stop on mud: the base falls immediately"
    assert robot.group()["cause"].startswith("terrain 5: ground is mud")
    time.sleep(2.0)
    assert robot.group()["cause"] == "the ground's label expired"
    assert robot.stop(0.4 * G)["status"] == "taken"
    assert "braking.mud" not in names(robot), "the label has expired"


def names(robot: Robot) -> list[str]:
    return [g["group"] for g in robot.parameters()["groups"]]


def test_stops_are_found_in_samples(robot: Robot) -> None:
    vehicle = Vehicle(seed=3)
    for _ in range(4):
        _, samples = vehicle.stop(Surface(0.2), 2.0)
        values = np.stack(list(samples.values()))
        for part in np.array_split(values, 7, axis=1):
            receipt = robot.send("drive", robot.fields(columns=list(samples), values=block(part)))
            assert receipt["status"] == "taken"
    assert robot.level_force() == pytest.approx(0.2, rel=0.05)
    assert robot.group()["notes"]["stops believed"] >= 3  # words: ok


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda c: c["v"].__setitem__(5, np.nan), "values.v[5]"),
        (lambda c: c["pitch"].__setitem__(0, np.inf), "values.pitch[0]"),
        (lambda c: c["t"].__setitem__(9, 0.0), "values.t[9]"),
        (lambda c: c.pop("v_cmd"), "columns"),
        (lambda c: c.__setitem__("colour", c["v"]), "columns"),
        (lambda c: c["v"].__setitem__(0, 1e6), "values.v[0]"),
    ],
    ids=["nan", "inf", "backwards", "missing", "unknown", "too fast"],
)
def test_bad_samples_are_refused_and_change_nothing(robot: Robot, change: Any, text: str) -> None:
    _, samples = Vehicle().stop(Surface(0.1), 2.0)
    before = as_bytes(robot)
    change(samples)
    fields = robot.fields(columns=list(samples), values=block(np.stack(list(samples.values()))))
    for _ in range(3):
        receipt = robot.send("drive", {**fields, "sequence": next(robot.sequence)})
        assert receipt["status"] in ("refused", "error")
        assert text in receipt["reason"]
    ragged = robot.fields(columns=["t", "v", "v_cmd", "pitch"], values=block(np.zeros(4)))
    assert "values" in robot.send("drive", ragged)["reason"]
    assert as_bytes(robot) == before


def test_operators_set_within_limits(robot: Robot) -> None:
    fast = robot.top_speed(30.0)
    assert robot.set("limits", speed=1.5)["status"] == "ok"
    assert robot.top_speed(30.0) <= 1.5 < fast
    assert robot.group("limits")["who"] == "test"
    assert robot.set("braking", b_b=0.2)["status"] == "ok"
    assert robot.level_force() == pytest.approx(0.23)
    assert robot.set("braking", b_b=0.6)["status"] == "ok"
    assert robot.level_force() == pytest.approx(0.43), "only stops raise it above the model file"
    assert robot.set("terrain", slip_track=1.4)["status"] == "ok"
    assert robot.group("terrain")["values"]["slip_track"] == pytest.approx(1.4)


@pytest.mark.parametrize(
    ("group", "values", "text"),
    [
        ("limits", {"speed": 5.0}, "at most the 4"),
        ("limits", {"min_load": 0.01}, "at least the 0.1"),
        ("limits", {"speed": -1.0}, "speed"),
        ("limits", {"colour": 1.0}, "one of speed"),
        ("braking", {"b_b": 5.0}, "F_b/W"),
        ("braking", {"b_b": -0.1}, "F_b/W"),
        ("braking", {"dead_time": 0.1}, "model file"),
        ("terrain", {"slip_track": 0.2}, "slip_track"),
        ("terrain", {"motion_resistance": 9.0}, "motion_resistance"),
        ("brakes", {"b_b": 0.3}, "one of braking"),
        ("braking.a/b", {"b_b": 0.3}, "one of braking"),
    ],
)
def test_operators_mistakes_are_named_and_change_nothing(
    robot: Robot, group: str, values: dict[str, float], text: str
) -> None:
    before = as_bytes(robot)
    reply = robot.set(group, **values)
    assert reply["status"] == "refused"
    assert text in reply["reason"]
    nan = robot.query(
        "params/set", {"group": "limits", "values": {"speed": float("nan")}}, "set_parameters"
    )
    assert nan is not None
    assert nan["status"] != "ok"
    assert as_bytes(robot) == before


def test_any_version_can_be_gone_back_to(robot: Robot) -> None:
    stored = {}
    for force in (0.42, 0.41, 0.2, 0.2, 0.19):
        version = robot.stop(force * G)["version"]
        stored[version] = robot.group()["values"], robot.top_speed()
    for version in (*stored, *reversed(stored)):
        reply = robot.roll_back(version, "braking")
        assert reply["status"] == "ok"
        values, speed = stored[version]
        assert robot.group()["values"] == pytest.approx(values, rel=1e-6)
        assert robot.top_speed() == pytest.approx(speed, rel=2e-3)
        assert robot.group()["cause"] == f"rolled back to version {version}"
    robot.set("limits", speed=2.0)
    robot.roll_back(min(stored), "braking")
    assert robot.group("limits")["values"]["speed"] == 2.0
    unknown = robot.roll_back(10**6)
    assert unknown["status"] == "refused"
    assert "version" in unknown["reason"]


def test_history_says_what_caused_what(robot: Robot) -> None:
    robot.stop(0.41 * G)
    robot.set("braking", b_b=0.3)
    history = robot.parameters("braking", history=3)["history"]
    assert [h["cause"].partition(":")[0] for h in history[:2]] == ["set b_b = 0.3", "stop 1"]
    assert [h["who"] for h in history[:2]] == ["test", robot.source]
    assert history[0]["version"] == history[1]["version"] + 1
    assert history[0]["values"]["b_b"] == 0.3
    assert abs(history[0]["at"] - time.time()) < 60.0
