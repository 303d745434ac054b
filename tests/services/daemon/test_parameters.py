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
    one = Robot(service, session, f"{request.node.name}-{time.monotonic_ns()}"[-100:])
    assert one.roll_back(1)["status"] == "ok"
    if one.plan()["map_version"] == 0:
        send_ground(one)
    yield one
    one.set("limits", speed=4.0)


def as_bytes(robot: Robot) -> bytes:
    """All that is planned with; what only time changes is left out."""
    groups = robot.parameters()["groups"]
    return json.dumps([{**g, "age": 0.0} for g in groups], sort_keys=True).encode()


def test_weaker_brakes_slow_plans_with_the_second_stop_and_plans_say_so(robot: Robot) -> None:
    before = robot.top_speed()
    first = robot.stop(0.12 * G)
    assert first["status"] == "taken"
    assert first["durable"]
    assert "not believed" in first["reason"]
    second = robot.stop(0.12 * G)
    assert "changed" in second["reason"]
    assert second["version"] == first["version"] + 1
    reply = robot.plan(0.0, clear=8.0)
    assert reply["parameters"]["version"] == second["version"]
    assert robot.level_force() == pytest.approx(0.12, abs=0.01)
    assert robot.top_speed() < 0.95 * before
    assert reply["flags"] == []


def test_stronger_brakes_make_plans_faster_by_steps_and_only_once_they_are_sure(
    robot: Robot,
) -> None:
    before = robot.level_force()
    forces = []
    for i in range(16):
        speed, grade = 1.2 + 0.4 * (i % 7), 0.1 * (-1) ** i
        level = 0.60 + 0.015 * (speed - 2.0) + (-0.03 * speed - 0.35) * grade
        robot.stop(G * (level + float(np.sin(grade))), speed=speed, grade=grade)
        forces.append(robot.level_force())
    steps = np.diff([before, *forces])
    assert max(forces[:7]) <= before + 1e-9
    assert forces[-1] > before + 0.05
    assert steps.max() <= 0.02 + 1e-9
    assert robot.group()["valid"]


def test_a_group_tells_all_about_itself(robot: Robot) -> None:
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


def test_people_read_with_empty_hands(robot: Robot, session: zenoh.Session) -> None:
    (reply,) = session.get(robot.service.key("params"), timeout=5.0)
    assert reply.ok is not None
    assert str(reply.ok.encoding) == "application/json;slopewise.parameter_reply.v1"
    told = json.loads(reply.ok.payload.to_bytes())
    assert told["status"] == "ok"
    replies = list(session.get(robot.service.key("params/*"), timeout=5.0))
    keys = {str(r.ok.key_expr) for r in replies if r.ok is not None}
    assert keys == {robot.service.key(f"params/{g['group']}") for g in told["groups"]}
    (one,) = session.get(robot.service.key("params/limits"), timeout=5.0)
    assert one.ok is not None
    assert json.loads(one.ok.payload.to_bytes())["groups"][0]["values"]["speed"] == 4.0
    (none,) = session.get(robot.service.key("params/nonsense"), timeout=5.0)
    assert none.ok is not None
    told = json.loads(none.ok.payload.to_bytes())
    assert told["status"] == "error"
    assert "one of braking" in told["reason"]


def test_changes_are_published(robot: Robot, session: zenoh.Session) -> None:
    heard: list[zenoh.Sample] = []
    all_of_them: list[zenoh.Sample] = []
    with (
        session.declare_subscriber(robot.service.key("params/*"), heard.append),
        session.declare_subscriber(robot.service.key("params"), all_of_them.append),
    ):
        time.sleep(0.3)
        receipt = robot.stop(0.4 * G)
        until = time.monotonic() + 5.0
        while not (heard and all_of_them) and time.monotonic() < until:
            time.sleep(0.01)
    groups = json.loads(all_of_them[-1].payload.to_bytes())["groups"]
    assert {"braking", "limits"} <= {group["group"] for group in groups}
    told = [json.loads(s.payload.to_bytes()) for s in heard]
    assert {str(s.key_expr) for s in heard} == {robot.service.key("params/braking")}
    assert told[-1]["version"] == receipt["version"]
    assert told[-1] == {**robot.group(), "age": told[-1]["age"]}


