"""Seeded mistakes are found by name, and nothing is said of robots that fit."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="the ros extra is not installed")

from slopewise.models.errors import InputError
from slopewise.services.doctor.collect import Collector
from slopewise.services.doctor.examine import examine
from slopewise.services.doctor.facts import Facts, Misfit, MisfitSeverity, Seen
from slopewise.services.doctor.nav2_file import read_nav2
from slopewise.services.io.bags import typestore
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.ros.settings import EdgeSettings, OwnStop, Timing, Wheels
from tests.services.command_line import here

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
        "linear": {"x": {"has_acceleration_limits": True, "max_deceleration": 2.2}},
    },
    "twist_mux": {"locks": {"slopewise": {"topic": "speed_stop", "timeout": 0.5, "priority": 255}}},
    "local_costmap": {"footprint": "[[0.9, 0.62], [0.9, -0.62], [-0.9, -0.62], [-0.9, 0.62]]"},
}


def parameters(tmp_path: Path, nodes: dict[str, Any]) -> Any:
    """As a file holds them, and as JSON is YAML."""
    file = tmp_path / "params.yaml"
    wrapped = {node: {"ros__parameters": table} for node, table in nodes.items()}
    wrapped["local_costmap"] = {"local_costmap": wrapped.get("local_costmap", {})}
    file.write_text(json.dumps(wrapped))
    return read_nav2([file])


def header(t: float, frame: str) -> Any:
    sec = int(t)
    stamp = T["builtin_interfaces/msg/Time"](sec, round(1e9 * (t - sec)))
    return T["std_msgs/msg/Header"](stamp, frame)


def odometry(t: float, x: float, speed: float, frame: str = "map") -> Any:
    point, vector = T["geometry_msgs/msg/Point"], T["geometry_msgs/msg/Vector3"]
    turn = T["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    pose = T["geometry_msgs/msg/Pose"](point(x, 0.0, 0.0), turn)
    twist = T["geometry_msgs/msg/Twist"](vector(speed, 0.0, 0.0), vector(0.0, 0.0, 0.0))
    here = T["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36))
    moving = T["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36))
    return T["nav_msgs/msg/Odometry"](header(t, frame), "base_link", here, moving)


def limit(t: float, value: float, percentage: bool = False) -> Any:
    return T["nav2_msgs/msg/SpeedLimit"](header(t, ""), percentage, value)


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
    found: list[Message] = []
    x, speed, begun = 0.0, 2.0, 1_800_000_000.0
    for k in range(round(20 * rate)):
        t = begun + k / rate
        wanted = 2.0 if k < 8 * rate or not obeys else lowered
        speed = max(speed - 1.5 / rate, wanted) if k > 8.3 * rate else speed
        x += speed / rate
        message = odometry(t - late, x, speed * scale, frame)
        found.append((t, "/odom", "nav_msgs/msg/Odometry", message))
    for k in range(200):
        t = begun + 0.1 * k
        value = 2.0 if k < 80 else lowered
        found.append((t, "/speed_limit", "nav2_msgs/msg/SpeedLimit", limit(t, value, percentage)))
    return sorted(found, key=lambda message: message[0])


def seen(messages: list[Message]) -> Seen:
    collector = Collector()
    for at, topic, kind, message in messages:
        collector.take(topic, kind, message, at)
    return collector.seen


def restamped(stamp: float) -> Seen:
    """A drive whose odometry has the same stamp throughout [s]."""
    messages = drive()
    for _, topic, _, message in messages:
        if topic == "/odom":
            message.header = header(stamp, "map")
    return seen(messages)


class _Map:
    def __init__(self, t: float, frame: str) -> None:
        self.header = header(t, frame)


def with_map(told: Seen, age: float = 0.5, frame: str = "map") -> Seen:
    collector = Collector()
    collector.seen = told
    for k in range(20):
        at = 1_800_000_000.0 + k
        collector.take("/elevation_map", "grid_map_msgs/msg/GridMap", _Map(at - age, frame), at)
    return told


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
    "less than plans want": (change(*BASE, to=1.0), "deceleration against the plan"),
    "sign": (change(SMOOTHER, "max_decel", to=[2.0, 0.0, 3.0]), "sign of a deceleration"),
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
    "slow controller": (change(SERVER, "controller_frequency", to=5.0), "rate of the controller"),
}

WHEELS = Wheels(left="l", right="r", radius=0.165)

EDGE_MISTAKES = {
    "own stop too hard": (EdgeSettings(stop=OwnStop(deceleration=6.0)), "the edge's own stop"),
    "own stop too quick": (EdgeSettings(stop=OwnStop(dead_time=0.1)), "the edge's own stop"),
    "wheel radius": (EdgeSettings(wheels=WHEELS), "wheel radius"),
    "short life": (EdgeSettings(timing=Timing(life=0.09, period=0.05)), "life of a limit"),
}

SEEN_MISTAKES = {
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


def named(findings: list[Misfit]) -> set[str]:
    return {finding.check for finding in findings}


@pytest.mark.parametrize("mistake", PARAMETER_MISTAKES)
def test_mistakes_in_parameter_files(tmp_path: Path, mistake: str) -> None:
    nodes = copy.deepcopy(NAV2)
    act, check = PARAMETER_MISTAKES[mistake]
    act(nodes)
    found = examine(Facts(MODEL, EdgeSettings(), parameters(tmp_path, nodes), None))
    assert check in named(found), found
    assert all(f.words and f.remedy for f in found)


@pytest.mark.parametrize("mistake", EDGE_MISTAKES)
def test_mistakes_in_the_edges_settings(tmp_path: Path, mistake: str) -> None:
    edge, check = EDGE_MISTAKES[mistake]
    assert named(examine(Facts(MODEL, edge, parameters(tmp_path, NAV2), None))) == {check}


@pytest.mark.parametrize("mistake", SEEN_MISTAKES)
def test_mistakes_that_show_on_a_drive(mistake: str) -> None:
    make, check = SEEN_MISTAKES[mistake]
    found = examine(Facts(MODEL, None, None, make()))
    assert check in named(found), found


SANE_SEEN = {
    "obeys": lambda: seen(drive()),
    "in odom, connected": lambda: _connected(),
    "slows to a crawl": lambda: with_map(seen(drive(lowered=0.01))),
}


def _connected() -> Seen:
    told = with_map(seen(drive(frame="odom")))
    told.links["odom"] = "map"
    return told


@pytest.mark.parametrize("sane", ["mppi", "dwb", "regulated", *SANE_SEEN])
def test_nothing_is_said_of_robots_that_fit(tmp_path: Path, sane: str) -> None:
    nodes, told = copy.deepcopy(NAV2), None
    if sane == "dwb":
        nodes["controller_server"]["FollowPath"] = {"max_vel_x": 2.0, "decel_lim_x": -1.8}
        nodes["global_costmap"] = {"robot_radius": 1.0}
    elif sane == "regulated":
        nodes["controller_server"]["FollowPath"] = {"desired_linear_vel": 2.0}
        del nodes["twist_mux"], nodes["diff_drive_controller"]
    elif sane in SANE_SEEN:
        told = SANE_SEEN[sane]()
    has_map = told is None or "/elevation_map" in told.topics
    edge = EdgeSettings(wheels=Wheels(left="l", right="r", radius=0.28)) if has_map else None
    assert examine(Facts(MODEL, edge, parameters(tmp_path, nodes), told)) == []


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
def test_the_command_looks_at_a_recording(tmp_path: Path, obeys: bool, status: int) -> None:
    bag = write_bag(tmp_path / "bag", drive(obeys=obeys))
    done = here("doctor", "--bag", str(bag), "--model", "atv", "--json")
    assert done.returncode == status, done.stderr
    result = json.loads(done.stdout)
    assert result["looked_at"] == ["model", "messages"]
    assert [f["check"] for f in result["findings"]] == ([] if obeys else ["limits are not obeyed"])


def test_files_that_cannot_be_used(tmp_path: Path) -> None:
    for text, words in (("a: [", "expected YAML"), ("a: 1\n", "parameters of nodes")):
        file = tmp_path / "p.yaml"
        file.write_text(text)
        with pytest.raises(InputError, match=words):
            read_nav2([file])
    assert here("doctor").returncode == 2
    assert here("doctor", "--live", "1").returncode == 2


def test_names_with_dots_and_namespaces(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text(
        "/r1/controller_server:\n  ros__parameters:\n    controller_plugins: [F]\n"
        "    F.ax_min: -1.0\n    F:\n      vx_max: 2.0\n"
    )
    nav2 = read_nav2([file])
    assert nav2.controllers() == {"F": {"ax_min": -1.0, "vx_max": 2.0}}
    assert all(f.severity is MisfitSeverity.ERROR for f in examine(Facts(MODEL, None, nav2, None)))
