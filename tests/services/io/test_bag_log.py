"""Recordings written by rosbags itself, read back as drive logs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

from slopewise.models.errors import InputError
from slopewise.services.io.drive_log import read_logs
from tests.services.faults import fault_in

rosbags = pytest.importorskip("rosbags", reason="the ros extra is not installed")

from rosbags.rosbag2 import StoragePlugin, Writer  # noqa: E402

from slopewise.services.io.bags import attitude, typestore  # noqa: E402
from tests.services.ros.ros_messages import command, imu, joints, odometry  # noqa: E402

BEGIN = 1_700_000_000_000_000_000  # [ns]
TOPICS = """
[v]
topic = "/odom"
field = "twist.twist.linear.x"
[v_cmd]
topic = "/cmd_vel"
field = "linear.x"
hold = true
[pitch]
topic = "/imu/data"
quaternion = "orientation"
[v_left]
topic = "/joint_states"
joint = "left"
field = "velocity"
scale = 0.28
"""


def messages(speed: float) -> Iterator[tuple[str, str, int, object]]:
    """Speed less 0.5 t at 50 Hz, the stop command at 1 s, pitch 0.1 rad, one wheel at 10 rad/s."""
    for k in range(150):
        t = k / 50
        at = BEGIN + round(1e9 * t)
        yield "/odom", "nav_msgs/msg/Odometry", at, odometry(speed - 0.5 * t)
        if k % 5 == 0:
            twist = command(2.0 if t < 1.0 else 0.0).twist
            yield "/cmd_vel", "geometry_msgs/msg/Twist", at + 1_000_000, twist
            yield "/imu/data", "sensor_msgs/msg/Imu", at, imu(0.1, 0.0)
            wheels = joints(10.0, 3.0, ("right", "left"))
            yield "/joint_states", "sensor_msgs/msg/JointState", at, wheels


def written(
    folder: Path,
    plugin: StoragePlugin = StoragePlugin.MCAP,
    names: Mapping[str, str] = MappingProxyType({}),
    *more: str,
    speed: float = 2.0,
) -> Path:
    """A recording, with other topics; ``more`` get the speed commands, too."""
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        connections = {}
        for topic, kind, at, message in messages(speed):
            for name in (names.get(topic, topic), *(more if topic == "/cmd_vel" else ())):
                if name not in connections:
                    connections[name] = writer.add_connection(name, kind, typestore=typestore())
                writer.write(connections[name], at, typestore().serialize_cdr(message, kind))
    return folder


@pytest.fixture
def topics(tmp_path: Path) -> Path:
    path = tmp_path / "topics.toml"
    path.write_text(TOPICS)
    return path


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_a_recording_is_a_drive_log(tmp_path: Path, topics: Path, plugin: StoragePlugin) -> None:
    bag = written(tmp_path / "drive", plugin)
    inside = next(p for p in bag.iterdir() if p.suffix in (".db3", ".mcap"))
    log = read_logs([bag], topics)
    t = log.columns["t"] - 1e-9 * BEGIN
    assert set(log.columns) == {"run", "t", "v", "v_cmd", "pitch", "v_left"}
    assert set(log.columns["run"]) == {"drive"}
    assert 0.0 < t[0] <= 0.021  # not before the first command
    np.testing.assert_allclose(log.columns["v"], 2.0 - 0.5 * t, atol=1e-6)
    np.testing.assert_allclose(log.columns["pitch"], 0.1, atol=1e-9)
    np.testing.assert_allclose(log.columns["v_left"], 2.8)
    assert float(t[np.argmax(log.columns["v_cmd"] <= 0.0)]) == pytest.approx(1.02, abs=1e-6)
    np.testing.assert_array_equal(read_logs([inside], topics).columns["t"], log.columns["t"])


def test_several_recordings_are_runs(tmp_path: Path, topics: Path) -> None:
    bags = [written(tmp_path / name, speed=speed) for name, speed in (("a", 2.0), ("b", 1.9))]
    assert len(read_logs(bags, topics).runs) == 2


@pytest.mark.parametrize(
    ("old", "new", "field", "message"),
    [
        ('"/odom"', '"/odometry"', "topic /odometry", "expected one of /cmd_vel, /imu/data"),
        ("linear.x", "linear.speed", "topics.toml", "has no speed"),
        ('joint = "left"', 'joint = "middle"', "topics.toml", "expected one of right, left"),
    ],
)
def test_mappings_that_do_not_fit(
    tmp_path: Path, topics: Path, old: str, new: str, field: str, message: str
) -> None:
    topics.write_text(TOPICS.replace(old, new))
    bag = written(tmp_path / "drive")
    with pytest.raises(InputError) as error:
        read_logs([bag], topics)
    assert error.value.source == str(bag)
    assert field in str(error.value)
    assert message in str(error.value)


def test_what_is_no_recording(tmp_path: Path, topics: Path) -> None:
    broken = tmp_path / "drive.mcap"
    broken.write_bytes(b"nothing of the kind")
    with fault_in(broken, "", "expected a ROS 2 recording"):
        read_logs([broken], topics)
    table = tmp_path / "log.csv"
    table.write_text("run,t,v,v_cmd,pitch\n1,0,1,1,0\n")
    with fault_in(table, "", "a table among them"):
        read_logs([broken, table], topics)
    with fault_in(topics, "", "got tables only"):
        read_logs([table], topics)


def test_without_a_mapping_topics_are_guessed_by_type(tmp_path: Path) -> None:
    names = {"/odom": "/ekf/filtered", "/cmd_vel": "/robot/cmd_vel", "/imu/data": "/xsens"}
    log = read_logs([written(tmp_path / "a", StoragePlugin.MCAP, names, "/joystick")])
    assert set(log.columns) == {"run", "t", "v", "v_cmd", "pitch", "roll", "yaw_rate"}
    t = log.columns["t"] - 1e-9 * BEGIN
    np.testing.assert_allclose(log.columns["v"], 2.0 - 0.5 * t, atol=1e-6)
    np.testing.assert_allclose(log.columns["pitch"], 0.1, atol=1e-9)
    np.testing.assert_allclose(log.columns["roll"], 0.0, atol=1e-9)


def test_what_is_not_certain_is_not_guessed(tmp_path: Path) -> None:
    bag = written(tmp_path / "b", StoragePlugin.MCAP, {"/cmd_vel": "/a"}, "/b")
    with pytest.raises(InputError, match=r"v_cmd of .* is not recorded, expected one of /a, /b"):
        read_logs([bag])


@pytest.mark.parametrize("axis", range(3), ids=["roll", "pitch", "yaw"])
def test_a_quaternion_about_one_axis_is_its_angle(axis: int) -> None:
    angles = np.zeros(3)
    angles[axis] = 1.0
    assert attitude(np.cos(0.5), *(np.sin(0.5) * angles)) == pytest.approx(angles.tolist())