def bad(robot: Robot, what: str) -> dict[str, Any]:
    """A stop that is wrong in one way."""
    stop = robot.stop_fields(0.1 * G)
    changes: dict[str, dict[str, Any]] = {
        "nan": {"deceleration": float("nan")},
        "inf": {"speed": float("inf")},
        "negative": {"deceleration": -1.0},
        "too fast": {"speed": 400.0},
        "nan time": {"time": float("nan")},
        "surface": {"surface": "a/b"},
        "unknown": {"colour": 1},
        "long": {"source": "x" * 1000},
        "text": {"speed": "fast"},
    }
    return {**stop, **changes[what]}


@pytest.mark.parametrize(
    "what",
    ["nan", "inf", "negative", "too fast", "nan time", "surface", "unknown", "long", "text"],
)
def test_malformed_stops_are_answered_counted_and_change_nothing(robot: Robot, what: str) -> None:
    before, counted = as_bytes(robot), robot.status()["counters"].get("stop_malformed", 0)
    fields = bad(robot, what)
    for _ in range(2):
        receipt = robot.send("stop", {**fields, "sequence": 1})
        assert receipt["status"] == "error"
        assert "obs/stop" in receipt["reason"]
    robot.put("stop", fields)
    time.sleep(0.05)
    assert robot.status()["counters"]["stop_malformed"] == counted + 3
    assert as_bytes(robot) == before


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


def test_duplicates_and_late_ones_are_ignored_and_counted(robot: Robot) -> None:
    stops = [robot.stop_fields(0.1 * G) for _ in range(3)]
    assert robot.send("stop", stops[1])["status"] == "taken"
    before, counters = as_bytes(robot), robot.status()["counters"]
    again = robot.send("stop", stops[1])
    assert (again["status"], again["reason"]) == ("ignored", "duplicate")
    late = robot.send("stop", stops[0])
    assert (late["status"], late["reason"]) == ("ignored", "out of order")
    assert as_bytes(robot) == before
    after = robot.status()["counters"]
    assert after["stop_duplicate"] == counters.get("stop_duplicate", 0) + 1
    assert after["stop_out_of_order"] == counters.get("stop_out_of_order", 0) + 1
    assert robot.send("stop", stops[2])["status"] == "taken"


def test_stops_of_the_future_are_refused_and_counted(robot: Robot) -> None:
    robot.stop(0.4 * G)
    before, counted = as_bytes(robot), robot.status()["counters"].get("stop_future", 0)
    for ahead in (3600.0, 10.0, 1e9):
        receipt = robot.stop(0.1 * G, time=time.monotonic() + ahead)
        assert (receipt["status"], receipt["reason"]) == ("refused", "future")
    assert as_bytes(robot) == before
    assert robot.status()["counters"]["stop_future"] == counted + 3
    assert robot.stop(0.4 * G)["status"] == "taken"


def test_a_senders_clock_that_was_set_is_believed_after_a_while_and_flagged(robot: Robot) -> None:
    robot.stop(0.4 * G)
    for jump, word in ((3600.0, "future"), (-3600.0, "late")):
        statuses = [robot.stop(0.4 * G, time=time.monotonic() + jump)["reason"] for _ in range(4)]
        assert statuses == [word] * 4
        assert robot.stop(0.4 * G, time=time.monotonic() + jump)["status"] == "taken"
        assert robot.stop(0.4 * G, time=time.monotonic() + jump)["status"] == "taken"
    flags = robot.parameters()["flags"]
    assert f"the clock of {robot.source} was set" in flags


def test_one_outlier_is_not_believed(robot: Robot) -> None:
    for _ in range(5):
        robot.stop(0.43 * G)
    before = robot.level_force()
    assert "not believed" in robot.stop(0.9 * G)["reason"]
    assert robot.level_force() == pytest.approx(before, abs=1e-3)
    assert "not believed" in robot.stop(0.1 * G)["reason"]
    assert robot.level_force() == pytest.approx(before, abs=1e-3)
    assert robot.stop(0.43 * G)["reason"] == "accepted"


def test_surfaces_by_name_learn_apart(robot: Robot) -> None:
    base = robot.group("braking")["values"]
    classes = np.zeros((41, 400))
    send_ground(robot, ground(["", "ice"], classes))
    for _ in range(3):
        robot.stop(0.1 * G, surface="ice")
    assert robot.level_force("braking.ice") == pytest.approx(0.1, abs=0.01)
    assert robot.group("braking")["values"] == base, "the map tells surfaces apart"
    free = robot.top_speed()
    classes[:, 20:] = 1
    send_ground(robot, ground(["", "ice"], classes))
    icy = robot.top_speed()
    assert icy < 0.9 * free
    send_ground(robot, ground(["", "snow"], classes))
    assert robot.top_speed() < icy, "nobody ever braked on it"
    send_ground(robot)
    robot.stop(0.1 * G, surface="ice")
    assert robot.group("braking")["version"] > 1, "without names the base stands for the ground"


