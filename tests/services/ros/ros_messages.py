"""Messages of ROS 2 from numbers, and a session that keeps what it is given."""

from __future__ import annotations

from typing import Any

import numpy as np

from slopewise.services.io.bags import typestore
from slopewise.services.ros import conversions as ros
from slopewise.services.ros.inbox import Inbox, Received
from slopewise.services.ros.vehicle_state import VehicleState
from slopewise.services.wire import codec
from slopewise.services.wire.observations import DriveSamples
from tests.services import grid_maps

TYPES = typestore().types
KINDS = {
    "odom": ros.ODOMETRY,
    "imu": ros.IMU,
    "joints": ros.JOINTS,
    "cmd_vel": "geometry_msgs/msg/TwistStamped",
    "tf": ros.TRANSFORMS,
    "tf_static": ros.TRANSFORMS,
}


def header(frame: str, stamp: float = 5.0) -> Any:
    return grid_maps.header(frame, int(stamp), round(1e9 * (stamp % 1.0)))


def vector(x: float = 0.0, z: float = 0.0) -> Any:
    return TYPES["geometry_msgs/msg/Vector3"](x, 0.0, z)


def odometry(speed: float, x: float = 0.0, stamp: float = 5.0, frame: str = "odom") -> Any:
    pose = TYPES["geometry_msgs/msg/PoseWithCovariance"](grid_maps.pose(x), np.zeros(36))
    twist = TYPES["geometry_msgs/msg/Twist"](vector(speed), vector())
    moving = TYPES["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36))
    return TYPES[ros.ODOMETRY](header(frame, stamp), "base_link", pose, moving)


def pose_of(x: float, yaw: float, frame: str) -> Any:
    """Pose as the tools of RViz publish it."""
    pose = TYPES["geometry_msgs/msg/PoseWithCovariance"](grid_maps.pose(x, yaw=yaw), np.zeros(36))
    return TYPES["geometry_msgs/msg/PoseWithCovarianceStamped"](header(frame), pose)


def imu(pitch: float, rate: float) -> Any:
    q = TYPES["geometry_msgs/msg/Quaternion"](0.0, np.sin(pitch / 2), 0.0, np.cos(pitch / 2))
    nine = np.zeros(9)
    return TYPES[ros.IMU](header("map"), q, nine, vector(z=rate), nine, vector(), nine)


def command(speed: float) -> Any:
    twist = TYPES["geometry_msgs/msg/Twist"](vector(speed), vector())
    return TYPES["geometry_msgs/msg/TwistStamped"](header("map"), twist)


def joints(left: float, right: float, names: tuple[str, ...] = ("r", "l")) -> Any:
    speeds = np.array([right, left])
    return TYPES[ros.JOINTS](header("map"), list(names), np.zeros(2), speeds, np.zeros(2))


def transforms(*links: tuple[str, str, float, float, float]) -> Any:
    """Transforms of (parent, child, x, y, yaw)."""
    stamped, messages = TYPES["geometry_msgs/msg/TransformStamped"], []
    for parent, child, x, y, yaw in links:
        shift = TYPES["geometry_msgs/msg/Vector3"](x, y, 0.0)
        turn = grid_maps.pose(yaw=yaw).orientation
        transform = TYPES["geometry_msgs/msg/Transform"](shift, turn)
        messages.append(stamped(header(parent), child, transform))
    return TYPES[ros.TRANSFORMS](messages)


class WireStub:
    """Session and node that keep what they are given."""

    def __init__(self) -> None:
        self.inbox = Inbox(lambda: 0.0)
        self.sent: list[DriveSamples] = []

    def declare_publisher(self, key: str, **_: Any) -> WireStub:
        assert key == "slopewise/robot/v1/obs/drive"
        return self

    def put(self, payload: bytes, encoding: Any) -> None:
        self.sent.append(codec.decode(DriveSamples, payload, str(encoding), "obs", 10**6))

    def subscribe(self, topic: str, kind: str, latched: bool = False) -> str:
        return f"/{topic.strip('/')}"


def give(vehicle: VehicleState, at: float, **messages: Any) -> None:
    """Hand messages over by topic, all of one arrival."""
    store = typestore()
    vehicle.take(
        {
            f"/{name}": [Received(bytes(store.serialize_cdr(message, KINDS[name])), at)]
            for name, message in messages.items()
        }
    )
