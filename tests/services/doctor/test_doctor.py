"""Seeded mistakes are named, and robots that fit have no issues."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="the ros extra is not installed")

from slopewise.services.doctor.examine import absent, examine
from slopewise.services.doctor.message_collector import MessageCollector
from slopewise.services.doctor.nav2_file import read_nav2
from slopewise.services.doctor.robot_facts import ConfigIssue, ObservedTraffic, RobotFacts
from slopewise.services.io.bags import typestore
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.ros.settings import EdgeSettings, FallbackStop, Timing, WheelJoints
from tests.services.command_line import here
from tests.services.ros.ros_messages import header, odometry

MODEL = read_model(find_model("atv"))
T = typestore().types

NAV2: dict[str, Any] = {
    "controller_server": {
        "use_sim_time": False,
        "controller_frequency": 20.0,
        "speed_limit_topic": "speed_limit",
        "controller_plugins": ["FollowPath"],
        "FollowPath": {"vx_max": 3.5, "ax_min": -2.0},
    },
    "velocity_smoother": {
        "use_sim_time": False,
        "max_velocity": [3.5, 0.0, 2.0],
        "max_decel": [-2.0, 0.0, -3.0],
    },
    "diff_drive_controller": {
        "linear": {"x": {"has_acceleration_limits": True, "max_deceleration": 2.2}}
    },
    "twist_mux": {"locks": {"slopewise": {"topic": "speed_stop", "timeout": 0.5, "priority": 255}}},
    "local_costmap": {"footprint": "[[0.9, 0.62], [0.9, -0.62], [-0.9, -0.62], [-0.9, 0.62]]"},
}


def parameters(tmp_path: Path, nodes: dict[str, Any]) -> Any:
    """Parameters in a file; JSON is YAML."""
    file = tmp_path / "params.yaml"
    wrapped = {node: {"ros__parameters": table} for node, table in nodes.items()}
    wrapped["local_costmap"] = {"local_costmap": wrapped.get("local_costmap", {})}
    file.write_text(json.dumps(wrapped))
    return read_nav2([file])


def limit(t: float, value: float, percentage: bool = False) -> Any:
    return T["nav2_msgs/msg/SpeedLimit"](header("", t), percentage, value)


Message = tuple[float, str, str, Any]


def drive(
    *,
    obeys: bool = True,
    rate: float = 50.0,
    late: float = 0.0,
    scale: float = 1.0,
    lowered: float = 1.0,
    percentage: bool = False,
    frame: str = "map",
) -> list[Message]:
    """Twenty seconds: 2 m/s, then a lower limit, obeyed at 1.5 m/s²."""
    messages: list[Message] = []
    x, speed, begun = 0.0, 2.0, 1_800_000_000.0
    for k in range(round(20 * rate)):
        t = begun + k / rate
        goal = 2.0 if k < 8 * rate or not obeys else lowered
        speed = max(speed - 1.5 / rate, goal) if k > 8.3 * rate else speed
        x += speed / rate
        message = odometry(speed * scale, x, t - late, frame)
        messages.append((t, "/odom", "nav_msgs/msg/Odometry", message))
    for k in range(200):
        t = begun + 0.1 * k
        value = 2.0 if k < 80 else lowered
        messages.append(
            (t, "/speed_limit", "nav2_msgs/msg/SpeedLimit", limit(t, value, percentage))
        )
    return sorted(messages, key=lambda message: message[0])


def seen(messages: list[Message]) -> ObservedTraffic:
    collector = MessageCollector()
    for at, topic, kind, message in messages:
        collector.take(topic, kind, message, at)
    return collector.seen


def restamped(stamp: float) -> ObservedTraffic:
    """A drive whose odometry has the same stamp throughout [s]."""
    messages = drive()
    for _, topic, _, message in messages:
        if topic == "/odom":
            message.header = header("map", stamp)
    return seen(messages)


class MapStub:
    def __init__(self, t: float, frame: str) -> None:
        self.header = header(frame, t)


def with_map(traffic: ObservedTraffic, age: float = 0.5, frame: str = "map") -> ObservedTraffic:
    collector = MessageCollector()
    collector.seen = traffic
    for k in range(20):
        at = 1_800_000_000.0 + k
        collector.take("/elevation_map", "grid_map_msgs/msg/GridMap", MapStub(at - age, frame), at)
    return traffic


def change(*keys: str, to: Any) -> Callable[[dict[str, Any]], None]:
    def act(nodes: dict[str, Any]) -> None:
        table = nodes
        for key in keys[:-1]:
            table = table.setdefault(key, {})
        if to is None:
            table.pop(keys[-1], None)
        else:
            table[keys[-1]] = to

    return act


SMOOTHER, BASE = "velocity_smoother", ("diff_drive_controller", "linear", "x", "max_deceleration")
SMALL = "[[0.5, 0.3], [0.5, -0.3], [-0.5, -0.3], [-0.5, 0.3]]"
FILTER = {"plugin": "nav2_costmap_2d::SpeedFilter"}
SERVER = "controller_server"

PARAMETER_MISTAKES = {
    "smoother weaker": (
        change(SMOOTHER, "max_decel", to=[-1.6, 0.0, -3.0]),
        "deceleration along the chain",
    ),
    "base weaker": (change(*BASE, to=1.6), "deceleration along the chain"),
    "more than the brakes can": (change(*BASE, to=6.0), "deceleration against the brakes"),
    "less than plans need": (change(*BASE, to=1.0), "deceleration against the plan"),
    "sign": (change(SMOOTHER, "max_decel", to=[2.0, 0.0, 3.0]), "sign of a deceleration"),
    "sign of DWB": (change(SERVER, "FollowPath", "decel_lim_x", to=2.0), "sign of a deceleration"),
    "text": (
        change(SERVER, "FollowPath", "ax_min", to="$(var brakes)"),
        "a parameter that is no number",
    ),
    "not a number": (change(SMOOTHER, "max_decel", to=[nan]), "a parameter that is no number"),
    "smoother slower": (
        change(SMOOTHER, "max_velocity", to=[1.0, 0.0, 2.0]),
        "speed along the chain",
    ),
    "too fast": (change(SERVER, "FollowPath", "vx_max", to=8.0), "speed against the model"),
    "other topic": (change(SERVER, "speed_limit_topic", to="/limits"), "topic of the limit"),
    "speed filter": (change("local_costmap", "speed_filter", to=FILTER), "two who limit"),
    "no lock": (change("twist_mux", "locks", to={}), "lock"),
    "open lock": (change("twist_mux", "locks", "slopewise", "timeout", to=0.0), "lock"),
    "footprint": (change("local_costmap", "footprint", to=SMALL), "footprint"),
    "two clocks": (change(SMOOTHER, "use_sim_time", to=True), "clock"),
    "controller at rest": (
        change(SERVER, "controller_frequency", to=0.0),
        "rate of the controller",
    ),
    "plugins by default": (
        lambda nodes: (
            change(SERVER, "controller_plugins", to=None)(nodes),
            change(SERVER, "FollowPath", "ax_min", to=-6.0)(nodes),
        ),
        "deceleration against the brakes",
    ),
    "slow controller": (change(SERVER, "controller_frequency", to=5.0), "rate of the controller"),
}

WHEELS = WheelJoints(left="l", right="r", radius=0.165)

EDGE_MISTAKES = {
    "own stop too hard": (EdgeSettings(stop=FallbackStop(deceleration=6.0)), "the edge's own stop"),
    "own stop too quick": (EdgeSettings(stop=FallbackStop(dead_time=0.1)), "the edge's own stop"),
    "wheel radius": (EdgeSettings(wheels=WHEELS), "wheel radius"),
    "short life": (EdgeSettings(timing=Timing(life=0.09, period=0.05)), "life of a limit"),
}

TRAFFIC_MISTAKES = {
    "ignored limit": (lambda: seen(drive(obeys=False)), "limits are not obeyed"),
    "limit of 0": (lambda: seen(drive(lowered=0.0)), "a limit of 0"),
    "percentage": (lambda: seen(drive(percentage=True)), "a limit in percent"),
    "slow odometry": (lambda: seen(drive(rate=4.0)), "rate"),
    "late stamps": (lambda: seen(drive(late=3.0)), "clock"),
    "no stamps": (lambda: restamped(0.0), "stamps"),
    "repeated stamps": (lambda: restamped(1_800_000_000.0), "stamps"),
    "wrong wheel": (lambda: seen(drive(scale=1.25)), "odometry against itself"),
    "old map": (lambda: with_map(seen(drive()), age=60.0), "map"),
    "no transform": (lambda: with_map(seen(drive(frame="odom"))), "frames"),
}


def named(issues: list[ConfigIssue]) -> set[str]:
    return {issue.check for issue in issues}


@pytest.mark.parametrize("mistake", PARAMETER_MISTAKES)
def test_mistakes_in_parameter_files_are_named(tmp_path: Path, mistake: str) -> None:
    nodes = copy.deepcopy(NAV2)
    act, check = PARAMETER_MISTAKES[mistake]
    act(nodes)
    issues = examine(RobotFacts(MODEL, EdgeSettings(), parameters(tmp_path, nodes)))
    assert check in named(issues), issues
    assert all(issue.message and issue.fix for issue in issues)


@pytest.mark.parametrize("mistake", EDGE_MISTAKES)
def test_mistakes_in_the_settings_of_the_edge_are_named(tmp_path: Path, mistake: str) -> None:
    edge, check = EDGE_MISTAKES[mistake]
    assert named(examine(RobotFacts(MODEL, edge, parameters(tmp_path, NAV2)))) == {check}


@pytest.mark.parametrize("mistake", TRAFFIC_MISTAKES)
def test_mistakes_in_the_traffic_of_a_drive_are_named(mistake: str) -> None:
    make, check = TRAFFIC_MISTAKES[mistake]
    issues = examine(RobotFacts(MODEL, seen=make()))
    assert check in named(issues), issues


SANE_TRAFFIC = {
    "obeys": lambda: seen(drive()),
    "in odom, connected": lambda: connected(),
    "odometry at 10 Hz": lambda: with_map(seen(drive(rate=10.0))),
    "slows to a crawl": lambda: with_map(seen(drive(lowered=0.01))),
}


def connected() -> ObservedTraffic:
    traffic = with_map(seen(drive(frame="odom")))
    traffic.links["odom"] = "map"
    return traffic


@pytest.mark.parametrize("sane", ["mppi", "dwb", "regulated", *SANE_TRAFFIC])
def test_robots_that_fit_have_no_issues(tmp_path: Path, sane: str) -> None:
    nodes, traffic = copy.deepcopy(NAV2), ObservedTraffic()
    if sane == "dwb":
        nodes["controller_server"]["FollowPath"] = {"max_vel_x": 2.0, "decel_lim_x": -1.8}
        nodes["global_costmap"] = {"robot_radius": 1.0}
    elif sane == "regulated":
        nodes["controller_server"]["FollowPath"] = {"desired_linear_vel": 2.0}
        del nodes["twist_mux"], nodes["diff_drive_controller"]
    elif sane in SANE_TRAFFIC:
        traffic = SANE_TRAFFIC[sane]()
    has_map = not traffic.topics or "/elevation_map" in traffic.topics
    edge = EdgeSettings(wheels=WheelJoints(left="l", right="r", radius=0.28)) if has_map else None
    assert examine(RobotFacts(MODEL, edge, parameters(tmp_path, nodes), traffic)) == []


def write_bag(folder: Path, messages: list[Message]) -> Path:
    from rosbags.rosbag2 import StoragePlugin, Writer

    store = typestore()
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections: dict[str, Any] = {}
        for at, topic, kind, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            data = store.serialize_cdr(message, kind)
            writer.write(connections[topic], round(1e9 * at), data)
    return folder


@pytest.mark.parametrize(("obeys", "status"), [(True, 0), (False, 3)])
def test_command_examines_a_recording(tmp_path: Path, obeys: bool, status: int) -> None:
    bag = write_bag(tmp_path / "bag", drive(obeys=obeys))
    done = here("doctor", "--bag", str(bag), "--model", "atv", "--json")
    assert done.returncode == status, done.stderr
    result = json.loads(done.stdout)
    assert result["looked_at"] == ["model", "messages"]
    assert [f["check"] for f in result["findings"]] == ([] if obeys else ["limits are not obeyed"])
    assert [text.split()[1] for text in result["absent"]] == [
        "nav_msgs/msg/Path",
        "grid_map_msgs/msg/GridMap",
        "tf2_msgs/msg/TFMessage",
    ]


def test_traffic_on_other_topics_is_named_as_such() -> None:
    traffic = with_map(seen([(t, "/r1" + name, k, m) for t, name, k, m in drive()]))
    texts = absent(RobotFacts(MODEL, None, seen=traffic))
    odometry = next(text for text in texts if "Odometry" in text)
    assert odometry.endswith(
        "on /odom, not checked: rate, frame; --config names the topic, as one of /r1/odom"
    )
    assert not any("GridMap" in text for text in texts)
    assert absent(RobotFacts(MODEL)) == []  # without traffic nothing is expected of it


def noisy_map(tmp_path: Path, std: float, cell: float, **stated: Any) -> Path:
    file = tmp_path / "map.npz"
    heights = std * np.random.default_rng(1).standard_normal((80, 90))
    np.savez(file, elevation=heights, resolution=cell, origin=(0.0, 0.0), **stated)
    return file


@pytest.mark.parametrize(
    ("std", "cell", "stated", "check", "severity"),
    [
        (0.03, 0.1, {}, "map noise", "warning"),
        (0.2, 0.1, {"height_std": 0.2}, "map noise", "error"),
        (0.01, 0.5, {}, "map cells", "warning"),
        (0.02, 0.1, {"height_std": 0.01}, "map error", "warning"),
        (5.0, 0.1, {"height_std": 0.0}, "map heights", "warning"),
    ],
)
def test_what_a_map_does_not_show_is_reported_before_planning(
    tmp_path: Path, std: float, cell: float, stated: dict[str, float], check: str, severity: str
) -> None:
    file = noisy_map(tmp_path, std, cell, **stated)
    done = here("doctor", file, "--model", "atv", "--json")
    issues = {f["check"]: f for f in json.loads(done.stdout)["findings"]}
    assert issues[check]["severity"] == severity
    assert done.returncode == (3 if severity == "error" else 0)
    if check == "map noise":
        assert "scans" in issues[check]["remedy"]


def test_an_exact_map_has_no_issue_and_needs_a_model(tmp_path: Path) -> None:
    file = noisy_map(tmp_path, 0.0, 0.1, height_std=0.0)
    assert "everything that could be checked fits" in here("doctor", file, "-m", "atv").stdout
    assert "--model" in here("doctor", file).stderr