def test_labels_of_the_ground_name_stops_and_lower_the_base(robot: Robot) -> None:
    robot.send("terrain", robot.fields(surface="grass", probability=0.5))
    robot.stop(0.43 * G)
    assert "braking.grass" not in names(robot), "nobody is sure"
    robot.send("terrain", robot.fields(surface="grass"))
    robot.stop(0.42 * G)
    assert "braking.grass" in names(robot)
    before = robot.level_force()
    receipt = robot.send("terrain", robot.fields(surface="mud"))
    assert receipt["status"] == "taken"
    assert robot.level_force() < 0.65 * before, "nobody braked on mud: the base falls at once"
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
        whole = np.stack(list(samples.values()))
        for part in np.array_split(whole, 7, axis=1):
            receipt = robot.send("drive", robot.fields(columns=list(samples), values=block(part)))
            assert receipt["status"] == "taken"
    assert robot.level_force() == pytest.approx(0.2, rel=0.05)
    assert robot.group()["notes"]["stops believed"] >= 3


@pytest.mark.parametrize(
    ("change", "words"),
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
def test_bad_samples_are_refused_and_change_nothing(robot: Robot, change: Any, words: str) -> None:
    _, samples = Vehicle().stop(Surface(0.1), 2.0)
    before = as_bytes(robot)
    change(samples)
    fields = robot.fields(columns=list(samples), values=block(np.stack(list(samples.values()))))
    for _ in range(3):
        receipt = robot.send("drive", {**fields, "sequence": next(robot.sequence)})
        assert receipt["status"] in ("refused", "error")
        assert words in receipt["reason"]
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
    assert robot.level_force() == pytest.approx(0.43), "above the model file only stops can tell"
    assert robot.set("terrain", slip_track=1.4)["status"] == "ok"
    assert robot.group("terrain")["values"]["slip_track"] == pytest.approx(1.4)


@pytest.mark.parametrize(
    ("group", "values", "words"),
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
    robot: Robot, group: str, values: dict[str, float], words: str
) -> None:
    before = as_bytes(robot)
    reply = robot.set(group, **values)
    assert reply["status"] == "refused"
    assert words in reply["reason"]
    nan = robot.query(
        "params/set", {"group": "limits", "values": {"speed": float("nan")}}, "set_parameters"
    )
    assert nan is not None
    assert nan["status"] != "ok"
    assert as_bytes(robot) == before


def test_any_version_can_be_gone_back_to(robot: Robot) -> None:
    kept = {}
    for force in (0.42, 0.41, 0.2, 0.2, 0.19):
        version = robot.stop(force * G)["version"]
        kept[version] = robot.group()["values"], robot.top_speed()
    for version in (*kept, *reversed(kept)):
        reply = robot.roll_back(version, "braking")
        assert reply["status"] == "ok"
        values, speed = kept[version]
        assert robot.group()["values"] == pytest.approx(values, rel=1e-6)
        assert robot.top_speed() == pytest.approx(speed, rel=2e-3)
        assert robot.group()["cause"] == f"rolled back to version {version}"
    robot.set("limits", speed=2.0)
    robot.roll_back(min(kept), "braking")
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


def test_terrain_is_learned_from_samples_of_a_skid_steered_robot(tmp_path: Path) -> None:
    from tests.models.terrain import plant

    vehicle = plant.drive(plant.square(sides=2), plant.SAND, speed_body(), seed=1)
    with (
        running(tmp_path, planning=SETTINGS, model="husky") as started,
        started.session() as opened,
    ):
        robot = Robot(started, opened)
        before = robot.group("terrain")["values"]
        for part in np.array_split(np.stack(list(vehicle.values())), 20, axis=1):
            fields = robot.fields(columns=list(vehicle), values=block(part))
            assert robot.send("drive", fields)["status"] == "taken"
        group = robot.group("terrain")
    assert group["valid"]
    assert group["values"]["motion_resistance"] > before["motion_resistance"]
    assert group["values"]["slip_track"] == pytest.approx(1.62, rel=0.15)


def speed_body() -> Any:
    from tests.models.terrain import plant

    return plant.Body()
