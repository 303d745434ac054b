"""What ROS 2 tells of a drive arrives as samples that the service can learn from."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="the ros extra is not installed")

from slopewise.services.io.bags import typestore
from slopewise.services.ros import conversions as ros
from slopewise.services.ros.inbox import Inbox, Received
from slopewise.services.ros.settings import EdgeSettings, Topics, Wheels
from slopewise.services.ros.vehicle_state import VehicleState
from slopewise.services.wire import codec
from slopewise.services.wire.observations import DriveSamples
from tests.services import grid_maps

TYPES = typestore().types


class Wire:
    """A session and a node that keep what they are given."""

    def __init__(self) -> None:
        self.inbox = Inbox(lambda: 0.0)
        self.sent: list[DriveSamples] = []

    def declare_publisher(self, key: str, **_: Any) -> Wire:
        assert key == "slopewise/robot/v1/obs/drive"
        return self

    def put(self, payload: bytes, encoding: Any) -> None:
        self.sent.append(codec.decode(DriveSamples, payload, str(encoding), "obs", 10**6))

    def subscribe(self, topic: str, kind: str, latched: bool = False) -> str:
        return f"/{topic.strip('/')}"


def vector(x: float = 0.0, z: float = 0.0) -> Any:
    return TYPES["geometry_msgs/msg/Vector3"](x, 0.0, z)


def odometry(speed: float) -> Any:
    pose = TYPES["geometry_msgs/msg/PoseWithCovariance"](grid_maps.pose(), np.zeros(36))
    twist = TYPES["geometry_msgs/msg/Twist"](vector(speed), vector())
    return TYPES["nav_msgs/msg/Odometry"](
        grid_maps.header("odom"),
        "base_link",
        pose,
        TYPES["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36)),
    )


def imu(pitch: float, rate: float) -> Any:
    q = TYPES["geometry_msgs/msg/Quaternion"](0.0, np.sin(pitch / 2), 0.0, np.cos(pitch / 2))
    nine = np.zeros(9)
    return TYPES["sensor_msgs/msg/Imu"](
        grid_maps.header(), q, nine, vector(z=rate), nine, vector(), nine
    )


def command(speed: float) -> Any:
    twist = TYPES["geometry_msgs/msg/Twist"](vector(speed), vector())
    return TYPES["geometry_msgs/msg/TwistStamped"](grid_maps.header(), twist)


def joints(left: float, right: float, names: tuple[str, ...] = ("r", "l")) -> Any:
    return TYPES["sensor_msgs/msg/JointState"](
        grid_maps.header(), list(names), np.zeros(2), np.array([right, left]), np.zeros(2)
    )


def state(wired: Wire) -> VehicleState:
    settings = EdgeSettings(
        topics=Topics(imu="imu", joints="joints", command="cmd_vel"),
        wheels=Wheels(left="l", right="r", radius=0.2),
    )
    return VehicleState(settings, wired, wired)  # type: ignore[arg-type]


def give(vehicle: VehicleState, at: float, **messages: Any) -> None:
    kinds = {
        "odom": ros.ODOMETRY,
        "imu": ros.IMU,
        "joints": ros.JOINTS,
        "cmd_vel": "geometry_msgs/msg/TwistStamped",
        "tf": ros.TRANSFORMS,
        "tf_static": ros.TRANSFORMS,
    }
    store = typestore()
    vehicle.take(
        {
            f"/{name}": [Received(bytes(store.serialize_cdr(message, kinds[name])), at)]
            for name, message in messages.items()
        }
    )


def test_samples_hold_what_was_told() -> None:
    wired = Wire()
    vehicle = state(wired)
    give(vehicle, 9.9, cmd_vel=command(2.0))
    for k in range(50):
        at = 10.0 + 0.02 * k
        if k == 30:
            give(vehicle, at, cmd_vel=command(0.0))
        give(
            vehicle, at, odom=odometry(2.0 - 0.01 * k), imu=imu(0.1, 0.3), joints=joints(9.0, 11.0)
        )
    (message,) = wired.sent
    rows = dict(zip(message.columns, message.values, strict=True))
    np.testing.assert_allclose(rows["t"], 10.0 + 0.02 * np.arange(50))
    np.testing.assert_allclose(rows["v"], 2.0 - 0.01 * np.arange(50))
    np.testing.assert_array_equal(rows["v_cmd"], np.where(np.arange(50) < 30, 2.0, 0.0))
    np.testing.assert_allclose(rows["pitch"], 0.1)
    np.testing.assert_allclose(rows["yaw_rate"], 0.3)
    np.testing.assert_allclose(rows["v_left"], 1.8)
    np.testing.assert_allclose(rows["v_right"], 2.2)


def test_a_sensor_that_is_silent_ends_the_stretch() -> None:
    wired = Wire()
    vehicle = state(wired)
    give(vehicle, 9.9, cmd_vel=command(2.0), joints=joints(9.0, 9.0), imu=imu(0.0, 0.0))
    for k in range(60):
        give(vehicle, 10.0 + 0.02 * k, odom=odometry(2.0), joints=joints(9.0, 9.0))
    (message,) = wired.sent
    assert message.values[0, -1] < 9.9 + 0.5


def test_without_a_stop_command_nothing_is_told() -> None:
    wired = Wire()
    vehicle = state(wired)
    for k in range(80):
        give(vehicle, 0.02 * k, odom=odometry(2.0), imu=imu(0.0, 0.0), joints=joints(9.0, 9.0))
    assert not wired.sent


def test_messages_that_say_nothing_are_counted() -> None:
    wired = Wire()
    vehicle = state(wired)
    give(vehicle, 1.0, odom=odometry(float("nan")))
    assert vehicle.motion(1.0, "odom") == (None, "no odometry")
    give(vehicle, 1.0, joints=joints(1.0, 1.0, ("a", "b")))
    assert "joint l" in wired.inbox.refused["/joints"]
    give(vehicle, 2.0, odom=odometry(1.5))
    motion, why = vehicle.motion(2.1, "odom")
    assert motion is not None
    assert (motion.speed, why) == (1.5, "")
    assert vehicle.motion(2.1, "map") == (None, "expected a transform from odom to map, got none")
    assert vehicle.motion(9.0, "odom") == (
        None,
        "odometry is 7.00 s old (arrival and growth of delay), limit 0.3 s",
    )


def transforms(*links: tuple[str, str, float, float, float]) -> Any:
    """Of (parent, child, x, y, yaw)."""
    stamped = TYPES["geometry_msgs/msg/TransformStamped"]
    return TYPES[ros.TRANSFORMS](
        [
            stamped(
                grid_maps.header(parent),
                child,
                TYPES["geometry_msgs/msg/Transform"](
                    TYPES["geometry_msgs/msg/Vector3"](x, y, 0.0),
                    TYPES["geometry_msgs/msg/Quaternion"](
                        0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)
                    ),
                ),
            )
            for parent, child, x, y, yaw in links
        ]
    )


def test_odometry_is_carried_over_to_the_frame_of_the_paths() -> None:
    """odom is turned by a right angle in map, and world lies 10 m beside map."""
    vehicle = state(Wire())
    give(vehicle, 1.0, tf_static=transforms(("world", "map", 10.0, 0.0, 0.0)))
    give(vehicle, 5.0, tf=transforms(("map", "odom", 3.0, 4.0, np.pi / 2)))
    message = odometry(1.5)
    message.pose.pose.position.x = 2.0
    give(vehicle, 5.0, odom=message)
    for frame, x, y in (("odom", 2.0, 0.0), ("map", 3.0, 6.0), ("/world", 13.0, 6.0)):
        motion, why = vehicle.motion(5.1, frame)
        assert motion is not None, why
        assert (motion.x, motion.y) == pytest.approx((x, y))
        assert motion.heading == pytest.approx(0.0 if frame == "odom" else np.pi / 2)
        assert motion.speed == 1.5
    # A transform that nobody renews is none after a second; the fixed one holds.
    message.header = grid_maps.header("odom", 6, 500_000_000)
    give(vehicle, 6.5, odom=message)
    assert vehicle.motion(6.5, "map") == (None, "expected a transform from odom to map, got none")
    give(vehicle, 6.6, tf=transforms(("map", "odom", 3.0, 4.0, 0.0)), odom=message)
    motion, _ = vehicle.motion(6.6, "world")
    assert motion is not None
    assert motion.x == pytest.approx(15.0)


def test_frames_that_go_round_in_circles_or_are_none() -> None:
    wired = Wire()
    vehicle = state(wired)
    give(vehicle, 1.0, odom=odometry(1.0))
    give(vehicle, 1.0, tf=transforms(("odom", "a", 1.0, 0.0, 0.0), ("a", "odom", 1.0, 0.0, 0.0)))
    assert vehicle.motion(1.0, "map")[0] is None
    give(vehicle, 1.0, tf=transforms(("map", "odom", float("nan"), 0.0, 0.0)))
    assert "finite" in wired.inbox.refused["/tf"]
